// Written as C by hapt: a brushed motor at an H-bridge, with a quadrature encoder on the puck.
//
// Type a to arm, d to disarm, s to stop, c to clear a fault. Nothing moves before a.
// The numbers below are of your device: measure them, and put them into the world file too.

#include <@prefix@.h>

const int ENCODER_A = 2, ENCODER_B = 3;
const int PWM_PIN = 9, DIRECTION_PIN = 8;
// One count of the quadrature in @u.position@: the world's own.
const double COUNT = @count@;
// @u.torque@ at full PWM with the motor at rest: its constant times the supply's voltage over its resistance.
const double TORQUE_AT_FULL_PWM = 0.1;
// A period in microseconds: the world's own.
const unsigned long PERIOD_US = @period_us@UL;

hapt_controller controller;
volatile long counts = 0;

void onEdge() {
  static int last = 0;
  const int now = (digitalRead(ENCODER_A) << 1) | digitalRead(ENCODER_B);
  static const signed char steps[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};
  counts += steps[(last << 2) | now];
  last = now;
}

void drive(hapt_real torque) {
  double duty = 255.0 * (double)torque / TORQUE_AT_FULL_PWM;
  digitalWrite(DIRECTION_PIN, duty < 0.0 ? HIGH : LOW);
  duty = duty < 0.0 ? -duty : duty;
  analogWrite(PWM_PIN, duty > 255.0 ? 255 : (int)duty);
}

void setup() {
  pinMode(ENCODER_A, INPUT_PULLUP);
  pinMode(ENCODER_B, INPUT_PULLUP);
  pinMode(PWM_PIN, OUTPUT);
  pinMode(DIRECTION_PIN, OUTPUT);
  drive((hapt_real)0);
  attachInterrupt(digitalPinToInterrupt(ENCODER_A), onEdge, CHANGE);
  attachInterrupt(digitalPinToInterrupt(ENCODER_B), onEdge, CHANGE);
  Serial.begin(115200);
  hapt_init(&controller);
}

void loop() {
  static unsigned long due = micros();
  static hapt_phase shown = HAPT_PHASE_DISARMED;
  const unsigned long late = micros() - due;
  hapt_reading reading;
  if ((long)late < 0) {
    return;
  }
  while (Serial.available() > 0) {
    switch (Serial.read()) {
      case 'a': hapt_@arm@(&controller); break;
      case 'd': hapt_disarm(&controller); break;
      case 's': hapt_stop(&controller); break;
      case 'c': hapt_clear(&controller); break;
    }
  }
  reading.missed = late / PERIOD_US;
  reading.late = (hapt_real)((late % PERIOD_US) * 1e-6);
  reading.silent = (hapt_real)0;
  due += (reading.missed + 1) * PERIOD_US;
  noInterrupts();
  const long count = counts;
  interrupts();
  reading.position = (hapt_real)(count * COUNT);
//if exact
  // This world takes a measured velocity: put your device's here.
  reading.velocity = (hapt_real)0;
//end
  drive(hapt_step_reading(&controller, &reading));
  if (controller.phase != shown) {
    shown = controller.phase;
    Serial.println(hapt_reason_text(controller.reason));
  }
}
