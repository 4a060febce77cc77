//! The recorder: written samples stay, lost ones are counted, and it never blocks the loop.

use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use crate::common::{self, WHEEL, header, world};
use hapt_core::{Phase, Request, SafetyProfile};
use hapt_log::{Ending, Error, Kind, Log, Recorder, Summary, columns, replay};
use hapt_rt::{BODIES, Change, Engine, HandCommand, LoopCommand, Plan, Record, SimulatedDevice};
use hapt_sim::Grip;

/// Sample k of a loop at rest.
fn record(sample: u64) -> Record {
    Record {
        sample,
        due: 1_000_000 * sample,
        plan: 0,
        position: sample as f64,
        velocity: 0.0,
        zero: 0.0,
        measured: sample as f64,
        measured_velocity: 0.0,
        torque: -0.0,
        link: 0.0,
        command: 0.0,
        output: 0.0,
        applied: 0.0,
        phase: Phase::Running,
        reason: None,
        warning: None,
        latency: 1_500,
        computation: 900,
        outside: 0,
        missed: 0,
        late: 1.5e-6,
        silent: 0.0,
        request: None,
        bodies: [(0.0, 0.0); BODIES],
        announced: false,
    }
}

/// `samples` samples of a loop in real time that is armed, gripped, moved and released, changes to another world, and is disarmed and armed
/// again.
fn session(samples: usize, text: &str, other: &str) -> Vec<Record> {
    let world = world(text);
    let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
    let next = Plan::following(&common::world(other), &plan).unwrap();
    let (device, mut hand) = SimulatedDevice::new(&world);
    let mut engine = Engine::start(plan, Box::new(device)).unwrap();
    let grip = Grip { inertia: 0.0, damping: 0.02, stiffness: 5.0 };
    let mut touches = vec![
        HandCommand::Grab(grip),
        HandCommand::Move(0.4),
        HandCommand::Release,
        HandCommand::Grab(grip),
        HandCommand::Move(-0.7),
    ]
    .into_iter();
    let mut orders = vec![
        LoopCommand::Request(Request::Arm),
        LoopCommand::Swap(Box::new(next)),
        LoopCommand::Request(Request::Disarm),
        LoopCommand::Request(Request::Arm),
    ]
    .into_iter();
    let mut records = Vec::new();
    while records.len() < samples {
        while let Ok(record) = engine.records.pop() {
            records.push(record);
            if records.len() % (samples / 6) == 10 {
                touches.next().map(|touch| hand.push(touch));
                orders.next().map(|order| engine.send(order).ok());
            }
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    records.truncate(samples);
    records
}

fn recorded(path: &Path, records: &[Record], other: &str) -> Summary {
    let recorder = Recorder::start(path, &world(WHEEL), header(WHEEL)).unwrap();
    recorder.plan(1, &world(other), Change::Follows);
    for record in records {
        assert!(recorder.send(record));
    }
    recorder.finish().unwrap()
}

#[test]
fn a_replay_of_a_session_is_bit_identical_over_a_change_of_worlds() {
    let other = WHEEL.replace("1.018592", "2.5").replace("1 ms", "2 ms");
    let records = session(900, WHEEL, &other);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let recording = recorded(&path, &records, &other);
    assert_eq!((recording.written, recording.lost), (900, 0));

    let mut log = Log::open(&path).unwrap();
    assert_eq!(log.plan().columns, columns(&world(WHEEL), true, false));
    let phases = log.plan().columns.iter().find_map(|column| match column.kind {
        Kind::Choice(choice) if column.name == "phase" => Some(choice.values),
        _ => None,
    });
    let mut last = (0, -1.0);
    for record in &records {
        let sample = log.next().unwrap().unwrap();
        let inputs = sample.inputs().unwrap();
        assert_eq!((inputs.sample, inputs.request, sample.plan.number), (record.sample, record.request, record.plan));
        assert_eq!(inputs.reading.position.to_bits(), record.position.to_bits());
        assert_eq!((inputs.reading.late, inputs.reading.missed), (record.late, record.missed));
        let (phase, _) = phases.unwrap().iter().find(|(_, code)| *code == inputs.phase).unwrap();
        assert_eq!(phase.replace('-', ""), format!("{:?}", record.phase).to_lowercase());
        // Time continues, by whole periods of the world that ran.
        let period = sample.plan.world.sampling.period;
        let step = if last.1 < 0.0 { 0.0 } else { sample.values[0] - last.1 };
        assert!(sample.log_time > last.0 && (last.1 < 0.0 || (step / period).round() >= 1.0), "{step}");
        last = (sample.log_time, sample.values[0]);
    }
    assert!(log.next().unwrap().is_none());
    assert_eq!(log.ending(), &Ending::Whole);

    let moved = records.iter().filter(|record| record.output != 0.0).count();
    assert!(moved > 200 && records.iter().any(|record| record.plan == 1), "nothing happened: {moved}");
    let again = replay(&mut Log::open(&path).unwrap()).unwrap();
    assert_eq!((again.compared, again.first, again.skipped, again.gaps), (900, None, 0, 0));

    // After a gap the state is unknown without a snapshot.
    recorded(&path, &[&records[..300], &records[303..]].concat(), &other);
    let again = replay(&mut Log::open(&path).unwrap()).unwrap();
    assert_eq!((again.compared, again.first, again.skipped, again.gaps), (300, None, 597, 1));
    recorded(&path, &records[5..], &other);
    let refused = replay(&mut Log::open(&path).unwrap()).err().unwrap();
    assert!(matches!(refused, Error::NoReplay(_)), "{refused}");
}

#[test]
fn after_a_gap_the_recorder_requests_the_loops_state_and_the_replay_continues_from_there() {
    let world = world(WHEEL);
    let (device, mut hand) = SimulatedDevice::new(&world);
    let mut engine = Engine::start(Plan::new(&world, SafetyProfile::Simulated).unwrap(), Box::new(device)).unwrap();
    engine.send(LoopCommand::Request(Request::Arm)).unwrap();
    hand.push(HandCommand::Grab(Grip { inertia: 0.0, damping: 0.02, stiffness: 5.0 })).unwrap();
    hand.push(HandCommand::Move(0.4)).unwrap();
    let disk = Disk::new(1 << 30);
    let recorder = Recorder::start_on(disk.clone(), "x", &world, header(WHEEL)).unwrap();
    let mut records = 0;
    while records < 1500 {
        while let Ok(record) = engine.records.pop() {
            records += 1;
            // Some records are not passed on.
            if !(400..410).contains(&records) {
                recorder.follow(&mut engine, &record);
            }
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let written = recorder.finish().unwrap().written;
    let bytes = disk.bytes();
    let again = replay(&mut Log::read(&bytes[..]).unwrap()).unwrap();
    assert_eq!((&again.first, again.gaps, again.compared + again.skipped), (&None, 1, written));
    assert!(again.compared > 600 && again.skipped >= 256, "{again:?}");
}

/// Takes bytes while its gate is open, and up to a size.
#[derive(Clone)]
struct Disk {
    taken: Arc<Mutex<Vec<u8>>>,
    open: Arc<(Mutex<bool>, Condvar)>,
    room: usize,
}

impl Disk {
    fn new(room: usize) -> Disk {
        Disk { taken: Arc::default(), open: Arc::new((Mutex::new(true), Condvar::new())), room }
    }

    fn gate(&self, open: bool) {
        *self.open.0.lock().unwrap() = open;
        self.open.1.notify_all();
    }

    fn bytes(&self) -> Vec<u8> {
        self.taken.lock().unwrap().clone()
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let open = self.open.0.lock().unwrap();
        drop(self.open.1.wait_while(open, |open| !*open).unwrap());
        let mut taken = self.taken.lock().unwrap();
        let fits = bytes.len().min(self.room - taken.len());
        taken.extend_from_slice(&bytes[..fits]);
        if fits == 0 { Err(io::Error::from(io::ErrorKind::StorageFull)) } else { Ok(fits) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_blocked_disk_loses_samples_and_does_not_block_the_sender() {
    let disk = Disk::new(1 << 30);
    let recorder = Recorder::start_on(disk.clone(), "slow", &world(WHEEL), header(WHEEL)).unwrap();
    disk.gate(false);
    // More than the queue holds: sending returns while the disk is blocked, and the lost records are counted.
    let sent = 60_000;
    for sample in 0..sent {
        recorder.send(&record(sample));
    }
    let lost = recorder.state().lost;
    assert!(lost > 0 && recorder.state().error.is_none(), "{:?}", recorder.state());
    disk.gate(true);
    let recording = recorder.finish().unwrap();
    assert_eq!(recording.written + recording.lost, sent);
    let bytes = disk.bytes();
    let mut log = Log::read(&bytes[..]).unwrap();
    let mut count = 0;
    while log.next().unwrap().is_some() {
        count += 1;
    }
    assert_eq!((count, log.ending()), (recording.written, &Ending::Whole));
}

#[test]
fn a_full_disk_is_reported_and_keeps_the_written_samples() {
    let disk = Disk::new(700_000);
    let recorder = Recorder::start_on(disk.clone(), "full.mcap", &world(WHEEL), header(WHEEL)).unwrap();
    let mut sent = 0;
    while recorder.state().error.is_none() {
        recorder.send(&record(sent));
        sent += 1;
        if sent % 1000 == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let state = recorder.state();
    assert!(!recorder.send(&record(sent)), "it takes records that it cannot write");
    assert_eq!(state.error.as_deref(), Some("cannot write full.mcap: no storage space"));
    let refused = recorder.finish().unwrap_err();
    assert_eq!(refused.to_string(), "cannot write full.mcap: no storage space");

    let bytes = disk.bytes();
    let mut log = Log::read(&bytes[..]).unwrap();
    let mut count = 0;
    while let Some(sample) = log.next().unwrap() {
        assert_eq!(sample.values[1], count as f64);
        count += 1;
    }
    assert_eq!(log.ending(), &Ending::Cut(bytes.len() as u64));
    assert!(state.written > 1000 && count >= state.written, "{count} of {} are there", state.written);
}

#[test]
fn an_output_that_cannot_be_written_fails_at_the_start() {
    let refused = |path: &str| Recorder::start(path, &world(WHEEL), header(WHEEL)).err().unwrap().to_string();
    assert_eq!(refused("no/such/x.mcap"), "cannot write no/such/x.mcap: No such file or directory (os error 2)");
    #[cfg(target_os = "linux")]
    assert_eq!(refused("/dev/full"), "cannot write /dev/full: No space left on device (os error 28)");
}

#[test]
fn a_log_begun_just_after_a_change_of_worlds_begins_with_the_new_one() {
    let disk = Disk::new(1 << 30);
    let header = hapt_log::Header { plan: 7, ..header(WHEEL) };
    let recorder = Recorder::start_on(disk.clone(), "x", &world(WHEEL), header).unwrap();
    for sample in 0..10 {
        let plan = if sample < 4 { 6 } else { 7 };
        assert!(recorder.send(&Record { plan, ..record(sample) }));
    }
    assert_eq!(recorder.finish().unwrap().written, 6);
    let bytes = disk.bytes();
    let mut log = Log::read(&bytes[..]).unwrap();
    assert_eq!((log.plan().number, log.next().unwrap().unwrap().values[1]), (7, 4.0));
}

#[test]
fn samples_of_an_unannounced_world_are_an_error() {
    let disk = Disk::new(1 << 30);
    let recorder = Recorder::start_on(disk, "x", &world(WHEEL), header(WHEEL)).unwrap();
    recorder.send(&Record { plan: 3, ..record(0) });
    assert_eq!(
        recorder.finish().unwrap_err().to_string(),
        "cannot write x: the samples of plan 3 came before its world"
    );
}

/// Not a test: the program that the next test runs and kills.
#[test]
#[ignore = "runs until it is killed"]
fn a_recorder_at_work() {
    let path = std::env::var_os("HAPT_LOG_PATH").unwrap();
    let recorder = Recorder::start(Path::new(&path), &world(WHEEL), header(WHEEL)).unwrap();
    let mut reported = 0;
    for sample in 0.. {
        recorder.send(&record(sample));
        std::thread::sleep(Duration::from_millis(1));
        let written = recorder.state().written;
        if written > reported {
            reported = written;
            // Directly to standard error, since the harness captures output.
            writeln!(io::stderr(), "written {written} of {sample}").unwrap();
        }
    }
}

/// Samples that the recorder reports as written are in the file after a kill -9; and it writes at least once a second.
#[cfg(unix)]
#[test]
fn a_killed_recorder_leaves_its_written_samples() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "recorder::a_recorder_at_work", "--ignored", "--nocapture"]).env("HAPT_LOG_PATH", &path);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut reported = lines.map_while(Result::ok).filter_map(|line| line.strip_prefix("written ").map(String::from));
    let (first, second) = (reported.next(), reported.next());
    child.kill().unwrap();
    child.wait().unwrap();
    let (Some(_), Some(second)) = (first, second) else { panic!("it wrote nothing") };
    let written: u64 = second.split(' ').next().unwrap().parse().unwrap();

    let mut log = Log::open(&path).unwrap();
    let mut count = 0;
    while let Some(sample) = log.next().unwrap() {
        assert_eq!(sample.values[1], count as f64);
        count += 1;
    }
    assert!(matches!(log.ending(), Ending::Cut(_)), "{}", log.ending());
    assert!(written > 0 && count >= written, "{count} of {written}");
}

/// Between two flushes the file has the end of an MCAP file: the mcap crate's reader, which requires that end, reads every sample, and
/// hapt's own reports that its writer has not finished it.
#[test]
fn a_recording_is_a_complete_file_at_every_moment_and_unfinished_until_it_is_finished() {
    let messages = |path: &Path| -> Option<usize> {
        let bytes = std::fs::read(path).unwrap();
        mcap::MessageStream::new(&bytes)
            .ok()?
            .map(|message| message.ok())
            .collect::<Option<Vec<_>>>()
            .map(|all| all.len())
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.mcap");
    let recorder = Recorder::start(&path, &world(WHEEL), header(WHEEL)).unwrap();
    assert_eq!(messages(&path), Some(0));
    // More than a chunk, then a few more samples.
    let mut sent = 0;
    for more in [5000, 7, 3] {
        for sample in sent..sent + more {
            assert!(recorder.send(&record(sample)));
        }
        sent += more;
        while recorder.state().written < sent {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(messages(&path), Some(sent as usize));
        let mut log = Log::open(&path).unwrap();
        let mut count = 0;
        while log.next().unwrap().is_some() {
            count += 1;
        }
        assert_eq!(count, sent);
        assert!(matches!(log.ending(), Ending::Cut(_)), "{}", log.ending());
    }
    recorder.finish().unwrap();
    assert_eq!(messages(&path), Some(sent as usize));
    let mut log = Log::open(&path).unwrap();
    while log.next().unwrap().is_some() {}
    assert_eq!(*log.ending(), Ending::Whole);
    // The index is the writer's own, and it overwrites the provisional end.
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, sent);
}
