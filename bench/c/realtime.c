/* A bare loop in real time: sleep until an instant, look at the clock, and nothing else; the same calls of the clock, in the same order,
   as hapt-rt's loop makes. Prints the quantiles of how late it was, in ns. */
#define _GNU_SOURCE
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

static uint64_t ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **word)
{
    if (count != 4)
        return 2;
    uint64_t samples = (uint64_t)atoll(word[1]), period = (uint64_t)atoll(word[2]), spin = (uint64_t)atoll(word[3]);
    struct sched_param priority = {.sched_priority = 80};
    prctl(PR_SET_TIMERSLACK, 1);
    int fifo = pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) == 0;
    if (mlockall(MCL_CURRENT | MCL_FUTURE))
        fprintf(stderr, "memory is not locked\n");
    double *late = calloc(samples, sizeof *late);
    uint64_t due = ns(), taken = 0;
    while (taken < samples) {
        uint64_t now = ns();
        while (now + spin < due) {
            struct timespec at = {(time_t)((due - spin) / 1000000000u), (long)((due - spin) % 1000000000u)};
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
            now = ns();
        }
        while (now < due)
            now = ns();
        uint64_t woken = ns();
        late[taken++] = (double)((woken - due) % period);
        ns();
        now = ns();
        due += period * ((now - due) / period + 1);
    }
    qsort(late, samples, sizeof *late, by_size);
    double at[] = {0.5, 0.9, 0.99, 0.999, 1.0};
    printf("%d", fifo);
    for (int i = 0; i < 5; i++)
        printf(" %.0f", late[(uint64_t)(at[i] * (double)(samples - 1))]);
    printf("\n");
    return 0;
}
