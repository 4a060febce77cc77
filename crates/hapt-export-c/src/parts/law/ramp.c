/* stiffness x, level from low and to high: the slope of what a spring with a limit, a wall or a dead band stores. */
typedef struct {
    hapt_real stiffness;
    hapt_real low;
    hapt_real high;
} hapt_ramp;

static hapt_ramp hapt_ramp_of(hapt_real stiffness, hapt_real least, hapt_real most)
{
    hapt_ramp ramp;
    ramp.stiffness = stiffness;
    /* Avoids the NaN of 0/0, for a wall without stiffness. */
    ramp.low = least == (hapt_real)0 ? least : least / stiffness;
    ramp.high = most / stiffness;
    return ramp;
}

/* How far x is over y; 0 when it is not. */
static hapt_real hapt_over(hapt_real x, hapt_real y)
{
    return x > y ? x - y : (hapt_real)0;
}

/* The mean over the way from `from` to `from + distance`, and its derivative by `distance`. */
static hapt_pair hapt_ramp_mean(hapt_ramp ramp, hapt_real from, hapt_real distance)
{
    const hapt_real to = from + distance;
    const hapt_real a = hapt_between(from, ramp.low, ramp.high), b = hapt_between(to, ramp.low, ramp.high);
    const hapt_real way = to - from;
    hapt_real rise, share, mean;
    if (a == from && b == to) {
        return hapt_pair_of(ramp.stiffness * (from + (hapt_real)0.5 * distance), (hapt_real)0.5 * ramp.stiffness);
    }
    if (way == (hapt_real)0) {
        return hapt_pair_of(ramp.stiffness * a, (hapt_real)0);
    }
    rise = (hapt_real)0.5 * (b - a) * ((b - a) / way);
    share = hapt_over(to, ramp.high) - hapt_over(from, ramp.high);
    if (share != (hapt_real)0) {
        rise += (ramp.high - a) * (share / way);
    }
    share = hapt_over(ramp.low, from) - hapt_over(ramp.low, to);
    if (share != (hapt_real)0) {
        rise += (ramp.low - a) * (share / way);
    }
    mean = a + rise;
    return hapt_pair_of(ramp.stiffness * mean, ramp.stiffness * ((b - mean) / way));
}

