//! A board that is a standalone wheel: USB, mailbox and sampler, with a host at one end and an exact device at the other.

use hapt_core::{CertifiedTime, Phase, Reason, SafetyProfile};
use hapt_model::{Source, World};
use hapt_plant::VirtualDevice;
use hapt_wire::device::{Measurement, Motor, UNSERVED, WheelMailbox, WheelSampler, WheelStatus};
use hapt_wire::pid::{Common, Condition, Control, FULL, INFINITE, Input, Kind, Operation, Report, SILENCE, id};
use hapt_wire::usb::WheelPort;
use usb_device::UsbDirection;
use usb_device::bus::{PollResult, UsbBusAllocator};
use usb_device::endpoint::EndpointAddress;

use crate::bus::{Controller, Host, MAX_TRANSFER_BYTES};

const LIMIT: f64 = 5.0;
const HALF: f64 = 2.5 * std::f64::consts::PI;
const WORLD: &str = r#"
loop.period = "1 ms"
device.inertia = "0.02 kg m^2"
device.damping = "0.05 N m s/rad"
device.limit = "5 N m"
"#;

/// The bytes of a wheel without couplings.
fn bytes() -> Vec<u8> {
    use hapt_core::wheel::{Device, Timing};
    let world = World::read(&Source::from_text("wheel.toml", WORLD), &[]).unwrap();
    let device = Device::ideal(Timing::even(1e-3), 0.05, LIMIT);
    let limits = hapt_core::Limits {
        time: CertifiedTime::NOT_STATED,
        pulse: 0.0,
        link: f64::INFINITY,
        ..world.board_limits(SafetyProfile::Simulated)
    };
    let mut room = [0; 1024];
    hapt_wire::pack_wheel(&device, HALF, &world.spec(), &limits, &mut room).unwrap().to_vec()
}

/// The board with its wheel. `turn` is an iteration of the main loop, which tests may omit.
struct Bench<'p> {
    turn: Box<dyn FnMut(&mut WheelMailbox) + 'p>,
    sampler: WheelSampler,
    mailbox: WheelMailbox,
    wheel: VirtualDevice,
}

impl Bench<'_> {
    fn sample(&mut self, fault: bool) -> Motor {
        let position = self.wheel.puck().0 as f32;
        let motor = self.sampler.sample(&Measurement { position, fault, ..Measurement::default() }, &mut self.mailbox);
        assert!(motor.torque == 0.0 || motor.on, "a torque without a driver");
        self.wheel.command(f64::from(motor.torque));
        self.wheel.travel();
        motor
    }

    /// Takes this number of samples, with the main loop in between.
    fn run(&mut self, samples: usize) -> (f64, WheelStatus) {
        let mut torque = 0.0;
        for _ in 0..samples {
            (self.turn)(&mut self.mailbox);
            torque = f64::from(self.sample(false).torque);
        }
        (torque, self.mailbox.shown())
    }
}

/// The host's actions on the board.
struct Game<'h> {
    host: &'h Host,
}

impl Game<'_> {
    fn control(&self, bench: &mut Bench<'_>, setup: [u8; 8], data: &[u8]) -> Option<Vec<u8>> {
        let mut room = [0; MAX_TRANSFER_BYTES];
        let Bench { turn, mailbox, .. } = bench;
        self.host.control(setup, data, &mut room, || turn(mailbox)).map(<[u8]>::to_vec)
    }

    fn configure(&self, bench: &mut Bench<'_>) {
        assert!(self.control(bench, [0, 9, 1, 0, 0, 0, 0, 0], &[]).is_some());
    }

    fn report(&self, bench: &mut Bench<'_>, report: Report) {
        let (bytes, length) = report.write();
        let bytes = &bytes[..length];
        if matches!(report, Report::Create(_)) {
            let setup = [0x21, 9, bytes[0], 3, 0, 0, length as u8, 0];
            assert!(self.control(bench, setup, bytes).is_some(), "{report:?}");
        } else {
            let Bench { turn, mailbox, .. } = bench;
            self.host.send(1, bytes, || turn(mailbox));
        }
    }

    fn play(&self, bench: &mut Bench<'_>, kind: Kind, of: impl Fn(usize) -> Report) {
        self.report(bench, Report::Create(kind));
        let load = self.control(bench, [0xa1, 1, id::LOAD, 3, 0, 0, 64, 0], &[]).unwrap();
        assert_eq!(load[2], 1, "a place");
        let block = usize::from(load[1]) - 1;
        let common =
            Common { kind, duration: INFINITE, repeat: 0, delay: 0, gain: FULL, button: 0, direction: Some(27_000) };
        for report in [
            Report::Effect { block, common },
            of(block),
            Report::Operation { block, operation: Operation::Start, loops: 1 },
        ] {
            self.report(bench, report);
        }
    }

    /// A constant torque of half of full scale to the right.
    fn push(&self, bench: &mut Bench<'_>) {
        self.play(bench, Kind::Constant, |block| Report::Constant { block, magnitude: FULL / 2 });
    }
}

fn with_bench(test: impl FnOnce(&Game<'_>, &mut Bench<'_>)) {
    let host = Host::new();
    let mut next = [1; 2];
    let bus =
        UsbBusAllocator::new(Controller::new(&host, move |direction, address: Option<EndpointAddress>, _, _, _| {
            let place = &mut next[usize::from(direction == UsbDirection::In)];
            Ok(address.unwrap_or_else(|| {
                *place += 1;
                EndpointAddress::from_parts(*place - 1, direction)
            }))
        }));
    let mut port = WheelPort::new(&bus, HALF).unwrap();
    let sampler = WheelSampler::new(&bytes()).unwrap();
    let world = World::read(&Source::from_text("wheel.toml", WORLD), &[]).unwrap();
    let turn = move |mailbox: &mut WheelMailbox| {
        port.poll();
        port.exchange(mailbox);
    };
    let wheel = VirtualDevice::new(&world.device_spec());
    test(&Game { host: &host }, &mut Bench { turn: Box::new(turn), sampler, mailbox: WheelMailbox::new(), wheel });
}

fn is_near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-3 * LIMIT
}

#[test]
fn no_torque_before_a_host_has_the_wheel_and_then_the_requested_one() {
    with_bench(|game, bench| {
        assert_eq!(bench.run(100).1.phase, Phase::Disarmed);
        game.configure(bench);
        let (torque, shown) = bench.run(500);
        assert_eq!((torque, shown.phase), (0.0, Phase::Running));
        game.push(bench);
        let (torque, shown) = bench.run(50);
        assert!(is_near(torque, 0.5 * LIMIT) && shown.playing == 1, "{torque}");
        // The host receives the wheel's position of the sample before.
        let expected = Input::at(f64::from(bench.mailbox.shown().position), HALF);
        bench.run(2);
        let (report, length) = game.host.report();
        assert_eq!(report[..length], expected.write());
        assert!(expected.steering > 50);
    });
}

#[test]
fn a_host_that_suspends_resets_or_is_silent_leaves_no_torque_on() {
    for event in [Some(PollResult::Suspend), Some(PollResult::Reset), None] {
        with_bench(|game, bench| {
            game.configure(bench);
            bench.run(500);
            game.push(bench);
            bench.run(50);
            let samples = match event {
                Some(event) => {
                    game.host.signal(event);
                    1
                }
                None => SILENCE as usize / 1000 + 1,
            };
            let (_, shown) = bench.run(samples);
            assert_eq!(shown.playing, 0);
            // The fading torque has a time constant of 2 ms.
            assert!(bench.run(20).0.abs() < 1e-3 * LIMIT);
            assert_eq!(bench.mailbox.shown().phase, Phase::Running, "the world itself goes on");
        });
    }
}

#[test]
fn effects_end_where_the_main_loop_stops_and_resume_with_it() {
    with_bench(|game, bench| {
        game.configure(bench);
        bench.run(500);
        game.push(bench);
        bench.run(50);
        let bound = (UNSERVED / 1e-3) as usize;
        for _ in 0..bound {
            bench.sample(false);
        }
        assert_eq!(bench.mailbox.shown().playing, 1);
        bench.sample(false);
        assert_eq!(bench.mailbox.shown().playing, 0);
        for _ in 0..20 {
            bench.sample(false);
        }
        assert!(bench.sample(false).torque.abs() < 1e-3 * LIMIT as f32);
        game.report(bench, Report::Control(Control::Enable));
        assert!(is_near(bench.run(50).0, 0.5 * LIMIT), "a host that speaks has its effects back");
    });
}

#[test]
fn a_fault_of_the_driver_stays_for_any_request_of_a_host() {
    with_bench(|game, bench| {
        game.configure(bench);
        bench.run(500);
        game.push(bench);
        bench.run(50);
        assert!(!bench.sample(true).on);
        for control in [Control::Reset, Control::Enable] {
            game.report(bench, Report::Control(control));
        }
        game.configure(bench);
        game.push(bench);
        let (torque, shown) = bench.run(500);
        assert_eq!((torque, shown.phase, shown.reason), (0.0, Phase::Faulted, Some(Reason::Driver)));
    });
}

#[test]
fn a_spring_of_a_host_returns_the_wheel_and_is_scaled_to_the_stiffness_budget() {
    with_bench(|game, bench| {
        game.configure(bench);
        bench.run(500);
        let stiff = |block| {
            let condition = Condition {
                positive: FULL,
                negative: FULL,
                positive_saturation: FULL,
                negative_saturation: FULL,
                ..Condition::default()
            };
            Report::Condition { block, axis: 0, condition }
        };
        for _ in 0..16 {
            game.play(bench, Kind::Spring, stiff);
        }
        bench.wheel.set_out((0.5, 0.0), (0.0, 0.0));
        let mut farthest = 0.0_f64;
        for _ in 0..20_000 {
            bench.run(1);
            farthest = farthest.max(bench.wheel.puck().0.abs());
        }
        assert!(farthest <= 0.5 + 1e-6, "{farthest}");
        assert!(bench.wheel.puck().0.abs() < 0.05, "{}", bench.wheel.puck().0);
    });
}

#[test]
fn bytes_that_are_no_wheel_are_refused() {
    let whole = bytes();
    assert!(WheelSampler::new(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(WheelSampler::new(&whole[..length]).is_err(), "{length} bytes");
    }
    let mut other = whole.clone();
    other[0] = 99;
    assert!(WheelSampler::new(&other).is_err());
}
