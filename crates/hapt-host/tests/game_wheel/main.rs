//! A game wheel at the other end of a stream, with a USB/IP host of this test, and a loop whose samples the test takes.

#![cfg(target_os = "linux")]

mod base_feel;
mod game_loop;
mod host;

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Request, SafetyProfile};
use hapt_host::game_wheel::{GameWheel, Room, WheelStatus};
use hapt_host::messages::{ClientMessage, ServerMessage, WheelInfo};
use hapt_host::{Machine, PageSession, Session, WheelView, WorldConfig};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Device, Failure, Moment, Outside, Plan, Position, Record};
use hapt_wire::pid::{Condition, Control, DESCRIPTOR, FULL, Input, Kind, Periodic, Report, SILENCE, id};
use hapt_wire::usb::UNREAD;

use host::Host;

/// A time beyond which a test fails: far longer than on the slowest machine.
const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const RANGE: f64 = 5.0 * std::f64::consts::PI;
const LIMIT: f64 = 5.0;
/// A damping of 1/3 N·m s/rad permits more than 300 N·m/rad at 1 ms.
const WORLD: &str = r#"
loop.period = "1 ms"
device.inertia = "0.02 kg m^2"
device.damping = "0.3 N m s/rad"
device.limit = "5 N m"
"#;

/// A device with a prescribed motion: its position is a function of the time since the function was set.
struct Moved {
    path: Arc<Mutex<Path>>,
}

struct Path {
    at: Box<dyn Fn(f64) -> f64 + Send>,
    samples: u32,
}

impl Device for Moved {
    fn read(&mut self) -> Result<Position, Failure> {
        let path = self.path.lock().unwrap();
        Ok(Position { position: (path.at)(1e-3 * f64::from(path.samples)), velocity: 0.0, announced: false })
    }

    fn write(&mut self, _: f64) -> Result<(), Failure> {
        Ok(())
    }

    fn passed(&mut self, periods: u32) {
        self.path.lock().unwrap().samples += periods;
    }
}

/// A wheel, its loop at full torque, and its host.
struct Bench {
    wheel: GameWheel,
    cycle: Cycle,
    path: Arc<Mutex<Path>>,
    host: Host,
    /// Whether the host reads reports, as a driver does while a program has the wheel open.
    reads: bool,
    samples: u64,
}

impl Bench {
    fn new() -> Self {
        let world = World::read(&Source::from_text("wheel.toml", WORLD), &[]).unwrap();
        let (own, other) = UnixStream::pair().unwrap();
        let (wheel, port) = GameWheel::on(own, &Room::of(&world, RANGE).unwrap()).unwrap();
        let path = Arc::new(Mutex::new(Path { at: Box::new(|_| 0.0), samples: 0 }));
        let device = Moved { path: Arc::clone(&path) };
        let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
        let cycle = Cycle::new(Box::new(plan), Box::new(device)).with_outside(Outside::playing(port));
        let mut bench = Bench { wheel, cycle, path, host: Host::new(other), reads: true, samples: 0 };
        bench.host.configure();
        bench.sample(None);
        bench.sample(Some(Request::Arm));
        while bench.sample(None).phase != Phase::Running {}
        bench
    }

    fn sample(&mut self, request: Option<Request>) -> Record {
        let periods = u32::from(self.samples > 0);
        self.cycle.pass(periods);
        self.samples += 1;
        if self.samples.is_multiple_of(100) {
            self.settle();
        }
        let now = 1_000_000 * self.samples;
        self.cycle.sample(&Moment { periods, now, ..Moment::default() }, request).unwrap()
    }

    /// Waits until the wheel has taken all samples but the last, or is detached.
    fn settle(&mut self) -> WheelStatus {
        let begin = Instant::now();
        loop {
            let status = self.wheel.status();
            if status.samples + 1 >= self.samples || !status.is_attached {
                if status.is_attached && self.reads {
                    // Any transfer collects the positions so far.
                    self.host.feature(id::POOL);
                }
                return status;
            }
            assert!(begin.elapsed() < TEST_TIMEOUT);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// The information for a page.
    fn view(&self) -> WheelInfo {
        self.wheel.view().info()
    }

    /// Takes samples for `ms`; returns the last.
    fn run(&mut self, ms: u64) -> Record {
        let last = (0..ms).map(|_| self.sample(None)).last().unwrap();
        self.settle();
        last
    }

    /// Moves the wheel on this path for `ms`; returns the last sample's torque of effects, and the position.
    fn moved(&mut self, ms: u64, at: impl Fn(f64) -> f64 + Send + 'static) -> (f64, f64) {
        *self.path.lock().unwrap() = Path { at: Box::new(at), samples: 0 };
        let record = self.run(ms);
        (record.link, record.position)
    }
}

fn condition(coefficient: i16) -> impl Fn(usize) -> Report {
    move |block| {
        let condition = Condition {
            positive: coefficient,
            negative: coefficient,
            positive_saturation: FULL,
            negative_saturation: FULL,
            ..Condition::default()
        };
        Report::Condition { block, axis: 0, condition }
    }
}

/// Within 2 % of full scale.
fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 0.02 * LIMIT
}

#[test]
fn a_host_finds_a_wheel_with_its_descriptors() {
    let mut bench = Bench::new();
    let (status, device) = bench.host.get(0, 0x0100, 18);
    assert_eq!((status, device.len(), &device[8..12]), (0, 18, &[0x09, 0x12, 0x01, 0x00][..]));
    let (status, configuration) = bench.host.get(0, 0x0200, 255);
    // The interface is HID's, with the descriptor's length, and an endpoint each way.
    assert_eq!((status, configuration[9 + 5], configuration[4]), (0, 3, 1));
    let length = DESCRIPTOR.len().to_le_bytes();
    assert_eq!(configuration[18..27], [9, 0x21, 0x11, 1, 0, 1, 0x22, length[0], length[1]]);
    let (status, descriptor) = bench.host.get(1, 0x2200, 4096);
    assert_eq!((status, &descriptor[..]), (0, DESCRIPTOR));
    // A host may request half of it.
    assert_eq!(bench.host.get(1, 0x2200, 128).1, DESCRIPTOR[..128]);
    let (_, name) = bench.host.get(0, 0x0302, 255);
    let name: Vec<u16> = name[2..].chunks(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect();
    assert_eq!(String::from_utf16(&name).unwrap(), "hapt wheel");
    assert_eq!(bench.host.feature(id::POOL), (0, vec![id::POOL, 16, 0, 16, 1]));
}

#[test]
fn the_host_receives_the_wheels_position() {
    let mut bench = Bench::new();
    for (turn, expected) in [(0.25, 16_384), (-0.5, -32_767), (9.0, 32_767)] {
        bench.moved(50, move |_| turn * RANGE);
        let begin = Instant::now();
        loop {
            // Any transfer gathers what has been shown.
            bench.host.feature(id::POOL);
            let last = bench.host.shown.last().cloned().unwrap_or_default();
            let input = Input { steering: expected, ..Input::default() };
            if last == input.write() {
                break;
            }
            assert!(begin.elapsed() < TEST_TIMEOUT, "{last:?} for {turn}");
            bench.run(1);
        }
    }
}

#[test]
fn a_page_shows_the_effects_and_sets_the_pedals_of_a_simulated_wheel() {
    let source = Source::from_text("wheel.toml", WORLD);
    let world = World::read(&source, &[]).unwrap();
    let (own, other) = UnixStream::pair().unwrap();
    let (wheel, port) = GameWheel::on(own, &Room::of(&world, RANGE).unwrap()).unwrap();
    let machine = Machine::simulated(&world).with_outside(Outside::playing(port)).unwrap();
    let machine = Machine { wheel: Some(Box::new(wheel.view())), ..machine };
    let session = Session::start(WorldConfig::new(source, Vec::new()).unwrap(), machine).unwrap();
    let (mut page, begin) = (PageSession::new(session), Instant::now());
    let mut host = Host::new(other);
    host.configure();
    let until = |page: &mut PageSession, host: &mut Host, what: &dyn Fn(&WheelInfo, &Host) -> bool| loop {
        page.poll(begin.elapsed(), |_, _| ());
        // Any transfer gathers what has been shown.
        host.feature(id::POOL);
        let info = page.session.wheel().unwrap().info();
        if what(&info, host) {
            break info;
        }
        assert!(begin.elapsed() < TEST_TIMEOUT, "{info:?} {:?}", host.shown.last());
        std::thread::sleep(Duration::from_millis(2));
    };
    let block = host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL / 2 });
    host.play(Kind::Spring, condition(-FULL));
    let info = until(&mut page, &mut host, &|info, _| info.given[0] < -0.4 * LIMIT && info.effects.len() == 2);
    assert_eq!(info.effects.iter().map(|effect| effect.kind).collect::<Vec<_>>(), ["torque", "spring"]);
    // A driving spring counts as 0, and the page shows the reason.
    assert!(info.attached && info.limit == LIMIT && info.reason.is_some(), "{info:?}");
    host.report(Report::Free { block });
    until(&mut page, &mut host, &|info, _| info.effects.len() == 1 && info.given[0] > -1e-9);
    let epoch = page.session.handle().epoch();
    let pressed = r#"{"type": "controls", "pedals": [1, 0, 0.5], "buttons": 5}"#;
    assert!(page.handle(1, ClientMessage::read(pressed).unwrap(), epoch).is_none());
    let shows = |pedals, buttons| {
        move |_: &WheelInfo, host: &Host| {
            let last = host.shown.last().map_or(&[][..], Vec::as_slice);
            last.get(3..) == Some(&Input { pedals, buttons, ..Input::default() }.write()[3..])
        }
    };
    until(&mut page, &mut host, &shows([32_767, 0, 16_384], 5));
    // A page that leaves releases pedals and buttons.
    page.session.release();
    until(&mut page, &mut host, &shows([0; 3], 0));
    for bad in [
        r#"{"type": "controls", "pedals": [1.5, 0, 0], "buttons": 0}"#,
        r#"{"type": "controls", "pedals": [0, 0], "buttons": 0}"#,
    ] {
        assert!(ClientMessage::read(bad).is_err(), "{bad}");
    }
    // The effects use the damping that this world leaves unused.
    let set = ClientMessage::Set { key: "device.damping".into(), value: "1 N m s/rad".into() };
    assert!(matches!(page.handle(1, set, epoch), Some(ServerMessage::Refused { .. })));
    let ServerMessage::World(world) = page.world() else { panic!("no world") };
    assert!(world.keys.iter().all(|key| key.fixed));
}

#[test]
fn conditions_have_their_closed_forms_to_two_hundredths_of_full_scale() {
    let mut bench = Bench::new();
    for coefficient in [FULL, FULL / 3] {
        let share = f64::from(coefficient) / f64::from(FULL);
        let block = bench.host.play(Kind::Spring, condition(coefficient));
        for angle in [0.3, -2.0, 4.5] {
            let (torque, z) = bench.moved(200, move |t| angle * (5.0 * t).min(1.0));
            assert!(near(torque, -share * LIMIT * z / (0.5 * RANGE)), "spring: {torque} at {z}");
        }
        bench.host.report(Report::Free { block });
        let block = bench.host.play(Kind::Damper, condition(coefficient));
        for velocity in [4.0, -7.0] {
            let (torque, _) = bench.moved(300, move |t| velocity * t);
            assert!(near(torque, -share * LIMIT * velocity / 10.0), "damper: {torque} at {velocity} rad/s");
        }
        bench.host.report(Report::Free { block });
        let block = bench.host.play(Kind::Friction, condition(coefficient));
        for velocity in [0.5_f64, -3.0] {
            let (torque, _) = bench.moved(300, move |t| velocity * t);
            assert!(near(torque, -share * LIMIT * velocity.signum()), "friction: {torque} at {velocity} rad/s");
        }
        bench.host.report(Report::Free { block });
        let block = bench.host.play(Kind::Inertia, condition(coefficient));
        for jerk in [60.0, -90.0] {
            let (torque, _) = bench.moved(1000, move |t| jerk * t * t * t / 6.0);
            assert!(near(torque, -share * LIMIT * jerk / 200.0), "inertia: {torque} at {jerk} rad/s²");
        }
        bench.host.report(Report::Free { block });
    }
}

#[test]
fn torques_have_their_closed_forms_from_the_sample_after_the_report_on() {
    let mut bench = Bench::new();
    let block = bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL / 2 });
    assert!(near(bench.run(50).link, -0.5 * LIMIT));
    // A change of the magnitude fades over 2 ms, and begins at once.
    bench.host.report(Report::Constant { block, magnitude: -FULL / 2 });
    let first = bench.sample(None).link;
    let second = bench.sample(None).link;
    assert!((first + 0.5 * LIMIT).abs() < 1e-3 && second > first + 0.3, "{first}, then {second}");
    assert!(near(bench.run(50).link, 0.5 * LIMIT));
    bench.host.report(Report::Free { block });
    let periodic = Periodic { magnitude: FULL / 2, offset: FULL / 10, phase: 0, period: 200 };
    for (kind, wave) in [
        (Kind::Sine, (|x| (std::f64::consts::TAU * x).sin()) as fn(f64) -> f64),
        (Kind::Triangle, |x| 1.0 - 4.0 * ((x + 0.25) % 1.0 - 0.5).abs()),
        (Kind::SawtoothUp, |x| 2.0 * x - 1.0),
        (Kind::SawtoothDown, |x| 1.0 - 2.0 * x),
        (Kind::Square, |x| if x < 0.5 { 1.0 } else { -1.0 }),
    ] {
        bench.run(50);
        let begin = bench.samples;
        let block = bench.host.play(kind, |block| Report::Periodic { block, periodic });
        for _ in 0..500 {
            let found = bench.sample(None).link;
            // The start fades in, and steps may be a sample early or late.
            let ms = bench.samples - begin;
            let turn = ms as f64 / 200.0;
            let jumps = ms % 100 < 3 || ms % 100 > 97;
            if ms > 20 && !jumps {
                let expected = -LIMIT * (0.1 + 0.5 * wave(turn % 1.0));
                assert!(near(found, expected), "{kind:?} after {ms} ms: {found}, {expected}");
            }
        }
        bench.host.report(Report::Free { block });
    }
}

#[test]
fn for_any_request_the_sum_is_within_the_limit_and_the_reason_of_a_smaller_torque_is_reported() {
    let mut bench = Bench::new();
    for _ in 0..4 {
        bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    }
    bench.host.play(Kind::Spring, condition(-FULL));
    let record = bench.run(100);
    assert!(record.link >= -LIMIT - 1e-6 && record.output.abs() <= LIMIT, "{record:?}");
    let status = bench.settle();
    assert!(status.less[0] > 0, "a driving spring is reported");
    assert_eq!(status.refused, 0);
}

#[test]
fn a_full_pool_is_reported_and_malformed_reports_change_nothing() {
    let mut bench = Bench::new();
    for _ in 0..16 {
        bench.host.report(Report::Create(Kind::Spring));
    }
    bench.host.report(Report::Create(Kind::Spring));
    assert_eq!(bench.host.feature(id::LOAD).1[1..3], [0, 2]);
    bench.host.report(Report::Control(Control::Reset));
    let block = bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    bench.host.send(&[]);
    bench.host.send(&[id::CONSTANT]);
    bench.host.send(&[0xff; 64]);
    bench.host.send(&[id::CONSTANT, block as u8 + 1, 0xff, 0x7f]);
    assert_eq!(bench.host.set_feature(&[id::CREATE, 99]), -32, "a stall");
    assert_eq!(bench.host.feature(99).0, -32);
    // More than a control transfer may carry.
    assert_eq!(bench.host.control([0x21, 9, id::CREATE, 3, 0, 0, 0, 2], &[0; 512]).0, -32);
    assert_eq!(bench.host.control([0x21, 0x77, 0, 0, 0, 0, 0, 0], &[]).0, -32);
    // The loop has taken no sample meanwhile, and the ring to it is full. It takes the pools in the ring, and then the newest.
    bench.sample(None);
    bench.host.feature(id::POOL);
    assert!(near(bench.run(50).link, -LIMIT));
    assert_eq!(bench.settle().refused, 5);
}

/// A wheel under a constant torque and a spring.
fn playing() -> Bench {
    let mut bench = Bench::new();
    bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    bench.host.play(Kind::Spring, condition(FULL));
    bench.moved(100, |_| 1.0);
    assert!(bench.sample(None).link < -1.0);
    bench
}

/// Asserts that the wheel is detached, and that the effects' torque ends.
fn ends_without_torque(bench: &mut Bench) {
    let begin = Instant::now();
    while bench.wheel.status().is_attached {
        assert!(begin.elapsed() < TEST_TIMEOUT);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(bench.run(50).link.abs() < 1e-6);
}

#[test]
fn a_host_that_disconnects_leaves_no_torque_on() {
    let mut bench = playing();
    bench.host.stream.shutdown(std::net::Shutdown::Both).unwrap();
    ends_without_torque(&mut bench);
}

#[test]
fn a_wheel_that_loses_its_configuration_gives_no_torque() {
    let mut bench = playing();
    assert_eq!(bench.host.control([0, 9, 0, 0, 0, 0, 0, 0], &[]).0, 0, "the kernel has its answer");
    ends_without_torque(&mut bench);
    // A host that restores it at once, before the wheel has polled, has removed the driver's effects too.
    let mut bench = playing();
    for configuration in [0, 1] {
        bench.host.submit(0, false, 0, [0, 9, configuration, 0, 0, 0, 0, 0], &[]);
    }
    ends_without_torque(&mut bench);
}

#[test]
fn a_wheel_that_no_driver_reads_gives_no_torque() {
    let mut bench = playing();
    bench.reads = false;
    // A part of the torque is left, since the host may have been busy.
    assert!(bench.run(UNREAD / 1000 / 2).link < -1.0);
    // The counted time between two polls is bounded, and this loop runs ahead of them.
    bench.run(4 * UNREAD / 1000);
    ends_without_torque(&mut bench);
}

#[test]
fn a_wheel_that_no_program_has_open_waits_for_the_next() {
    let mut bench = Bench::new();
    bench.reads = false;
    bench.run(10 * UNREAD / 1000);
    bench.reads = true;
    bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    assert!(near(bench.run(4 * UNREAD / 1000).link, -LIMIT));
    assert!(bench.wheel.status().is_attached);
}

#[test]
fn a_malformed_message_detaches_the_wheel_without_torque() {
    let mut bench = Bench::new();
    bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    bench.run(20);
    bench.host.stream.write_all(&[0x5a; 96]).unwrap();
    ends_without_torque(&mut bench);
}

#[test]
fn a_silent_host_leaves_no_torque_on_but_its_springs() {
    let mut bench = Bench::new();
    bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    bench.host.play(Kind::Spring, condition(FULL));
    bench.moved(SILENCE / 1000 - 100, |_| 1.0);
    let spring = -LIMIT / (0.5 * RANGE);
    let is_silent = |bench: &Bench| bench.view().reason.is_some_and(|reason| reason.contains("nothing for 10 s"));
    assert!(!is_silent(&bench));
    assert!(near(bench.sample(None).link, spring - LIMIT) || bench.sample(None).link <= -LIMIT + 1e-6);
    let after = bench.run(200).link;
    assert!(near(after, spring), "{after}");
    // The limit was reached earlier.
    bench.view();
    bench.run(10);
    assert!(is_silent(&bench));
    bench.host.report(Report::Gain(FULL));
    bench.run(100);
    assert!(!is_silent(&bench));
}

#[test]
fn an_unlinked_transfer_is_not_answered() {
    let mut bench = Bench::new();
    bench.run(20);
    let waiting = bench.host.waiting.take().unwrap();
    bench.host.number += 1;
    let unlink = bench.host.number;
    bench.host.message([2, unlink, 1 << 16 | 2, 0, 0, waiting, 0, 0, 0, 0], [0; 8], &[]);
    let (command, number, (mut status, _)) = bench.host.next(|number| number == waiting);
    // It may have been answered before it was unlinked.
    let was_shown = command == 3;
    if was_shown {
        assert_eq!(number, waiting);
        status = bench.host.next(|_| false).2.0;
    } else {
        assert_eq!((command, number), (4, unlink));
    }
    assert_eq!(status, if was_shown { 0 } else { -104 });
    bench.host.look();
    bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: FULL });
    assert!(near(bench.run(50).link, -LIMIT));
}

#[test]
fn updates_at_a_high_rate_are_all_rendered() {
    let mut bench = Bench::new();
    let block = bench.host.play(Kind::Constant, |block| Report::Constant { block, magnitude: 0 });
    let before = bench.settle().taken;
    let mut random = 7_u32;
    for update in 1..=20_000_u64 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let magnitude = (random >> 16) as i16 % FULL;
        bench.host.report(Report::Constant { block, magnitude });
        let link = bench.sample(None).link;
        assert!(link.abs() <= LIMIT + 1e-6);
        if update % 1000 == 0 {
            assert_eq!(bench.settle().taken - before, update);
            let expected = -LIMIT * f64::from(magnitude) / f64::from(FULL);
            assert!(near(bench.run(20).link, expected));
        }
    }
}
