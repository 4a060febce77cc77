/* ---- The supervisor ---- */

#define HAPT_NO_REQUEST 0
#define HAPT_ARM 1
#define HAPT_DISARM 2
#define HAPT_STOP 3
#define HAPT_CLEAR 4
/* Faultless samples after which a cause counts as gone. */
#define HAPT_CALM 16u

static int hapt_is_active(const hapt_controller *self)
{
    return self->phase == HAPT_PHASE_FADING_IN || self->phase == HAPT_PHASE_RUNNING || self->phase == HAPT_PHASE_FADING_OUT;
}

/* Whether the measured velocity is still valid after a fault, so that damping may bring the puck to rest. */
static int hapt_trusts_the_encoder(hapt_reason reason)
{
    return @trusted@;
}

/* Takes the torque away, unless it is away already. */
static void hapt_fault(hapt_controller *self, hapt_reason reason)
{
    if (self->phase != HAPT_PHASE_FAULTED || reason == HAPT_REASON_STOP) {
        self->braking = hapt_trusts_the_encoder(reason) && hapt_is_active(self) ? self->gain : (hapt_real)0;
        self->phase = HAPT_PHASE_FAULTED;
        self->reason = reason;
    }
}

/* The same where there may be a torque; whether there might. */
static int hapt_fault_where_active(hapt_controller *self, hapt_reason reason)
{
    const int active = hapt_is_active(self);
    if (active) {
        hapt_fault(self, reason);
    }
    return active;
}

/* Whether the cause of a fault is gone. */
static int hapt_is_over(const hapt_world *world, const hapt_controller *self, int lost)
{
    if (self->reason == HAPT_REASON_HEAT || self->reason == HAPT_REASON_DRIVER_HEAT) {
        return self->heat[0] <= (hapt_real)0.5 * world->motor_most && self->heat[1] <= (hapt_real)0.5 * world->driver_most;
    }
    return self->reason == HAPT_REASON_LINK ? !lost : self->calm >= HAPT_CALM;
}

static void hapt_home(hapt_controller *self)
{
//if zero_where_armed
    self->offset = self->seen_position;
//if recentre_counts
    self->rest_counts = 0;
//end
//else
    (void)self;
//end
}

static void hapt_handle(const hapt_world *world, hapt_controller *self, int request, hapt_reason wrong, int lost)
{
    const hapt_phase phase = self->phase;
    if (request == HAPT_STOP) {
        hapt_fault(self, HAPT_REASON_STOP);
        self->calm = 0;
    } else if (request == HAPT_ARM && (phase == HAPT_PHASE_DISARMED || phase == HAPT_PHASE_FADING_OUT)) {
        if (wrong != HAPT_REASON_NONE) {
            hapt_fault(self, wrong);
        } else if (lost) {
            self->reason = HAPT_REASON_LINK;
        } else {
            self->reason = HAPT_REASON_NONE;
            self->warning = HAPT_REASON_NONE;
            if (phase == HAPT_PHASE_DISARMED) {
                self->fresh = 1;
                hapt_set_stand(self, hapt_no_stand());
//if pulse
                self->testing = 1;
                self->test_sample = 0;
                self->test_marks[0] = (hapt_real)0;
                self->test_marks[1] = (hapt_real)0;
                self->test_marks[2] = (hapt_real)0;
//end
                hapt_home(self);
            }
            self->phase = HAPT_PHASE_FADING_IN;
        }
    } else if (request == HAPT_DISARM && (phase == HAPT_PHASE_FADING_IN || phase == HAPT_PHASE_RUNNING)) {
        self->phase = HAPT_PHASE_FADING_OUT;
    } else if (request == HAPT_CLEAR && phase == HAPT_PHASE_FAULTED && hapt_is_over(world, self, lost)) {
        self->phase = HAPT_PHASE_DISARMED;
        self->reason = HAPT_REASON_NONE;
    }
}

/* A sample later than the certificate covers. */
static void hapt_lapse(hapt_controller *self)
{
    if (!hapt_is_active(self)) {
        return;
    }
//if late_fault
    hapt_fault(self, HAPT_REASON_UNEVEN);
//end
//if late_fade
    if (self->phase != HAPT_PHASE_FADING_OUT) {
        self->phase = HAPT_PHASE_FADING_OUT;
        self->reason = HAPT_REASON_UNEVEN;
    }
//end
//if late_count
    if (self->warning == HAPT_REASON_NONE) {
        self->warning = HAPT_REASON_UNEVEN;
    }
//end
}

//if pulse
#define HAPT_IS_TESTING(self) ((self)->testing != 0)
//else
#define HAPT_IS_TESTING(self) 0
//end

/* A sample that is not like the last, before the world takes it. Whether the world waits at its start. */
static int hapt_look(const hapt_world *world, hapt_controller *self, const hapt_reading *reading, int request, hapt_reason *wrong)
{
    const int keeps_time = hapt_keeps_time(world, self, reading);
    const int lost = reading->silent > world->link;
    int outside, waits;
//if recentre
    self->rest_samples = 0;
//end
    *wrong = hapt_wrong(world, self, reading);
//if late_fault
    if (*wrong != HAPT_REASON_NONE || !keeps_time) {
//else
    if (*wrong != HAPT_REASON_NONE) {
//end
        self->calm = 0;
    } else if (self->calm < HAPT_CALM) {
        self->calm += 1;
    }
    /* Without a torque before it, a late sample is no matter. */
    outside = !keeps_time && hapt_is_active(self);
    if (request != HAPT_NO_REQUEST) {
        hapt_handle(world, self, request, *wrong, lost);
    }
    if (hapt_is_active(self)) {
        if (*wrong != HAPT_REASON_NONE) {
            hapt_fault(self, *wrong);
//if link_faults
        } else if (lost) {
            hapt_fault(self, HAPT_REASON_LINK);
        }
//else
        } else if (lost && self->phase != HAPT_PHASE_FADING_OUT) {
            self->phase = HAPT_PHASE_FADING_OUT;
            self->reason = HAPT_REASON_LINK;
        }
//end
    }
    if (outside) {
        self->outside = hapt_sum_of(self->outside, 1);
        hapt_lapse(self);
    }
    waits = !hapt_is_active(self) || HAPT_IS_TESTING(self);
    if (waits || self->fresh) {
        hapt_state_init(&self->world);
        self->has_booked = 0;
        self->fresh = 0;
    }
    return waits;
}

/* The world's numbers and energies. */
static void hapt_book(const hapt_world *world, hapt_controller *self, const hapt_reading *reading)
{
    const hapt_sample *sample = &self->sample;
    const hapt_energies step = hapt_energies_of(world, &self->world, sample->position, sample->velocity);
    int in_account, within;
    if (!hapt_is_finite(sample->torque) || !hapt_is_finite(step.stored) || !hapt_is_finite(step.made)) {
        hapt_fault(self, HAPT_REASON_NOT_FINITE);
        return;
    }
//if sources
    hapt_enter(world, self, &step, sample->position, sample->torque - hapt_sources(world, &self->world, sample->velocity), reading->missed);
//else
    hapt_enter(world, self, &step, sample->position, sample->torque - world->constant, reading->missed);
//end
    /* Written so that a NaN is outside every limit. */
    in_account = self->account >= (hapt_real)0;
    within = self->made <= world->energy;
    if (!in_account) {
//if port_trips
        hapt_fault(self, HAPT_REASON_PORT_ENERGY);
//else
        self->warning = HAPT_REASON_PORT_ENERGY;
//end
    }
    if (!within) {
//if world_trips
        hapt_fault(self, HAPT_REASON_WORLD_ENERGY);
//else
        self->warning = HAPT_REASON_WORLD_ENERGY;
//end
    }
    if (hapt_abs(sample->command) > world->torque) {
        hapt_fault(self, HAPT_REASON_TORQUE);
    }
}

/* What the phase makes of the world's command, and the phase after this sample. */
static hapt_real hapt_wanted(const hapt_world *world, hapt_controller *self)
{
    if (self->phase != HAPT_PHASE_RUNNING) {
        const hapt_real near = (hapt_real)0.5 * world->fade;
        if (!hapt_is_active(self)) {
            self->gain = (hapt_real)0;
//if pulse
            self->testing = 0;
//end
            return (hapt_real)0;
        }
//if pulse
        if (self->testing && self->phase == HAPT_PHASE_FADING_IN) {
            hapt_reason reason = HAPT_REASON_NONE;
            hapt_real torque;
            const int runs = hapt_test(world, self, &torque, &reason);
            if (runs == 0) {
                self->testing = 0;
                self->fresh = 1;
                hapt_home(self);
            } else if (runs < 0) {
                hapt_fault(self, reason);
            }
            return torque;
        }
//end
        self->gain += self->phase == HAPT_PHASE_FADING_IN ? world->fade : -world->fade;
        if (self->gain > (hapt_real)1 - near) {
            self->gain = (hapt_real)1;
            self->phase = HAPT_PHASE_RUNNING;
        } else if (self->gain < near) {
            self->gain = (hapt_real)0;
            self->phase = HAPT_PHASE_DISARMED;
//if pulse
            self->testing = 0;
//end
            return (hapt_real)0;
        }
    }
    return self->gain * self->sample.command + (hapt_real)0;
}

/* The torque after a fault: none, or what brings the puck to rest over a fade's time. */
static hapt_real hapt_braked(const hapt_world *world, hapt_controller *self, hapt_reason wrong)
{
    if (self->braking < (hapt_real)0.5 * world->fade || world->brake <= (hapt_real)0) {
        return (hapt_real)0;
    }
    if (wrong != HAPT_REASON_NONE && !hapt_trusts_the_encoder(wrong)) {
        self->braking = (hapt_real)0;
        return (hapt_real)0;
    }
    self->braking -= world->fade;
    if (self->braking < (hapt_real)0.5 * world->fade) {
        return (hapt_real)0;
    }
    return -hapt_within(world->brake * (self->has_step ? self->seen_step : (hapt_real)0) * self->braking, world->torque);
}

/* One sample at a torque; whether the motor (0) or its driver (1) is too hot. */
static int hapt_warm(hapt_real *heat, hapt_real torque, hapt_real part, hapt_real most)
{
    *heat += (torque * torque - *heat) * part;
    return *heat > most;
}

hapt_real hapt_step_reading(hapt_controller *self, const hapt_reading *reading)
{
//if tuned
    const hapt_world *world = &self->numbers;
//else
    const hapt_world *world = &hapt_compiled;
//end
    const int request = self->request;
    const int steady = request == HAPT_NO_REQUEST && self->phase == HAPT_PHASE_RUNNING && !self->fresh && !HAPT_IS_TESTING(self)
        && self->calm >= HAPT_CALM;
    const int ordinary = steady && hapt_is_ordinary(world, self, reading);
    hapt_reason wrong = HAPT_REASON_NONE;
    hapt_real position, velocity = (hapt_real)0, whole, output;
    int waits = 0, leaps = 0;
    self->request = HAPT_NO_REQUEST;
    if (!ordinary) {
        waits = hapt_look(world, self, reading, request, &wrong);
        leaps = HAPT_IS_TESTING(self);
    }
//if recentre
    if (ordinary) {
        hapt_recentre(world, self);
    }
//end
//if exact
    /* A NaN never enters the world. */
    velocity = hapt_is_finite(reading->velocity) ? reading->velocity : (hapt_real)0;
//end
    position = self->seen_position - self->offset;
    self->sample = hapt_sample_of(world, &self->world, position, velocity);
    if (!waits) {
        hapt_book(world, self, reading);
    }
    whole = self->gain * self->sample.command + (hapt_real)0;
    if (!(ordinary && self->phase == HAPT_PHASE_RUNNING && hapt_abs(whole - self->output) <= world->slew)) {
        whole = hapt_wanted(world, self);
        if (hapt_abs(whole - self->output) > world->slew && !leaps) {
            (void)hapt_fault_where_active(self, HAPT_REASON_SLEW);
        }
        if (self->phase == HAPT_PHASE_FAULTED) {
            whole = hapt_braked(world, self, wrong);
        }
    }
    output = whole;
    if (hapt_warm(&self->heat[0], whole, world->motor_part, world->motor_most)
        && hapt_fault_where_active(self, HAPT_REASON_HEAT)) {
        output = (hapt_real)0;
    }
    if (hapt_warm(&self->heat[1], whole, world->driver_part, world->driver_most)
        && hapt_fault_where_active(self, HAPT_REASON_DRIVER_HEAT)) {
        output = (hapt_real)0;
    }
    self->output = output;
    return output;
}

//if exact
hapt_real hapt_step(hapt_controller *self, hapt_real position, hapt_real velocity)
//else
hapt_real hapt_step(hapt_controller *self, hapt_real position)
//end
{
    hapt_reading reading;
    reading.position = position;
//if exact
    reading.velocity = velocity;
//end
    reading.late = (hapt_real)0;
    reading.missed = 0;
    reading.silent = (hapt_real)0;
    return hapt_step_reading(self, &reading);
}

static void hapt_ask(hapt_controller *self, int request)
{
    if (self->request != HAPT_STOP) {
        self->request = request;
    }
}

//if certified
void hapt_arm(hapt_controller *self)
//else
void hapt_arm_uncertified(hapt_controller *self)
//end
{
    hapt_ask(self, HAPT_ARM);
}

void hapt_disarm(hapt_controller *self)
{
    hapt_ask(self, HAPT_DISARM);
}

void hapt_stop(hapt_controller *self)
{
    hapt_ask(self, HAPT_STOP);
}

void hapt_clear(hapt_controller *self)
{
    hapt_ask(self, HAPT_CLEAR);
}

void hapt_trip(hapt_controller *self, hapt_reason reason)
{
    hapt_fault(self, reason);
    self->braking = (hapt_real)0;
    self->calm = 0;
}

void hapt_commanded(hapt_controller *self, hapt_real delay)
{
    self->seen_delay = delay;
}

void hapt_init(hapt_controller *self)
{
    int i;
    hapt_state_init(&self->world);
    self->phase = HAPT_PHASE_DISARMED;
    self->reason = HAPT_REASON_NONE;
    self->warning = HAPT_REASON_NONE;
    self->gain = (hapt_real)0;
    self->offset = (hapt_real)0;
    self->output = (hapt_real)0;
    self->sample.position = (hapt_real)0;
    self->sample.velocity = (hapt_real)0;
    self->sample.torque = (hapt_real)0;
    self->sample.command = (hapt_real)0;
    self->account = (hapt_real)0;
    self->made = (hapt_real)0;
    self->outside = 0;
    self->request = HAPT_NO_REQUEST;
    self->seen_position = (hapt_real)0;
    self->seen_step = (hapt_real)0;
    self->has_step = 0;
    self->known = 0;
    self->seen_late = (hapt_real)0;
    self->seen_delay = (hapt_real)0;
    hapt_set_stand(self, hapt_no_stand());
    self->under_way = (hapt_real)0;
    for (i = 0; i < 16; i++) {
        self->held[i] = (hapt_real)0;
    }
    self->newest_held = 0;
    self->has_booked = 0;
    self->booked_position = (hapt_real)0;
    self->heat[0] = (hapt_real)0;
    self->heat[1] = (hapt_real)0;
//if recentre
    self->rest_at = (hapt_real)0;
    self->rest_samples = 0;
//if count
    self->rest_way = (hapt_real)0;
    self->rest_counts = 0;
    self->rest_origin = (hapt_real)0;
//end
//end
//if pulse
    self->testing = 0;
    self->test_sample = 0;
    for (i = 0; i < 3; i++) {
        self->test_marks[i] = (hapt_real)0;
    }
//end
//if tuned
    for (i = 0; i < HAPT_PARAMETERS; i++) {
        self->parameters[i] = hapt_ranges[i].file;
    }
    self->numbers = hapt_compiled;
//end
    self->fresh = 1;
    self->braking = (hapt_real)0;
    self->calm = 0;
}

const char *hapt_reason_text(hapt_reason reason)
{
    switch (reason) {
@reason_cases@
    default:
        return "";
    }
}
