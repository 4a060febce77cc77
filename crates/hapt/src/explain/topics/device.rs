//! The loop and its device: the input of the world, and its output.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "output",
        aliases: &["output-start", "output-end", "output-middle"],
        line: "the state of the step from which the torque is computed",
        text: r#""start": from x_k, before the step, as the notes' diagrams have it. "end" (the default): from the
positions of x_{k+1} with the mean velocities over the step; the torque is then earlier, and a
spring is passive with a device damping of kT/2. "middle": the mean of both. tustin and foh have
"start" only.

  hapt sim @notes/wheel                                    torque from the start of the step
  hapt sim @notes/wheel --set loop.output=end              torque from the end of the step

It has no effect on the held world, but on the hand: with "start" no device damping makes an
undamped oscillation passive.

  hapt check @notes/wheel --set loop.output=end            Certified
"#,
    },
    Topic {
        name: "advance",
        aliases: &["lead", "look-ahead"],
        line: "steps further ahead, for a delay that is known",
        text: r#"With output "end", `advance = n` predicts the world n further samples for the torque, the puck held
in place: the torque then fits the moment at which it arrives. Use it for a known delay of n whole
samples: a lossless world then requires at most KT(1/2 + n) of device damping, and without the
advance no damping is enough. The state itself does not change.

  hapt check @notes/default --set loop.delay=1ms --set loop.advance=1 | grep ^passive   0.001528

See delay.
"#,
    },
    Topic {
        name: "rates",
        aliases: &["bodies_every", "two-rates", "multirate"],
        line: "bodies that step at every n-th sample only",
        text: r#"With `bodies_every = n` in [loop] the bodies step at every n-th sample, by n periods, and
stand still in between. The torque has the puck's newest position at every sample. A spring then
requires KT/2 of the fast period T, and the method steps by nT.

  hapt check @devices/two-rates --why | grep ^passive      0.0005013

That is proved for zoh, trapezoidal and backward-euler with output "end", without a delay, and
with no damper or friction between the puck and a body. The others have no required damping.
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
  hapt check @notes/default --why --set loop.delay=1ms | grep ^free   unstable: hands-off

The held world is unaffected. Prediction compensates in part for whole periods: see advance. With a
fraction of a period no device damping makes an undamped oscillation passive: extend the delay to a
whole sample.
"#,
    },
    Topic {
        name: "handle",
        aliases: &["shaft", "device.handle", "flexible", "twist"],
        line: "a handle on a flexible shaft between motor and hand",
        text: r#"[device.handle] has the inertia of a handle beyond a shaft, and the stiffness and damping of the
shaft. The puck is then the motor's side, where the encoder is; the hand holds the handle.

  hapt sim @notes/released --set device.handle.inertia='5e-4 kg m^2' \
      --set device.handle.stiffness='20 N m/rad' --scenario release --out runs

Shaft, handle and hand are one passive hand to the motor. So the lines `passive`, `uneven` and
`counts` of hapt check hold for every handle, and `free` includes this one. `held` is the loop while
the hand holds the handle still. A run has the columns handle_rad and handle_rad_per_s.
"#,
    },
    Topic {
        name: "uneven",
        aliases: &["interval-max", "delay-max", "lag", "tolerance", "jitter", "safety.late"],
        line: "the verdict for uneven samples and varying delays",
        text: r#"No clock is exact. `loop.interval_max` is the longest time between two samples, `loop.delay_max`
the largest delay, `device.lag` the time constant with which the motor follows its command, and
damping = "1.2e-3 N m s/rad ± 20 %" has a tolerance. The line `uneven` of hapt check is the claim
of `passive` for every pattern of intervals and delays, and every device within its tolerances.

  hapt check @notes/default --set loop.interval_max=1.5ms | grep ^uneven

Without delay and lag it asks for the required damping times interval_max/period. Its end is about
the loop hands-off under the same patterns: proved, broken by a pattern, or open. A scenario runs
the worst pattern that was found with timing = { kind = "worst" }. In real time `safety.late`
("fade", "fault", "count") is what happens beyond the stated times.
"#,
    },
    Topic {
        name: "estimator",
        aliases: &[
            "exact",
            "difference",
            "low-pass",
            "foaw",
            "foaw-best",
            "velocity",
            "kalman",
            "levant",
            "acceleration",
            "cutoff",
            "every",
            "filter",
            "recentre",
            "window",
        ],
        line: "the estimator of the puck's velocity",
        text: r#"exact        the true velocity: a tachometer, and the default
difference   (z_k - z_{k-1})/T: fast; one count is a jump of count/T; over `every` n, count/(nT)
low-pass     the same through a filter with `cutoff`: smoother and later
foaw         over the longest window that fits within one count; foaw-best: the best line over it
kalman       the steady Kalman filter of constant acceleration, with `cutoff`: it overshoots
levant       the difference, as long as the velocity changes by no more than 1.1 `acceleration`
`filter` is of the position: the world sees it behind one pole, late by 1/(2π filter).
`recentre`: the world's origin slips to a puck that has rested for so long, held by friction.

With differences a step causes a torque peak, of 2 k z0 with b = Tk between puck and wheel:

  hapt sim @notes/damped --set loop.estimator=difference --set scenarios.step.hand.at=1s   1600 N mm
"#,
    },
    Topic {
        name: "encoder",
        aliases: &["count"],
        line: "the encoder's resolution: the position in counts",
        text: r#"`encoder = 4000` rounds the puck's position to 1/4000 of a turn, 0.09 deg; linear, it is the size of
a count, such as "5 um". Without the key the encoder is ideal. The torque of a spring K then comes
in steps of K·count, a difference's velocity in steps of count/T.

  hapt sim @devices/eth-wall --scenario push               peak torque
  hapt sim @devices/eth-wall --scenario push --set device.encoder=400

A wall with coarse counts buzzes at rest, unless the Coulomb friction exceeds K·count/2: see counts.
"#,
    },
    Topic {
        name: "counts",
        aliases: &["quantisation", "quantization", "buzz", "max-stiffness"],
        line: "the line `counts`: the largest stiffness for the encoder's resolution",
        text: r#"Counts of size Δ make a spring's torque jump by KΔ, which excites a hum that no viscous damping
stops near rest. Coulomb friction f of the real device does. The line `counts` gives the stiffness
up to which friction and damping absorb it, min(2b/T, 2(f - BΔ/T - s/2)/Δ) (Abbott and Okamura 2005;
dampers B at the puck and half a step s of the motor's levels take their share first), and whether
the total stiffness at the puck, walls at their steepest, is below. It is not part of the verdict,
but a line `not proved` reports it. With a body no friction is enough: see proved. Without
`encoder` and `levels` there is no such line.

  hapt check @devices/eth-wall --why --set loop.period=0.9ms   up to 2.889 N m/rad at the puck
  hapt check @devices/eth-wall --set loop.period=0.9ms --set device.friction=0    it may buzz
"#,
    },
    Topic {
        name: "limit",
        aliases: &["clipping", "clipped", "saturation", "motor-limit", "torque", "force"],
        line: "the largest torque that is commanded of the motor",
        text: r#"`device.limit` clamps the command to ±limit. `hapt sim` reports whether the world exceeds it, how
often, and at which sample first: from there on the rendered torque deviates from the world's. The
limit does not act on the virtual bodies: a held world keeps growing behind it.

  hapt sim @notes/euler                                    first at sample 1491 (1.491 s)
  hapt sim @notes/damped                                   never beyond its limit

A coupling's own `limit` clamps it on both ends, bodies included: see clamped.
"#,
    },
    Topic {
        name: "clamped",
        aliases: &["coupling-limit", "clamp", "clamped-limit"],
        line: "a `limit` on a spring, damper or wall: clamped on both of its ends",
        text: r#"`limit = "800 N mm"` in a spring, damper or wall clamps its torque to ±limit, on the puck and on the
body alike: action equals reaction. The motor's limit does not: it clips the torque on the puck
alone, while the full spring acts on the body, which can generate energy. Springs at the puck
clamped to the motor's limit or less prevent clipping, and the verdict can then cover the whole
loop.

  hapt check @notes/default --why                          not proved: the motor's limit cuts
  hapt check @notes/default --set couplings.0.limit=0.8    Certified: safe to let go
  hapt sim @notes/default --set couplings.0.limit=0.5      500 N mm

A clamped coupling is nonlinear: `held` and `free` evaluate it with its slope and without.
"#,
    },
    Topic {
        name: "levels",
        aliases: &["resolution", "torque-levels"],
        line: "the resolution of the torque",
        text: r#"`levels = 2048` rounds the command to steps of 2 limit/levels, as a PWM or a converter does. It
needs a limit, and is even so that the limit is a whole number of steps. Without the key the torque
has no steps.

  hapt sim @notes/default --set device.levels=16           peak torque

Coarse levels feel like clicks in a soft spring.
"#,
    },
    Topic {
        name: "compensating",
        aliases: &["compensating-damper", "b=tk", "b-=-tk"],
        line: "the damper b = Tk that cancels forward Euler's growth",
        text: r#"`damping = "compensating"` is T times the sum of the stiffnesses of the springs between the same two
ends (from a body to ground: of all springs at the body), and follows the period. Under forward
Euler it keeps an undamped oscillation at constant amplitude, for ωT < 2, of z0/√(1 - (ωT)²/4).

  hapt check @notes/damped | grep ^held                                marginal
  hapt check @notes/damped | grep ^passive                             not passive at any
  hapt check @notes/damped --why --set loop.method=zoh | grep note     only damps

That is enough for the held world; for passivity the torque from the start of the step stays out of
phase. Under the other methods it is an ordinary damper.
"#,
    },
    Topic {
        name: "identify",
        aliases: &["identification", "inertia", "offset", "cogging"],
        line: "the parameters of a device from a record of its motion",
        text: r#"`hapt identify` fits J a = torque(t - delay) + offset - b v - f sign v to a record's positions:
inertia, damping, friction, delay and a constant torque, each with a 95 % confidence interval; the
motor's sign and the encoder's counts. From a log, or by an experiment: steps and a chirp of a small
torque, under the supervisor. A real device moves only after a confirmation.

  hapt sim @notes/released --set device.encoder=4000 --out .
  hapt identify release.csv --from 0.26s                   encoder   4000 counts a revolution

Read its warnings: two parameters that the record hardly distinguishes, less than half a count of
noise. `--write` writes the [device] table, with end stops that the record runs into, gravity and
cogging. A lag is separated from a delay where the record allows; else the delay is both together.
`--against WORLD` names the numbers of a file that the record contradicts: it ends with 1 then.
"#,
    },
    Topic {
        name: "linear-estimate",
        aliases: &["steepest", "slopes", "estimate"],
        line: "the note on nonlinear worlds in `hapt check`",
        text: r#"Eigenvalues are for linear worlds. A wall, detent or friction at a body is taken once flat and once
at its steepest rise (a detent's is 2π torque/pitch, a wall's its stiffness), never falling; the
worst combination counts. So the verdict is an estimate: a wheel that moves in and out of a wall may
gain energy where neither state does. Simulate it as well:

  hapt sim @devices/smartknob-detents                      scenario settle

Couplings between puck and ground enter `free` and not `held`: a held puck does not move them.
"#,
    },
];
