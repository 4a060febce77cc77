// In place of SimpleFOC: what the sketch uses of it, with a motor that renders its target, and a wheel on it.

#include <math.h>

#include "Arduino.h"
#include "SimpleFOC.h"
#include "board.h"

static const double INERTIA = 6.4e-4, DAMPING = 2e-3;
// 1 V makes 50 mN m, and so does 1 A; a current follows its target in 0.5 ms.
static const double TORQUE_PER_UNIT = 1.0 / 20.0, CURRENT_TIME = 0.5e-3;

static double wheel_rad = 0.0, wheel_rad_s = 0.0, in_use = 0.0;
static bool does_start = true;

void prepare(bool starts) { does_start = starts; }
void started() {}
void advance() {
  wheel_rad_s += STEP / INERTIA * (in_use * TORQUE_PER_UNIT - DAMPING * wheel_rad_s);
  wheel_rad += STEP * wheel_rad_s;
}
double applied() { return in_use; }

SensorConfig AS5600_I2C = {0x36};
MagneticSensorI2C::MagneticSensorI2C(SensorConfig) {}
void MagneticSensorI2C::init() {}
// This sensor counts against the motor's torque.
static double turns() { return -wheel_rad / (2.0 * M_PI); }
float Sensor::getMechanicalAngle() { return (float)(2.0 * M_PI * (turns() - floor(turns()))); }
int32_t Sensor::getFullRotations() { return (int32_t)floor(turns()); }

BLDCDriver3PWM::BLDCDriver3PWM(int, int, int, int) {}
int BLDCDriver3PWM::init() { return 1; }

// As SimpleFOC: a target is taken by move() while the motor is on, and applied by the next loopFOC().
static float setpoint = 0.0f;
static bool senses = false;
BLDCMotor::BLDCMotor(int)
    : torque_controller(TorqueControlType::voltage), voltage_limit(12.0f), current_limit(0.2f), voltage(), current() {}
void BLDCMotor::linkSensor(Sensor *) {}
void BLDCMotor::linkDriver(BLDCDriver3PWM *) {}
void BLDCMotor::linkCurrentSense(InlineCurrentSense *) { senses = true; }
InlineCurrentSense::InlineCurrentSense(float, float, int, int) {}
void InlineCurrentSense::linkDriver(BLDCDriver3PWM *) {}
int InlineCurrentSense::init() { return 1; }
int BLDCMotor::init() { return 1; }
int BLDCMotor::initFOC() {
  enabled = 1;
  sensor_direction = CCW;
  return does_start;
}
void BLDCMotor::enable() { enabled = 1; }
void BLDCMotor::disable() {
  enabled = 0;
  in_use = 0.0;
  this->current.q = 0.0f;
}
void BLDCMotor::move(float target) {
  if (enabled) setpoint = target;
}
void BLDCMotor::loopFOC() {
  if (!enabled) return;
  if (torque_controller == TorqueControlType::voltage) {
    this->voltage.q = fminf(fmaxf(setpoint, -voltage_limit), voltage_limit);
    in_use = this->voltage.q;
  } else if (senses) {
    const float wanted = fminf(fmaxf(setpoint, -current_limit), current_limit);
    this->current.q += (float)(STEP / CURRENT_TIME) * (wanted - this->current.q);
    in_use = this->current.q;
  }
}

extern BLDCMotor motor;
static CommandCallback registered[1];
static char letter = 0;
Commander::Commander(char, bool) {}
void Commander::add(char id, CommandCallback onCommand, const char *) {
  letter = id;
  registered[0] = onCommand;
}
void Commander::run(char *line) {
  if (line[0] == letter) registered[0](line + 1);
  // As where a sketch registers a motor under M: MT sets the type of its control, MC that of its motion.
  if (line[0] == 'M' && line[1] == 'T') motor.torque_controller = (TorqueControlType)(line[2] - '0');
  if (line[0] == 'M' && line[1] == 'C') motor.controller = (MotionControlType)(line[2] - '0');
}
