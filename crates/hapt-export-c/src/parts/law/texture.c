/* The sum of the harmonics at `turns`, and its derivative by q; with `half` each harmonic is a mean over the way from half before to
 * half after. */
static hapt_pair hapt_texture_sum(const hapt_texture *texture, hapt_real turns, const hapt_real *half)
{
    const hapt_real tau = (hapt_real)HAPT_TAU;
    const hapt_real sine = hapt_sin(tau * turns), cosine = hapt_sin(tau * (turns + (hapt_real)0.25));
    hapt_real s = sine, c = cosine, sum = (hapt_real)0, slope = (hapt_real)0, n = (hapt_real)0;
    int i;
    for (i = 0; i < 4; i++) {
        hapt_real share = (hapt_real)1, next;
        n += (hapt_real)1;
        if (half) {
            const hapt_real angle = n * (tau * *half);
            share = angle == (hapt_real)0 ? (hapt_real)1 : hapt_sin(angle) / angle;
        }
        sum += (texture->sine[i] * s + texture->cosine[i] * c) * share;
        slope += n * (texture->sine[i] * c - texture->cosine[i] * s);
        next = s * cosine + c * sine;
        c = c * cosine - s * sine;
        s = next;
    }
    return hapt_pair_of(sum, slope * (tau / texture->pitch));
}

/* q from the nearest whole period, in periods. */
static hapt_real hapt_texture_turns(const hapt_texture *texture, hapt_real q)
{
    const hapt_real turns = (q - texture->phase) / texture->pitch;
    return turns - hapt_floor(turns + (hapt_real)0.5);
}

static hapt_real hapt_texture_torque(const hapt_texture *texture, hapt_real q)
{
    return hapt_texture_sum(texture, hapt_texture_turns(texture, q), 0).value;
}

