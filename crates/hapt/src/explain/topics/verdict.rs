//! The verdict, its reasons and its remedies.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "held",
        aliases: &["hold-still", "puck-held"],
        line: "the world alone, the puck standing still: stability of the integration",
        text: r#"The puck stands still, as in a hand of unlimited strength, and only the bodies move. The line `held`
of `hapt check` describes the evolution of a disturbance: λ, the eigenvalues of one sample. The
motor has no effect on a held puck: limit, delay, encoder and the device's damping do not matter. So
"held" is about the integration alone. The lines `free` and `passive` include device and hand: see
free and passivity.

  hapt check @notes/euler            held      unstable

Walls, detents and friction at a body are taken as their slopes, the worst of them, with a note.
"#,
    },
    Topic {
        name: "growth",
        aliases: &["growth-per-s", "growth-per-second"],
        line: "the rate at which a disturbance grows, in 1/s",
        text: r#"A disturbance of the held world grows as e^(growth · t): growth = ln(largest |λ|)/T, λ being the
eigenvalues of one sample of length T. Below 0 it decays. Forward Euler on an undamped mode of
angular frequency ω has ln(1 + ω²T²)/(2T), about ω²T/2: half the period gives half the growth, never
none.

  hapt check @notes/euler --why                        growth 0.0197388 per second
  hapt check @notes/euler --why --set loop.period=0.5ms   growth 0.00986956 per second
  hapt sim @notes/euler                                0.0197388 predicted

`hapt sim` fits the same number to the run, if the hand holds still for long enough.
"#,
    },
    Topic {
        name: "verdict",
        aliases: &["verdicts", "certified", "certificate", "not-certified"],
        line: "certified, or not: the answer of `hapt check`",
        text: r#"certified        by theorems: stable held and hands-off, and passive     exit code 0
open             nothing was found against it, no theorem covers it      exit code 1
not certified    unstable held, unstable hands-off, or not passive       exit code 1

The sentence names the conditions that fail; `remedies` lists changes that certify it. The lines
`not proved` say what theorems leave out, of counts, levels and limit of the device too.

  hapt check @notes/default                                Certified: safe to let go
  hapt check @notes/default --set couplings.0.limit=0.8    Certified: safe to let go
  hapt check @notes/euler                                  Not certified: it grows
"#,
    },
    Topic {
        name: "stable",
        aliases: &[],
        line: "a disturbance decays",
        text: r#"Every eigenvalue of one sample lies inside the unit circle, |λ| < 1: a disturbance of the bodies
(`held`), or of bodies and wheel (`free`), decays, by at least the printed rate. Held, a world
without bodies has no state, and is stable too.

  hapt check @notes/euler --why --set loop.method=backward-euler   stable: a disturbance
  hapt check @devices/eth-wall --set loop.period=0.9ms          nothing moves once the puck is held

Stable does not mean accurate: backward Euler dissipates the energy of an undamped oscillation. Nor
does it mean safe in the hand: see passivity.
"#,
    },
    Topic {
        name: "marginal",
        aliases: &["limit-of-stability"],
        line: "a disturbance neither grows nor decays",
        text: r#"The largest eigenvalue lies on the unit circle, |λ| = 1 (a growth below 1e-9 per second counts as
none). That is correct for an undamped oscillation, and for a body that no spring ties: it stays
where it is shifted to. A good integrator keeps an undamped world marginal, and does not make it
stable.

  hapt check @notes/default                                marginal
  hapt check @notes/default --set loop.period=2ms          marginal

A small change may make it unstable: for a margin add a damper between the same two ends.
"#,
    },
    Topic {
        name: "unstable",
        aliases: &["runs-away", "run-away"],
        line: "a disturbance grows",
        text: r#"An eigenvalue lies outside the unit circle: the smallest disturbance grows, until the motor is at
its limit. `hapt check` ends with exit code 1. Held, another method helps (zoh, trapezoidal), or a
damper beside the spring; hands-off (see free), damping of the real device, a softer spring, a
shorter period.

  hapt check @notes/euler                                                  unstable
  hapt check @notes/euler --set loop.method=zoh --set loop.output=end      marginal

A shorter period alone does not stabilise forward Euler on an undamped mode: the growth is only
slower.
"#,
    },
    Topic {
        name: "critical-period",
        aliases: &["critical"],
        line: "the longest period up to which the loop is not unstable",
        text: r#"No eigenvalue is outside the unit circle for any period up to this one. Dampers called
"compensating" follow the period, delays stay in seconds. It is printed for the held world and for
the free loop. "none, unstable from 0 on": no period is short enough. "none, never unstable": every
period is stable. For a passive hand see the period among the margins: it is often shorter.

  hapt check @notes/default --why                          critical period 2.35619 ms
  hapt check @notes/damped --set loop.period=320ms         unstable
  hapt check @notes/euler --why                            none, unstable from 0 on

Held, the notes' wheel with b = Tk has 318.31 ms, 2/ω for 1 Hz.
"#,
    },
    Topic {
        name: "modes",
        aliases: &["mode", "damping-ratio", "frequency"],
        line: "the oscillations of the world, and their frequency and damping in the loop",
        text: r#"A mode is an oscillation of the world, with the puck held or hands-off: its frequency |s|/2π and
damping ratio -Re s/|s|, of the differential equation; then the same in the loop, from ln(λ)/T. A
method may change both. A negative ratio in the loop is an oscillation that grows.

  hapt check @notes/euler --why          in this loop 0.999992 Hz, -0.00314156
  hapt check @notes/default --why --set loop.method=trapezoidal    in this loop 0.999997 Hz, 0
  hapt check @notes/default --why        in this loop 1 Hz, 0

"It does not swing" means that the pair has become two real eigenvalues in the loop.
"#,
    },
    Topic {
        name: "free",
        aliases: &["released", "let-go", "hands-off", "hold", "free-loop"],
        line: "hands-off: the stability of wheel, motor and world",
        text: r#"The line `free` of `hapt check`: world, estimator, delay, hold and device as one linear map, without
a hand. The motor holds its torque for a period, so that it is T/2 late on average, and a late
spring supplies energy: the oscillation of J_z on k grows by about kT/(4 J_z) per second, for every
method. Damping of the device, more than kT/2, or a shorter period compensates for that. Limit,
encoder, levels and Coulomb friction are left out.

  hapt check @notes/default                                            free      stable
  hapt check @notes/default --why --set device.damping=0 | grep ^free   unstable: hands-off
"#,
    },
    Topic {
        name: "passivity",
        aliases: &["passive", "required-damping", "device-damping"],
        line: "no passive hand can extract energy: the device damping that this requires",
        text: r#"A hand is passive when it supplies no more energy than it received: springs, masses, dampers, and
nearly all people. The line `passive` gives the viscous damping that the real device needs so that
no such hand can make the loop shake (Colgate and Schenkel 1997, exactly, for the linear loop). A
spring K needs KT/2; a damper B by differences B more; a delay of d samples KTd more. "not passive
at any device damping": the torque is out of phase, and damping cannot compensate; see output.

  hapt check @notes/default --why                     a device damping of 0.0005093 N m s/rad
  hapt check @notes/default --why --set loop.period=2ms   a device damping of 0.001019 N m s/rad
  hapt check @notes/wheel | grep ^passive             not passive at any device damping

Passivity and stability are different properties: see verdict, proved and remedies.
"#,
    },
    Topic {
        name: "proved",
        aliases: &["not-proved", "proof", "linear-loop"],
        line: "what a verdict about the linear loop leaves open",
        text: r#"Eigenvalues and passivity describe the linear loop: no counts, no clipping, walls as their slopes.
Where a theorem extends passivity to the whole loop it is proved; otherwise lines `not proved` give
the reasons: a motor that clips beside a body, counts beside a body, counts or levels with too
little friction, a constant torque at a body, the exact velocity in a damper at the puck, FOAW, a
wall behind a low-pass. The verdict then covers the linear loop alone. The energy theorem covers
zoh, trapezoidal and backward-euler with output "end", undamped walls at bodies too.

  hapt check @notes/default --why                          not proved: the motor's limit cuts
  hapt check @notes/default --why --set couplings.0.limit=0.8   passive against every passive hand:

"not proved" does not mean "wrong": simulate it, with the device as it is. See limit and energy.
"#,
    },
    Topic {
        name: "remedies",
        aliases: &["remedy", "margins", "margin", "no-remedies"],
        line: "changes that certify a loop, and the margins of a certified one",
        text: r#"For a loop that is not certified, `hapt check` searches for changes that certify it, one at a time:
device damping, period, delay, advance, output, stiffness, a damper from every body to ground. They
are lines to paste, a block a remedy, in the units of the file, rounded to the safe side. Device
damping is a property of the hardware. "none found": no single change is enough. For a certified
loop the same list has the margins: the range of each alone. Two at once need a new check.

  hapt check @notes/wheel | grep -A1 remedies              output = "end"
  hapt check @notes/default                                period = "2.356194 ms"

--no-remedies omits the search; in --json they are then null.
"#,
    },
];
