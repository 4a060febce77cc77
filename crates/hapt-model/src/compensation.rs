//! `[[compensation]]`: torques of the device that the loop compensates, by the measured position or velocity.
//!
//! A compensation becomes a coupling between puck and ground: of gravity a detent of a turn, of cogging a texture, of friction an
//! assist. So it runs, is supervised, certified and exported as any other coupling of the world.

use std::f64::consts::TAU;

use hapt_core::{Coupling, End, HARMONICS, Law, Waveform};
use hapt_plant::spec::{Cogging, Gravity};

use crate::kinds::Compensated;
use crate::world::Device;

impl Device {
    /// The coupling that compensates `share` of a torque of this device, of friction fully from the speed `velocity` on; `None` where it
    /// has none. Of friction that differs by direction or changes with the position the smallest level is compensated.
    pub fn compensation(&self, of: Compensated, share: f64, velocity: Option<f64>) -> Option<Coupling> {
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
            Compensated::Friction => {
                let friction = self.least_friction();
                let torque = share * friction;
                (friction > 0.0).then_some(Law::Assist { torque, velocity: velocity? })?
            }
        };
        Some(law.between(End::Puck, End::Ground))
    }

    /// The torque of this device that a coupling compensates, and its share; `None` where it is another coupling.
    pub fn compensated_by(&self, coupling: &Coupling) -> Option<(Compensated, f64)> {
        let (of, torque, whole) = match coupling.law {
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
            _ => return None,
        };
        let is_there = torque > 0.0 && whole > 0.0 && coupling.first == End::Puck && coupling.second == End::Ground;
        is_there.then_some((of, torque / whole))
    }
}
