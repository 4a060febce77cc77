/* The sweeps of `cargo xtask bench` over worlds that do more than a wheel in a hand, as one writes each in C to be fast: bench/worlds, with
   -DKIND=RELEASED, WALL, DETENTS, GRIP or BODIES. Every hand lets go between two samples, and the period is the inner axis: sixteen worlds
   side by side, each with its own period, its own sample of the release and its own last sample. What differs lane by lane in a branch
   (the release's period, a stop under friction) is done for that lane alone.
   Arguments: the first axis from, to, n; the period from, to, n; the file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define RELEASED 0
#define WALL 1
#define DETENTS 2
#define GRIP 3
#define BODIES 4
enum { SIDE = 16, WINDOW = 16 };
#define EACH for (int i = 0; i < SIDE; i++)

/* What the world files say. */
#define DURATION 1.0
#define RELEASE 0.2503
#define J (KIND == DETENTS ? 3e-6 : 6.4e-4)
#define B (KIND == DETENTS ? 4e-5 : 1.2e-3)
#define LIMIT (KIND == DETENTS ? 0.04 : 0.82225)
#define TO (KIND == DETENTS ? 0.2 : 0.78)
#define WHEEL 0.0258
#define LINK 0.01
#define FRICTION 0.005
#define AT 0.9
#define STIFF 2.0
#define WALL_DAMPING 1e-4
#define HAND 1e-3
#define HAND_DAMPING 0.02
#define HAND_STIFFNESS 2.0
#define SIZE (2 * M_PI / 16384)
#define TURN (2 * M_PI / 0.25)
#define DAMPER 2e-5
static const char *const AXIS = KIND == DETENTS ? "couplings.0.torque" : "couplings.0.stiffness";

typedef double Lane[SIDE];

/* What velocity and torque do to position and velocity over t. */
typedef struct {
    double z_v, z_f, v_v, v_f;
} Gain;

static Gain gain(double t)
{
    const double a = B / J, decay = expm1(-a * t);
    return (Gain){-decay / a, (t + decay / a) / B, decay, -decay / B};
}

static void slide(Gain g, double torque, double *z, double *v)
{
    const double travel = g.z_v * *v + g.z_f * torque;
    *v += g.v_v * *v + g.v_f * torque;
    *z += travel;
}

/* Free for t, with a stop under friction where there is one. */
static void go(double t, double torque, double *z, double *v)
{
    if (KIND != WALL) {
        slide(gain(t), torque, z, v);
        return;
    }
    double way = *v > 0 ? 1 : *v < 0 ? -1 : 0;
    if (way != 0) {
        const double at_last = (torque - FRICTION * way) / B, a = B / J;
        const double stop = at_last * way < 0 ? log1p(-*v / at_last) / a : t;
        if (stop >= t) {
            slide(gain(t), torque - FRICTION * way, z, v);
            return;
        }
        slide(gain(stop), torque - FRICTION * way, z, v);
        *v = 0;
        t -= stop;
    }
    if (fabs(torque) > FRICTION)
        slide(gain(t), torque - copysign(FRICTION, torque), z, v);
}

/* The grip's exponential over t: e is the distance from where its spring and the torque balance. */
static inline void grip(double t, double torque, double *z, double *v)
{
    const double m = J + HAND, square = HAND_STIFFNESS / m, sigma = 0.5 * (B + HAND_DAMPING) / m, omega = sqrt(square - sigma * sigma);
    const double rest = TO + torque / HAND_STIFFNESS, e = *z - rest, decay = exp(-sigma * t), s = decay * sin(omega * t) / omega,
                 c = decay * cos(omega * t);
    const double v0 = *v;
    *z = rest + (c + sigma * s) * e + s * v0;
    *v = (c - sigma * s) * v0 - square * s * e;
}

/* Counts a sample: the end-fit over the longest line through the newest count that passes within one of all. */
static inline void foaw(double (*restrict ring)[SIDE], int n, double *restrict slope)
{
    const int newest = n & 31, older = n < WINDOW ? n : WINDOW;
    Lane low, high;
    EACH low[i] = -1e300, high[i] = 1e300, slope[i] = 0;
    int active = 1;
    for (int age = 1; age <= older && active; age++) {
        const double part = 1.0 / age, within = 1 + 1e-9, *then = ring[(n - age) & 31];
        active = 0;
        EACH {
            const double d = then[i] - ring[newest][i], s = d * part;
            const int ok = (s >= low[i]) & (s <= high[i]);
            const double lowest = fmax(low[i], (d - within) * part), highest = fmin(high[i], (d + within) * part);
            /* What has left the line never comes back to it. */
            low[i] = ok ? lowest : 1, high[i] = ok ? highest : -1;
            slope[i] = ok ? -s : slope[i];
            active |= ok;
        }
    }
}

static void run(const double *restrict first, const double *restrict period, double *restrict peak, double *restrict energy)
{
    Lane z, v, applied, most, T;
    Lane z_v, z_f, v_v, v_f, hold_e, hold_v, hold_ve, hold_vv;
    int samples[SIDE], release[SIDE];
    int least = 1 << 30, last = 0, first_free = 1 << 30, all_free = 0;
    EACH {
        T[i] = period[i];
        samples[i] = (int)round(DURATION / T[i]) + 1;
        double at = RELEASE / T[i], whole = round(at);
        release[i] = fabs(at - whole) <= 1e-6 ? (int)whole : (int)at;
        least = samples[i] < least ? samples[i] : least, last = samples[i] > last ? samples[i] : last;
        first_free = release[i] < first_free ? release[i] : first_free, all_free = release[i] > all_free ? release[i] : all_free;
        const Gain g = gain(T[i]);
        z_v[i] = g.z_v, z_f[i] = g.z_f, v_v[i] = g.v_v, v_f[i] = g.v_f;
        z[i] = KIND == GRIP ? 0 : TO;
        v[i] = applied[i] = most[i] = 0;
        if (KIND == GRIP) {
            /* From where spring and torque balance, one unit away, and one unit fast. */
            double e = TO + 1, fast = 0;
            grip(T[i], 0, &e, &fast);
            hold_e[i] = e - TO, hold_ve[i] = fast;
            e = TO, fast = 1;
            grip(T[i], 0, &e, &fast);
            hold_v[i] = e - TO, hold_vv[i] = fast;
        }
    }
#if KIND == DETENTS
    static _Thread_local double ring[32][SIDE];
    Lane fit;
#elif KIND == BODIES
    Lane cosine[3][3], sine[3][3], turned[3][3], w[3], wv[3], dw[3], dwv[3];
    EACH {
        /* w'' = -m (w - z): 1 - cos and sin of it by their series. */
        const double k = first[i], m[3][3] = {{(k + 1) / LINK, -1 / LINK, 0}, {-1 / LINK, 2 / LINK, -1 / LINK}, {0, -1 / LINK, 1 / LINK}};
        double term[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, c[3][3] = {{0}}, s[3][3] = {{T[i], 0, 0}, {0, T[i], 0}, {0, 0, T[i]}};
        for (int j = 1; j < 10; j++) {
            double next[3][3] = {{0}};
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    for (int x = 0; x < 3; x++)
                        next[a][b] -= m[a][x] * term[x][b];
                    next[a][b] *= T[i] * T[i] / (2 * j * (2 * j - 1));
                }
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    term[a][b] = next[a][b];
                    c[a][b] += next[a][b];
                    s[a][b] += next[a][b] * T[i] / (2 * j + 1);
                }
        }
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                cosine[a][b][i] = c[a][b], sine[a][b][i] = s[a][b], turned[a][b][i] = 0;
                for (int x = 0; x < 3; x++)
                    turned[a][b][i] -= m[a][x] * s[x][b];
            }
        for (int a = 0; a < 3; a++)
            w[a][i] = wv[a][i] = dw[a][i] = dwv[a][i] = 0;
    }
#else
    Lane c1, from_velocity, to_velocity, w, wv, dw, dwv;
    EACH {
        const double omega = sqrt(first[i] / WHEEL), s = sin(omega * T[i]), half = sin(0.5 * omega * T[i]);
        c1[i] = -2 * half * half, from_velocity[i] = s / omega, to_velocity[i] = -s * omega;
        w[i] = wv[i] = dw[i] = dwv[i] = 0;
    }
#endif
    for (int n = 0; n < last; n++) {
        if (n > all_free + 1) {
            Lane friction, stays;
            int odd = 0;
            EACH {
                const double way = v[i] != 0 ? copysign(1, v[i]) : applied[i] > FRICTION ? 1 : applied[i] < -FRICTION ? -1 : 0;
                friction[i] = KIND == WALL ? FRICTION * way : 0;
                stays[i] = KIND == WALL && way == 0;
            }
            EACH {
                const double torque = applied[i] - friction[i], travel = z_v[i] * v[i] + z_f[i] * torque,
                             speed = v[i] + v_v[i] * v[i] + v_f[i] * torque;
                if (KIND == WALL) {
                    /* Where it stops on the way, alone, from here. */
                    const int stops = v[i] * speed < 0;
                    odd |= stops;
                    z[i] += stays[i] || stops ? 0 : travel;
                    v[i] = stays[i] ? 0 : stops ? v[i] : speed;
                    stays[i] = stops;
                } else {
                    z[i] += travel;
                    v[i] = speed;
                }
            }
            if (KIND == WALL && odd)
                EACH if (stays[i] != 0)
                    go(T[i], applied[i], &z[i], &v[i]);
        } else if (n > first_free) {
            EACH {
                const double held = RELEASE - release[i] * T[i];
                if (n == release[i] + 1) {
                    if (KIND == GRIP && held > 0)
                        grip(held, applied[i], &z[i], &v[i]);
                    go(T[i] - fmax(held, 0), applied[i], &z[i], &v[i]);
                } else if (n > release[i]) {
                    go(T[i], applied[i], &z[i], &v[i]);
                } else if (KIND == GRIP) {
                    grip(T[i], applied[i], &z[i], &v[i]);
                }
            }
        } else if (KIND == GRIP && n > 0) {
            EACH {
                const double rest = TO + applied[i] / HAND_STIFFNESS, e = z[i] - rest, speed = v[i];
                z[i] = rest + hold_e[i] * e + hold_v[i] * speed;
                v[i] = hold_ve[i] * e + hold_vv[i] * speed;
            }
        }
#if KIND == DETENTS
        EACH ring[n & 31][i] = floor(z[i] / SIZE + 0.5 + 1e-9);
        foaw(ring, n, fit);
        EACH {
            const double torque = -first[i] * sin(TURN * SIZE * ring[n & 31][i]) - DAMPER * SIZE / T[i] * fit[i];
            most[i] = fmax(most[i], fabs(torque));
            applied[i] = fmin(fmax(torque, -LIMIT), LIMIT);
        }
#elif KIND == BODIES
        EACH {
            for (int a = 0; a < 3; a++)
                w[a][i] += dw[a][i], wv[a][i] += dwv[a][i];
            const double x[3] = {w[0][i] - z[i], w[1][i] - z[i], w[2][i] - z[i]};
            for (int a = 0; a < 3; a++) {
                dw[a][i] = dwv[a][i] = 0;
                for (int b = 0; b < 3; b++) {
                    dw[a][i] += cosine[a][b][i] * x[b] + sine[a][b][i] * wv[b][i];
                    dwv[a][i] += turned[a][b][i] * x[b] + cosine[a][b][i] * wv[b][i];
                }
            }
            const double torque = first[i] * (x[0] + dw[0][i]);
            most[i] = fmax(most[i], fabs(torque));
            applied[i] = fmin(fmax(torque, -LIMIT), LIMIT);
        }
#else
        EACH {
            w[i] += dw[i];
            wv[i] += dwv[i];
            dw[i] = c1[i] * (w[i] - z[i]) + from_velocity[i] * wv[i];
            dwv[i] = to_velocity[i] * (w[i] - z[i]) + c1[i] * wv[i];
            double torque = first[i] * (w[i] + dw[i] - z[i]);
            if (KIND == WALL) {
                const double push = STIFF * (z[i] - AT) + WALL_DAMPING * v[i];
                torque -= z[i] > AT && push > 0 ? push : 0;
            }
            most[i] = fmax(most[i], fabs(torque));
            applied[i] = fmin(fmax(torque, -LIMIT), LIMIT);
        }
#endif
        if (n + 1 >= least)
            EACH if (n + 1 == samples[i]) {
                peak[i] = most[i];
#if KIND == DETENTS
                energy[i] = first[i] / TURN * (1 - cos(TURN * z[i]));
#elif KIND == BODIES
                const double q[3] = {z[i] - w[0][i], w[0][i] - w[1][i], w[1][i] - w[2][i]};
                energy[i] = 0.5 * (first[i] * q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
                for (int a = 0; a < 3; a++)
                    energy[i] += 0.5 * LINK * wv[a][i] * wv[a][i];
#else
                energy[i] = 0.5 * WHEEL * wv[i] * wv[i] + 0.5 * first[i] * (z[i] - w[i]) * (z[i] - w[i]);
                if (KIND == WALL && z[i] > AT)
                    energy[i] += 0.5 * STIFF * (z[i] - AT) * (z[i] - AT);
#endif
            }
    }
}

static double at(double from, double to, int n, int i)
{
    return i == 0 ? from : i == n - 1 ? to : from + i * (to - from) / (n - 1);
}

int main(int count, char **word)
{
    if (count != 8)
        return 2;
    const double k0 = atof(word[1]), k1 = atof(word[2]), t0 = atof(word[4]), t1 = atof(word[5]);
    const int nk = atoi(word[3]), nt = atoi(word[6]), cells = nk * nt, room = (cells + SIDE - 1) / SIDE * SIDE;
    double *table = malloc((size_t)room * 4 * sizeof *table), *k = table, *period = table + room, *peak = table + 2 * room,
           *energy = table + 3 * room;
    FILE *out = fopen(word[7], "w");
    if (!out || !table)
        return 3;
#pragma omp parallel for schedule(dynamic, 16)
    for (int block = 0; block < room; block += SIDE) {
        for (int i = block; i < block + SIDE; i++) {
            const int cell = i < cells ? i : cells - 1;
            k[i] = at(k0, k1, nk, cell / nt);
            period[i] = at(t0, t1, nt, cell % nt);
        }
        run(k + block, period + block, peak + block, energy + block);
    }
    fprintf(out, "%s,loop.period,peak_torque,final_energy\n", AXIS);
    for (int i = 0; i < cells; i++)
        fprintf(out, "%.17g,%.17g,%.17g,%.17g\n", k[i], period[i], peak[i], energy[i]);
    return fclose(out) ? 3 : 0;
}
