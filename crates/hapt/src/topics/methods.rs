//! The methods of integration, one by one.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "forward-euler",
        aliases: &["euler", "explicit-euler"],
        line: "the simplest method: grows, unless damped",
        text: r#"x_{k+1} = x_k + T f(x_k, u_k): positions and velocities by the slopes at the start of the step.
λ = 1 + sT puts an undamped swing outside the unit circle at every period: it grows by
ln(1 + ω²T²)/(2T). A damper b = Tk beside the spring undoes that, for ωT < 2 (see compensating).
Damped worlds are stable up to the critical period; far beyond critical damping that gets shorter.

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
λ = 1/(1 - sT) is inside the unit circle at every period. The price: an undamped swing decays, at
the rate at which forward Euler makes it grow.

  hapt check @notes/default --set loop.method=backward-euler        growth -0.0197388 per second

Walls, detents and Coulomb friction at a body go with it: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "semi-implicit-euler",
        aliases: &["symplectic-euler", "symplectic"],
        line: "Euler with the new velocity: keeps a swing, up to a period",
        text: r#"First the velocities, v_{k+1} = v_k + T a(x_k, v_k, u_k), then x_{k+1} = x_k + T v_{k+1}.
As cheap as forward Euler, and an undamped swing keeps its size for ωT < 2; its frequency is a
little high. Held, it has the eigenvalues of forward Euler with b = Tk.

  hapt check @notes/default --set loop.method=semi-implicit-euler --set loop.output=middle   318.3

With "middle" an undamped swing is passive from kT/2 of device damping on; with "start" or "end" no
damping is enough. It takes every coupling at a body.
"#,
    },
    Topic {
        name: "trapezoidal",
        aliases: &["trapezoid"],
        line: "the mean of both slopes: keeps a swing at every period",
        text: r#"x_{k+1} = x_k + T/2 (f(x_k, u_k) + f(x_{k+1}, u_k)): a matrix solved once beforehand.
λ = (1 + sT/2)/(1 - sT/2): an undamped swing stays on the unit circle at every period, and turns by
2 atan(ωT/2) a sample, a little slow.

  hapt check @notes/default --set loop.method=trapezoidal      in this loop 0.999997 Hz, 0

tustin is the same rule with the new sample taken first. Walls, detents and Coulomb friction at
a body go with it: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "zoh",
        aliases: &["exact-hold", "default-method"],
        line: "the default: exact while the puck's position is held over the step",
        text: r#"The solution of the differential equation with the sample u_k held over the step, by the matrix
exponential, computed once. λ = e^(sT) exactly: frequencies and damping are those of the world, at
every period. What is left of the error is the hold of the puck's position, and of the motor.

  hapt check @notes/default                                in this loop 1 Hz, 0
  hapt check @notes/default --set loop.period=2ms          in this loop 1 Hz, 0

Walls, detents and Coulomb friction at a body go with it: see nonlinear-at-a-body.
"#,
    },
    Topic {
        name: "rk4",
        aliases: &["runge-kutta"],
        line: "four slopes a step: accurate, stable up to a period",
        text: r#"The classical Runge-Kutta rule, with the sample u_k held over the step. Its λ is e^(sT) up to the
fourth power of sT. A slow swing loses next to nothing; beyond ωT = 2√2 it grows.

  hapt check @notes/default --set loop.method=rk4                            period 450.158 ms
  hapt check @notes/default --set loop.method=rk4 --set loop.period=460ms    unstable

It takes every coupling at a body, evaluated at its four stages.
"#,
    },
    Topic {
        name: "tustin",
        aliases: &["bilinear"],
        line: "trapezoidal, with the new sample taken first",
        text: r#"x_k = x_{k-1} + T/2 (f(x_{k-1}, u_{k-1}) + f(x_k, u_k)): the loop reads the puck, then advances the
world to now, then takes the torque from x_k. So its output is "start", and no other goes with it.
Eigenvalues as trapezoidal. It does nothing at the first sample.

  hapt check @notes/default --set loop.method=tustin | grep Hz      in this loop 0.999997 Hz, 0

With that output no device damping makes a swing passive that nothing damps.
No nonlinear coupling at a body goes with it, not even a constant.
"#,
    },
    Topic {
        name: "foh",
        aliases: &["first-order-hold"],
        line: "exact while the puck moves straight between two samples",
        text: r#"The solution of the differential equation with the puck running straight from the last sample to
this one. It takes the new sample first; its output is "start". Second order in T for any motion of
the puck: the method for a hand that moves smoothly, such as a sine.

  hapt check @notes/resonance | grep Hz                    in this loop 1 Hz, 0
  hapt sim @notes/resonance                                sample 2982 (2.982 s)

No nonlinear coupling at a body goes with it. No device damping makes a swing passive that nothing
damps: its torque comes out of step with the hand.
"#,
    },
    Topic {
        name: "nonlinear-at-a-body",
        aliases: &["nonlinear", "discrete-gradient"],
        line: "\"does not go with method ...\": walls, detents, friction at a body",
        text: r#"A wall, a detent or friction between a body and anything is nonlinear inside of the integration.
Taken from the start of the step, its torque makes energy: a body bouncing on a wall gained a factor
of millions. zoh, trapezoidal and backward-euler find it over the step, so that it never does (the
discrete gradient); LuGre friction has no such step, and tustin and foh have no place for one. There
hapt refuses, and does not approximate in silence. The explicit methods take everything and promise
less. Under zoh, with a spring that is clamped at 0.8 N m:

  hapt check @notes/default --set couplings.0.limit=0.8                passive against every

Between puck and ground such couplings go with every method: @devices/eth-wall has them with zoh.
"#,
    },
];
