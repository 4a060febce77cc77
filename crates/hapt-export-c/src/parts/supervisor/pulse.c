/* One sample of the sign test: 1 while it runs, with its torque, 0 where the puck moved the right way, -1 where it is not. */
static int hapt_test(const hapt_world *world, hapt_controller *self, hapt_real *torque, hapt_reason *reason)
{
    const uint32_t n = @pulse_samples@u, now = self->test_sample;
    const uint32_t acting = now > @pulse_delay@u ? now - @pulse_delay@u : 0;
    const hapt_real position = self->seen_position;
    self->test_sample = hapt_sum_of(now, 1);
    *torque = (hapt_real)0;
    if (now == 0) {
        self->test_marks[0] = position;
        self->test_marks[1] = position;
        self->test_marks[2] = position;
    } else if (acting == n) {
        self->test_marks[1] = position;
        self->test_marks[2] = position;
    } else if (acting == 2 * n) {
        self->test_marks[2] = position;
    } else if (acting >= 3 * n) {
        const hapt_real moved = (self->test_marks[2] - self->test_marks[1]) - (self->test_marks[1] - self->test_marks[0]);
        if (moved > world->pulse_least) {
            return 0;
        }
        *reason = moved < -world->pulse_least ? HAPT_REASON_REVERSED : HAPT_REASON_STUCK;
        return -1;
    }
    if (now >= n && now < 3 * n) {
        *torque = now < 2 * n ? world->pulse_torque : -world->pulse_torque;
    }
    return 1;
}

