/* -torque sin(2 pi (q - phase)/pitch), from the nearest rest */
static hapt_real hapt_detent_torque(const hapt_detent *detent, hapt_real q)
{
    const hapt_real turns = (q - detent->phase) / detent->pitch;
    const hapt_real rest = hapt_floor(turns + (hapt_real)0.5);
    return -(detent->torque * hapt_sin((hapt_real)HAPT_TAU * (turns - rest)));
}

//part torque
    case HAPT_DETENT:
        return hapt_detent_torque(&world->detent[coupling->place], q);
//part mean
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

//part mean_torque
    case HAPT_DETENT:
        return hapt_negative(hapt_detent_mean(&world->detent[curve->place], curve->from, distance));
//part solve
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
//part stored_slope
    case HAPT_DETENT: {
        const hapt_detent *detent = &world->detent[coupling->place];
        return hapt_detent_mean(detent, hapt_detent_turns(detent, start), distance).value;
    }
//part potential
//if parts_detent
    case HAPT_STORED_DETENT: {
        const hapt_stored_detent *detent = &world->stored_detent[part->index];
        const hapt_real turns = (q - detent->phase) / detent->pitch;
        const hapt_real half = (hapt_real)HAPT_PI * (turns - hapt_floor(turns + (hapt_real)0.5));
        const hapt_real sine = hapt_sin(half);
        const hapt_real well = detent->torque * detent->pitch / (hapt_real)HAPT_PI * (sine * sine);
        return lag == (hapt_real)0 ? well : well - detent->torque * hapt_sin(half + half) * lag;
    }
//end
