/* ---- Numbers ---- */

#ifdef __FAST_MATH__
#error "-ffast-math changes the bits and the checks for NaN: compile this file without it"
#endif
#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0
#error "-ffinite-math-only removes the checks for NaN: compile this file without it"
#endif
#if defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "this option changes the bits: compile this file without it"
#endif
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16
#error "this processor computes with more digits than a number has: use SSE2 (-msse2 -mfpmath=sse)"
#endif

//if doubles
#if defined(__SIZEOF_DOUBLE__) && __SIZEOF_DOUBLE__ < 8
#error "this file computes with doubles of 64 bits, which this compiler does not have, as those for AVR: a world without detents and textures needs none with --float f32; else use a board of 32 bits"
#endif
//end

/* A product and a sum in one rounding would change the bits. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize ("fp-contract=off")
#endif

#if defined(__GNUC__)
#define HAPT_INFINITY ((hapt_real)__builtin_huge_val())
#else
#define HAPT_INFINITY ((hapt_real)(1e300 * 1e300))
#endif
/* From 1 to the next number. */
//if f32
#define HAPT_EPSILON ((hapt_real)1.1920928955078125e-07)
//else
#define HAPT_EPSILON 2.220446049250313e-16
//end
#define HAPT_TAU 6.283185307179586
#define HAPT_PI 3.141592653589793
#define HAPT_ROOT_E 1.6487212707001282

/* |x| */
static hapt_real hapt_abs(hapt_real x)
{
    return x < (hapt_real)0 ? -x : x + (hapt_real)0;
}

/* Neither infinite nor NaN. */
static int hapt_is_finite(hapt_real x)
{
    return x - x == (hapt_real)0;
}

//if between
/* x within [low, high]; a NaN stays one. */
static hapt_real hapt_between(hapt_real x, hapt_real low, hapt_real high)
{
    return x > high ? high : (low > x ? low : x);
}

//end
/* x within +-limit; a NaN stays one. */
static hapt_real hapt_within(hapt_real x, hapt_real limit)
{
    x = x > limit ? limit : x;
    return x < -limit ? -limit : x;
}

//if floor
/* The largest whole number that is not greater. */
static hapt_real hapt_floor(hapt_real x)
{
//if f32
    const hapt_real whole = (hapt_real)8388608; /* 2^23: from here on every number is whole */
//else
    const hapt_real whole = (hapt_real)4503599627370496; /* 2^52: from here on every number is whole */
//end
    hapt_real rounded;
    if (!(hapt_abs(x) < whole) || x == (hapt_real)0) {
        return x;
    }
    rounded = x < (hapt_real)0 ? (x - whole) + whole : (x + whole) - whole;
    return rounded > x ? rounded - (hapt_real)1 : rounded;
}

//end
