/* The example on ARM's MPS2 board as QEMU has it, with nothing below it: the vector table, the FPU, and semihosting to print. */
#include "example.h"

extern uint32_t stack_top, data_start, data_end, data_stored, bss_start, bss_end;

static int semihosting(int operation, const void *parameter)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void reset(void)
{
    *(volatile uint32_t *)0xe000ed88 |= 0xf << 20; /* CPACR: the FPU on */
    __asm__ volatile("dsb\n isb");
    for (uint32_t *to = &data_start, *from = &data_stored; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;)
        *to++ = 0;

    uint64_t sum = hapt_example();
    char text[18];
    for (int i = 0; i < 16; i++)
        text[i] = "0123456789abcdef"[sum >> (60 - 4 * i) & 15];
    text[16] = '\n', text[17] = 0;
    semihosting(0x04, text);                                 /* SYS_WRITE0 */
    static const uint32_t application_exit[] = {0x20026, 0}; /* code 0 */
    semihosting(0x20, application_exit);                     /* SYS_EXIT_EXTENDED */
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {&stack_top, (const void *)reset};
