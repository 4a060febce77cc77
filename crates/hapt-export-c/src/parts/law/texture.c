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

//part torque
    case HAPT_TEXTURE:
        return hapt_texture_torque(&world->texture[coupling->place], q);
//part mean
/* The mean torque of a texture over a distance from so many periods. */
static hapt_pair hapt_texture_mean(const hapt_texture *texture, hapt_real from, hapt_real distance)
{
    const hapt_real half = (hapt_real)0.5 * (distance / texture->pitch);
    const hapt_pair mean = hapt_texture_sum(texture, from + half, &half);
    if (hapt_abs(half) > (hapt_real)(1.0 / 256.0)) {
        const hapt_real end = hapt_texture_sum(texture, from + half + half, 0).value;
        return hapt_pair_of(mean.value, (end - mean.value) / distance);
    }
    return hapt_pair_of(mean.value, (hapt_real)0.5 * mean.slope);
}

//part mean_torque
    case HAPT_TEXTURE:
        return hapt_texture_mean(&world->texture[curve->place], curve->from, distance);
//part solve
    case HAPT_TEXTURE: {
        const hapt_texture *texture = &world->texture[coupling->place];
        const hapt_real from = hapt_texture_turns(texture, response->start);
        const hapt_curve curve = hapt_curve_of(HAPT_TEXTURE, coupling->place, from);
        hapt_response from_whole = *response;
        hapt_real most = (hapt_real)0, steepest = (hapt_real)0, turn;
        int i;
        from_whole.start = from * texture->pitch;
        for (i = 0; i < 4; i++) {
            const hapt_real size = hapt_abs(texture->sine[i]) + hapt_abs(texture->cosine[i]);
            most += size;
            steepest += (hapt_real)(i + 1) * size;
        }
        turn = response->compliance * steepest * (hapt_real)HAPT_PI / texture->pitch;
        return hapt_solve_nearest(world, &from_whole, most, turn, turn, texture->pitch * (hapt_real)(1.0 / 256.0), &curve);
    }
//part stored_slope
    case HAPT_TEXTURE: {
        const hapt_texture *texture = &world->texture[coupling->place];
        return -hapt_texture_mean(texture, hapt_texture_turns(texture, start), distance).value;
    }
//part potential
//if parts_texture
    case HAPT_STORED_TEXTURE: {
        const hapt_stored_texture *texture = &world->stored_texture[part->index];
        const hapt_real way = (q - texture->phase) / texture->pitch;
        const hapt_real turns = way - hapt_floor(way + (hapt_real)0.5);
        const hapt_real tau = (hapt_real)HAPT_TAU;
        hapt_real well = texture->base, torque = (hapt_real)0, n = (hapt_real)0;
        int i;
        for (i = 0; i < 4; i++) {
            const hapt_real a = texture->sine[i], b = texture->cosine[i];
            hapt_real s, c;
            n += (hapt_real)1;
            s = hapt_sin(tau * n * turns);
            c = hapt_sin(tau * (n * turns + (hapt_real)0.25));
            well += (a * c - b * s) / n;
            torque += a * s + b * c;
        }
        return well + torque * (tau / texture->pitch) * lag;
    }
//end
