// The hardware under SimpleFOC itself: a driver of three phases at 12 V, a motor of 7 pairs of poles with a wheel on it, an AS5600 that counts
// against the motor's torque, and shunts in two phases.

#include "Arduino.h"
#include "SPI.h"
#include "SimpleFOC.h"
#include "Wire.h"
#include "board.h"

extern BLDCMotor motor;
extern Commander commander;

static const double SUPPLY = 12.0, RESISTANCE = 1.0, INDUCTANCE = 0.5e-3, TORQUE_CONSTANT = 0.05, POLES = 7.0;
// While SimpleFOC looks for the field a hand damps the wheel.
static const double INERTIA = 6.4e-4, HELD = 0.08, DAMPING = 2e-3;
static const int ENABLE = 8;
static const double SHUNT = 0.01, GAIN = 50.0, MIDDLE = 1.65;

static double wheel_rad = 0.0, wheel_rad_s = 0.0, damping = HELD;
// Currents in the rotor's axes, and the duties.
static double current_d = 0.0, current_q = 0.0, duty[3] = {0.0, 0.0, 0.0};
static bool is_on = false, is_sensed = true;

void prepare(bool starts) { is_sensed = starts; }

void started() {
  damping = DAMPING;
  // As in SimpleFOC's own examples.
  commander.add('M', [](char *line) { commander.motor(&motor, line); });
}

void advance() {
  const double angle = POLES * wheel_rad, c = cos(angle), s = sin(angle);
  const double mean = (duty[0] + duty[1] + duty[2]) / 3.0;
  const double alpha = SUPPLY * (duty[0] - mean), beta = (alpha + 2.0 * SUPPLY * (duty[1] - mean)) / sqrt(3.0);
  const double d = alpha * c + beta * s, q = beta * c - alpha * s;
  const double speed = POLES * wheel_rad_s;
  const int parts = 5;
  for (int i = 0; i < parts && is_on; i++) {
    const double step = STEP / parts / INDUCTANCE;
    const double last = current_d;
    current_d += step * (d - RESISTANCE * current_d + speed * INDUCTANCE * current_q);
    current_q += step * (q - RESISTANCE * current_q - speed * INDUCTANCE * last - TORQUE_CONSTANT * wheel_rad_s);
  }
  if (!is_on) current_d = current_q = 0.0;
  wheel_rad_s += STEP / INERTIA * (TORQUE_CONSTANT * current_q - damping * wheel_rad_s);
  wheel_rad += STEP * wheel_rad_s;
}

double applied() {
  if (!is_on || !motor.enabled) return 0.0;
  return motor.torque_controller == TorqueControlType::voltage ? motor.voltage.q : motor.current_sp;
}

unsigned long millis(void) { return micros() / 1000; }
void delayMicroseconds(unsigned int time) {
  for (unsigned int us = 0; us < time; us += 50) {
    now_us += 50;
    advance();
  }
}
void delay(unsigned long time) { delayMicroseconds((unsigned int)time * 1000); }

void digitalWrite(int pin, int level) {
  if (pin == ENABLE) is_on = level;
}
void pinMode(int, int) {}
int digitalRead(int) { return 0; }
int analogRead(int) { return 0; }

void *_configure3PWM(long, const int, const int, const int) { return duty; }
void _writeDutyCycle3PWM(float a, float b, float c, void *) {
  duty[0] = a;
  duty[1] = b;
  duty[2] = c;
}

void *_configureADCInline(const void *, const int, const int, const int) { return duty; }
float _readADCVoltageInline(const int pin, const void *) {
  const double angle = POLES * wheel_rad - (pin == A0 ? 0.0 : 2.0 * M_PI / 3.0);
  return (float)(MIDDLE + SHUNT * GAIN * (current_d * cos(angle) - current_q * sin(angle)));
}

TwoWire Wire;
SPIClass SPI;
static int angle_counts = 0, read_bytes = 0;
void TwoWire::requestFrom(uint8_t, uint8_t) {
  const double turns = is_sensed ? -wheel_rad / (2.0 * M_PI) : 0.0;
  angle_counts = (int)(4096.0 * (turns - floor(turns)));
  read_bytes = 0;
}
int TwoWire::read() { return read_bytes++ == 0 ? angle_counts >> 8 & 15 : angle_counts & 255; }
