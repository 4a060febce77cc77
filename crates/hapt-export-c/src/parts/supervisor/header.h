
/* ---- The supervisor: it checks every sample between the loop's command and the motor ---- */

/* Where it stands. */
typedef enum {
@phases@
} hapt_phase;

/* Why there is no torque. */
typedef enum {
    HAPT_REASON_NONE = 0,
@reasons@
} hapt_reason;

/* What the device shows at one sample. */
typedef struct {
    /* The puck's position in @u.position@. */
    hapt_real position;
//if exact
    /* Its velocity in @u.velocity@. */
    hapt_real velocity;
//end
    /* How late the sample is, s. */
    hapt_real late;
    /* Samples missed since the last one; a sample with an old reading counts as missed. */
    uint32_t missed;
    /* Since the last sign of life of whoever is in control, s; 0 without such a link. */
    hapt_real silent;
} hapt_reading;

//if tuned
/* ---- The numbers of the world that hapt_set() may change ---- */

#define HAPT_PARAMETERS @tuned@

/* Each with the range in which the world is certified, all others at the file's values. */
typedef enum {
@parameters@
} hapt_parameter;

typedef struct {
    hapt_real least;
    hapt_real file;
    hapt_real most;
} hapt_range;

extern const hapt_range hapt_ranges[HAPT_PARAMETERS];

/* What came of it: all but HAPT_SET_DONE leave everything as it was. */
typedef enum {
    HAPT_SET_DONE = 0,
    HAPT_SET_UNKNOWN = 1,
    /* Outside of the parameter's range, or not a number. */
    HAPT_SET_OUTSIDE = 2,
    /* A change under a torque would put energy into the world. */
    HAPT_SET_NOT_DISARMED = 3,
    /* Another parameter is not at the file's value: the certificate covers one change at a time. */
    HAPT_SET_OTHER_CHANGED = 4
} hapt_set_result;

@world_types@
//end
/* The loop under its supervisor. Read what you like; write nothing but by the functions below. */
typedef struct {
    hapt_state world;
    hapt_phase phase;
    hapt_reason reason;
    /* The first limit that was exceeded since arming and only warns. */
    hapt_reason warning;
    /* From 0 to 1: how much of the command reaches the motor. */
    hapt_real gain;
    /* The device's position at which the world's is 0, @u.position@. */
    hapt_real offset;
    /* The torque that the motor was last asked for, @u.torque@. */
    hapt_real output;
    /* The loop's own sample. */
    hapt_sample sample;
    /* The energy that the hand may still receive, and what the method has generated, J. */
    hapt_real account;
    hapt_real made;
    /* Samples under a torque that came later than the certificate covers. */
    uint32_t outside;
    /* The rest is the supervisor's own. */
    int32_t request;
    hapt_real seen_position;
    hapt_real seen_step;
    int32_t has_step;
    int32_t known;
    hapt_real seen_late;
    hapt_real seen_delay;
    hapt_real stand_way;
    hapt_real stand_speed;
    uint32_t stand_since;
    uint32_t stand_asked;
    hapt_real under_way;
    hapt_real held[16];
    uint32_t newest_held;
    int32_t has_booked;
    hapt_real booked_position;
    hapt_real heat[2];
//if recentre
    hapt_real rest_at;
    uint32_t rest_samples;
//if count
    hapt_real rest_way;
    int32_t rest_counts;
    hapt_real rest_origin;
//end
//end
//if pulse
    int32_t testing;
    uint32_t test_sample;
    hapt_real test_marks[3];
//end
//if tuned
    hapt_real parameters[HAPT_PARAMETERS];
    hapt_world numbers;
//end
    int32_t fresh;
    hapt_real braking;
    uint32_t calm;
} hapt_controller;

/* Before sample 0: disarmed. */
void hapt_init(hapt_controller *self);

//if exact
/* One sample, once every @period@, at the puck's position in @u.position@ and velocity in @u.velocity@: the torque for the motor in
 * @u.torque@. */
hapt_real hapt_step(hapt_controller *self, hapt_real position, hapt_real velocity);
//else
/* One sample, once every @period@, at the puck's position in @u.position@: the torque for the motor in @u.torque@. */
hapt_real hapt_step(hapt_controller *self, hapt_real position);
//end

/* The same with all that a device can tell: lateness, missed samples, silence of a link. */
hapt_real hapt_step_reading(hapt_controller *self, const hapt_reading *reading);

//if tuned
/* Another value of one parameter, while disarmed, from where hapt_step() is called. hapt_init() sets the file's values, and hapt_state_step()
 * has them always. The supervisor's limits stay those of the file's values. */
hapt_set_result hapt_set(hapt_controller *self, hapt_parameter parameter, hapt_real value);

//end
/* Requests for the next sample. Stop wins over all others. */
//if certified
/* From disarmed: the torque fades in. */
void hapt_arm(hapt_controller *self);
//else
/* From disarmed: the torque fades in. THE WORLD IS NOT CERTIFIED: it may gain energy and run away. */
void hapt_arm_uncertified(hapt_controller *self);
//end
/* The torque fades out. */
void hapt_disarm(hapt_controller *self);
/* The torque is 0 from the next sample on. */
void hapt_stop(hapt_controller *self);
/* From faulted, once the cause is gone: disarmed. */
void hapt_clear(hapt_controller *self);

/* The device reports a fault of its own, such as too much current: before each sample while it lasts. */
void hapt_trip(hapt_controller *self, hapt_reason reason);
/* The motor had the command of the last sample this long after it, in s. Without this call it is on time. */
void hapt_commanded(hapt_controller *self, hapt_real delay);
/* A sentence about a reason, in English. */
const char *hapt_reason_text(hapt_reason reason);
