//! Stops and starts of a puck with a handle on a shaft, against Runge-Kutta steps that are short compared with every time constant of it.

use hapt_plant::spec::{DeviceSpec, Drive, Hand, Handle, Shape};
use hapt_plant::{Script, VirtualDevice};
use hapt_testing::prelude::*;

const T: f64 = 1e-3;
/// The step, as a fraction of the time in which the fastest mode passes a radian.
const PART: f64 = 0.04;

#[derive(Clone, Debug)]
struct Case {
    spec: DeviceSpec,
    handle: Handle,
    drive: Drive,
    commands: Vec<f64>,
}

/// Puck and handle: x, v, h, w.
type State = [f64; 4];

impl Case {
    /// The hand's inertia, damping and stiffness on the handle, and its torque as a function of t.
    fn hand(&self) -> (f64, f64, f64, impl Fn(f64) -> f64) {
        let (inertia, damping, stiffness, shape) = match &self.drive {
            Drive::Torque(shape) => (0.0, 0.0, 0.0, shape),
            Drive::Grip { inertia, damping, stiffness, moves, .. } => (*inertia, *damping, *stiffness, moves),
            Drive::Position(_) => unreachable!("a handle that moves by itself"),
        };
        let grips = matches!(self.drive, Drive::Grip { .. });
        let Shape::Sine { amplitude, frequency, phase } = *shape else { unreachable!("a sine") };
        let omega = std::f64::consts::TAU * frequency;
        let torque = move |t: f64| {
            let (sin, cos) = (omega * t + phase).sin_cos();
            let part = if grips { stiffness * sin + damping * omega * cos } else { sin };
            amplitude * part
        };
        (inertia, damping, stiffness, torque)
    }

    fn by_device(&self) -> Vec<State> {
        let spec = DeviceSpec { handle: Some(self.handle), ..self.spec };
        let mut device = VirtualDevice::new(&spec);
        device.begin(&mut Script::new(&Hand { drive: self.drive.clone(), release: None }, 1e3 * T, T));
        let step = |command: &f64| {
            device.command(*command);
            device.travel();
            let ((x, v), (h, w)) = (device.puck(), device.handle().unwrap());
            [x, v, h, w]
        };
        self.commands.iter().map(step).collect()
    }

    fn by_small_steps(&self) -> Vec<State> {
        let DeviceSpec { lag, inertia, damping, friction, friction_backward, .. } = self.spec;
        let level = |side: f64| if side < 0.0 { friction_backward.unwrap_or(friction) } else { friction };
        let Handle { inertia: handle, stiffness, damping: shaft } = self.handle;
        let (extra, damper, spring, hand) = self.hand();
        let mass = handle + extra;
        let masses = 1.0 / inertia + 1.0 / mass;
        let swing = (stiffness * masses + spring / mass).sqrt();
        let rate = (damping / inertia + shaft * masses + damper / mass).max(swing).max(if lag > 0.0 {
            1.0 / lag
        } else {
            0.0
        });
        let steps = (rate.max(1e3) * T / PART).ceil();
        let (mut y, mut motor, mut gap) = ([0.0; 4], 0.0, 0.0);
        let mut places = Vec::new();
        for (k, &command) in self.commands.iter().enumerate() {
            if lag > 0.0 {
                gap += motor - command;
            }
            motor = command;
            let torque = |t: f64| if lag > 0.0 { motor + gap * (-(t - k as f64 * T) / lag).exp() } else { motor };
            let shaft_torque = |y: State| stiffness * (y[2] - y[0]) + shaft * (y[3] - y[1]);
            let change = |y: State, t: f64, direction: f64| -> State {
                let w = (hand(t) - shaft_torque(y) - damper * y[3] - spring * y[2]) / mass;
                if direction == 0.0 {
                    return [0.0, 0.0, y[3], w];
                }
                [y[1], (torque(t) + shaft_torque(y) - damping * y[1] - level(direction) * direction) / inertia, y[3], w]
            };
            let step = |y: State, t: f64, h: f64, direction: f64| -> State {
                let ahead = |d: State, h: f64| -> State { std::array::from_fn(|i| y[i] + h * d[i]) };
                let a = change(y, t, direction);
                let b = change(ahead(a, h / 2.0), t + h / 2.0, direction);
                let c = change(ahead(b, h / 2.0), t + h / 2.0, direction);
                let d = change(ahead(c, h), t + h, direction);
                std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
            };
            let net = |y: State, t: f64| torque(t) + shaft_torque(y);
            let (from, h) = (k as f64 * T, T / steps);
            let mut direction = if y[1] != 0.0 { f64::signum(y[1]) } else { 0.0 };
            for i in 0..steps as usize {
                let (mut t, mut left) = (from + h * i as f64, h);
                // A stop or a start within the step divides it at an instant found by bisection.
                for _ in 0..8 {
                    if direction == 0.0 && net(y, t).abs() > level(net(y, t)) * (1.0 + 1e-12) {
                        direction = net(y, t).signum();
                    }
                    let ends = |h: f64| {
                        let next = step(y, t, h, direction);
                        let over = if direction == 0.0 {
                            net(next, t + h).abs() > level(net(next, t + h))
                        } else {
                            direction * next[1] < 0.0
                        };
                        (over, next)
                    };
                    let (over, next) = ends(left);
                    if !over {
                        y = next;
                        break;
                    }
                    let (mut low, mut high) = (0.0, left);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if ends(middle).0 { high = middle } else { low = middle }
                    }
                    y = ends(high).1;
                    (t, left) = (t + high, left - high);
                    direction = if direction == 0.0 { net(y, t).signum() } else { 0.0 };
                    y[1] = 0.0;
                }
            }
            gap *= if lag > 0.0 { (-T / lag).exp() } else { 1.0 };
            places.push(y);
        }
        places
    }
}

fn about(level: f64) -> impl Strategy<Value = f64> {
    let near = (-4.0_f64..-0.5).prop_map(|power| 1.0 + 10_f64.powf(power));
    (prop_oneof![near, 0.2_f64..3.0], any::<bool>())
        .prop_map(move |(part, up)| if up { part * level } else { -part * level })
}

/// Pucks whose velocity damping settles within a thousandth of a sample to ten samples, and shafts that oscillate slower or faster, damped or not.
fn cases() -> impl Strategy<Value = Case> {
    let lag = prop_oneof![Just(0.0), (-1.5_f64..1.5).prop_map(|power| T * 10_f64.powf(power))];
    let levels = (1e-2_f64..0.3, prop::option::of(0.1_f64..2.0));
    let puck = (-6.0_f64..-3.0, -3.0_f64..1.0, levels, lag);
    let handle = (-1.0_f64..1.0, -1.0_f64..0.5, -2.0_f64..1.5);
    let grip = prop::option::of((-1.0_f64..1.0, -2.0_f64..1.0, -1.0_f64..1.0));
    (puck, handle, grip).prop_flat_map(
        |((inertia, settles, (friction, backward), lag), (share, angle, ratio), grip)| {
            let inertia = 10_f64.powf(inertia);
            let damping = inertia / (T * 10_f64.powf(settles));
            let other = inertia * 10_f64.powf(share);
            let (omega, mass) = (10_f64.powf(angle) / T, 1.0 / (1.0 / inertia + 1.0 / other));
            let handle =
                Handle { inertia: other, stiffness: mass * omega * omega, damping: mass * omega * 10_f64.powf(ratio) };
            let spec = DeviceSpec {
                lag,
                damping,
                friction,
                friction_backward: backward.map(|part| part * friction),
                ..DeviceSpec::new(T, inertia)
            };
            let sine = |level: f64| {
                (about(level), 0.0_f64..2.3, 0.0_f64..6.3).prop_map(|(amplitude, frequency, phase)| Shape::Sine {
                    amplitude,
                    frequency: 10_f64.powf(frequency),
                    phase,
                })
            };
            let drive = match grip {
                None => sine(friction).prop_map(Drive::Torque).boxed(),
                Some((inertia, damper, stiff)) => {
                    let stiffness = handle.stiffness * 10_f64.powf(stiff);
                    let (inertia, damping) = (other * 10_f64.powf(inertia), stiffness * T * 10_f64.powf(damper));
                    let grip = move |moves| Drive::Grip { inertia, damping, stiffness, moves, switching: None };
                    sine(friction / stiffness).prop_map(grip).boxed()
                }
            };
            (drive, prop::collection::vec(prop_oneof![Just(0.0), about(friction)], 6))
                .prop_map(move |(drive, commands)| Case { spec, handle, drive, commands })
        },
    )
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn a_puck_on_a_shaft_stops_and_starts_when_its_equation_says_however_fast_damping_settles_it(case in cases()) {
        let (right, found) = (case.by_small_steps(), case.by_device());
        let size = |i: usize| right.iter().fold(1e-3 * case.spec.friction * T / case.spec.damping, |most: f64, y| most.max(y[i].abs()));
        for (k, (found, right)) in found.iter().zip(&right).enumerate() {
            for i in [0, 2] {
                prop_assert!((found[i] - right[i]).abs() <= 2e-6 * size(i), "{found:?} {right:?} after sample {k}: {case:?}");
            }
        }
    }
}
