/* One sample of a linear world of N bodies with hapt's own matrices: -DN=... The matrix stands by columns, so that gcc can make
   vectors without reordering a sum; the order of the two loops is the one that it makes more of. */
#include "bench.h"

enum { SAMPLES = 4096 };

static struct {
    double period, limit, own[2], springs[N], dampers[N], start[2 * N], from_z[2 * N], from_v[2 * N], matrix[2 * N][2 * N];
    double input[SAMPLES][2];
} world;

static double x[2 * N], change[2 * N];

static double step(double z, double v, double rate)
{
    double next[2 * N], torque = world.own[0] * z + world.own[1] * v;
    for (int i = 0; i < 2 * N; i++) {
        x[i] += change[i];
        next[i] = world.from_z[i] * z + world.from_v[i] * v;
    }
#if N > 16
    for (int j = 0; j < 2 * N; j++)
        for (int i = 0; i < 2 * N; i++)
#else
    for (int i = 0; i < 2 * N; i++)
        for (int j = 0; j < 2 * N; j++)
#endif
            next[i] += world.matrix[j][i] * x[j];
    for (int i = 0; i < 2 * N; i++)
        change[i] = next[i];
    for (int i = 0; i < N; i++)
        torque += world.springs[i] * (x[i] + next[i]) + world.dampers[i] * (next[i] * rate);
    return torque > world.limit ? world.limit : torque < -world.limit ? -world.limit : torque;
}

int main(int count, char **word)
{
    FILE *file = count == 3 ? fopen(word[1], "rb") : NULL;
    if (!file || fread(&world, sizeof world, 1, file) != 1)
        return 2;
    int repeats = atoi(word[2]);
    double sum = 0, rate = 1 / world.period, *times = malloc((size_t)repeats * sizeof *times);
    for (int r = 0; r < repeats; r++) {
        double start = now();
        sum = 0;
        for (int i = 0; i < 2 * N; i++)
            x[i] = world.start[i], change[i] = 0;
        for (int i = 0; i < SAMPLES; i++)
            sum += step(world.input[i][0], world.input[i][1], rate);
        times[r] = now() - start;
    }
    print_median(times, repeats, SAMPLES);
    printf("%.17g\n", sum);
    for (int i = 0; i < N; i++)
        printf("%.17g %.17g\n", x[i], x[N + i]);
    return 0;
}
