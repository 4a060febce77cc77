/* ---- The ledgers of energy: at the port, and inside of the world ---- */

static hapt_real hapt_held_ago(const hapt_controller *self, uint32_t age)
{
    return self->held[(self->newest_held % 16 + 16 - age % 16) % 16];
}

static void hapt_hold(hapt_controller *self, hapt_real torque)
{
    self->newest_held = (self->newest_held % 16 + 1) % 16;
    self->held[self->newest_held] = torque;
}

/* The account after this sample; it is opened anew where it is closed. */
static hapt_real hapt_account(const hapt_world *world, hapt_controller *self, const hapt_energies *step, hapt_real position,
                              hapt_real torque, uint32_t missed)
{
    const hapt_real dz = position - self->booked_position;
    hapt_real paid = world->ledger_damping * (dz * dz), held;
    if (!self->has_booked) {
        /* What the motor holds of before is booked as the world's, as fades are: what is stored belongs to this torque. */
        uint32_t i;
        self->made = (hapt_real)0;
        self->under_way = (hapt_real)0;
        for (i = 0; i < 16; i++) {
            self->held[i] = torque;
        }
        return step->stored + world->energy;
    }
    if (@ledger_delay@ >= 14) {
        return step->stored + world->energy;
    }
    if (missed > 0) {
        /* What the motor held while no sample came it held on. */
        uint32_t i;
        for (i = 0; i < missed && i < 15; i++) {
            hapt_hold(self, hapt_held_ago(self, 0));
        }
        paid = paid / (hapt_real)((double)missed + 1.0);
    }
    held = hapt_held_ago(self, @ledger_delay@u);
    if (world->ledger_part > (hapt_real)0) {
        held += world->ledger_part * (hapt_held_ago(self, @ledger_delay@u + 1) - held);
    }
    return self->account + (paid - held * dz + step->given);
}

/* One sample: the world's torque without constants, the puck's measured position. */
static void hapt_enter(const hapt_world *world, hapt_controller *self, const hapt_energies *step, hapt_real position, hapt_real torque,
                       uint32_t missed)
{
    const hapt_real account = hapt_account(world, self, step, position, torque, missed);
    hapt_real most = step->stored + world->energy, made;
    if (world->ledger_share > (hapt_real)0) {
        const hapt_real dz = position - (self->has_booked ? self->booked_position : position);
        self->under_way = world->ledger_left * self->under_way + world->ledger_share * (dz * dz);
        most += self->under_way;
    }
    self->account = account > most ? most : account;
    made = self->made + step->made;
    self->made = made < (hapt_real)0 ? (hapt_real)0 : made;
    hapt_hold(self, torque);
    self->booked_position = position;
    self->has_booked = 1;
}

