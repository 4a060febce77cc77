/* ---- One sample ---- */

//if bodies
/* Of few bodies a loop counts longer than it computes, also where the compiler looks for size; of many it would fill the flash. */
#if HAPT_BODIES > 4
#define HAPT_UNROLLED
#elif defined(__clang__)
#define HAPT_UNROLLED _Pragma("clang loop unroll(full)")
#elif defined(__GNUC__) && __GNUC__ >= 8
#define HAPT_UNROLLED _Pragma("GCC unroll 8")
#else
#define HAPT_UNROLLED
#endif

/* x += factor y */
static void hapt_add(hapt_vector *x, hapt_real factor, const hapt_vector *y)
{
    int i;
    HAPT_UNROLLED
    for (i = 0; i < HAPT_BODIES; i++) {
        x->position[i] += factor * y->position[i];
        x->velocity[i] += factor * y->velocity[i];
    }
}

/* x_{k+1} - x_k by the method's matrices (@method@): row by row, so that no sum waits in memory. */
static hapt_vector hapt_linear(const hapt_world *world, const hapt_vector *x, hapt_real position, hapt_real velocity,
                               hapt_real old_position, hapt_real old_velocity)
{
    hapt_vector change;
    int i, j;
//if !new_first
    (void)old_position;
    (void)old_velocity;
//end
    HAPT_UNROLLED
    for (i = 0; i < HAPT_BODIES; i++) {
        hapt_real dx = world->drift[0][i];
        hapt_real dv = world->drift[1][i];
//if new_first
        dx += world->input_old[0][0][i] * old_position + world->input_old[1][0][i] * old_velocity;
        dv += world->input_old[0][1][i] * old_position + world->input_old[1][1][i] * old_velocity;
//end
        dx += world->input_new[0][0][i] * position + world->input_new[1][0][i] * velocity;
        dv += world->input_new[0][1][i] * position + world->input_new[1][1][i] * velocity;
        HAPT_UNROLLED
        for (j = 0; j < HAPT_BODIES; j++) {
            dx += world->state[j][0][0][i] * x->position[j] + world->state[j][1][0][i] * x->velocity[j];
            dv += world->state[j][0][1][i] * x->position[j] + world->state[j][1][1][i] * x->velocity[j];
        }
        change.position[i] = dx;
        change.velocity[i] = dv;
    }
    return change;
}

//end
//if pushed
/* change += what the nonlinear torques do as they stand at x */
static void hapt_pushed(const hapt_world *world, hapt_vector *change, const hapt_vector *x, hapt_real position, hapt_real velocity,
                        const hapt_real *bristle)
{
    hapt_real torque[HAPT_BODY_ROOM] = {0};
    int i;
    (void)bristle;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
        if (coupling->law != HAPT_LINEAR) {
            const hapt_real q = hapt_relative(coupling, position, x->position);
            const hapt_real rate = hapt_relative(coupling, velocity, x->velocity);
//if bristles
            const hapt_real part = hapt_torque(world, coupling, q, rate, bristle[i]);
//else
            const hapt_real part = hapt_torque(world, coupling, q, rate, (hapt_real)0);
//end
            if (coupling->first >= 0) {
                torque[coupling->first] += part;
            }
            if (coupling->second >= 0) {
                torque[coupling->second] += -part;
            }
        }
    }
    for (i = 0; i < HAPT_BODIES; i++) {
        hapt_push(world, i, torque[i], change);
    }
}

//end
//if bodies
/* x_{k+1} - x_k with all torques on the bodies. */
static hapt_vector hapt_change(const hapt_world *world, const hapt_vector *x, hapt_real position, hapt_real velocity,
                               hapt_real old_position, hapt_real old_velocity, const hapt_real *bristle, hapt_real *contact,
                               uint32_t *unsettled)
{
    hapt_vector change = hapt_linear(world, x, position, velocity, old_position, old_velocity);
//if staged
    const hapt_real reach[3] = {(hapt_real)0.5, (hapt_real)0.5, (hapt_real)1};
    const hapt_real weight[3] = {(hapt_real)2, (hapt_real)2, (hapt_real)1};
    const hapt_real sixth = (hapt_real)1 / (hapt_real)6;
    hapt_vector sum;
    int i;
//end
    (void)bristle;
    (void)contact;
    (void)unsettled;
//if gradient
    hapt_gradient(world, x, position, velocity, &change, contact, unsettled);
//end
//if pushed
    hapt_pushed(world, &change, x, position, velocity, bristle);
//end
//if staged
    /* Runge-Kutta's four stages, each an Euler step; the first is there. */
    sum = change;
    for (i = 0; i < 3; i++) {
        hapt_vector at = *x;
        hapt_add(&at, reach[i], &change);
        change = hapt_linear(world, &at, position, velocity, old_position, old_velocity);
        hapt_pushed(world, &change, &at, position, velocity, bristle);
        hapt_add(&sum, weight[i], &change);
    }
    for (i = 0; i < HAPT_BODIES; i++) {
        change.position[i] = sixth * sum.position[i];
        change.velocity[i] = sixth * sum.velocity[i];
    }
//end
    return change;
}

//end
/* The couplings' torque on the puck, with the bodies as given. */
static hapt_real hapt_torque_at(const hapt_world *world, const hapt_vector *bodies, hapt_real position, hapt_real velocity,
                                const hapt_real *bristle, const hapt_real *contact)
{
    hapt_real torque = world->port_offset + world->port_puck[0] * position + world->port_puck[1] * velocity;
//if bodies
    int i;
    HAPT_UNROLLED
    for (i = 0; i < HAPT_BODIES; i++) {
        torque += world->port_bodies[0][i] * bodies->position[i] + world->port_bodies[1][i] * bodies->velocity[i];
    }
//end
    (void)bodies;
    (void)bristle;
    (void)contact;
//if nonlinear
    torque = torque + hapt_nonlinear_torque(world, bodies, position, velocity, bristle, contact);
//end
    return torque;
}

/* The sample at a position and, where the estimator is exact, a velocity. */
static hapt_sample hapt_sample_of(const hapt_world *world, hapt_state *state, hapt_real position, hapt_real velocity)
{
    hapt_sample sample;
    hapt_vector bodies;
//if bristles
    hapt_real *bristle = state->bristle;
//else
    hapt_real *bristle = 0;
//end
//if gradient
    hapt_real *contact = state->contact;
    uint32_t *unsettled = &state->unsettled;
//else
    hapt_real *contact = 0;
//if bodies
    uint32_t *unsettled = 0;
//end
//end
//if ahead
//if bristles
    hapt_real bristle_ahead[HAPT_COUPLINGS];
//end
//if gradient
    hapt_real contact_ahead[HAPT_COUPLINGS];
    uint32_t unsettled_ahead = 0;
//end
//if bodies
    hapt_vector change;
//end
    int step;
//end
//if array_loop
    int i;
//end
//if skips
    uint32_t waits;
//end
//if filter
    hapt_real measured;
//if new_first_bodies
    const hapt_real last_seen = state->filtered;
//end
//end

//if count
    position = hapt_counted(world, state, position);
//end
//if over
    hapt_remember(state, position);
//end
//if !exact
    velocity = hapt_estimate(world, state, position);
//end
//if filter
    /* The velocity is that of the measured position; the world sees the filtered one. */
    measured = position;
    if (state->has_last) {
        position = state->filtered + world->filter * (position - state->filtered);
    }
    state->filtered = position;
//end
//if skips
    waits = state->until_step < @skips@u ? state->until_step : @skips@u;
//end
//if held_bodies
//if skips
    if (waits == 0) {
        hapt_add(&state->now, (hapt_real)1, &state->change);
    }
//else
    hapt_add(&state->now, (hapt_real)1, &state->change);
//end
//end
//if bristles
    hapt_bend(world, bristle, position, velocity, &state->now);
//end
//if held_bodies
//if skips
    if (waits == 0) {
        state->change = hapt_change(world, &state->now, position, velocity, (hapt_real)0, (hapt_real)0, bristle, contact, unsettled);
    }
    state->until_step = waits == 0 ? @skips@u : waits - 1;
//else
    state->change = hapt_change(world, &state->now, position, velocity, (hapt_real)0, (hapt_real)0, bristle, contact, unsettled);
//end
//end
//if new_first_bodies
    /* This method takes the new sample first. */
    if (state->has_last) {
//if filter
        const hapt_vector change = hapt_change(world, &state->now, position, velocity, last_seen, state->last_velocity,
                                               bristle, contact, unsettled);
//else
        const hapt_vector change = hapt_change(world, &state->now, position, velocity, state->last_position, state->last_velocity,
                                               bristle, contact, unsettled);
//end
        hapt_add(&state->now, (hapt_real)1, &change);
    }
//end
//if last
    state->has_last = 1;
//if filter
    state->last_position = measured;
//else
    state->last_position = position;
//end
    state->last_velocity = velocity;
//end

    /* The torque, from the state that the output names: @output@. */
    bodies = state->now;
//if end_bodies
    hapt_add(&bodies, (hapt_real)1, &state->change);
    HAPT_UNROLLED
    for (i = 0; i < HAPT_BODIES; i++) {
        bodies.velocity[i] = state->change.position[i] * world->rate;
    }
//end
//if middle_bodies
    hapt_add(&bodies, (hapt_real)0.5, &state->change);
//end
//if ahead
    /* The world goes on without the loop, the puck held where it was seen. */
//if bodies
    hapt_add(&bodies, (hapt_real)1, &state->change);
//end
//if bristles
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        bristle_ahead[i] = bristle[i];
    }
    bristle = bristle_ahead;
//end
//if gradient
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        contact_ahead[i] = contact[i];
    }
    contact = contact_ahead;
    unsettled = &unsettled_ahead;
//end
    for (step = 0; step < @advance@; step++) {
//if bristles
        hapt_bend(world, bristle, position, (hapt_real)0, &bodies);
//end
//if bodies
        change = hapt_change(world, &bodies, position, (hapt_real)0, (hapt_real)0, (hapt_real)0, bristle, contact, unsettled);
        hapt_add(&bodies, (hapt_real)1, &change);
//end
    }
//if bodies
    for (i = 0; i < HAPT_BODIES; i++) {
        bodies.velocity[i] = change.position[i] * world->rate;
    }
//end
//end
//if filter
    sample.position = measured;
//else
    sample.position = position;
//end
    sample.velocity = velocity;
    sample.torque = hapt_torque_at(world, &bodies, position, velocity, bristle, contact);
    sample.command = hapt_command(world, sample.torque);
    return sample;
}

void hapt_state_init(hapt_state *state)
{
    int i;
    for (i = 0; i < HAPT_BODY_ROOM; i++) {
        state->now.position[i] = hapt_compiled.start[0][i];
        state->now.velocity[i] = hapt_compiled.start[1][i];
        state->change.position[i] = (hapt_real)0;
        state->change.velocity[i] = (hapt_real)0;
    }
//if skips
    state->until_step = 0;
//end
//if bristles
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        state->bristle[i] = (hapt_real)0;
    }
//end
//if gradient
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        state->contact[i] = (hapt_real)0;
    }
    state->unsettled = 0;
//end
//if last
    state->has_last = 0;
    state->last_position = (hapt_real)0;
    state->last_velocity = (hapt_real)0;
//end
//if filter
    state->filtered = (hapt_real)0;
//end
//if tracked
    state->tracked_position = (hapt_real)0;
//end
//if kalman
    state->tracked_acceleration = (hapt_real)0;
//end
//if ring
    for (i = 0; i < HAPT_COUNTS; i++) {
        state->count[i] = (hapt_real)0;
    }
    state->newest = 0;
    state->older = 0;
//end
}

//if exact
hapt_sample hapt_state_step(hapt_state *state, hapt_real position, hapt_real velocity)
{
    return hapt_sample_of(&hapt_compiled, state, position, velocity);
}
//else
hapt_sample hapt_state_step(hapt_state *state, hapt_real position)
{
    return hapt_sample_of(&hapt_compiled, state, position, (hapt_real)0);
}
//end
