/* A nonlinear coupling with a body at an end. */
static int hapt_at_body(const hapt_coupling *coupling)
{
    return coupling->law != HAPT_LINEAR && (coupling->first >= 0 || coupling->second >= 0);
}

/* The change of a body's position (0) or velocity (1) by a unit of torque on another. */
static hapt_real hapt_entry(const hapt_world *world, int half, int of, int by)
{
    return of >= 0 && by >= 0 ? world->force[by][half][of] : (hapt_real)0;
}

/* The change of another coupling's q (0) or q' (1) by a unit of torque at one. */
static hapt_real hapt_across(const hapt_world *world, int half, const hapt_coupling *one, const hapt_coupling *other)
{
    return hapt_entry(world, half, one->first, other->first) + hapt_entry(world, half, one->second, other->second)
        - (hapt_entry(world, half, one->first, other->second) + hapt_entry(world, half, one->second, other->first));
}

/* change += what a coupling's torque does */
static void hapt_push_ends(const hapt_world *world, const hapt_coupling *coupling, hapt_real torque, hapt_vector *change)
{
    hapt_push(world, coupling->first, torque, change);
    hapt_push(world, coupling->second, -torque, change);
}

static hapt_response hapt_response_of(const hapt_world *world, const hapt_coupling *coupling, const hapt_vector *x, hapt_real position,
                                      hapt_real velocity, const hapt_vector *change, hapt_real torque, int stops)
{
    const hapt_real compliance = hapt_across(world, 0, coupling, coupling), mobility = hapt_across(world, 1, coupling, coupling);
    hapt_response response;
    response.start = hapt_relative(coupling, position, x->position);
    response.free = hapt_relative(coupling, (hapt_real)0, change->position) - compliance * torque;
    response.compliance = compliance;
    response.rate = hapt_relative(coupling, (hapt_real)0, x->velocity) + hapt_relative(coupling, (hapt_real)0, change->velocity)
        - mobility * torque;
    response.mobility = stops ? mobility : (hapt_real)0;
    response.puck_rate = (coupling->first == HAPT_PUCK       ? (hapt_real)1
                          : coupling->second == HAPT_PUCK ? (hapt_real)-1
                                                          : (hapt_real)0)
        * velocity;
    return response;
}

/* One step of Newton's method for all torques at once. */
static void hapt_newton(const hapt_world *world, const hapt_vector *x, hapt_real position, hapt_real velocity, hapt_vector *change,
                        hapt_real *torque, int stops)
{
    hapt_real rows[HAPT_COUPLINGS][HAPT_COUPLINGS] = {{0}};
    hapt_real steps[HAPT_COUPLINGS] = {0};
    int i, j, k;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
        rows[i][i] = (hapt_real)1;
        if (hapt_at_body(coupling)) {
            const hapt_response response = hapt_response_of(world, coupling, x, position, velocity, change, torque[i], stops);
            const hapt_solution solution = hapt_solve_coupling(world, coupling, &response);
            steps[i] = solution.torque - torque[i];
            for (j = 0; j < HAPT_COUPLINGS; j++) {
                const hapt_coupling *other = &world->couplings[j];
                if (i != j && hapt_at_body(other)) {
                    rows[i][j] = -(solution.by_free * hapt_across(world, 0, coupling, other)
                                   + solution.by_rate * hapt_across(world, 1, coupling, other));
                }
            }
        }
    }
    for (k = 0; k < HAPT_COUPLINGS; k++) {
        if (!(rows[k][k] > (hapt_real)1e-6)) {
            /* A torque that the others determine already, or a NaN, gets no correction. */
            for (j = 0; j < HAPT_COUPLINGS; j++) {
                rows[k][j] = j == k ? (hapt_real)1 : (hapt_real)0;
            }
            steps[k] = (hapt_real)0;
        }
        for (i = k + 1; i < HAPT_COUPLINGS; i++) {
            const hapt_real part = rows[i][k] / rows[k][k];
            if (part != (hapt_real)0) {
                for (j = k; j < HAPT_COUPLINGS; j++) {
                    rows[i][j] -= part * rows[k][j];
                }
                steps[i] -= part * steps[k];
            }
        }
    }
    for (i = HAPT_COUPLINGS - 1; i >= 0; i--) {
        for (j = i + 1; j < HAPT_COUPLINGS; j++) {
            steps[i] -= rows[i][j] * steps[j];
        }
        steps[i] = steps[i] / rows[i][i];
    }
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        if (hapt_at_body(&world->couplings[i]) && hapt_is_finite(steps[i])) {
            hapt_push_ends(world, &world->couplings[i], steps[i], change);
            torque[i] += steps[i];
        }
    }
}

static void hapt_raise(hapt_real *scale, hapt_real size)
{
    if (size > *scale) {
        *scale = size;
    }
}

/* Solves one coupling's torque, the others' held; whether it was converged before. */
static int hapt_solve_one(const hapt_world *world, const hapt_coupling *coupling, const hapt_vector *x, hapt_real position,
                          hapt_real velocity, hapt_vector *change, hapt_real *torque, hapt_real *scale, int stops)
{
    const hapt_real old = *torque, bits = (hapt_real)4 * HAPT_EPSILON;
    hapt_response response;
    hapt_real next, by;
//if wall
    if (old == (hapt_real)0 && coupling->law == HAPT_WALL) {
        /* Out of reach: the common case, and cheap to see. */
        const hapt_wall *wall = &world->wall[coupling->place];
        const hapt_real depth = wall->direction * (hapt_relative(coupling, position, x->position) - wall->at);
        const hapt_real distance = hapt_relative(coupling, (hapt_real)0, change->position);
        if (depth <= (hapt_real)0 && depth + wall->direction * distance <= (hapt_real)0) {
            return 1;
        }
    }
//end
    response = hapt_response_of(world, coupling, x, position, velocity, change, old, stops);
    next = hapt_solve_coupling(world, coupling, &response).torque;
    by = next - old;
    if (by == (hapt_real)0) {
        return 1;
    }
    hapt_push_ends(world, coupling, by, change);
    *torque = next;
    hapt_raise(scale, hapt_abs(response.start));
    hapt_raise(scale, hapt_abs(response.free));
    hapt_raise(scale, response.compliance * hapt_abs(next));
    return hapt_abs(by) <= bits * hapt_abs(next) || response.compliance * hapt_abs(by) <= bits * *scale;
}

/* Takes the energy that unconverged torques would add from the bodies' motion. */
static void hapt_dissipate(const hapt_world *world, const hapt_vector *x, hapt_real position, hapt_vector *change, hapt_real *torque)
{
    hapt_real gain = (hapt_real)0, size = (hapt_real)0, moving = (hapt_real)0, kept;
    int i;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
        if (hapt_at_body(coupling)) {
            const hapt_real start = hapt_relative(coupling, position, x->position);
            const hapt_real distance = hapt_relative(coupling, (hapt_real)0, change->position);
            const hapt_real slope = hapt_stored_slope(world, coupling, start, distance);
            gain += (torque[i] + slope) * distance;
            size += (hapt_abs(torque[i]) + hapt_abs(slope)) * (hapt_abs(start) + hapt_abs(distance));
        }
    }
    if (gain <= (hapt_real)16 * HAPT_EPSILON * size) {
        return;
    }
    for (i = 0; i < HAPT_BODIES; i++) {
        const hapt_real v = x->velocity[i] + change->velocity[i];
        moving += (hapt_real)0.5 * world->inertia[i] * (v * v);
    }
    kept = gain < moving ? (hapt_real)1 - gain / moving : (hapt_real)0;
    if (kept <= (hapt_real)0) {
        for (i = 0; i < HAPT_BODIES; i++) {
            change->position[i] = (hapt_real)0;
        }
        for (i = 0; i < HAPT_COUPLINGS; i++) {
            torque[i] = (hapt_real)0;
        }
    }
    for (i = 0; i < HAPT_BODIES; i++) {
        change->velocity[i] = kept * (x->velocity[i] + change->velocity[i]) - x->velocity[i];
    }
}

/* Adds the nonlinear torques' motion to `change`, coupling by coupling until a round changes nothing; every fourth round is followed by a
 * step of Newton's method for all. */
static void hapt_gradient(const hapt_world *world, const hapt_vector *x, hapt_real position, hapt_real velocity, hapt_vector *change,
                          hapt_real *torque, uint32_t *unsettled)
{
    int unchecked = @contacts@, pass, i;
    hapt_real scale = hapt_abs(position);
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        torque[i] = (hapt_real)0;
    }
    for (pass = 0; pass < 60; pass++) {
        const int stops = pass < 30;
        for (i = 0; i < HAPT_COUPLINGS; i++) {
            const hapt_coupling *coupling = &world->couplings[i];
            if (hapt_at_body(coupling)) {
                if (hapt_solve_one(world, coupling, x, position, velocity, change, &torque[i], &scale, stops)) {
                    unchecked -= 1;
                } else {
                    unchecked = @contacts@ - 1;
                }
                if (unchecked <= 0) {
                    return;
                }
            }
        }
        if (pass % 4 == 3 && pass + 1 < 60) {
            hapt_newton(world, x, position, velocity, change, torque, stops);
            unchecked = @contacts@;
        }
    }
    *unsettled += *unsettled < 0xffffffffu ? 1 : 0;
    hapt_dissipate(world, x, position, change, torque);
}

