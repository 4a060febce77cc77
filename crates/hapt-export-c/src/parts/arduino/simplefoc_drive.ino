// Written as C by hapt: SimpleFOC as a motor drive. The loop runs on the computer, by hapt run --device simplefoc:PATH?volts-per-torque=V,
// and this board renders its torque. Change the pins, the sensor and the driver to those of your board, and LIMIT to what your motor bears.
// A board that measures its currents can control them: ?torque-constant=K in the address, and 1 here.
#ifndef BY_CURRENT
#define BY_CURRENT 0
#endif
//
// A line goes through SimpleFOC's Commander under the letter H, and has one answer. The motor is off from the start on. It is on while a
// target arrives in the time that the computer has set, and else off until the computer stops it and switches it on again.

#include <SimpleFOC.h>

BLDCMotor motor = BLDCMotor(7);
BLDCDriver3PWM driver = BLDCDriver3PWM(9, 5, 6, 8);
MagneticSensorI2C sensor = MagneticSensorI2C(AS5600_I2C);
#if BY_CURRENT
// The shunts' resistance in ohm, the gain of their amplifiers, and the pins of two phases.
InlineCurrentSense current_sense = InlineCurrentSense(0.01f, 50.0f, A0, A2);
#endif
// Without a port of its own: it prints nothing, and the sketch reads the lines.
Commander commander = Commander();

// The speed of the line: @BAUD in the computer's address. A port on USB has any.
const unsigned long BAUD = 921600;
// The largest target: volts where the torque is controlled by voltage, else amperes.
const float LIMIT = 3.0f;

// The version of the line, and its states.
const uint8_t VERSION = 1;
const uint8_t STATE_OFF = 0, STATE_ON = 1, STATE_EXPIRED = 2, STATE_REFUSED = 3, STATE_FAILED = 4;
// The longest line, without its newline: what Commander takes.
const uint8_t LONGEST = 19;
// Bytes read in one turn of loop(): the motor does not wait for a line.
const uint8_t AT_ONCE = 40;

uint8_t state = STATE_FAILED;
float target = 0.0f;
// The largest target of this session.
float ceiling = 0.0f;
// The number of the last target, or of the line that switched the motor on.
uint8_t last = 0;
unsigned long watchdog = 0, fed = 0;
// The unit since the start.
char unit = '?';

// What SimpleFOC controls now: volts, measured amperes, estimated ones (E), or no torque (?).
char controlled() {
  if (motor.controller != MotionControlType::torque) {
    return '?';
  }
  switch (motor.torque_controller) {
    case TorqueControlType::voltage: return 'V';
    case TorqueControlType::dc_current:
    case TorqueControlType::foc_current: return 'A';
    default: return 'E';
  }
}

void off(uint8_t why) {
  target = 0.0f;
  // Forgets the last target too: SimpleFOC keeps it up to the next move().
  motor.move(0.0f);
  motor.disable();
  state = why;
}

void on(uint8_t number, unsigned long time) {
  target = 0.0f;
  motor.enable();
  motor.move(0.0f);
  last = number;
  watchdog = time;
  fed = micros();
  state = STATE_ON;
}

// CRC-16/IBM-3740.
uint16_t crc(uint16_t sum, uint8_t next) {
  sum ^= (uint16_t)((uint16_t)next << 8);
  for (uint8_t i = 0; i < 8; i++) {
    sum = (uint16_t)((sum & 0x8000u) ? ((sum << 1) ^ 0x1021u) : (sum << 1));
  }
  return sum;
}

// 16: it is no digit.
uint8_t digit(char c) {
  if (c >= '0' && c <= '9') {
    return (uint8_t)(c - '0');
  }
  return c >= 'A' && c <= 'F' ? (uint8_t)(c - 'A' + 10) : 16;
}

float number(const uint8_t *bytes) {
  const uint32_t bits = ((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | bytes[3];
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

void put(uint8_t *bytes, float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  for (uint8_t i = 0; i < 4; i++) {
    bytes[i] = (uint8_t)(bits >> (24 - 8 * i));
  }
}

void send(char kind, const uint8_t *data, uint8_t length) {
  static const char digits[] = "0123456789ABCDEF";
  uint8_t line[40];
  uint8_t filled = 0;
  line[filled++] = 'h';
  line[filled++] = (uint8_t)kind;
  for (uint8_t i = 0; i < length; i++) {
    line[filled++] = (uint8_t)digits[data[i] >> 4];
    line[filled++] = (uint8_t)digits[data[i] & 15];
  }
  uint16_t sum = 0xffff;
  for (uint8_t i = 0; i < filled; i++) {
    sum = crc(sum, line[i]);
  }
  for (int8_t shift = 12; shift >= 0; shift -= 4) {
    line[filled++] = (uint8_t)digits[(sum >> shift) & 15];
  }
  line[filled++] = '\n';
  // Without room the answer is lost: the motor does not wait for the computer.
  if (Serial.availableForWrite() >= filled) {
    Serial.write(line, filled);
  }
}

void answer(char kind, uint8_t to) {
  // Positive in the direction of the motor's torque.
  const int sign = (int)motor.sensor_direction < 0 ? -1 : 1;
  const float angle = (float)sign * sensor.getMechanicalAngle();
  const long counted = (long)sensor.getFullRotations() * sign;
  const long turns = counted > 32767L ? 32767L : counted < -32767L ? -32767L : counted;
  const float measured = state != STATE_ON ? 0.0f : unit == 'V' ? motor.voltage.q : motor.current.q;
  uint8_t data[13] = {to, state, last, (uint8_t)((uint16_t)turns >> 8), (uint8_t)turns};
  put(data + 5, angle);
  put(data + 9, measured);
  send(kind, data, 13);
}

void answerVersion(uint8_t to) {
  uint8_t data[8] = {to, VERSION, (uint8_t)unit, state};
  put(data + 4, LIMIT);
  send('V', data, 8);
}

void execute(char kind, const uint8_t *data, uint8_t length) {
  if (kind == 'V' && length == 1) {
    answerVersion(data[0]);
    return;
  } else if (kind == 'Q' && length == 1) {
    // The position alone: it feeds no watchdog.
  } else if (kind == 'S' && length == 1) {
    if (state != STATE_FAILED) {
      off(STATE_OFF);
    }
  } else if (kind == 'L' && length == 5) {
    const float wanted = number(data + 1);
    // A NaN is within no range.
    if (state == STATE_ON || (state == STATE_OFF && !(wanted >= 0.0f && wanted <= LIMIT))) {
      off(STATE_REFUSED);
    } else if (state == STATE_OFF) {
      ceiling = wanted;
    }
  } else if (kind == 'E' && length == 3) {
    const unsigned long time = 100UL * (((unsigned long)data[1] << 8) | data[2]);
    if (state == STATE_OFF && time > 0 && (unit == 'V' || unit == 'A')) {
      on(data[0], time);
    }
  } else if (kind == 'T' && length == 5) {
    const float wanted = number(data + 1);
    if (state == STATE_ON && !(wanted >= -ceiling && wanted <= ceiling)) {
      off(STATE_REFUSED);
    } else if (state == STATE_ON) {
      target = wanted;
      last = data[0];
      fed = micros();
    }
  } else {
    return;
  }
  answer(kind, data[0]);
}

// What stands behind the H: a kind, bytes in hexadecimal digits, the checksum. Anything else is no line: it has no answer and no effect.
void onLine(char *line) {
  uint8_t data[9];
  uint8_t length = 1;
  while (length < LONGEST && digit(line[length]) < 16) {
    length++;
  }
  if (line[0] < 'A' || line[0] > 'Z' || line[length] != '\n' || length % 2 == 0 || length < 7) {
    return;
  }
  uint16_t sum = crc(0xffff, 'H');
  for (uint8_t i = 0; i + 4 < length; i++) {
    sum = crc(sum, (uint8_t)line[i]);
  }
  const uint8_t bytes = (uint8_t)((length - 1) / 2);
  for (uint8_t i = 0; i < bytes; i++) {
    data[i] = (uint8_t)((digit(line[1 + 2 * i]) << 4) | digit(line[2 + 2 * i]));
  }
  if (((uint16_t)data[bytes - 2] << 8 | data[bytes - 1]) == sum) {
    execute(line[0], data, (uint8_t)(bytes - 2));
  }
}

// Commander's own reading takes the end of a line that is too long for a new one, and reads on while bytes arrive.
void receive() {
  static char line[LONGEST + 2];
  static uint8_t filled = 0;
  for (uint8_t i = 0; i < AT_ONCE && Serial.available() > 0; i++) {
    const char c = (char)Serial.read();
    if (c != '\n') {
      if (filled < LONGEST) {
        line[filled] = c;
      }
      filled = filled > LONGEST ? filled : (uint8_t)(filled + 1);
      continue;
    }
    if (filled <= LONGEST) {
      line[filled] = '\n';
      line[filled + 1] = '\0';
      commander.run(line);
    }
    filled = 0;
  }
}

void guard() {
  // A target would have another unit: another command has changed it.
  if (controlled() != unit) {
    off(STATE_FAILED);
  }
  if (state != STATE_ON) {
    return;
  }
  if (micros() - fed > watchdog) {
    off(STATE_EXPIRED);
  } else if (!motor.enabled) {
    off(STATE_FAILED);
  }
}

void setup() {
  Serial.begin(BAUD);
  sensor.init();
  motor.linkSensor(&sensor);
  driver.voltage_power_supply = 12;
  driver.init();
  motor.linkDriver(&driver);
  motor.controller = MotionControlType::torque;
#if BY_CURRENT
  motor.torque_controller = TorqueControlType::foc_current;
  motor.current_limit = LIMIT;
  motor.init();
  current_sense.linkDriver(&driver);
  current_sense.init();
  motor.linkCurrentSense(&current_sense);
#else
  motor.torque_controller = TorqueControlType::voltage;
  motor.voltage_limit = LIMIT;
  motor.init();
#endif
  const int found = motor.initFOC();
  unit = controlled();
  off(found ? STATE_OFF : STATE_FAILED);
  commander.add('H', onLine, "hapt");
}

void loop() {
  motor.loopFOC();
  motor.move(target);
  receive();
  guard();
}
