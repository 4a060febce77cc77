/* change += what a torque on a coupling's two ends does */
static void hapt_push(const hapt_world *world, int body, hapt_real torque, hapt_vector *change)
{
    int i;
    if (body >= 0) {
        for (i = 0; i < HAPT_BODIES; i++) {
            change->position[i] += torque * world->force[body][0][i];
            change->velocity[i] += torque * world->force[body][1][i];
        }
    }
}

