/* x 2^n */
static float hapt_scalbn32(float x, int n)
{
    if (n > 127) {
        x *= 1.7014118e38f; /* 2^127 */
        n -= 127;
        if (n > 127) {
            x *= 1.7014118e38f;
            n -= 127;
            n = n > 127 ? 127 : n;
        }
    } else if (n < -126) {
        x *= 1.9721523e-31f; /* 2^-126 2^24 */
        n += 102;
        if (n < -126) {
            x *= 1.9721523e-31f;
            n += 102;
            n = n < -126 ? -126 : n;
        }
    }
    return x * hapt_number_of32((uint32_t)(127 + n) << 23);
}

/* e^x */
static float hapt_exp(float x)
{
    const uint32_t bits = hapt_bits_of32(x);
    const int negative = (int)(bits >> 31);
    const uint32_t hx = bits & 0x7fffffff;
    float hi, lo, c, y, square;
    int k;
    if (hx >= 0x42aeac50) {
        if (hx > 0x7f800000) {
            return x;
        }
        if (hx >= 0x42b17218 && !negative) {
            return x * 1.7014118e38f;
        }
        if (negative && hx >= 0x42cff1b5) {
            return 0.0f;
        }
    }
    if (hx > 0x3eb17218) {
        if (hx > 0x3f851592) {
            k = (int)(1.4426950216e+00f * x + (negative ? -0.5f : 0.5f));
        } else {
            k = 1 - negative - negative;
        }
        hi = x - (float)k * 6.9314575195e-01f;
        lo = (float)k * 1.4286067653e-06f;
        x = hi - lo;
    } else if (hx > 0x39000000) {
        k = 0;
        hi = x;
        lo = 0.0f;
    } else {
        return 1.0f + x;
    }
    square = x * x;
    c = x - square * (1.6666625440e-1f + square * -2.7667332906e-3f);
    y = 1.0f + (x * c / (2.0f - c) - lo + hi);
    return k == 0 ? y : hapt_scalbn32(y, k);
}

