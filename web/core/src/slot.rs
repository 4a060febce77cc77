//! What can be changed while a page runs.

use alloc::vec::Vec;

use hapt_core::{Body, Coupling, Damping, Law, Method, Output, Spec};

use crate::Setup;

/// The longest and the shortest period of a loop behind a page, in s: a loop that is to be seen runs, and leaves the machine some time.
pub const PERIODS: core::ops::RangeInclusive<f64> = 50e-6..=0.1;

/// A number, or a choice, that can be changed while a page runs. The numbers are what JavaScript calls them by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Slot {
    /// T in s.
    Period = 0,
    /// Its place in [`Method::ALL`]; the output follows where it must.
    Method = 1,
    /// Its place in [`Output::ALL`].
    Output = 2,
    /// From the sample to the motor's torque, in s.
    Delay = 3,
    /// A spring's or a wall's, in N·m/rad (linear: N/m).
    Stiffness = 4,
    /// A damper's or a wall's, in N·m·s/rad (N·s/m).
    Damping = 5,
    /// Of a damper, whatever the value: b = Tk.
    Compensating = 6,
    /// A friction's, a detent's or a constant's, in N·m (N).
    Torque = 7,
    /// A body's, in kg·m² (kg).
    Inertia = 8,
    /// The puck's.
    PuckInertia = 9,
    /// The puck's.
    PuckDamping = 10,
    /// The puck's Coulomb friction in N·m (N).
    PuckFriction = 11,
}

impl Slot {
    /// All of them, by their numbers.
    pub const ALL: [Slot; 12] = [
        Slot::Period,
        Slot::Method,
        Slot::Output,
        Slot::Delay,
        Slot::Stiffness,
        Slot::Damping,
        Slot::Compensating,
        Slot::Torque,
        Slot::Inertia,
        Slot::PuckInertia,
        Slot::PuckDamping,
        Slot::PuckFriction,
    ];
}

/// What runs, as data.
#[derive(Clone, Debug)]
pub(crate) struct WorldDraft {
    /// Without its lists.
    spec: Spec<'static>,
    bodies: Vec<Body>,
    couplings: Vec<Coupling>,
    pub setup: Setup,
}

impl WorldDraft {
    pub fn new(spec: &Spec<'_>, setup: Setup) -> Self {
        let (bodies, couplings) = (spec.bodies.to_vec(), spec.couplings.to_vec());
        WorldDraft { spec: Spec { bodies: &[], couplings: &[], ..*spec }, bodies, couplings, setup }
    }

    pub fn spec(&self) -> Spec<'_> {
        Spec { bodies: &self.bodies, couplings: &self.couplings, ..self.spec }
    }

    /// Of the coupling or body `index`, where it is one's; `false` where there is no such number. Its range is the core's to check, but for
    /// the device's.
    pub fn change(&mut self, slot: Slot, index: usize, value: f64) -> bool {
        let WorldDraft { spec, bodies, couplings, setup } = self;
        let Setup { device, limits, output, .. } = setup;
        let is_size = value >= 0.0 && value.is_finite();
        let right = match slot {
            Slot::Period => PERIODS.contains(&value),
            Slot::PuckInertia => is_size && value > 0.0,
            Slot::Delay | Slot::PuckDamping | Slot::PuckFriction => is_size,
            Slot::Method
            | Slot::Output
            | Slot::Stiffness
            | Slot::Damping
            | Slot::Compensating
            | Slot::Torque
            | Slot::Inertia => value.is_finite(),
        };
        if !right {
            return false;
        }
        match slot {
            Slot::Period => (spec.period, device.period) = (value, value),
            Slot::Delay => (device.delay, limits.delay) = (value, value),
            Slot::PuckInertia => (device.inertia, limits.inertia) = (value, value),
            Slot::PuckDamping => (device.damping, limits.damping) = (value, value),
            Slot::PuckFriction => (device.friction, limits.friction) = (value, value),
            Slot::Method => {
                let Some(&method) = Method::ALL.get(value as usize) else { return false };
                spec.method = method;
                spec.output = if method.takes_new_sample_first() { Output::Start } else { *output };
            }
            Slot::Output => {
                let Some(&chosen) = Output::ALL.get(value as usize) else { return false };
                (spec.output, *output) = (chosen, chosen);
            }
            Slot::Inertia => match bodies.get_mut(index) {
                Some(body) => body.inertia = value,
                None => return false,
            },
            Slot::Stiffness | Slot::Damping | Slot::Compensating | Slot::Torque => {
                return couplings.get_mut(index).is_some_and(|coupling| set(&mut coupling.law, slot, value));
            }
        }
        true
    }
}

/// Sets a law's number; `false` where it has none of this name.
fn set(law: &mut Law, slot: Slot, value: f64) -> bool {
    let name = match slot {
        Slot::Stiffness => "stiffness",
        Slot::Damping => "damping",
        Slot::Torque => "torque",
        Slot::Compensating => return compensate(law, Damping::Compensating),
        Slot::Period
        | Slot::Method
        | Slot::Output
        | Slot::Delay
        | Slot::Inertia
        | Slot::PuckInertia
        | Slot::PuckDamping
        | Slot::PuckFriction => return false,
    };
    if slot == Slot::Damping && compensate(law, Damping::Fixed(value)) {
        return true;
    }
    let number = law.quantities().find(|quantity| quantity.name == name).map(|quantity| quantity.value);
    number.map(|number| *number = value).is_some()
}

/// Sets a damper's damping; `false` where the law is none.
fn compensate(law: &mut Law, to: Damping) -> bool {
    law.damper().map(|damping| *damping = to).is_some()
}
