//! The measures of a cell.

use std::cell::OnceCell;
use std::ops::ControlFlow;

use hapt_analysis::{
    NetworkCheck, Verdict, check_network, free_growth, held_world_growth, is_certified, required_damping, sign,
};
use hapt_model::{Motion, Scenario, System, World};
use hapt_sim::{Outcome, Run, Simulation, Summary, SystemSummary};

use super::Stop;

hapt_model::named! {
    /// A number of a world, or of a run of it.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Measure {
        /// The largest |torque| over the rows, before the limit.
        PeakTorque => "peak_torque",
        /// The energy stored in the world at the last row.
        FinalEnergy => "final_energy",
        /// Time from the hand's last event until all motion stays within 2 % of its final value.
        SettlingTime => "settling_time",
        /// Growth of the world with the puck held.
        HeldGrowth => "held_growth_per_s",
        /// Growth of the whole loop, with the puck free.
        FreeGrowth => "free_growth_per_s",
        /// The verdict on the world with the puck held: -1 stable, 0 marginal, 1 unstable.
        HeldVerdict => "held_verdict",
        /// The verdict on the whole loop, with the puck free.
        FreeVerdict => "free_verdict",
        /// The least device damping that makes the loop passive.
        RequiredDamping => "required_damping",
        /// 1 for a certified loop, or network, else 0.
        Certified => "certified",
        /// Of a network: the largest net energy that all hands together have drawn from it.
        EnergyDrawn => "energy_drawn",
        /// Of a network: the number of releases of link ends.
        Releases => "let_go",
        /// Of a network: the smallest difference between a device's damping and the required one.
        DampingMargin => "damping_margin",
        /// Of a network: the largest factor on the stiffness of all links with which it is passive.
        StiffnessScale => "stiffness_scale",
        /// Of a network: 1 where it is passive at fixed times, 0 where not.
        FixedPassive => "fixed_passive",
    }
}

impl Measure {
    /// Its meaning, in one line.
    pub const fn meaning(self) -> &'static str {
        match self {
            Measure::PeakTorque => "the largest torque of the run, of any station, before the motor's limit",
            Measure::FinalEnergy => "the energy stored in the world at the run's end",
            Measure::SettlingTime => "from the hand's last event until the motion stays within 2 % of its end",
            Measure::HeldGrowth => "the growth of a disturbance of the world, the puck held",
            Measure::FreeGrowth => "the growth of a disturbance of the whole loop, no hand on the puck",
            Measure::HeldVerdict => "the world, the puck held: -1 stable, 0 marginal, 1 unstable",
            Measure::FreeVerdict => "the whole loop, no hand on the puck: -1 stable, 0 marginal, 1 unstable",
            Measure::RequiredDamping => "the least device damping that makes the loop passive",
            Measure::Certified => "1 for a certified loop, or network, else 0",
            Measure::EnergyDrawn => "of a network: the most energy that all hands have had from it at any instant",
            Measure::Releases => "of a network: how often ends of its links let go",
            Measure::DampingMargin => "of a network: the least damping of a device beyond what is required of it",
            Measure::StiffnessScale => "of a network: the largest factor on all its links with which it is passive",
            Measure::FixedPassive => "of a network: 1 for passive at fixed times, 0 for not, none without a verdict",
        }
    }

    /// Its unit in SI; empty for a plain number.
    pub const fn unit(self, motion: Motion) -> &'static str {
        match (self, motion) {
            (Measure::PeakTorque, Motion::Rotary) => "N m",
            (Measure::PeakTorque, Motion::Linear) => "N",
            (Measure::FinalEnergy | Measure::EnergyDrawn, _) => "J",
            (Measure::SettlingTime, _) => "s",
            (Measure::HeldGrowth | Measure::FreeGrowth, _) => "1/s",
            (Measure::RequiredDamping | Measure::DampingMargin, Motion::Rotary) => "N m s/rad",
            (Measure::RequiredDamping | Measure::DampingMargin, Motion::Linear) => "N s/m",
            (Measure::HeldVerdict | Measure::FreeVerdict | Measure::Certified, _)
            | (Measure::Releases | Measure::StiffnessScale | Measure::FixedPassive, _) => "",
        }
    }

    /// Those of a world, or of a network.
    pub fn of(system: &System) -> impl Iterator<Item = Measure> + Clone {
        let is_network = system.world().is_none();
        Measure::ALL.into_iter().filter(move |measure| match measure {
            Measure::PeakTorque | Measure::Certified => true,
            Measure::FinalEnergy
            | Measure::SettlingTime
            | Measure::HeldGrowth
            | Measure::FreeGrowth
            | Measure::HeldVerdict
            | Measure::FreeVerdict
            | Measure::RequiredDamping => !is_network,
            Measure::EnergyDrawn
            | Measure::Releases
            | Measure::DampingMargin
            | Measure::StiffnessScale
            | Measure::FixedPassive => is_network,
        })
    }

    /// Whether the key of this dotted path can change it. A run and a network depend on every key; measures of a loop do not depend on a
    /// scenario or on initial states of bodies, and only `certified` depends on the encoder. Compensations follow the device. With the puck
    /// held a loop does not depend on device, delay and estimator; with a handle held it does.
    pub(crate) fn depends_on(self, key: &str, system: &System) -> bool {
        let Some(world) = system.world() else { return true };
        let has_handle = world.device.handle.is_some();
        let is_held = matches!(self, Measure::HeldGrowth | Measure::HeldVerdict);
        if key.starts_with("compensation.") || (key.starts_with("device.") && !world.compensations.is_empty()) {
            return has_handle || !is_held;
        }
        if key.starts_with("device.handle.") {
            return self != Measure::RequiredDamping;
        }
        if key.starts_with("device.gravity.") || key.starts_with("device.cogging.") {
            return self != Measure::RequiredDamping && (has_handle || !is_held);
        }
        let of_losses = ["device.friction_by_position.", "device.stribeck.", "device.stops."];
        if of_losses.iter().any(|table| key.starts_with(table)) {
            return matches!(self, Measure::Certified) || self.of_a_run();
        }
        let mut names = key.split('.');
        let (table, last) = (names.next().unwrap_or_default(), names.next_back().unwrap_or_default());
        match self {
            Measure::PeakTorque
            | Measure::FinalEnergy
            | Measure::SettlingTime
            | Measure::EnergyDrawn
            | Measure::Releases
            | Measure::DampingMargin
            | Measure::StiffnessScale
            | Measure::FixedPassive => true,
            Measure::HeldGrowth | Measure::HeldVerdict if !has_handle => match table {
                "loop" => matches!(last, "period" | "bodies_every"),
                "bodies" => last == "inertia",
                table => table == "couplings",
            },
            Measure::HeldGrowth | Measure::HeldVerdict | Measure::FreeGrowth | Measure::FreeVerdict => {
                matches!((table, last), ("device", "inertia" | "damping")) || self.is_in_loop(table, last)
            }
            // The required damping does not depend on the device's damping.
            Measure::RequiredDamping => self.is_in_loop(table, last),
            Measure::Certified => matches!((table, last), ("device", _)) || self.is_in_loop(table, last),
        }
    }

    fn is_in_loop(self, table: &str, last: &str) -> bool {
        matches!((table, last), ("loop" | "couplings", _) | ("bodies", "inertia") | ("device", "lag"))
    }

    /// Whether it needs a run, and so a scenario.
    pub const fn of_a_run(self) -> bool {
        match self {
            Measure::PeakTorque
            | Measure::FinalEnergy
            | Measure::SettlingTime
            | Measure::EnergyDrawn
            | Measure::Releases => true,
            Measure::HeldGrowth
            | Measure::FreeGrowth
            | Measure::HeldVerdict
            | Measure::FreeVerdict
            | Measure::RequiredDamping
            | Measure::Certified
            | Measure::DampingMargin
            | Measure::StiffnessScale
            | Measure::FixedPassive => false,
        }
    }

    /// Its value for this system, for a measure of the loop; `None` where it does not exist, and for a measure of a run.
    pub fn of_the_loop(self, system: &System) -> Option<f64> {
        Checked::new(system, &|| false).value(self)
    }

    /// Whether it belongs to the loop with the puck held.
    pub(crate) const fn of_held_loop(self) -> bool {
        match self {
            Measure::HeldGrowth | Measure::HeldVerdict => true,
            Measure::PeakTorque
            | Measure::FinalEnergy
            | Measure::SettlingTime
            | Measure::FreeGrowth
            | Measure::FreeVerdict
            | Measure::RequiredDamping
            | Measure::Certified
            | Measure::EnergyDrawn
            | Measure::Releases
            | Measure::DampingMargin
            | Measure::StiffnessScale
            | Measure::FixedPassive => false,
        }
    }
}

/// All measures of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct OfRun {
    pub peak_torque: Option<f64>,
    pub final_energy: Option<f64>,
    pub settling_time: Option<f64>,
    pub energy_drawn: Option<f64>,
    pub releases: Option<f64>,
}

impl OfRun {
    /// The measures of a run in a lane; none for one that stops being finite.
    pub fn of(outcome: Option<Outcome>) -> Self {
        OfRun {
            peak_torque: outcome.map(|run| run.peak_torque),
            final_energy: outcome.map(|run| run.final_energy),
            ..OfRun::default()
        }
    }

    /// The value of a measure of a run; `None` of every other measure.
    pub fn value(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::PeakTorque => self.peak_torque,
            Measure::FinalEnergy => self.final_energy,
            Measure::SettlingTime => self.settling_time,
            Measure::EnergyDrawn => self.energy_drawn,
            Measure::Releases => self.releases,
            Measure::HeldGrowth
            | Measure::FreeGrowth
            | Measure::HeldVerdict
            | Measure::FreeVerdict
            | Measure::RequiredDamping
            | Measure::Certified
            | Measure::DampingMargin
            | Measure::StiffnessScale
            | Measure::FixedPassive => None,
        }
    }
}

/// Rows between two checks of the stop.
pub(crate) const STRETCH: u64 = 4096;

/// Runs scenario number `scenario` once; no measures of a run that cannot start, stops being finite or is stopped. The time of settling is
/// that of a world.
pub(crate) fn of_run(system: &System, scenario: usize, settling: bool, stop: &Stop<'_>) -> OfRun {
    let run = || -> Option<OfRun> {
        let name = *system.scenarios().get(scenario)?;
        let system = hapt_analysis::played(system, name).ok()?;
        let mut run = Run::new(&system, name).ok()?;
        let mut summary = SystemSummary::new(&system, &run);
        let settles = system.world().filter(|_| settling).zip(run.stations().next());
        let mut settling = settles.and_then(|(world, run)| Some(Settling::new(world, world.scenario(name).ok()?, run)));
        let mut rows = 0_u64;
        let ended = run.try_for_each(|row| {
            summary.add(row);
            if let Some(settling) = &mut settling {
                settling.add(row.row.time, row.row.puck, &row.row.bodies);
            }
            rows += 1;
            match rows.is_multiple_of(STRETCH) && stop() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        if ended.ok()?.is_break() {
            return None;
        }
        Some(OfRun {
            peak_torque: Some(summary.peak_torque()),
            final_energy: summary.stations.first().map(Summary::final_energy),
            settling_time: settling.and_then(|settling| settling.time()),
            energy_drawn: Some((summary.drawn - summary.blur()).max(0.0)),
            releases: Some(run.releases().flatten().sum::<u64>() as f64),
        })
    };
    run().unwrap_or_default()
}

/// A system whose measures of the loop are computed; those of a network are in one certificate.
pub(crate) struct Checked<'s> {
    pub system: &'s System,
    stop: &'s Stop<'s>,
    check: OnceCell<Option<NetworkCheck>>,
}

impl<'s> Checked<'s> {
    pub fn new(system: &'s System, stop: &'s Stop<'s>) -> Self {
        Checked { system, stop, check: OnceCell::new() }
    }

    fn check(&self) -> Option<&NetworkCheck> {
        let check = || if (self.stop)() { None } else { check_network(self.system).ok() };
        self.check.get_or_init(check).as_ref()
    }

    /// A measure of the loop; `None` where it does not exist or cannot be computed.
    pub fn value(&self, measure: Measure) -> Option<f64> {
        let number = |is: bool| f64::from(u8::from(is));
        let world = self.system.world();
        match measure {
            Measure::HeldGrowth => held_world_growth(world?).ok().flatten(),
            Measure::FreeGrowth => free_growth(world?).ok().flatten(),
            Measure::HeldVerdict => held_world_growth(world?).ok().map(Verdict::of).map(sign),
            Measure::FreeVerdict => free_growth(world?).ok().map(Verdict::of).map(sign),
            Measure::RequiredDamping => required_damping(world?).ok().flatten(),
            Measure::Certified => match world {
                Some(world) => Some(number(is_certified(world))),
                None => Some(number(self.check()?.certified)),
            },
            Measure::DampingMargin => {
                let stations = self.check()?.stations.iter();
                let margins = stations.map(|station| Some(station.device_damping - station.required_damping?));
                margins.collect::<Option<Vec<f64>>>()?.into_iter().min_by(f64::total_cmp)
            }
            Measure::StiffnessScale => self.check()?.remedies.as_ref()?.stiffness_scale,
            Measure::FixedPassive => self.check()?.fixed.passive.map(number),
            Measure::PeakTorque
            | Measure::FinalEnergy
            | Measure::SettlingTime
            | Measure::EnergyDrawn
            | Measure::Releases => None,
        }
    }
}

/// The first row from which on all motion stays within 2 % of its largest distance from its final value.
struct Settling {
    /// The hand's last event.
    from: f64,
    duration: f64,
    /// Whether the hand holds the puck to the end, so that the bodies' motion counts.
    held: bool,
    times: Vec<f64>,
    /// One series for each moving part, over the times.
    tracks: Vec<Vec<f64>>,
}

/// The settling band.
const BAND: f64 = 0.02;

impl Settling {
    fn new(world: &World, scenario: &Scenario, run: &Simulation) -> Self {
        let held = run.is_held_at(scenario.duration);
        let tracks = if held { world.bodies.len() } else { 1 };
        Settling {
            from: run.last_event(),
            duration: scenario.duration,
            held,
            times: Vec::new(),
            tracks: vec![Vec::new(); tracks],
        }
    }

    fn add(&mut self, time: f64, puck: f64, bodies: &[(f64, f64)]) {
        // An event within 1e-6 of a sample is that sample; rounding of k·T is far less.
        if time < self.from * (1.0 - 1e-12) {
            return;
        }
        self.times.push(time);
        if self.held {
            self.tracks.iter_mut().zip(bodies).for_each(|(track, body)| track.push(body.0));
        } else if let Some(track) = self.tracks.first_mut() {
            track.push(puck);
        }
    }

    fn time(&self) -> Option<f64> {
        // The run has no motion after the event.
        if self.from >= self.duration {
            return None;
        }
        let mut settled = self.from;
        for track in &self.tracks {
            let last = *track.last()?;
            let largest = track.iter().map(|x| (x - last).abs()).fold(0.0, f64::max);
            if largest == 0.0 {
                continue;
            }
            // The row after the last one outside of the band; the last row of all is within it.
            let outside = track.iter().rposition(|x| (x - last).abs() > BAND * largest);
            let row = outside.map_or(0, |row| row + 1);
            settled = settled.max(*self.times.get(row)?);
        }
        if self.tracks.iter().all(|track| track.iter().all(|x| Some(x) == track.last())) {
            return Some(0.0);
        }
        (settled <= 0.9 * self.duration).then_some(settled - self.from)
    }
}
