/* A torque along the acceleration: the low-passed velocity after a sample of t seconds. */
static hapt_real hapt_acceleration_smooth(const hapt_acceleration *acceleration, hapt_real smooth, hapt_real velocity, hapt_real t)
{
    return smooth + t / (acceleration->tau + t) * (velocity - smooth);
}

static hapt_real hapt_acceleration_torque(const hapt_acceleration *acceleration, hapt_real smooth, hapt_real velocity)
{
    return hapt_between(acceleration->gain * (velocity - smooth), -acceleration->limit, acceleration->limit);
}

//part torque
    case HAPT_ACCELERATION:
        return hapt_acceleration_torque(&world->acceleration[coupling->place], bristle, velocity);
