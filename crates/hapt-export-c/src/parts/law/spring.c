/* -stiffness (q - rest), within +-limit */
static hapt_real hapt_spring_torque(const hapt_spring *spring, hapt_real q)
{
    return hapt_between(-(spring->stiffness * (q - spring->rest)), -spring->limit, spring->limit);
}

