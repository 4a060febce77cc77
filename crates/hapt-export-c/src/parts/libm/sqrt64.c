/* The square root of x, which is not negative, correctly rounded: bit by bit, as that of a whole number. */
static double hapt_sqrt(double x)
{
    const uint64_t one = (uint64_t)1 << 52;
    uint64_t rest = hapt_bits_of64(x), twice = 0, root = 0, bit;
    int power = (int)(rest >> 52);
    if (!(x > 0.0) || power == 2047) {
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
        const uint64_t next = twice + bit;
        if (next <= rest) {
            rest -= next;
            twice = next + bit;
            root += bit;
        }
        rest <<= 1;
    }
    return hapt_number_of64(((root + 1) >> 1) + ((uint64_t)((power + 1021) / 2) << 52));
}

