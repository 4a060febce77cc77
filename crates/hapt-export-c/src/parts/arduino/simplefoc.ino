// Written as C by hapt: SimpleFOC in torque mode by voltage. Change the pins, the sensor and the driver to those of your board.
//
// Type a to arm, d to disarm, s to stop, c to clear a fault. Nothing moves before a.

#include <SimpleFOC.h>
#include <@prefix@.h>

BLDCMotor motor = BLDCMotor(7);
BLDCDriver3PWM driver = BLDCDriver3PWM(9, 5, 6, 8);
MagneticSensorI2C sensor = MagneticSensorI2C(AS5600_I2C);

// Volts for one @u.torque@: the winding's resistance over the motor's torque constant. Measure it: the torque is wrong by its error.
const double VOLTS_PER_TORQUE = 20.0;
// A period in microseconds: the world's own.
const unsigned long PERIOD_US = @period_us@UL;

hapt_controller controller;

void setup() {
  Serial.begin(115200);
  sensor.init();
  motor.linkSensor(&sensor);
  driver.voltage_power_supply = 12;
  driver.init();
  motor.linkDriver(&driver);
  motor.controller = MotionControlType::torque;
  motor.torque_controller = TorqueControlType::voltage;
  motor.init();
  motor.initFOC();
  hapt_init(&controller);
}

void loop() {
  static unsigned long due = micros();
  static hapt_phase shown = HAPT_PHASE_DISARMED;
  static double volts = 0.0;
  unsigned long late;
  hapt_reading reading;
  // As often as it can: the field follows the rotor. The torque changes once a period.
  motor.loopFOC();
  motor.move((float)volts);
  late = micros() - due;
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
  // Positive in the direction of the motor's torque: the sensor may count the other way.
  reading.position = (hapt_real)((int)motor.sensor_direction * sensor.getAngle());
//if exact
  reading.velocity = (hapt_real)((int)motor.sensor_direction * sensor.getVelocity());
//end
  volts = (double)hapt_step_reading(&controller, &reading) * VOLTS_PER_TORQUE;
  motor.move((float)volts);
  if (controller.phase != shown) {
    shown = controller.phase;
    Serial.println(hapt_reason_text(controller.reason));
  }
}
