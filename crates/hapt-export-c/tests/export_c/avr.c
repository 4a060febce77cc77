/* One world with readings of its own: a hand that moves the puck, and now and then jumps, stands still, or is late. What the C shows of each
 * sample goes out as a hash, the same on a computer and on an ATmega328P under simavr. */

#include <stdio.h>
#include <string.h>
#include "w.c"

#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

static int put(char c, FILE *file)
{
    (void)file;
    loop_until_bit_is_set(UCSR0A, UDRE0);
    UDR0 = c;
    return 0;
}
static FILE serial = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
#endif

static w_controller controller;
static uint32_t hash = 2166136261u, drawn = 1;

static void show(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    hash = (hash ^ bits) * 16777619u;
}

/* From -1 to 1. */
static float next(void)
{
    drawn = drawn * 1664525u + 1013904223u;
    return (float)((int32_t)(drawn >> 8) - 8388608) / 8388608.0f;
}

int main(void)
{
    float position = 0.0f, velocity = 0.0f;
    int k;
#ifdef __AVR__
    UCSR0B = 1 << TXEN0;
    UBRR0 = 0;
    stdout = &serial;
#endif
    w_init(&controller);
    for (k = 0; k < 600; k++) {
        w_reading reading = {0};
        float wild = next();
        velocity = 0.995f * velocity + 0.4f * next();
        position += (wild > 0.99f ? 40.0f : 1.0f) * PERIOD * velocity;
        reading.position = position;
#ifdef EXACT
        reading.velocity = velocity;
#endif
        reading.late = wild < -0.98f ? -2.0f * wild * PERIOD : 0.0f;
        if (k % 80 == 3) {
            w_arm_uncertified(&controller);
        } else if (k % 80 == 79) {
            w_clear(&controller);
        }
        show(w_step_reading(&controller, &reading));
        show((float)controller.phase);
        show((float)controller.reason);
        show(controller.sample.torque);
        show(controller.account);
        show(controller.gain);
        if (k % 100 == 99) {
            printf("%d %08lx\n", k, (unsigned long)hash);
        }
    }
#ifdef __AVR__
    cli();
    sleep_mode();
#endif
    return 0;
}
