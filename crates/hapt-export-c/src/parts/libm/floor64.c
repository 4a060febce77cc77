/* The largest whole number that is not greater than x, which is not negative and below 2^52. */
static double hapt_floor64(double x)
{
    const double rounded = (x + 4503599627370496.0) - 4503599627370496.0;
    return rounded > x ? rounded - 1.0 : rounded;
}

