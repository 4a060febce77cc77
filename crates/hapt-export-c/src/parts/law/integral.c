/* The integral after a sample of t seconds at q, up to where its torque reaches the limit. */
static hapt_real hapt_integral_sum(const hapt_integral *integral, hapt_real sum, hapt_real q, hapt_real t)
{
    return hapt_between(sum + t * (q - integral->rest), -integral->most, integral->most);
}

static hapt_real hapt_integral_torque(const hapt_integral *integral, hapt_real sum)
{
    return -(integral->gain * sum);
}

//part torque
    case HAPT_INTEGRAL:
        return hapt_integral_torque(&world->integral[coupling->place], bristle);
