//! The loop and its device: what comes before the world, and behind it.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "output",
        aliases: &["output-start", "output-end", "output-middle"],
        line: "which state of the step makes the torque",
        text: r#""start": from x_k, before the step, as the notes' diagrams have it. "end" (the default): from the
positions of x_{k+1} with the mean velocities over the step; that makes the torque earlier, and a
spring passive at the price kT/2. "middle": the mean of both. tustin and foh know "start" only.

  hapt sim @notes/wheel                                    torque from the start of the step
  hapt sim @notes/wheel --set loop.output=end              torque from the end of the step

Held, it changes nothing. For the hand it does: with "start" no device damping makes a swing
passive that nothing damps.

  hapt check @notes/wheel --set loop.output=end            verdict   certified
"#,
    },
    Topic {
        name: "advance",
        aliases: &["lead", "look-ahead"],
        line: "steps further ahead, for a delay that is known",
        text: r#"With output "end", `advance = n` takes the world n further samples ahead for the torque, the puck
held where it is: the torque is then that of the moment at which it arrives. For a known delay of n
whole samples: a lossless world then asks for at most KT(1/2 + n) of device damping, and without the
advance no damping is enough. The state itself is not changed by it.

  hapt check @notes/default --set loop.delay=1ms --set loop.advance=1 | grep ^passive   0.001528

See delay.
"#,
    },
    Topic {
        name: "delay",
        aliases: &["latency"],
        line: "from the sample to the moment the torque changes",
        text: r#"Reading, computing and sending take time: the command of sample k acts from t_k + delay to t_{k+1} +
delay, and before the first command the motor gives 0. A delay comes on top of the T/2 of the hold:
a spring K, released, then needs about K(T/2 + delay) of device damping.

  hapt sim @notes/released --set loop.delay=1ms            scenario release
  hapt check @notes/default --set loop.delay=1ms | grep ^free      unstable: let go

Held, nothing changes. Whole periods can be made up for in part: see advance. With a part of a
period no device damping makes a swing passive that nothing damps: wait until the sample is full.
"#,
    },
    Topic {
        name: "estimator",
        aliases: &["exact", "difference", "low-pass", "foaw", "foaw-best", "velocity", "cutoff", "window"],
        line: "where the loop has the puck's velocity from",
        text: r#"exact        the true velocity: a tachometer, and the default
difference   (z_k - z_{k-1})/T: quick; one count is a jump of count/T
low-pass     the same, smoothed by `cutoff`: smoother and later
foaw         over the longest window that fits within one count: still at rest, quick in motion
foaw-best    the best line over that window

By differences a step looks like a kick, of 2 k z0 with b = Tk between puck and wheel:

  hapt sim @notes/damped --set loop.estimator=difference --set scenarios.step.hand.at=1s   1600 N mm
"#,
    },
    Topic {
        name: "encoder",
        aliases: &["count"],
        line: "the position comes in counts",
        text: r#"`encoder = 4000` rounds the puck's position to 1/4000 of a turn, 0.09 deg; linear, it is the size of
a count, such as "5 um". Without the key the encoder is ideal. The torque of a spring K then comes
in steps of K·count, a difference's velocity in steps of count/T.

  hapt sim @devices/eth-wall --scenario push               peak torque
  hapt sim @devices/eth-wall --scenario push --set device.encoder=400

A wall in coarse counts buzzes at rest, unless Coulomb friction beyond K·count/2 holds it still: see
counts.
"#,
    },
    Topic {
        name: "counts",
        aliases: &["quantisation", "quantization", "buzz", "max-stiffness"],
        line: "the line `counts`: how stiff the wheel may feel in encoder counts",
        text: r#"Counts of size Δ make a spring jump by KΔ, and that feeds a hum that no viscous damping stops near
rest. Coulomb friction f of the real device does. The line `counts` gives the stiffness up to which
friction and damping swallow them, min(2b/T, 2(f - BΔ/T - s/2)/Δ) (Abbott and Okamura 2005; dampers
B at the puck and half a step s of the motor's levels take their share first), and whether all the
stiffness at the puck together, walls at their steepest, is below. It is not part of the verdict,
but a line `not proved` says so. Beside a body no friction is enough: see proved. Without `encoder`
and `levels` there is no such line.

  hapt check @devices/eth-wall --set loop.period=0.9ms     up to 2.889 N m/rad at the puck
  hapt check @devices/eth-wall --set loop.period=0.9ms --set device.friction=0    it may buzz
"#,
    },
    Topic {
        name: "limit",
        aliases: &["clipping", "clipped", "saturation", "motor-limit", "torque", "force"],
        line: "the largest torque that the motor may be asked for",
        text: r#"`device.limit` cuts the command to ±limit. `hapt sim` says when the world asks for more, how often,
and first at which sample: from there on the wheel does not feel like the world. The virtual bodies
know nothing of it: a held world grows on behind the limit.

  hapt sim @notes/euler                                    first at sample 1491 (1.491 s)
  hapt sim @notes/damped                                   never asked for more than its limit

A coupling's own `limit` cuts it on both ends, so that the bodies know: see clamped.
"#,
    },
    Topic {
        name: "clamped",
        aliases: &["coupling-limit", "clamp", "clamped-limit"],
        line: "a `limit` on a spring, damper or wall: cut on both of its ends",
        text: r#"`limit = "800 N mm"` in a spring, damper or wall holds its torque within ±limit, on the puck and on
the body alike: action stays reaction. The motor's limit does not: it cuts what the wheel feels, and
the body is still pulled by the full spring, which can make energy. Springs at the puck clamped to
no more than the motor's limit keep it from clipping, and the verdict can be one on the whole loop.

  hapt check @notes/default                                not proved: the motor's limit cuts
  hapt check @notes/default --set couplings.0.limit=0.8    verdict   certified: stable held
  hapt sim @notes/default --set couplings.0.limit=0.5      500 N mm

Clamped, a coupling is nonlinear: `held` and `free` look at it with its slope and without.
"#,
    },
    Topic {
        name: "levels",
        aliases: &["resolution", "torque-levels"],
        line: "the torque comes in steps",
        text: r#"`levels = 2048` rounds the command to steps of 2 limit/levels, as a PWM or a converter does. It
needs a limit, and is even so that the limit is a whole number of steps. Without it: no steps.

  hapt sim @notes/default --set device.levels=16           peak torque

Coarse levels are felt as clicks in a soft spring.
"#,
    },
    Topic {
        name: "compensating",
        aliases: &["compensating-damper", "b=tk", "b-=-tk"],
        line: "the damper b = Tk that undoes forward Euler's growth",
        text: r#"`damping = "compensating"` is T times the sum of the stiffnesses of the springs between the same two
ends (from a body to ground: of all springs at the body), and follows the period. Under forward
Euler it keeps an undamped swing at one size, for ωT < 2, with the amplitude z0/√(1 - (ωT)²/4).

  hapt check @notes/damped | grep ^held                                marginal
  hapt check @notes/damped | grep ^passive                             not passive at any
  hapt check @notes/damped --set loop.method=zoh | grep note           only damps

Held, that is enough; in the hand the torque from the start of the step stays out of step. Under the
other methods it is a damper like any other.
"#,
    },
    Topic {
        name: "identify",
        aliases: &["identification", "inertia", "offset", "cogging"],
        line: "what a device is made of, from a record of its motion",
        text: r#"`hapt identify` fits J a = torque(t - delay) + offset - b v - f sign v to the positions of a record:
inertia, damping, friction, delay and a constant torque, each with the interval that covers the
truth 95 times in 100; the motor's sign and the encoder's counts. From a log, or by an experiment:
steps and a chirp of a small torque, under the supervisor. A real device moves after a yes only.

  hapt sim @notes/released --set device.encoder=4000 --out .
  hapt identify release.csv --from 0.26s                   encoder   4000 counts a revolution

Heed its warnings: two numbers that the record hardly tells apart, less than half a count of noise,
a torque that goes with the position (gravity, cogging). `--write` gives the [device] table.
"#,
    },
    Topic {
        name: "linear-estimate",
        aliases: &["steepest", "slopes", "estimate"],
        line: "the note on nonlinear worlds in `hapt check`",
        text: r#"Eigenvalues are for linear worlds. A wall, detent or friction at a body is taken once flat and once
at its steepest rise (a detent's is 2π torque/pitch, a wall's its stiffness), never falling; of all
combinations the worst counts. So the verdict is an estimate: a wheel that hops between in and out
of a wall may grow where neither does. Run it as well:

  hapt sim @devices/smartknob-detents                      scenario settle

Couplings between puck and ground enter `free` and not `held`: held, they move nothing.
"#,
    },
];
