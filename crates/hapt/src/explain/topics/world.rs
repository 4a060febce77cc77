//! The basic terms: the parts of a world.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "puck",
        aliases: &["handle", "haptic-wheel", "knob"],
        line: "the part of the device that the hand holds",
        text: r#"The handle of the device: the haptic wheel (rotary) or a sliding handle (linear). Its position is z.
It is a physical body with the inertia, damping and friction of [device]; couplings connect the
virtual world to it, and the motor renders their torque. A positive torque pushes toward larger z.

  hapt check @notes/default --set device.inertia='1e-3 kg m^2'      Certified

In a world file an end is called "puck", "ground" or by the name of a body: see body and coupling.
"#,
    },
    Topic {
        name: "body",
        aliases: &["bodies", "virtual-mass", "virtual-wheel", "mass"],
        line: "a virtual inertia with a position and a velocity",
        text: r#"A virtual mass or wheel: [bodies.NAME] with an inertia (linear: a mass), and an initial position and
velocity. Couplings connect it to the puck, to ground or to other bodies. The method advances it,
sample by sample; a world without bodies needs no integration.

  hapt sim @notes/default --set bodies.wheel.inertia='0.02 kg m^2'      peak torque
"#,
    },
    Topic {
        name: "ground",
        aliases: &["frame", "fixed"],
        line: "the fixed frame, at position 0, at rest",
        text: r#"The fixed frame. A coupling between the puck and ground is a wall, a detent or a spring that the
hand feels directly; one between a body and ground holds, damps or brakes the body.

  hapt check @notes/damped-to-ground      held      marginal

See coupling for the ends, and signs for the sign of a torque.
"#,
    },
    Topic {
        name: "coupling",
        aliases: &["couplings", "ends", "kind"],
        line: "a massless element between two ends",
        text: r#"spring, damper, wall, detent, friction or constant, between two of puck, ground and bodies. It acts
on q, the position of the first end relative to the second; its torque acts on the first end and the
opposite on the second. Overrides count couplings from 0, in file order:

  hapt check @notes/default --set couplings.0.stiffness='10 N mm/deg'      Certified

Each kind is a topic of its own: spring, damper, wall, detent, friction.
"#,
    },
    Topic {
        name: "spring",
        aliases: &["rest", "torsional-spring", "stiffness", "k"],
        line: "torque = -stiffness · (q - rest)",
        text: r#"The stiffness is the torque per angle, in N m/rad or N mm/deg (linear: N/m). The spring is slack at
q = `rest`. With the torque from the end of the step, a spring to a body requires a device damping
of stiffness · T/2; a stiffer spring needs a shorter period or more damping.

  hapt check @notes/default --why                                           0.0005093
  hapt check @notes/default --why --set couplings.0.stiffness='35.56 N mm/deg'   0.001019

See passivity, period and z-width.
"#,
    },
    Topic {
        name: "damper",
        aliases: &["damping", "viscous", "b", "viscosity"],
        line: "torque = -damping · the rate of q",
        text: r#"The damping is the torque per speed, in N m s/rad (linear: N s/m). Three places have one: the device
(device.damping, which is physical and dissipates what sampling generates), a damper in the world,
and a wall. A virtual damper at the puck depends on the velocity estimate from the encoder.

  hapt check @notes/default --set device.damping=0                      Not certified
  hapt check @notes/damped                                              held

See estimator, required-damping and compensating.
"#,
    },
    Topic {
        name: "wall",
        aliases: &["end-stop", "end-stops", "contact", "side", "at"],
        line: "a spring and a damper on one side of a position, that only push",
        text: r#"side = "above" pushes back while q is above `at`, "below" while it is below; it never pulls. Inside
it is a spring of `stiffness` and a damper of `damping`. A stiff wall is difficult to render: at the
puck, with differenced positions, it requires a device damping of about stiffness · T/2 + damping.

  hapt check @devices/eth-wall                         ETH haptic wheel
  hapt impedance @devices/eth-wall --z-width           passive

See z-width for the stiffest wall of a device. [device.stops] are mechanical stops, not rendered:
they ask for no damping.
"#,
    },
    Topic {
        name: "detent",
        aliases: &["detents", "pitch", "phase", "click", "notch"],
        line: "stable positions at equal distances, as of a click wheel",
        text: r#"torque = -torque · sin(2π (q - phase)/pitch): its stable positions are at phase and at every pitch
from there, where it is steepest, with 2π · torque/pitch. That slope counts as its stiffness.

  hapt sim @devices/smartknob-detents --scenario settle      scenario settle
  hapt check @devices/smartknob-detents                      Not certified

Halfway between two stable positions the slope falls, which requires no damping.
"#,
    },
    Topic {
        name: "dead-band",
        aliases: &["deadband", "dead-zone", "slack", "backlash", "play"],
        line: "a spring that begins at a distance from its rest",
        text: r#"Within `width` of `rest`, on either side, there is no torque; beyond, it is a spring of `stiffness`
from the edge on, within `limit` if there is one. The stiffness counts as that of a spring: a
dead band asks the device for stiffness · T/2.

  kind = "dead-band", stiffness = "1 N m/rad", width = "5 deg"

  hapt sim @devices/magnets --scenario turn                  scenario turn

See spring and wall.
"#,
    },
    Topic {
        name: "magnet",
        aliases: &["magnets", "attract", "snap", "pull"],
        line: "a pull toward a place, which fades with the distance",
        text: r#"torque = -torque · x · exp((1 - x²)/2) with x = (q - at)/width: it pulls toward `at`, most at
`width` from it, and hardly at 3 · width. It is steepest at `at`, with √e · torque/width, which
counts as its stiffness.

  kind = "magnet", torque = "30 N mm", width = "3 deg", at = "90 deg"

  hapt check @devices/magnets                                Certified

Beyond `width` the pull falls with the distance: a falling slope, which costs nothing. Detents pull
at equal distances, magnets where they are put.
"#,
    },
    Topic {
        name: "texture",
        aliases: &["textures", "grating", "ripple", "cogging", "waveform", "samples", "harmonics"],
        line: "a periodic torque against position, from harmonics or samples",
        text: r#"torque = torque · Σ (sine_n sin nθ + cosine_n cos nθ) with θ = 2π (q - phase)/pitch and up to 4
harmonics: in the file as sine and cosine, or as samples of one period, inline or in a CSV file. Its
energy is periodic: it gives back what it takes. Its steepest slope counts as its stiffness.

  kind = "texture", torque = "5 N mm", pitch = "10 deg", sine = [-1, 0, 0.3]
  kind = "texture", torque = "5 N mm", pitch = "10 deg", samples = [0, 1, 0.5, -0.5, -1]

  hapt sim @devices/grating --scenario stroke                scenario stroke

Samples without a mean that 4 harmonics show to a hundredth are read, all others are refused. With
sine = [-1] it is a detent.
"#,
    },
    Topic {
        name: "friction",
        aliases: &[
            "coulomb",
            "lugre",
            "stribeck",
            "friction-backward",
            "friction-by-position",
            "stick-slip",
            "bristle",
            "stick",
        ],
        line: "a torque against the motion: Coulomb or LuGre",
        text: r#"In a world `kind = "friction"` is Coulomb friction with one `torque`, or LuGre friction with six
keys, whose bristles let it stick. The device's own friction, device.friction, is physical: it stops
the puck, prevents a buzz of the encoder's counts, and never counts as damping. Toward smaller
positions it may be device.friction_backward; [device.friction_by_position] is how both change over
a turn, or another `pitch`. [device.stribeck] is what it is more at rest, gone at a `velocity`.
Certificates rest on the least level of all, and on none of what falls.

  hapt sim @notes/released --set device.friction='5 N mm'      friction took
  hapt check @notes/default --set device.friction='5 N mm'     Certified

See counts.
"#,
    },
    Topic {
        name: "integral",
        aliases: &["pid", "ki", "windup", "reset"],
        line: "the integral term of a PID controller",
        text: r#"A PID controller is three couplings between puck and ground: a spring (P), a damper (D) and
kind = "integral", whose torque is -stiffness/time times the sum of T (q - rest). With the stiffness
of the spring, `time` is the controller's integral time. A `limit` stops it from winding up.

  kind = "integral", stiffness = "1 N m/rad", time = "0.1 s", limit = "50 N mm"

  hapt check @knob/return-to-center --set couplings.0.kind=integral      energy to slow hands

No damping makes it passive: a hand that moves slowly to and fro draws energy from it, (T72) of
docs/theory.md. Friction of the device of no less than its limit does, (T76).
"#,
    },
    Topic {
        name: "acceleration",
        aliases: &["inertia-compensation", "compensate-inertia"],
        line: "a torque along the acceleration, which makes the puck lighter",
        text: r#"kind = "acceleration" between puck and ground has the torque inertia times the change of the
velocity behind a low-pass of `cutoff`, per second. A compensation of inertia is one:

  hapt check @notes/default --set 'compensation=[{of="inertia",share=0.05,cutoff="5 Hz"}]' --why

It costs about inertia · 2π cutoff of the device's damping, (T78) of docs/theory.md: more than it
takes off where it acts. More than the damping is not certified, and no motor runs it. With a
`limit` within the device's friction it is certified at any size, (T76).
"#,
    },
    Topic {
        name: "assist",
        aliases: &["friction-compensation", "compensate-friction"],
        line: "a torque along the velocity, within the device's friction",
        text: r#"kind = "assist" between puck and ground has the torque torque · v/velocity, within ±torque: it
pushes along with the hand. A compensation of friction is one:

  hapt check @knob/on-off --set 'compensation=[{of="friction",share=0.7,velocity="1 rad/s"}]'   safe

The device's friction takes what it gives, whatever counts, estimator and delay are: so it is
certified up to the least friction within its tolerance, (T76) of docs/theory.md. More is not, and
no motor runs it. What it takes of the friction does not pay for counts and missing damping.
"#,
    },
    Topic {
        name: "hand",
        aliases: &["human", "grip", "scenario", "step", "ramp", "sine"],
        line: "what moves the puck: a motion, a torque or a grip",
        text: r#"A scenario is a hand, a duration and a name. step, ramp, sine and path prescribe the puck's
position, torque pushes it, and grip holds it like a hand, through a spring and a damper. `release`
ends the contact.

  hapt sim @notes/default --scenario step                                    scenario step
  hapt sim @notes/default --set scenarios.step.hand.release='0.25 s'   hand gave

The certificate covers every passive hand: one that stores and dissipates energy and supplies none.
"#,
    },
    Topic {
        name: "period",
        aliases: &["sampling-period", "sample-period", "t", "rate", "sampling-rate"],
        line: "T, the time from one sample to the next",
        text: r#"Once in a period the loop reads the puck, advances the world and sends a torque, which is then held.
The torque is late by T/2 on average: halving T halves the device damping that a spring requires.

  hapt check @notes/default --why | grep ^passive                       0.0005093
  hapt check @notes/default --why --set loop.period=0.5ms | grep ^passive   0.0002546

A delay in samples (loop.delay = "1.5 samples") follows the period. See critical-period.
"#,
    },
    Topic {
        name: "device",
        aliases: &["motor", "hardware", "spec", "haptic-device"],
        line: "everything physical: puck, encoder, motor, limits",
        text: r#"[device] has the puck's inertia, damping and friction, the encoder's counts, the motor's limit and
levels. On the command line --device says what the loop runs on: sim (the exact simulation),
replay:FILE, moteus:..., odrive:..., simplefoc:... or hapt:PATH.

  hapt check @notes/default --set device.encoder=4000 | grep ^counts      counts

With a real motor the file's [device] and [safety] are ceilings: nothing widens them while it runs.
"#,
    },
    Topic {
        name: "world",
        aliases: &["virtual-world", "world-file", "loop", "method"],
        line: "the bodies and couplings: everything virtual",
        text: r#"A world file is TOML: [loop] has period and method, [device] the physical part, [bodies] and
[[couplings]] the world, [scenarios] the hands. The method advances the bodies: zoh, exact for a
held puck, is the default; forward-euler is there for comparison.

  hapt check @notes/default      Certified
  hapt check @notes/euler        Not certified

`hapt init` makes a file to start from; `hapt worlds` lists those that are built in.
"#,
    },
];
