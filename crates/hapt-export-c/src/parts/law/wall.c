/* A spring and a damper on one side of its face, which only push. */
static hapt_real hapt_wall_torque(const hapt_wall *wall, hapt_real q, hapt_real velocity)
{
    const hapt_real depth = wall->direction * (q - wall->at);
    const hapt_real push = wall->stiffness * depth + wall->damping * (wall->direction * velocity);
    if (depth > (hapt_real)0 && push > (hapt_real)0) {
        return -(wall->direction * hapt_between(push, (hapt_real)0, wall->limit));
    }
    return (hapt_real)0;
}

