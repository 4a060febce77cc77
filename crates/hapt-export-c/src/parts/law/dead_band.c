/* A spring that begins at +-width from its rest. */
static hapt_real hapt_dead_band_torque(const hapt_dead_band *band, hapt_real q)
{
    const hapt_real x = q - band->rest;
    const hapt_real beyond = x - hapt_between(x, -band->width, band->width);
    return hapt_between(-(band->stiffness * beyond), -band->limit, band->limit);
}

//part torque
    case HAPT_DEAD_BAND:
        return hapt_dead_band_torque(&world->dead_band[coupling->place], q);
//part mean
/* The mean slope of what a dead band stores, from x = q - rest: two walls face to face. */
static hapt_pair hapt_dead_band_mean(const hapt_dead_band *band, hapt_real x, hapt_real distance)
{
    const hapt_ramp wall = hapt_ramp_of(band->stiffness, (hapt_real)0, band->limit);
    const hapt_pair above = hapt_ramp_mean(wall, x - band->width, distance);
    const hapt_pair below = hapt_ramp_mean(wall, -x - band->width, -distance);
    return hapt_pair_of(above.value - below.value, above.slope + below.slope);
}

//part mean_torque
    case HAPT_DEAD_BAND:
        return hapt_negative(hapt_dead_band_mean(&world->dead_band[curve->place], curve->from, distance));
//part solve
    case HAPT_DEAD_BAND: {
        const hapt_dead_band *band = &world->dead_band[coupling->place];
        hapt_response from_rest = *response;
        hapt_curve curve;
        from_rest.start = response->start - band->rest;
        curve = hapt_curve_of(HAPT_DEAD_BAND, coupling->place, from_rest.start);
        return hapt_solution_within(hapt_solve_falling(world, &from_rest, &curve), -band->limit, band->limit);
    }
//part stored_slope
    case HAPT_DEAD_BAND: {
        const hapt_dead_band *band = &world->dead_band[coupling->place];
        return hapt_dead_band_mean(band, start - band->rest, distance).value;
    }
//part potential
//if parts_dead_band
    case HAPT_STORED_DEAD_BAND: {
        const hapt_stored_dead_band *band = &world->stored_dead_band[part->index];
        const hapt_real side = q - band->rest > (hapt_real)0 ? (hapt_real)1 : (hapt_real)-1;
        return hapt_spring_energy(band->stiffness, band->rest + side * band->width, side, band->limit, q, lag);
    }
//end
