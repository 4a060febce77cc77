// Written as C by hapt: Hapkit, a paddle with an ATmega328P. The puck is the motor's pulley.
//
// Type a to arm, d to disarm, s to stop, c to clear a fault. Nothing moves before a. The loop has to fit into its period: analogRead takes
// 0.1 ms, a step with one spring about 0.6 ms; a late sample is counted, and ends the run as the world says.

#include <@prefix@.h>

const int PWM_PIN = 5, DIRECTION_PIN = 8, SENSOR_PIN = A2;
// The magnetoresistive sensor reads so many steps in half a turn of the pulley, and then begins anew. Measure it: turn slowly, and take the
// largest reading less the smallest. The world's encoder is twice this number a turn.
const int STEPS = 980;
const double STEP = 3.141592653589793 / STEPS;
// @u.torque@ of the motor at full PWM, at rest: measure it, and put it into the world's limit.
const double TORQUE_AT_FULL_PWM = 0.0167;
// A period in microseconds: the world's own.
const unsigned long PERIOD_US = @period_us@UL;

hapt_controller controller;

// The pulley's position in steps since the start, over any number of turns. It must not go a quarter of a turn in a period.
long turned() {
  static int last = -1;
  static long steps = 0;
  const int now = analogRead(SENSOR_PIN);
  if (last >= 0) {
    int way = now - last;
    if (way > STEPS / 2) {
      way -= STEPS;
    } else if (way < -(STEPS / 2)) {
      way += STEPS;
    }
    steps += way;
  }
  last = now;
  return steps;
}

void drive(hapt_real torque) {
  double duty = 255.0 * (double)torque / TORQUE_AT_FULL_PWM;
  digitalWrite(DIRECTION_PIN, duty < 0.0 ? HIGH : LOW);
  duty = duty < 0.0 ? -duty : duty;
  analogWrite(PWM_PIN, duty > 255.0 ? 255 : (int)duty);
}

void setup() {
  pinMode(PWM_PIN, OUTPUT);
  pinMode(DIRECTION_PIN, OUTPUT);
  drive((hapt_real)0);
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
  reading.position = (hapt_real)(turned() * STEP);
//if exact
  // This world takes a measured velocity, which Hapkit does not have: use the estimator "difference" or "low-pass".
  reading.velocity = (hapt_real)0;
//end
  drive(hapt_step_reading(&controller, &reading));
  if (controller.phase != shown) {
    shown = controller.phase;
    Serial.println(hapt_reason_text(controller.reason));
  }
}
