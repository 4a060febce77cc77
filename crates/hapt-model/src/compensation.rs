//! `[[compensation]]`: torques of the device that the loop compensates, by the measured position, velocity or acceleration.
//!
//! A compensation becomes a coupling between puck and ground: of gravity a detent of a turn, of cogging a texture, of friction an
//! assist, of inertia a torque along the acceleration. So it runs, is supervised, certified and exported as any other coupling of the world. The table is kept with the world, so
//! that the coupling follows a number of the device that a sweep changes.

use std::f64::consts::TAU;

use hapt_core::{Coupling, End, HARMONICS, Law, Waveform};
use hapt_plant::spec::{Cogging, Gravity};

use crate::kinds::Compensated;
use crate::world::{Compensation, Device, World};

impl Device {
    /// The coupling that compensates a torque of this device; `None` where it has no such torque. Of friction that differs by direction or
    /// changes with the position the smallest level is compensated, which may be 0.
    pub fn compensation(&self, Compensation { of, share, velocity, cutoff }: Compensation) -> Option<Coupling> {
        let law = match of {
            Compensated::Gravity => {
                let Gravity { torque, phase } = self.torque.gravity?;
                Law::Detent { torque: share * torque, pitch: TAU, phase: -phase }
            }
            Compensated::Cogging => {
                let Cogging { torque, pitch, phase, waveform } = self.torque.cogging?;
                let Waveform { sine, cosine } = waveform;
                let waveform = Waveform { sine: sine.map(|x| -x), cosine: cosine.map(|x| -x) };
                Law::Texture { torque: share * torque, pitch, phase, waveform }
            }
            Compensated::Friction => Law::Assist { torque: share * self.least_friction(), velocity: velocity? },
            Compensated::Inertia => Law::Acceleration { inertia: share * self.inertia, cutoff: cutoff? },
        };
        Some(law.between(End::Puck, End::Ground))
    }

    /// The torque of this device that a coupling compensates, and its share; `None` where it is another coupling.
    pub fn compensated_by(&self, coupling: &Coupling) -> Option<(Compensated, f64)> {
        let (of, taken, whole) = match coupling.law {
            Law::Detent { torque, pitch, phase } => {
                let gravity = self.torque.gravity?;
                let is_same = pitch == TAU && phase == -gravity.phase;
                is_same.then_some((Compensated::Gravity, torque, gravity.torque))?
            }
            Law::Texture { torque, pitch, phase, waveform } => {
                let cogging = self.torque.cogging?;
                let Waveform { sine, cosine } = cogging.waveform;
                let opposite = |one: [f32; HARMONICS], other: [f32; HARMONICS]| one == other.map(|x| -x);
                let is_same = pitch == cogging.pitch && phase == cogging.phase;
                let is_opposite = opposite(waveform.sine, sine) && opposite(waveform.cosine, cosine);
                (is_same && is_opposite).then_some((Compensated::Cogging, torque, cogging.torque))?
            }
            Law::Assist { torque, .. } => (Compensated::Friction, torque, self.least_friction()),
            Law::Acceleration { inertia, .. } => (Compensated::Inertia, inertia, self.inertia),
            _ => return None,
        };
        let is_there = taken > 0.0 && whole > 0.0 && coupling.first == End::Puck && coupling.second == End::Ground;
        is_there.then_some((of, taken / whole))
    }
}

impl World {
    /// Whether a compensation, of gravity or cogging, counts from the device's own position: the world's 0 is then the device's, and arming
    /// does not move it.
    pub fn counts_from_device(&self) -> bool {
        self.compensations.iter().any(|compensation| match compensation.of {
            Compensated::Gravity | Compensated::Cogging => true,
            Compensated::Friction | Compensated::Inertia => false,
        })
    }

    /// The places of the compensations' couplings; `None` where a world made by hand has no such coupling.
    pub(crate) fn compensating(&self) -> Vec<Option<usize>> {
        let place = |compensation: &Compensation| {
            let own = self.device.compensation(*compensation)?;
            self.couplings.iter().rposition(|coupling| *coupling == own)
        };
        self.compensations.iter().map(place).collect()
    }

    /// Makes the couplings at these places follow the device and the compensations.
    pub(crate) fn compensate(&mut self, places: &[Option<usize>]) {
        for (compensation, place) in self.compensations.iter().zip(places) {
            let place = place.and_then(|place| self.couplings.get_mut(place));
            if let (Some(place), Some(coupling)) = (place, self.device.compensation(*compensation)) {
                *place = coupling;
            }
        }
    }
}
