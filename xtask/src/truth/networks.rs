//! Networks of stations against brute force: hands at all of them, clocks, delays and losses of every kind.

use std::ops::AddAssign;

use fastrand::Rng;
use hapt_analysis::{Error, NetworkCheck, check_network};
use hapt_model::{Source, System};
use hapt_sim::{Run, SystemSummary};

use super::{Against, Claim, Counts, JUST, ROUNDING, numbers};

/// The scenario of all hands.
const SCENARIO: &str = "all";
/// Parts of the damping that is called enough at which hands are tried too.
const PARTS: [f64; 4] = [0.9, 0.7, 0.5, 0.3];

/// The results of hands on the networks of one verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Judged {
    /// At the damping that is called enough; slow where a link released.
    pub claim: Claim,
    /// Broken at parts of it.
    broken: [u64; PARTS.len()],
}

impl AddAssign for Judged {
    fn add_assign(&mut self, other: Self) {
        self.claim += other.claim;
        for (sum, more) in self.broken.iter_mut().zip(other.broken) {
            *sum += more;
        }
    }
}

/// Points of a motion that begins when all links are connected: steps here and there, or a sine.
fn path(rng: &mut Rng, size: f64) -> String {
    let mut text = String::from("0,0\n0.3,0\n");
    let (mut time, frequency, is_sine) = (0.3, 0.3 * 100f64.powf(rng.f64()), rng.bool());
    while time < 3.0 {
        let from = time;
        time += if is_sine { 2e-3 } else { 0.2 * rng.f64() + 1e-3 };
        let angle = std::f64::consts::TAU * frequency * (from - 0.3);
        let value = size * if is_sine { angle.sin() } else { rng.f64() - 0.5 };
        text += &format!("{time},{value}\n");
    }
    text
}

/// How the times of a network are drawn.
#[derive(Clone, Copy, PartialEq)]
enum Times {
    /// Clocks that share no instant and drift.
    Own,
    /// Periods with common multiples, at which all stations take a sample.
    Common,
    /// The same, and messages that all have their exact delay and all arrive.
    Exact,
}

/// A network of `n` stations with random devices, clocks, links and hands; `None` where the reader refuses it.
fn random(rng: &mut Rng, n: usize, times: Times) -> Option<System> {
    let mut source = Source::from_text("network.toml", "");
    let base = 1e-3;
    let (common, exact) = (times != Times::Own, times == Times::Exact);
    let mut text = String::new();
    // The proof of a link's damping is of these estimators (T64).
    let damped = !exact && rng.bool();
    for i in 0..n {
        let period = if common { base * f64::from(1 << rng.u8(..3)) } else { base * (0.7 + 2.0 * rng.f64()) };
        let delay = if rng.bool() { 0.0 } else { period * rng.f64() };
        let phase = if times == Times::Common || exact && rng.bool() { 0.0 } else { period * rng.f64() };
        let lag = if rng.u8(..4) == 0 && !exact { period * rng.f64() } else { 0.0 };
        let estimator = match (damped, rng.bool()) {
            (false, _) => "",
            (true, false) => ", estimator = \"difference\"",
            (true, true) => ", estimator = \"low-pass\", cutoff = 60",
        };
        let mut world = format!(
            "loop = {{ period = {period}, delay = {delay}{estimator} }}\ndevice = {{ inertia = {}, lag = {lag} }}\n",
            1e-4 * 30f64.powf(rng.f64())
        );
        if rng.bool() {
            world += &format!(
                "[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {}\n",
                rng.f64()
            );
        }
        let moves = rng.u8(..3) > 0;
        let (unit, size) = if moves { ("puck_rad", 0.3) } else { ("torque_Nm", 0.1) };
        source.files.insert(format!("h{i}.csv"), format!("time_s,{unit}\n{}", path(rng, size)));
        let shape = format!("{{ kind = \"path\", file = \"h{i}.csv\" }}");
        let hand = match (moves, rng.bool()) {
            (false, _) => format!("{{ kind = \"torque\", moves = {shape} }}"),
            (true, false) => shape,
            (true, true) => format!(
                "{{ kind = \"grip\", inertia = {}, damping = {}, stiffness = {}, moves = {shape} }}",
                1e-4 * 30f64.powf(rng.f64()),
                1e-3 * rng.f64(),
                2.0 * rng.f64(),
            ),
        };
        if rng.u8(..4) > 0 {
            world += &format!("[scenarios.{SCENARIO}]\nduration = 3\nhand = {hand}\n");
        }
        source.files.insert(format!("s{i}.toml"), world);
        let drift = if common || rng.bool() { 0.0 } else { 10_000.0 * (2.0 * rng.f64() - 1.0) };
        text += &format!("[stations.s{i}]\nworld = \"s{i}.toml\"\nphase = {phase}\ndrift = {drift}\n");
    }
    for i in 1..n {
        let other = rng.usize(..i);
        let law = match rng.u8(..4) {
            // Walls and limits are not proved at fixed times.
            0 | 1 if exact => "kind = \"spring\"".into(),
            0 => format!("kind = \"wall\"\nside = \"above\"\nat = {}", 0.1 * rng.f64()),
            1 => "kind = \"spring\"\nlimit = 0.02".into(),
            _ => "kind = \"spring\"".into(),
        };
        let delay_max = 10e-3 * rng.f64();
        // A link may have only stiffness or only damping.
        let stiffness = if damped && rng.u8(..4) == 0 { 0.0 } else { 0.01 * 100f64.powf(rng.f64()) };
        let damping = if damped && rng.u8(..4) > 0 { 1e-4 * 300f64.powf(rng.f64()) } else { 0.0 };
        let period = if damped && rng.bool() { "period = \"6 ms\"\n" } else { "" };
        text += &format!(
            "[[links]]\n{period}{law}\nbetween = [\"s{i}\", \"s{other}\"]\nstiffness = {stiffness}\ndamping = {damping}\ndelay = {}\ndelay_max = {delay_max}\nloss = {}\nduplicate = {}\nseed = {}\nage_max = {}\n",
            if exact { delay_max } else { delay_max * rng.f64() },
            if exact || rng.bool() { 0.0 } else { 0.5 * rng.f64() },
            if rng.bool() { 0.0 } else { rng.f64() },
            rng.u32(..),
            16e-3 + 30e-3 * rng.f64()
        );
    }
    source.text = text;
    System::read(&source, &[]).ok()
}

/// The energy that hands have drawn from a network.
struct Drawn {
    /// The most by any instant, J.
    drawn: f64,
    /// All the work exchanged, J.
    round: f64,
    /// The energy that may be missing between the samples of different stations, J.
    slack: f64,
    releases: u64,
    samples: u64,
}

fn drawn(network: &System) -> Drawn {
    let Ok(mut run) = Run::new(network, SCENARIO) else {
        return Drawn { drawn: 0.0, round: 0.0, slack: 0.0, releases: 0, samples: 0 };
    };
    let mut summary = SystemSummary::new(network, &run);
    let mut is_finite = true;
    while let Some(row) = run.next() {
        let Ok(row) = row else {
            // Hands on a diverging loop exchange unbounded energy.
            is_finite = false;
            break;
        };
        summary.add(&row);
    }
    Drawn {
        drawn: if is_finite { summary.drawn } else { f64::INFINITY },
        round: if is_finite { summary.exchanged } else { 1.0 },
        slack: summary.blur(),
        releases: run.releases().flatten().sum(),
        samples: summary.stations.iter().map(|station| station.rows).sum(),
    }
}

/// The network of number `i`, from a seed of its own.
pub fn one(seed: u64, i: u64, against: &Against) -> Counts {
    let mut found = Counts { loops: 1, ..Counts::default() };
    let mut report = |what: String| {
        if let Ok(mut against) = against.lock() {
            against.push(format!("network {i} of seed {seed}: {what}"));
        }
    };
    if judge(&mut numbers(seed, i), &mut found, &mut report).is_err() {
        found.unanswered += 1;
    }
    found
}

/// Judges and runs it. Errors where numbers are out of range.
fn judge(rng: &mut Rng, found: &mut Counts, report: &mut dyn FnMut(String)) -> Result<(), Error> {
    let n = 2 + (10.0 * rng.f64().powi(3)) as usize;
    let times = [Times::Own, Times::Common, Times::Common, Times::Exact][rng.usize(..4)];
    let Some(network) = random(rng, n, times).filter(|network| !network.scenarios().is_empty()) else {
        found.unanswered += 1;
        return Ok(());
    };
    let check = check_network(&network)?;
    let required: Vec<f64> = check.stations.iter().map(|of| of.required_damping.unwrap_or(0.0)).collect();
    let enough = |check: NetworkCheck| check.stations.iter().all(|station| station.passive);
    compare(&network, &required, enough, &mut found.networks[0], &mut found.samples, report)?;
    // A verdict that is open or not proved claims nothing.
    let fixed = check.fixed;
    let required: Option<Vec<f64>> = fixed.required_damping.iter().map(|(_, damping)| *damping).collect();
    let Some(required) = required.filter(|_| fixed.proved) else { return Ok(()) };
    let enough = |check: NetworkCheck| check.fixed.passive == Some(true);
    compare(&network, &required, enough, &mut found.networks[1], &mut found.samples, report)
}

/// Compares a verdict, by which dampings are `enough`, with hands on devices that have just these, and less.
fn compare(
    network: &System,
    required: &[f64],
    enough: impl Fn(NetworkCheck) -> bool,
    judged: &mut Judged,
    samples: &mut u64,
    report: &mut dyn FnMut(String),
) -> Result<(), Error> {
    let damped = |part: f64| {
        let mut network = network.clone();
        for (station, required) in network.stations.iter_mut().zip(required) {
            station.world.device.damping = required * part;
        }
        network
    };
    let just = damped(1.0 + JUST);
    if !enough(check_network(&just)?) {
        report("the damping that is called enough is not".into());
    }
    let run = drawn(&just);
    *samples += run.samples;
    if run.releases > 0 {
        // A link that reconnects adds the energy of its stretch.
        judged.claim += Claim { loops: 1, slow: 1, ..Claim::default() };
        return Ok(());
    }
    let holds = run.drawn <= ROUNDING * run.round + run.slack;
    if !holds {
        let n = network.stations.len();
        report(format!("{n} stations called passive, and their hands draw {:e} of {:e} J", run.drawn, run.round));
    }
    judged.claim += Claim { loops: 1, confirmed: u64::from(holds), slow: 0, contradicted: u64::from(!holds) };
    for (part, broken) in PARTS.iter().zip(&mut judged.broken) {
        let run = drawn(&damped(*part));
        *samples += run.samples;
        *broken += u64::from(run.drawn > 1e-3 * run.round);
    }
    Ok(())
}

/// The counts in Markdown.
pub fn table(found: &Counts, seed: u64) -> String {
    let [any, fixed] = &found.networks;
    let mut text = format!(
        "{} random networks of 2 to 11 stations (seed {seed}), {} samples; in {} a link let go, and they are not judged. \
         {} have fixed times and the second verdict ({} let go).\n\n\
         | part of the damping that is called enough | for any clocks | drew energy | at fixed times | drew energy |\n\
         | --- | --- | --- | --- | --- |\n",
        any.claim.loops, found.samples, any.claim.slow, fixed.claim.loops, fixed.claim.slow
    );
    let row = |part: f64, of: &dyn Fn(&Judged) -> u64| {
        let columns = found.networks.iter().map(|judged| {
            let loops = judged.claim.loops - judged.claim.slow;
            let broken = of(judged);
            format!(" {loops} | {broken} ({:.1} %) |", 100.0 * broken as f64 / loops.max(1) as f64)
        });
        format!("| {part} |{}\n", columns.collect::<String>())
    };
    text += &row(1.0, &|judged| judged.claim.contradicted);
    for (at, part) in PARTS.iter().enumerate() {
        text += &row(*part, &|judged| judged.broken[at]);
    }
    text
}
