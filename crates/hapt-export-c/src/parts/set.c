/* ---- Parameters ---- */

const hapt_range hapt_ranges[HAPT_PARAMETERS] = {
@ranges@
};

/* The compiled numbers with another value of one parameter. */
static void hapt_take(hapt_world *world, hapt_parameter parameter, hapt_real value)
{
    switch (parameter) {
@set_cases@
    default:
        break;
    }
}

hapt_set_result hapt_set(hapt_controller *self, hapt_parameter parameter, hapt_real value)
{
    const int32_t index = (int32_t)parameter;
    int32_t i;
    if (index < 0 || index >= HAPT_PARAMETERS) {
        return HAPT_SET_UNKNOWN;
    }
    /* Written so that a NaN is outside. */
    if (!(value >= hapt_ranges[index].least && value <= hapt_ranges[index].most)) {
        return HAPT_SET_OUTSIDE;
    }
    if (self->phase != HAPT_PHASE_DISARMED) {
        return HAPT_SET_NOT_DISARMED;
    }
    for (i = 0; i < HAPT_PARAMETERS; i++) {
        if (i != index && self->parameters[i] != hapt_ranges[i].file && value != hapt_ranges[index].file) {
            return HAPT_SET_OTHER_CHANGED;
        }
    }
    self->parameters[index] = value;
    hapt_take(&self->numbers, parameter, value);
    return HAPT_SET_DONE;
}

