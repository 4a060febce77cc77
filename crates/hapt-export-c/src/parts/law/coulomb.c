/* -torque sign(q'), 0 at rest */
static hapt_real hapt_coulomb_torque(const hapt_coulomb *coulomb, hapt_real velocity)
{
    if (velocity > (hapt_real)0) {
        return -coulomb->torque;
    }
    return (hapt_real)0 > velocity ? coulomb->torque : (hapt_real)0;
}

