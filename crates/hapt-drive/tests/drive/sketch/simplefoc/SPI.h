/* Nothing is on this bus: the names are SimpleFOC's. */
#pragma once
#include "Arduino.h"
#define MSBFIRST 1
#define SPI_MODE0 0
#define SPI_MODE1 1
struct SPISettings {
  SPISettings() {}
  SPISettings(long, int, int) {}
};
struct SPIClass {
  void begin() {}
  void end() {}
  void beginTransaction(SPISettings) {}
  void endTransaction() {}
  uint16_t transfer16(uint16_t) { return 0; }
};
extern SPIClass SPI;
