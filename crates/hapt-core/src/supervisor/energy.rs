//! The energy that a world stores, and that a step of it may add: the couplings as energies.
//!
//! The loop's matrices contain only torques. This is derived from the spec a second time, and so is a check of them.

use crate::compile::compensated;
use crate::contact::within;
use crate::law::{HARMONICS, filtered, gain, reduced};
use crate::spec::sign_at_puck;
use crate::supervisor::springs::{Springs, Well};
use crate::supervisor::sums::{Step, Sums};
use crate::{Constants, Coupling, Damping, End, Law, Method, Real, Side, Spec, State};

/// √e
const ROOT_E: f64 = 1.648_721_270_700_128_2;

/// A potential V(q).
#[derive(Clone, Copy, Debug)]
enum Potential<F> {
    Nothing,
    /// stiffness · x²/2 up to the x at which the torque is `limit`, linear from there on; x = |q - rest|, or inside of a wall's face.
    Spring {
        stiffness: F,
        rest: F,
        /// +1: above the rest only (a wall), -1: below it only, 0: both sides.
        side: F,
        limit: F,
    },
    /// torque · pitch/2π · (1 - cos 2π(q - phase)/pitch)
    Detent {
        torque: F,
        pitch: F,
        phase: F,
    },
    /// stiffness · y²/2 up to the y at which the torque is `limit`, linear from there on; y = |q - rest| - width where positive, or 0.
    DeadBand {
        stiffness: F,
        rest: F,
        width: F,
        limit: F,
    },
    /// torque · width · (√e - exp((1 - x²)/2)), x = (q - at)/width
    Magnet {
        torque: F,
        width: F,
        at: F,
    },
    /// base + Σ (sine cos nθ - cosine sin nθ)/n, θ = 2π(q - phase)/pitch, with torque · pitch/2π in base and factors
    Texture {
        pitch: F,
        phase: F,
        /// Σ √(sine² + cosine²)/n
        base: F,
        sine: [F; HARMONICS],
        cosine: [F; HARMONICS],
    },
    /// stiffness · s²/2 of the coupling's bristle.
    Bristle {
        stiffness: F,
    },
}

/// q of a coupling: puck · z + (first · w of one body - second · w of another); the factors are 0, 1 or -1.
#[derive(Clone, Copy, Debug)]
struct Ends<F> {
    puck: F,
    first: (usize, F),
    second: (usize, F),
}

/// One coupling: the energy that it stores, transmits from the puck, and gives.
#[derive(Clone, Copy, Debug)]
struct Part<F> {
    ends: Ends<F>,
    /// Which coupling it is.
    place: usize,
    potential: Potential<F>,
    /// N·m·s/rad (N·s/m)
    damping: F,
    /// The largest torque of a friction, N·m (N).
    friction: F,
    /// A constant's torque.
    constant: F,
    /// Between the puck and a body: only such a coupling transmits the puck's motion into a held step.
    carries: bool,
}

/// The torque on the puck of a coupling that is an energy source: by_state · s + by_velocity · ż, within ±most.
#[derive(Clone, Copy, Debug)]
struct Source<F> {
    by_state: F,
    by_velocity: F,
    most: F,
}

impl<F: Real> Source<F> {
    const NONE: Self = Source { by_state: F::ZERO, by_velocity: F::ZERO, most: F::ZERO };

    /// `None` of a coupling that is none.
    fn of(coupling: &Coupling) -> Option<Self> {
        let sign = sign_at_puck(coupling.first, coupling.second);
        let [by_state, by_velocity, most] = match coupling.law {
            // Its sum stops at its limit.
            Law::Integral { stiffness, time, .. } => [-(stiffness / time) * sign, 0.0, f64::INFINITY],
            Law::Assist { torque, velocity } => [0.0, gain(torque, velocity), torque],
            Law::Acceleration { inertia, cutoff } => {
                let (gain, _) = filtered(inertia, cutoff);
                [-gain * sign, gain, coupling.limit.unwrap_or(f64::INFINITY)]
            }
            Law::Spring { .. }
            | Law::Damper { .. }
            | Law::Wall { .. }
            | Law::Detent { .. }
            | Law::DeadBand { .. }
            | Law::Magnet { .. }
            | Law::Texture { .. }
            | Law::Coulomb { .. }
            | Law::Lugre { .. }
            | Law::Constant { .. } => return None,
        };
        let f = F::from_f64;
        Some(Source { by_state: f(by_state), by_velocity: f(by_velocity), most: f(most) })
    }
}

/// A world's energies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Energy<F, const B: usize, const C: usize> {
    bodies: usize,
    springs: Springs<F, B, C>,
    /// All parts that are not plain springs.
    parts: [Part<F>; C],
    part_count: usize,
    /// 1/T, T here and below the bodies' step.
    rate: F,
    /// T/2 where the method keeps V - T/2 · V'(q) q̇ in place of V (semi-implicit Euler), else 0.
    lag: F,
    /// How many samples after each step of the bodies they stand still.
    skips: u32,
    /// Whether the puck is held during a step: not by the methods that take the new sample first.
    holds: bool,
    /// Whether the bodies' own energies are the only ones, and the bodies step at every sample, with the puck held.
    is_all: bool,
    /// Whether the bodies see a filtered position: then the energy of their steps is computed with that. The stored energy is computed at
    /// the measured position, where the hand does its work.
    sees_filtered: bool,
    /// The torques of all constants on the puck.
    constant: F,
    sources: [Source<F>; C],
    has_sources: bool,
}

impl<F: Real, const B: usize, const C: usize> Energy<F, B, C> {
    /// For a world that the loop has compiled.
    pub fn new(spec: &Spec) -> Self {
        let f = F::from_f64;
        let lag = if spec.method == Method::SemiImplicitEuler { f(0.5 * spec.step()) } else { F::ZERO };
        let mut constant = 0.0;
        for coupling in spec.couplings {
            if let Law::Constant { torque } = coupling.law {
                constant += torque * sign_at_puck(coupling.first, coupling.second);
            }
        }
        let mut energy = Energy {
            bodies: spec.bodies.len().min(B),
            springs: Springs::new(spec),
            parts: [Part::NONE; C],
            part_count: 0,
            rate: f(1.0 / spec.step()),
            lag,
            skips: spec.bodies_every.saturating_sub(1),
            holds: !spec.method.takes_new_sample_first(),
            is_all: false,
            sees_filtered: spec.filter.is_some() && !spec.bodies.is_empty(),
            constant: f(constant),
            sources: [Source::NONE; C],
            has_sources: false,
        };
        for (source, coupling) in energy.sources.iter_mut().zip(spec.couplings) {
            if let Some(found) = Source::of(coupling) {
                *source = found;
                energy.has_sources = true;
            }
        }
        for (place, coupling) in spec.couplings.iter().enumerate() {
            let part = part(spec, coupling);
            match part.well().filter(|_| lag == F::ZERO) {
                Some(well) => energy.springs.add(coupling.first, coupling.second, well),
                None => energy.add(place, part),
            }
        }
        energy.is_all = energy.springs.are_at_bodies() && energy.part_count == 0 && energy.holds && energy.skips == 0;
        energy
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        self.springs.constants(self.bodies, to);
        to.number("lag", "T/2 where the method keeps V - T/2 V' q', else 0", self.lag.to_f64());
        to.whole("holds", "whether a step is made with the puck held", i64::from(self.holds));
        to.whole("is_all", "whether the bodies' own energies are all", i64::from(self.is_all));
        to.number("constant", "the torques of all constants on the puck", self.constant.to_f64());
        for part in self.parts.iter().take(self.part_count) {
            part.constants(to);
        }
    }

    fn add(&mut self, place: usize, part: Part<F>) {
        // Between puck and ground, or between bodies, a damper has no part in this sum.
        let counts = part.carries || part.constant != F::ZERO || !matches!(part.potential, Potential::Nothing);
        if let (true, Some(room)) = (counts, self.parts.get_mut(self.part_count)) {
            *room = Part { place, ..part };
            self.part_count += 1;
        }
    }

    /// The torque on the puck of couplings that are energy sources, at `state` and the puck's `velocity`: constants, integral terms, which
    /// give the same energy in every slow turn of the hand, assists, and torques along the acceleration, which take part of the device's
    /// damping (docs/theory.md, (T72), (T76), (T78)). The ledgers leave its work out.
    #[inline]
    pub fn sources<const W: usize>(&self, state: &State<F, B, C, W>, velocity: F) -> F {
        if self.has_sources { self.with_sources(&state.bristles, velocity) } else { self.constant }
    }

    #[cold]
    #[inline(never)]
    fn with_sources(&self, states: &[F; C], velocity: F) -> F {
        let mut torque = self.constant;
        for (source, state) in self.sources.iter().zip(states) {
            torque += within(source.by_state * *state + source.by_velocity * velocity, -source.most, source.most);
        }
        torque
    }

    /// The step that `state` has just taken, at the puck's measured position and velocity; only the stored energy where it has taken none.
    #[inline]
    pub fn step<const W: usize>(&self, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        if self.sees_filtered { self.step_behind_filter(state, puck) } else { self.step_at(state, puck) }
    }

    #[cold]
    #[inline(never)]
    fn step_behind_filter<const W: usize>(&self, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        let stored = self.step_at(state, puck).stored;
        Step { stored, ..self.step_at(state, (state.memory.filtered, puck.1)) }
    }

    #[inline(always)]
    fn step_at<const W: usize>(&self, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        match self.bodies {
            1 => self.step_of(1, state, puck),
            n => self.step_of(n, state, puck),
        }
    }

    /// The step of a world of n bodies.
    #[inline(always)]
    fn step_of<const W: usize>(&self, n: usize, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        let sums = self.springs.of_bodies(n, state, puck.0);
        if self.is_all { sums.step() } else { self.step_with(sums, state, puck) }
    }

    /// The step with all other parts of the world.
    #[inline(never)]
    fn step_with<const W: usize>(&self, mut sums: Sums<F>, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        self.springs.of_others(&mut sums, state, puck.0);
        if self.part_count > 0 {
            self.parts(&mut sums, state, puck);
        }
        let step = sums.step();
        // Where the bodies stand still, constants do no work on them.
        if state.until_step < self.skips {
            return Step { made: F::ZERO, given: F::ZERO, ..step };
        }
        if self.holds { step } else { Step { made: F::ZERO, ..step } }
    }

    /// All parts that are not plain springs. They are out of line: they need a sine.
    #[inline(never)]
    fn parts<const W: usize>(&self, sums: &mut Sums<F>, state: &State<F, B, C, W>, puck: (F, F)) {
        let (from, change) = (&state.now, &state.change);
        for part in self.parts.iter().take(self.part_count) {
            let bristle = state.bristles.get(part.place).copied().unwrap_or(F::ZERO);
            let (between, moved) = part.ends.bodies(&from.position, &change.position);
            let (rate, turned) = part.ends.bodies(&from.velocity, &change.velocity);
            let q = part.ends.puck * puck.0 + between;
            sums.before += part.potential.at(q, bristle, self.lag * rate);
            sums.after += part.potential.at(q + moved, bristle, self.lag * (rate + turned));
            sums.given += part.constant * moved;
            if part.carries && puck.1 != F::ZERO {
                let work = -(part.damping * (part.ends.puck * puck.1 + moved * self.rate) * moved);
                sums.carried += if work > F::ZERO { work } else { F::ZERO };
                sums.carried += part.friction * moved.abs();
            }
        }
    }
}

impl<F: Real> Ends<F> {
    const NONE: Self = Ends { puck: F::ZERO, first: (0, F::ZERO), second: (0, F::ZERO) };

    fn new(first: End, second: End) -> Self {
        let body = |end: End| end.body().map_or((0, F::ZERO), |i| (i, F::ONE));
        let puck = F::from_f64(sign_at_puck(first, second));
        Ends { puck, first: body(first), second: body(second) }
    }

    /// The bodies' part of q, and of its change.
    #[inline]
    fn bodies<const B: usize>(&self, from: &[F; B], change: &[F; B]) -> (F, F) {
        let of = |(i, factor): (usize, F)| match (from.get(i), change.get(i)) {
            (Some(x), Some(dx)) => (factor * *x, factor * *dx),
            _ => (F::ZERO, F::ZERO),
        };
        let (first, second) = (of(self.first), of(self.second));
        (first.0 - second.0, first.1 - second.1)
    }
}

impl<F: Real> Part<F> {
    const NONE: Self = Part {
        ends: Ends::NONE,
        place: 0,
        potential: Potential::Nothing,
        damping: F::ZERO,
        friction: F::ZERO,
        constant: F::ZERO,
        carries: false,
    };

    fn constants(&self, to: &mut dyn Constants) {
        let kind = match self.potential {
            Potential::Nothing => "nothing",
            Potential::Spring { .. } => "spring",
            Potential::Detent { .. } => "detent",
            Potential::DeadBand { .. } => "dead_band",
            Potential::Magnet { .. } => "magnet",
            Potential::Texture { .. } => "texture",
            Potential::Bristle { .. } => "bristle",
        };
        to.element("parts", kind);
        to.whole("place", "of its coupling", self.place as i64);
        to.whole("first", "body", self.ends.first.0 as i64);
        to.whole("second", "body", self.ends.second.0 as i64);
        to.whole("carries", "whether it brings the puck's motion into a step", i64::from(self.carries));
        for (name, value) in [
            ("puck", self.ends.puck),
            ("of_first", self.ends.first.1),
            ("of_second", self.ends.second.1),
            ("damping", self.damping),
            ("friction", self.friction),
            ("constant", self.constant),
        ] {
            to.number(name, "", value.to_f64());
        }
        let mut numbers = |numbers: &[(&'static str, F)]| {
            for (name, value) in numbers {
                to.number(name, "", value.to_f64());
            }
        };
        match self.potential {
            Potential::Nothing => {}
            Potential::Spring { stiffness, rest, side, limit } => {
                numbers(&[("stiffness", stiffness), ("rest", rest), ("side", side), ("limit", limit)]);
            }
            Potential::Detent { torque, pitch, phase } => {
                numbers(&[("torque", torque), ("pitch", pitch), ("phase", phase)]);
            }
            Potential::DeadBand { stiffness, rest, width, limit } => {
                numbers(&[("stiffness", stiffness), ("rest", rest), ("width", width), ("limit", limit)]);
            }
            Potential::Magnet { torque, width, at } => numbers(&[("torque", torque), ("width", width), ("at", at)]),
            Potential::Texture { pitch, phase, base, sine, cosine } => {
                numbers(&[("pitch", pitch), ("phase", phase), ("base", base)]);
                for (name, factors) in [("sine", sine), ("cosine", cosine)] {
                    to.array(name, "", &[HARMONICS], &|i| factors.get(i).map_or(0.0, |x| x.to_f64()));
                }
            }
            Potential::Bristle { stiffness } => numbers(&[("stiffness", stiffness)]),
        }
        to.end();
    }

    /// Its stored energy, where it is a spring on both sides and without a limit.
    fn well(&self) -> Option<Well<F>> {
        match self.potential {
            Potential::Spring { stiffness, rest, side, limit } if side == F::ZERO && !limit.is_finite() => {
                Some(Well { half: F::HALF * stiffness, rest })
            }
            Potential::Nothing
            | Potential::Spring { .. }
            | Potential::Detent { .. }
            | Potential::DeadBand { .. }
            | Potential::Magnet { .. }
            | Potential::Texture { .. }
            | Potential::Bristle { .. } => None,
        }
    }
}

impl<F: Real> Potential<F> {
    /// V(q) - V'(q) · `lag`
    fn at(&self, q: F, bristle: F, lag: F) -> F {
        match *self {
            Potential::Nothing => F::ZERO,
            Potential::Spring { stiffness, rest, side, limit } => {
                let x = q - rest;
                if side * x < F::ZERO {
                    return F::ZERO;
                }
                let torque = stiffness * x;
                if torque.abs() <= limit {
                    return F::HALF * torque * x - torque * lag;
                }
                // The slope ends at limit/stiffness.
                let size = x.abs() - F::HALF * limit / stiffness;
                limit * size - if x > F::ZERO { limit * lag } else { -(limit * lag) }
            }
            Potential::Detent { torque, pitch, phase } => {
                // 1 - cos 2a = 2 sin² a: a small swing about a rest keeps its digits.
                let turns = (q - phase) / pitch;
                let half = F::from_f64(core::f64::consts::PI) * (turns - (turns + F::HALF).floor());
                let sine = half.sin();
                let well = torque * pitch / F::from_f64(core::f64::consts::PI) * (sine * sine);
                if lag == F::ZERO { well } else { well - torque * (half + half).sin() * lag }
            }
            Potential::DeadBand { stiffness, rest, width, limit } => {
                let x = q - rest;
                let side = if x > F::ZERO { F::ONE } else { -F::ONE };
                Potential::Spring { stiffness, rest: rest + side * width, side, limit }.at(q, bristle, lag)
            }
            Potential::Magnet { torque, width, at } => {
                let x = (q - at) / width;
                let fall = (-(F::HALF * x * x)).expm1();
                let scale = torque * F::from_f64(ROOT_E);
                -(scale * width * fall) - scale * x * (F::ONE + fall) * lag
            }
            Potential::Texture { pitch, phase, base, sine, cosine } => {
                let turns = (q - phase) / pitch;
                let turns = turns - (turns + F::HALF).floor();
                let tau = F::from_f64(core::f64::consts::TAU);
                let quarter = F::HALF * F::HALF;
                let (mut well, mut torque, mut n) = (base, F::ZERO, F::ZERO);
                for (a, b) in sine.into_iter().zip(cosine) {
                    n += F::ONE;
                    let (s, c) = ((tau * n * turns).sin(), (tau * (n * turns + quarter)).sin());
                    well += (a * c - b * s) / n;
                    torque += a * s + b * c;
                }
                well + torque * (tau / pitch) * lag
            }
            Potential::Bristle { stiffness } => F::HALF * stiffness * (bristle * bristle),
        }
    }
}

fn part<F: Real>(spec: &Spec, coupling: &Coupling) -> Part<F> {
    let f = F::from_f64;
    let spring = |stiffness, rest, side, limit| {
        if stiffness == 0.0 {
            return Potential::Nothing;
        }
        Potential::Spring { stiffness: f(stiffness), rest: f(rest), side: f(side), limit: f(limit) }
    };
    let facing = |side| match side {
        Side::Above => 1.0,
        Side::Below => -1.0,
    };
    let damper = |damping| match damping {
        Damping::Fixed(damping) => damping,
        Damping::Compensating => spec.compensates_over(coupling) * compensated(spec.couplings, coupling).unwrap_or(0.0),
    };
    let limit = coupling.limit.unwrap_or(f64::INFINITY);
    let (potential, damping, friction, constant) = match coupling.law {
        Law::Spring { stiffness, rest } => (spring(stiffness, rest, 0.0, limit), 0.0, 0.0, 0.0),
        Law::Wall { side, at, stiffness, damping } => (spring(stiffness, at, facing(side), limit), damping, 0.0, 0.0),
        Law::Detent { torque, pitch, phase } => {
            (Potential::Detent { torque: f(torque), pitch: f(pitch), phase: f(reduced(phase, pitch)) }, 0.0, 0.0, 0.0)
        }
        Law::DeadBand { stiffness, rest, width } => {
            let (stiffness, rest, width, limit) = (f(stiffness), f(rest), f(width), f(limit));
            (Potential::DeadBand { stiffness, rest, width, limit }, 0.0, 0.0, 0.0)
        }
        Law::Magnet { torque, width, at } => {
            (Potential::Magnet { torque: f(torque), width: f(width), at: f(at) }, 0.0, 0.0, 0.0)
        }
        Law::Texture { torque, pitch, phase, ref waveform } => {
            let scale = torque * pitch / core::f64::consts::TAU;
            let base = waveform.harmonics().map(|(n, sine, cosine)| libm::hypot(sine, cosine) / n).sum::<f64>();
            let scaled = |factors: [f32; HARMONICS]| factors.map(|factor| f(scale * f64::from(factor)));
            let (sine, cosine) = (scaled(waveform.sine), scaled(waveform.cosine));
            (
                Potential::Texture {
                    pitch: f(pitch),
                    phase: f(reduced(phase, pitch)),
                    base: f(scale * base),
                    sine,
                    cosine,
                },
                0.0,
                0.0,
                0.0,
            )
        }
        Law::Damper { damping } => (Potential::Nothing, damper(damping), 0.0, 0.0),
        Law::Coulomb { torque } => (Potential::Nothing, 0.0, torque, 0.0),
        Law::Lugre { coulomb, stribeck, bristle_stiffness, bristle_damping, viscous, .. } => {
            let level = if coulomb > stribeck { coulomb } else { stribeck };
            let potential = Potential::Bristle { stiffness: f(bristle_stiffness) };
            (potential, bristle_damping + viscous, level, 0.0)
        }
        Law::Integral { .. } | Law::Assist { .. } | Law::Acceleration { .. } => (Potential::Nothing, 0.0, 0.0, 0.0),
        Law::Constant { torque } => (Potential::Nothing, 0.0, 0.0, torque),
    };
    let ends = [coupling.first, coupling.second];
    let carries = ends.iter().any(|end| end.is_puck()) && coupling.is_at_body() && (damping > 0.0 || friction > 0.0);
    Part {
        ends: Ends::new(coupling.first, coupling.second),
        potential,
        damping: f(damping),
        friction: f(friction),
        constant: f(constant),
        carries,
        ..Part::NONE
    }
}
