
/* ---- Idle re-centring: while the puck rests, the world's origin slips so that the torque falls to 0 ---- */

/* The origin after this sample. */
static hapt_real hapt_origin(const hapt_world *world, hapt_controller *self)
{
    const hapt_real torque = hapt_held_ago(self, 0), step = self->has_step ? self->seen_step : (hapt_real)0;
    const hapt_real size = hapt_abs(torque), way = world->recentre_slip * torque;
    if (hapt_abs(self->seen_position - self->rest_at) > world->recentre_near) {
        self->rest_at = self->seen_position;
        self->rest_samples = 0;
//if count
        self->rest_way = (hapt_real)0;
//end
        return self->offset;
    }
    if (self->rest_samples < @recentre_idle@u) {
        self->rest_samples += 1;
        return self->offset;
    }
    /* Written so that a NaN slips nothing. */
    if (!(size <= world->recentre_most && size >= world->recentre_stiffness * (hapt_abs(step) + world->recentre_counts))) {
        return self->offset;
    }
//if count
    self->rest_way += way;
    if (hapt_abs(self->rest_way) < world->recentre_count || self->rest_counts >= 16777216 || self->rest_counts <= -16777216) {
        return self->offset;
    }
    if (self->rest_counts == 0) {
        self->rest_origin = self->offset;
    }
    if (self->rest_way > (hapt_real)0) {
        self->rest_counts += 1;
        self->rest_way += -world->recentre_count;
    } else {
        self->rest_counts -= 1;
        self->rest_way += world->recentre_count;
    }
    /* Of the sum: the rounding of many slips does not add up. */
    return self->rest_origin - (hapt_real)self->rest_counts * world->recentre_count;
//else
    return self->offset - way;
//end
}

static void hapt_recentre(const hapt_world *world, hapt_controller *self)
{
    const hapt_real origin = hapt_origin(world, self);
    if (origin != self->offset) {
        /* No work is done. */
        if (self->has_booked) {
            self->booked_position += self->offset - origin;
        }
        self->offset = origin;
    }
}
