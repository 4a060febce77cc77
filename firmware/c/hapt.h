/* hapt's loop and supervisor for firmware in C: link libhapt.a. No heap, no files, no clock; single precision.

   A struct hapt is all that there is: make one static (zeros), load a world into it, and call hapt_guard once a sample, from the timer's
   interrupt. Everything is SI: rad, rad/s, N m, s; in linear worlds m, m/s, N. One call at a time for one struct. */
#ifndef HAPT_H
#define HAPT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A world, its state, and its supervisor. What is inside is nobody's business. */
struct hapt {
    uint64_t room[512];
};

/* What the supervisor may be asked for with a reading. A stop counts whatever else is going on. HAPT_FAULT tells it that the motor's driver
   has switched itself off, as for too much current: at each sample for as long as that lasts. It takes a clear to go on. */
enum { HAPT_NOTHING, HAPT_ARM, HAPT_DISARM, HAPT_STOP, HAPT_CLEAR, HAPT_FAULT };

/* Where it stands. */
enum { HAPT_DISARMED, HAPT_FADING_IN, HAPT_RUNNING, HAPT_FADING_OUT, HAPT_FAULTED };

/* What the device says at one sample. */
struct hapt_reading {
    float position;       /* of the puck */
    float velocity;       /* of the puck, where the world's estimator is "exact"; else 0 */
    float late;           /* s after its instant that the sample is taken */
    float silent;         /* s since whoever holds the link was heard; 0 where there is no link */
    unsigned int missed;  /* samples since the last */
    unsigned int request; /* HAPT_NOTHING and so on */
};

/* What the motor is to hold, and why. */
struct hapt_guarded {
    float output; /* torque for the motor: faded, limited, 0 unless armed */
    float torque; /* the couplings', before levels, limit and supervisor */
    int phase;    /* HAPT_DISARMED and so on */
    int reason;   /* of a fault, as in docs/safety.md; 0: none */
};

/* Compiles a world from the bytes that a board is sent (docs/wire.md), and starts it, disarmed. 0: done; -1: the bytes are no world of
   this version, or one too large (4 bodies, 8 couplings, a window of 16); -2: its numbers are out of range. What ran before goes on
   after an error. Takes milliseconds, and about 20 KiB of stack. */
int hapt_load(struct hapt *hapt, const uint8_t *bytes, size_t length);

/* One sample under the supervisor. All zeros where no world is loaded. */
struct hapt_guarded hapt_guard(struct hapt *hapt, const struct hapt_reading *reading);

/* One sample without it, for tests and simulations: the torque after levels and limit. Not for motors. */
float hapt_step(struct hapt *hapt, float position, float velocity);

/* Position of a body, from 0, as of the last sample; its velocity too where there is a place for it. */
float hapt_body(struct hapt *hapt, unsigned int body, float *velocity);

#ifdef __cplusplus
}
#endif
#endif
