//! The rows of the table of keys, for world files and for network files.

use hapt_core::spec::CouplingKind;
use hapt_core::{HARMONICS, Method, Output, Side, WhenLate};

use super::{Key, Measure, Presence, Range, Takes, key};
use crate::kinds::{Compensated, EstimatorKind, HandKind, Motion, ShapeKind, TimingKind};

/// The word that makes a damper follow the springs in parallel with it.
pub(crate) const COMPENSATING: &str = "compensating";

/// The unit of times in periods.
pub const SAMPLES: &str = "samples";

/// A body's name is an end of couplings and a column of tables, where these three are taken.
const BODIES: Takes =
    Takes::Named { most: 32, what: "body", letter_first: true, reserved: &["puck", "ground", "measured"] };
const SCENARIOS: Takes = Takes::Named { most: 1000, what: "scenario", letter_first: false, reserved: &[] };

/// The numbers of a texture's harmonics, and of its samples.
const WAVES: Takes = Takes::Numbers { least: 1, most: HARMONICS };
pub(crate) const MOST_SAMPLES: usize = 4096;
/// The couplings of a world, compensations included.
pub(crate) const MOST_COUPLINGS: usize = 64;
const WAVEFORM: Presence = Presence::Depends("required: sine and cosine, samples or file");

const LUGRE: Presence = Presence::Depends("required with the other LuGre keys");

const HARMONIC: Presence = Presence::Depends("required: sine, cosine or both");

/// The names of the reactions to a lost link, and to the world's own ledger.
pub(crate) const LINK_LOST: [&str; 2] = ["fade-out", "fault"];
pub(crate) const WORLD_LEDGER: [&str; 2] = ["warn", "trip"];
/// The handle's table, and the name of its columns.
pub(crate) const HANDLE: &str = "handle";
/// The direction in which a drive turns.
pub(crate) const DIRECTION: [&str; 2] = ["forward", "reverse"];

use Measure::{
    Acceleration, Angle, Damping, Energy, Frequency, Inertia, Position, Ratio, Stiffness, Time, Torque, Velocity,
};
use Presence::{Depends, Name, Number, Optional, Required};
use Range::{Any, Positive, Share, ZeroOrMore};
use Takes::{Ends, List, Quantity, QuantityOr, Table, Text, Whole};

/// Every key of the world file.
#[rustfmt::skip]
pub const KEYS: &[Key] = &[
    key("title", Text, Optional, "What the world is called in reports."),
    key("motion", Takes::Name(Motion::NAMES), Name("rotary"),
        "Whether the puck turns (angles, torques, inertias) or slides (lengths, forces, masses)."),

    key("loop", Table, Required, "The sampled program that runs the world."),
    key("loop.period", Quantity(Time, Positive), Required, "The sampling period T.").within(1e-5, 0.1),
    key("loop.method", Takes::Name(Method::NAMES), Name("zoh"), "The integration method of the bodies."),
    key("loop.output", Takes::Name(Output::NAMES), Depends("\"start\" with tustin and foh, which take no other; \"end\" with the others"),
        "Which state of the step makes the torque."),
    key("loop.advance", Whole { least: 0, most: 1000, step: 1 }, Number(0.0),
        "With output \"end\": further samples ahead for the torque, the puck held still."),
    key("loop.bodies_every", Whole { least: 1, most: 1000, step: 1 }, Number(1.0),
        "The bodies step at every n-th sample, by n periods; the torque has the puck's newest position at every sample."),
    key("loop.delay", Takes::TimeOrSamples, Number(0.0),
        "From the sample to the moment the motor torque changes, in a unit of time or in samples (\"1.5 samples\" follows the period); at most a million periods.").within(0.0, 0.1),
    key("loop.delay_max", Takes::TimeOrSamples, Depends("loop.delay"),
        "The largest delay, where it varies; no shorter than the delay, the least.").within(0.0, 0.1),
    key("loop.interval_max", Quantity(Time, Positive), Depends("loop.period"),
        "The longest true time between two samples, in any pattern; no shorter than the period, the nominal one.").within(1e-5, 1.0),
    key("loop.filter", Quantity(Frequency, Positive), Optional,
        "The cutoff of one pole behind which the world sees the puck's position; the velocity is that of the measured one. Absent: none.").within(0.5, 1e5),
    key("loop.recentre", Quantity(Time, Positive), Optional,
        "While the puck rests for so long under a torque within the device's friction, the world's origin slips, with this time constant, to where its torque is 0; two periods at least. Absent: it stays.").within(1e-2, 60.0),
    key("loop.estimator", Takes::Name(EstimatorKind::NAMES), Name("exact"), "How the loop estimates the puck's velocity."),
    key("loop.cutoff", Quantity(Frequency, Positive), Depends("required with the estimators low-pass and kalman"),
        "The cutoff of the estimators low-pass and kalman.").within(0.5, 1e5),
    key("loop.acceleration", Quantity(Acceleration, Positive), Depends("required with the estimator levant"),
        "The largest acceleration that the estimator levant follows exactly.").within(1e-2, 1e7),
    key("loop.every", Whole { least: 1, most: 256, step: 1 }, Number(1.0),
        "The samples over which the estimator difference takes the velocity."),
    key("loop.window", Whole { least: 1, most: 256, step: 1 }, Number(16.0), "The largest window of the FOAW estimators, in samples."),

    key("device", Table, Required, "Everything physical: the puck, its encoder and its motor."),
    key("device.inertia", Quantity(Inertia, Positive), Required, "The puck's inertia (linear: mass).").tolerated().within(1e-9, 10.0),
    key("device.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "The puck's viscous damping.").tolerated(),
    key("device.friction", Quantity(Torque, ZeroOrMore), Number(0.0),
        "The puck's Coulomb friction; it sticks while at rest and |net torque| is no larger.").tolerated(),
    key("device.friction_backward", Quantity(Torque, ZeroOrMore), Depends("device.friction"),
        "The Coulomb friction toward smaller positions, where it is another one: device.friction is then that toward larger ones.").tolerated(),
    key("device.lag", Quantity(Time, ZeroOrMore), Number(0.0),
        "The time constant of the first-order lag of the motor torque behind its command.").tolerated().within(0.0, 0.1),
    key("device.limit", Quantity(Torque, Positive), Optional, "The largest torque that is commanded; absent: any."),
    key("device.encoder", Whole { least: 1, most: 1 << 53, step: 1 }, Optional, "Counts per revolution; absent: ideal.").only(Motion::Rotary),
    key("device.encoder", Quantity(Position, Positive), Optional, "The size of one count; absent: ideal.").only(Motion::Linear).within(1e-9, 1e-3),
    key("device.levels", Whole { least: 2, most: u32::MAX as u64, step: 2 }, Optional,
        "Torque resolution: steps of 2 limit/levels. Needs a limit; absent: ideal."),
    key("device.motor", Table, Optional,
        "A motor behind a gear or a cable, with the numbers of its own side: they are added to those of the device, which are at the puck.").only(Motion::Rotary),
    key("device.motor.ratio", Quantity(Ratio, Positive), Required, "Revolutions of the motor for one of the puck.").only(Motion::Rotary),
    key("device.motor.inertia", Quantity(Inertia, ZeroOrMore), Number(0.0), "The rotor's inertia; at the puck it counts ratio² times.").only(Motion::Rotary),
    key("device.motor.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "The motor's viscous damping; at the puck it counts ratio² times.").only(Motion::Rotary),
    key("device.motor.friction", Quantity(Torque, ZeroOrMore), Number(0.0), "The motor's Coulomb friction; at the puck it counts ratio times.").only(Motion::Rotary),
    key("device.motor.limit", Quantity(Torque, Positive), Optional, "The largest torque of the motor's shaft, in place of device.limit, which is ratio times as much.").only(Motion::Rotary),
    key("device.motor.torque_constant", Quantity(Ratio, Positive), Depends("required with device.motor.current"), "The motor's torque for its current, in N m/A.").only(Motion::Rotary),
    key("device.motor.current", Quantity(Ratio, Positive), Optional, "The largest current, in A: with torque_constant in place of device.motor.limit.").only(Motion::Rotary),
    key("device.motor.encoder", Whole { least: 1, most: 1 << 53, step: 1 }, Optional,
        "Counts in a revolution of the motor, in place of device.encoder; at the puck ratio times as many, to a whole number.").only(Motion::Rotary),
    key("device.drive", Table, Optional, "The transmission to a motor drive (--device moteus:..., odrive:... and simplefoc:...)."),
    key("device.drive.gear", Quantity(Ratio, Positive), Depends("device.motor.ratio, or 1"), "Revolutions of the drive for one of the puck.").only(Motion::Rotary),
    key("device.drive.gear", Quantity(Position, Positive), Depends("required with a drive"), "The way of the puck in one revolution of the drive.").only(Motion::Linear),
    key("device.drive.direction", Takes::Name(&DIRECTION), Name(DIRECTION[0]),
        "Whether the drive's positions rise with the puck's (\"forward\") or fall (\"reverse\"); torques likewise."),
    key("device.drive.home", Quantity(Position, Any), Optional,
        "The puck's position, by the drive's own zero, that is the world's 0; a rotary puck is within half a turn of it at the start. \
         Absent: 0 is where the loop is armed."),
    key("device.handle", Table, Optional, "A handle that a flexible shaft connects to the puck: motor and encoder are at the puck, the hand is at the handle."),
    key("device.handle.inertia", Quantity(Inertia, Positive), Required, "The inertia (linear: mass) of the handle beyond the shaft."),
    key("device.handle.stiffness", Quantity(Stiffness, Positive), Required, "The shaft's stiffness: torque per angle between handle and puck."),
    key("device.handle.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "The shaft's damping: torque per relative velocity of handle and puck."),

    key("device.friction_by_position", Table, Optional,
        "Coulomb friction that changes with the position: device.friction and device.friction_backward are its mean levels, and at a position both \
         are 1 + share · waveform times that."),
    key("device.friction_by_position.share", Quantity(Ratio, ZeroOrMore), Required,
        "The part of its mean by which friction changes where the waveform is 1. No level may be below 0: times the sizes of the harmonics it is 1 at most."),
    key("device.friction_by_position.pitch", Quantity(Position, Positive), Required, "One period of the waveform: \"1 rev\" for the harmonics of a turn."),
    key("device.friction_by_position.phase", Quantity(Position, Any), Number(0.0), "Where a period of the waveform begins."),
    key("device.friction_by_position.sine", WAVES, HARMONIC, "The waveform's harmonics: of sin θ, sin 2θ and so on, θ = 2π (z - phase)/pitch."),
    key("device.friction_by_position.cosine", WAVES, HARMONIC, "The waveform's harmonics: of cos θ, cos 2θ and so on."),

    key("device.stribeck", Table, Optional, "Friction that falls as the puck speeds up: above Coulomb friction, in either direction, it is torque · max(0, 1 - |v|/velocity)."),
    key("device.stribeck.torque", Quantity(Torque, ZeroOrMore), Required, "By how much friction at rest is above device.friction."),
    key("device.stribeck.velocity", Quantity(Velocity, Positive), Required, "The speed from which on friction is device.friction."),

    key("device.stops", Table, Optional, "Mechanical ends of the puck's way, by the world's 0: springs and dampers that push it back and never pull."),
    key("device.stops.low", Quantity(Position, Any), Depends("required: low, high or both"), "Where the stop toward smaller positions begins, 0 or less."),
    key("device.stops.high", Quantity(Position, Any), Depends("required: low, high or both"), "Where the stop toward larger positions begins, 0 or more."),
    key("device.stops.stiffness", Quantity(Stiffness, Positive), Required, "Torque per way into a stop."),
    key("device.stops.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "Torque per velocity in a stop, as long as the sum pushes."),

    key("device.gravity", Table, Optional, "The torque of an unbalanced puck: torque · sin(z + phase) on it. Over a turn it gives no energy.").only(Motion::Rotary),
    key("device.gravity.torque", Quantity(Torque, ZeroOrMore), Required, "Weight times the distance of the centre of mass from the axis.").only(Motion::Rotary),
    key("device.gravity.phase", Quantity(Angle, Any), Number(0.0),
        "The angle at z = 0: 0 stands on its head, 90 deg is level, 180 deg hangs.").only(Motion::Rotary),
    key("device.cogging", Table, Optional, "The torque of a motor without current against its position, as the waveform of a texture. Over a pitch it gives no energy."),
    key("device.cogging.torque", Quantity(Torque, ZeroOrMore), Required, "The torque on the puck where the waveform is 1."),
    key("device.cogging.pitch", Quantity(Position, Positive), Required, "One period of the waveform: \"1 rev\" for the harmonics of a turn."),
    key("device.cogging.phase", Quantity(Position, Any), Number(0.0), "Where a period of the waveform begins."),
    key("device.cogging.sine", WAVES, HARMONIC, "The waveform's harmonics: of sin θ, sin 2θ and so on, θ = 2π (z - phase)/pitch."),
    key("device.cogging.cosine", WAVES, HARMONIC, "The waveform's harmonics: of cos θ, cos 2θ and so on."),

    key("bodies", BODIES, Optional, "The virtual inertias, by name."),
    key("bodies.*.inertia", Quantity(Inertia, Positive), Required, "Its inertia (linear: mass)."),
    key("bodies.*.position", Quantity(Position, Any), Number(0.0), "Its initial position."),
    key("bodies.*.velocity", Quantity(Velocity, Any), Number(0.0), "Its initial velocity."),

    key("couplings", List { most: MOST_COUPLINGS, what: "coupling" }, Optional, "The massless elements between puck, bodies and ground."),
    key("couplings.*.kind", Takes::Name(CouplingKind::NAMES), Required, "Its law."),
    key("couplings.*.between", Ends(["puck", "wheel"]), Required,
        "Its ends: \"puck\", \"ground\" or bodies. It acts on q, the first as seen from the second; its torque acts on the first."),
    key("couplings.*.stiffness", Quantity(Stiffness, ZeroOrMore), Required, "Torque per q; of a wall, inside; of a dead band, outside.").of(&["spring", "wall", "dead-band"]),
    key("couplings.*.stiffness", Quantity(Stiffness, ZeroOrMore), Required, "Torque per q that has stood for `time`.").of(&["integral"]),
    key("couplings.*.time", Quantity(Time, Positive), Number(1.0), "The time in which a q that stands gives the torque of a spring of that stiffness: of a PID controller its integral time.").of(&["integral"]),
    key("couplings.*.rest", Quantity(Position, Any), Number(0.0), "The q at which the spring is slack; of a dead band, its middle; at which the integral stands still.").of(&["spring", "dead-band", "integral"]),
    key("couplings.*.damping", QuantityOr(Damping, ZeroOrMore, COMPENSATING), Required,
        "Torque per rate of q; \"compensating\": T times the stiffness of the springs between the same two ends \
         (from a body to ground: of all springs at the body).").of(&["damper"]),
    key("couplings.*.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "Torque per rate of q inside; the wall never pulls.").of(&["wall"]),
    key("couplings.*.side", Takes::Name(&[Side::Above.name(), Side::Below.name()]), Required,
        "Whether the wall pushes while q is above its face or below.").of(&["wall"]),
    key("couplings.*.at", Quantity(Position, Any), Required, "The wall's face.").of(&["wall"]),
    key("couplings.*.at", Quantity(Position, Any), Number(0.0), "Where the magnet pulls to.").of(&["magnet"]),
    key("couplings.*.limit", Quantity(Torque, Positive), Optional, "The largest torque, on both ends; absent: any. An integral stops there.").of(&["spring", "damper", "wall", "dead-band", "integral", "acceleration"]),
    key("couplings.*.width", Quantity(Position, ZeroOrMore), Required, "Half of the dead band: how far from `rest` the spring begins.").of(&["dead-band"]),
    key("couplings.*.width", Quantity(Position, Positive), Required, "How far from `at` the magnet pulls most.").of(&["magnet"]),
    key("couplings.*.torque", Quantity(Torque, ZeroOrMore), Required, "The largest pull of the magnet.").of(&["magnet"]),
    key("couplings.*.torque", Quantity(Torque, ZeroOrMore), Required, "The largest torque of the detent.").of(&["detent"]),
    key("couplings.*.pitch", Quantity(Position, Positive), Required, "From one rest of the detent to the next.").of(&["detent"]),
    key("couplings.*.phase", Quantity(Position, Any), Number(0.0), "Where one of the detent's rests is.").of(&["detent"]),
    key("couplings.*.torque", Quantity(Torque, ZeroOrMore), Required, "The texture's torque on the first end where its waveform is 1.").of(&["texture"]),
    key("couplings.*.pitch", Quantity(Position, Positive), Required, "One period of the texture.").of(&["texture"]),
    key("couplings.*.phase", Quantity(Position, Any), Number(0.0), "Where a period of the texture begins.").of(&["texture"]),
    key("couplings.*.sine", WAVES, WAVEFORM, "The waveform's harmonics: of sin θ, sin 2θ and so on, θ = 2π (q - phase)/pitch.").of(&["texture"]),
    key("couplings.*.cosine", WAVES, WAVEFORM, "The waveform's harmonics: of cos θ, cos 2θ and so on.").of(&["texture"]),
    key("couplings.*.samples", Takes::Numbers { least: 2, most: MOST_SAMPLES }, WAVEFORM,
        "The waveform at equal distances over one period, the first at phase; without a mean, and as smooth as 4 harmonics.").of(&["texture"]),
    key("couplings.*.file", Text, WAVEFORM, "The same samples as a CSV file beside the world file: one column, its header waveform.").of(&["texture"]),
    key("couplings.*.torque", Quantity(Torque, ZeroOrMore), Depends("Coulomb friction; else the six LuGre keys"),
        "The torque of Coulomb friction, against the rate of q.").of(&["friction"]),
    key("couplings.*.coulomb", Quantity(Torque, ZeroOrMore), LUGRE, "LuGre: the level when sliding fast.").of(&["friction"]),
    key("couplings.*.stribeck", Quantity(Torque, ZeroOrMore), LUGRE, "LuGre: the static level.").of(&["friction"]),
    key("couplings.*.stribeck_velocity", Quantity(Velocity, Positive), LUGRE,
        "LuGre: the Stribeck velocity.").of(&["friction"]),
    key("couplings.*.bristle_stiffness", Quantity(Stiffness, ZeroOrMore), LUGRE, "LuGre: sigma_0.").of(&["friction"]),
    key("couplings.*.bristle_damping", Quantity(Damping, ZeroOrMore), LUGRE, "LuGre: sigma_1.").of(&["friction"]),
    key("couplings.*.viscous", Quantity(Damping, ZeroOrMore), LUGRE, "LuGre: sigma_2.").of(&["friction"]),
    key("couplings.*.torque", Quantity(Torque, ZeroOrMore), Required, "The assist's largest torque, along the rate of q.").of(&["assist"]),
    key("couplings.*.velocity", Quantity(Velocity, Positive), Required, "The rate of q from which on the assist has its largest torque; below it is proportional.").of(&["assist"]),
    key("couplings.*.inertia", Quantity(Inertia, ZeroOrMore), Required, "Torque along the acceleration of q, per acceleration.").of(&["acceleration"]),
    key("couplings.*.cutoff", Quantity(Frequency, Positive), Required, "Of the low-pass of the rate of q, whose change over a period is the acceleration.").of(&["acceleration"]),
    key("couplings.*.torque", Quantity(Torque, Any), Required, "The torque on the first end.").of(&["constant"]),

    key("compensation", List { most: Compensated::ALL.len(), what: "compensation" }, Optional,
        "Torques of the device that the loop takes back by the measured position, friction by the velocity, inertia by the acceleration: each a coupling between puck and ground behind the others."),
    key("compensation.*.of", Takes::Name(Compensated::NAMES), Required, "Which torque of the device: that of device.gravity, device.cogging or device.friction, or of its inertia."),
    key("compensation.*.share", Quantity(Ratio, Share), Number(1.0), "The part of it that is taken back."),
    key("compensation.*.cutoff", Quantity(Frequency, Positive), Depends("required of inertia; of nothing else"),
        "Of the low-pass behind which the acceleration is measured."),
    key("compensation.*.velocity", Quantity(Velocity, Positive), Depends("required of friction; of nothing else"),
        "The measured speed from which on the whole share of the friction is taken back; below it is proportional."),

    key("safety", Table, Optional, "What the supervisor holds a live loop to."),
    key("safety.fade", Quantity(Time, Positive), Number(0.1), "How long the torque rises when armed, and falls when disarmed.").within(1e-3, 10.0),
    key("safety.velocity", Quantity(Velocity, Positive), Depends("the overspeed where the file states it, else twice the overspeed; any on the simulated device"),
        "The largest speed that the device can have; a reading beyond it faults."),
    key("safety.jump", Quantity(Position, Positive), Depends("25 rad/s (linear: 1.25 m/s) and limit times period over inertia, times the period; any on the simulated device"),
        "The largest change of the displacement from one sample to the next; two counts are added."),
    key("safety.overspeed", Quantity(Velocity, Positive),
        Depends("50 rad/s (linear: 2.5 m/s), or where the limit throws the puck over half a turn (0.1 m), the larger; any on the simulated device"),
        "The largest speed with the motor on."),
    key("safety.stuck", Quantity(Time, ZeroOrMore), Depends("1 s; never on the simulated device"),
        "How long, added up, the position may stand still under a torque of more than twice the friction and a twentieth of the limit; 0: for ever."),
    key("safety.torque", Quantity(Torque, Positive), Depends("device.limit"), "The largest command; more faults."),
    key("safety.slew", Quantity(Torque, Positive), Depends("what this world can do at these speeds; any on the simulated device"),
        "The largest change of the torque from one sample to the next."),
    key("safety.rms", Quantity(Torque, Positive), Depends("any"), "The torque that the motor may hold for ever."),
    key("safety.heating", Quantity(Time, Positive), Number(30.0), "The motor's thermal time constant."),
    key("safety.driver_rms", Quantity(Torque, Positive), Depends("any"), "The torque that the driver may hold for ever."),
    key("safety.driver_heating", Quantity(Time, Positive), Number(1.0), "The driver's thermal time constant."),
    key("safety.late", Takes::Name(WhenLate::NAMES), Depends("\"fade\"; \"fault\" on a board"),
        "What a sample after more than loop.interval_max, or a command after more than loop.delay_max, does where the file states them: it faults, fades the torque out, or counts."),
    key("safety.stall", Quantity(Time, ZeroOrMore), Depends("5 periods, or what interval_max allows where that is longer; any on the simulated device"),
        "How late a sample may come, missed samples counted in, before it faults whatever late is; 0: any.").within(0.0, 10.0),
    key("safety.link", Quantity(Time, ZeroOrMore), Depends("0.3 s, or twice fade, period and delay together where that is longer; never on the simulated device"),
        "From the last heartbeat of the client in control to torque 0, the fade included; 0: never.").within(0.0, 100.0),
    key("safety.link_lost", Takes::Name(&LINK_LOST), Name(LINK_LOST[0]), "What a lost link does."),
    key("safety.energy", Quantity(Energy, Positive),
        Depends("device.limit over 0.05 rad (linear: 2.5 mm), 0.05 J without a limit; a tenth of it for a world that is not certified"),
        "The most that the hand may be given beyond what is stored, and that the integrator may make."),
    key("safety.world_ledger", Takes::Name(&WORLD_LEDGER), Depends("\"trip\"; \"warn\" on the simulated device, and with an explicit method in a certified world"),
        "What it does when the integrator has made that energy; on the simulated device also when the hand has been given it."),
    key("safety.pulse", Quantity(Torque, ZeroOrMore),
        Depends("twice the friction and a twentieth of the limit, or more, up to half of the limit, where that moves the puck by less than 12 counts in 0.25 s, and never more than the limit; none on the simulated device"),
        "The torque of the sign test's pulse when armed; 0: no test."),
    key("safety.brake", Quantity(Damping, ZeroOrMore), Number(0.0),
        "Damping for a fade's time after faults that leave the encoder trusted; 0: the torque is just off."),

    key("scenarios", SCENARIOS, Optional, "What is simulated, by name."),
    key("scenarios.*.duration", Quantity(Time, Positive), Required, "How long; at most 10^10 samples.").within(1e-3, 1e5),
    key("scenarios.*.timing", Table, Optional, "When samples are truly taken, and how late commands arrive; absent: every period."),
    key("scenarios.*.timing.kind", Takes::Name(TimingKind::NAMES), Required,
        "A \"pattern\" repeats; \"worst\" is the pattern that hapt check finds worst hands-off."),
    key("scenarios.*.timing.seed", Whole { least: 0, most: u32::MAX as u64, step: 1 }, Number(0.0), "The same seed draws the same intervals and delays.").of(&["random"]),
    key("scenarios.*.timing.shortest", Quantity(Time, Positive), Depends("as far below the period as interval_max is above, a hundredth of the period at least"),
        "The shortest interval drawn. Delays are uniform from delay to delay_max, intervals from the longer of this and the delay before to interval_max.").of(&["random"]),
    key("scenarios.*.timing.intervals", Takes::Numbers { least: 1, most: MOST_SAMPLES }, Required, "The intervals, in periods, repeated.").of(&["pattern"]),
    key("scenarios.*.timing.delays", Takes::Numbers { least: 1, most: MOST_SAMPLES }, Depends("loop.delay"), "The delay before each interval, in periods; one for all, or as many as intervals.").of(&["pattern"]),
    key("scenarios.*.timing.file", Text, Required, "A CSV file beside the world file, its header time_s or time_s,delay_s, a line for each sample.").of(&["recorded"]),
    key("scenarios.*.hand", Table, Required, "The human: what drives the puck."),
    key("scenarios.*.hand.kind", Takes::Name(HandKind::NAMES), Required,
        "A shape (step, ramp, sine, path) prescribes the puck's position; torque pushes it, grip holds it through a spring and a damper."),
    key("scenarios.*.hand.release", Quantity(Time, ZeroOrMore), Optional, "From this instant on the hand is gone; absent: it stays."),
    key("scenarios.*.hand.to", Quantity(Position, Any), Required, "The position.").of(&["step", "ramp"]),
    key("scenarios.*.hand.at", Quantity(Time, ZeroOrMore), Number(0.0), "When the step comes or the ramp starts.").of(&["step", "ramp"]),
    key("scenarios.*.hand.over", Quantity(Time, Positive), Required, "How long the ramp takes.").of(&["ramp"]),
    key("scenarios.*.hand.amplitude", Quantity(Position, Any), Required, "The sine's amplitude.").of(&["sine"]),
    key("scenarios.*.hand.frequency", Quantity(Frequency, Positive), Required, "The sine's frequency.").of(&["sine"]),
    key("scenarios.*.hand.phase", Quantity(Angle, Any), Number(0.0), "The sine's phase at t = 0.").of(&["sine"]),
    key("scenarios.*.hand.file", Text, Required,
        "A CSV file beside the world file, its header time_s,puck_UNIT.").of(&["path"]),
    key("scenarios.*.hand.inertia", Quantity(Inertia, Positive), Depends("none"), "The hand's inertia, which moves with the puck.").of(&["grip"]),
    key("scenarios.*.hand.damping", Quantity(Damping, ZeroOrMore), Number(0.0), "Between the puck and the intended motion.").of(&["grip"]),
    key("scenarios.*.hand.stiffness", Quantity(Stiffness, ZeroOrMore), Number(0.0), "Between the puck and the intended motion.").of(&["grip"]),
    key("scenarios.*.hand.hold", Quantity(Time, Positive), Depends("none; only with both hold and open"),
        "The hand holds for so long, opens, takes hold again where the puck is then, and so on.").of(&["grip"]),
    key("scenarios.*.hand.open", Quantity(Time, Positive), Depends("none; only with both hold and open"),
        "How long it is open: without spring and damper, with its inertia.").of(&["grip"]),
    key("scenarios.*.hand.moves", Table, Required, "The torque as a shape.").of(&["torque"]),
    key("scenarios.*.hand.moves", Table, Required, "The intended motion as a shape.").of(&["grip"]),
    key("scenarios.*.hand.moves.kind", Takes::Name(ShapeKind::NAMES), Required, "The shape."),
    key("scenarios.*.hand.moves.to", Quantity(Torque, Any), Required, "Where the torque goes.").of(&["step", "ramp"]).under(&["torque"]),
    key("scenarios.*.hand.moves.to", Quantity(Position, Any), Required, "Where the intended motion goes.").of(&["step", "ramp"]).under(&["grip"]),
    key("scenarios.*.hand.moves.at", Quantity(Time, ZeroOrMore), Number(0.0), "When the step comes or the ramp starts.").of(&["step", "ramp"]),
    key("scenarios.*.hand.moves.over", Quantity(Time, Positive), Required, "How long the ramp takes.").of(&["ramp"]),
    key("scenarios.*.hand.moves.amplitude", Quantity(Torque, Any), Required, "The sine's amplitude.").of(&["sine"]).under(&["torque"]),
    key("scenarios.*.hand.moves.amplitude", Quantity(Position, Any), Required, "The sine's amplitude.").of(&["sine"]).under(&["grip"]),
    key("scenarios.*.hand.moves.frequency", Quantity(Frequency, Positive), Required, "The sine's frequency.").of(&["sine"]),
    key("scenarios.*.hand.moves.phase", Quantity(Angle, Any), Number(0.0), "The sine's phase at t = 0.").of(&["sine"]),
    key("scenarios.*.hand.moves.file", Text, Required,
        "A CSV file beside the world file, its header time_s,torque_UNIT (linear: time_s,force_UNIT).").of(&["path"]).under(&["torque"]),
    key("scenarios.*.hand.moves.file", Text, Required,
        "A CSV file beside the world file, its header time_s,puck_UNIT.").of(&["path"]).under(&["grip"]),
];

/// The table at the top of a network file, in the paths of [`NETWORK`].
pub const NETWORK_FILE: &str = "network";
/// A station's name is a part of file names.
const STATIONS: Takes = Takes::Named { most: 32, what: "station", letter_first: true, reserved: &[] };

/// Every key of a network file, which joins the pucks of several worlds; `network` stands for the top of the file.
#[rustfmt::skip]
pub const NETWORK: &[Key] = &[
    key("network.title", Text, Optional, "What the network is called in reports."),
    key("network.stations", STATIONS, Required, "The devices, by name, each with its own world and clock."),
    key("network.stations.*.world", Text, Required, "Its world file, in the folder of this file or below it."),
    key("network.stations.*.phase", Quantity(Time, ZeroOrMore), Number(0.0), "When its first sample is taken, by the clock of the network; at most 1000 s."),
    key("network.stations.*.drift", Quantity(Ratio, Any), Number(0.0), "By how many millionths its clock is fast (below 0: slow) against that of the network, at most 10 000."),
    key("network.links", List { most: 64, what: "link" }, Required, "The couplings between the pucks of two stations. Each computes its own end, from its own sample and the newest position received."),
    key("network.links.*.kind", Takes::Name(&["spring", "wall"]), Required, "Its law, of q: the first station's puck as seen from the second's."),
    key("network.links.*.between", Ends(["left", "right"]), Required, "The two stations."),
    key("network.links.*.stiffness", Quantity(Stiffness, ZeroOrMore), Required, "Torque per displacement (for a wall: per displacement inside of it)."),
    key("network.links.*.rest", Quantity(Position, Any), Number(0.0), "q at which the spring is slack.").of(&["spring"]),
    key("network.links.*.damping", Quantity(Damping, ZeroOrMore), Number(0.0),
        "Torque per difference of the velocities (of a wall inside; it never pulls). The other's is its mean between two messages."),
    key("network.links.*.limit", Quantity(Torque, Positive), Optional, "The largest torque, on both pucks; absent: any."),
    key("network.links.*.side", Takes::Name(&[Side::Above.name(), Side::Below.name()]), Required, "Which side of `at` is inside of the wall.").of(&["wall"]),
    key("network.links.*.at", Quantity(Position, Any), Required, "Where the wall begins.").of(&["wall"]),
    key("network.links.*.period", Quantity(Time, Positive), Depends("the sender's loop.period"), "The time between two messages, each way; no shorter than the sender's period, at most 1000 s."),
    key("network.links.*.delay", Quantity(Time, ZeroOrMore), Number(0.0), "The least delay of a message; at most 1000 s, and a million messages under way each way."),
    key("network.links.*.delay_max", Quantity(Time, ZeroOrMore), Depends("delay"), "The largest, with the same bounds. Simulations draw each message's delay between the two; messages may overtake each other."),
    key("network.links.*.loss", Quantity(Ratio, ZeroOrMore), Number(0.0), "The part of the messages that a simulation loses, from 0 to 1."),
    key("network.links.*.duplicate", Quantity(Ratio, ZeroOrMore), Number(0.0), "The part of the messages that arrive a second time in a simulation, after another delay, from 0 to 1."),
    key("network.links.*.seed", Whole { least: 0, most: u32::MAX as u64, step: 1 }, Number(0.0), "The same seed draws the same losses, copies and times."),
    key("network.links.*.age_max", Quantity(Time, Positive), Required,
        "The greatest age of a position at any time that its torque acts, from the other's sample to the end of the hold here; at most 1000 s. A station without so young a position releases the link."),
];
