//! A coupling's law: its data, and what follows from them. Each law has a file; this one defines what each law must provide.
//!
//! A law with an energy is a function of q only: its file gives its torque -V'(q), its V, and the mean of V' over a displacement, which
//! is what the discrete-gradient step needs ([`crate::gradient`]). Every match here names every law, so that a new law does not
//! compile until each function handles it.

mod acceleration;
mod coulomb;
mod damper;
mod dead_band;
mod detent;
mod integral;
mod lugre;
mod magnet;
mod quantity;
mod spring;
mod texture;
mod wall;

pub(crate) use acceleration::{Acceleration, filtered};
pub(crate) use coulomb::Coulomb;
pub use damper::Damping;
pub(crate) use damper::{Damper, gain};
pub(crate) use dead_band::DeadBand;
pub(crate) use detent::Detent;
pub(crate) use integral::{Integral, most};
pub(crate) use lugre::Lugre;
pub(crate) use magnet::Magnet;
use quantity::padded;
pub use quantity::{Quantity, Range};
#[cfg(test)]
pub(crate) use spring::Ramp;
pub(crate) use spring::Spring;
pub(crate) use texture::Texture;
pub use texture::{HARMONICS, Waveform};
pub use wall::Side;
pub(crate) use wall::{Wall, direction};

/// The torque of a coupling on its first end, in N·m (linear: N), for q in rad (linear: m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// -stiffness · (q - rest)
    Spring {
        /// N·m/rad, zero or more.
        stiffness: f64,
        /// The q at which the spring is slack.
        rest: f64,
    },
    /// -damping · q̇
    Damper {
        /// The damping, or the rule that gives it.
        damping: Damping,
    },
    /// `Above`: -(stiffness · (q - at) + damping · q̇) while q > at, never pulling (not positive); `Below`: its mirror.
    Wall {
        /// On which side of `at` the wall pushes.
        side: Side,
        /// The wall's face.
        at: f64,
        /// N·m/rad, zero or more.
        stiffness: f64,
        /// N·m·s/rad, zero or more.
        damping: f64,
    },
    /// -torque · sin(2π (q - phase)/pitch): it rests at phase + n · pitch.
    Detent {
        /// The largest torque, zero or more.
        torque: f64,
        /// From one rest to the next, positive.
        pitch: f64,
        /// Where one of them is.
        phase: f64,
    },
    /// A spring that begins at ±width from its rest: -stiffness · (q - rest ∓ width) beyond, 0 between.
    DeadBand {
        /// N·m/rad, zero or more.
        stiffness: f64,
        /// The middle of the band.
        rest: f64,
        /// Half of the band, zero or more.
        width: f64,
    },
    /// A pull toward `at` that fades with the distance: -torque · x · exp((1 - x²)/2), x = (q - at)/width.
    Magnet {
        /// The largest torque, at x = ±1; zero or more.
        torque: f64,
        /// How far from `at` it is largest, positive.
        width: f64,
        /// Where it pulls to.
        at: f64,
    },
    /// A periodic torque: torque · waveform(2π (q - phase)/pitch).
    Texture {
        /// The torque where the waveform is 1, zero or more.
        torque: f64,
        /// One period of the waveform, positive.
        pitch: f64,
        /// The q at which a period starts.
        phase: f64,
        /// The torque over one period, relative to `torque`.
        waveform: Waveform,
    },
    /// Coulomb friction: -torque · sign(q̇), 0 at q̇ = 0.
    Coulomb {
        /// Zero or more.
        torque: f64,
    },
    /// LuGre friction (Canudas de Wit et al., IEEE TAC 40(3), 1995): -(σ0 s + σ1 ṡ + σ2 q̇), ṡ = q̇ - σ0 |q̇| s/g,
    /// g = coulomb + (stribeck - coulomb) exp(-(q̇/stribeck_velocity)²).
    Lugre {
        /// The level when sliding fast, zero or more.
        coulomb: f64,
        /// The static level, zero or more.
        stribeck: f64,
        /// rad/s, positive.
        stribeck_velocity: f64,
        /// σ0 in N·m/rad, zero or more.
        bristle_stiffness: f64,
        /// σ1 in N·m·s/rad, zero or more.
        bristle_damping: f64,
        /// σ2 in N·m·s/rad, zero or more.
        viscous: f64,
    },
    /// -stiffness/time · s, s = Σ T (q - rest) over the samples up to this one: the integral term of a PID controller. Between puck and ground.
    Integral {
        /// N·m/rad, zero or more.
        stiffness: f64,
        /// The time in s in which a standing deflection gives the torque of a spring of that stiffness, positive.
        time: f64,
        /// The q at which the sum stays constant.
        rest: f64,
    },
    /// torque · q̇/velocity, within ±torque: a torque along the velocity, as a compensation of friction makes it. Between puck and ground.
    Assist {
        /// The largest torque, zero or more.
        torque: f64,
        /// The q̇ from which on it is that, positive.
        velocity: f64,
    },
    /// inertia · ds/dt, s the velocity q̇ behind a low-pass: s_k = s_{k-1} + T (q̇_k - s_{k-1})/(τ + T), τ = 1/(2π cutoff). A torque along
    /// the acceleration, as a compensation of inertia makes it. Between puck and ground.
    Acceleration {
        /// kg·m² (linear: kg), zero or more.
        inertia: f64,
        /// Of the low-pass in Hz, positive, and at most the sampling rate.
        cutoff: f64,
    },
    /// torque
    Constant {
        /// Any finite number.
        torque: f64,
    },
}

crate::named! {
    /// The kinds of couplings in world files.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum CouplingKind {
        /// [`Law::Spring`]
        Spring => "spring",
        /// [`Law::Damper`]
        Damper => "damper",
        /// [`Law::Wall`]
        Wall => "wall",
        /// [`Law::Detent`]
        Detent => "detent",
        /// [`Law::DeadBand`]
        DeadBand => "dead-band",
        /// [`Law::Magnet`]
        Magnet => "magnet",
        /// [`Law::Texture`]
        Texture => "texture",
        /// [`Law::Coulomb`] and [`Law::Lugre`]
        Friction => "friction",
        /// [`Law::Integral`]
        Integral => "integral",
        /// [`Law::Assist`]
        Assist => "assist",
        /// [`Law::Acceleration`]
        Acceleration => "acceleration",
        /// [`Law::Constant`]
        Constant => "constant",
    }
}

/// The properties in which the laws differ, in addition to their torques.
struct Traits {
    kind: CouplingKind,
    noun: &'static str,
    /// The q about which it acts.
    center: Option<f64>,
    /// The name of the number that its torque is proportional to, as a stiffness.
    strength: Option<&'static str>,
    takes_limit: bool,
    has_bristle: bool,
    integrates: bool,
    is_at_puck: bool,
    is_endless: bool,
}

impl Traits {
    /// A law without any of them.
    const fn plain(kind: CouplingKind, noun: &'static str) -> Self {
        Traits {
            kind,
            noun,
            center: None,
            strength: None,
            takes_limit: false,
            has_bristle: false,
            integrates: false,
            is_at_puck: false,
            is_endless: false,
        }
    }

    /// A law that acts about a q, as steep as one of its numbers.
    const fn about(self, center: f64, strength: &'static str) -> Self {
        Traits { center: Some(center), strength: Some(strength), ..self }
    }
}

/// Bounds on the slopes of a law's torque, and the magnitude of its dry friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slopes {
    /// The largest stiffness -dτ/dq, N·m/rad (linear: N/m); of a texture an upper bound of it.
    pub stiffness: f64,
    /// The largest damping -dτ/dq̇.
    pub damping: Damping,
    /// The largest torque of dry friction, N·m (linear: N).
    pub friction: f64,
}

/// A law that matrices hold: -(stiffness · q + damping · q̇) + torque on the first end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// N·m/rad (linear: N/m).
    pub stiffness: f64,
    /// N·m·s/rad (linear: N·s/m).
    pub damping: Damping,
    /// At q = 0 and q̇ = 0, N·m (linear: N).
    pub torque: f64,
}

impl Law {
    /// One of every law, with a valid value for each of its numbers: a damper by either rule, a wall on either side.
    pub const ALL: [Law; 15] = [
        Law::Spring { stiffness: 1.0, rest: 0.0 },
        Law::Damper { damping: Damping::Fixed(1.0) },
        Law::Damper { damping: Damping::Compensating },
        Law::Wall { side: Side::Above, at: 0.0, stiffness: 1.0, damping: 0.0 },
        Law::Wall { side: Side::Below, at: 0.0, stiffness: 1.0, damping: 0.0 },
        Law::Detent { torque: 1.0, pitch: 1.0, phase: 0.0 },
        Law::DeadBand { stiffness: 1.0, rest: 0.0, width: 1.0 },
        Law::Magnet { torque: 1.0, width: 1.0, at: 0.0 },
        Law::Texture { torque: 1.0, pitch: 1.0, phase: 0.0, waveform: Waveform::SINE },
        Law::Coulomb { torque: 1.0 },
        Law::Lugre {
            coulomb: 1.0,
            stribeck: 1.0,
            stribeck_velocity: 1.0,
            bristle_stiffness: 1.0,
            bristle_damping: 1.0,
            viscous: 1.0,
        },
        Law::Integral { stiffness: 1.0, time: 1.0, rest: 0.0 },
        Law::Assist { torque: 1.0, velocity: 1.0 },
        Law::Acceleration { inertia: 1.0, cutoff: 1.0 },
        Law::Constant { torque: 1.0 },
    ];

    /// Its numbers in the order of the documentation; a compensating damper has none.
    pub fn quantities(&mut self) -> impl Iterator<Item = Quantity<'_>> {
        use Range::{Any, Positive, ZeroOrMore};
        let of = |name, range, value| Quantity { name, range, value };
        let all = match self {
            Law::Spring { stiffness, rest } => padded([of("stiffness", ZeroOrMore, stiffness), of("rest", Any, rest)]),
            Law::Damper { damping: Damping::Fixed(damping) } => padded([of("damping", ZeroOrMore, damping)]),
            Law::Damper { damping: Damping::Compensating } => padded([]),
            Law::Wall { side: _, at, stiffness, damping } => {
                padded([of("at", Any, at), of("stiffness", ZeroOrMore, stiffness), of("damping", ZeroOrMore, damping)])
            }
            Law::Detent { torque, pitch, phase } | Law::Texture { torque, pitch, phase, waveform: _ } => {
                padded([of("torque", ZeroOrMore, torque), of("pitch", Positive, pitch), of("phase", Any, phase)])
            }
            Law::DeadBand { stiffness, rest, width } => {
                padded([of("stiffness", ZeroOrMore, stiffness), of("rest", Any, rest), of("width", ZeroOrMore, width)])
            }
            Law::Magnet { torque, width, at } => {
                padded([of("torque", ZeroOrMore, torque), of("width", Positive, width), of("at", Any, at)])
            }
            Law::Coulomb { torque } => padded([of("torque", ZeroOrMore, torque)]),
            Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => {
                padded([
                    of("coulomb", ZeroOrMore, coulomb),
                    of("stribeck", ZeroOrMore, stribeck),
                    of("stribeck_velocity", Positive, stribeck_velocity),
                    of("bristle_stiffness", ZeroOrMore, bristle_stiffness),
                    of("bristle_damping", ZeroOrMore, bristle_damping),
                    of("viscous", ZeroOrMore, viscous),
                ])
            }
            Law::Integral { stiffness, time, rest } => {
                padded([of("stiffness", ZeroOrMore, stiffness), of("time", Positive, time), of("rest", Any, rest)])
            }
            Law::Assist { torque, velocity } => {
                padded([of("torque", ZeroOrMore, torque), of("velocity", Positive, velocity)])
            }
            Law::Acceleration { inertia, cutoff } => {
                padded([of("inertia", ZeroOrMore, inertia), of("cutoff", Positive, cutoff)])
            }
            Law::Constant { torque } => padded([of("torque", Any, torque)]),
        };
        all.into_iter().flatten()
    }

    /// One row for each law.
    const fn traits(&self) -> Traits {
        use CouplingKind as Kind;
        let plain = Traits::plain;
        match *self {
            Law::Spring { rest, .. } => {
                Traits { takes_limit: true, ..plain(Kind::Spring, "a spring").about(rest, "stiffness") }
            }
            Law::Damper { .. } => Traits { takes_limit: true, ..plain(Kind::Damper, "a damper") },
            Law::Wall { at, .. } => Traits { takes_limit: true, ..plain(Kind::Wall, "a wall").about(at, "stiffness") },
            Law::Detent { phase, .. } => plain(Kind::Detent, "a detent").about(phase, "torque"),
            Law::DeadBand { rest, .. } => {
                Traits { takes_limit: true, ..plain(Kind::DeadBand, "a dead band").about(rest, "stiffness") }
            }
            Law::Magnet { at, .. } => plain(Kind::Magnet, "a magnet").about(at, "torque"),
            Law::Texture { phase, .. } => plain(Kind::Texture, "a texture").about(phase, "torque"),
            Law::Coulomb { .. } => Traits { is_endless: true, ..plain(Kind::Friction, "Coulomb friction") },
            Law::Lugre { .. } => Traits {
                strength: Some("bristle_stiffness"),
                has_bristle: true,
                ..plain(Kind::Friction, "LuGre friction")
            },
            Law::Integral { rest, .. } => Traits {
                center: Some(rest),
                takes_limit: true,
                integrates: true,
                is_at_puck: true,
                is_endless: true,
                ..plain(Kind::Integral, "an integral term")
            },
            Law::Assist { .. } => Traits { is_at_puck: true, is_endless: true, ..plain(Kind::Assist, "an assist") },
            Law::Acceleration { .. } => Traits {
                takes_limit: true,
                is_at_puck: true,
                ..plain(Kind::Acceleration, "a torque along the acceleration")
            },
            Law::Constant { torque } => {
                Traits { is_endless: torque != 0.0, ..plain(Kind::Constant, "a constant torque") }
            }
        }
    }

    /// Its kind in world files.
    pub const fn kind(&self) -> CouplingKind {
        self.traits().kind
    }

    /// Its name, with its article.
    pub const fn noun(&self) -> &'static str {
        self.traits().noun
    }

    /// The number that its torque is proportional to, as a stiffness: `None` where it has no slope against q.
    pub fn strength(&mut self) -> Option<Quantity<'_>> {
        let name = self.traits().strength?;
        self.quantities().find(|quantity| quantity.name == name)
    }

    /// Its steepest slopes.
    pub fn slopes(&self) -> Slopes {
        let none = Slopes { stiffness: 0.0, damping: Damping::Fixed(0.0), friction: 0.0 };
        match *self {
            Law::Spring { stiffness, .. } => Slopes { stiffness, ..none },
            Law::Damper { damping } => Slopes { damping, ..none },
            Law::Wall { stiffness, damping, .. } => Slopes { stiffness, damping: Damping::Fixed(damping), ..none },
            Law::Detent { torque, pitch, .. } => Slopes { stiffness: core::f64::consts::TAU * torque / pitch, ..none },
            Law::DeadBand { stiffness, .. } => Slopes { stiffness, ..none },
            Law::Magnet { torque, width, .. } => Slopes { stiffness: magnet::ROOT_E * torque / width, ..none },
            Law::Texture { torque, pitch, ref waveform, .. } => {
                Slopes { stiffness: core::f64::consts::TAU * torque / pitch * waveform.slope(), ..none }
            }
            Law::Coulomb { torque } => Slopes { friction: torque, ..none },
            Law::Lugre { coulomb, stribeck, bristle_stiffness, bristle_damping, viscous, .. } => Slopes {
                stiffness: bristle_stiffness,
                damping: Damping::Fixed(bristle_damping + viscous),
                friction: coulomb.max(stribeck),
            },
            Law::Integral { .. } | Law::Assist { .. } | Law::Acceleration { .. } | Law::Constant { .. } => none,
        }
    }

    /// The q about which it acts: its rest or its face. `None` for a law that does not depend on q.
    pub const fn center(&self) -> Option<f64> {
        self.traits().center
    }

    /// Whether it is the integral term of a controller, whose torque depends on all of the past.
    pub const fn integrates(&self) -> bool {
        self.traits().integrates
    }

    /// Whether it is allowed only between puck and ground, and without an advance: it depends on how the puck moves, or has moved.
    pub const fn is_at_puck(&self) -> bool {
        self.traits().is_at_puck
    }

    /// Whether it may hold a torque at rest that is 0 at no q: an origin that follows it would slip for ever.
    pub const fn is_endless(&self) -> bool {
        self.traits().is_endless
    }

    /// Whether it has a bristle, an internal state that bends with the motion.
    pub const fn has_bristle(&self) -> bool {
        self.traits().has_bristle
    }

    /// Whether it has a state of its own: a bristle, the sum of an integral term, the low-passed velocity of a torque along the acceleration.
    pub const fn has_state(&self) -> bool {
        self.has_bristle() || self.integrates() || matches!(self, Law::Acceleration { .. })
    }

    /// Whether its torque can be held within a limit, on both ends.
    pub const fn takes_limit(&self) -> bool {
        self.traits().takes_limit
    }

    /// On which side a wall pushes; `None` for every other law.
    pub const fn side(&self) -> Option<Side> {
        if let Law::Wall { side, .. } = *self { Some(side) } else { None }
    }

    /// A texture's waveform; `None` for every other law.
    pub const fn waveform(&self) -> Option<&Waveform> {
        if let Law::Texture { waveform, .. } = self { Some(waveform) } else { None }
    }

    /// The same, to be changed.
    pub const fn waveform_mut(&mut self) -> Option<&mut Waveform> {
        if let Law::Texture { waveform, .. } = self { Some(waveform) } else { None }
    }

    /// A constant's torque; `None` for every other law.
    pub const fn constant(&self) -> Option<f64> {
        if let Law::Constant { torque } = *self { Some(torque) } else { None }
    }

    /// A spring's stiffness in N·m/rad (linear: N/m), the input of a compensating damper; `None` for every other law.
    pub const fn spring(&self) -> Option<f64> {
        if let Law::Spring { stiffness, .. } = *self { Some(stiffness) } else { None }
    }

    /// A damper's damping; `None` for every other law.
    pub const fn damper(&mut self) -> Option<&mut Damping> {
        if let Law::Damper { damping } = self { Some(damping) } else { None }
    }

    /// Whether it is a damper whose damping follows the springs in parallel with it.
    pub const fn is_compensating(&self) -> bool {
        matches!(self, Law::Damper { damping: Damping::Compensating })
    }

    /// As matrices, without a limit; `None` for a nonlinear law.
    pub(crate) fn linear(&self) -> Option<Linear> {
        let damping = Damping::Fixed(0.0);
        match *self {
            Law::Spring { stiffness, rest } => Some(Linear { stiffness, damping, torque: stiffness * rest }),
            Law::Damper { damping } => Some(Linear { stiffness: 0.0, damping, torque: 0.0 }),
            Law::Constant { torque } => Some(Linear { stiffness: 0.0, damping, torque }),
            Law::Wall { .. }
            | Law::Detent { .. }
            | Law::DeadBand { .. }
            | Law::Magnet { .. }
            | Law::Texture { .. }
            | Law::Coulomb { .. }
            | Law::Lugre { .. }
            | Law::Integral { .. }
            | Law::Assist { .. }
            | Law::Acceleration { .. } => None,
        }
    }

    /// The energy in J that it stores at q, with the present deflection of a friction's bristle, where its torque is held within `limit`;
    /// infinite: any.
    pub(crate) fn stored(&self, q: f64, bristle: f64, limit: f64) -> f64 {
        match *self {
            Law::Spring { stiffness, rest } => spring::energy(stiffness, q - rest, limit),
            Law::Wall { side, at, stiffness, .. } => wall::energy(side, at, stiffness, q, limit),
            Law::Detent { torque, pitch, phase } => Detent { torque, pitch, phase: reduced(phase, pitch) }.energy(q),
            Law::DeadBand { stiffness, rest, width } => dead_band::energy(stiffness, rest, width, q, limit),
            Law::Magnet { torque, width, at } => magnet::energy(torque, width, at, q),
            Law::Texture { torque, pitch, phase, ref waveform } => texture::energy(torque, pitch, phase, waveform, q),
            Law::Constant { torque } => -torque * q,
            Law::Lugre { bristle_stiffness, .. } => 0.5 * bristle_stiffness * (bristle * bristle),
            Law::Damper { .. }
            | Law::Coulomb { .. }
            | Law::Integral { .. }
            | Law::Assist { .. }
            | Law::Acceleration { .. } => 0.0,
        }
    }
}

/// Phases up to this many pitches are not reduced.
const MAX_PITCHES: f64 = 16.0;
/// A number of this many pitches has no digits within one pitch.
const WHOLE_PITCHES: f64 = 9_007_199_254_740_992.0;

/// An equivalent phase of a periodic law, of a few pitches at most: with a phase of many pitches the position would be lost in rounding. It
/// errs by the rounding of the phase itself; `libm::fmod` would not, but contains a panic.
pub(crate) fn reduced(phase: f64, pitch: f64) -> f64 {
    let pitches = phase / pitch;
    match libm::fabs(pitches) {
        few if few <= MAX_PITCHES => phase,
        many if many < WHOLE_PITCHES => phase - pitch * libm::floor(pitches),
        _ => 0.0,
    }
}
