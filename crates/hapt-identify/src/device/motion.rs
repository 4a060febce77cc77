//! The exact motion of a puck with end stops and Stribeck friction under the held torque.
//!
//! Its motion is linear between events: the puck comes to rest or starts, friction stops falling with the speed, contact with a stop begins
//! or ends. Over a piece without an event position, velocity and the motor's gap to its command are power series; pieces are so short that
//! the series end at rounding, and events are located on them. As in hapt-plant's device, friction and stops are
//! ```text
//! f + s max(0, 1 - |v|/w)    against the slide, and up to f + s at rest
//! max(0, k p + c ṗ)          with the depth p > 0 in the stop
//! ```
//! Torques of the position ([`super::field`]) are constant over a piece, at the value in its middle; the errors of that, of order three in
//! the length, are taken out at its end.

use super::field::{Field, Waves};
use super::pieces::{Line, Maps, Rates, State};
use crate::arrivals::Arrivals;

/// The numbers of a device that its motion depends on, torques per inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbers {
    /// 1/J with the motor's sign.
    pub gain: f64,
    /// b/J.
    pub damping: f64,
    /// f/J.
    pub friction: f64,
    /// A constant torque over J.
    pub offset: f64,
    /// The delay, in s.
    pub delay: f64,
    /// The lag, in s.
    pub lag: f64,
    /// s/J of Stribeck's friction.
    pub rise: f64,
    /// The velocity w from which on that is 0.
    pub fast: f64,
    /// The places of the stops, toward smaller positions and toward larger ones; infinite: there is none.
    pub stops: [f64; 2],
    /// k/J.
    pub stiffness: f64,
    /// c/J.
    pub stop_damping: f64,
    /// Torques of the position over J, and the part of friction that changes with it.
    pub waves: Waves,
    /// Whether pieces under torques of the position are short.
    pub finely: bool,
    /// The initial position.
    pub position: f64,
    /// The initial velocity.
    pub velocity: f64,
}

/// The accuracy of the motion as a part of its size: without torques of the position it is within this of hapt-plant's.
pub(crate) const ACCURACY: f64 = 1e-7;
/// A gap below this part of the largest one so far counts as none.
const NO_GAP: f64 = 1e-12;
/// More events between two changes of the torque are chatter.
const MOST_EVENTS: usize = 64;
/// Over a piece a torque of the position goes through at most this part of a radian.
const MOST_PHASE: f64 = 0.25;
/// And where their errors are to show.
const FINE_PHASE: f64 = 0.003;
/// Between two changes of the torque at most this many: its mean over many periods is 0, and no device of a record is so fast.
const MOST_TURNED: f64 = 100.0;
/// The contact with a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Touch {
    /// In no stop.
    Free,
    /// In a stop that pushes.
    Pressed,
    /// In a stop that the puck leaves faster than the stop follows.
    Left,
}

/// The event that ends a piece.
#[derive(Clone, Copy, PartialEq)]
enum Event {
    Rests,
    ChangesSpeed,
    Enters(usize),
    LetsGo,
    TakesHold,
    Leaves,
}

struct Motion {
    numbers: Numbers,
    state: State,
    torque: f64,
    /// The largest gap so far.
    widest: f64,
    /// 1 or -1 while it slides, 0 at rest.
    direction: f64,
    /// Whether friction falls with the speed.
    falls: bool,
    touch: Touch,
    /// The stop that it is in: 0 the low one, 1 the high one.
    stop: usize,
    /// Whether it has been in each of them.
    touched: [bool; 2],
    maps: Maps,
    /// The radians of the steepest wave per radian (m); `None`: there is none.
    steepest: Option<f64>,
}

impl Numbers {
    /// The fastest rate of its motion, in 1/s.
    pub fn fastest(&self) -> f64 {
        let &Numbers { damping, lag, rise, fast, stiffness, stop_damping, ref waves, .. } = self;
        let swing = (stiffness + waves.spring.abs()).sqrt();
        let rates = [damping + stop_damping, swing, rise / fast, if lag > 0.0 { lag.recip() } else { 0.0 }];
        if rates.iter().any(|rate| rate.is_nan()) { f64::INFINITY } else { rates.into_iter().fold(0.0, f64::max) }
    }

    /// Passes each time's index from `first` on and the position there to `see`. The motion starts at the sample `first` under torques
    /// commanded at `times` and held; the first command also holds before its time. Returns which of the stops the motion runs into.
    pub fn follow(&self, times: &[f64], torques: &[f64], first: usize, mut see: impl FnMut(usize, f64)) -> [bool; 2] {
        let (Some(&start), Some(&held)) = (times.get(first), torques.first()) else { return [false; 2] };
        let mut motion = Motion::new(*self, held);
        let (mut arrivals, mut now) = (Arrivals::new(times, torques, self.delay), f64::NEG_INFINITY);
        while let Some((at, torque)) = arrivals.change(start, motion.torque) {
            motion.relax(at - now);
            now = at;
            motion.command(torque);
        }
        motion.relax(start - now);
        motion.set_out();
        now = start;
        for (i, &to) in times.iter().enumerate().skip(first) {
            while let Some((at, torque)) = arrivals.change(to, motion.torque) {
                motion.pass(at - now);
                now = at;
                motion.command(torque);
            }
            motion.pass(to - now);
            now = to;
            see(i, motion.state[0]);
        }
        motion.touched
    }
}

impl Motion {
    fn new(numbers: Numbers, torque: f64) -> Self {
        let state = [numbers.position, numbers.velocity, 0.0];
        Motion {
            numbers,
            state,
            torque,
            widest: 0.0,
            direction: 0.0,
            falls: false,
            touch: Touch::Free,
            stop: 0,
            touched: [false; 2],
            maps: Maps::new(),
            steepest: numbers.waves.steepest(),
        }
    }

    /// Only the gap decays, over `length` s.
    fn relax(&mut self, length: f64) {
        if self.state[2] != 0.0 {
            self.state[2] *= (-length / self.numbers.lag).exp();
        }
    }

    fn command(&mut self, torque: f64) {
        if self.numbers.lag > 0.0 {
            self.state[2] += self.torque - torque;
            self.widest = self.widest.max(self.state[2].abs());
        }
        self.torque = torque;
        if self.direction == 0.0 {
            self.start();
        }
    }

    /// From the first state: the direction of motion, and whether it is in a stop.
    fn set_out(&mut self) {
        let [z, v, _] = self.state;
        if let Some(stop) = (0..2).find(|stop| self.depth(*stop, z) > 0.0) {
            (self.stop, self.touch) = (stop, Touch::Pressed);
            self.touched[stop] = true;
            if self.push_of_stop().value(&self.state) <= 0.0 {
                self.touch = Touch::Left;
            }
        }
        self.direction = if v != 0.0 { v.signum() } else { 0.0 };
        self.falls = v.abs() < self.numbers.fast;
        if v == 0.0 {
            self.start();
        }
    }

    /// 1 for the stop toward larger positions.
    fn side(stop: usize) -> f64 {
        if stop == 0 { -1.0 } else { 1.0 }
    }

    fn depth(&self, stop: usize, z: f64) -> f64 {
        Self::side(stop) * (z - self.numbers.stops[stop])
    }

    /// The force of the stop that it is in.
    fn push_of_stop(&self) -> Line {
        let &Numbers { stops, stiffness, stop_damping, .. } = &self.numbers;
        let side = Self::side(self.stop);
        Line {
            position: side * stiffness,
            velocity: side * stop_damping,
            constant: -side * stiffness * stops[self.stop],
        }
    }

    /// The acceleration of a puck that does not slide, friction aside.
    fn push(&self) -> f64 {
        let &Numbers { gain, offset, .. } = &self.numbers;
        let stop = match self.touch {
            Touch::Free => 0.0,
            Touch::Pressed | Touch::Left => -Self::side(self.stop) * self.push_of_stop().value(&self.state).max(0.0),
        };
        gain * (self.torque + self.state[2]) + offset + stop + self.numbers.waves.at_rest(self.state[0])
    }

    /// The level that holds the puck at rest, over J.
    fn holds(&self) -> f64 {
        let Numbers { friction, rise, waves, .. } = &self.numbers;
        friction * waves.level(self.state[0]) + rise
    }

    /// Starts from rest, where the push exceeds the friction.
    fn start(&mut self) {
        let push = self.push();
        let holds = self.holds();
        self.direction = if push.abs() <= holds || push == 0.0 { 0.0 } else { push.signum() };
        self.falls = true;
        // A stop pushes a puck at rest in it.
        if self.touch == Touch::Left {
            self.touch = Touch::Pressed;
        }
    }

    /// v̇ = drive - loss v - spring z + gain gap
    fn rates(&self) -> Rates {
        let numbers = &self.numbers;
        let &Numbers { gain, damping, friction, offset, lag, rise, fast, stops, stiffness, stop_damping, .. } = numbers;
        let Waves { spring, middle, .. } = numbers.waves;
        let decay = if self.state[2] == 0.0 { 0.0 } else { lag.recip() };
        let drive = gain * self.torque + offset - friction * self.direction + spring * middle;
        let mut rates = Rates { drive, loss: damping, spring, decay };
        if self.falls && rise > 0.0 {
            rates.drive -= rise * self.direction;
            rates.loss -= rise / fast;
        }
        if self.touch == Touch::Pressed {
            rates.drive += stiffness * stops[self.stop];
            rates.loss += stop_damping;
            rates.spring += stiffness;
        }
        rates
    }

    /// The events of the present piece; that of rest comes first, because the position grows or falls steadily up to it.
    fn events(&self) -> [Option<(Event, Line)>; 4] {
        let speed = |by: f64, constant: f64| Line { position: 0.0, velocity: by * self.direction, constant };
        let &Numbers { rise, fast, stops, .. } = &self.numbers;
        let rests = (Event::Rests, speed(-1.0, 0.0));
        let changes = match (rise > 0.0, self.falls) {
            (false, _) => None,
            (true, true) => Some((Event::ChangesSpeed, speed(1.0, -fast))),
            (true, false) => Some((Event::ChangesSpeed, speed(-1.0, fast))),
        };
        let into = |stop: usize, by: f64| {
            let side = by * Self::side(stop);
            stops[stop].is_finite().then_some(Line { position: side, velocity: 0.0, constant: -side * stops[stop] })
        };
        let push = self.push_of_stop();
        let negative =
            |line: Line| Line { position: -line.position, velocity: -line.velocity, constant: -line.constant };
        let [one, other] = match self.touch {
            Touch::Free => {
                [into(0, 1.0).map(|line| (Event::Enters(0), line)), into(1, 1.0).map(|line| (Event::Enters(1), line))]
            }
            Touch::Pressed => [Some((Event::LetsGo, negative(push))), None],
            Touch::Left => [Some((Event::TakesHold, push)), into(self.stop, -1.0).map(|line| (Event::Leaves, line))],
        };
        [Some(rests), changes, one, other]
    }

    /// Advances by `length` s under the command that is held.
    fn pass(&mut self, length: f64) {
        let (mut rest, mut events) = (length, 0);
        while rest > 0.0 {
            if self.direction == 0.0 {
                let Some(wait) = self.breaks_away(rest) else { return self.relax(rest) };
                self.relax(wait);
                // The direction of the total torque.
                self.direction = (self.push() - self.numbers.gain * self.state[2]).signum();
                self.falls = true;
                rest -= wait;
                continue;
            }
            let lines = if events < MOST_EVENTS { self.events() } else { [None; 4] };
            let gain = self.numbers.gain;
            let mut rates = self.rates();
            let drive = rates.drive;
            // The piece ends where the series are no longer accurate. A gap that cannot bring the puck to rest does not shorten it.
            let (mut end, mut held) = self.piece(rest, if self.moves_on(&lines) { rates.slow() } else { rates });
            rates.drive = drive + held.map_or(0.0, |(_, field)| field.value);
            let is_quiet = |places: &[State; 2]| {
                let is_before = |line: &Line| places.iter().all(|place| line.value(place) <= 0.0);
                lines.iter().flatten().all(|(_, line)| is_before(line))
            };
            let mut first = None;
            let [middle, mut last] = match self.maps.places(&rates, gain, end, &self.state).filter(is_quiet) {
                Some(places) => places,
                None => {
                    if !rates.reaches(end) {
                        (end, held) = self.piece(rest, rates);
                        rates.drive = drive + held.map_or(0.0, |(_, field)| field.value);
                    }
                    let series = rates.series(self.state, gain, end);
                    let (mut middle, mut last) = (series.at(0.5 * end), series.at(end));
                    for (event, line) in lines.into_iter().flatten() {
                        // A condition that begins and ends within the piece shows in its middle.
                        let part = match (line.value(&middle) > 0.0, line.value(&last) > 0.0) {
                            (true, _) => 0.5,
                            (false, true) => 1.0,
                            (false, false) => continue,
                        };
                        end = series.crossing(&line, part * end);
                        (middle, last, first) = (series.at(0.5 * end), series.at(end), Some(event));
                    }
                    [middle, last]
                }
            };
            if let Some(held) = held {
                correct(&mut last, &middle, &rates, gain, held, end);
            }
            self.state = last;
            if self.state[2].abs() < NO_GAP * self.widest {
                self.state[2] = 0.0;
            }
            rest -= end;
            if first.is_none() && end <= 0.0 {
                break;
            }
            if let Some(event) = first {
                events += 1;
                self.happens(event);
            }
        }
    }

    /// The length of the next piece at these rates, within `rest` s, and the torque of the position that is held over it, with its place.
    fn piece(&self, rest: f64, rates: Rates) -> (f64, Option<(f64, Field)>) {
        let [z, v, _] = self.state;
        let mut end = rates.reached(rest);
        let Some(steepest) = self.steepest.filter(|steepest| steepest * (v * rest).abs() < MOST_TURNED) else {
            return (end, None);
        };
        let most = if self.numbers.finely { FINE_PHASE } else { MOST_PHASE };
        // Halves recur, and have maps.
        while steepest * (v * end).abs() > most {
            end *= 0.5;
        }
        let place = z + 0.5 * end * v;
        (end, Some((place, self.numbers.waves.field(place, -self.numbers.friction * self.direction))))
    }

    /// Whether the gap cannot bring the puck to rest, and rest is the only event that there can be. The gap changes the velocity by at most
    /// its acceleration times the lag.
    fn moves_on(&self, lines: &[Option<(Event, Line)>; 4]) -> bool {
        let [_, v, gap] = self.state;
        lines[1..].iter().all(Option::is_none) && v.abs() > 2.0 * (self.numbers.gain * gap * self.numbers.lag).abs()
    }

    fn happens(&mut self, event: Event) {
        match event {
            Event::Rests => {
                self.state[1] = 0.0;
                self.start();
            }
            Event::ChangesSpeed => self.falls = !self.falls,
            Event::Enters(stop) => {
                (self.stop, self.touch) = (stop, Touch::Pressed);
                self.touched[stop] = true;
                self.state[0] = self.numbers.stops[stop];
            }
            Event::LetsGo => {
                // Without a damper the contact ends where the stop begins.
                if self.numbers.stop_damping > 0.0 {
                    self.touch = Touch::Left;
                } else {
                    self.happens(Event::Leaves);
                }
            }
            Event::TakesHold => self.touch = Touch::Pressed,
            Event::Leaves => {
                self.touch = Touch::Free;
                self.state[0] = self.numbers.stops[self.stop];
            }
        }
    }

    /// When the rising torque exceeds the friction, within `rest` s.
    fn breaks_away(&self, rest: f64) -> Option<f64> {
        let gap = self.numbers.gain * self.state[2];
        if gap == 0.0 {
            return None;
        }
        let holds = self.holds();
        let end = self.push() - gap;
        if end == 0.0 || end.abs() <= holds {
            return None;
        }
        let part = (holds * end.signum() - end) / gap;
        let wait = if part >= 1.0 { 0.0 } else { -self.numbers.lag * part.ln() };
        (wait < rest).then_some(wait)
    }
}

/// Takes out of the state at the end of a piece the error of a torque of the position that is held at its value at a place near the middle:
/// F(z(t)) - F(place) up to the second order in the time from the middle on.
fn correct(last: &mut State, middle: &State, rates: &Rates, gain: f64, (place, field): (f64, Field), length: f64) {
    let [z, v, gap] = *middle;
    let a = rates.drive - rates.loss * v - rates.spring * z + gain * gap;
    let constant = field.slope * (z - place);
    let bend = field.bend * v * v + field.slope * a;
    last[0] += length * length * (0.5 * constant - length * field.slope * v / 12.0);
    last[1] += length * (constant + length * length * bend / 24.0);
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use hapt_model::Waveform;
    use hapt_plant::VirtualDevice;
    use hapt_plant::spec::{Cogging, DeviceSpec, DeviceTorque, FrictionByPosition, Gravity, Stops, Stribeck};
    use hapt_testing::prelude::*;

    use super::super::parameters::Device;

    proptest! {
        #![proptest_config(hapt_testing::cases(64))]

        #[test]
        fn it_goes_where_the_exact_device_goes(
            seed in any::<u64>(), rate in 0.0..10.0f64, friction in 0.0..0.03f64, delay in 0.0..4e-3f64,
            lag in prop_oneof![Just(0.0), 5e-5..1e-2f64], stiffness in 1.0..200.0f64, ratio in prop_oneof![Just(0.0), 0.0..1.5f64],
            rise in prop_oneof![Just(0.0), 0.0..0.005f64], fast in 0.3..3.0f64,
        ) {
            let mut rng = Rng::with_seed(seed);
            let inertia = 1e-3;
            let stops = Stops {
                low: Some(-0.2 - rng.f64()).filter(|_| rng.bool()),
                high: Some(0.2 + rng.f64()),
                stiffness,
                damping: 2.0 * ratio * f64::sqrt(stiffness * inertia),
            };
            let stribeck = Some(Stribeck { torque: rise, velocity: fast }).filter(|stribeck| stribeck.torque > 0.0);
            let rig = DeviceSpec {
                lag, delay, damping: rate * inertia, friction, stops: Some(stops), stribeck, ..DeviceSpec::new(1e-3, inertia)
            };
            let off = off_by(&rig, &mut rng);
            prop_assert!(off < super::ACCURACY, "{off:e} of the motion");
        }

        #[test]
        fn it_goes_where_the_exact_device_goes_under_torques_of_the_position(
            seed in any::<u64>(), rate in 2.0..10.0f64, friction in 0.005..0.03f64, delay in 0.0..4e-3f64,
            lag in prop_oneof![Just(0.0), 5e-5..1e-2f64], has in 1u8..8, lean in -0.3..0.3f64,
        ) {
            let mut rng = Rng::with_seed(seed);
            let (inertia, stiffness) = (1e-3, 1.0 + 100.0 * rng.f64());
            let stops = Stops { low: None, high: Some(0.5 + rng.f64()), stiffness, damping: 0.1 * rng.f64() };
            let mut single = || 0.3 * (rng.f64() - 0.5) as f32;
            let waveform = Waveform { sine: [0.7, single(), single(), 0.0], cosine: [single(), 0.0, single(), single()] };
            let gravity = Gravity { torque: 0.03 * rng.f64(), phase: rng.f64() };
            let cogging = Cogging { torque: 0.02 * rng.f64(), pitch: 0.3 + rng.f64(), phase: rng.f64(), waveform };
            let changes = FrictionByPosition { share: 0.4 * rng.f64(), pitch: 0.5 + rng.f64(), phase: rng.f64(), waveform };
            let torque = DeviceTorque {
                gravity: Some(gravity).filter(|_| has & 1 > 0),
                cogging: Some(cogging).filter(|_| has & 2 > 0),
            };
            let rig = DeviceSpec {
                lag, delay, torque, damping: rate * inertia, friction: friction * (1.0 - lean),
                friction_backward: Some(friction * (1.0 + lean)), friction_by_position: Some(changes).filter(|_| has & 4 > 0),
                stops: Some(stops), ..DeviceSpec::new(1e-3, inertia)
            };
            let off = off_by(&rig, &mut rng);
            // Each turn at the stop multiplies the error before it.
            prop_assert!(off < 1e-3, "{off:e} of the motion");
        }

        /// A gap that decays within a part of a period.
        #[test]
        fn it_goes_where_the_exact_device_goes_with_a_short_lag(
            seed in any::<u64>(), rate in 0.0..10.0f64, friction in 0.0..0.03f64, delay in 0.0..4e-3f64, lag in 2e-5..2e-3f64,
            has in 0u8..8,
        ) {
            let mut rng = Rng::with_seed(seed);
            let mut single = || 0.3 * (rng.f64() - 0.5) as f32;
            let waveform = Waveform { sine: [0.7, single(), 0.0, single()], cosine: [single(), 0.0, single(), 0.0] };
            let gravity = Gravity { torque: 0.03 * rng.f64(), phase: rng.f64() };
            let cogging = Cogging { torque: 0.02 * rng.f64(), pitch: 0.3 + rng.f64(), phase: rng.f64(), waveform };
            let changes = FrictionByPosition { share: 0.4 * rng.f64(), pitch: 0.5 + rng.f64(), phase: rng.f64(), waveform };
            let torque = DeviceTorque {
                gravity: Some(gravity).filter(|_| has & 1 > 0),
                cogging: Some(cogging).filter(|_| has & 2 > 0),
            };
            let inertia = 1e-3;
            let rig = DeviceSpec {
                lag, delay, torque, damping: rate * inertia, friction,
                friction_by_position: Some(changes).filter(|_| has & 4 > 0), ..DeviceSpec::new(1e-3, inertia)
            };
            let off = off_by(&rig, &mut rng);
            prop_assert!(off < if has > 0 { 1e-4 } else { super::ACCURACY }, "{has}: {off:e} of the motion");
        }
    }

    /// The largest difference from hapt-plant's device, as a part of its motion.
    fn off_by(rig: &DeviceSpec, rng: &mut Rng) -> f64 {
        let mut level = 0.0;
        let step = |k: u32| {
            if k % 60 == 10 {
                level = 0.1 * (2.0 * rng.f64() - 1.0);
            }
            level
        };
        let torques: Vec<f64> = (0..1500).map(step).collect();
        let mut device = VirtualDevice::new(rig);
        let at = |torque: &f64| {
            let z = device.puck().0;
            device.command(*torque);
            device.travel();
            z
        };
        let truth: Vec<f64> = torques.iter().map(at).collect();
        let times: Vec<f64> = (0..1500).map(|k| f64::from(k) * 1e-3).collect();
        let size = truth.iter().fold(1e-3, |size: f64, z| size.max(z.abs()));
        let mut most = 0.0f64;
        Device::of_spec(rig)
            .numbers([0.0; 2])
            .follow(&times, &torques, 0, |k, z| most = most.max((z - truth[k]).abs()));
        most / size
    }
}
