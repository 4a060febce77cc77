/* A spring and a damper on one side of its face, which only push. */
static hapt_real hapt_wall_torque(const hapt_wall *wall, hapt_real q, hapt_real velocity)
{
    const hapt_real depth = wall->direction * (q - wall->at);
    const hapt_real push = wall->stiffness * depth + wall->damping * (wall->direction * velocity);
    if (depth > (hapt_real)0 && push > (hapt_real)0) {
        return -(wall->direction * hapt_between(push, (hapt_real)0, wall->limit));
    }
    return (hapt_real)0;
}

//part torque
    case HAPT_WALL:
        return hapt_wall_torque(&world->wall[coupling->place], q, velocity);
//part mean
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

//part mean_torque
    case HAPT_WALL:
        return hapt_wall_push(&world->wall[curve->place], curve->from, curve->drag, distance);
//part solving
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

//part solve
    case HAPT_WALL:
        return hapt_solve_wall(world, coupling->place, response);
//part stored_slope
    case HAPT_WALL: {
        const hapt_wall *wall = &world->wall[coupling->place];
        const hapt_ramp ramp = hapt_ramp_of(wall->stiffness, (hapt_real)0, wall->limit);
        return wall->direction
            * hapt_ramp_mean(ramp, wall->direction * (start - wall->at), wall->direction * distance).value;
    }
