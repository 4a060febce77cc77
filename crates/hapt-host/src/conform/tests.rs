//! The judge against simulated wheels: hapt's own rendering, and the standard's meaning with each known error.

use hapt_core::wheel::{Device, Timing};
use hapt_wire::pid::{self, FULL, INFINITE, Kind, Operation, Pool, Report, Scale as Full};

use super::meaning::{Action, Played, WheelMotion, torque};
use super::*;

/// The rendering of a simulated wheel.
enum Renderer {
    /// The standard's meaning of the requests, or an error.
    Meaning { played: Vec<Option<Played>>, order: Vec<usize>, gain: f64, error: Option<KnownError>, scales: [f64; 3] },
    /// hapt's own effects, from the reports that a driver sends.
    Own { pool: Box<Pool>, wheel: hapt_core::wheel::Wheel<f32>, state: Box<hapt_core::wheel::WheelState<f32>> },
}

/// A mass with friction, whose position is counted.
struct Simulated {
    renderer: Renderer,
    time: f64,
    position: f64,
    velocity: f64,
    held: f64,
    /// The acceleration of the largest torque, and the torques of a velocity of 1/s and of dry friction.
    strength: f64,
    damping: f64,
    friction: f64,
    count: f64,
    latency: f64,
    /// Messages in flight, with their times of arrival.
    sent: Vec<(f64, Sent)>,
}

enum Sent {
    Put(usize, HostEffect),
    Start(usize, u32),
    Stop(usize),
    Clear,
    Gain(f64),
}

const STEP: f64 = 1e-3;
/// Half of the range of hapt's own wheel, rad, its inertia, damping and limit.
const HALF: f64 = 2.5 * std::f64::consts::PI;
const INERTIA: f64 = 0.02;
const LIMIT: f64 = 5.0;

impl Simulated {
    fn meaning(error: Option<KnownError>) -> Self {
        let renderer =
            Renderer::Meaning { played: vec![None; 8], order: Vec::new(), gain: 1.0, error, scales: [0.4, 1.0, 0.02] };
        Simulated {
            renderer,
            time: 100.0,
            position: 0.02,
            velocity: 0.0,
            held: 0.0,
            strength: 30.0,
            damping: 0.05,
            friction: 0.01,
            count: 1.0 / 32_767.0,
            latency: 0.012,
            sent: Vec::new(),
        }
    }

    fn own() -> Self {
        let wheel = hapt_core::wheel::Wheel::new(&Device::ideal(Timing::even(STEP), 0.05, LIMIT)).unwrap();
        let state = Box::new(wheel.start());
        Simulated {
            renderer: Renderer::Own { pool: Box::new(Pool::new()), wheel, state },
            strength: LIMIT / INERTIA / HALF,
            damping: 0.05 * HALF / LIMIT,
            ..Simulated::meaning(None)
        }
    }

    fn send(&mut self, sent: Sent) {
        self.sent.push((self.time + self.latency, sent));
    }

    /// One step, with what has arrived.
    fn step(&mut self) {
        while self.sent.first().is_some_and(|(when, _)| *when <= self.time) {
            let (_, sent) = self.sent.remove(0);
            self.renderer.take(sent, self.time);
        }
        let motion = WheelMotion { position: self.position, velocity: self.velocity, acceleration: 0.0 };
        // It is linear in the acceleration.
        let rest = self.renderer.torque(self.time, &motion);
        let unit = self.renderer.torque(self.time, &WheelMotion { acceleration: 1.0, ..motion }) - rest;
        let (rest, unit) = match &mut self.renderer {
            Renderer::Meaning { .. } => (rest, unit),
            Renderer::Own { pool, wheel, state } => {
                let now = (1e6 * self.time) as u64;
                let full = Full { torque: LIMIT as f32, angle: HALF as f32, velocity: 10.0, acceleration: 200.0 };
                let (effects, count) = pool.effects(now, &full);
                let given = wheel.step(state, (HALF * self.position) as f32, &effects[..count], pool.revision());
                (f64::from(given.torque) / LIMIT, 0.0)
            }
        };
        self.held = rest - self.damping * self.velocity;
        let dry = if self.velocity == 0.0 {
            self.held.clamp(-self.friction, self.friction)
        } else {
            self.friction * self.velocity.signum()
        };
        let acceleration = self.strength * (self.held - dry) / (1.0 - self.strength * unit);
        let next = self.velocity + acceleration * STEP;
        // Friction stops the wheel, and does not reverse it.
        self.velocity = if next * self.velocity < 0.0 { 0.0 } else { next };
        self.position += self.velocity * STEP;
        self.time += STEP;
    }
}

impl Renderer {
    fn torque(&self, time: f64, motion: &WheelMotion) -> f64 {
        let Renderer::Meaning { played, order, gain, error, scales } = self else { return 0.0 };
        let one = |at: &usize| {
            let effect = played[*at].clone()?;
            let scale = match effect.requested.form {
                Form::Condition { law: Law::Damper, .. } => scales[0],
                Form::Condition { law: Law::Friction, .. } => scales[1],
                Form::Condition { law: Law::Inertia, .. } => scales[2],
                Form::Condition { law: Law::Spring, .. } => 0.0,
                Form::Constant { .. } | Form::Ramp { .. } | Form::Periodic { .. } => 0.0,
            };
            effect.plays(time, *error).then(|| {
                let torque = torque(&[effect], *gain, time, motion, *error);
                torque.stated + scale * torque.scaled
            })
        };
        let all: Vec<f64> = order.iter().filter_map(one).collect();
        let sum = if *error == Some(KnownError::Last) { all.last().copied().unwrap_or(0.0) } else { all.iter().sum() };
        sum.clamp(-1.0, 1.0)
    }

    fn take(&mut self, sent: Sent, now: f64) {
        match self {
            Renderer::Meaning { played, order, gain, error, .. } => match sent {
                Sent::Put(at, requested) => match &mut played[at] {
                    // The torque of the swing changes continually.
                    Some(effect) if at == 0 && *error != Some(KnownError::Update) => effect.requested = requested,
                    Some(effect) => effect.actions.push((now, Action::Change(requested))),
                    none => *none = Some(Played { requested, actions: Vec::new() }),
                },
                Sent::Start(at, count) => {
                    played[at].as_mut().unwrap().actions.push((now, Action::Start(count)));
                    order.push(at);
                }
                Sent::Stop(at) => played[at].as_mut().unwrap().actions.push((now, Action::Stop)),
                Sent::Clear => {
                    played.iter_mut().for_each(|effect| *effect = None);
                    order.clear();
                }
                Sent::Gain(share) => *gain = share,
            },
            Renderer::Own { pool, .. } => {
                for report in reports(sent) {
                    pool.take(&report, (1e6 * now) as u64);
                }
            }
        }
    }
}

fn level(share: f64) -> i16 {
    (share * f64::from(FULL)).round() as i16
}

fn ms(seconds: f64) -> u16 {
    (1e3 * seconds).round() as u16
}

/// The reports of Linux's driver for a request.
fn reports(sent: Sent) -> Vec<Report> {
    let HostEffect { form, direction, length, delay } = match sent {
        Sent::Put(_, requested) => requested,
        Sent::Start(block, count) => {
            return vec![Report::Operation { block, operation: Operation::Start, loops: count as u8 }];
        }
        Sent::Stop(block) => return vec![Report::Operation { block, operation: Operation::Stop, loops: 0 }],
        Sent::Clear => return (0..8).map(|block| Report::Free { block }).collect(),
        Sent::Gain(share) => return vec![Report::Gain(level(share))],
    };
    let Sent::Put(block, _) = sent else { return Vec::new() };
    let kind = match form {
        Form::Constant { .. } => Kind::Constant,
        Form::Ramp { .. } => Kind::Ramp,
        Form::Periodic { wave: Wave::Square, .. } => Kind::Square,
        Form::Periodic { wave: Wave::Sine, .. } => Kind::Sine,
        Form::Periodic { wave: Wave::Triangle, .. } => Kind::Triangle,
        Form::Periodic { wave: Wave::SawUp, .. } => Kind::SawtoothUp,
        Form::Periodic { wave: Wave::SawDown, .. } => Kind::SawtoothDown,
        Form::Condition { law: Law::Spring, .. } => Kind::Spring,
        Form::Condition { law: Law::Damper, .. } => Kind::Damper,
        Form::Condition { law: Law::Friction, .. } => Kind::Friction,
        Form::Condition { law: Law::Inertia, .. } => Kind::Inertia,
    };
    let duration = length.map_or(INFINITE, ms);
    let common = pid::Common {
        kind,
        duration,
        repeat: 0,
        delay: ms(delay),
        gain: FULL,
        button: 0,
        direction: Some((36_000.0 * direction) as u16),
    };
    let mut all = vec![Report::Effect { block, common }];
    match form {
        Form::Constant { level: share, envelope } => {
            let of = pid::Envelope {
                attack_level: level(envelope.attack_level),
                fade_level: level(envelope.fade_level),
                attack_time: ms(envelope.attack),
                fade_time: ms(envelope.fade),
            };
            all.push(Report::Envelope { block, envelope: of });
            all.push(Report::Constant { block, magnitude: level(share) });
        }
        Form::Ramp { from, to } => all.push(Report::Ramp { block, start: level(from), end: level(to) }),
        Form::Periodic { magnitude, offset, phase, period, .. } => {
            let (magnitude, offset) = (level(magnitude), level(offset));
            let phase = (36_000.0 * phase) as u16;
            all.push(Report::Periodic {
                block,
                periodic: pid::Periodic { magnitude, offset, phase, period: ms(period) },
            });
        }
        Form::Condition { axes, .. } => {
            for (axis, of) in axes.iter().enumerate() {
                let condition = pid::Condition {
                    offset: level(of.center),
                    positive: level(of.right),
                    negative: level(of.left),
                    positive_saturation: level(of.right_most),
                    negative_saturation: level(of.left_most),
                    dead_band: level(of.dead_band),
                };
                all.push(Report::Condition { block, axis: axis as u8, condition });
            }
        }
    }
    all
}

impl Wheel for Simulated {
    fn now(&mut self) -> f64 {
        self.time
    }

    fn put(&mut self, place: usize, requested: &HostEffect) -> Result<(), ConformError> {
        self.send(Sent::Put(place, *requested));
        Ok(())
    }

    fn start(&mut self, place: usize, count: u32) -> Result<(), ConformError> {
        self.send(Sent::Start(place, count));
        Ok(())
    }

    fn stop(&mut self, place: usize) -> Result<(), ConformError> {
        self.send(Sent::Stop(place));
        Ok(())
    }

    fn clear(&mut self) -> Result<(), ConformError> {
        self.send(Sent::Clear);
        Ok(())
    }

    fn gain(&mut self, share: f64) -> Result<(), ConformError> {
        self.send(Sent::Gain(share));
        Ok(())
    }

    fn watch(&mut self, until: f64, trace: &mut Vec<(f64, f64)>) -> Result<(), ConformError> {
        let counted = |position: f64, count: f64| (position / count).round() * count;
        if trace.is_empty() {
            trace.push((self.time, counted(self.position, self.count)));
        }
        while self.time < until {
            self.step();
            let seen = counted(self.position, self.count);
            // A driver reports only changes.
            if trace.last().is_none_or(|(_, last)| *last != seen) {
                trace.push((self.time, seen));
            }
        }
        Ok(())
    }
}

fn verdicts(wheel: &mut Simulated) -> Result<Conformance, ConformError> {
    conform(wheel, cases(0.2), 0.4, |_| ())
}

/// One of each set of cases that are equal under every error.
fn each_once() -> Vec<Case> {
    const ALIKE: [&str; 7] =
        ["constant to the right", "sine", "square", "triangle", "sawtooth down", "spring", "half a spring"];
    let unlike = |case: &Case| !ALIKE.contains(&case.name) && !matches!(case.scale, Scale::Uses(_));
    cases(0.2).into_iter().filter(unlike).collect()
}

fn summary(found: &Conformance) -> Vec<String> {
    found.findings.iter().map(|f| format!("{:22} {:6.2} % {:?}", f.name, 100.0 * f.off, f.verdict)).collect()
}

#[test]
fn a_wheel_that_renders_the_meaning_conforms() {
    let found = verdicts(&mut Simulated::meaning(None)).unwrap();
    assert!(found.conforms() && !found.inverted, "{:?}\n{}", found.plant, summary(&found).join("\n"));
}

#[test]
fn hapts_own_wheel_conforms() {
    let found = verdicts(&mut Simulated::own()).unwrap();
    assert!(found.conforms(), "{:?}\n{}", found.plant, summary(&found).join("\n"));
}

#[test]
fn every_known_error_is_found_and_named() {
    for error in KnownError::ALL {
        let found = conform(&mut Simulated::meaning(Some(*error)), each_once(), 0.4, |_| ());
        match found {
            Ok(found) => {
                let named = found.findings.iter().any(|finding| finding.verdict == Verdict::Known(*error));
                assert!(named, "{error:?}: {:?}\n{}", found.plant, summary(&found).join("\n"));
            }
            // Without these two nothing can be measured.
            Err(ConformError::Still(_)) if *error == KnownError::Nothing => {}
            Err(ConformError::NoUpdates) if *error == KnownError::Update => {}
            Err(other) => panic!("{error:?}: {other}"),
        }
    }
}

#[test]
fn a_wheel_far_from_the_middle_is_not_pushed() {
    let mut wheel = Simulated { position: 0.9, ..Simulated::meaning(None) };
    assert!(matches!(verdicts(&mut wheel), Err(ConformError::Aside(_))));
    assert_eq!(wheel.velocity, 0.0);
}

#[test]
fn weak_strong_and_late_wheels_are_measured_too() {
    // A weak wheel with large friction and a coarse axis; a strong one with little friction; one with a long latency.
    let weak =
        Simulated { strength: 6.0, friction: 0.06, damping: 0.3, count: 1.0 / 2048.0, ..Simulated::meaning(None) };
    let strong =
        Simulated { strength: 90.0, friction: 0.002, damping: 0.01, latency: 0.004, ..Simulated::meaning(None) };
    let late = Simulated { latency: 0.04, ..Simulated::meaning(None) };
    for (name, mut wheel) in [("weak", weak), ("strong", strong), ("late", late)] {
        let found = verdicts(&mut wheel).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(found.conforms(), "{name}: {:?}\n{}", found.plant, summary(&found).join("\n"));
    }
}
