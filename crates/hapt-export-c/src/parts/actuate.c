/* What the motor is asked for: levels and limit. A NaN commands 0. */
static hapt_real hapt_command(const hapt_world *world, hapt_real torque)
{
//if levels
    torque = world->level * hapt_floor(torque / world->level + (hapt_real)0.5 + (hapt_real)1e-9);
    torque = hapt_within(torque, world->limit);
    return hapt_is_finite(torque) ? torque : (hapt_real)0;
//else
    if (hapt_abs(torque) <= world->passes) {
        return torque;
    }
    if (torque > (hapt_real)0) {
        return world->beyond;
    }
    return torque < (hapt_real)0 ? (hapt_real)0 - world->beyond : (hapt_real)0;
//end
}

