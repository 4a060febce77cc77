//if libm
/* ---- sin, exp, expm1: the algorithms of FreeBSD's and musl's libm, to the bit ----
 * Copyright (C) 1993, 2004 by Sun Microsystems, Inc. All rights reserved.
 * Developed at SunPro and SunSoft, Sun Microsystems, Inc. businesses. Permission to use, copy, modify, and distribute this
 * software is freely granted, provided that this notice is preserved. */

//end
/* gcc, clang and others define this in C++ too. */
//if bits64
typedef union {
    double number;
    uint64_t bits;
} hapt_bits64;

//end
//if f32
typedef union {
    float number;
    uint32_t bits;
} hapt_bits32;

//end
//if f64
static uint64_t hapt_bits_of64(double x)
{
    hapt_bits64 both;
    both.number = x;
    return both.bits;
}

//end
//if bits64
static double hapt_number_of64(uint64_t bits)
{
    hapt_bits64 both;
    both.bits = bits;
    return both.number;
}

//end
//if f32
static uint32_t hapt_bits_of32(float x)
{
    hapt_bits32 both;
    both.number = x;
    return both.bits;
}

static float hapt_number_of32(uint32_t bits)
{
    hapt_bits32 both;
    both.bits = bits;
    return both.number;
}

//end
