/* A spring that begins at +-width from its rest. */
static hapt_real hapt_dead_band_torque(const hapt_dead_band *band, hapt_real q)
{
    const hapt_real x = q - band->rest;
    const hapt_real beyond = x - hapt_between(x, -band->width, band->width);
    return hapt_between(-(band->stiffness * beyond), -band->limit, band->limit);
}

