/* A world in C: ten thousand samples of a puck that is pushed about, and the sum of the bits of all torques. world.h is made by
   `cargo xtask firmware world worlds/notes/default.toml`. */
#include "../hapt.h"
#include "example.h"
#include "world.h"

static struct hapt wheel;

static uint64_t add(uint64_t sum, float x)
{
    /* A union and no memcpy: a freestanding compiler needs no C library. */
    union { float value; uint32_t bits; } both = {x};
    return (sum ^ both.bits) * 0x100000001b3u;
}

uint64_t hapt_example(void)
{
    struct hapt_reading reading = {0};
    uint64_t sum = 0xcbf29ce484222325u;
    float position = 0, step = 0;
    uint32_t random = 1;
    if (hapt_load(&wheel, world, sizeof world) != 0)
        return 0;
    for (int k = 0; k < 10000; k++) {
        random = random * 1664525u + 1013904223u;
        step = 0.999f * step - 0.0004f * position + 0.002f * ((float)(random >> 8) / 16777216.0f - 0.5f);
        position += step;
        reading.position = position;
        reading.velocity = step * 1000.0f;
        reading.request = k == 0 ? HAPT_ARM : HAPT_NOTHING;
        struct hapt_guarded guarded = hapt_guard(&wheel, &reading);
        float velocity, body = hapt_body(&wheel, 0, &velocity);
        sum = add(add(add(add(sum, guarded.output), guarded.torque), body), velocity);
        sum = (sum ^ (uint64_t)guarded.phase) * 0x100000001b3u;
    }
    return sum;
}
