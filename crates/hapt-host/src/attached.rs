//! An attached motor: the file's `[device]` and `[safety]` are ceilings for the whole session.
//!
//! The certificate always applies to the file's device, and no limit of the supervisor exceeds the file's, derived limits included.

use hapt_core::{Limits, SafetyProfile};
use hapt_model::{EstimatorKind, Safety, World};
use hapt_sim::{DesktopSupervisor, Measures};

use crate::keys::SettableKey;

/// The keys of `[loop]` that may be set with a motor: they describe the program. The others describe the hardware.
const SETTABLE: [&str; 11] = [
    "period",
    "method",
    "output",
    "advance",
    "bodies_every",
    "filter",
    "estimator",
    "cutoff",
    "acceleration",
    "every",
    "window",
];

/// The file's device and its limits.
#[derive(Clone, Debug)]
pub(crate) struct Attached {
    /// The world of the file with its limits written out, so that they do not follow later changes.
    file: World,
    profile: SafetyProfile,
    /// The torque of the sign test, in N·m (linear: N); a lower limit would skip the test.
    pulse: f64,
    /// Whether the supervisor tests the sign, and accounts for the energy at the puck.
    monitors: [bool; 2],
}

impl Attached {
    /// The limits of this world's file.
    ///
    /// # Errors
    /// In a sentence: the core does not take the world.
    pub fn new(world: &World, profile: SafetyProfile) -> Result<Self, String> {
        let limits = world.limits(profile);
        let file = World { safety: written_out(&world.safety, &limits, profile), ..world.clone() };
        let monitors = monitors(&file, profile)?;
        Ok(Attached { file, profile, pulse: limits.pulse, monitors })
    }

    /// Whether the key can be set.
    pub fn allows(&self, path: &str) -> bool {
        match path.split_once('.') {
            Some(("loop", name)) => SETTABLE.contains(&name),
            Some(("device", name)) => name == "limit",
            Some(("bodies" | "couplings", _)) => true,
            _ => false,
        }
    }

    /// The message for a key that cannot be set.
    pub fn refusal(&self, path: &str) -> String {
        format!(
            "{path}: cannot be set with a motor attached, as it describes the hardware or its protection; end hapt live, change the file, and start \
             it again"
        )
    }

    /// Marks a key as fixed, or limits its range to the file's value.
    pub fn bound(&self, key: &mut SettableKey) {
        key.fixed = !self.allows(&key.path);
        if let (false, "device.limit", Some(limit)) = (key.fixed, key.path.as_str(), self.file.device.limit) {
            key.max = limit;
            key.min = key.min.max(self.pulse).min(0.5 * limit);
        }
    }

    /// Applies the file's limits to a changed world.
    ///
    /// # Errors
    /// In a sentence: the change that would exceed them.
    pub fn hold(&self, world: &mut World) -> Result<(), String> {
        let file = &self.file;
        world.safety.clone_from(&file.safety);
        if world.sampling.estimator == EstimatorKind::Exact {
            return Err("loop.estimator: an encoder gives no true velocity; take \"difference\", or a filter".into());
        }
        let mut device = world.device.clone();
        let requested = std::mem::replace(&mut device.limit, file.device.limit);
        let times = |world: &World| (world.sampling.delay, world.sampling.delay_max, world.sampling.interval_max);
        if device != file.device || times(world) != times(file) || world.motion != file.motion {
            return Err(self.refusal("device"));
        }
        // The delay belongs to the hardware; given in samples, it would change with the period.
        if world.sampling.delay_s() != file.sampling.delay_s() {
            let delay = file.sampling.delay_s();
            return Err(format!(
                "loop.period: the file gives loop.delay in samples, {delay} s at its own period; with a motor attached give it as a time, \
                 and the period can be set"
            ));
        }
        let (Some(requested), Some(limit)) = (requested, file.device.limit) else {
            return if requested == file.device.limit { Ok(()) } else { Err(self.refusal("device.limit")) };
        };
        let (unit, pulse) = (Measures::Effort.unit(world.motion), self.pulse);
        // A NaN compares false, and is refused.
        let lower = requested <= limit;
        if !lower {
            return Err(format!(
                "device.limit: {requested} {unit} is above the file's {limit} {unit}; with a motor attached it can only be lowered"
            ));
        }
        if requested < limit && requested < pulse {
            return Err(format!(
                "device.limit: {requested} {unit} is below {pulse} {unit}, the torque of the sign test when the motor is armed"
            ));
        }
        let [tests, accounts] = monitors(world, self.profile)?;
        match self.monitors {
            [true, _] if !tests => Err("loop.period: with it the sign test at arming would be left out".into()),
            [_, true] if !accounts => {
                Err("loop.period: the delay would be more periods than the energy account at the puck can follow"
                    .into())
            }
            _ => Ok(()),
        }
    }

    /// The world on the file's device, to which the certificate applies.
    pub fn certified_world(&self, world: &World) -> World {
        World { device: self.file.device.clone(), ..world.clone() }
    }
}

/// Whether the supervisor of a world tests the sign, and accounts for the energy at the puck.
fn monitors(world: &World, profile: SafetyProfile) -> Result<[bool; 2], String> {
    let supervisor = DesktopSupervisor::new(&world.limits(profile), &world.spec());
    supervisor.map(|supervisor| supervisor.watches()).map_err(|error| error.to_string())
}

/// The `[safety]` table with the defaults written out, except `slew`, which follows the couplings, and `torque`, which is at most the limit.
fn written_out(safety: &Safety, limits: &Limits, profile: SafetyProfile) -> Safety {
    let some = |limit: f64| limit.is_finite().then_some(limit);
    let some_or_any = |limit: f64| Some(if limit.is_finite() { limit } else { 0.0 });
    // An uncertified world gets a tenth of the written value.
    let energy = if profile == SafetyProfile::Uncertified { 10.0 * limits.energy } else { limits.energy };
    Safety {
        velocity: some(limits.velocity),
        jump: some(limits.jump),
        overspeed: some(limits.overspeed),
        stuck: some_or_any(limits.stuck),
        stall: some_or_any(limits.stall),
        link: some_or_any(limits.link),
        energy: some(energy),
        world_trips: Some(limits.world_trips),
        pulse: Some(limits.pulse),
        ..safety.clone()
    }
}
