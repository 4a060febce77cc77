static float hapt_k_sin(double x)
{
    const double z = x * x;
    const double w = z * z;
    const double r = -0.000198393348360966317347 + z * 0.0000027183114939898219064;
    const double s = z * x;
    return (float)((x + s * (-0.166666666416265235595 + z * 0.0083333293858894631756)) + s * w * r);
}

static float hapt_k_cos(double x)
{
    const double z = x * x;
    const double w = z * z;
    const double r = -0.00138867637746099294692 + z * 0.0000243904487962774090654;
    return (float)(((1.0 + z * -0.499999997251031003120) + w * 0.0416666233237390631894) + (w * z) * r);
}

/* The remainder of x by pi/2, and the quotient. */
static int hapt_rem_pio2(float x, double *y)
{
    const double wide = (double)x;
    const uint32_t bits = hapt_bits_of32(x);
    const uint32_t ix = bits & 0x7fffffff;
    double piece, f;
    int n, e0;
    if (ix < 0x4dc90fdb) {
        f = (wide * 6.36619772367581382433e-01 + 6755399441055744.0) - 6755399441055744.0;
        *y = wide - f * 1.57079631090164184570e+00 - f * 1.58932547735281966916e-08;
        return (int)f;
    }
    e0 = (int)(ix >> 23) - (0x7f + 23);
    piece = (double)hapt_number_of32(ix - ((uint32_t)e0 << 23));
    n = hapt_rem_pio2_large(&piece, y, 1, e0, 0);
    if (bits >> 31) {
        *y = -*y;
        n = -n;
    }
    return n;
}

/* sin x */
static float hapt_sin(float x)
{
    const double half_pi = 1.5707963267948966;
    const double wide = (double)x;
    const uint32_t bits = hapt_bits_of32(x);
    const uint32_t ix = bits & 0x7fffffff;
    const int negative = (int)(bits >> 31);
    double y;
    int n;
    if (ix <= 0x3f490fda) {
        return ix < 0x39800000 ? x : hapt_k_sin(wide);
    }
    if (ix <= 0x407b53d1) {
        if (ix <= 0x4016cbe3) {
            return negative ? -hapt_k_cos(wide + half_pi) : hapt_k_cos(wide - half_pi);
        }
        return hapt_k_sin(negative ? -(wide + 2.0 * half_pi) : -(wide - 2.0 * half_pi));
    }
    if (ix <= 0x40e231d5) {
        if (ix <= 0x40afeddf) {
            return negative ? hapt_k_cos(wide + 3.0 * half_pi) : -hapt_k_cos(wide - 3.0 * half_pi);
        }
        return hapt_k_sin(negative ? wide + 4.0 * half_pi : wide - 4.0 * half_pi);
    }
    if (ix >= 0x7f800000) {
        return x - x;
    }
    n = hapt_rem_pio2(x, &y) & 3;
    if (n == 0) {
        return hapt_k_sin(y);
    }
    if (n == 1) {
        return hapt_k_cos(y);
    }
    return n == 2 ? hapt_k_sin(-y) : -hapt_k_cos(y);
}

