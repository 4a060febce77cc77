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
//if wall
/* How hard a wall pushes, outward from x > 0, over a distance. */
static hapt_pair hapt_wall_push(const hapt_wall *wall, hapt_real from, hapt_real drag, hapt_real distance)
{
    const hapt_ramp ramp = hapt_ramp_of(wall->stiffness, (hapt_real)0, wall->limit);
    const hapt_pair mean = hapt_ramp_mean(ramp, from, distance);
    const hapt_real sum = mean.value + drag * distance;
    if (sum > wall->limit) {
        return hapt_pair_of(-wall->limit, (hapt_real)0);
    }
    return sum > (hapt_real)0 ? hapt_pair_of(-sum, -(mean.slope + drag)) : hapt_pair_of((hapt_real)0, (hapt_real)0);
}

//end
//if dead_band
/* The mean slope of what a dead band stores, from x = q - rest: two walls face to face. */
static hapt_pair hapt_dead_band_mean(const hapt_dead_band *band, hapt_real x, hapt_real distance)
{
    const hapt_ramp wall = hapt_ramp_of(band->stiffness, (hapt_real)0, band->limit);
    const hapt_pair above = hapt_ramp_mean(wall, x - band->width, distance);
    const hapt_pair below = hapt_ramp_mean(wall, -x - band->width, -distance);
    return hapt_pair_of(above.value - below.value, above.slope + below.slope);
}

//end
//if detent
/* q from the nearest rest, in turns. */
static hapt_real hapt_detent_turns(const hapt_detent *detent, hapt_real q)
{
    const hapt_real turns = (q - detent->phase) / detent->pitch;
    return turns - hapt_floor(turns + (hapt_real)0.5);
}

/* The mean slope of what a detent stores. */
static hapt_pair hapt_detent_mean(const hapt_detent *detent, hapt_real from, hapt_real distance)
{
    const hapt_real tau = (hapt_real)HAPT_TAU;
    const hapt_real half = (hapt_real)0.5 * (distance / detent->pitch);
    const hapt_real angle = tau * half;
    const hapt_real share = angle == (hapt_real)0 ? (hapt_real)1 : hapt_sin(angle) / angle;
    const hapt_real mean = detent->torque * (hapt_sin(tau * (from + half)) * share);
    if (hapt_abs(half) > (hapt_real)(1.0 / 64.0)) {
        return hapt_pair_of(mean, (detent->torque * hapt_sin(tau * (from + half + half)) - mean) / distance);
    }
    return hapt_pair_of(mean, detent->torque * (hapt_real)0.5 * (tau / detent->pitch)
                                  * hapt_sin(tau * (from + half + (hapt_real)0.25)));
}

//end
//if magnet
/* The mean slope of what a magnet stores, from x in widths. */
static hapt_pair hapt_magnet_mean(const hapt_magnet *magnet, hapt_real x, hapt_real distance)
{
    const hapt_real way = distance / magnet->width;
    const hapt_real end = x + way;
    const hapt_real middle = x + (hapt_real)0.5 * way;
    const int is_end = hapt_abs(end) < hapt_abs(x);
    const hapt_real nearest = is_end ? end : x, u = is_end ? -(way * middle) : way * middle;
    const hapt_real share = u > (hapt_real)0 ? -(hapt_expm1(-u) / u) : (hapt_real)1;
    const hapt_real scale = magnet->torque * (hapt_real)HAPT_ROOT_E;
    const hapt_real mean = scale * middle * (hapt_exp(-((hapt_real)0.5 * nearest * nearest)) * share);
    if (hapt_abs(way) > (hapt_real)(1.0 / 64.0)) {
        return hapt_pair_of(mean, (scale * end * hapt_exp(-((hapt_real)0.5 * end * end)) - mean) / distance);
    } else {
        const hapt_real square = middle * middle;
        return hapt_pair_of(mean, (hapt_real)0.5 * (scale / magnet->width) * ((hapt_real)1 - square)
                                      * hapt_exp(-((hapt_real)0.5 * square)));
    }
}

//end
//if texture
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

//end
//if curves
static hapt_pair hapt_negative(hapt_pair pair)
{
    return hapt_pair_of(-pair.value, -pair.slope);
}

/* The torque that keeps a law's energy over a distance, and its derivative. */
static hapt_pair hapt_mean_torque(const hapt_world *world, const hapt_curve *curve, hapt_real distance)
{
    switch (curve->law) {
//if wall
    case HAPT_WALL:
        return hapt_wall_push(&world->wall[curve->place], curve->from, curve->drag, distance);
//end
//if spring
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[curve->place];
        const hapt_ramp ramp = hapt_ramp_of(spring->stiffness, -spring->limit, spring->limit);
        return hapt_negative(hapt_ramp_mean(ramp, curve->from, distance));
    }
//end
//if detent
    case HAPT_DETENT:
        return hapt_negative(hapt_detent_mean(&world->detent[curve->place], curve->from, distance));
//end
//if dead_band
    case HAPT_DEAD_BAND:
        return hapt_negative(hapt_dead_band_mean(&world->dead_band[curve->place], curve->from, distance));
//end
//if magnet
    case HAPT_MAGNET:
        return hapt_negative(hapt_magnet_mean(&world->magnet[curve->place], curve->from, distance));
//end
//if texture
    case HAPT_TEXTURE:
        return hapt_texture_mean(&world->texture[curve->place], curve->from, distance);
//end
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
//if wall
static hapt_solution hapt_solve_wall(const hapt_world *world, int place, const hapt_response *response)
{
    const hapt_wall *wall = &world->wall[place];
    const hapt_real drag = wall->damping * world->rate;
    hapt_response inward = *response;
    hapt_curve curve;
    hapt_solution solution;
    inward.start = wall->direction * (response->start - wall->at);
    inward.free = wall->direction * response->free;
    curve = hapt_curve_of(HAPT_WALL, place, inward.start);
    if (drag > (hapt_real)0) {
        /* Damping acts where the middle of the way is inside. */
        const hapt_real edge = -(inward.start + inward.start);
        const hapt_real damped = hapt_wall_push(wall, inward.start, drag, edge).value;
        const hapt_real undamped = hapt_wall_push(wall, inward.start, (hapt_real)0, edge).value;
        if (edge - inward.free - inward.compliance * damped <= (hapt_real)0) {
            curve.drag = drag;
        } else if (edge - inward.free - inward.compliance * undamped < (hapt_real)0) {
            solution = hapt_solution_of((edge - inward.free) / inward.compliance, -((hapt_real)1 / inward.compliance), (hapt_real)0);
            solution = hapt_solution_within(solution, -wall->limit, (hapt_real)0);
            solution.torque = wall->direction * solution.torque;
            return solution;
        }
    }
    solution = hapt_solution_within(hapt_solve_falling(world, &inward, &curve), -wall->limit, (hapt_real)0);
    solution.torque = wall->direction * solution.torque;
    return solution;
}

//end
//if damper
static hapt_solution hapt_solve_damper(const hapt_world *world, const hapt_damper *damper, const hapt_response *response)
{
    const hapt_real drag = damper->damping * world->rate;
    const hapt_real whole = (hapt_real)1 + drag * response->compliance;
    const hapt_real torque = -(drag * response->free + damper->damping * response->puck_rate) / whole;
    return hapt_solution_within(hapt_solution_of(torque, -(drag / whole), (hapt_real)0), -damper->limit, damper->limit);
}

//end
//if coulomb
/* Of the torques that oppose the motion, or make it 0, the one that brings the velocity nearest to rest. */
static hapt_solution hapt_solve_coulomb(const hapt_coulomb *coulomb, const hapt_response *response)
{
    hapt_solution most, stop;
    if (response->free == (hapt_real)0) {
        return hapt_solution_of((hapt_real)0, (hapt_real)0, (hapt_real)0);
    }
    most = hapt_solution_of(-(response->free / response->compliance), -((hapt_real)1 / response->compliance), (hapt_real)0);
    most = hapt_solution_within(most, -coulomb->torque, coulomb->torque);
    if (response->mobility <= (hapt_real)0) {
        return most;
    }
    stop = hapt_solution_of(-(response->rate / response->mobility), (hapt_real)0, -((hapt_real)1 / response->mobility));
    if (most.torque > (hapt_real)0) {
        return stop.torque > most.torque ? most : hapt_solution_within(stop, (hapt_real)0, most.torque);
    }
    return stop.torque < most.torque ? most : hapt_solution_within(stop, most.torque, (hapt_real)0);
}

//end
/* A coupling's torque on its first end, held over the step. */
static hapt_solution hapt_solve_coupling(const hapt_world *world, const hapt_coupling *coupling, const hapt_response *response)
{
    switch (coupling->law) {
//if wall
    case HAPT_WALL:
        return hapt_solve_wall(world, coupling->place, response);
//end
//if spring
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[coupling->place];
        hapt_response from_rest = *response;
        hapt_curve curve;
        from_rest.start = response->start - spring->rest;
        curve = hapt_curve_of(HAPT_SPRING, coupling->place, from_rest.start);
        return hapt_solution_within(hapt_solve_falling(world, &from_rest, &curve), -spring->limit, spring->limit);
    }
//end
//if damper
    case HAPT_DAMPER:
        return hapt_solve_damper(world, &world->damper[coupling->place], response);
//end
//if detent
    case HAPT_DETENT: {
        const hapt_detent *detent = &world->detent[coupling->place];
        const hapt_real from = hapt_detent_turns(detent, response->start);
        const hapt_curve curve = hapt_curve_of(HAPT_DETENT, coupling->place, from);
        hapt_response from_rest = *response;
        hapt_real turn;
        from_rest.start = from * detent->pitch;
        turn = response->compliance * detent->torque * (hapt_real)HAPT_PI / detent->pitch;
        return hapt_solve_nearest(world, &from_rest, detent->torque, turn, turn, detent->pitch * (hapt_real)(1.0 / 64.0), &curve);
    }
//end
//if dead_band
    case HAPT_DEAD_BAND: {
        const hapt_dead_band *band = &world->dead_band[coupling->place];
        hapt_response from_rest = *response;
        hapt_curve curve;
        from_rest.start = response->start - band->rest;
        curve = hapt_curve_of(HAPT_DEAD_BAND, coupling->place, from_rest.start);
        return hapt_solution_within(hapt_solve_falling(world, &from_rest, &curve), -band->limit, band->limit);
    }
//end
//if magnet
    case HAPT_MAGNET: {
        const hapt_magnet *magnet = &world->magnet[coupling->place];
        hapt_response from_place = *response;
        hapt_curve curve;
        hapt_real turn;
        from_place.start = response->start - magnet->at;
        curve = hapt_curve_of(HAPT_MAGNET, coupling->place, from_place.start / magnet->width);
        turn = (hapt_real)0.5 * response->compliance * magnet->torque / magnet->width;
        return hapt_solve_nearest(world, &from_place, magnet->torque, (hapt_real)(2.0 / 2.718281828459045) * turn,
                                  (hapt_real)HAPT_ROOT_E * turn, magnet->width * (hapt_real)(1.0 / 64.0), &curve);
    }
//end
//if texture
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
//end
//if coulomb
    case HAPT_COULOMB:
        return hapt_solve_coulomb(&world->coulomb[coupling->place], response);
//end
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
//if wall
    case HAPT_WALL: {
        const hapt_wall *wall = &world->wall[coupling->place];
        const hapt_ramp ramp = hapt_ramp_of(wall->stiffness, (hapt_real)0, wall->limit);
        return wall->direction
            * hapt_ramp_mean(ramp, wall->direction * (start - wall->at), wall->direction * distance).value;
    }
//end
//if spring
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[coupling->place];
        const hapt_ramp ramp = hapt_ramp_of(spring->stiffness, -spring->limit, spring->limit);
        return hapt_ramp_mean(ramp, start - spring->rest, distance).value;
    }
//end
//if detent
    case HAPT_DETENT: {
        const hapt_detent *detent = &world->detent[coupling->place];
        return hapt_detent_mean(detent, hapt_detent_turns(detent, start), distance).value;
    }
//end
//if dead_band
    case HAPT_DEAD_BAND: {
        const hapt_dead_band *band = &world->dead_band[coupling->place];
        return hapt_dead_band_mean(band, start - band->rest, distance).value;
    }
//end
//if magnet
    case HAPT_MAGNET: {
        const hapt_magnet *magnet = &world->magnet[coupling->place];
        return hapt_magnet_mean(magnet, (start - magnet->at) / magnet->width, distance).value;
    }
//end
//if texture
    case HAPT_TEXTURE: {
        const hapt_texture *texture = &world->texture[coupling->place];
        return -hapt_texture_mean(texture, hapt_texture_turns(texture, start), distance).value;
    }
//end
    default:
        return (hapt_real)0;
    }
}

