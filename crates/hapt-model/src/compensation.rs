//! `[[compensation]]`: torques of the device that the loop takes back, by the position that it measures.
//!
//! A compensation is the coupling between puck and ground that it makes: of gravity a detent of a turn, of cogging a texture. So it runs, is
//! supervised, certified and exported as any other coupling of the world.

use std::f64::consts::TAU;

use hapt_core::{Coupling, End, Law, Waveform};
use hapt_plant::spec::{Cogging, Gravity};

use crate::world::Device;

hapt_core::named! {
    /// The torques of a device that a loop may take back.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Compensated {
        /// [`Gravity`]
        Gravity => "gravity",
        /// [`Cogging`]
        Cogging => "cogging",
    }
}

impl Device {
    /// The coupling that takes back `share` of a torque of this device; `None` where it has none.
    pub fn compensation(&self, of: Compensated, share: f64) -> Option<Coupling> {
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
        };
        Some(law.between(End::Puck, End::Ground))
    }

    /// Which torque of this device a coupling takes back, and how much of it; `None` where it is another coupling.
    pub fn compensated_by(&self, coupling: &Coupling) -> Option<(Compensated, f64)> {
        Compensated::ALL.into_iter().find_map(|of| {
            let whole = match of {
                Compensated::Gravity => self.torque.gravity?.torque,
                Compensated::Cogging => self.torque.cogging?.torque,
            };
            let (Law::Detent { torque, .. } | Law::Texture { torque, .. }) = coupling.law else { return None };
            let share = torque / whole;
            // The same coupling but for the rounding of its torque.
            let mut same = self.compensation(of, share)?;
            if let Law::Detent { torque: own, .. } | Law::Texture { torque: own, .. } = &mut same.law {
                *own = torque;
            }
            (torque > 0.0 && same == *coupling).then_some((of, share))
        })
    }
}
