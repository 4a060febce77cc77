/* The notes' wheel for 10 s at 1 kHz, as one writes it in plain C: the wheel by the exact hold with the torque from the end of
   the step, the puck held, and from `release` on exactly integrated under the held torque with the device's damping.
   -DWORKS=1 adds the works of hand, motor, damping and friction, as hapt always has them. */
#include "bench.h"

enum { COLUMNS = WORKS ? 14 : 10 };

typedef struct {
    double period;
    int samples;
    double inertia, damping, limit, body, stiffness, to;
    int release;
} Parameters;

static void run(const Parameters *p, double *const *column)
{
    const double T = p->period, J = p->inertia, b = p->damping, k = p->stiffness;
    /* The wheel: J_w w'' = k (z - w). */
    const double omega = sqrt(k / p->body), s = sin(omega * T), half = sin(0.5 * omega * T), c1 = -2 * half * half;
    const double from_velocity = s / omega, to_velocity = -s * omega;
    /* The puck: J z'' = torque - b z'. */
    const double a = b / J, x = a * T, decay = expm1(-x);
    const double dv_v = decay, dv_f = -decay / b, dz_v = -decay / a, dz_f = (T + decay / a) / b;
    /* The integral of z'^2: vv v^2 + vf v f + ff f^2. */
    double ff = 0;
    for (double n = 20, term; n >= 3; n--) {
        term = pow(-x, n) / tgamma(n + 1) * (2 - pow(2, n - 1));
        ff += term;
    }
    ff /= a * b * b;
    const double vv = -expm1(-2 * x) / (2 * a), vf = decay * decay / (a * b);

    double z = p->to, v = 0, w = 0, wv = 0, dw = 0, dwv = 0, applied = 0, motor = 0, lost = 0;
    for (int i = 0; i < p->samples; i++) {
        if (i > p->release) {
            double dz = dz_v * v + dz_f * applied;
            if (WORKS) {
                motor += applied * dz;
                lost += b * (v * (vv * v + vf * applied) + ff * applied * applied);
            }
            z += dz;
            v += dv_v * v + dv_f * applied;
        }
        w += dw;
        wv += dwv;
        dw = c1 * (w - z) + from_velocity * wv;
        dwv = to_velocity * (w - z) + c1 * wv;
        double torque = k * (w + dw - z);
        applied = torque > p->limit ? p->limit : torque < -p->limit ? -p->limit : torque;
        column[0][i] = i * T;
        column[1][i] = z;
        column[2][i] = v;
        column[3][i] = z;
        column[4][i] = v;
        column[5][i] = torque;
        column[6][i] = applied;
        column[7][i] = applied;
        column[8][i] = w;
        column[9][i] = wv;
        if (WORKS) {
            column[10][i] = 0;
            column[11][i] = motor;
            column[12][i] = lost;
            column[13][i] = 0;
        }
    }
}

int main(int count, char **word)
{
    if (count != 11)
        return 2;
    Parameters p = {atof(word[1]), atoi(word[2]), atof(word[3]), atof(word[4]), atof(word[5]),
                    atof(word[6]), atof(word[7]), atof(word[8]), atoi(word[9])};
    int repeats = atoi(word[10]);
    double *column[COLUMNS], *times = malloc((size_t)repeats * sizeof *times);
    for (int j = 0; j < COLUMNS; j++)
        column[j] = calloc((size_t)p.samples, sizeof *column[j]);
    for (int r = 0; r < repeats; r++) {
        double start = now();
        run(&p, column);
        times[r] = now() - start;
    }
    print_median(times, repeats, p.samples);
    for (int j = 0; j < COLUMNS; j++) {
        double sum = 0;
        for (int i = 0; i < p.samples; i++)
            sum += fabs(column[j][i]);
        printf("%.17g %.17g\n", sum, column[j][p.samples - 1]);
    }
    return 0;
}
