/* -torque x exp((1 - x^2)/2), x = (q - at)/width */
static hapt_real hapt_magnet_torque(const hapt_magnet *magnet, hapt_real q)
{
    const hapt_real x = (q - magnet->at) / magnet->width;
    return -(magnet->torque * (hapt_real)HAPT_ROOT_E * x * hapt_exp(-((hapt_real)0.5 * x * x)));
}

