//! A log that begins anywhere in a loop's run, and continues after a gap: with the loop's state its replay is bit-identical.

use crate::common::{WHEEL, header, world, worlds};
use hapt_core::{Reason, Request, SafetyProfile, WhenLate};
use hapt_log::{Error, Header, Log, LogWriter, Origin, Replay, replay};
use hapt_model::{Delay, World};
use hapt_rt::{
    Change, Cycle, Device, Failure, HandCommand, Hands, Moment, Plan, Position, Record, SimulatedDevice, Snapshot,
};
use hapt_sim::Grip;
use hapt_testing::prelude::*;

/// The number of samples of a run.
const RUN_SAMPLES: u64 = 700;

/// A simulated device whose encoder occasionally has an error.
struct Glitching {
    device: SimulatedDevice,
    sample: u64,
    glitches: Vec<(u64, f64)>,
}

impl Device for Glitching {
    fn read(&mut self) -> Result<Position, Failure> {
        let mut position = self.device.read()?;
        let glitch = self.glitches.iter().find(|(sample, _)| *sample == self.sample);
        position.position += glitch.map_or(0.0, |(_, by)| *by);
        Ok(position)
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.device.write(torque)
    }

    fn passed(&mut self, periods: u32) {
        self.sample += u64::from(periods);
        self.device.passed(periods);
    }

    fn adopt(&mut self, plan: &mut Plan) {
        self.device.adopt(plan);
    }
}

/// An event of a loop.
#[derive(Clone, Copy, Debug)]
enum Event {
    Ask(Request),
    Hand(Option<f64>),
    /// To the world of this number, in this way.
    Swap(usize, Change),
    Glitch(f64),
    Miss(u32),
    Late(f64),
    /// The delay of the sample's command, in ns.
    Command(u32),
    Silence(f64),
}

fn events() -> impl Strategy<Value = Vec<(u64, Event)>> {
    let request =
        prop::sample::select(vec![Request::Arm, Request::Arm, Request::Disarm, Request::Clear, Request::Stop]);
    let event = prop_oneof![
        3 => request.prop_map(Event::Ask),
        4 => prop::option::weighted(0.8, -1.0..1.0).prop_map(Event::Hand),
        3 => (0usize..3, prop::sample::select(vec![Change::Follows, Change::Enters])).prop_map(|(to, change)| Event::Swap(to, change)),
        1 => prop::sample::select(vec![f64::NAN, 50.0, 1e-3]).prop_map(Event::Glitch),
        1 => (1u32..4).prop_map(Event::Miss),
        1 => (0.0..0.05).prop_map(Event::Late),
        1 => (0.0..1e-3).prop_map(Event::Late),
        1 => (0u32..2_000_000).prop_map(Event::Command),
        1 => (0.0..1.0).prop_map(Event::Silence),
    ];
    prop::collection::vec((20..RUN_SAMPLES, event), 5..30)
}

/// A loop's records, and the snapshots before some of them.
struct Life {
    worlds: Vec<World>,
    /// The index of the world of each plan, and how it replaced the last one, by the plan's number.
    plans: Vec<(usize, Change)>,
    records: Vec<Record>,
    snapshots: Vec<Snapshot>,
}

fn hand(hands: &mut Hands, to: Option<f64>, held: &mut bool) {
    let touch = match to {
        None => HandCommand::Release,
        Some(_) if !*held => HandCommand::Grab(Grip { inertia: 1e-4, damping: 0.02, stiffness: 3.0 }),
        Some(position) => HandCommand::Move(position),
    };
    *held = to.is_some();
    hands.push(touch).unwrap();
}

/// A world that states samples a third of a period late, and commands half a period late.
fn timed((mut world, when_late): (World, WhenLate)) -> World {
    let period = world.sampling.period;
    world.sampling.interval_max = Some(1.33 * period);
    world.sampling.delay_max = Some(Delay::Seconds(world.sampling.delay_s() + 0.5 * period));
    world.safety.late = Some(when_late);
    world
}

/// Runs a loop with these events, with a snapshot before each sample of `taken`.
fn live(texts: &[String], profile: SafetyProfile, events: &[(u64, Event)], taken: &[u64]) -> Life {
    let worlds: Vec<World> = texts.iter().map(|text| world(text)).zip(WhenLate::ALL).map(timed).collect();
    let (device, mut hands) = SimulatedDevice::new(&worlds[0]);
    let glitches = events.iter().filter_map(|&(at, event)| match event {
        Event::Glitch(by) => Some((at, by)),
        _ => None,
    });
    let device = Glitching { device, sample: 0, glitches: glitches.collect() };
    let mut plan = Plan::new(&worlds[0], profile).unwrap();
    let mut cycle = Cycle::new(Box::new(plan.clone()), Box::new(device));
    let (mut records, mut snapshots, mut plans) = (Vec::<Record>::new(), Vec::new(), vec![(0, Change::Follows)]);
    let (mut held, mut k) = (false, 0);
    while k < RUN_SAMPLES {
        let mut moment = Moment { periods: u32::from(k > 0), ..Moment::default() };
        let (mut request, mut swap, mut delay) = ((k == 10).then_some(Request::Arm), None, 0);
        for (_, event) in events.iter().filter(|(at, _)| *at == k) {
            match *event {
                Event::Ask(what) => request = Some(what),
                Event::Hand(to) => hand(&mut hands, to, &mut held),
                Event::Swap(to, change) => swap = Some((to, change)),
                Event::Glitch(_) => {}
                Event::Miss(missed) => moment.periods += missed,
                Event::Late(late) => moment.late = late,
                Event::Command(late) => delay = late,
                Event::Silence(silent) => moment.silent = silent,
            }
        }
        cycle.pass(moment.periods);
        if let Some((to, change)) = swap {
            plan = Plan::replacing(&worlds[to], &plan, change).unwrap();
            cycle.swap(Box::new(plan.clone()));
            plans.push((to, change));
        }
        if taken.contains(&k) {
            let mut snapshot = Snapshot::EMPTY;
            cycle.snapshot(&mut snapshot);
            snapshots.push(snapshot);
        }
        // The loop may diverge: then it has ended.
        let Ok(mut record) = cycle.sample(&moment, request) else { break };
        record.computation = delay;
        cycle.commanded(delay);
        records.push(record);
        k += 1;
    }
    Life { worlds, plans, records, snapshots }
}

impl Life {
    /// The log of some of the records, with the snapshots before them.
    fn log(&self, profile: SafetyProfile, records: impl Iterator<Item = usize>) -> Vec<u8> {
        let mut writer: Option<LogWriter<Vec<u8>>> = None;
        for record in records.filter_map(|at| self.records.get(at)) {
            let (world, change) = self.plans[record.plan as usize];
            let world = &self.worlds[world];
            let writer = writer.get_or_insert_with(|| {
                let header = Header { profile, plan: record.plan, ..header("") };
                LogWriter::new(Vec::new(), world, &header, Origin::Live(0)).unwrap()
            });
            if writer.plan() != record.plan {
                writer.begin_at(record.sample, record.plan, world, change).unwrap();
            }
            let snapshot = self.snapshots.iter().find(|snapshot| snapshot.sample == record.sample);
            writer.write_record(record, snapshot).unwrap();
        }
        writer.unwrap().finish().unwrap()
    }
}

fn replayed(bytes: &[u8]) -> Replay {
    replay(&mut Log::read(bytes).unwrap()).unwrap()
}

proptest! {
    #![proptest_config(hapt_testing::cases(96))]

    #[test]
    fn a_replay_begins_at_any_snapshot_and_continues_after_a_gap(
        texts in prop::collection::vec(worlds(), 3),
        profile in prop::sample::select(SafetyProfile::ALL.to_vec()),
        events in events(),
        begin in 0..RUN_SAMPLES - 200,
        gap in 1usize..60,
        late in 0usize..30,
    ) {
        let (from, lost) = (begin as usize, begin as usize + 50);
        let again = lost + gap + late;
        let life = live(&texts, profile, &events, &[begin, again as u64]);
        prop_assume!(life.records.len() > again + 20);
        let all = life.records.len() - from;
        let whole = replayed(&life.log(profile, from..life.records.len()));
        prop_assert_eq!((whole.compared, whole.skipped, whole.gaps), (all as u64, 0, 0), "{:?}", whole);
        prop_assert_eq!(whole.first, None);

        let gone = replayed(&life.log(profile, (from..life.records.len()).filter(|at| !(lost..lost + gap).contains(at))));
        prop_assert_eq!((gone.compared, gone.skipped, gone.gaps), ((all - gap - late) as u64, late as u64, 1), "{:?}", gone);
        prop_assert_eq!(gone.first, None);
    }

    /// The replay uses the state: with one changed bit the torques differ.
    #[test]
    fn a_replay_from_a_changed_snapshot_differs(bit in 30u32..52) {
        let texts = vec![WHEEL.to_string()];
        let mut life = live(&texts, SafetyProfile::Simulated, &[(20, Event::Hand(Some(0.0))), (22, Event::Hand(Some(0.5)))], &[300]);
        let place = &mut life.snapshots[0].state.world.now.position[0];
        *place = f64::from_bits(place.to_bits() ^ (1 << bit));
        let again = replayed(&life.log(SafetyProfile::Simulated, 300..700));
        prop_assert!(again.different > 100 && again.first.unwrap().sample == 300);
    }
}

#[test]
fn the_runs_contain_faults_swaps_and_torques() {
    // A check of the strategy above, which the tests rely on.
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let strategy = (prop::collection::vec(worlds(), 3), events());
    let (mut torques, mut reasons, mut plans) = (0, std::collections::BTreeSet::new(), 0);
    for _ in 0..60 {
        let (texts, events) = strategy.new_tree(&mut runner).unwrap().current();
        let life = live(&texts, SafetyProfile::Certified, &events, &[]);
        torques += life.records.iter().filter(|record| record.output != 0.0).count();
        reasons.extend(life.records.iter().filter_map(|record| record.reason.map(Reason::code)));
        plans += life.plans.len() - 1;
    }
    assert!(torques > 5_000 && reasons.len() >= 5 && plans > 60, "{torques} {reasons:?} {plans}");
    assert!(reasons.contains(&Reason::Uneven.code()), "{reasons:?}");
}

#[test]
fn a_log_copied_sample_by_sample_keeps_its_snapshots() {
    let texts = vec![WHEEL.to_string()];
    let life = live(&texts, SafetyProfile::Simulated, &[(20, Event::Hand(Some(0.0)))], &[200, 400]);
    let bytes = life.log(SafetyProfile::Simulated, 200..500);
    let mut log = Log::read(&bytes[..]).unwrap();
    let mut copy = LogWriter::new(Vec::new(), &life.worlds[0], &log.header.clone(), log.origin).unwrap();
    let mut found = Vec::new();
    while let Some(sample) = log.next().unwrap() {
        found.extend(sample.snapshot.cloned());
        copy.write_sample(&sample).unwrap();
    }
    assert_eq!(found, life.snapshots);
    assert!(copy.finish().unwrap() == bytes);
}

/// A log with a state of another version is read as one without.
#[test]
fn a_state_of_another_version_is_ignored() {
    let texts = vec![WHEEL.to_string()];
    let life = live(&texts, SafetyProfile::Simulated, &[], &[200]);
    let mut bytes = life.log(SafetyProfile::Simulated, 200..300);
    assert_eq!(replayed(&bytes).compared, 100);
    let name = b"state-200";
    let at = bytes.windows(name.len()).position(|window| window == name).unwrap();
    // After its name: its media type, and the length of its content.
    let data = at + name.len() + 4 + "application/octet-stream".len() + 8;
    assert_eq!(bytes[data], 6);
    let length = u64::from_le_bytes(bytes[data - 8..data].try_into().unwrap()) as usize;
    bytes[data] = 1;
    // 0: no checksum.
    bytes[data + length..data + length + 4].fill(0);
    let mut log = Log::read(&bytes[..]).unwrap();
    assert!(log.next().unwrap().unwrap().snapshot.is_none());
    let refused = replay(&mut Log::read(&bytes[..]).unwrap()).err().unwrap();
    assert!(matches!(refused, Error::NoReplay(_)) && refused.to_string().contains("100 samples"), "{refused}");
}
