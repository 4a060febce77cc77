//! The texts of `hapt explain`, one row a topic.
//!
//! About ten lines of at most 100 columns each. A line that begins with two blanks and `hapt` is a command that runs; what
//! stands beside it, after three blanks or more, is in its output. So no number here can grow old.

/// One topic.
pub struct Topic {
    /// What it is asked for by.
    pub name: &'static str,
    /// Other words for it.
    pub aliases: &'static [&'static str],
    /// What it is about, for the list.
    pub line: &'static str,
    /// The whole text.
    pub text: &'static str,
}

/// Every topic: the verdict first, then the methods, the loop, the device, and what messages say.
pub const TOPICS: &[Topic] = &[
    Topic {
        name: "held",
        aliases: &["hold-still", "puck-held"],
        line: "the world alone, the puck standing still: whether the integration holds",
        text: r#"The puck stands still, as in a hand infinitely strong, and only the bodies move. The line `held`
of `hapt check` says what becomes of a disturbance of them: λ, the eigenvalues of one sample.
A held puck does not feel the motor: limit, delay, encoder and the device's damping change nothing.
So "held" judges the integration alone. Device and hand come in with the lines `free` and `passive`:
see free and passivity.

  hapt check @notes/euler            held      unstable

Walls, detents and friction at a body are taken as their slopes, the worst of them; a note says so.
"#,
    },
    Topic {
        name: "growth",
        aliases: &["growth-per-s", "growth-per-second"],
        line: "the rate at which a disturbance grows, in 1/s",
        text: r#"A disturbance of the held world grows as e^(growth · t): growth = ln(largest |λ|)/T, λ being the
eigenvalues of one sample of length T. Below 0 it decays. Forward Euler on an undamped swing of
angular frequency ω has ln(1 + ω²T²)/(2T), about ω²T/2: half the period, half the growth, not none.

  hapt check @notes/euler                              growth 0.0197388 per second
  hapt check @notes/euler --set loop.period=0.5ms      growth 0.00986956 per second
  hapt sim @notes/euler                                0.0197388 predicted

`hapt sim` fits the same number to the run, where the hand holds still for long enough.
"#,
    },
    Topic {
        name: "verdict",
        aliases: &["verdicts", "certified", "certificate", "not-certified"],
        line: "certified, or not: the answer of `hapt check`",
        text: r#"certified        stable held and let go, and passive against every passive hand      exit code 0
  ... as far as the linear loop goes: the lines `not proved` say what that leaves open
not certified    unstable held, unstable let go, or not passive                      exit code 1

The sentence names what is missing; `remedies` says what would make it so. Encoder counts get a
line of their own and do not change the verdict.

  hapt check @notes/default                                verdict   certified, as far as
  hapt check @notes/default --set couplings.0.limit=0.8    verdict   certified: stable held
  hapt check @notes/euler                                  verdict   not certified: it is unstable
"#,
    },
    Topic {
        name: "stable",
        aliases: &[],
        line: "a disturbance decays",
        text: r#"Every eigenvalue of one sample lies inside the unit circle, |λ| < 1: whatever disturbs the bodies
(`held`), or bodies and wheel (`free`), dies away, by at least the rate that is printed. Held, a
world without bodies has nothing to disturb, and is stable too.

  hapt check @notes/euler --set loop.method=backward-euler      stable: a disturbance
  hapt check @devices/eth-wall --set loop.period=0.9ms          nothing is left to move

Stable does not mean true: backward Euler takes energy out of a swing that nothing damps.
Nor does it mean safe in the hand: see passivity.
"#,
    },
    Topic {
        name: "marginal",
        aliases: &["limit-of-stability"],
        line: "a disturbance stays as it is",
        text: r#"The largest eigenvalue lies on the unit circle, |λ| = 1 (a growth below 1e-9 per second counts as
none). That is right for a swing which nothing damps, and for what no spring ties: it stays where
it is shifted to. A good integrator keeps an undamped world marginal, and does not make it stable.

  hapt check @notes/default                                marginal
  hapt check @notes/default --set loop.period=2ms          marginal

A small change may tip it: for a margin add a damper between the same two ends.
"#,
    },
    Topic {
        name: "unstable",
        aliases: &["runs-away", "run-away"],
        line: "a disturbance grows",
        text: r#"An eigenvalue lies outside the unit circle: the smallest disturbance grows, until
the motor is at its limit. `hapt check` ends with exit code 1. Held, another method helps (zoh,
trapezoidal), or a damper beside the spring; let go (see free), damping of the real device, a
softer spring, a shorter period.

  hapt check @notes/euler                                                  unstable
  hapt check @notes/euler --set loop.method=zoh --set loop.output=end      marginal

A shorter period alone does not cure forward Euler on an undamped swing: it only grows slower.
"#,
    },
    Topic {
        name: "critical-period",
        aliases: &["critical", "period"],
        line: "the longest period up to which the loop is not unstable",
        text: r#"No eigenvalue is outside the unit circle for any period up to this one. Dampers called
"compensating" follow the period, delays stay in seconds. It is printed for the held world and for
the free loop. "none, unstable from 0 on": no period is short enough. "none, never unstable": any
period will do. For a hand see the period among the margins: it is often shorter.

  hapt check @notes/default                                critical period 2.35619 ms
  hapt check @notes/damped --set loop.period=320ms         unstable
  hapt check @notes/euler                                  none, unstable from 0 on

Held, the notes' wheel with b = Tk has 318.31 ms, 2/ω for 1 Hz.
"#,
    },
    Topic {
        name: "modes",
        aliases: &["mode", "damping-ratio", "frequency"],
        line: "the swings of the world, and what the loop makes of them",
        text: r#"A mode is one way in which the world swings, with the puck held or with the wheel let go: its
frequency |s|/2π and damping ratio -Re s/|s|, of the differential equation; then the same of what
the loop really does, from ln(λ)/T.
A method may change both. A negative ratio in the loop is a swing that grows.

  hapt check @notes/euler                in this loop 0.999992 Hz, -0.00314156
  hapt check @notes/default --set loop.method=trapezoidal          in this loop 0.999997 Hz, 0
  hapt check @notes/default              in this loop 1 Hz, 0

"It does not swing" says that the loop has made two real eigenvalues of the pair.
"#,
    },
    Topic {
        name: "free",
        aliases: &["released", "let-go", "hands-off", "hold", "free-loop"],
        line: "the hand is gone: wheel, motor and world by themselves",
        text: r#"The line `free` of `hapt check`: world, estimator, delay, hold and device as one linear map, nobody
at the wheel. The motor holds its torque for a period, so that it comes T/2 late on average, and a
late spring drives: the swing of J_z on k grows by about kT/(4 J_z) per second, whatever the method.
Damping of the device, more than kT/2, or a shorter period pays for that. Limit, encoder, levels and
Coulomb friction are left out.

  hapt check @notes/default                                            free      stable
  hapt check @notes/default --set device.damping=0 | grep ^free        unstable: let go
"#,
    },
    Topic {
        name: "passivity",
        aliases: &["passive", "required-damping", "device-damping"],
        line: "no passive hand can draw energy from it: how much device damping that takes",
        text: r#"A hand is passive when it gives no more energy than it got: springs, masses, dampers, and nearly all
people. The line `passive` says how much viscous damping the real device needs so that no such hand
can make the loop shake (Colgate and Schenkel 1997, exactly, for the linear loop). A spring K needs
KT/2; a damper B by differences B more; a delay of d samples KTd more. "not passive at any device
damping": the world answers out of step, and friction of the wheel cannot pay; see output.

  hapt check @notes/default                           it asks the device for 0.0005093 N m s/rad
  hapt check @notes/default --set loop.period=2ms     it asks the device for 0.001019 N m s/rad
  hapt check @notes/wheel | grep ^passive             not passive at any device damping

Passive and stable are different claims: see verdict, proved and remedies.
"#,
    },
    Topic {
        name: "proved",
        aliases: &["not-proved", "proof", "linear-loop"],
        line: "what a verdict on the linear loop leaves open",
        text: r#"Eigenvalues and passivity are of the linear loop: no counts, no clipping, walls as their slopes.
Where a theorem carries passivity over to the whole loop it is proved; where not, lines `not proved`
give the reasons: a motor that clips beside a body, counts at a body that nothing damps, FOAW, a
wall behind a low-pass. The verdict then stands for the linear loop alone. The energy theorem covers
zoh, trapezoidal and backward-euler with output "end", undamped walls at bodies too.

  hapt check @notes/default                                not proved: the motor's limit cuts
  hapt check @notes/default --set couplings.0.limit=0.8    passive against every passive hand:

"not proved" is not "wrong": simulate it, with the device as it is. See limit and energy.
"#,
    },
    Topic {
        name: "remedies",
        aliases: &["remedy", "margins", "margin", "no-remedies"],
        line: "what would make a loop certified, and how far one may go",
        text: r#"Not certified, `hapt check` looks for numbers that would change that, each one by itself: device
damping, period, delay, advance, output, stiffness, a damper from every body to ground. They are
lines to paste, in the units of the file, rounded to the safe side. "none found": none of them does.
Certified, the same list is the margins: how far each may go alone. Two at once need a new check.

  hapt check @notes/wheel | grep -A1 remedies              output = "end"
  hapt check @notes/default                                period = "2.356 ms"

--no-remedies leaves the search out; in --json they are then null.
"#,
    },
    Topic {
        name: "sweep",
        aliases: &["vary", "measure", "measures", "map"],
        line: "many worlds at once: a table, and a map",
        text: r#"`hapt sweep` goes through every combination of a few keys and writes a row for each: KEY=FROM..TO:N,
or :N:log for equal ratios. Measures of a run are peak_torque, final_energy and settling_time; of
the loop held_growth_per_s, free_growth_per_s, required_damping and certified (0 or 1). A measure
without a value is empty. --plot draws a curve or a map; --resume goes on after an interruption.

  hapt sweep @notes/default --vary loop.period=1ms..4ms:4 --measure certified --out map.csv
  cat map.csv

The row 0.003,0.0 says: at 3 ms it is not certified.
"#,
    },
    Topic {
        name: "impedance",
        aliases: &["felt", "feel", "rendered", "asked", "ideal"],
        line: "what a hand that swings feels, against frequency",
        text: r#"`hapt impedance`: the torque that resists a hand which moves as a sine, over its position, K. It is
said as the one spring (Re K), damper (Im K/ω) or mass (-Re K/ω²) that would do alone there; a mass
below 0 is felt as a spring, a damper below 0 gives energy. "asked" is what a slow hand is to feel,
"ideal" what the differential equations do, without samples, hold and delay. The device's own
inertia and damping come to it. At a resonance that nothing damps it is "unbounded".

  hapt impedance @notes/default            rendered to 10 % up to 0.301507 Hz
  hapt impedance @notes/default            the loop damps by -0.0005093 N m s/rad

That damping is -KT/2, the price of holding the torque: the device has to pay it.
"#,
    },
    Topic {
        name: "z-width",
        aliases: &["width", "zwidth"],
        line: "the springs and dampers that a device can stand for",
        text: r#"`hapt impedance --z-width` puts the world away and asks which spring K and damper B to ground the
device could render, at its period, delay and estimator. "passive": no passive hand can draw energy
from it. "stable": nothing grows when nobody holds it. The stable ones are many times more, and
feel stiffer; a hand may shake them. "counts" is up to where the encoder's steps are swallowed.

  hapt impedance @devices/eth-wall --z-width     passive   up to 2.6 N m/rad without a damper
  hapt impedance @devices/eth-wall --z-width --plot z.svg

2.6 N m/rad is 2b/T. A longer delay, a heavier filter and a coarser encoder narrow it.
"#,
    },
    Topic {
        name: "boundary",
        aliases: &["edge", "edges", "d-decomposition", "region"],
        line: "the exact edge of stability and of passivity over two keys",
        text: r#"`hapt boundary` finds where in the plane of two keys held, free and passive change, without a grid.
Where the keys are a stiffness and a damping at one place, the edge of stability comes from its
equation: λ = 1, λ = -1, λ = e^{jφ}, solved for both keys (D-decomposition). Else the edge is
followed by the change of the verdict. Beside every point the verdict is asked on both sides. An
island between the lines that are searched, five each way and the frame, can be missed.

  hapt boundary @devices/eth-wall --vary loop.delay=0..2ms --vary device.damping=0..0.01
"#,
    },
    Topic {
        name: "worst-hand",
        aliases: &["worst", "broken", "survived", "gap"],
        line: "the passive hand that draws most energy: the other side of the certificate",
        text: r#"`hapt worst` looks for a passive hand, a mass on a spring with some damping, that draws energy from
the loop: by eigenvalues, which is exact for the linear loop, and by runs with all that the device
has; then for hands that open and take hold again. It prints the scenario, or writes it by --out.

  hapt worst @notes/default                                survived, as certified
  hapt worst @notes/wheel | grep verdict                   broken

The exit code is 1 when broken. `gap` says what the certificate asks of the device's damping, and up
to what such a hand breaks the linear loop. In between nothing is known: a hand of several swings
may break it, and the certificate covers all of them.
"#,
    },
    Topic {
        name: "energy",
        aliases: &["energy-theorem", "ledger"],
        line: "the ledger of a run, and the theorem behind `output = \"end\"`",
        text: r#"`hapt sim` sums what hand and motor gave and what damping and friction took, exactly, between the
samples. A motor that gave energy has shaken the wheel, or returned what the world had stored.
The theorem: where the method keeps the stored energy with the puck held, and the torque is that at
the END of the step, a sample leaks at most K dz²/2; device damping b ≥ KT/2 pays for it, whatever
the hand does and whatever hangs on the spring. It is why hapt's default is zoh with output "end".

  hapt sim @notes/released --set loop.output=end           hand gave

See passivity.
"#,
    },
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
friction and damping swallow them, min(2b/T, 2f/Δ) (Abbott and Okamura 2005), and whether all the
stiffness at the puck together, walls at their steepest, is below. It is not part of the verdict,
but a line `not proved` says so. Without `encoder` there is no such line.

  hapt check @devices/eth-wall --set loop.period=0.9ms     up to 2.889 N m/rad at the puck
  hapt check @devices/eth-wall --set loop.period=0.9ms --set device.friction=0    it may buzz
"#,
    },
    Topic {
        name: "limit",
        aliases: &["clipping", "clipped", "saturation", "motor-limit"],
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
    Topic {
        name: "not-finite",
        aliases: &["stops-being-finite", "overflow", "nan", "infinity"],
        line: "\"the run stops being finite\": the loop has run away",
        text: r#"The numbers have left double precision: an unstable loop has doubled for too long. The run ends
there with exit code 3, and a file keeps its rows up to the last finite one. The limit cuts the
motor's torque, not the virtual bodies, so it does not help here. Ask why, then change the method or
the period:

  hapt check @notes/euler --set loop.period=1s                     unstable
  hapt check @notes/default --set loop.period=1s | grep ^held      marginal
"#,
    },
    Topic {
        name: "units",
        aliases: &["unit", "dimension", "quantity", "quantities"],
        line: "numbers with units, and the angle as a dimension",
        text: r#"A quantity is "1 ms", "45 deg", "17.8 N mm/deg", "6.4e-4 kg m^2", or a bare number in SI (rad, m,
s, kg, N, N m). Units: rad deg ° rev rpm m cm mm um s ms us Hz kHz N mN kg g J Nm Nmm mNm;
products by a space, · or *, quotients by / (a/b c is (a/b)·c), powers by ^2 or ².
The angle counts: N m is a torque, N m/rad a stiffness, and one for the other is an error, for
forgotten degrees cost a factor 57.3. Only an inertia goes both ways, kg m^2 or N m s^2/rad.

  hapt sim @notes/wheel --set loop.period=2ms              2 ms a sample
  hapt sim @notes/wheel --set 'couplings.0.stiffness=1 J/rad'
"#,
    },
    Topic {
        name: "unknown-key",
        aliases: &["key", "keys", "schema", "did-you-mean"],
        line: "a key that the world file does not have there",
        text: r#"Every key is known by name and place, so that a slip of the pen is an error and not a default. The
message names the nearest key, or the place where the key belongs. A key of one kind of coupling or
hand is unknown to the others. All of them, with docs and defaults, for your editor:

  hapt schema                                              "compensating"
  hapt init my-world --template wall

An editor with taplo (Even Better TOML) reads the schema by the file's first line, #:schema.
"#,
    },
    Topic {
        name: "samples",
        aliases: &["duration", "samples-limit", "too-many-samples"],
        line: "at most 10^10 samples in a scenario",
        text: r#"A scenario has round(duration/T) + 1 samples, from t = 0 to the duration. More than 10^10 are
refused, wherever they go: nearly always a unit is wrong, such as "1 us" for "1 ms". A run itself
takes no memory for its length; a CSV file takes a line a sample.

  hapt sim @notes/euler --set scenarios.step.duration=1s   1 s at 1 ms a sample
"#,
    },
    Topic {
        name: "path",
        aliases: &["file", "csv", "path-file"],
        line: "a hand that follows a file",
        text: r#"hand = { kind = "path", file = "turn.csv" }: two columns, times increasing, straight in between.
The header has the unit, time_s,puck_deg for a position; a torque hand's path has time_s,torque_Nmm.
The file stands beside the world file or below, never outside of its folder; for standard input and
built-in worlds, in the current folder. # begins a comment.

  hapt sim @notes/wheel --out runs

The columns time_s and puck_rad of such a run, put into a file of their own, are a path again.
"#,
    },
    Topic {
        name: "signs",
        aliases: &["sign", "q", "between"],
        line: "which way a torque pushes",
        text: r#"A torque is the torque ON THE PUCK, positive when it pushes toward larger angles. A coupling acts on
q, its first end as seen from the second; its torque stands on the first end, the opposite on the
second. So `between = ["puck", "wheel"]` with a spring gives -k (puck - wheel) on the puck.

  hapt sim @notes/wheel                                    800 N mm

The notes' (2.18) and (2.22) print the torque on the virtual wheel under the name of the reaction:
with that sign the released wheel runs away.
"#,
    },
    Topic {
        name: "exit-codes",
        aliases: &["exit-code", "codes", "exit"],
        line: "how a command ends: 0, 1, 2, 3, 130, 143",
        text: r#"0     done; for `hapt check`: certified. Also when the reader of our output has seen enough
1     `hapt check` has not certified the loop: unstable or not passive; `hapt worst` broke it
2     bad usage or bad input: nothing was done
3     the system failed, or a run stopped being finite: its file ends before
130   interrupted (Ctrl-C): unfinished files are removed
143   terminated: the same

  hapt check @notes/euler            unstable
"#,
    },
];
