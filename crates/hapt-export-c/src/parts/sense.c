/* ---- The puck as the loop measures it ---- */

//if ring
/* The one so many samples ago. */
static hapt_real hapt_then(const hapt_state *state, uint32_t age)
{
    return state->count[(state->newest % HAPT_COUNTS + HAPT_COUNTS - (age < HAPT_COUNTS ? age : HAPT_COUNTS)) % HAPT_COUNTS];
}

/* Adds the newest. */
static void hapt_remember(hapt_state *state, hapt_real newest)
{
    if (state->has_last) {
        state->newest = (state->newest + 1) % HAPT_COUNTS;
        state->older = state->older < HAPT_COUNTS - 1 ? state->older + 1 : HAPT_COUNTS - 1;
    }
    state->count[state->newest % HAPT_COUNTS] = newest;
}

//end
//if foaw
/* The count so many samples ago, relative to the newest. */
static hapt_real hapt_count_at(const hapt_state *state, uint32_t age)
{
    return hapt_then(state, age) - hapt_then(state, 0);
}

/* First-order adaptive windowing: the velocity over the longest window in which each sample lies within one count of the line from
 * the newest to the oldest. */
static hapt_real hapt_windowed(const hapt_world *world, const hapt_state *state)
{
    const hapt_real within = (hapt_real)(1.0 + 1e-9);
    const uint32_t window = state->older < HAPT_COUNTS - 1 ? state->older : HAPT_COUNTS - 1;
    hapt_real lowest = -HAPT_INFINITY, highest = HAPT_INFINITY, slope;
    uint32_t n = 1, age;
    for (age = 1; age <= window; age++) {
        const hapt_real time = (hapt_real)age;
        const hapt_real count = hapt_count_at(state, age);
        const hapt_real low = (count - within) / time, high = (count + within) / time;
        slope = count / time;
        if (!(slope >= lowest && slope <= highest)) {
            break;
        }
        lowest = low > lowest ? low : lowest;
        highest = high < highest ? high : highest;
        n = age;
    }
//if best
    slope = (hapt_real)0;
    for (age = 0; age <= n; age++) {
        slope += ((hapt_real)n - (hapt_real)(2 * age)) * hapt_count_at(state, age);
    }
    slope = slope * (hapt_real)6 / (hapt_real)(n * (n + 1) * (n + 2));
//else
    slope = -hapt_count_at(state, n) / (hapt_real)n;
//end
    return slope * world->count * world->sample_rate;
}

//end
//if count
/* The position that the count shows, in @u.position@; the memory moves on by one sample. */
static hapt_real hapt_counted(const hapt_world *world, hapt_state *state, hapt_real position)
{
    /* A tie within 1e-9 of a count goes up. */
    const hapt_real count = hapt_floor(position / world->count + (hapt_real)0.5 + (hapt_real)1e-9);
//if foaw
    hapt_remember(state, count);
//else
    (void)state;
//end
    return count * world->count;
}

//end
//if !exact
/* The velocity from this position and those before, in @u.velocity@. */
static hapt_real hapt_estimate(const hapt_world *world, const hapt_state *state, hapt_real position)
{
    if (!state->has_last) {
        return (hapt_real)0;
    }
//if difference
    return (position - state->last_position) * world->sample_rate;
//end
//if low_pass
    return world->keep * state->last_velocity + world->gain * (position - state->last_position);
//end
//if foaw
    (void)position;
    return hapt_windowed(world, state);
//end
//if over
    return (position - hapt_then(state, HAPT_COUNTS - 1 < state->older ? HAPT_COUNTS - 1 : state->older)) * world->every_rate;
//end
}

//end
