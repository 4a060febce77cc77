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
//if kalman
/* The steady Kalman filter of a constant acceleration: the velocity, and what it tracks, at a new position. */
static hapt_real hapt_followed(const hapt_world *world, hapt_state *state, hapt_real position)
{
    const hapt_real velocity = state->last_velocity, acceleration = state->tracked_acceleration;
    const hapt_real predicted = state->tracked_position + world->period * velocity + world->half_square * acceleration;
    const hapt_real error = position - predicted;
    state->tracked_position = predicted + world->of_position * error;
    state->tracked_acceleration = acceleration + world->of_acceleration * error;
    return velocity + world->period * acceleration + world->of_velocity * error;
}

//end
//if levant
/* Levant's differentiator with an implicit step: the velocity, and the position that follows, at a new position. Up to an error of `reach`
 * the position follows at once; beyond, the velocity changes by the most that it may, and the root of the rest solves a quadratic
 * equation. */
static hapt_real hapt_followed(const hapt_world *world, hapt_state *state, hapt_real position)
{
    const hapt_real before = state->tracked_position, velocity = state->last_velocity;
    const hapt_real error = before + world->period * velocity - position;
    const hapt_real beyond = hapt_abs(error) - world->reach;
    const hapt_real rest = beyond > (hapt_real)0 ? beyond : (hapt_real)0;
    const hapt_real sign = error > (hapt_real)0 ? (hapt_real)1 : (hapt_real)-1;
    const hapt_real root = (hapt_real)2 * rest / (world->pull + hapt_sqrt(world->pull * world->pull + (hapt_real)4 * rest));
    state->tracked_position = position + sign * root * root;
    return beyond > (hapt_real)0 ? velocity - sign * world->change : (position - before) * world->sample_rate;
}

//end
//if !exact
/* The velocity from this position and those before, in @u.velocity@. */
//if tracked
static hapt_real hapt_estimate(const hapt_world *world, hapt_state *state, hapt_real position)
//else
static hapt_real hapt_estimate(const hapt_world *world, const hapt_state *state, hapt_real position)
//end
{
    if (!state->has_last) {
//if tracked
        state->tracked_position = position;
//end
//if kalman
        state->tracked_acceleration = (hapt_real)0;
//end
        return (hapt_real)0;
    }
//if difference
    return (position - state->last_position) * world->sample_rate;
//end
//if low_pass
    return world->keep * state->last_velocity + world->gain * (position - state->last_position);
//end
//if tracked
    return hapt_followed(world, state, position);
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
