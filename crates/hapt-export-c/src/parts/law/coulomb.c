/* -torque sign(q'), 0 at rest */
static hapt_real hapt_coulomb_torque(const hapt_coulomb *coulomb, hapt_real velocity)
{
    if (velocity > (hapt_real)0) {
        return -coulomb->torque;
    }
    return (hapt_real)0 > velocity ? coulomb->torque : (hapt_real)0;
}

//part torque
    case HAPT_COULOMB:
        return hapt_coulomb_torque(&world->coulomb[coupling->place], velocity);
//part solving
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

//part solve
    case HAPT_COULOMB:
        return hapt_solve_coulomb(&world->coulomb[coupling->place], response);
