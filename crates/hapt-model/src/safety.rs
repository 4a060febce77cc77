//! The `[safety]` table as the file has it.

use hapt_core::WhenLate;

use crate::error::{Error, ErrorKind};
use crate::fields::{Fields, one_of};
use crate::keys::{LINK_LOST, WORLD_LEDGER, default_number};

/// The `[safety]` table, in SI; `None`: the default, which depends on the world ([`World::limits`](crate::World::limits)).
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// How long a fade takes, in s.
    pub fade: f64,
    /// The largest speed of the device in rad/s (linear: m/s).
    pub velocity: Option<f64>,
    /// The largest change of the displacement from sample to sample, in rad (m).
    pub jump: Option<f64>,
    /// The largest speed with the motor on, in rad/s (m/s).
    pub overspeed: Option<f64>,
    /// The longest time without motion under torque, in s; 0: any.
    pub stuck: Option<f64>,
    /// The largest command in N·m (N).
    pub torque: Option<f64>,
    /// The largest change of torque from sample to sample, in N·m (N).
    pub slew: Option<f64>,
    /// The motor's continuous torque in N·m (N).
    pub rms: Option<f64>,
    /// The motor's thermal time constant in s.
    pub heating: f64,
    /// The driver's continuous torque in N·m (N).
    pub driver_rms: Option<f64>,
    /// The driver's thermal time constant in s.
    pub driver_heating: f64,
    /// The largest lateness of a sample in s, missed samples counted in; 0: any.
    pub stall: Option<f64>,
    /// The reaction to times beyond `loop.interval_max` and `loop.delay_max`, where the file states them.
    pub late: Option<WhenLate>,
    /// From the last heartbeat to torque 0, the fade included, in s; 0: any.
    pub link: Option<f64>,
    /// Whether a lost link is a fault; else the torque fades out.
    pub link_faults: bool,
    /// The energy at which the ledgers trip, in J.
    pub energy: Option<f64>,
    /// Whether the world's own ledger trips.
    pub world_trips: Option<bool>,
    /// The sign test's torque in N·m (N); 0: no test.
    pub pulse: Option<f64>,
    /// Damping after a fault, in N·m·s/rad (N·s/m); 0: none.
    pub brake: f64,
}

impl Default for Safety {
    fn default() -> Self {
        Safety {
            fade: const { default_number("safety.fade") },
            velocity: None,
            jump: None,
            overspeed: None,
            stuck: None,
            torque: None,
            slew: None,
            rms: None,
            heating: const { default_number("safety.heating") },
            driver_rms: None,
            driver_heating: const { default_number("safety.driver_heating") },
            stall: None,
            late: None,
            link: None,
            link_faults: false,
            energy: None,
            world_trips: None,
            pulse: None,
            brake: const { default_number("safety.brake") },
        }
    }
}

impl Safety {
    /// The keys that take names, where the file has them.
    pub(crate) fn names(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let link = self.link_faults.then_some(("link_lost", LINK_LOST[1]));
        let ledger = self.world_trips.map(|trips| ("world_ledger", WORLD_LEDGER[usize::from(trips)]));
        let late = self.late.map(|late| ("late", late.name()));
        link.into_iter().chain(ledger).chain(late)
    }
}

impl Safety {
    pub(crate) fn read(fields: &Fields<'_>, limit: Option<f64>) -> Result<Safety, Error> {
        let pulse = fields.optional_number("pulse")?;
        if let Some((pulse, limit)) = pulse.zip(limit).filter(|(pulse, limit)| pulse > limit) {
            let message = format!("{pulse:?} is above device.limit, {limit:?} in SI; expected at most that");
            return Err(fields.error(ErrorKind::Combination, "pulse", message));
        }
        Ok(Safety {
            fade: fields.number("fade")?,
            velocity: fields.optional_number("velocity")?,
            jump: fields.optional_number("jump")?,
            overspeed: fields.optional_number("overspeed")?,
            stuck: fields.optional_number("stuck")?,
            torque: fields.optional_number("torque")?,
            slew: fields.optional_number("slew")?,
            rms: fields.optional_number("rms")?,
            heating: fields.number("heating")?,
            driver_rms: fields.optional_number("driver_rms")?,
            driver_heating: fields.number("driver_heating")?,
            stall: fields.optional_number("stall")?,
            late: one_of(fields, "late", &WhenLate::ALL, WhenLate::name)?,
            link: fields.optional_number("link")?,
            link_faults: fields.name("link_lost") == Some(LINK_LOST[1]),
            energy: fields.optional_number("energy")?,
            world_trips: fields.name("world_ledger").map(|name| name == WORLD_LEDGER[1]),
            pulse,
            brake: fields.number("brake")?,
        })
    }
}
