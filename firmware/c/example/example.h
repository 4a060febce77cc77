#include <stdint.h>

/* The sum of the bits of ten thousand samples. */
uint64_t hapt_example(void);
