//! The methods of integration, one by one.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "forward-euler",
        aliases: &["euler", "explicit-euler"],
        line: "the simplest method: grows, unless damped",
        text: r#"x_{k+1} = x_k + T f(x_k, u_k): positions and velocities by the slopes at the start of the step.
λ = 1 + sT puts an undamped mode outside the unit circle at every period: it grows by ln(1 +
ω²T²)/(2T). A damper b = Tk beside the spring cancels that, for ωT < 2 (see compensating). Damped
worlds are stable up to the critical period; far beyond critical damping that becomes shorter.

  hapt check @notes/euler                  unstable
  hapt sim @notes/damped                   0 predicted

It takes every coupling at a body, as semi-implicit-euler and rk4 do.
"#,
    },
    Topic {
        name: "backward-euler",
        aliases: &["implicit-euler"],
        line: "never unstable, but takes energy out of every swing",
        text: r#"x_{k+1} = x_k + T f(x_{k+1}, u_k): slopes at the end of the step, a matrix solved once beforehand.
λ = 1/(1 - sT) is inside the unit circle at every period. The price: an undamped oscillation decays,
at the rate at which it grows under forward Euler.

  hapt check @notes/default --why --set loop.method=backward-euler   growth -0.0197388 per second

It supports walls, detents and Coulomb friction at a body: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "semi-implicit-euler",
        aliases: &["symplectic-euler", "symplectic"],
        line: "Euler with the new velocity: keeps the amplitude, up to a period",
        text: r#"First the velocities, v_{k+1} = v_k + T a(x_k, v_k, u_k), then x_{k+1} = x_k + T v_{k+1}. It costs
as little as forward Euler, and an undamped oscillation keeps its amplitude for ωT < 2; its
frequency is slightly high. Held, it has the eigenvalues of forward Euler with b = Tk.

  hapt check @notes/default --set loop.method=semi-implicit-euler --set loop.output=middle   318.3

With "middle" an undamped oscillation is passive from kT/2 of device damping on; with "start" or
"end" no damping is enough. It supports every coupling at a body.
"#,
    },
    Topic {
        name: "trapezoidal",
        aliases: &["trapezoid"],
        line: "the mean of both slopes: keeps the amplitude at every period",
        text: r#"x_{k+1} = x_k + T/2 (f(x_k, u_k) + f(x_{k+1}, u_k)): a matrix solved once beforehand.
λ = (1 + sT/2)/(1 - sT/2): an undamped mode stays on the unit circle at every period; its phase
advances by 2 atan(ωT/2) a sample, slightly slow.

  hapt check @notes/default --why --set loop.method=trapezoidal   in this loop 0.999997 Hz, 0

tustin is the same rule with the new sample taken first. It supports walls, detents and Coulomb
friction at a body: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "zoh",
        aliases: &["exact-hold", "default-method"],
        line: "the default: exact while the puck's position is held over the step",
        text: r#"The solution of the differential equation with the sample u_k held over the step, by the matrix
exponential, computed once. λ = e^(sT) exactly: frequencies and damping are those of the world, at
every period. The remaining error is the hold of the puck's position, and of the motor.

  hapt check @notes/default --why                          in this loop 1 Hz, 0
  hapt check @notes/default --why --set loop.period=2ms    in this loop 1 Hz, 0

It supports walls, detents and Coulomb friction at a body: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "rk4",
        aliases: &["runge-kutta"],
        line: "four slopes a step: accurate, stable up to a period",
        text: r#"The classical Runge-Kutta rule, with the sample u_k held over the step. Its λ is e^(sT) up to the
fourth power of sT. A slow oscillation loses almost nothing; beyond ωT = 2√2 it grows.

  hapt check @notes/default --why --set loop.method=rk4                      period 450.158 ms
  hapt check @notes/default --set loop.method=rk4 --set loop.period=460ms    unstable

It supports every coupling at a body, evaluated at its four stages.
"#,
    },
    Topic {
        name: "tustin",
        aliases: &["bilinear"],
        line: "trapezoidal, with the new sample taken first",
        text: r#"x_k = x_{k-1} + T/2 (f(x_{k-1}, u_{k-1}) + f(x_k, u_k)): the loop reads the puck, then advances the
world to now, then takes the torque from x_k. So its output is "start", and no other is possible.
Its eigenvalues are those of trapezoidal. It does nothing at the first sample.

  hapt check @notes/default --why --set loop.method=tustin | grep Hz   in this loop 0.999997 Hz, 0

With that output no device damping makes an undamped oscillation passive. It supports no nonlinear
coupling at a body, not even a constant.
"#,
    },
    Topic {
        name: "foh",
        aliases: &["first-order-hold"],
        line: "exact while the puck has constant velocity between two samples",
        text: r#"The solution of the differential equation with the puck at constant velocity from the last sample to
this one. It takes the new sample first; its output is "start". Second order in T for any motion of
the puck: use it for a hand that moves smoothly, such as a sine.

  hapt check @notes/resonance --why | grep Hz              in this loop 1 Hz, 0
  hapt sim @notes/resonance                                sample 2982 (2.982 s)

It supports no nonlinear coupling at a body. No device damping makes an undamped oscillation
passive: its torque is out of phase with the hand.
"#,
    },
    Topic {
        name: "nonlinear-at-a-body",
        aliases: &["nonlinear", "discrete-gradient"],
        line: "\"does not go with method ...\": walls, detents, friction at a body",
        text: r#"A wall, a detent or friction at a body is nonlinear inside the integration. Taken from the start of
the step, its torque generates energy: a body bouncing on a wall gained a factor of millions. zoh,
trapezoidal and backward-euler solve for it over the step without any gain (the discrete gradient);
LuGre friction has no such step, and neither have tustin and foh. hapt refuses these combinations
instead of a silent approximation. The explicit methods accept all, with weaker guarantees. Under
zoh, with a spring that is clamped at 0.8 N m:

  hapt check @notes/default --why --set couplings.0.limit=0.8          passive against every

Between puck and ground every method supports such couplings: @devices/eth-wall has them with zoh.
"#,
    },
];
