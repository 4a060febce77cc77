/* LuGre friction: the rate at which the bristle forgets, in 1/s; infinite where the friction's level is 0. */
static hapt_real hapt_lugre_rate(const hapt_lugre *lugre, hapt_real velocity)
{
    const hapt_real ratio = velocity / lugre->stribeck_velocity;
    const hapt_real level = lugre->coulomb + (lugre->stribeck - lugre->coulomb) * hapt_exp(-(ratio * ratio));
    return lugre->bristle_stiffness * hapt_abs(velocity) / level;
}

/* The bristle after t seconds at constant velocity. */
static hapt_real hapt_lugre_bend(const hapt_lugre *lugre, hapt_real bristle, hapt_real velocity, hapt_real t)
{
    const hapt_real rate = hapt_lugre_rate(lugre, velocity);
    const hapt_real forgotten = hapt_expm1(-(rate * t));
    return rate > (hapt_real)0 ? bristle + bristle * forgotten - velocity * forgotten / rate : bristle + velocity * t;
}

static hapt_real hapt_lugre_torque(const hapt_lugre *lugre, hapt_real bristle, hapt_real velocity)
{
    /* An unbent bristle at an infinite rate bends no further. */
    const hapt_real rate = hapt_lugre_rate(lugre, velocity);
    const hapt_real slip = HAPT_INFINITY > rate ? velocity - rate * bristle : (hapt_real)0;
    return -(lugre->bristle_stiffness * bristle + lugre->bristle_damping * slip + lugre->viscous * velocity);
}

//part torque
    case HAPT_LUGRE:
        return hapt_lugre_torque(&world->lugre[coupling->place], bristle, velocity);
//part potential
//if parts_bristle
    case HAPT_STORED_BRISTLE:
        return (hapt_real)0.5 * world->stored_bristle[part->index].stiffness * (bristle * bristle);
//end
