//! A device whose motion is linear in pieces: Runge and Kutta's short steps with every event bisected, energy, and closed forms.

use std::f64::consts::TAU;

use hapt_plant::spec::{DeviceSpec, Drive, Hand, Handle, Shape, Stribeck};
use hapt_plant::{Script, VirtualDevice};
use proptest::prelude::*;

use crate::fields::{any_device, any_hand, moved};

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
    fn level(&self, side: f64) -> f64 {
        let DeviceSpec { friction, friction_backward, .. } = *self.spec;
        if side < 0.0 { friction_backward.unwrap_or(friction) } else { friction }
    }

    fn more(&self) -> Stribeck {
        self.spec.stribeck.unwrap_or(Stribeck { torque: 0.0, velocity: f64::INFINITY })
    }

    fn has_friction(&self) -> bool {
        self.level(1.0) + self.level(-1.0) + self.more().torque > 0.0
    }

    /// The hand's torque on what it holds at x and v, and its inertia there.
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

    /// Everything on the puck but friction and the device's damping.
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
        let net = self.net(y, t) - self.spec.damping * y[1] - d * (self.level(d) + more);
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

    /// Whether the piece has ended.
    fn ends(&self, y: State, t: f64, mode: Mode) -> bool {
        let (d, Stribeck { torque, velocity }) = (mode.direction, self.more());
        match (self.has_friction(), d == 0.0) {
            (false, _) => false,
            (true, true) => self.net(y, t).abs() > (self.level(self.net(y, t)) + torque) * (1.0 + 1e-12),
            (true, false) if mode.slow => d * y[1] < 0.0 || d * y[1] > velocity,
            (true, false) => d * y[1] < velocity,
        }
    }

    /// The piece that goes on from the end of another.
    fn next(&self, y: &mut State, t: f64, mode: Mode) -> Mode {
        let (d, velocity) = (mode.direction, self.more().velocity);
        if d == 0.0 {
            return Mode { direction: self.net(*y, t).signum(), slow: true };
        }
        if mode.slow && d * y[1] < 0.5 * velocity {
            y[1] = 0.0;
            return Mode { direction: 0.0, slow: true };
        }
        Mode { slow: !mode.slow, ..mode }
    }

    /// After a period, in which nothing else happens.
    fn advance(&self, mut y: State, from: f64, mode: &mut Mode) -> State {
        let h = T / f64::from(STEPS);
        for i in 0..STEPS {
            let (mut t, mut left) = (from + h * f64::from(i), h);
            for _ in 0..20 {
                if mode.direction == 0.0 && self.ends(y, t, *mode) {
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

/// Of a hand of [`any_hand`] that swings: by a torque or in a grip.
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
    fn every_piece_of_a_motion_is_that_of_its_equation(
        spec in any_device(), stribeck in (1e-4_f64..0.05, 0.05_f64..5.0), hand in any_hand(), velocity in -10.0_f64..10.0,
        commands in prop::collection::vec(-0.1_f64..0.1, 8),
    ) {
        let stribeck = Stribeck { torque: stribeck.0, velocity: stribeck.1 };
        let spec = DeviceSpec { lag: 0.0, delay: 0.0, stribeck: Some(stribeck), ..spec };
        let Some((grip, [amplitude, omega, phase])) = swung(&hand) else { return Ok(()) };
        let device = moved(&spec, &hand, velocity, &commands);
        let mut y = [0.0, velocity, 0.0, velocity];
        let slow = velocity.abs() <= stribeck.velocity;
        let mut mode = Mode { direction: velocity.signum(), slow };
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

    /// A slow hand drags the puck by a soft spring: it slides where damping is more than what friction falls by, else it sticks and slips.
    #[test]
    fn a_dragged_puck_sticks_and_slips_where_friction_falls_more_than_damping_rises(
        inertia in 1e-3_f64..3e-3, damping in 5e-3_f64..2e-2, part in prop_oneof![0.2_f64..0.8, 1.5..4.0], stiffness in 0.2_f64..2.0,
        (friction, velocity) in (1e-3_f64..0.02, 0.5_f64..3.0), speed in 0.1_f64..0.4, back: bool,
    ) {
        let stribeck = Some(Stribeck { torque: part * damping * velocity, velocity });
        let spec = DeviceSpec {
            period: T, delay: 0.0, lag: 0.0, inertia, damping, friction, friction_backward: None, stribeck, handle: None,
            torque: Default::default(),
        };
        let way = if back { -1.0 } else { 1.0 };
        let moves = Shape::Ramp { to: way * speed * velocity * 50.0, at: 0.0, over: 50.0 };
        let hand = Drive::Grip { inertia: 0.0, damping: 0.0, stiffness, moves, switching: None };
        let mut device = VirtualDevice::new(&spec);
        device.begin(&mut Script::new(&Hand { drive: hand, release: None }, 50.0, T));
        (0..20_000).for_each(|_| device.travel());
        let mut speeds = Vec::new();
        for _ in 0..20_000 {
            device.travel();
            speeds.push(way * device.puck().1 / velocity);
        }
        let sticks = speeds.contains(&0.0);
        prop_assert_eq!(sticks, part > 1.0);
        if !sticks {
            prop_assert!(speeds[10_000..].iter().all(|v| (v - speed).abs() < 0.05 * speed), "{:?}", speeds.last());
        }
    }
}

/// What docs/worlds.md says of the straight line beside Stribeck's curves.
#[test]
fn a_straight_line_of_the_same_area_is_near_the_curves_of_the_literature() {
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
