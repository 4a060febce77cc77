/* The bus of the angle's sensor. */
#pragma once
#include "Arduino.h"
struct TwoWire {
  void begin() {}
  void beginTransmission(uint8_t) {}
  void write(uint8_t) {}
  uint8_t endTransmission(bool) { return 0; }
  void requestFrom(uint8_t, uint8_t);
  int read();
};
extern TwoWire Wire;
