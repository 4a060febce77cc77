// A board on this computer: board.cpp has its port and its time, motor.cpp or simplefoc/motor.cpp the motor with a wheel on it.
#pragma once
#include <stdint.h>

// Of the motor's own time, in s.
static const double STEP = 50e-6;
extern uint64_t now_us;

// Before the sketch's setup(): whether its start works.
void prepare(bool starts);
// After it.
void started();
// A step of the wheel.
void advance();
// The voltage in use, or the current that is controlled.
double applied();
