/* e^x - 1, good near 0 */
static float hapt_expm1(float x)
{
    const uint32_t bits = hapt_bits_of32(x);
    const uint32_t hx = bits & 0x7fffffff;
    const int negative = (int)(bits >> 31);
    float hi, lo, c = 0.0f, t, y, half, hxs, r1, e, power;
    int k = 0;
    if (hx >= 0x4195b844) {
        if (hx > 0x7f800000) {
            return x;
        }
        if (negative) {
            return -1.0f;
        }
        if (hx > 0x42b17217) {
            return x * 1.7014118e38f;
        }
    }
    if (hx > 0x3eb17218) {
        if (hx < 0x3F851592) {
            k = negative ? -1 : 1;
            hi = negative ? x + 6.9313812256e-01f : x - 6.9313812256e-01f;
            lo = negative ? -9.0580006145e-06f : 9.0580006145e-06f;
        } else {
            k = (int)(1.4426950216e+00f * x + (negative ? -0.5f : 0.5f));
            t = (float)k;
            hi = x - t * 6.9313812256e-01f;
            lo = t * 9.0580006145e-06f;
        }
        x = hi - lo;
        c = (hi - x) - lo;
    } else if (hx < 0x33000000) {
        return x;
    }
    half = 0.5f * x;
    hxs = x * half;
    r1 = 1.0f + hxs * (-3.3333212137e-2f + hxs * 1.5807170421e-3f);
    t = 3.0f - r1 * half;
    e = hxs * ((r1 - t) / (6.0f - x * t));
    if (k == 0) {
        return x - (x * e - hxs);
    }
    e = x * (e - c) - c;
    e -= hxs;
    if (k == -1) {
        return 0.5f * (x - e) - 0.5f;
    }
    if (k == 1) {
        return x < -0.25f ? -2.0f * (e - (x + 0.5f)) : 1.0f + 2.0f * (x - e);
    }
    if (k < 0 || k > 56) {
        y = x - e + 1.0f;
        y = k == 128 ? y * 2.0f * 1.7014118e38f : y * hapt_number_of32((uint32_t)(0x7f + k) << 23);
        return y - 1.0f;
    }
    power = hapt_number_of32((uint32_t)(0x7f - k) << 23);
    y = k < 23 ? x - e + (1.0f - power) : x - (e + power) + 1.0f;
    return y * hapt_number_of32((uint32_t)(0x7f + k) << 23);
}

