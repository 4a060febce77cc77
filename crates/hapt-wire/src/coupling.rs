//! The wire format of a coupling.
//!
//! The codes are frozen: boards in the field and logs on disks use them. A new law comes after the others, with a code of its own; a law
//! that takes a limit has a second form inside of [`Law::Clamped`].

use hapt_core::{Damping, End, Side, Waveform};
use serde::{Deserialize, Serialize};

use crate::Error;

/// The number of harmonics of a texture on the wire.
const HARMONICS: usize = 4;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Coupling {
    first: End,
    second: End,
    law: Law,
}

/// Codes 0, 1, 2, and so on, in this order.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Law {
    Spring {
        stiffness: f64,
        rest: f64,
    },
    Damper {
        damping: Damping,
    },
    Wall {
        side: Side,
        at: f64,
        stiffness: f64,
        damping: f64,
    },
    Detent {
        torque: f64,
        pitch: f64,
        phase: f64,
    },
    Coulomb {
        torque: f64,
    },
    Lugre {
        coulomb: f64,
        stribeck: f64,
        stribeck_velocity: f64,
        bristle_stiffness: f64,
        bristle_damping: f64,
        viscous: f64,
    },
    Constant {
        torque: f64,
    },
    Clamped {
        law: Clampable,
        limit: f64,
    },
    DeadBand {
        stiffness: f64,
        rest: f64,
        width: f64,
    },
    Magnet {
        torque: f64,
        width: f64,
        at: f64,
    },
    Texture {
        torque: f64,
        pitch: f64,
        phase: f64,
        sine: [f32; HARMONICS],
        cosine: [f32; HARMONICS],
    },
    Integral {
        stiffness: f64,
        time: f64,
        rest: f64,
    },
    Assist {
        torque: f64,
        velocity: f64,
    },
    Acceleration {
        inertia: f64,
        cutoff: f64,
    },
}

/// The laws that take a limit.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Clampable {
    Spring { stiffness: f64, rest: f64 },
    Damper { damping: Damping },
    Wall { side: Side, at: f64, stiffness: f64, damping: f64 },
    DeadBand { stiffness: f64, rest: f64, width: f64 },
    Integral { stiffness: f64, time: f64, rest: f64 },
    Acceleration { inertia: f64, cutoff: f64 },
}

impl Coupling {
    /// # Errors
    /// [`Error::NotAWorld`] for a limit on a law that takes none.
    pub fn new(coupling: &hapt_core::Coupling) -> Result<Self, Error> {
        use hapt_core::Law as Core;
        let clamped = |law| coupling.limit.map(|limit| Law::Clamped { law, limit });
        let law = match coupling.law {
            Core::Spring { stiffness, rest } => {
                clamped(Clampable::Spring { stiffness, rest }).unwrap_or(Law::Spring { stiffness, rest })
            }
            Core::Damper { damping } => clamped(Clampable::Damper { damping }).unwrap_or(Law::Damper { damping }),
            Core::Wall { side, at, stiffness, damping } => clamped(Clampable::Wall { side, at, stiffness, damping })
                .unwrap_or(Law::Wall { side, at, stiffness, damping }),
            Core::Detent { torque, pitch, phase } => Law::Detent { torque, pitch, phase },
            Core::DeadBand { stiffness, rest, width } => clamped(Clampable::DeadBand { stiffness, rest, width })
                .unwrap_or(Law::DeadBand { stiffness, rest, width }),
            Core::Magnet { torque, width, at } => Law::Magnet { torque, width, at },
            Core::Texture { torque, pitch, phase, waveform: Waveform { sine, cosine } } => {
                Law::Texture { torque, pitch, phase, sine, cosine }
            }
            Core::Coulomb { torque } => Law::Coulomb { torque },
            Core::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => {
                Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous }
            }
            Core::Integral { stiffness, time, rest } => clamped(Clampable::Integral { stiffness, time, rest })
                .unwrap_or(Law::Integral { stiffness, time, rest }),
            Core::Assist { torque, velocity } => Law::Assist { torque, velocity },
            Core::Acceleration { inertia, cutoff } => {
                clamped(Clampable::Acceleration { inertia, cutoff }).unwrap_or(Law::Acceleration { inertia, cutoff })
            }
            Core::Constant { torque } => Law::Constant { torque },
        };
        let fits = coupling.limit.is_none() || coupling.law.takes_limit();
        if fits { Ok(Coupling { first: coupling.first, second: coupling.second, law }) } else { Err(Error::NotAWorld) }
    }

    pub fn read(self) -> hapt_core::Coupling {
        use hapt_core::Law as Core;
        let (law, limit) = match self.law {
            Law::Spring { stiffness, rest } => (Core::Spring { stiffness, rest }, None),
            Law::Damper { damping } => (Core::Damper { damping }, None),
            Law::Wall { side, at, stiffness, damping } => (Core::Wall { side, at, stiffness, damping }, None),
            Law::Detent { torque, pitch, phase } => (Core::Detent { torque, pitch, phase }, None),
            Law::DeadBand { stiffness, rest, width } => (Core::DeadBand { stiffness, rest, width }, None),
            Law::Magnet { torque, width, at } => (Core::Magnet { torque, width, at }, None),
            Law::Texture { torque, pitch, phase, sine, cosine } => {
                (Core::Texture { torque, pitch, phase, waveform: Waveform { sine, cosine } }, None)
            }
            Law::Coulomb { torque } => (Core::Coulomb { torque }, None),
            Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => (
                Core::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous },
                None,
            ),
            Law::Constant { torque } => (Core::Constant { torque }, None),
            Law::Assist { torque, velocity } => (Core::Assist { torque, velocity }, None),
            Law::Acceleration { inertia, cutoff } => (Core::Acceleration { inertia, cutoff }, None),
            Law::Integral { stiffness, time, rest } => (Core::Integral { stiffness, time, rest }, None),
            Law::Clamped { law, limit } => {
                let law = match law {
                    Clampable::Spring { stiffness, rest } => Core::Spring { stiffness, rest },
                    Clampable::Damper { damping } => Core::Damper { damping },
                    Clampable::DeadBand { stiffness, rest, width } => Core::DeadBand { stiffness, rest, width },
                    Clampable::Wall { side, at, stiffness, damping } => Core::Wall { side, at, stiffness, damping },
                    Clampable::Integral { stiffness, time, rest } => Core::Integral { stiffness, time, rest },
                    Clampable::Acceleration { inertia, cutoff } => Core::Acceleration { inertia, cutoff },
                };
                (law, Some(limit))
            }
        };
        hapt_core::Coupling { first: self.first, second: self.second, law, limit }
    }
}
