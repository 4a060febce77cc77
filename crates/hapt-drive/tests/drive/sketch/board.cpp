// A board on this computer: the sketch, a motor with a wheel on it, and a serial port.
//
// board PORT PERIOD_US OK: in lockstep each query advances the clock by the period; after 50 ms without a byte it is the computer's clock.
// OK 0: the motor's start fails. The first line on standard output says that it has started; each later one is the largest voltage so far
// and the present one; by current it is the current.

#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>
#include <string>

#include "Arduino.h"
#include "SimpleFOC.h"

static const double STEP = 50e-6, INERTIA = 6.4e-4, DAMPING = 2e-3;
// 1 V makes 50 mN m, and so does 1 A; a current follows its target in 0.5 ms.
static const double TORQUE_PER_UNIT = 1.0 / 20.0, CURRENT_TIME = 0.5e-3;

static int port = -1;
static bool starts = true;
static uint64_t now_us = 0;
// The bytes that the sketch may read, and those behind them.
static std::string open_bytes, waiting;
static double wheel_rad = 0.0, wheel_rad_s = 0.0, applied = 0.0, largest = 0.0;

unsigned long micros(void) { return (unsigned long)(uint32_t)now_us; }

Port Serial;
void Port::begin(unsigned long) {}
int Port::available() { return (int)open_bytes.size(); }
int Port::read() {
  const int byte = open_bytes.empty() ? -1 : (unsigned char)open_bytes[0];
  open_bytes.erase(0, 1);
  return byte;
}
int Port::availableForWrite() {
  struct pollfd one = {port, POLLOUT, 0};
  return poll(&one, 1, 0) == 1 && (one.revents & POLLOUT) ? 64 : 0;
}
size_t Port::write(const uint8_t *bytes, size_t count) {
  const ssize_t written = ::write(port, bytes, count);
  return written < 0 ? 0 : (size_t)written;
}

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
BLDCMotor::BLDCMotor(int) : torque_controller(TorqueControlType::voltage), voltage_limit(12.0f), current_limit(0.2f), voltage(), current() {}
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
  return starts;
}
void BLDCMotor::enable() { enabled = 1; }
void BLDCMotor::disable() {
  enabled = 0;
  applied = 0.0;
  this->current.q = 0.0f;
}
void BLDCMotor::move(float target) {
  if (enabled) setpoint = target;
}
void BLDCMotor::loopFOC() {
  if (!enabled) return;
  if (torque_controller == TorqueControlType::voltage) {
    this->voltage.q = fminf(fmaxf(setpoint, -voltage_limit), voltage_limit);
    applied = this->voltage.q;
  } else if (senses) {
    const float wanted = fminf(fmaxf(setpoint, -current_limit), current_limit);
    this->current.q += (float)(STEP / CURRENT_TIME) * (wanted - this->current.q);
    applied = this->current.q;
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

void setup();
void loop();

static void turn() {
  loop();
  static double told = 0.0;
  largest = fmax(largest, fabs(applied));
  if (applied != told) {
    told = applied;
    printf("%.9g %.9g\n", largest, applied);
    fflush(stdout);
  }
}

static void travel(uint64_t us) {
  for (; us >= 50; us -= 50) {
    now_us += 50;
    wheel_rad_s += STEP / INERTIA * (applied * TORQUE_PER_UNIT - DAMPING * wheel_rad_s);
    wheel_rad += STEP * wheel_rad_s;
    turn();
  }
}

static uint64_t clock_us() {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

int main(int count, char **arguments) {
  if (count != 4) return 2;
  port = open(arguments[1], O_RDWR | O_NOCTTY | O_NONBLOCK);
  const uint64_t period = strtoull(arguments[2], nullptr, 10);
  starts = arguments[3][0] != '0';
  if (port < 0) return 2;
  setup();
  puts("started");
  fflush(stdout);
  uint64_t before = clock_us(), quiet = 0;
  for (;;) {
    char bytes[512];
    struct pollfd one = {port, POLLIN, 0};
    if (waiting.empty()) poll(&one, 1, 1);
    const ssize_t got = read(port, bytes, sizeof bytes);
    if (got > 0) waiting.append(bytes, (size_t)got);
    // A pause of the computer is none of the board's.
    const uint64_t now = clock_us(), passed = now - before < 20000 ? now - before : 20000;
    before = now;
    quiet = waiting.empty() ? quiet + passed : 0;
    if (period == 0 || quiet > 50000) travel(passed - passed % 50);
    if (waiting.empty()) continue;
    const size_t end = waiting.find('\n');
    const size_t length = end == std::string::npos ? waiting.size() : end + 1;
    if (period > 0 && waiting.compare(0, 2, "HQ") == 0 && end != std::string::npos) travel(period);
    open_bytes = waiting.substr(0, length);
    waiting.erase(0, length);
    while (!open_bytes.empty()) turn();
  }
}
