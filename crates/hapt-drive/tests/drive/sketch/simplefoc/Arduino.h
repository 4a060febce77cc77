/* Arduino on this computer, as far as SimpleFOC uses it. */
#pragma once
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <algorithm>
using std::max;
using std::min;

#define HIGH 1
#define LOW 0
#define INPUT 0
#define OUTPUT 1
#define INPUT_PULLUP 2
#define CHANGE 1
#define RISING 3
#define FALLING 2
#define A0 14
#define A2 16
#define F(text) (text)
#define PI 3.14159265358979f
#define isDigit(c) ((c) >= '0' && (c) <= '9')
typedef uint8_t byte;
typedef uint16_t word;
struct __FlashStringHelper;
struct StringSumHelper {};
struct Print {
  virtual size_t write(const uint8_t *, size_t) = 0;
  /* Nothing is printed but by the sketch's own write(). */
  template <class... All> void print(All...) {}
  template <class... All> void println(All...) {}
};
struct Port : Print {
  void begin(unsigned long);
  int available();
  int read();
  int availableForWrite();
  size_t write(const uint8_t *, size_t) override;
};
typedef Port Stream;
extern Port Serial;
unsigned long micros(void);
unsigned long millis(void);
void delay(unsigned long);
void delayMicroseconds(unsigned int);
void pinMode(int, int);
void digitalWrite(int, int);
int digitalRead(int);
int analogRead(int);
unsigned long pulseIn(int, int, unsigned long timeout = 0);
int digitalPinToInterrupt(int);
void attachInterrupt(int, void (*)(void), int);
void detachInterrupt(int);
void noInterrupts(void);
void interrupts(void);
