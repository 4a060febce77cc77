/* ---- The nonlinear couplings ---- */

/* q or q' of a coupling, from that of the puck and those of the bodies. */
static hapt_real hapt_end_at(int end, hapt_real puck, const hapt_real *bodies)
{
    return end >= 0 ? bodies[end] : (end == HAPT_PUCK ? puck : (hapt_real)0);
}

static hapt_real hapt_relative(const hapt_coupling *coupling, hapt_real puck, const hapt_real *bodies)
{
    return hapt_end_at(coupling->first, puck, bodies) - hapt_end_at(coupling->second, puck, bodies);
}

/* The torque on the first end, in @u.torque@, from q, q' and the bend of the bristle, the integral or the low-passed velocity. */
static hapt_real hapt_torque(const hapt_world *world, const hapt_coupling *coupling, hapt_real q, hapt_real velocity,
                             hapt_real bristle)
{
    (void)q;
    (void)velocity;
    (void)bristle;
    (void)world;
    switch (coupling->law) {
//parts torque
    default:
        return (hapt_real)0;
    }
}

/* The couplings' torque on the puck. */
static hapt_real hapt_nonlinear_torque(const hapt_world *world, const hapt_vector *bodies, hapt_real position, hapt_real velocity,
                                       const hapt_real *bristle, const hapt_real *contact)
{
    hapt_real torque = (hapt_real)0;
    int i;
    (void)bristle;
    (void)contact;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
        const int at_first = coupling->first == HAPT_PUCK, at_second = coupling->second == HAPT_PUCK;
        if (coupling->law != HAPT_LINEAR && at_first != at_second) {
            hapt_real part;
//if gradient
            if (coupling->found) {
                part = contact[i];
            } else
//end
            {
                const hapt_real q = hapt_relative(coupling, position, bodies->position);
                const hapt_real rate = hapt_relative(coupling, velocity, bodies->velocity);
//if bristles
                part = hapt_torque(world, coupling, q, rate, bristle[i]);
//else
                part = hapt_torque(world, coupling, q, rate, (hapt_real)0);
//end
            }
            torque += (at_first ? (hapt_real)1 : (hapt_real)-1) * part;
        }
    }
    return torque;
}

//if sources
/* The torque on the puck of what gives energy by its nature: constants, integral terms, assists and torques along the acceleration. */
static hapt_real hapt_sources(const hapt_world *world, const hapt_state *state, hapt_real velocity)
{
    hapt_real torque = world->constant;
    int i;
    (void)state;
    (void)velocity;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
//if integral
        if (coupling->law == HAPT_INTEGRAL) {
            const hapt_real part = hapt_integral_torque(&world->integral[coupling->place], state->bristle[i]);
            torque += (coupling->first == HAPT_PUCK ? (hapt_real)1 : (hapt_real)-1) * part;
        }
//end
//if acceleration
        if (coupling->law == HAPT_ACCELERATION) {
            const hapt_acceleration *acceleration = &world->acceleration[coupling->place];
            const hapt_real sign = coupling->first == HAPT_PUCK ? (hapt_real)1 : (hapt_real)-1;
            const hapt_real part = -acceleration->gain * sign * state->bristle[i] + acceleration->gain * velocity;
            torque += hapt_between(part, -acceleration->limit, acceleration->limit);
        }
//end
//if assist
        if (coupling->law == HAPT_DAMPER && world->damper[coupling->place].damping < (hapt_real)0) {
            torque += hapt_damper_torque(&world->damper[coupling->place], velocity);
        }
//end
    }
    return torque;
}

//end
//if bristles
/* Every bristle over one period, with q' as it is at this sample, and every integral and low-passed velocity by this sample. */
static void hapt_bend(const hapt_world *world, hapt_real *bristle, hapt_real position, hapt_real velocity,
                      const hapt_vector *bodies)
{
    int i;
    (void)position;
    (void)velocity;
    for (i = 0; i < HAPT_COUPLINGS; i++) {
        const hapt_coupling *coupling = &world->couplings[i];
//if lugre
        if (coupling->law == HAPT_LUGRE) {
            const hapt_real rate = hapt_relative(coupling, velocity, bodies->velocity);
            bristle[i] = hapt_lugre_bend(&world->lugre[coupling->place], bristle[i], rate, world->period);
        }
//end
//if integral
        if (coupling->law == HAPT_INTEGRAL) {
            const hapt_real q = hapt_relative(coupling, position, bodies->position);
            bristle[i] = hapt_integral_sum(&world->integral[coupling->place], bristle[i], q, world->period);
        }
//end
//if acceleration
        if (coupling->law == HAPT_ACCELERATION) {
            const hapt_real rate = hapt_relative(coupling, velocity, bodies->velocity);
            bristle[i] = hapt_acceleration_smooth(&world->acceleration[coupling->place], bristle[i], rate, world->period);
        }
//end
    }
}

//end
