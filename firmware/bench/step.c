/* One sample of a linear world of up to ROOM bodies, output "end": what hapt-core computes, in its order, so that the bits are the
   same. n is the number of bodies: known to the compiler, or only to the world. */
enum { ROOM = 4 };

struct bodies {
    float w[ROOM], v[ROOM];
};

struct world {
    int bodies;
    float rate, limit, own[2], springs[ROOM], dampers[ROOM];
    struct bodies from_z, from_zdot, from_w[ROOM], from_wdot[ROOM];
};

struct state {
    struct bodies now, change;
};

static inline __attribute__((always_inline)) float step(const struct world *world, struct state *x, int n, float z, float zdot)
{
    struct bodies next;
    for (int i = 0; i < n; i++) {
        x->now.w[i] += x->change.w[i];
        x->now.v[i] += x->change.v[i];
        next.w[i] = world->from_z.w[i] * z + world->from_zdot.w[i] * zdot;
        next.v[i] = world->from_z.v[i] * z + world->from_zdot.v[i] * zdot;
    }
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            next.w[i] += world->from_w[j].w[i] * x->now.w[j] + world->from_wdot[j].w[i] * x->now.v[j];
            next.v[i] += world->from_w[j].v[i] * x->now.w[j] + world->from_wdot[j].v[i] * x->now.v[j];
        }
    float torque = world->own[0] * z + world->own[1] * zdot;
    for (int i = 0; i < n; i++) {
        x->change.w[i] = next.w[i];
        x->change.v[i] = next.v[i];
        torque += world->springs[i] * (x->now.w[i] + next.w[i]) + world->dampers[i] * (next.w[i] * world->rate);
    }
    return torque > world->limit ? world->limit : torque < -world->limit ? -world->limit : torque;
}

float hapt_c_any(const struct world *world, struct state *x, float z, float zdot)
{
    return step(world, x, world->bodies, z, zdot);
}

float hapt_c_1(const struct world *world, struct state *x, float z, float zdot)
{
    return step(world, x, 1, z, zdot);
}

float hapt_c_2(const struct world *world, struct state *x, float z, float zdot)
{
    return step(world, x, 2, z, zdot);
}

float hapt_c_4(const struct world *world, struct state *x, float z, float zdot)
{
    return step(world, x, 4, z, zdot);
}
