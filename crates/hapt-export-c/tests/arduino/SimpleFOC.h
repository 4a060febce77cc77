/* The names of SimpleFOC that the sketches use. A program on a computer defines them in its own way. */
#include <stdint.h>
enum Direction : int8_t { CW = 1, CCW = -1, UNKNOWN = 0 };
/* Enumerations without a scope: a sketch may not take their names for its own. */
enum Quadrature : uint8_t { ON = 0, OFF = 1 };
enum Pullup : uint8_t { USE_INTERN, USE_EXTERN };
enum MotionControlType : uint8_t { torque, velocity, angle, velocity_openloop, angle_openloop, angle_nocascade, custom };
enum TorqueControlType : uint8_t { voltage, dc_current, foc_current, estimated_current };
struct SensorConfig { int address; };
extern SensorConfig AS5600_I2C;
struct Sensor {
  float getAngle();
  float getVelocity();
  float getMechanicalAngle();
  int32_t getFullRotations();
};
struct MagneticSensorI2C : Sensor {
  explicit MagneticSensorI2C(SensorConfig);
  void init();
};
struct BLDCDriver3PWM {
  BLDCDriver3PWM(int, int, int, int);
  float voltage_power_supply;
  int init();
};
struct InlineCurrentSense {
  InlineCurrentSense(float, float, int, int);
  void linkDriver(BLDCDriver3PWM *);
  int init();
};
struct DQ { float d, q; };
struct BLDCMotor {
  explicit BLDCMotor(int);
  void linkSensor(Sensor *);
  void linkDriver(BLDCDriver3PWM *);
  void linkCurrentSense(InlineCurrentSense *);
  int init();
  int initFOC();
  void loopFOC();
  void move(float);
  void enable();
  void disable();
  MotionControlType controller;
  TorqueControlType torque_controller;
  Direction sensor_direction;
  float voltage_limit, current_limit;
  DQ voltage, current;
  int8_t enabled;
};
typedef void (*CommandCallback)(char *);
struct Commander {
  explicit Commander(char eol = '\n', bool echo = false);
  void add(char id, CommandCallback onCommand, const char *label = nullptr);
  void run(char *line);
};
