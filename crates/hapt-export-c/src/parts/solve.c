/* ---- The torques at bodies, found so that a step gains no energy ---- */

/* How the step moves one coupling as a function of its own torque, those of all others held. */
typedef struct {
    /* q at the start of the step. */
    hapt_real start;
    /* q' - q without the coupling. */
    hapt_real free;
    /* The change of q' by a unit of torque. */
    hapt_real compliance;
    /* The velocity at the end without the coupling, and its change by a unit of torque. */
    hapt_real rate;
    hapt_real mobility;
    /* The part of the velocity that the puck makes. */
    hapt_real puck_rate;
} hapt_response;

/* A coupling's torque over the step, and its derivatives by `free` and `rate`. */
typedef struct {
    hapt_real torque;
    hapt_real by_free;
    hapt_real by_rate;
} hapt_solution;

static hapt_solution hapt_solution_of(hapt_real torque, hapt_real by_free, hapt_real by_rate)
{
    hapt_solution solution;
    solution.torque = torque;
    solution.by_free = by_free;
    solution.by_rate = by_rate;
    return solution;
}

/* The same within [low, high]. */
static hapt_solution hapt_solution_within(hapt_solution solution, hapt_real low, hapt_real high)
{
    const hapt_real torque = hapt_between(solution.torque, low, high);
    return torque == solution.torque ? solution : hapt_solution_of(torque, (hapt_real)0, (hapt_real)0);
}

//if curves
/* A law as a function of the distance that a step covers. */
typedef struct {
    int law;
    int place;
    /* Where the step starts, in the law's own measure. */
    hapt_real from;
//if wall
    /* A wall's damping over T. */
    hapt_real drag;
//end
} hapt_curve;

static hapt_curve hapt_curve_of(int law, int place, hapt_real from)
{
    hapt_curve curve;
    curve.law = law;
    curve.place = place;
    curve.from = from;
//if wall
    curve.drag = (hapt_real)0;
//end
    return curve;
}

//end
//parts mean
//if curves
static hapt_pair hapt_negative(hapt_pair pair)
{
    return hapt_pair_of(-pair.value, -pair.slope);
}

/* The torque that keeps a law's energy over a distance, and its derivative. */
static hapt_pair hapt_mean_torque(const hapt_world *world, const hapt_curve *curve, hapt_real distance)
{
    switch (curve->law) {
//parts mean_torque
    default:
        return hapt_negative(hapt_pair_of((hapt_real)0, (hapt_real)0));
    }
}

/* Solves d = free + compliance F and F = law(d) for F between two ends. Newton's steps, bisected where one leaves the bracket or is
 * not half of the one before. */
static hapt_solution hapt_solve(const hapt_world *world, const hapt_response *response, hapt_real low, hapt_real high, int rising,
                                const hapt_curve *curve)
{
    hapt_real at = hapt_between(response->free, low, high);
    hapt_real longest = high - low;
    hapt_solution solution = hapt_solution_of((hapt_real)0, (hapt_real)0, (hapt_real)0);
    int step_count;
    for (step_count = 0; step_count < 120; step_count++) {
        const hapt_pair force = hapt_mean_torque(world, curve, at);
        const hapt_real residual = at - response->free - response->compliance * force.value;
        const hapt_real gradient = (hapt_real)1 - response->compliance * force.slope;
        const hapt_real step = residual / gradient;
        const hapt_real newton = at - step;
        const hapt_real rounding = hapt_abs(gradient - (hapt_real)1) * hapt_abs(response->start) / hapt_abs(gradient);
        hapt_real next;
        solution = hapt_solution_of(force.value, force.slope / gradient, (hapt_real)0);
        if (hapt_abs(step) <= (HAPT_EPSILON + HAPT_EPSILON) * (hapt_abs(at) + hapt_abs(response->free) + rounding)) {
            solution.torque = force.value - force.slope * step;
            return solution;
        }
        if ((residual > (hapt_real)0) == rising) {
            high = at;
        } else {
            low = at;
        }
        if (newton >= low && newton <= high && hapt_abs(step) <= longest) {
            longest = (hapt_real)0.5 * hapt_abs(step);
            next = newton;
        } else {
            longest = high - low;
            next = low + (hapt_real)0.5 * (high - low);
        }
        if (next == at) {
            break;
        }
        at = next;
    }
    return solution;
}

//end
//if falling
/* Solves a law that never rises: between the free motion and the motion under the torque there. */
static hapt_solution hapt_solve_falling(const hapt_world *world, const hapt_response *response, const hapt_curve *curve)
{
    const hapt_real far = response->free + response->compliance * hapt_mean_torque(world, curve, response->free).value;
    if (far < response->free) {
        return hapt_solve(world, response, far, response->free, 1, curve);
    }
    return hapt_solve(world, response, response->free, far, 1, curve);
}

//end
//if nearest
static hapt_real hapt_residual(const hapt_world *world, const hapt_response *response, const hapt_curve *curve, hapt_real distance)
{
    return distance - response->free - response->compliance * hapt_mean_torque(world, curve, distance).value;
}

/* Solves a law that may have several solutions for the one nearest to the free motion. */
static hapt_solution hapt_solve_nearest(const hapt_world *world, const hapt_response *response, hapt_real most, hapt_real fall,
                                        hapt_real steepest, hapt_real fine, const hapt_curve *curve)
{
    const hapt_real reach = response->compliance * most;
    hapt_real low = response->free - reach, high = response->free + reach;
    int rising = 1;
    if (!(fall < (hapt_real)1)) {
        hapt_real above = response->free, below = response->free;
        hapt_real above_value = hapt_residual(world, response, curve, response->free), below_value = above_value;
        const int is_above = above_value > (hapt_real)0;
        int probe;
        for (probe = 0; probe < 200; probe++) {
            const int up = above - response->free <= response->free - below;
            const hapt_real side = up ? above : below;
            const hapt_real safe = hapt_abs(up ? above_value : below_value) / ((hapt_real)1 + steepest);
            const hapt_real step = safe > fine ? safe : fine;
            const hapt_real next = up ? side + step : side - step;
            const hapt_real value = hapt_residual(world, response, curve, next);
            if ((value > (hapt_real)0) != is_above) {
                low = up ? side : next;
                high = up ? next : side;
                rising = up ? !is_above : is_above;
                break;
            }
            if (up) {
                above = next;
                above_value = value;
            } else {
                below = next;
                below_value = value;
            }
        }
    }
    return hapt_solution_within(hapt_solve(world, response, low, high, rising, curve), -most, most);
}

//end
//parts solving
/* A coupling's torque on its first end, held over the step. */
static hapt_solution hapt_solve_coupling(const hapt_world *world, const hapt_coupling *coupling, const hapt_response *response)
{
    switch (coupling->law) {
//parts solve
    default:
        return hapt_solution_of((hapt_real)0, (hapt_real)0, (hapt_real)0);
    }
}

/* (V(q + distance) - V(q))/distance of what the coupling stores; 0 for what only takes. */
static hapt_real hapt_stored_slope(const hapt_world *world, const hapt_coupling *coupling, hapt_real start, hapt_real distance)
{
    (void)world;
    (void)start;
    (void)distance;
    switch (coupling->law) {
//parts stored_slope
    default:
        return (hapt_real)0;
    }
}

