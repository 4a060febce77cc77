//! The couplings that no matrix represents: wall, detent, the two frictions, the integral term, the torque along the acceleration, and couplings with a limit.

use core::mem::discriminant;

use crate::contact::{Solution, StepResponse};
use crate::lanes::each;
use crate::law::{
    Acceleration, Coulomb, Damper, DeadBand, Detent, Integral, Lugre, Magnet, Spring, Texture, Wall, direction,
    filtered, gain, most, reduced,
};
use crate::spec::sign_at_puck;
use crate::{Coupling, Damping, End, Lanes, Law, Number, Real, Vector};

/// A law as a loop runs it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LoopLaw<F> {
    Wall(Wall<F>),
    /// With a limit; the others are matrices.
    Spring(Spring<F>),
    /// With a limit; an assist is one of negative damping.
    Damper(Damper<F>),
    Detent(Detent<F>),
    DeadBand(DeadBand<F>),
    Magnet(Magnet<F>),
    Texture(Texture<F>),
    Coulomb(Coulomb<F>),
    Lugre(Lugre<F>),
    Integral(Integral<F>),
    Acceleration(Acceleration<F>),
}

/// A nonlinear coupling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nonlinear<F> {
    pub first: End,
    pub second: End,
    /// Whether the law does not determine its torque: Coulomb friction at a body, whose torque a discrete-gradient step finds.
    pub is_found: bool,
    pub curve: LoopLaw<F>,
}

/// q and q̇ of a coupling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relative<F> {
    pub position: F,
    pub velocity: F,
}

impl<F: Number> Nonlinear<F> {
    /// Whether either end is a body.
    pub fn at_body(&self) -> bool {
        self.first.body().is_some() || self.second.body().is_some()
    }

    /// Whether it has a torque, a bristle, an integral or a velocity from earlier in the run.
    pub fn remembers(&self) -> bool {
        let (bristle, torque) = self.keeps();
        bristle || torque
    }

    /// Whether it keeps a bristle, an integral or a velocity, and whether a torque that was found at a body.
    fn keeps(&self) -> (bool, bool) {
        match self.curve {
            LoopLaw::Lugre(_) | LoopLaw::Integral(_) | LoopLaw::Acceleration(_) => (true, false),
            LoopLaw::Coulomb(_) => (false, self.is_found),
            LoopLaw::Wall(_)
            | LoopLaw::Spring(_)
            | LoopLaw::Damper(_)
            | LoopLaw::Detent(_)
            | LoopLaw::DeadBand(_)
            | LoopLaw::Magnet(_)
            | LoopLaw::Texture(_) => (false, false),
        }
    }

    /// The sign of this coupling's torque on the puck; 0 when it is not tied to it.
    #[inline(always)]
    pub fn sign_at_puck(&self) -> f64 {
        sign_at_puck(self.first, self.second)
    }

    /// q and q̇ with the puck and the bodies as given.
    #[inline(always)]
    pub fn relative<const B: usize>(&self, puck: (F, F), bodies: &Vector<F, B>) -> Relative<F> {
        let at = |end: End| match end {
            End::Puck => puck,
            End::Ground => (F::ZERO, F::ZERO),
            // The index was checked when the loop was compiled.
            End::Body(i) => {
                (bodies.position.get(i).copied().unwrap_or(F::ZERO), bodies.velocity.get(i).copied().unwrap_or(F::ZERO))
            }
        };
        let (first, second) = (at(self.first), at(self.second));
        Relative { position: first.0 - second.0, velocity: first.1 - second.1 }
    }

    /// The bristle after a period `t` in s at q̇ held, or the integral or the low-passed velocity after a sample; the other laws have none of
    /// them.
    #[inline(always)]
    pub fn bend(&self, bristle: F, q: Relative<F>, t: F) -> F {
        match self.curve {
            LoopLaw::Lugre(lugre) => lugre.bend(bristle, q.velocity, t),
            LoopLaw::Integral(integral) => integral.sum(bristle, q.position, t),
            LoopLaw::Acceleration(acceleration) => acceleration.smooth(bristle, q.velocity, t),
            LoopLaw::Wall(_)
            | LoopLaw::Spring(_)
            | LoopLaw::Damper(_)
            | LoopLaw::Detent(_)
            | LoopLaw::DeadBand(_)
            | LoopLaw::Magnet(_)
            | LoopLaw::Texture(_)
            | LoopLaw::Coulomb(_) => bristle,
        }
    }

    /// The torque on the first end, with LuGre's bristle, the integral or the low-passed velocity at their present values.
    #[inline(always)]
    pub fn torque(&self, q: Relative<F>, bristle: F) -> F {
        match &self.curve {
            LoopLaw::Wall(wall) => wall.torque(q.position, q.velocity),
            LoopLaw::Spring(spring) => spring.torque(q.position),
            LoopLaw::Damper(damper) => damper.torque(q.velocity),
            LoopLaw::Detent(detent) => detent.torque(q.position),
            LoopLaw::DeadBand(band) => band.torque(q.position),
            LoopLaw::Magnet(magnet) => magnet.torque(q.position),
            LoopLaw::Texture(texture) => texture.torque(q.position),
            LoopLaw::Coulomb(coulomb) => coulomb.torque(q.velocity),
            LoopLaw::Lugre(lugre) => lugre.torque(bristle, q.velocity),
            LoopLaw::Integral(integral) => integral.torque(bristle),
            LoopLaw::Acceleration(acceleration) => acceleration.torque(bristle, q.velocity),
        }
    }
}

impl<F: Real> Nonlinear<F> {
    /// `None` for the couplings that are matrices. `compensating` is the damping of a damper that follows the springs, `finds` whether the
    /// method finds the torques at bodies.
    pub fn new(coupling: &Coupling, compensating: f64, finds: bool) -> Option<Self> {
        if coupling.linear().is_some() {
            return None;
        }
        let f = F::from_f64;
        let limit = f(coupling.limit.unwrap_or(f64::INFINITY));
        let curve = match coupling.law {
            Law::Constant { .. } => return None,
            Law::Spring { stiffness, rest } => {
                LoopLaw::Spring(Spring { stiffness: f(stiffness), rest: f(rest), limit })
            }
            Law::Damper { damping } => {
                let damping = match damping {
                    Damping::Fixed(damping) => damping,
                    Damping::Compensating => compensating,
                };
                LoopLaw::Damper(Damper { damping: f(damping), limit })
            }
            Law::Wall { side, at, stiffness, damping } => LoopLaw::Wall(Wall {
                direction: f(direction(side)),
                at: f(at),
                stiffness: f(stiffness),
                damping: f(damping),
                limit,
            }),
            Law::Detent { torque, pitch, phase } => {
                LoopLaw::Detent(Detent { torque: f(torque), pitch: f(pitch), phase: f(reduced(phase, pitch)) })
            }
            Law::DeadBand { stiffness, rest, width } => {
                LoopLaw::DeadBand(DeadBand { stiffness: f(stiffness), rest: f(rest), width: f(width), limit })
            }
            Law::Magnet { torque, width, at } => {
                LoopLaw::Magnet(Magnet { torque: f(torque), width: f(width), at: f(at) })
            }
            Law::Texture { torque, pitch, phase, ref waveform } => {
                LoopLaw::Texture(Texture::new(torque, pitch, phase, waveform))
            }
            Law::Coulomb { torque } => LoopLaw::Coulomb(Coulomb { torque: f(torque) }),
            Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => {
                LoopLaw::Lugre(Lugre {
                    coulomb: f(coulomb),
                    stribeck: f(stribeck),
                    stribeck_velocity: f(stribeck_velocity),
                    bristle_stiffness: f(bristle_stiffness),
                    bristle_damping: f(bristle_damping),
                    viscous: f(viscous),
                })
            }
            Law::Assist { torque, velocity } => {
                LoopLaw::Damper(Damper { damping: f(-gain(torque, velocity)), limit: f(torque) })
            }
            Law::Integral { stiffness, time, rest } => {
                let bound = most(stiffness, time, coupling.limit.unwrap_or(f64::INFINITY));
                LoopLaw::Integral(Integral { gain: f(stiffness / time), rest: f(rest), most: f(bound) })
            }
            Law::Acceleration { inertia, cutoff } => {
                let (gain, tau) = filtered(inertia, cutoff);
                LoopLaw::Acceleration(Acceleration { gain: f(gain), tau: f(tau), limit })
            }
        };
        let is_found = finds && coupling.is_at_body() && matches!(curve, LoopLaw::Coulomb(_));
        Some(Nonlinear { first: coupling.first, second: coupling.second, is_found, curve })
    }

    /// The torque on the first end, held over the step of 1/`rate` seconds.
    pub fn solve(&self, response: &StepResponse<F>, rate: F) -> Solution<F> {
        match &self.curve {
            LoopLaw::Wall(wall) => wall.solve(response, rate),
            LoopLaw::Spring(spring) => spring.solve(response),
            LoopLaw::Damper(damper) => damper.solve(response, rate),
            LoopLaw::Detent(detent) => detent.solve(response),
            LoopLaw::DeadBand(band) => band.solve(response),
            LoopLaw::Magnet(magnet) => magnet.solve(response),
            LoopLaw::Texture(texture) => texture.solve(response),
            LoopLaw::Coulomb(coulomb) => coulomb.solve(response),
            // Refused at bodies when the loop was compiled.
            LoopLaw::Lugre(_) | LoopLaw::Integral(_) | LoopLaw::Acceleration(_) => Solution::fixed(F::ZERO),
        }
    }

    /// The torque on the first end over a step of 1/`rate` seconds in which q goes from `start` by `distance`; 0 of Coulomb friction, which
    /// the displacement does not determine.
    pub fn over_step(&self, start: F, distance: F, puck_rate: F, rate: F) -> F {
        match &self.curve {
            LoopLaw::Wall(wall) => wall.over_step(start, distance, rate),
            LoopLaw::Damper(damper) => damper.torque(distance * rate + puck_rate),
            LoopLaw::Spring(_)
            | LoopLaw::Detent(_)
            | LoopLaw::DeadBand(_)
            | LoopLaw::Magnet(_)
            | LoopLaw::Texture(_) => -self.stored_slope(start, distance),
            LoopLaw::Coulomb(_) | LoopLaw::Lugre(_) | LoopLaw::Integral(_) | LoopLaw::Acceleration(_) => F::ZERO,
        }
    }

    /// Bounds on that torque at the solutions of a step that would go by `free` without it, and on its slope by the distance. A torque that
    /// falls with the distance everywhere is no larger at a solution than at `free`, where it drives q on.
    pub fn bounds(&self, start: F, free: F, puck_rate: F, rate: F) -> (F, F) {
        let pi = F::from_f64(core::f64::consts::PI);
        let there = self.over_step(start, free, puck_rate, rate).abs();
        match &self.curve {
            LoopLaw::Wall(wall) => {
                let undamped = wall.over_step_undamped(start, free).abs();
                (if undamped > there { undamped } else { there }, wall.stiffness + wall.damping * rate)
            }
            LoopLaw::Spring(spring) => (there, spring.stiffness),
            LoopLaw::DeadBand(band) => (there, band.stiffness),
            LoopLaw::Damper(damper) => (there, damper.damping * rate),
            // A mean torque changes by at most half of the steepest slope.
            LoopLaw::Detent(detent) => (detent.torque, pi * detent.torque / detent.pitch),
            LoopLaw::Magnet(magnet) => (magnet.torque, magnet.torque / magnet.width),
            LoopLaw::Texture(texture) => texture.bounds(),
            LoopLaw::Coulomb(coulomb) => (coulomb.torque, F::ZERO),
            LoopLaw::Lugre(_) | LoopLaw::Integral(_) | LoopLaw::Acceleration(_) => (F::ZERO, F::ZERO),
        }
    }

    /// The distance within which two solutions count as one; `None` where there is only one.
    pub fn fine(&self) -> Option<F> {
        let part = F::from_f64(1.0 / 64.0);
        match &self.curve {
            LoopLaw::Detent(detent) => Some(detent.pitch * part),
            LoopLaw::Magnet(magnet) => Some(magnet.width * part),
            LoopLaw::Texture(texture) => Some(texture.fine()),
            LoopLaw::Wall(_)
            | LoopLaw::Spring(_)
            | LoopLaw::Damper(_)
            | LoopLaw::DeadBand(_)
            | LoopLaw::Coulomb(_)
            | LoopLaw::Lugre(_)
            | LoopLaw::Integral(_)
            | LoopLaw::Acceleration(_) => None,
        }
    }

    /// Coulomb friction's level; `None` of every other law.
    pub fn coulomb(&self) -> Option<F> {
        if let LoopLaw::Coulomb(coulomb) = &self.curve { Some(coulomb.torque) } else { None }
    }

    /// +1 where it is between the same bodies as another, so that both are moved alike by a torque at either, -1 where the other way round; `None`
    /// where it is not.
    pub fn along(&self, other: &Self) -> Option<F> {
        let (own, its) = ([self.first.body(), self.second.body()], [other.first.body(), other.second.body()]);
        if own == its {
            Some(F::ONE)
        } else if own[0] == its[1] && own[1] == its[0] {
            Some(-F::ONE)
        } else {
            None
        }
    }

    /// Whether it is a wall out of reach from `start` to `start + distance`.
    #[inline]
    pub fn is_clear(&self, start: F, distance: F) -> bool {
        match &self.curve {
            LoopLaw::Wall(wall) => wall.is_clear(start, distance),
            LoopLaw::Spring(_)
            | LoopLaw::Damper(_)
            | LoopLaw::Detent(_)
            | LoopLaw::DeadBand(_)
            | LoopLaw::Magnet(_)
            | LoopLaw::Texture(_)
            | LoopLaw::Coulomb(_)
            | LoopLaw::Lugre(_)
            | LoopLaw::Integral(_)
            | LoopLaw::Acceleration(_) => false,
        }
    }

    /// (V(q + distance) - V(q))/distance of the coupling's energy, its limit at 0; 0 for a coupling that only dissipates.
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        match &self.curve {
            LoopLaw::Wall(wall) => wall.stored_slope(start, distance),
            LoopLaw::Spring(spring) => spring.stored_slope(start, distance),
            LoopLaw::Detent(detent) => detent.stored_slope(start, distance),
            LoopLaw::DeadBand(band) => band.stored_slope(start, distance),
            LoopLaw::Magnet(magnet) => magnet.stored_slope(start, distance),
            LoopLaw::Texture(texture) => texture.stored_slope(start, distance),
            LoopLaw::Damper(_)
            | LoopLaw::Coulomb(_)
            | LoopLaw::Lugre(_)
            | LoopLaw::Integral(_)
            | LoopLaw::Acceleration(_) => F::ZERO,
        }
    }
}

/// The numbers of every law: their names, and how lanes hold them side by side.
macro_rules! numbers {
    ($($law:ident $kind:literal { $($number:ident),* })*) => {
        impl<F: Number> LoopLaw<F> {
            /// Its name among [`crate::Constants`].
            pub fn kind(&self) -> &'static str {
                match self {
                    $(LoopLaw::$law(_) => $kind,)*
                    LoopLaw::Texture(_) => "texture",
                }
            }

            /// Each of its numbers with its name; of a texture all except its harmonics.
            pub fn numbers(&self, mut each: impl FnMut(&'static str, F)) {
                match self {
                    $(LoopLaw::$law(law) => { $(each(stringify!($number), law.$number);)* })*
                    LoopLaw::Texture(texture) => {
                        each("pitch", texture.pitch);
                        each("phase", texture.phase);
                    }
                }
            }
        }

        /// The law of these lanes, with their numbers side by side.
        fn side_by_side<const N: usize>(laws: [LoopLaw<f64>; N], first: LoopLaw<f64>) -> LoopLaw<Lanes<N>> {
            match first {
                $(LoopLaw::$law(first) => {
                    let of = |law: &LoopLaw<f64>| if let LoopLaw::$law(law) = *law { law } else { first };
                    LoopLaw::$law($law { $($number: each(&laws, &|law| of(law).$number)),* })
                })*
                LoopLaw::Texture(first) => {
                    let of = |law: LoopLaw<f64>| if let LoopLaw::Texture(texture) = law { texture } else { first };
                    LoopLaw::Texture(Texture::side_by_side(laws.map(of)))
                }
            }
        }
    };
}

numbers! {
    Wall "wall" { direction, at, stiffness, damping, limit }
    Spring "spring" { stiffness, rest, limit }
    Damper "damper" { damping, limit }
    Detent "detent" { torque, pitch, phase }
    DeadBand "dead_band" { stiffness, rest, width, limit }
    Magnet "magnet" { torque, width, at }
    Coulomb "coulomb" { torque }
    Lugre "lugre" { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous }
    Integral "integral" { gain, rest, most }
    Acceleration "acceleration" { gain, tau, limit }
}

impl<const N: usize> Nonlinear<Lanes<N>> {
    /// One coupling of each of N worlds; `None` where they differ in more than their numbers.
    pub fn side_by_side(couplings: [Nonlinear<f64>; N]) -> Option<Self> {
        let Nonlinear { first, second, is_found, curve } = *couplings.first()?;
        let alike = |other: &Nonlinear<f64>| {
            (other.first, other.second, other.is_found) == (first, second, is_found)
                && discriminant(&other.curve) == discriminant(&curve)
        };
        let curve = side_by_side(couplings.map(|coupling| coupling.curve), curve);
        couplings.iter().all(alike).then_some(Nonlinear { first, second, is_found, curve })
    }
}
