/* The example on a PC: gcc wheel.c pc.c libhapt.a */
#include "example.h"

#include <stdio.h>

int main(void)
{
    printf("%016llx\n", (unsigned long long)hapt_example());
    return 0;
}
