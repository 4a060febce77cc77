/* The square root of x, which is not negative, correctly rounded: bit by bit, as that of a whole number. */
static float hapt_sqrt(float x)
{
    const uint32_t one = (uint32_t)1 << 23;
    uint32_t rest = hapt_bits_of32(x), twice = 0, root = 0, bit;
    int power = (int)(rest >> 23);
    if (!(x > 0.0f) || power == 255) {
        return x;
    }
    if (power == 0) {
        for (power = 1; rest < one; power--) {
            rest <<= 1;
        }
    }
    /* Of an odd power of two the digits take one factor, so that the rest is a square. */
    rest = ((rest & (one - 1)) | one) << (power % 2 == 0 ? 2 : 1);
    /* One bit more than a number has, to round by. No root lies in the middle between two numbers. */
    for (bit = one << 1; bit != 0; bit >>= 1) {
        const uint32_t next = twice + bit;
        if (next <= rest) {
            rest -= next;
            twice = next + bit;
            root += bit;
        }
        rest <<= 1;
    }
    return hapt_number_of32(((root + 1) >> 1) + ((uint32_t)((power + 125) / 2) << 23));
}

