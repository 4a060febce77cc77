/* -torque sin(2 pi (q - phase)/pitch), from the nearest rest */
static hapt_real hapt_detent_torque(const hapt_detent *detent, hapt_real q)
{
    const hapt_real turns = (q - detent->phase) / detent->pitch;
    const hapt_real rest = hapt_floor(turns + (hapt_real)0.5);
    return -(detent->torque * hapt_sin((hapt_real)HAPT_TAU * (turns - rest)));
}

