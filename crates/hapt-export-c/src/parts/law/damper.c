/* -damping q', within +-limit */
static hapt_real hapt_damper_torque(const hapt_damper *damper, hapt_real velocity)
{
    return hapt_between(-(damper->damping * velocity), -damper->limit, damper->limit);
}

//part torque
    case HAPT_DAMPER:
        return hapt_damper_torque(&world->damper[coupling->place], velocity);
//part solving
static hapt_solution hapt_solve_damper(const hapt_world *world, const hapt_damper *damper, const hapt_response *response)
{
    const hapt_real drag = damper->damping * world->rate;
    const hapt_real whole = (hapt_real)1 + drag * response->compliance;
    const hapt_real torque = -(drag * response->free + damper->damping * response->puck_rate) / whole;
    return hapt_solution_within(hapt_solution_of(torque, -(drag / whole), (hapt_real)0), -damper->limit, damper->limit);
}

//part solve
    case HAPT_DAMPER:
        return hapt_solve_damper(world, &world->damper[coupling->place], response);
