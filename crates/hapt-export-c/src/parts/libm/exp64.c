/* e^x */
static double hapt_exp(double x)
{
    const uint32_t upper = (uint32_t)(hapt_bits_of64(x) >> 32);
    const int negative = (int)(upper >> 31);
    const uint32_t hx = upper & 0x7fffffff;
    double hi, lo, c, y, square;
    int k;
    if (hx >= 0x4086232b) {
        if (x != x) {
            return x;
        }
        if (x > 709.782712893383973096) {
            return x * 8.98846567431158e307;
        }
        if (x < -745.13321910194110842) {
            return 0.0;
        }
    }
    if (hx > 0x3fd62e42) {
        if (hx >= 0x3ff0a2b2) {
            k = (int)(1.44269504088896338700e+00 * x + (negative ? -0.5 : 0.5));
        } else {
            k = 1 - negative - negative;
        }
        hi = x - (double)k * 6.93147180369123816490e-01;
        lo = (double)k * 1.90821492927058770002e-10;
        x = hi - lo;
    } else if (hx > 0x3e300000) {
        k = 0;
        hi = x;
        lo = 0.0;
    } else {
        return 1.0 + x;
    }
    square = x * x;
    c = x - square
        * (1.66666666666666019037e-01
            + square * (-2.77777777770155933842e-03
                + square * (6.61375632143793436117e-05
                    + square * (-1.65339022054652515390e-06 + square * 4.13813679705723846039e-08))));
    y = 1.0 + (x * c / (2.0 - c) - lo + hi);
    return k == 0 ? y : hapt_scalbn64(y, k);
}

