/* The virtual wheel of the notes as the notes compute it, in C: the numbers in brackets are theirs. */
static const double T = 0.001, k = 1.0185916357881304, J_w = 0.025801227546559593;
static double theta_w, omega_w, last_z;

double lecture_step(double z)
{
    double b = T * k;                                                           /* (2.24) */
    double omega_z = (z - last_z) / T;                                          /* footnote 1 */
    double torque = -k * (theta_w - z) - b * (omega_w - omega_z);               /* (2.22) */
    double d_theta = omega_w;                                                   /* (2.20), row 1 */
    double d_omega = -k / J_w * theta_w - b / J_w * omega_w + k / J_w * z + b / J_w * omega_z; /* (2.20), row 2 */
    theta_w = theta_w + T * d_theta;                                            /* (2.7), (2.8) */
    omega_w = omega_w + T * d_omega;                                            /* (2.7), (2.8) */
    last_z = z;
    return torque;
}
