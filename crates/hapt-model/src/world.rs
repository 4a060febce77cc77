//! The world file's content, checked and in SI: rad, m, s, kg, N, N·m.

use std::f64::consts::TAU;

use hapt_core::{Body, Coupling, Spec};
use hapt_plant::spec::{DeviceSpec, DeviceTorque, Drive, FrictionByPosition, Hand, Handle, Stops, Stribeck};

use crate::kinds::{Compensated, Motion};
use crate::safety::Safety;
use crate::sampling::Sampling;
use crate::timing::Timing;

/// A world file, read and checked. All numbers are in SI.
///
/// ```
/// use hapt_model::{Source, World};
///
/// let file = r#"
/// loop.period = "1 ms"
/// device.inertia = "6.4e-4 kg m^2"
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "20 N mm/deg"
/// "#;
/// // An override replaces a key of the file, as `--set` does on the command line.
/// let world = World::read(&Source::from_text("spring.toml", file), &["loop.period=2ms".to_string()])?;
/// assert_eq!(world.sampling.period, 2e-3);
/// // The file that a world writes reads back to the same world.
/// assert_eq!(World::read(&Source::from_text("again.toml", world.to_toml()), &[])?, world);
/// # Ok::<(), hapt_model::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// The file's title.
    pub title: Option<String>,
    /// Rotary or linear.
    pub motion: Motion,
    /// The `[loop]` table.
    pub sampling: Sampling,
    /// The `[device]` table.
    pub device: Device,
    /// The `[safety]` table.
    pub safety: Safety,
    /// The bodies' names, in file order.
    pub names: Vec<String>,
    /// The bodies, in the same order.
    pub bodies: Vec<Body>,
    /// The couplings, in file order, and after them those of the compensations.
    pub couplings: Vec<Coupling>,
    /// The `[[compensation]]` tables, in file order.
    pub compensations: Vec<Compensation>,
    /// The scenarios, in file order.
    pub scenarios: Vec<Scenario>,
}

/// A row of `[[compensation]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensation {
    /// The torque of the device.
    pub of: Compensated,
    /// The part of it that is compensated, 0 to 1.
    pub share: f64,
    /// Of friction only: the speed in rad/s (linear: m/s) from which on the whole share is compensated.
    pub velocity: Option<f64>,
    /// Of inertia only: the cutoff in Hz of the low-pass behind which the acceleration is measured.
    pub cutoff: Option<f64>,
}

/// The `[device]` table: everything physical.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// The puck's J_z in kg·m² (linear: kg), positive.
    pub inertia: f64,
    /// Viscous, in N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// Coulomb, in N·m (linear: N), zero or more.
    pub friction: f64,
    /// The Coulomb friction toward smaller positions, where it is another one: `friction` is then that toward larger ones.
    pub friction_backward: Option<f64>,
    /// The time constant in s with which the motor torque follows its command, zero or more; 0: at once.
    pub lag: f64,
    /// How exactly the five numbers above are known. Simulations use the numbers themselves.
    pub tolerances: Tolerances,
    /// The largest torque that may be commanded; `None`: any.
    pub limit: Option<f64>,
    /// Counts per revolution (linear: the count's size in m); `None`: ideal.
    pub encoder: Option<f64>,
    /// Torque resolution: steps of 2 limit/levels; `None`: ideal.
    pub levels: Option<u32>,
    /// The `[device.drive]` table.
    pub drive: Mounting,
    /// The `[device.friction_by_position]` table: how both levels of Coulomb friction change with the position.
    pub friction_by_position: Option<FrictionByPosition>,
    /// The `[device.stribeck]` table: the additional friction at low speeds.
    pub stribeck: Option<Stribeck>,
    /// The `[device.stops]` table: the ends of the puck's travel.
    pub stops: Option<Stops>,
    /// The `[device.handle]` table: a handle on a flexible shaft. The numbers above are then of the motor's side, the puck. `None`: the
    /// puck is the handle.
    pub handle: Option<Handle>,
    /// The `[device.gravity]` and `[device.cogging]` tables.
    pub torque: DeviceTorque,
}

/// The half widths within which numbers of the device are known, as fractions of them from 0 to 1: 0.2 is ± 20 %. A changed number keeps
/// its tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerances {
    /// Of the inertia; below 1.
    pub inertia: f64,
    /// Of the viscous damping.
    pub damping: f64,
    /// Of the Coulomb friction.
    pub friction: f64,
    /// Of that toward smaller positions, where it is another one.
    pub friction_backward: f64,
    /// Of the lag.
    pub lag: f64,
}

/// The `[device.drive]` table: how the puck hangs on a motor drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Revolutions of the drive for one of the puck (linear: m for one revolution of the drive), positive; `None`: 1 (linear: unknown).
    pub gear: Option<f64>,
    /// The drive's positions decrease where the puck's increase.
    pub reversed: bool,
    /// The puck's position by the drive's own zero, in rad (linear: m), that is the world's 0; `None`: where it is armed.
    pub home: Option<f64>,
}

/// A hand, a duration and a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// `[A-Za-z0-9_-]+`
    pub name: String,
    /// In s, positive.
    pub duration: f64,
    /// The drive of the puck.
    pub hand: Hand,
    /// When the samples are taken.
    pub timing: Timing,
}

/// The largest angle by which a handle's shaft oscillates in a period with Coulomb friction, in rad: a run searches stops and starts at
/// every quarter.
const MOST_SWING: f64 = 100.0;
/// The same of a hand that swings the puck: a thousand turns in a period, each of them a stop.
const MOST_HAND_SWING: f64 = 3000.0;

impl Device {
    /// The device of a file that has only `device.inertia`: a puck of this inertia in kg·m² (linear: kg) that moves freely, on an ideal
    /// motor and encoder.
    pub fn new(inertia: f64) -> Self {
        Device {
            inertia,
            damping: 0.0,
            friction: 0.0,
            friction_backward: None,
            lag: 0.0,
            tolerances: Tolerances::default(),
            limit: None,
            encoder: None,
            levels: None,
            drive: Mounting::default(),
            friction_by_position: None,
            stribeck: None,
            stops: None,
            handle: None,
            torque: DeviceTorque::default(),
        }
    }

    /// Why a run at this period in s cannot simulate the device, with the table below `device` and the key in it that would have to change;
    /// `None` where it can. A world that was built or changed without its file is checked by this again.
    pub fn fault(&self, period: f64) -> Option<(&'static str, &'static str, String)> {
        self.level_fault()
            .or_else(|| self.shaft_fault(period).map(|message| ("handle", "stiffness", message)))
            .or_else(|| self.start_fault())
            .or_else(|| self.piece_fault(period))
    }

    /// Friction never pushes, but for the rounding of harmonics, which are single numbers: the device takes the share that it has room for.
    fn level_fault(&self) -> Option<(&'static str, &'static str, String)> {
        let changes = self.friction_by_position?;
        let whole = FrictionByPosition { share: 1.0, ..changes }.most();
        let message = || {
            format!(
                "{:?} takes friction below 0 at some positions: the sizes of the harmonics, the roots of sine² + cosine², add up to {whole:?}; \
                 expected a share of {:?} at most",
                changes.share,
                whole.recip()
            )
        };
        let is_within = changes.most() <= 1.0 + f64::from(f32::EPSILON);
        (!is_within).then(|| ("friction_by_position", "share", message()))
    }

    /// Every run starts at rest at 0.
    fn start_fault(&self) -> Option<(&'static str, &'static str, String)> {
        let stops = self.stops?;
        let message = |expected| format!("the puck starts at 0, which is in this stop; expected {expected}");
        match (stops.low, stops.high) {
            (Some(low), _) if low > 0.0 => Some(("stops", "low", message("0 or less"))),
            (_, Some(high)) if high < 0.0 => Some(("stops", "high", message("0 or more"))),
            (Some(_) | None, Some(_) | None) => None,
        }
    }

    fn shaft_fault(&self, period: f64) -> Option<String> {
        let shaft = self.handle.filter(|_| self.largest_friction() > 0.0)?;
        let swing = (shaft.stiffness * (self.inertia.recip() + shaft.inertia.recip())).sqrt() * period;
        (swing.is_nan() || swing > MOST_SWING).then(|| {
            format!(
                "the shaft swings {swing:.0} rad in a period, and beside device.friction at most {MOST_SWING} are simulated; leave \
                 [device.handle] out and add its inertia to device.inertia: to this loop such a shaft is rigid"
            )
        })
    }

    /// Whether only inertia, damping and Coulomb friction with one level per direction act on the puck: no gravity, no cogging, no
    /// friction that changes with the position or falls with the speed, no end stops.
    pub fn is_plain(&self) -> bool {
        let is_even = self.changing_friction() == 0.0 && self.falling_friction() == 0.0;
        self.torque.is_none() && is_even && self.stops.is_none()
    }

    /// How steeply friction changes with the position at most, in N·m/rad (linear: N/m). 0 where it does not.
    pub fn changing_friction(&self) -> f64 {
        let [forward, backward] = self.frictions();
        self.friction_by_position.map_or(0.0, |changes| forward.max(backward) * changes.steepest())
    }

    /// How steeply friction falls at low speeds, in N·m·s/rad (linear: N·s/m): a damping that is missing there. 0 where it does not.
    pub fn falling_friction(&self) -> f64 {
        self.stribeck.map_or(0.0, |stribeck| stribeck.slope())
    }

    /// Where other torques than inertia, damping and Coulomb friction act, a period is cut into parts in which no motion exceeds half a
    /// radian.
    fn piece_fault(&self, period: f64) -> Option<(&'static str, &'static str, String)> {
        if self.is_plain() {
            return None;
        }
        let swing = |stiffness: f64| (stiffness / self.inertia).sqrt();
        let (spring, damper) = self.stops.map_or((0.0, 0.0), |stops| (stops.stiffness, stops.damping));
        let field = if self.torque.cogging.is_some() { "cogging" } else { "gravity" };
        let parts = [
            (swing(self.torque.steepest()), field, "torque"),
            (swing(self.changing_friction()), "friction_by_position", "share"),
            (self.falling_friction() / self.inertia, "stribeck", "velocity"),
            (swing(spring), "stops", "stiffness"),
            (damper / self.inertia, "stops", "damping"),
        ];
        let shaft = self.handle.map_or(0.0, |shaft| {
            let masses = self.inertia.recip() + shaft.inertia.recip();
            (shaft.stiffness * masses).sqrt() + shaft.damping * masses
        });
        let turned = (parts.iter().map(|part| part.0).sum::<f64>() + self.damping / self.inertia + shaft) * period;
        // The part that goes furthest has to change.
        let most =
            |a: (f64, &'static str, &'static str), b: (f64, &'static str, &'static str)| if b.0 > a.0 { b } else { a };
        let (_, table, key) = parts.into_iter().reduce(most)?;
        (turned.is_nan() || turned > MOST_SWING).then(|| {
            let (what, expected) = match key {
                "torque" => ("under it, its damping and its shaft the puck swings", "a smaller torque"),
                "share" => ("where friction changes with the position the puck swings", "a smaller share, a longer pitch"),
                "velocity" => ("a slow puck speeds up, swings", "a larger velocity"),
                "damping" => ("in a stop the puck swings", "a smaller damping"),
                _ => ("in a stop the puck swings", "a smaller stiffness"),
            };
            let message = format!(
                "{what} or decays by {turned:.0} rad in a period, and at most {MOST_SWING} are simulated; expected {expected}, or a shorter \
                 loop.period"
            );
            (table, key, message)
        })
    }

    /// Why a run with this sampling cannot simulate the hand on the device, with the key below `hand` that would have to change; `None` where
    /// it can.
    pub fn hand_fault(&self, hand: &Hand, sampling: &Sampling) -> Option<(&'static str, String)> {
        if self.largest_friction() == 0.0 && self.is_plain() {
            return None;
        }
        let (key, shape) = match &hand.drive {
            Drive::Grip { moves, .. } | Drive::Torque(moves) => ("moves.frequency", Some(moves)),
            // Only the hand moves a puck without a shaft.
            Drive::Position(shape) => ("frequency", self.handle.and(Some(shape))),
        };
        let beside =
            if self.largest_friction() > 0.0 { "device.friction" } else { "device.gravity and device.cogging" };
        let interval = sampling.interval_max_s();
        let most = MOST_HAND_SWING / interval;
        let too_far = |key, omega: f64, expected: String| {
            let message = || {
                format!(
                    "the hand swings {:.0} rad in {interval:?} s, the longest interval, and beside {beside} at most \
                     {MOST_HAND_SWING} are simulated; expected {expected} or less, or a shorter loop.period",
                    omega * interval
                )
            };
            (omega.is_nan() || omega > most).then(|| (key, message()))
        };
        let by_spring = match hand.drive {
            Drive::Grip { inertia, damping, stiffness, .. } => {
                let inertia = inertia + self.handle.map_or(self.inertia, |handle| handle.inertia);
                let damps = if self.is_plain() { 0.0 } else { damping / inertia };
                too_far("stiffness", (stiffness / inertia).sqrt(), format!("{:.3e} in SI", most * most * inertia))
                    .or_else(|| too_far("damping", damps, format!("{:.3e} in SI", most * inertia)))
            }
            Drive::Torque(_) | Drive::Position(_) => None,
        };
        by_spring.or_else(|| {
            let frequency = shape?.frequency()?;
            too_far(key, TAU * frequency, format!("{:.3e} Hz", most / TAU))
        })
    }

    /// The least and the largest inertia within its tolerance.
    pub fn inertia_range(&self) -> [f64; 2] {
        within(self.inertia, self.tolerances.inertia)
    }

    /// The least and the largest damping within its tolerance.
    pub fn damping_range(&self) -> [f64; 2] {
        within(self.damping, self.tolerances.damping)
    }

    /// The Coulomb friction toward larger positions, and toward smaller ones; in the mean of all positions, where it changes with them.
    pub fn frictions(&self) -> [f64; 2] {
        [self.friction, self.friction_backward.unwrap_or(self.friction)]
    }

    /// The friction that the device has in either direction and at every position: the least that it dissipates on a path.
    pub fn least_friction(&self) -> f64 {
        let [forward, backward] = self.frictions();
        forward.min(backward) * self.parts_of_friction()[0]
    }

    /// The most that may hold the puck, in either direction and at any position.
    pub fn largest_friction(&self) -> f64 {
        let [forward, backward] = self.frictions();
        forward.max(backward) * self.parts_of_friction()[1] + self.stribeck.map_or(0.0, |stribeck| stribeck.torque)
    }

    /// Bounds on the part of its mean level that friction has at any position.
    fn parts_of_friction(&self) -> [f64; 2] {
        let most = self.friction_by_position.map_or(0.0, |changes| changes.most());
        [(1.0 - most).max(0.0), 1.0 + most]
    }

    /// The same device with this friction in both directions and at every position, exactly.
    pub fn set_friction(&mut self, friction: f64) {
        (self.friction, self.friction_backward, self.friction_by_position) = (friction, None, None);
        (self.tolerances.friction, self.tolerances.friction_backward) = (0.0, 0.0);
    }

    /// The least and the largest friction toward larger positions, and toward smaller ones, within their tolerances; in the mean of all positions.
    pub fn frictions_range(&self) -> [[f64; 2]; 2] {
        let forward = within(self.friction, self.tolerances.friction);
        [forward, self.friction_backward.map_or(forward, |level| within(level, self.tolerances.friction_backward))]
    }

    /// The least and the largest friction in either direction and at any position, within their tolerances.
    pub fn friction_range(&self) -> [f64; 2] {
        let ([forward, backward], [least, most]) = (self.frictions_range(), self.parts_of_friction());
        [forward[0].min(backward[0]) * least, forward[1].max(backward[1]) * most]
    }

    /// The least and the largest lag within its tolerance.
    pub fn lag_range(&self) -> [f64; 2] {
        within(self.lag, self.tolerances.lag)
    }
}

/// `middle` less and plus the fraction `tolerance` of it.
fn within(middle: f64, tolerance: f64) -> [f64; 2] {
    [middle - middle * tolerance, middle + middle * tolerance]
}

impl World {
    /// A rotary world of this loop on this device, with nothing virtual and no scenarios.
    ///
    /// ```
    /// use hapt_model::{Device, End, Law, Sampling, World};
    ///
    /// let mut world = World::new(Sampling::new(1e-3), Device { damping: 1.2e-3, ..Device::new(6.4e-4) });
    /// world.couplings = vec![Law::Spring { stiffness: 2.0, rest: 0.0 }.between(End::Puck, End::Ground)];
    /// assert_eq!(world.sampling.method.name(), "zoh");
    /// ```
    pub fn new(sampling: Sampling, device: Device) -> Self {
        World {
            title: None,
            motion: Motion::Rotary,
            sampling,
            device,
            safety: Safety::default(),
            names: Vec::new(),
            bodies: Vec::new(),
            couplings: Vec::new(),
            compensations: Vec::new(),
            scenarios: Vec::new(),
        }
    }

    /// The spec of the simulated device.
    pub fn device_spec(&self) -> DeviceSpec {
        let Device { inertia, damping, lag, stribeck, stops, handle, torque, .. } = self.device;
        let Device { friction, friction_backward, friction_by_position, .. } = self.device;
        let (period, delay) = (self.sampling.period, self.sampling.delay_s());
        DeviceSpec {
            period,
            delay,
            lag,
            inertia,
            damping,
            friction,
            friction_backward,
            friction_by_position,
            stribeck,
            stops,
            handle,
            torque,
        }
    }

    /// The spec of the loop.
    pub fn spec(&self) -> Spec<'_> {
        Spec {
            period: self.sampling.period,
            method: self.sampling.method,
            output: self.sampling.output,
            advance: self.sampling.advance,
            bodies_every: self.sampling.bodies_every,
            estimator: self.sampling.velocity_estimator(),
            filter: self.sampling.filter,
            count: self.count(),
            limit: self.device.limit,
            levels: self.device.levels,
            bodies: &self.bodies,
            couplings: &self.couplings,
        }
    }

    /// The size of one encoder count in rad (linear: m); `None`: ideal.
    pub fn count(&self) -> Option<f64> {
        self.device.encoder.map(|encoder| match self.motion {
            Motion::Rotary => std::f64::consts::TAU / encoder,
            Motion::Linear => encoder,
        })
    }
}
