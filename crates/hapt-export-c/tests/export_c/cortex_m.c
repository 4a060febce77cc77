/* The program's input and output on a Cortex-M under QEMU: the files `in` and `out`, by semihosting, a sample at a time. */

#include <stddef.h>
#include <stdint.h>

static unsigned char room_out[1024];
static size_t length_out;
static long in, out;

static long host(long call, const void *block)
{
    register long r0 __asm__("r0") = call;
    register const void *r1 __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void *memcpy(void *to, const void *from, size_t length)
{
    unsigned char *a = to;
    const unsigned char *b = from;
    while (length-- > 0) {
        *a++ = *b++;
    }
    return to;
}

void *memset(void *to, int value, size_t length)
{
    unsigned char *a = to;
    while (length-- > 0) {
        *a++ = (unsigned char)value;
    }
    return to;
}

static long file(const char *name, size_t length, uintptr_t mode)
{
    uintptr_t opened[3];
    opened[0] = (uintptr_t)name;
    opened[1] = mode;
    opened[2] = length;
    return host(1, opened);
}

static void flush(void)
{
    uintptr_t moved[3];
    moved[0] = (uintptr_t)out;
    moved[1] = (uintptr_t)room_out;
    moved[2] = length_out;
    host(5, moved);
    length_out = 0;
}

static int get(double *numbers, size_t length)
{
    uintptr_t moved[3];
    moved[0] = (uintptr_t)in;
    moved[1] = (uintptr_t)numbers;
    moved[2] = length;
    return host(6, moved) == 0;
}

static void put(double x)
{
    if (length_out + sizeof x > sizeof room_out) {
        flush();
    }
    memcpy(room_out + length_out, &x, sizeof x);
    length_out += sizeof x;
}

/* Apart from reset(), whose first instructions have no floating-point unit. */
int main(void) __attribute__((noinline));

void reset(void)
{
#ifdef __ARM_FP
    /* The floating-point unit, before it is used. */
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20;
    __asm__ volatile("dsb\n isb");
#endif
    in = file("in", 2, 1);
    out = file("out", 3, 5);
    main();
    flush();
    uintptr_t closed[1];
    closed[0] = (uintptr_t)out;
    host(2, closed);
    host(0x18, (const void *)0x20026);
    for (;;) {
    }
}

static void fault(void)
{
    /* An error: QEMU ends with another code. */
    host(0x18, (const void *)0x20023);
    for (;;) {
    }
}

extern char stack_top[];
__attribute__((section(".vectors"), used)) static void *const vectors[] = {
    stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault};
