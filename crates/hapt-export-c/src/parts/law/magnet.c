/* -torque x exp((1 - x^2)/2), x = (q - at)/width */
static hapt_real hapt_magnet_torque(const hapt_magnet *magnet, hapt_real q)
{
    const hapt_real x = (q - magnet->at) / magnet->width;
    return -(magnet->torque * (hapt_real)HAPT_ROOT_E * x * hapt_exp(-((hapt_real)0.5 * x * x)));
}

//part torque
    case HAPT_MAGNET:
        return hapt_magnet_torque(&world->magnet[coupling->place], q);
//part mean
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

//part mean_torque
    case HAPT_MAGNET:
        return hapt_negative(hapt_magnet_mean(&world->magnet[curve->place], curve->from, distance));
//part solve
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
//part stored_slope
    case HAPT_MAGNET: {
        const hapt_magnet *magnet = &world->magnet[coupling->place];
        return hapt_magnet_mean(magnet, (start - magnet->at) / magnet->width, distance).value;
    }
//part potential
//if parts_magnet
    case HAPT_STORED_MAGNET: {
        const hapt_stored_magnet *magnet = &world->stored_magnet[part->index];
        const hapt_real x = (q - magnet->at) / magnet->width;
        const hapt_real fall = hapt_expm1(-((hapt_real)0.5 * x * x));
        const hapt_real scale = magnet->torque * (hapt_real)HAPT_ROOT_E;
        return -(scale * magnet->width * fall) - scale * x * ((hapt_real)1 + fall) * lag;
    }
//end
