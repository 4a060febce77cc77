/* The program's input and output on a Cortex-M4F under QEMU: the files `in` and `out`, by semihosting. */

#include <stddef.h>
#include <stdint.h>

#define ROOM (2u << 20)

static unsigned char room_in[ROOM / 2], room_out[ROOM];
static size_t length_in, at_in, length_out;

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

static int get(double *in, size_t length)
{
    if (at_in + length > length_in) {
        return 0;
    }
    memcpy(in, room_in + at_in, length);
    at_in += length;
    return 1;
}

static void put(double x)
{
    if (length_out + sizeof x <= ROOM) {
        memcpy(room_out + length_out, &x, sizeof x);
        length_out += sizeof x;
    }
}

int main(void);

void reset(void)
{
    uintptr_t opened[3] = {(uintptr_t)"in", 1, 2}, moved[3] = {0, (uintptr_t)room_in, sizeof room_in};
    /* The floating-point unit, before it is used. */
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20;
    __asm__ volatile("dsb\n isb");
    moved[0] = (uintptr_t)host(1, opened);
    length_in = sizeof room_in - (size_t)host(6, moved);
    main();
    opened[0] = (uintptr_t)"out";
    opened[1] = 5;
    opened[2] = 3;
    moved[0] = (uintptr_t)host(1, opened);
    moved[1] = (uintptr_t)room_out;
    moved[2] = length_out;
    host(5, moved);
    host(2, moved);
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

__attribute__((section(".vectors"), used)) static void *const vectors[] = {(void *)0x20400000u, (void *)reset, (void *)fault, (void *)fault,
                                                                          (void *)fault,        (void *)fault, (void *)fault};
