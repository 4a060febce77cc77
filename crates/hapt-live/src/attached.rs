//! A motor that is attached: what the file says of it holds for as long as the loop runs.
//!
//! The file's `[device]` and `[safety]` are ceilings. Whatever a page says, the certificate is about the file's device, and no limit of the
//! supervisor becomes wider than the file's, derived ones among them.

use hapt_core::{Limits, SafetyProfile};
use hapt_model::{EstimatorKind, Safety, World};
use hapt_sim::{DesktopSupervisor, Measures};

use crate::protocol::KeySays;

/// What may be set in `[loop]` beside a motor: what the program does. All else there says what the hardware does.
const FREE: [&str; 7] = ["period", "method", "output", "advance", "estimator", "cutoff", "window"];

/// The file's device with what guards it.
#[derive(Clone, Debug)]
pub(crate) struct Attached {
    /// The world of the file, its limits written out: they follow nothing that is set later.
    file: World,
    profile: SafetyProfile,
    /// The sign test's torque in N·m (linear: N); a lower limit would leave the test out.
    pulse: f64,
    /// What the supervisor can do on it.
    watches: [bool; 2],
}

impl Attached {
    /// The world of the file on its motor.
    ///
    /// # Errors
    /// In a sentence: the core does not take it.
    pub fn new(world: &World, profile: SafetyProfile) -> Result<Self, String> {
        let limits = world.limits(profile);
        let file = World { safety: written_out(&world.safety, &limits, profile), ..world.clone() };
        let watches = watches(&file, profile)?;
        Ok(Attached { file, profile, pulse: limits.pulse, watches })
    }

    /// Whether the key can be set.
    pub fn leaves(&self, path: &str) -> bool {
        match path.split_once('.') {
            Some(("loop", name)) => FREE.contains(&name),
            Some(("device", name)) => name == "limit",
            Some(("bodies" | "couplings", _)) => true,
            _ => false,
        }
    }

    /// Why it cannot.
    pub fn refusal(&self, path: &str) -> String {
        format!(
            "{path}: with a motor attached only the world file says what the hardware is and what guards it; end hapt live, change the \
             file, and start it again"
        )
    }

    /// A key as the page shows it: fixed, or with a slider that ends at the file's value.
    pub fn bound(&self, key: &mut KeySays) {
        key.fixed = !self.leaves(&key.path);
        if let (false, "device.limit", Some(limit)) = (key.fixed, key.path.as_str(), self.file.device.limit) {
            key.max = limit;
            key.min = key.min.max(self.pulse).min(0.5 * limit);
        }
    }

    /// Holds a changed world to the file's device and limits.
    ///
    /// # Errors
    /// In a sentence, what would go beyond them.
    pub fn hold(&self, world: &mut World) -> Result<(), String> {
        let file = &self.file;
        world.safety.clone_from(&file.safety);
        if world.sampling.estimator == EstimatorKind::Exact {
            return Err("loop.estimator: an encoder gives no true velocity; take \"difference\", or a filter".into());
        }
        let mut device = world.device.clone();
        let asked = std::mem::replace(&mut device.limit, file.device.limit);
        if device != file.device || world.sampling.delay != file.sampling.delay || world.motion != file.motion {
            return Err(self.refusal("device"));
        }
        // A delay in samples is the hardware's too, and another period would make another time of it.
        if world.sampling.delay_s() != file.sampling.delay_s() {
            let delay = file.sampling.delay_s();
            return Err(format!(
                "loop.period: the file gives loop.delay in samples, {delay} s at its own period; with a motor attached give it as a time, \
                 and the period can be set"
            ));
        }
        let (Some(asked), Some(limit)) = (asked, file.device.limit) else {
            return if asked == file.device.limit { Ok(()) } else { Err(self.refusal("device.limit")) };
        };
        let (unit, pulse) = (Measures::Effort.unit(world.motion), self.pulse);
        // Written so that what is no number is refused.
        let lower = asked <= limit;
        if !lower {
            return Err(format!(
                "device.limit: {asked} {unit} is above the file's {limit} {unit}; with a motor attached it can only be lowered"
            ));
        }
        if asked < limit && asked < pulse {
            return Err(format!(
                "device.limit: {asked} {unit} is below {pulse} {unit}, the torque of the sign test when the motor is armed"
            ));
        }
        let [tests, accounts] = watches(world, self.profile)?;
        match self.watches {
            [true, _] if !tests => Err("loop.period: with it the sign test at arming would be left out".into()),
            [_, true] if !accounts => {
                Err("loop.period: the delay would be more periods than the energy account at the puck can follow"
                    .into())
            }
            _ => Ok(()),
        }
    }

    /// The world with the file's device, of which alone the certificate is.
    pub fn judged(&self, world: &World) -> World {
        World { device: self.file.device.clone(), ..world.clone() }
    }
}

/// What the supervisor of a world can do: test the sign, keep the account at the puck.
fn watches(world: &World, profile: SafetyProfile) -> Result<[bool; 2], String> {
    let supervisor = DesktopSupervisor::new(&world.limits(profile), &world.spec());
    supervisor.map(|supervisor| supervisor.watches()).map_err(|error| error.to_string())
}

/// The `[safety]` table with what the file leaves to defaults. What follows the couplings (`slew`) still does, and so does `torque`, which
/// is the limit or less.
fn written_out(safety: &Safety, limits: &Limits, profile: SafetyProfile) -> Safety {
    let some = |limit: f64| limit.is_finite().then_some(limit);
    let some_or_any = |limit: f64| Some(if limit.is_finite() { limit } else { 0.0 });
    // A world that is not certified has a tenth of what is written.
    let energy = if profile == SafetyProfile::Uncertified { 10.0 * limits.energy } else { limits.energy };
    Safety {
        velocity: some(limits.velocity),
        jump: some(limits.jump),
        overspeed: some(limits.overspeed),
        stuck: some_or_any(limits.stuck),
        late: some_or_any(limits.late),
        link: some_or_any(limits.link),
        energy: some(energy),
        world_trips: Some(limits.world_trips),
        pulse: Some(limits.pulse),
        ..safety.clone()
    }
}
