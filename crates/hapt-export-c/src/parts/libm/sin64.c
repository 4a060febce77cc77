static double hapt_k_sin(double x, double y, int has_tail)
{
    const double z = x * x;
    const double w = z * z;
    const double r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
        + z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    const double v = z * x;
    const double s1 = -1.66666666666666324348e-01;
    return has_tail ? x - ((z * (0.5 * y - v * r) - y) - v * s1) : x + v * (s1 + z * r);
}

static double hapt_k_cos(double x, double y)
{
    const double z = x * x;
    const double square = z * z;
    const double r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
        + square * square
            * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const double hz = 0.5 * z;
    const double w = 1.0 - hz;
    return w + (((1.0 - w) - hz) + (z * r - x * y));
}

/* The remainder of x by pi/2 for x of a medium size; ix is its upper word without the sign. */
static int hapt_rem_pio2_medium(double x, uint32_t ix, double *y)
{
    const double f = (x * 6.36619772367581382433e-01 + 6755399441055744.0) - 6755399441055744.0;
    const int ex = (int)(ix >> 20);
    double r = x - f * 1.57079632673412561417e+00;
    double w = f * 6.07710050650619224932e-11;
    double t;
    y[0] = r - w;
    if (ex - ((int)(hapt_bits_of64(y[0]) >> 52) & 0x7ff) > 16) {
        t = r;
        w = f * 6.07710050630396597660e-11;
        r = t - w;
        w = f * 2.02226624879595063154e-21 - ((t - r) - w);
        y[0] = r - w;
        if (ex - ((int)(hapt_bits_of64(y[0]) >> 52) & 0x7ff) > 49) {
            t = r;
            w = f * 2.02226624871116645580e-21;
            r = t - w;
            w = f * 8.47842766036889956997e-32 - ((t - r) - w);
            y[0] = r - w;
        }
    }
    y[1] = (r - y[0]) - w;
    return (int)f;
}

/* The remainder of x by pi/2 in two pieces, and the quotient. */
static int hapt_rem_pio2(double x, double *y)
{
    const uint64_t bits = hapt_bits_of64(x);
    const int negative = (int)(bits >> 63);
    const uint32_t ix = (uint32_t)(bits >> 32) & 0x7fffffff;
    double pieces[3], tail[2] = {0.0, 0.0}, z;
    int n, i;
    if (ix <= 0x401c463b && !(ix <= 0x400f6a7a && (ix & 0xfffff) == 0x921fb) && ix != 0x4012d97c && ix != 0x401921fb) {
        /* |x| below about 9 pi/4, and not next to a multiple of pi/2. */
        double k, shift, rest;
        n = ix <= 0x4002d97c ? 1 : (ix <= 0x400f6a7a ? 2 : (ix <= 0x4015fdbc ? 3 : 4));
        k = negative ? -(double)n : (double)n;
        shift = k * 1.57079632673412561417e+00;
        rest = k * 6.07710050650619224932e-11;
        z = x - shift;
        y[0] = z - rest;
        y[1] = (z - y[0]) - rest;
        return negative ? -n : n;
    }
    if (ix < 0x413921fb) {
        return hapt_rem_pio2_medium(x, ix, y);
    }
    z = hapt_number_of64((bits & 0xfffffffffffff) | ((uint64_t)(0x3ff + 23) << 52));
    for (i = 0; i < 2; i++) {
        pieces[i] = (double)(int32_t)z;
        z = (z - pieces[i]) * 16777216.0;
    }
    pieces[2] = z;
    for (i = 2; i > 0 && pieces[i] == 0.0; i--) {
    }
    n = hapt_rem_pio2_large(pieces, tail, i + 1, (int)(ix >> 20) - (0x3ff + 23), 1);
    y[0] = negative ? -tail[0] : tail[0];
    y[1] = negative ? -tail[1] : tail[1];
    return negative ? -n : n;
}

/* sin x */
static double hapt_sin(double x)
{
    const uint32_t ix = (uint32_t)(hapt_bits_of64(x) >> 32) & 0x7fffffff;
    double y[2];
    int n;
    if (ix <= 0x3fe921fb) {
        return ix < 0x3e500000 ? x : hapt_k_sin(x, 0.0, 0);
    }
    if (ix >= 0x7ff00000) {
        return x - x;
    }
    n = hapt_rem_pio2(x, y) & 3;
    if (n == 0) {
        return hapt_k_sin(y[0], y[1], 1);
    }
    if (n == 1) {
        return hapt_k_cos(y[0], y[1]);
    }
    return n == 2 ? -hapt_k_sin(y[0], y[1], 1) : -hapt_k_cos(y[0], y[1]);
}

