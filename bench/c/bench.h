/* What the C programs share: the clock, the median, the way to print. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Prints the median of the times, of one of `parts` each. */
static void print_median(double *times, int repeats, double parts)
{
    qsort(times, (size_t)repeats, sizeof *times, by_size);
    printf("ns %.9g\n", times[repeats / 2] / parts);
}
