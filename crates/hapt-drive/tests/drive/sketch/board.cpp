// The port and the time of a board on this computer, which runs the sketch.
//
// board PORT PERIOD_US OK: in lockstep each query advances the clock by the period; after 50 ms without a byte it is the computer's clock.
// OK 0: the motor's start fails. The first line on standard output says that it has started; each later one is the largest voltage so far
// and the present one; by current it is the current.

#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>
#include <string>

#include "Arduino.h"
#include "board.h"

uint64_t now_us = 0;
static int port = -1;
// The bytes that the sketch may read, and those behind them.
static std::string open_bytes, waiting;

unsigned long micros(void) { return (unsigned long)(uint32_t)now_us; }

Port Serial;
void Port::begin(unsigned long) {}
int Port::available() { return (int)open_bytes.size(); }
int Port::read() {
  const int byte = open_bytes.empty() ? -1 : (unsigned char)open_bytes[0];
  open_bytes.erase(0, 1);
  return byte;
}
int Port::availableForWrite() {
  struct pollfd one = {port, POLLOUT, 0};
  return poll(&one, 1, 0) == 1 && (one.revents & POLLOUT) ? 64 : 0;
}
size_t Port::write(const uint8_t *bytes, size_t count) {
  const ssize_t written = ::write(port, bytes, count);
  return written < 0 ? 0 : (size_t)written;
}

void setup();
void loop();

static void turn() {
  loop();
  static double told = 0.0, largest = 0.0;
  const double now = applied();
  largest = fmax(largest, fabs(now));
  if (now != told) {
    told = now;
    printf("%.9g %.9g\n", largest, now);
    fflush(stdout);
  }
}

static void travel(uint64_t us) {
  for (; us >= 50; us -= 50) {
    now_us += 50;
    advance();
    turn();
  }
}

static uint64_t clock_us() {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

int main(int count, char **arguments) {
  if (count != 4) return 2;
  port = open(arguments[1], O_RDWR | O_NOCTTY | O_NONBLOCK);
  const uint64_t period = strtoull(arguments[2], nullptr, 10);
  if (port < 0) return 2;
  prepare(arguments[3][0] != '0');
  setup();
  started();
  puts("started");
  fflush(stdout);
  uint64_t before = clock_us(), quiet = 0;
  for (;;) {
    char bytes[512];
    struct pollfd one = {port, POLLIN, 0};
    if (waiting.empty()) poll(&one, 1, 1);
    const ssize_t got = ::read(port, bytes, sizeof bytes);
    if (got > 0) waiting.append(bytes, (size_t)got);
    // A pause of the computer is none of the board's.
    const uint64_t now = clock_us(), passed = now - before < 20000 ? now - before : 20000;
    before = now;
    quiet = waiting.empty() ? quiet + passed : 0;
    if (period == 0 || quiet > 50000) travel(passed - passed % 50);
    if (waiting.empty()) continue;
    const size_t end = waiting.find('\n');
    const size_t length = end == std::string::npos ? waiting.size() : end + 1;
    if (period > 0 && waiting.compare(0, 2, "HQ") == 0 && end != std::string::npos) travel(period);
    open_bytes = waiting.substr(0, length);
    waiting.erase(0, length);
    while (!open_bytes.empty()) turn();
  }
}
