//! The verdict, what it rests on, and what would mend it.

use super::Topic;

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
        aliases: &["critical"],
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
give the reasons: a motor that clips beside a body, counts beside a body, counts or levels with too
little friction, a constant torque at a body, the exact velocity in a damper at the puck, FOAW, a
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
lines to paste, a block a remedy, in the units of the file, rounded to the safe side. Device damping
is a property of the hardware. "none found": none of them does.
Certified, the same list is the margins: how far each may go alone. Two at once need a new check.

  hapt check @notes/wheel | grep -A1 remedies              output = "end"
  hapt check @notes/default                                period = "2.356 ms"

--no-remedies leaves the search out; in --json they are then null.
"#,
    },
];
