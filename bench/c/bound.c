/* The arithmetic bound of the held wheel: what one sample has to wait for of the one before, x += S x + drift, and nothing else;
   with hapt's arithmetic (no fused multiply-add: it would not give the same bits everywhere). */
#include "bench.h"

int main(int count, char **word)
{
    if (count != 11)
        return 2;
    double T = atof(word[1]), omega = sqrt(atof(word[7]) / atof(word[6])), z = atof(word[8]);
    int samples = atoi(word[2]), repeats = atoi(word[10]);
    double s = sin(omega * T), half = sin(0.5 * omega * T), c1 = -2 * half * half;
    double a = c1, b = s / omega, c = -s * omega, d = c1, drift = -a * z, drift_v = -c * z, last = 0;
    double *times = malloc((size_t)repeats * sizeof *times);
    for (int r = 0; r < repeats; r++) {
        double start = now(), w = 0, v = 0;
        for (int i = 1; i < samples; i++) {
            double dw = (drift + a * w) + b * v, dv = (drift_v + c * w) + d * v;
            w += dw;
            v += dv;
        }
        times[r] = now() - start;
        last = w;
    }
    print_median(times, repeats, samples);
    printf("%.17g\n", last);
    return 0;
}
