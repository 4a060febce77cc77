//! A device whose motion is piecewise linear: short Runge-Kutta steps with every event bisected, energy, and closed forms.

use std::f64::consts::TAU;

use hapt_plant::spec::{DeviceSpec, Drive, Hand, Handle, Shape, Stops, Stribeck};
use hapt_plant::{Script, VirtualDevice};
use hapt_testing::prelude::*;

use crate::fields::{any_changes, any_device, any_hand, any_stribeck, gravity, moved};

const T: f64 = 1e-3;
/// Short steps in a period.
const STEPS: u32 = 200;

/// x, v, and of a handle h, w; without one h and w are x and v.
type State = [f64; 4];

/// The equation of one piece of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mode {
    /// ±1; 0: at rest.
    direction: f64,
    /// Below Stribeck's velocity.
    slow: bool,
    /// Of the stops toward larger and toward smaller positions.
    touch: [Touch; 2],
}

/// Whether the puck is outside a stop, is pushed by it, or leaves it faster than the stop follows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Touch {
    Beyond,
    Pressed,
    Left,
}

/// A device that a hand holds by this inertia, damping and stiffness about amplitude · sin(omega t + phase), or pushes by that torque.
struct Reference<'a> {
    spec: &'a DeviceSpec,
    grip: Option<[f64; 3]>,
    amplitude: f64,
    omega: f64,
    phase: f64,
    command: f64,
}

impl Reference<'_> {
    /// Coulomb friction at x toward a side.
    fn level(&self, side: f64, x: f64) -> f64 {
        let DeviceSpec { friction, friction_backward, friction_by_position, .. } = *self.spec;
        let mean = if side < 0.0 { friction_backward.unwrap_or(friction) } else { friction };
        mean * friction_by_position.map_or(1.0, |changes| changes.at(x))
    }

    fn more(&self) -> Stribeck {
        self.spec.stribeck.unwrap_or(Stribeck { torque: 0.0, velocity: f64::INFINITY })
    }

    /// The puck's depth in each stop, and the stop's unclamped push.
    fn stops(&self, y: State) -> [(f64, f64); 2] {
        let Some(Stops { low, high, stiffness, damping }) = self.spec.stops else { return [(-1.0, 0.0); 2] };
        let of = |side: f64, at: Option<f64>| {
            at.map_or((-1.0, 0.0), |at| {
                let depth = side * (y[0] - at);
                (depth, stiffness * depth + side * damping * y[1])
            })
        };
        [of(1.0, high), of(-1.0, low)]
    }

    /// The stops' push in this mode, toward larger positions.
    fn pushed(&self, y: State, mode: Mode) -> f64 {
        let push = |i: usize| if mode.touch[i] == Touch::Pressed { self.stops(y)[i].1 } else { 0.0 };
        push(1) - push(0)
    }

    fn touch(&self, y: State) -> [Touch; 2] {
        self.stops(y).map(|(depth, push)| match (depth > 0.0, push > 0.0) {
            (false, _) => Touch::Beyond,
            (true, true) => Touch::Pressed,
            (true, false) => Touch::Left,
        })
    }

    fn has_friction(&self) -> bool {
        self.spec.friction + self.spec.friction_backward.unwrap_or(0.0) + self.more().torque > 0.0
    }

    /// The hand's torque on the puck or handle at x and v, and its inertia there.
    fn hand(&self, [x, v]: [f64; 2], t: f64) -> (f64, f64) {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        match self.grip {
            None => (self.amplitude * sin, 0.0),
            Some([inertia, damping, stiffness]) => {
                let (to, speed) = (self.amplitude * sin, self.amplitude * self.omega * cos);
                (stiffness * (to - x) + damping * (speed - v), inertia)
            }
        }
    }

    /// The torque on the puck without friction and without the device's damping.
    fn net(&self, y: State, t: f64) -> f64 {
        let own = self.command + self.spec.torque.at(y[0]);
        match self.spec.handle {
            None => own + self.hand([y[0], y[1]], t).0,
            Some(Handle { stiffness, damping, .. }) => own + stiffness * (y[2] - y[0]) + damping * (y[3] - y[1]),
        }
    }

    fn rate(&self, y: State, t: f64, mode: Mode) -> State {
        let (d, Stribeck { torque, velocity }) = (mode.direction, self.more());
        let rests = d == 0.0 && self.has_friction();
        let more = if mode.slow && torque > 0.0 { torque * (1.0 - d * y[1] / velocity) } else { 0.0 };
        let (held_by, extra) = self.hand([y[2], y[3]], t);
        let mass = self.spec.inertia + if self.spec.handle.is_none() { extra } else { 0.0 };
        let net = self.net(y, t) + self.pushed(y, mode) - self.spec.damping * y[1] - d * (self.level(d, y[0]) + more);
        let (v, a) = if rests { (0.0, 0.0) } else { (y[1], net / mass) };
        match self.spec.handle {
            None => [v, a, v, a],
            Some(Handle { inertia, stiffness, damping }) => {
                let shaft = stiffness * (y[2] - y[0]) + damping * (y[3] - y[1]);
                [v, a, y[3], (held_by - shaft) / (inertia + extra)]
            }
        }
    }

    fn step(&self, y: State, t: f64, h: f64, mode: Mode) -> State {
        let ahead = |d: State, h: f64| -> State { std::array::from_fn(|i| y[i] + h * d[i]) };
        let a = self.rate(y, t, mode);
        let b = self.rate(ahead(a, h / 2.0), t + h / 2.0, mode);
        let c = self.rate(ahead(b, h / 2.0), t + h / 2.0, mode);
        let d = self.rate(ahead(c, h), t + h, mode);
        std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    }

    /// Whether the puck slides on from rest.
    fn slips(&self, y: State, t: f64, mode: Mode) -> bool {
        let net = self.net(y, t) + self.pushed(y, mode);
        net.abs() > (self.level(net, y[0]) + self.more().torque) * (1.0 + 1e-12)
    }

    /// Whether the piece has ended.
    fn ends(&self, y: State, t: f64, mode: Mode) -> bool {
        let (d, velocity) = (mode.direction, self.more().velocity);
        let by_friction = match (self.has_friction(), d == 0.0) {
            (false, _) => false,
            (true, true) => self.slips(y, t, mode),
            (true, false) if mode.slow => d * y[1] < 0.0 || d * y[1] > velocity,
            (true, false) => d * y[1] < velocity,
        };
        let by_stop = |(touch, (depth, push)): (Touch, (f64, f64))| match touch {
            Touch::Beyond => depth > 0.0,
            Touch::Pressed => push < 0.0,
            Touch::Left => push > 0.0 || depth < 0.0,
        };
        by_friction || mode.touch.into_iter().zip(self.stops(y)).any(by_stop)
    }

    /// The piece that continues from the end of another.
    fn next(&self, y: &mut State, t: f64, mode: Mode) -> Mode {
        let (d, velocity) = (mode.direction, self.more().velocity);
        let mut next = Mode { touch: self.touch(*y), ..mode };
        if !self.has_friction() {
            return next;
        }
        if d == 0.0 {
            if self.slips(*y, t, mode) {
                (next.direction, next.slow) = ((self.net(*y, t) + self.pushed(*y, mode)).signum(), true);
            }
        } else if mode.slow && d * y[1] < 0.0 {
            y[1] = 0.0;
            next = Mode { direction: 0.0, slow: true, touch: self.touch(*y) };
        } else {
            next.slow = d * y[1] <= velocity;
        }
        next
    }

    /// After a period, in which nothing else happens.
    fn advance(&self, mut y: State, from: f64, mode: &mut Mode) -> State {
        let h = T / f64::from(STEPS);
        for i in 0..STEPS {
            let (mut t, mut left) = (from + h * f64::from(i), h);
            for _ in 0..20 {
                if mode.direction == 0.0 && self.has_friction() && self.ends(y, t, *mode) {
                    *mode = self.next(&mut y, t, *mode);
                }
                let next = self.step(y, t, left, *mode);
                if !self.ends(next, t + left, *mode) {
                    y = next;
                    break;
                }
                let (mut low, mut high) = (0.0, left);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    let over = self.ends(self.step(y, t, middle, *mode), t + middle, *mode);
                    if over { high = middle } else { low = middle }
                }
                y = self.step(y, t, high, *mode);
                (t, left) = (t + high, left - high);
                *mode = self.next(&mut y, t, *mode);
            }
        }
        y
    }
}

/// The grip (if any) and the sine of a hand of [`any_hand`] that swings.
fn swung(hand: &Drive) -> Option<(Option<[f64; 3]>, [f64; 3])> {
    let of = |shape: &Shape| match *shape {
        Shape::Sine { amplitude, frequency, phase } => Some([amplitude, TAU * frequency, phase]),
        Shape::Step { .. } | Shape::Ramp { .. } | Shape::Path { .. } => None,
    };
    match hand {
        Drive::Torque(shape) => Some((None, of(shape)?)),
        Drive::Grip { inertia, damping, stiffness, moves, .. } => {
            Some((Some([*inertia, *damping, *stiffness]), of(moves)?))
        }
        Drive::Position(_) => None,
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(400))]

    #[test]
    fn every_piece_of_a_motion_solves_its_equation(
        spec in any_device(), stribeck in (1e-4_f64..0.05, 0.05_f64..5.0), falls in any::<bool>(), hand in any_hand(),
        velocity in -10.0_f64..10.0,
        commands in prop::collection::vec(-0.1_f64..0.1, 8),
    ) {
        let stribeck = Stribeck { torque: stribeck.0, velocity: stribeck.1 };
        let stribeck_there = Some(stribeck).filter(|_| falls);
        let spec = DeviceSpec { lag: 0.0, delay: 0.0, stribeck: stribeck_there, ..spec };
        let Some((grip, [amplitude, omega, phase])) = swung(&hand) else { return Ok(()) };
        let device = moved(&spec, &hand, velocity, &commands);
        let mut y = [0.0, velocity, 0.0, velocity];
        let slow = velocity.abs() <= stribeck.velocity || !falls;
        let mut mode = Mode { direction: velocity.signum(), slow, touch: [Touch::Beyond; 2] };
        for (k, command) in commands.iter().enumerate() {
            let reference = Reference { spec: &spec, grip, amplitude, omega, phase, command: *command };
            y = reference.advance(y, k as f64 * T, &mut mode);
        }
        let (x, v) = device.puck();
        let (h, w) = device.handle().unwrap_or((x, v));
        let fast = velocity.abs() + commands.iter().map(|command| command.abs()).sum::<f64>() * T / spec.inertia;
        for (found, right) in [x, h].into_iter().zip([y[0], y[2]]) {
            prop_assert!((found - right).abs() < 1e-7 * fast * 8.0 * T, "{found} {right}, {y:?}");
        }
        for (found, right) in [v, w].into_iter().zip([y[1], y[3]]) {
            prop_assert!((found - right).abs() < 1e-5 * fast, "{found} {right}, {y:?}");
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    /// A slow hand drags the puck by a soft spring: it slides where the damping exceeds the slope with which friction falls, else it sticks
    /// and slips.
    #[test]
    fn a_dragged_puck_sticks_and_slips_where_friction_falls_more_than_damping_rises(
        inertia in 1e-3_f64..3e-3, damping in 5e-3_f64..2e-2, part in prop_oneof![0.2_f64..0.8, 1.5..4.0], stiffness in 0.2_f64..2.0,
        (friction, velocity) in (1e-3_f64..0.02, 0.5_f64..3.0), speed in 0.1_f64..0.4, back in any::<bool>(),
    ) {
        let stribeck = Some(Stribeck { torque: part * damping * velocity, velocity });
        let spec = DeviceSpec { damping, friction, stribeck, ..DeviceSpec::new(T, inertia) };
        let sign = if back { -1.0 } else { 1.0 };
        let moves = Shape::Ramp { to: sign * speed * velocity * 50.0, at: 0.0, over: 50.0 };
        let hand = Drive::Grip { inertia: 0.0, damping: 0.0, stiffness, moves, switching: None };
        let mut device = VirtualDevice::new(&spec);
        device.begin(&mut Script::new(&Hand { drive: hand, release: None }, 50.0, T));
        (0..20_000).for_each(|_| device.travel());
        let mut speeds = Vec::new();
        for _ in 0..20_000 {
            device.travel();
            speeds.push(sign * device.puck().1 / velocity);
        }
        let sticks = speeds.contains(&0.0);
        prop_assert_eq!(sticks, part > 1.0);
        if !sticks {
            prop_assert!(speeds[10_000..].iter().all(|v| (v - speed).abs() < 0.05 * speed), "{:?}", speeds.last());
        }
    }
}

/// The numbers of docs/worlds.md that compare the straight line with Stribeck's curves.
#[test]
fn a_straight_line_of_the_same_area_approximates_the_curves_of_the_literature() {
    let farthest = |curve: fn(f64) -> f64, width: f64| {
        let grid = (0..=100_000).map(|i| f64::from(i) * 1e-4);
        let area: f64 = grid.clone().map(|x| curve(x) * 1e-4).sum::<f64>() - 0.5e-4;
        assert!((area - 0.5 * width).abs() < 1e-4, "{area}");
        grid.map(|x| (curve(x) - (1.0 - x / width).max(0.0)).abs()).fold(0.0, f64::max)
    };
    let gauss = farthest(|x| (-x * x).exp(), std::f64::consts::PI.sqrt());
    let exponential = farthest(|x| (-x).exp(), 2.0);
    assert!((gauss - 0.086).abs() < 5e-4 && (exponential - 0.153).abs() < 5e-4, "{gauss} {exponential}");
}

fn bare(inertia: f64, stops: Stops) -> DeviceSpec {
    DeviceSpec { stops: Some(stops), ..DeviceSpec::new(T, inertia) }
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    /// A damped half swing ends where the spring and its damper push no more: φ of it, cos φ = 2ζ² - 1, and e^(-ζφ/√(1 - ζ²)) of the speed is left.
    #[test]
    fn a_puck_bounces_off_a_stop_by_its_closed_form(
        inertia in 1e-4_f64..1e-2, swing in 20.0_f64..2000.0, ratio in prop_oneof![Just(0.0), 0.01_f64..0.95], speed in 0.1_f64..20.0, at in 1e-3_f64..0.02,
        back in any::<bool>(),
    ) {
        let (stiffness, damping) = (inertia * swing * swing, 2.0 * ratio * inertia * swing);
        let sign = if back { -1.0 } else { 1.0 };
        let (low, high) = if back { (Some(-at), None) } else { (None, Some(at)) };
        let spec = bare(inertia, Stops { low, high, stiffness, damping });
        let root = (1.0 - ratio * ratio).sqrt();
        let phase = (2.0 * ratio * ratio - 1.0).acos();
        let kept = (-ratio * phase / root).exp();
        let left_at = at / speed + phase / (root * swing);
        let depth = speed / (root * swing) * kept * phase.sin();
        // It leaves the stop, and passes its face.
        let out = left_at + depth / (kept * speed);
        let samples = (out / T).ceil() as usize + 3;
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), sign * speed, &vec![0.0; samples]);
        let (x, v) = device.puck();
        let wanted = at + depth - kept * speed * (samples as f64 * T - left_at);
        prop_assert!((sign * v + kept * speed).abs() < 1e-10 * speed, "{v} {kept}");
        prop_assert!((sign * x - wanted).abs() < 1e-10 * (at + speed * samples as f64 * T), "{x} {wanted}");
        let lost = 0.5 * inertia * speed * speed * (1.0 - kept * kept);
        prop_assert!((device.ledger().stops - lost).abs() < 1e-10 * inertia * speed * speed, "{:?} {lost}", device.ledger());
    }

    /// The device is not sampled: under a held command its motion and its works are the same whatever the period is.
    #[test]
    fn the_length_of_a_period_changes_no_motion(
        spec in any_device(), hand in any_hand(), velocity in prop_oneof![Just(0.0), -20.0_f64..20.0], command in prop_oneof![Just(0.0), -0.1_f64..0.1],
        periods in 1_usize..100,
    ) {
        // A settled motor: the delay and the lag of its first command are those of another motion.
        let spec = DeviceSpec { delay: 0.0, lag: 0.0, ..spec };
        let by = |periods: usize| {
            let spec = DeviceSpec { period: 40.0 * T / periods as f64, ..spec };
            moved(&spec, &hand, velocity, &vec![command; periods])
        };
        let (one, other) = (by(40), by(periods));
        let of = |device: &VirtualDevice| {
            let ((x, v), ledger) = (device.puck(), device.ledger());
            [x, v, ledger.motor, ledger.hand, ledger.friction, ledger.stops, ledger.damping]
        };
        let size = one.puck().1.abs() + other.puck().1.abs() + velocity.abs() + 1.0;
        for (a, b) in of(&one).into_iter().zip(of(&other)) {
            prop_assert!((a - b).abs() < 1e-8 * size * (1.0 + a.abs()), "{:?} {:?}", of(&one), of(&other));
        }
    }

    /// A puck that rests at, in or before a stop, held by friction or not, under its own weight and a growing push: it breaks away, and goes into
    /// the stop and out of it, at the same instants in samples of any length.
    #[test]
    fn a_puck_leaves_its_rest_at_an_instant_of_any_period(
        inertia in 1e-4_f64..1e-2, friction in prop_oneof![Just(0.0), 1e-3..0.02_f64], changes in prop::option::of(any_changes()),
        stribeck in any_stribeck(), (weight, phase) in (0.0_f64..0.02, 0.0..TAU),
        near in prop_oneof![Just(0.0), -1e-3..1e-4_f64], back in any::<bool>(),
        stiffness in 1.0_f64..100.0, rate in -5.0_f64..5.0, handle in prop::option::of((1e-4_f64..1e-2, 1.0_f64..100.0, 0.0_f64..0.01)),
        periods in 1_usize..30,
    ) {
        let (low, high) = if back { (Some(near.min(0.0)), None) } else { (None, Some(-near.min(0.0))) };
        let handle = handle.map(|(inertia, stiffness, damping)| Handle { inertia, stiffness, damping });
        let spec = DeviceSpec {
            friction, friction_by_position: changes, stribeck, torque: gravity(weight, phase), handle,
            ..bare(inertia, Stops { low, high, stiffness, damping: 0.0 })
        };
        let whole = 20.0 * T;
        let hand = Drive::Torque(Shape::Ramp { to: rate, at: 0.0, over: 1.0 });
        let by = |periods: usize| moved(&DeviceSpec { period: whole / periods as f64, ..spec }, &hand, 0.0, &vec![0.0; periods]).puck();
        let (one, other) = (by(20), by(periods));
        let speed = (weight + rate.abs() * whole) * whole / inertia;
        prop_assert!((one.1 - other.1).abs() < 1e-9 * speed, "{one:?} {other:?} of {speed}");
        prop_assert!((one.0 - other.0).abs() < 1e-9 * speed * whole, "{one:?} {other:?} of {speed}");
    }

    /// A straight motion that goes on into a stop: the damper's work is c v times the depth.
    #[test]
    fn a_straight_motion_into_a_stop_does_the_work_of_its_damper(
        face in 0.0_f64..0.1, depth in 1e-4_f64..0.3, at in 0.0_f64..5e-3, over in 1e-3_f64..0.1, stiffness in 1.0_f64..100.0,
        damping in 1e-4..0.5_f64, back in any::<bool>(),
    ) {
        let (low, high) = if back { (Some(-face), None) } else { (None, Some(face)) };
        let to = face + depth;
        let hand = Drive::Position(Shape::Ramp { to: if back { -to } else { to }, at, over });
        let samples = ((at + over) / T).ceil() as usize + 1;
        let device = moved(&bare(1e-3, Stops { low, high, stiffness, damping }), &hand, 0.0, &vec![0.0; samples]);
        let wanted = damping * to / over * depth;
        prop_assert!((device.ledger().stops - wanted).abs() < 1e-9 * wanted, "{:?} {wanted}", device.ledger());
    }

    /// A hand that prescribes the motion supplies the energy that the stops dissipate.
    #[test]
    fn a_prescribed_motion_does_the_work_of_the_stops(
        (low, high) in (-0.1_f64..-1e-3, 1e-3_f64..0.1), stiffness in 1.0_f64..100.0, damping in prop_oneof![Just(0.0), 1e-4..0.5_f64],
        shape in prop_oneof![
            (0.005_f64..0.3, 0.5_f64..3000.0, 0.0..TAU).prop_map(|(amplitude, frequency, phase)| Shape::Sine { amplitude, frequency, phase }),
            (-0.3_f64..0.3, 1e-3_f64..5e-3).prop_map(|(to, over)| Shape::Ramp { to, at: 0.0, over }),
        ],
    ) {
        let stops = Stops { low: Some(low), high: Some(high), stiffness, damping };
        let spec = bare(1e-3, stops);
        // A jump at the start stores what the stops lose, or not.
        let first = moved(&spec, &Drive::Position(shape.clone()), 0.0, &[0.0]);
        let device = moved(&spec, &Drive::Position(shape.clone()), 0.0, &[0.0; 6]);
        let at = |t: f64| match shape {
            Shape::Sine { amplitude, frequency, phase } => {
                let (sin, cos) = (TAU * frequency * t + phase).sin_cos();
                (amplitude * sin, amplitude * TAU * frequency * cos)
            }
            Shape::Ramp { to, over, .. } => if t < over { (to * t / over, to / over) } else { (to, 0.0) },
            Shape::Step { .. } | Shape::Path { .. } => unreachable!(),
        };
        let steps = 400_000;
        let h = 5.0 * T / f64::from(steps);
        let power = |i: i32| {
            let (x, v) = at(T + h * (f64::from(i) + 0.5));
            let push = |depth: f64, rate: f64| if depth > 0.0 { (stiffness * depth + damping * rate).max(0.0) * rate } else { 0.0 };
            push(x - high, v) + push(low - x, -v)
        };
        let work = h * (0..steps).map(power).sum::<f64>();
        let stored = |x: f64| 0.5 * stiffness * ((x - high).max(0.0).powi(2) + (low - x).max(0.0).powi(2));
        let (before, after) = (at(T), at(6.0 * T));
        let found = device.ledger().stops - first.ledger().stops + stored(after.0) - stored(before.0);
        let fastest = 0.5 * (0..100).map(|i| at(6.0 * T * f64::from(i) / 100.0).1.abs()).fold(0.0, f64::max);
        let size = (stiffness * 0.3 + damping * fastest) * fastest * 5.0 * T + 1e-9;
        prop_assert!((found - work).abs() < 1e-4 * size, "{found} {work} of {size}");
    }
}
