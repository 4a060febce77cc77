/* -stiffness (q - rest), within +-limit */
static hapt_real hapt_spring_torque(const hapt_spring *spring, hapt_real q)
{
    return hapt_between(-(spring->stiffness * (q - spring->rest)), -spring->limit, spring->limit);
}

//part torque
    case HAPT_SPRING:
        return hapt_spring_torque(&world->spring[coupling->place], q);
//part mean_torque
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[curve->place];
        const hapt_ramp ramp = hapt_ramp_of(spring->stiffness, -spring->limit, spring->limit);
        return hapt_negative(hapt_ramp_mean(ramp, curve->from, distance));
    }
//part solve
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[coupling->place];
        hapt_response from_rest = *response;
        hapt_curve curve;
        from_rest.start = response->start - spring->rest;
        curve = hapt_curve_of(HAPT_SPRING, coupling->place, from_rest.start);
        return hapt_solution_within(hapt_solve_falling(world, &from_rest, &curve), -spring->limit, spring->limit);
    }
//part stored_slope
    case HAPT_SPRING: {
        const hapt_spring *spring = &world->spring[coupling->place];
        const hapt_ramp ramp = hapt_ramp_of(spring->stiffness, -spring->limit, spring->limit);
        return hapt_ramp_mean(ramp, start - spring->rest, distance).value;
    }
//part potential
//if parts_spring
    case HAPT_STORED_SPRING: {
        const hapt_stored_spring *spring = &world->stored_spring[part->index];
        return hapt_spring_energy(spring->stiffness, spring->rest, spring->side, spring->limit, q, lag);
    }
//end
