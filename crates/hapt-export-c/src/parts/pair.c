/* A torque and its derivative. */
typedef struct {
    hapt_real value;
    hapt_real slope;
} hapt_pair;

static hapt_pair hapt_pair_of(hapt_real value, hapt_real slope)
{
    hapt_pair pair;
    pair.value = value;
    pair.slope = slope;
    return pair;
}

