/* Instructions a sample of the C that `hapt export c` writes, w.c, under QEMU's -icount on mps2-an386: bare and supervised, over the trace
   of src/trace.rs, counted as in src/bin/count.rs. It prints whole numbers: ticks of a run with no step, of the bare and the supervised
   step, and of 20 000 instructions; the stack and the size of the controller in bytes; the phase; the sum of the supervised run's bits. */
#include "w.h"

#define SAMPLES 1000u
#define STACK 16384u
#define PATTERN 0xa5a5a5a5u

static w_controller controller;
static w_state bare;

static uint32_t host(uint32_t call, const void *block)
{
    register uint32_t r0 __asm__("r0") = call;
    register const void *r1 __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void print(uint32_t number)
{
    char text[12];
    char *at = text + 11;
    *at = 0;
    *--at = ' ';
    do {
        *--at = (char)('0' + number % 10u);
        number /= 10u;
    } while (number != 0);
    host(4, at);
}

static uint32_t now(void)
{
    return *(volatile uint32_t *)0xe000e018u;
}

static uint32_t between(uint32_t earlier, uint32_t later)
{
    return (earlier - later) & 0xffffffu;
}

static uint32_t rounds(uint32_t count)
{
    const uint32_t start = now();
    __asm__ volatile("2: subs %0, %0, #1\n bne 2b" : "+r"(count) : : "cc");
    return between(start, now());
}

typedef struct {
    uint32_t random;
    float position, step;
} trace;

static void next(trace *self)
{
    self->random = self->random * 1664525u + 1013904223u;
    const float push = (float)(self->random >> 8) / 16777216.0f - 0.5f;
    self->step = (0.999f * self->step - 0.0004f * self->position) + 0.002f * push;
    self->position += self->step;
}

static uint64_t sum;

static void add(float x)
{
    uint32_t bits;
    __builtin_memcpy(&bits, &x, sizeof bits);
    sum = (sum ^ bits) * 0x00000100000001b3ull;
}

static float sample(int kind, const trace *at)
{
    const float velocity = at->step * (1.0f / 1e-3f);
    if (kind == 0) {
        return at->position + velocity;
    }
    if (kind == 1) {
#ifdef EXACT
        return w_state_step(&bare, at->position, velocity).command;
#else
        return w_state_step(&bare, at->position).command;
#endif
    }
    w_reading reading;
    reading.position = at->position;
#ifdef EXACT
    reading.velocity = velocity;
#endif
    reading.late = 0.0f;
    reading.missed = 0;
    reading.silent = 0.0f;
    return w_step_reading(&controller, &reading);
}

static uint32_t run(int kind, uint32_t samples)
{
    trace at = {1, 0.0f, 0.0f};
    volatile float shown;
    const uint32_t start = now();
    for (uint32_t k = 0; k < samples; k++) {
        next(&at);
        shown = sample(kind, &at);
    }
    (void)shown;
    return between(start, now());
}

static uint32_t counted(int kind)
{
    const uint32_t few = run(kind, SAMPLES);
    return run(kind, 2 * SAMPLES) - few;
}

/* The stack that a sample takes below this function's. */
static __attribute__((noinline)) uint32_t stack_of_a_sample(void)
{
    uint32_t *top;
    __asm__ volatile("mov %0, sp" : "=r"(top));
    uint32_t *const bottom = top - STACK / 4;
    trace at = {1, 0.0f, 0.0f};
    for (uint32_t *word = bottom; word < top; word++) {
        *(volatile uint32_t *)word = PATTERN;
    }
    for (uint32_t k = 0; k < 200; k++) {
        next(&at);
        sample(2, &at);
    }
    const uint32_t *word = bottom;
    while (word < top && *(const volatile uint32_t *)word == PATTERN) {
        word++;
    }
    return 4u * (uint32_t)(top - word);
}

/* Apart from reset(), whose first instructions have no floating-point unit. */
static __attribute__((noinline)) void all(void)
{
    uint32_t nothing, alone, supervised;
    trace at = {1, 0.0f, 0.0f};
    *(volatile uint32_t *)0xe000e014u = 0xffffffu;
    *(volatile uint32_t *)0xe000e018u = 0;
    *(volatile uint32_t *)0xe000e010u = 5;
    nothing = counted(0);
    w_state_init(&bare);
    alone = counted(1);
    w_init(&controller);
    w_arm(&controller);
    for (uint32_t k = 0; k < 101; k++) {
        next(&at);
        sample(2, &at);
    }
    supervised = counted(2);
    print(nothing);
    print(alone);
    print(supervised);
    print(rounds(11000) - rounds(1000));
    print(stack_of_a_sample());
    print(sizeof controller);
    print((uint32_t)controller.phase);
    at = (trace){1, 0.0f, 0.0f};
    sum = 0xcbf29ce484222325ull;
    for (uint32_t k = 0; k < SAMPLES; k++) {
        next(&at);
        add(sample(2, &at));
    }
    print((uint32_t)(sum >> 32));
    print((uint32_t)sum);
    host(0x18, (const void *)0x20026);
}

void reset(void)
{
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20;
    __asm__ volatile("dsb\n isb");
    all();
    for (;;) {
    }
}

static void fault(void)
{
    host(0x18, (const void *)0x20023);
    for (;;) {
    }
}

void *memcpy(void *to, const void *from, __SIZE_TYPE__ length)
{
    char *a = to;
    const char *b = from;
    while (length-- > 0) {
        *a++ = *b++;
    }
    return to;
}

void *memset(void *to, int value, __SIZE_TYPE__ length)
{
    char *a = to;
    while (length-- > 0) {
        *a++ = (char)value;
    }
    return to;
}

/* clang's names. */
void __aeabi_memclr4(void *to, __SIZE_TYPE__ length)
{
    memset(to, 0, length);
}

void __aeabi_memclr8(void *to, __SIZE_TYPE__ length)
{
    memset(to, 0, length);
}

void __aeabi_memcpy4(void *to, const void *from, __SIZE_TYPE__ length)
{
    memcpy(to, from, length);
}

void __aeabi_memcpy8(void *to, const void *from, __SIZE_TYPE__ length)
{
    memcpy(to, from, length);
}

__attribute__((section(".vectors"), used)) static void *const vectors[] = {
    (void *)0x20400000u, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault};
