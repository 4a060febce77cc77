/* ---- What the world stores ---- */

/* What one step did, in J: stored after it, made by the method, given to bodies by constants. */
typedef struct {
    hapt_real stored;
    hapt_real made;
    hapt_real given;
} hapt_energies;

//if well
/* k/2 x^2 */
static hapt_real hapt_well(hapt_real half, hapt_real x)
{
    return half * (x * x);
}

//end
//if stores_spring
/* A spring's energy up to the x at which its torque is `limit`, straight from there on, less V' lag; `side` is 1 above the rest only, -1
 * below it only, 0 on both sides. */
static hapt_real hapt_spring_energy(hapt_real stiffness, hapt_real rest, hapt_real side, hapt_real limit, hapt_real q, hapt_real lag)
{
    const hapt_real x = q - rest;
    const hapt_real torque = stiffness * x;
    if (side * x < (hapt_real)0) {
        return (hapt_real)0;
    }
    if (hapt_abs(torque) <= limit) {
        return (hapt_real)0.5 * torque * x - torque * lag;
    } else {
        const hapt_real size = hapt_abs(x) - (hapt_real)0.5 * limit / stiffness;
        return limit * size - (x > (hapt_real)0 ? limit * lag : -(limit * lag));
    }
}

//end
//if parts
/* V(q) - V'(q) lag of a coupling. */
static hapt_real hapt_potential(const hapt_world *world, const hapt_part *part, hapt_real q, hapt_real bristle, hapt_real lag)
{
    (void)world;
    (void)q;
    (void)bristle;
    (void)lag;
    switch (part->kind) {
//parts potential
    default:
        return (hapt_real)0;
    }
}

//end
/* The energies of the step that the state has just taken, at this position and velocity of the puck. */
static hapt_energies hapt_energies_at(const hapt_world *world, const hapt_state *state, hapt_real position, hapt_real velocity)
{
    hapt_real before = (hapt_real)0, after = (hapt_real)0, given = (hapt_real)0, carried = (hapt_real)0, rounding;
    hapt_energies step;
//if energy_loop
    int i;
//end
    (void)world;
    (void)position;
    (void)velocity;
    (void)state;
//if bodies
    for (i = 0; i < HAPT_BODIES; i++) {
        const hapt_real w = state->now.position[i], dw = state->change.position[i];
        const hapt_real v = state->now.velocity[i], end = v + state->change.velocity[i];
        const hapt_real x = position - w - world->puck_rest[i], y = w - world->ground_rest[i];
        before += world->half_inertia[i] * (v * v) + hapt_well(world->puck_half[i], x) + hapt_well(world->ground_half[i], y);
        after += world->half_inertia[i] * (end * end) + hapt_well(world->puck_half[i], x - dw)
            + hapt_well(world->ground_half[i], y + dw);
    }
//end
//if !is_all
    {
        const hapt_real own = world->least + hapt_well(world->own_half, position - world->own_rest);
        before += own;
        after += own;
    }
//if pairs
    for (i = 0; i < @pairs@; i++) {
        const hapt_pair_of_bodies *pair = &world->pairs[i];
        const hapt_real x = state->now.position[pair->first] - state->now.position[pair->second] - pair->rest;
        const hapt_real moved = state->change.position[pair->first] - state->change.position[pair->second];
        before += hapt_well(pair->half, x);
        after += hapt_well(pair->half, x + moved);
    }
//end
//if parts
    for (i = 0; i < @parts@; i++) {
        const hapt_part *part = &world->parts[i];
        const hapt_vector *now = &state->now, *change = &state->change;
        const hapt_real between = part->of_first * now->position[part->first] - part->of_second * now->position[part->second];
        const hapt_real moved = part->of_first * change->position[part->first] - part->of_second * change->position[part->second];
        const hapt_real rate = part->of_first * now->velocity[part->first] - part->of_second * now->velocity[part->second];
        const hapt_real turned = part->of_first * change->velocity[part->first] - part->of_second * change->velocity[part->second];
        const hapt_real q = part->puck * position + between;
//if parts_bristle
        /* Of a friction alone: the room for bristles ends with the last nonlinear coupling. */
        const hapt_real bristle = part->kind == HAPT_STORED_BRISTLE ? state->bristle[part->place] : (hapt_real)0;
//else
        const hapt_real bristle = (hapt_real)0;
//end
        before += hapt_potential(world, part, q, bristle, world->lag * rate);
        after += hapt_potential(world, part, q + moved, bristle, world->lag * (rate + turned));
        given += part->constant * moved;
        if (part->carries && velocity != (hapt_real)0) {
            const hapt_real work = -(part->damping * (part->puck * velocity + moved * world->rate) * moved);
            carried += work > (hapt_real)0 ? work : (hapt_real)0;
            carried += part->friction * hapt_abs(moved);
        }
    }
//end
//end
    /* Rounding does not count as generated energy. */
    rounding = (hapt_real)16 * HAPT_EPSILON * (hapt_abs(before) + hapt_abs(after));
    step.stored = after;
    step.made = after - before - given - carried - rounding;
    step.given = given;
//if skips
    /* Where the bodies stand still, constants do no work on them. */
    if (state->until_step < @skips@u) {
        step.made = (hapt_real)0;
        step.given = (hapt_real)0;
    }
//end
//if new_first
    step.made = (hapt_real)0;
//end
    return step;
}

/* The same at the measured position: the bodies' step is measured by the position that they see, and what is stored is at the measured one. */
static hapt_energies hapt_energies_of(const hapt_world *world, const hapt_state *state, hapt_real position, hapt_real velocity)
{
//if filter_bodies
    hapt_energies step = hapt_energies_at(world, state, state->filtered, velocity);
    step.stored = hapt_energies_at(world, state, position, velocity).stored;
    return step;
//else
    return hapt_energies_at(world, state, position, velocity);
//end
}

