/* ---- What a reading alone shows ---- */

typedef struct {
    hapt_real way;
    hapt_real speed;
    uint32_t since;
    uint32_t asked;
} hapt_stand;

static hapt_stand hapt_no_stand(void)
{
    hapt_stand stand;
    stand.way = (hapt_real)0;
    stand.speed = (hapt_real)0;
    stand.since = 0;
    stand.asked = 0;
    return stand;
}

static hapt_stand hapt_stand_of(const hapt_controller *self)
{
    hapt_stand stand;
    stand.way = self->stand_way;
    stand.speed = self->stand_speed;
    stand.since = self->stand_since;
    stand.asked = self->stand_asked;
    return stand;
}

static void hapt_set_stand(hapt_controller *self, hapt_stand stand)
{
    self->stand_way = stand.way;
    self->stand_speed = stand.speed;
    self->stand_since = stand.since;
    self->stand_asked = stand.asked;
}

/* a + b, at most the largest */
static uint32_t hapt_sum_of(uint32_t a, uint32_t b)
{
    return a > 0xffffffffu - b ? 0xffffffffu : a + b;
}

/* A puck that stands still for so many samples more under the torque `held`, beside one that is free to move: whether it has stood still for
 * too long. */
static int hapt_stands(const hapt_world *world, hapt_stand *stand, hapt_real held, uint32_t samples, hapt_real periods)
{
    const hapt_real torque = hapt_abs(held) > world->stuck_torque ? held : (hapt_real)0;
    const hapt_real friction = periods * world->stuck_friction;
    hapt_real pushed, slid;
    if (!((stand->since | stand->asked) > 0 || hapt_abs(held) > world->stuck_torque)) {
        *stand = hapt_no_stand();
        return 0;
    }
    if (held * stand->way < (hapt_real)0) {
        /* A torque of the other sign restarts it from rest. */
        const uint32_t asked = stand->asked;
        *stand = hapt_no_stand();
        stand->asked = asked;
    }
    pushed = stand->speed + periods * (world->stuck_push * torque);
    slid = pushed > friction ? pushed - friction : (pushed < -friction ? pushed + friction : (hapt_real)0);
    stand->speed = slid / ((hapt_real)1 + periods * world->stuck_drag);
    stand->way = stand->way + periods * stand->speed;
    stand->since = hapt_sum_of(stand->since, samples);
    stand->since = stand->since < @stuck_most@u ? stand->since : @stuck_most@u;
    if (hapt_abs(stand->way) <= world->stuck_far) {
        return 0;
    }
    stand->asked = hapt_sum_of(stand->asked, stand->since);
    stand->way = (hapt_real)0;
    stand->speed = (hapt_real)0;
    stand->since = 0;
    return stand->asked > @stuck@u;
}

/* Whether a reading is ordinary: within every limit and on time. Then it is remembered. */
static int hapt_is_ordinary(const hapt_world *world, hapt_controller *self, const hapt_reading *reading)
{
    const hapt_real step = reading->position - self->seen_position;
    hapt_stand stand = hapt_no_stand();
    if (!self->has_step || reading->missed > 0) {
        return 0;
    }
    /* Written so that a NaN is outside every limit. */
    if (!(hapt_abs(step) <= world->ordinary_distance && hapt_abs(step - self->seen_step) <= world->ordinary_jump)) {
        return 0;
    }
//if exact
    if (!hapt_is_finite(reading->velocity)) {
        return 0;
    }
//end
    if (!(hapt_abs(reading->late) <= world->ordinary_late && hapt_abs(reading->silent) <= world->ordinary_silent)) {
        return 0;
    }
    if (!(world->period + (reading->late - self->seen_late) <= world->ordinary_interval
          && self->seen_delay <= world->ordinary_delay)) {
        return 0;
    }
    if (step == (hapt_real)0) {
        stand = hapt_stand_of(self);
        if (hapt_stands(world, &stand, self->output, 1, (hapt_real)1)) {
            return 0;
        }
    }
    self->seen_position = reading->position;
    self->seen_step = step;
    hapt_set_stand(self, stand);
    self->seen_late = reading->late;
    self->seen_delay = (hapt_real)0;
    return 1;
}

/* Whether the interval before this sample, and the command of the one before it, are within what the certificate covers. */
static int hapt_keeps_time(const hapt_world *world, hapt_controller *self, const hapt_reading *reading)
{
    const hapt_real periods = (hapt_real)1 + (hapt_real)reading->missed;
    const hapt_real interval = periods * world->period + (reading->late - self->seen_late);
    const int keeps = interval <= world->ordinary_interval && self->seen_delay <= world->ordinary_delay;
    self->seen_late = hapt_is_finite(reading->late) ? reading->late : (hapt_real)0;
    self->seen_delay = (hapt_real)0;
    return keeps;
}

/* What is wrong with a reading; a lost link apart. */
static hapt_reason hapt_wrong(const hapt_world *world, hapt_controller *self, const hapt_reading *reading)
{
    const hapt_real missed = (hapt_real)reading->missed;
    const hapt_real periods = (hapt_real)1 + missed;
    hapt_real distance, step, before;
    int known, had_step, late, runs_away, is_stuck = 0;
    hapt_stand stand;
    if (!hapt_is_finite(reading->position) || !hapt_is_finite(reading->late) || !hapt_is_finite(reading->silent)) {
        return HAPT_REASON_NOT_FINITE;
    }
//if exact
    if (!hapt_is_finite(reading->velocity)) {
        return HAPT_REASON_NOT_FINITE;
    }
//end
    distance = reading->position - self->seen_position;
    known = self->known;
    self->seen_position = reading->position;
    self->known = 1;
    stand = hapt_no_stand();
    if (distance == (hapt_real)0) {
        stand = hapt_stand_of(self);
        is_stuck = hapt_stands(world, &stand, self->output, hapt_sum_of(reading->missed, 1), periods);
    }
    hapt_set_stand(self, stand);
    late = hapt_abs(reading->late) + missed * world->period > world->stall;
    if (!known) {
        self->has_step = 0;
        return late ? HAPT_REASON_LATE : HAPT_REASON_NONE;
    }
    step = distance / periods;
    before = self->seen_step;
    had_step = self->has_step;
    self->seen_step = step;
    self->has_step = 1;
    if (reading->missed == 0 && had_step && hapt_abs(step - before) > world->jump) {
        return HAPT_REASON_JUMP;
    }
    runs_away = hapt_abs(distance) > world->overspeed * periods + world->size && hapt_abs(self->output) > world->friction;
    /* One speed for both: with the motor on it is the puck that is too fast, not the reading. */
    if (runs_away && world->velocity <= world->overspeed) {
        return HAPT_REASON_OVERSPEED;
    }
    if (hapt_abs(distance) > world->velocity * periods + world->size) {
        return HAPT_REASON_VELOCITY;
    }
    if (runs_away) {
        return HAPT_REASON_OVERSPEED;
    }
    if (late) {
        return HAPT_REASON_LATE;
    }
    return is_stuck ? HAPT_REASON_STUCK : HAPT_REASON_NONE;
}

