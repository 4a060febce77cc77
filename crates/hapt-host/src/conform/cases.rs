//! The cases of the conformance test: effects that are played on a wheel.

use super::effect::{Condition, Envelope, Form, HostEffect, LEFT, Law, RIGHT, Wave};
use super::meaning::{Action, Played};

/// How a case treats the wheel's own scale of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// The standard states all of it.
    Stated,
    /// The case finds it.
    Finds(Law),
    /// An earlier case has found it.
    Uses(Law),
}

/// Effects to be played, while the wheel swings about the middle.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: &'static str,
    /// The request, in a sentence.
    pub asks: String,
    /// The effects that play.
    pub effects: Vec<Played>,
    /// The device's gain.
    pub gain: f64,
    /// s
    pub seconds: f64,
    /// How the case treats the scale of its law.
    pub scale: Scale,
    /// Whether the swing is wide: conditions depend on motion.
    pub wide: bool,
}

impl Case {
    /// The swing without effects.
    pub fn rest() -> Self {
        plain("rest", "nothing".into(), Vec::new(), 1.0)
    }
}

/// The time at which effects start, in s.
const START: f64 = 0.3;

/// A time longer than any case, in s.
const LONG: f64 = 10.0;

/// An effect that starts once and has a length beyond the case; effects without a length have their own case.
fn once(requested: HostEffect) -> Played {
    let requested = HostEffect { length: requested.length.or(Some(LONG)), ..requested };
    Played { requested, actions: vec![(START, Action::Start(1))] }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn plain(name: &'static str, asks: String, effects: Vec<Played>, seconds: f64) -> Case {
    Case { name, asks, effects, gain: 1.0, seconds, scale: Scale::Stated, wide: false }
}

fn condition(name: &'static str, asks: String, law: Law, numbers: Condition, scale: Scale) -> Case {
    let effects = vec![once(HostEffect::condition(law, numbers))];
    Case { name, asks, effects, gain: 1.0, seconds: 3.2, scale, wide: true }
}

/// All cases, in their order, with torques of at most `level`.
pub fn cases(level: f64) -> Vec<Case> {
    let all = torques(level).into_iter().chain(waves(level)).chain(springs()).chain(others());
    all.collect()
}

fn torques(level: f64) -> Vec<Case> {
    let left = |level: f64| HostEffect::constant(level, LEFT);
    let full = percent(level);
    let timed = |requested: HostEffect, count: u32| Played { requested, actions: vec![(START, Action::Start(count))] };
    let mut stopped = once(left(level));
    stopped.actions.push((1.3, Action::Stop));
    let mut changed = once(left(level));
    changed.actions.push((1.2, Action::Change(HostEffect { length: Some(LONG), ..left(-0.5 * level) })));
    let enveloped = HostEffect {
        form: Form::Constant {
            level,
            envelope: Envelope { attack: 0.6, attack_level: 0.0, fade: 0.6, fade_level: 0.0 },
        },
        length: Some(1.6),
        ..left(level)
    };
    vec![
        plain("constant", format!("{full} to the left for 1 s, then stopped"), vec![stopped], 2.2),
        plain(
            "constant to the right",
            format!("{full} to the right"),
            vec![once(HostEffect::constant(level, RIGHT))],
            1.6,
        ),
        plain(
            "without length",
            format!("{full} to the left until it is stopped"),
            vec![Played { requested: left(level), actions: vec![(START, Action::Start(1)), (1.3, Action::Stop)] }],
            2.2,
        ),
        plain("direction", format!("{full} from 45° of the left"), vec![once(HostEffect::constant(level, 0.125))], 1.6),
        Case {
            gain: 0.5,
            ..plain("gain", format!("{full} at half of the device's gain"), vec![once(left(level))], 1.8)
        },
        plain("envelope", format!("{full} with attack and fade of 0.6 s from 0"), vec![once(enveloped)], 2.4),
        plain("length", format!("{full} for 0.6 s"), vec![once(HostEffect { length: Some(0.6), ..left(level) })], 1.8),
        plain(
            "delay",
            format!("{full} for 0.7 s, after a delay of 0.6 s"),
            vec![once(HostEffect { length: Some(0.7), delay: 0.6, ..left(level) })],
            2.2,
        ),
        plain(
            "count",
            format!("{full} for 0.4 s, three times in a row"),
            vec![timed(HostEffect { length: Some(0.4), ..left(level) }, 3)],
            2.2,
        ),
        plain("change", format!("{full} to the left, then half of it to the right"), vec![changed], 2.2),
        plain(
            "sum",
            format!("{full} to the left and half of it to the right at once"),
            vec![once(left(level)), once(HostEffect::constant(0.5 * level, RIGHT))],
            1.8,
        ),
    ]
}

fn waves(level: f64) -> Vec<Case> {
    let periodic = |wave, phase, offset| {
        let form = Form::Periodic { wave, magnitude: level, offset, phase, period: 0.8 };
        once(HostEffect { form, ..HostEffect::constant(0.0, LEFT) })
    };
    let wave =
        |name, asks: &str, effect| plain(name, format!("{} over 0.8 s{asks}", percent(level)), vec![effect], 2.4);
    let ramp = HostEffect {
        form: Form::Ramp { from: -level, to: level },
        length: Some(1.5),
        ..HostEffect::constant(0.0, LEFT)
    };
    vec![
        wave("sine", "", periodic(Wave::Sine, 0.0, 0.0)),
        wave("phase", ", a sine from a quarter of a turn on", periodic(Wave::Sine, 0.25, 0.0)),
        wave("offset", ", a sine about half of that", periodic(Wave::Sine, 0.0, 0.5 * level)),
        wave("square", "", periodic(Wave::Square, 0.0, 0.0)),
        wave("triangle", "", periodic(Wave::Triangle, 0.0, 0.0)),
        wave("sawtooth up", "", periodic(Wave::SawUp, 0.0, 0.0)),
        wave("sawtooth down", "", periodic(Wave::SawDown, 0.0, 0.0)),
        plain("ramp", format!("{0} to the right to {0} to the left in 1.5 s", percent(level)), vec![once(ramp)], 2.2),
    ]
}

fn springs() -> Vec<Case> {
    let spring = |name, asks: &str, numbers| condition(name, asks.into(), Law::Spring, numbers, Scale::Stated);
    let full = Condition::even(1.0);
    let mut second = spring("second axis", "full coefficient, and a quarter on a second axis", full);
    let axes = [full, Condition::even(0.25)];
    second.effects = vec![once(HostEffect {
        form: Form::Condition { law: Law::Spring, axes },
        ..HostEffect::condition(Law::Spring, full)
    })];
    vec![
        spring("spring", "full coefficient", full),
        spring("half a spring", "half of the coefficient", Condition::even(0.5)),
        spring("dead band", "full coefficient beyond 8 % of the way", Condition { dead_band: 0.08, ..full }),
        spring("centre", "full coefficient about 8 % to the right", Condition { center: 0.08, ..full }),
        spring("saturation", "full coefficient up to 4 %", Condition { right_most: 0.04, left_most: 0.04, ..full }),
        spring("one side", "full coefficient to the right alone", Condition { left: 0.0, ..full }),
        second,
    ]
}

fn others() -> Vec<Case> {
    let pair = |law, name, half, share: f64| {
        let asks = |share: f64| format!("{} of the coefficient", percent(share));
        [
            condition(name, asks(share), law, Condition::even(share), Scale::Finds(law)),
            condition(half, asks(0.5 * share), law, Condition::even(0.5 * share), Scale::Uses(law)),
        ]
    };
    let all = [
        pair(Law::Damper, "damper", "half a damper", 0.5),
        pair(Law::Friction, "friction", "half a friction", 0.2),
        pair(Law::Inertia, "inertia", "half an inertia", 1.0),
    ];
    all.into_iter().flatten().collect()
}
