/* The sweep of `cargo xtask bench` as one writes it in C to be fast: the notes' wheel for a second, stepped and held or let go, over a
   grid of stiffnesses and inertias. Sixteen worlds side by side in arrays that gcc vectorises, OpenMP over them, a CSV at the end.
   Arguments: T, samples, J_z, b, limit, z0, the sample of the release, k from, k to, n, J_w from, J_w to, n, the file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 16 };

typedef struct {
    double period;
    int samples;
    double inertia, damping, limit, to;
    int release;
} Device;

static void run(const Device *p, const double *restrict k, const double *restrict body, double *restrict peak,
                double *restrict energy)
{
    const double T = p->period, J = p->inertia, b = p->damping, limit = p->limit;
    const double a = b / J, decay = expm1(-a * T);
    const double dv_v = decay, dv_f = -decay / b, dz_v = -decay / a, dz_f = (T + decay / a) / b;
    double c1[SIDE], from_velocity[SIDE], to_velocity[SIDE];
    double z[SIDE], v[SIDE], w[SIDE], wv[SIDE], dw[SIDE], dwv[SIDE], applied[SIDE], most[SIDE];
    for (int i = 0; i < SIDE; i++) {
        const double omega = sqrt(k[i] / body[i]), s = sin(omega * T), half = sin(0.5 * omega * T);
        c1[i] = -2 * half * half, from_velocity[i] = s / omega, to_velocity[i] = -s * omega;
        z[i] = p->to, v[i] = w[i] = wv[i] = dw[i] = dwv[i] = applied[i] = most[i] = 0;
    }
    for (int n = 0; n < p->samples; n++) {
        if (n > p->release)
            for (int i = 0; i < SIDE; i++) {
                z[i] += dz_v * v[i] + dz_f * applied[i];
                v[i] += dv_v * v[i] + dv_f * applied[i];
            }
        for (int i = 0; i < SIDE; i++) {
            w[i] += dw[i];
            wv[i] += dwv[i];
            dw[i] = c1[i] * (w[i] - z[i]) + from_velocity[i] * wv[i];
            dwv[i] = to_velocity[i] * (w[i] - z[i]) + c1[i] * wv[i];
            const double torque = k[i] * (w[i] + dw[i] - z[i]);
            most[i] = fmax(most[i], fabs(torque));
            applied[i] = fmin(fmax(torque, -limit), limit);
        }
    }
    for (int i = 0; i < SIDE; i++) {
        peak[i] = most[i];
        energy[i] = 0.5 * body[i] * wv[i] * wv[i] + 0.5 * k[i] * (z[i] - w[i]) * (z[i] - w[i]);
    }
}

static double at(double from, double to, int n, int i)
{
    return i == 0 ? from : i == n - 1 ? to : from + i * (to - from) / (n - 1);
}

int main(int count, char **word)
{
    if (count != 15)
        return 2;
    const Device p = {atof(word[1]), atoi(word[2]), atof(word[3]), atof(word[4]), atof(word[5]), atof(word[6]), atoi(word[7])};
    const double k0 = atof(word[8]), k1 = atof(word[9]), j0 = atof(word[11]), j1 = atof(word[12]);
    const int nk = atoi(word[10]), nj = atoi(word[13]), cells = nk * nj, room = (cells + SIDE - 1) / SIDE * SIDE;
    double *table = malloc((size_t)room * 4 * sizeof *table), *k = table, *body = table + room, *peak = table + 2 * room,
           *energy = table + 3 * room;
    FILE *out = fopen(word[14], "w");
    if (!out || !table)
        return 3;
#pragma omp parallel for schedule(dynamic, 16)
    for (int block = 0; block < room; block += SIDE) {
        for (int i = block; i < block + SIDE; i++) {
            const int cell = i < cells ? i : cells - 1;
            k[i] = at(k0, k1, nk, cell / nj);
            body[i] = at(j0, j1, nj, cell % nj);
        }
        run(&p, k + block, body + block, peak + block, energy + block);
    }
    fputs("couplings.0.stiffness,bodies.wheel.inertia,peak_torque,final_energy\n", out);
    for (int i = 0; i < cells; i++)
        fprintf(out, "%.17g,%.17g,%.17g,%.17g\n", k[i], body[i], peak[i], energy[i]);
    return fclose(out) ? 3 : 0;
}
