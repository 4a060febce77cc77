//! The passive hands, one at each station, that draw most energy together from a network.
//!
//! The certificate of a network is for any clocks, any order and any loss within the links' ages. So the search runs the hands with the messages of
//! the file, and with messages as late as `age_max` allows. The hands are those of modes of the whole network ([`hands`]), from slow to fast, and
//! of a local search from the best; each is run on the exact devices, and its energy is that of the ledgers.

mod drawn;
mod hands;

use hapt_analysis::nelder_mead::maximise;
use hapt_analysis::{Demands, check_network};
use hapt_model::System;
use serde::{Serialize, Serializer};

use super::hand::Hand;
use super::search::{Error, Watch, go_on, stiffness};
use drawn::drawn_from_network;
use hands::{Mode, opposite, reach};

pub use drawn::DrawnFromNetwork;

/// ω times the largest age, of the modes that are always tried.
const ANGLES: [f64; 6] = [0.05, 0.12, 0.3, 0.6, 1.0, 1.6];
/// The stiffness of hands relative to that at the pucks.
const SHARES: [f64; 2] = [0.1, 0.4];
/// Periods of a run, and the smallest and the largest number of samples of one station.
const SWINGS: f64 = 12.0;
const SAMPLES: [f64; 2] = [2_000.0, 40_000.0];
/// The largest number of runs of the local search, and its range as a logarithm.
const CLIMB: usize = 24;
const FAR: f64 = 1.0;
/// The part of the required dampings with which hands are searched where none draws from the network itself.
const WEAK: f64 = 0.7;
/// The number of bisections for the damping up to which hands draw.
const HALVINGS: usize = 7;
/// The largest ages of messages as parts of `age_max`, tried in this order where a link releases with a larger one.
const LATE: [f64; 3] = [0.99, 0.9, 0.74];
/// The name of the scenario.
const NAME: &str = "worst";

/// The worst hands found for a network, in the form of `hapt worst --json`, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstOfNetwork {
    /// Whether the hands draw energy.
    pub broken: bool,
    /// Whether the network is certified.
    pub certified: bool,
    /// Whether the messages are as late as the links' `age_max` allows, instead of the file's delays.
    pub late: bool,
    /// In file order; serialised as a mapping by name.
    #[serde(serialize_with = "by_name")]
    pub stations: Vec<WorstStation>,
    /// The time at which the hands begin, s: links have connected by then.
    pub begins_s: f64,
    /// The frequency of the mode that they make, Hz.
    pub hz: f64,
    /// The energy that they drew.
    pub drawn: DrawnFromNetwork,
    /// The network of the run, with the scenario `worst` only.
    #[serde(skip)]
    pub network: System,
    /// The duration of that, s.
    pub duration_s: f64,
    /// The largest part of all required dampings at which such hands still draw; `None`: at no tried one.
    pub breaking_part: Option<f64>,
    /// The number of runs.
    pub runs: usize,
}

/// One station.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstStation {
    /// Its name.
    #[serde(skip)]
    pub name: String,
    /// Its hand; `None`: hands-off.
    pub hand: Option<Hand>,
    /// The damping that the certificate requires, where there is one, N·m·s/rad (linear: N·s/m).
    pub required_damping: Option<f64>,
    /// The device's, in the same unit.
    pub device_damping: f64,
}

fn by_name<S: Serializer>(stations: &[WorstStation], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(stations.iter().map(|station| (&station.name, station)))
}

/// A mode that was tried.
#[derive(Clone, Debug)]
struct Tried {
    mode: Mode,
    hands: Vec<Option<Hand>>,
    drawn: DrawnFromNetwork,
    network: System,
    duration: f64,
}

impl Tried {
    /// A gain ranks above any loss.
    fn height(&self) -> f64 {
        let DrawnFromNetwork { gain, exchanged, end, .. } = self.drawn;
        let part = |energy: f64| energy / exchanged.max(f64::MIN_POSITIVE);
        if self.drawn.is_gain() { 1.0 + part(gain) } else { part(end).min(0.0) }
    }
}

/// The runs of one network.
struct Trials<'w> {
    runs: usize,
    watch: &'w Watch<'w>,
    /// When hands begin, s.
    begins: f64,
    /// The stiffness at each puck that its own world has.
    own: Vec<f64>,
    reach: f64,
}

impl Trials<'_> {
    fn run(&mut self, network: &System, mode: Mode) -> Result<Tried, Error> {
        let shortest = network.stations.iter().map(|of| of.world.sampling.period).fold(f64::INFINITY, f64::min);
        let longest = network.stations.iter().map(|of| of.world.sampling.period).fold(0.0, f64::max);
        let [fewest, most] = SAMPLES.map(|samples| samples * shortest);
        let swings = (SWINGS * std::f64::consts::TAU / mode.angular).clamp(fewest, most);
        let duration = ((self.begins + swings) / longest).ceil() * longest;
        let hands = mode.hands(network, &self.own, self.reach);
        let mut network = network.clone();
        for (station, hand) in network.stations.iter_mut().zip(&hands) {
            station.world.scenarios = hand.iter().map(|hand| hand.scenario(NAME, duration, self.begins)).collect();
        }
        let had = hands.iter().flatten().map(Hand::energy).sum();
        let drawn = drawn_from_network(&network, NAME, self.begins, had)?;
        self.runs += 1;
        go_on(self.watch, self.runs)?;
        Ok(Tried { mode, hands, drawn, network, duration })
    }

    /// The best of modes from slow to fast, and of a local search from one that draws.
    fn best(&mut self, network: &System, shapes: &[Vec<f64>]) -> Result<Option<Tried>, Error> {
        let oldest = network.links.iter().map(|link| link.age_max).fold(0.0, f64::max);
        let mut best: Option<Tried> = None;
        let better =
            |best: &Option<Tried>, tried: &Tried| best.as_ref().is_none_or(|best| tried.height() > best.height());
        for shape in shapes {
            for angle in ANGLES {
                for share in SHARES {
                    let tried = self.run(network, Mode { shape: shape.clone(), angular: angle / oldest, share })?;
                    if better(&best, &tried) {
                        best = Some(tried);
                    }
                }
            }
        }
        let Some(from) = best.clone().filter(|best| best.drawn.is_gain()) else { return Ok(best) };
        let mut failed = None;
        maximise([0.0; 2], [0.3, 0.5], CLIMB, |x| {
            let of = |value: f64, x: f64| value * x.clamp(-FAR, FAR).exp();
            let Mode { shape, angular, share } = &from.mode;
            let mode = Mode { shape: shape.clone(), angular: of(*angular, x[0]), share: of(*share, x[1]) };
            match self.run(network, mode) {
                Ok(tried) => {
                    let height = tried.height();
                    if better(&best, &tried) {
                        best = Some(tried);
                    }
                    height
                }
                Err(error) => {
                    failed = Some(error);
                    f64::NEG_INFINITY
                }
            }
        });
        failed.map_or(Ok(best), Err)
    }
}

/// The same network without loss, and with the delay that makes positions at most `part` of their `age_max` old.
fn late(network: &System, part: f64) -> System {
    let mut late = network.clone();
    for (index, link) in late.links.iter_mut().enumerate() {
        let taken = [0, 1].map(|side| {
            let end = network.end(index, side);
            end.hold + end.period
        });
        let travel_time = part * link.age_max - taken[0].max(taken[1]);
        link.delay = travel_time.max(link.delay);
        (link.delay_max, link.loss, link.duplicate) = (None, 0.0, 0.0);
    }
    late
}

/// The largest number of runs of [`search_network`].
pub(super) const MAX_RUNS: usize = 3 * (2 * ANGLES.len() * SHARES.len() + CLIMB + 3) + LATE.len() + 1 + HALVINGS;

/// Searches for the passive hands that draw most energy together.
///
/// ```
/// use hapt_model::{System, Source};
/// use hapt_sweep::worst::search_network;
///
/// let mut source = Source::from_text("pair.toml", r#"
/// stations.left.world = "wheel.toml"
/// stations.right.world = "wheel.toml"
/// links = [{ kind = "spring", between = ["left", "right"], stiffness = 0.2, age_max = "30 ms" }]
/// "#);
/// source.files.insert("wheel.toml".into(), "loop.period = '1 ms'\ndevice = { inertia = 1e-3, damping = 0.004 }".into());
/// let worst = search_network(&System::read(&source, &[])?, &|_| std::ops::ControlFlow::Continue(()))?;
/// // K (T/2 + age_max) are 0.0061.
/// assert!(!worst.certified && worst.broken);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`].
pub fn search_network(network: &System, watch: &Watch<'_>) -> Result<WorstOfNetwork, Error> {
    for station in &network.stations {
        hapt_sim::check(&station.world)?;
    }
    let check = check_network(network)?;
    let oldest = network.links.iter().map(|link| link.age_max).fold(0.0, f64::max);
    let own = network.stations.iter().map(|station| stiffness(&station.world)).collect::<Result<Vec<_>, _>>()?;
    let longest = network.stations.iter().map(|of| of.world.sampling.period).fold(0.0, f64::max);
    let begins = (10.0 * oldest / longest).ceil() * longest;
    let mut trials = Trials { runs: 0, watch, begins, own, reach: reach(network) };
    let signs = opposite(network);
    let shapes = shapes(network, &signs)?;

    let file = trials.best(network, &shapes)?;
    let mut latest = late(network, LATE[0]);
    for part in LATE {
        latest = late(network, part);
        let angular = ANGLES[2] / oldest;
        if trials.run(&latest, Mode { shape: signs.clone(), angular, share: SHARES[1] })?.drawn.let_go == 0 {
            break;
        }
    }
    let last = trials.best(&latest, &shapes)?;
    let required: Option<Vec<f64>> = check.stations.iter().map(|station| station.required_damping).collect();
    let gains = |tried: &Option<Tried>| tried.as_ref().is_some_and(|tried| tried.drawn.is_gain());
    // The hands draw with the file's own messages, but not with later ones.
    let is_late = !gains(&file) && last.is_some();
    let mut best = if is_late { last } else { file };
    if let Some(required) = required.as_ref().filter(|_| !gains(&best)) {
        // The hands that draw at the smallest reduction of the damping.
        let weak = trials.best(&damped(&latest, required, WEAK), &shapes)?;
        if let Some(weak) = weak.filter(|weak| weak.drawn.is_gain()) {
            best = Some(trials.run(&latest, weak.mode)?);
        }
    }
    let Some(best) = best else { return Err(Error::Linear(hapt_analysis::Error::Eigenvalues { order: 0 })) };
    let breaking_part = breaking(&mut trials, &latest, required.as_deref(), &best.mode)?;
    let stations = check.stations.iter().zip(best.hands).map(|(of, hand)| WorstStation {
        name: of.name.clone(),
        hand,
        required_damping: of.required_damping,
        device_damping: of.device_damping,
    });
    Ok(WorstOfNetwork {
        certified: check.certified,
        broken: best.drawn.is_gain(),
        late: is_late,
        hz: best.mode.angular / std::f64::consts::TAU,
        begins_s: begins,
        drawn: best.drawn,
        network: best.network,
        duration_s: best.duration,
        stations: stations.collect(),
        breaking_part,
        runs: trials.runs,
    })
}

/// The mode shapes that are tried: equal amplitudes, and those of the network's matrix.
fn shapes(network: &System, signs: &[f64]) -> Result<Vec<Vec<f64>>, Error> {
    let mut shapes = vec![signs.to_vec()];
    if let Some(favoured) = Demands::of(network)?.favoured(network)? {
        let most = favoured.iter().copied().fold(0.0, f64::max);
        let shape: Vec<f64> = favoured.iter().zip(signs).map(|(x, sign)| sign * (x / most).max(0.05)).collect();
        if shape.iter().zip(signs).any(|(x, sign)| (x - sign).abs() > 0.1) {
            shapes.push(shape);
        }
    }
    Ok(shapes)
}

/// The same network with devices that have this part of the required dampings.
fn damped(network: &System, required: &[f64], part: f64) -> System {
    let mut damped = network.clone();
    for (station, required) in damped.stations.iter_mut().zip(required) {
        station.world.device.damping = part * required;
    }
    damped
}

/// The largest part of the required dampings at which the hands of a mode draw, by bisection; `None` where they draw at none.
fn breaking(
    trials: &mut Trials<'_>,
    network: &System,
    required: Option<&[f64]>,
    mode: &Mode,
) -> Result<Option<f64>, Error> {
    let Some(required) = required else { return Ok(None) };
    let (mut low, mut high, mut found) = (0.0, 1.0, None);
    for _ in 0..HALVINGS {
        let part = 0.5 * (low + high);
        if trials.run(&damped(network, required, part), mode.clone())?.drawn.is_gain() {
            (low, found) = (part, Some(part));
        } else {
            high = part;
        }
    }
    Ok(found)
}
