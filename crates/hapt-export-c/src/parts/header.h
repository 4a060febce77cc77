#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The numbers of the loop. */
//if f32
typedef float hapt_real;
//else
typedef double hapt_real;
//end

/* The bodies of the world (@bodies@). A C array has one place at least. */
#define HAPT_BODIES @n@
#define HAPT_BODY_ROOM @n_room@
//if nonlinear
/* The couplings up to the last nonlinear one. */
#define HAPT_COUPLINGS @couplings@
//end
//if ring
/* The samples that the velocity's estimator remembers. */
#define HAPT_COUNTS @counts@
//end

/* Positions and velocities of the bodies, in @u.position@ and @u.velocity@. */
typedef struct {
    hapt_real position[HAPT_BODY_ROOM];
    hapt_real velocity[HAPT_BODY_ROOM];
} hapt_vector;

/* Everything that changes from sample to sample. A copy of it is a snapshot. */
typedef struct {
    /* x_k of the last sample at which the bodies stepped. */
    hapt_vector now;
    /* x_{k+1} - x_k */
    hapt_vector change;
//if skips
    /* How many more samples come before the bodies step. */
    uint32_t until_step;
//end
//if bristles
    /* The bend of each friction's bristle, @u.position@; the sum of each integral term, @u.position@ s; the low-passed velocity of each torque
       along the acceleration, @u.velocity@. */
    hapt_real bristle[HAPT_COUPLINGS];
//end
//if gradient
    /* The torque of each coupling at a body over the last step, @u.torque@. */
    hapt_real contact[HAPT_COUPLINGS];
    /* Steps in which the torques did not converge. Such a step never gains energy. */
    uint32_t unsettled;
//end
//if last
    /* The puck at the last sample, where there was one. */
    int32_t has_last;
    hapt_real last_position;
    hapt_real last_velocity;
//end
//if filter
    /* The filtered position at the last sample. */
    hapt_real filtered;
//end
//if tracked
    /* What the velocity's estimator makes of the positions so far. */
    hapt_real tracked_position;
//end
//if kalman
    hapt_real tracked_acceleration;
//end
//if ring
    /* The last counts or positions, a ring. */
    hapt_real count[HAPT_COUNTS];
    uint32_t newest;
    uint32_t older;
//end
} hapt_state;

/* What one sample gives. */
typedef struct {
    /* The puck as the loop saw it, @u.position@ and @u.velocity@. */
    hapt_real position;
    hapt_real velocity;
    /* The couplings' torque on the puck in @u.torque@, before levels and limit. */
    hapt_real torque;
    /* What the motor is asked for. */
    hapt_real command;
} hapt_sample;

/* The state before sample 0. */
void hapt_state_init(hapt_state *state);

//if exact
/* One sample WITHOUT the supervisor, at the puck's position in @u.position@ and velocity in @u.velocity@. For simulations; a motor
 * gets hapt_step(). */
hapt_sample hapt_state_step(hapt_state *state, hapt_real position, hapt_real velocity);
//else
/* One sample WITHOUT the supervisor, at the puck's position in @u.position@. For simulations; a motor gets hapt_step(). */
hapt_sample hapt_state_step(hapt_state *state, hapt_real position);
//end
