/* -damping q', within +-limit */
static hapt_real hapt_damper_torque(const hapt_damper *damper, hapt_real velocity)
{
    return hapt_between(-(damper->damping * velocity), -damper->limit, damper->limit);
}

