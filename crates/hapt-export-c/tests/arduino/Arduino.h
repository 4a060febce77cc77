/* The names of Arduino that the sketches use. */
#include <stdint.h>
#include <stddef.h>
#if __has_include(<string.h>)
#include <string.h>
#else
extern "C" void *memcpy(void *, const void *, size_t);
#endif
#define INPUT_PULLUP 2
#define OUTPUT 1
#define HIGH 1
#define LOW 0
#define CHANGE 1
#define A0 14
#define A2 16
int analogRead(int);
unsigned long micros(void);
void pinMode(int, int);
void digitalWrite(int, int);
int digitalRead(int);
void analogWrite(int, int);
int digitalPinToInterrupt(int);
void attachInterrupt(int, void (*)(void), int);
void noInterrupts(void);
void interrupts(void);
struct Port {
  void begin(unsigned long);
  int available();
  int read();
  int availableForWrite();
  size_t write(const uint8_t *, size_t);
  void println(const char *);
};
extern Port Serial;
