/* e^x - 1, good near 0 */
static double hapt_expm1(double x)
{
    const uint64_t bits = hapt_bits_of64(x);
    const uint32_t hx = (uint32_t)(bits >> 32) & 0x7fffffff;
    const int negative = (int)(bits >> 63);
    double hi, lo, c = 0.0, t, y, half, hxs, r1, e, power;
    int k = 0;
    if (hx >= 0x4043687A) {
        if (x != x) {
            return x;
        }
        if (negative) {
            return -1.0;
        }
        if (x > 7.09782712893383973096e+02) {
            return x * 8.98846567431158e307;
        }
    }
    if (hx > 0x3fd62e42) {
        if (hx < 0x3FF0A2B2) {
            k = negative ? -1 : 1;
            hi = negative ? x + 6.93147180369123816490e-01 : x - 6.93147180369123816490e-01;
            lo = negative ? -1.90821492927058770002e-10 : 1.90821492927058770002e-10;
        } else {
            k = (int)(1.44269504088896338700e+00 * x + (negative ? -0.5 : 0.5));
            t = (double)k;
            hi = x - t * 6.93147180369123816490e-01;
            lo = t * 1.90821492927058770002e-10;
        }
        x = hi - lo;
        c = (hi - x) - lo;
    } else if (hx < 0x3c900000) {
        return x;
    }
    half = 0.5 * x;
    hxs = x * half;
    r1 = 1.0
        + hxs * (-3.33333333333331316428e-02
            + hxs * (1.58730158725481460165e-03
                + hxs * (-7.93650757867487942473e-05
                    + hxs * (4.00821782732936239552e-06 + hxs * -2.01099218183624371326e-07))));
    t = 3.0 - r1 * half;
    e = hxs * ((r1 - t) / (6.0 - x * t));
    if (k == 0) {
        return x - (x * e - hxs);
    }
    e = x * (e - c) - c;
    e -= hxs;
    if (k == -1) {
        return 0.5 * (x - e) - 0.5;
    }
    if (k == 1) {
        return x < -0.25 ? -2.0 * (e - (x + 0.5)) : 1.0 + 2.0 * (x - e);
    }
    if (k < 0 || k > 56) {
        y = x - e + 1.0;
        y = k == 1024 ? y * 2.0 * 8.98846567431158e307 : y * hapt_number_of64((uint64_t)(0x3ff + k) << 52);
        return y - 1.0;
    }
    power = hapt_number_of64((uint64_t)(0x3ff - k) << 52);
    y = k < 20 ? x - e + (1.0 - power) : x - (e + power) + 1.0;
    return y * hapt_number_of64((uint64_t)(0x3ff + k) << 52);
}

