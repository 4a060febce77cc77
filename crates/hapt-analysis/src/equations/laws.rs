//! Properties of the laws that the proofs and the search for the worst hand use. A match names every law, so that a new law does not compile
//! until it has an entry here; a property of only one law tests for that law.

use std::sync::LazyLock;

use hapt_model::{Coupling, Damping, End, HARMONICS, Law, Side};

/// The class of a law, for the theorems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Springs and dampers.
    Linear,
    /// A torque that does not depend on the motion.
    Constant,
    /// A potential with a steepest rise, with a dissipative damping, or either of them with a limit.
    Potential,
    /// Dry friction, whose torque jumps with the sign of the velocity.
    Coulomb,
    /// Friction with bristles, which have internal state.
    Lugre,
    /// The integral term of a controller: linear, with a state. A limit stops it.
    Integral,
    /// A bounded torque along the velocity, which only adds energy.
    Assist,
    /// A torque along the acceleration: linear, with a state.
    Acceleration,
}

impl Kind {
    pub fn of(coupling: &Coupling) -> Kind {
        match coupling.law {
            Law::Spring { .. } | Law::Damper { .. } if coupling.limit.is_none() => Kind::Linear,
            Law::Spring { .. }
            | Law::Damper { .. }
            | Law::Wall { .. }
            | Law::Detent { .. }
            | Law::DeadBand { .. }
            | Law::Magnet { .. }
            | Law::Texture { .. } => Kind::Potential,
            Law::Constant { .. } => Kind::Constant,
            Law::Coulomb { .. } => Kind::Coulomb,
            Law::Lugre { .. } => Kind::Lugre,
            Law::Integral { .. } => Kind::Integral,
            Law::Assist { .. } => Kind::Assist,
            Law::Acceleration { .. } => Kind::Acceleration,
        }
    }
}

/// Whether the torque is not an affine function of the motion so far.
pub(crate) fn is_nonlinear(coupling: &Coupling) -> bool {
    match Kind::of(coupling) {
        Kind::Linear | Kind::Constant => false,
        Kind::Potential | Kind::Coulomb | Kind::Lugre | Kind::Assist => true,
        Kind::Integral | Kind::Acceleration => coupling.limit.is_some(),
    }
}

/// The gain of an integral term, N·m/(rad·s) (linear: N/(m·s)); 0 of every other law.
pub(crate) fn integral_gain(law: &Law) -> f64 {
    if let Law::Integral { stiffness, time, .. } = *law { stiffness / time } else { 0.0 }
}

/// A torque along the acceleration: inertia/(τ + T) · (v_k - s_{k-1}), s the velocity behind a low-pass of the time constant τ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// kg·m² (linear: kg), positive.
    pub inertia: f64,
    /// τ in s.
    pub tau: f64,
}

impl Acceleration {
    /// `None` of every other law, and without an inertia.
    pub fn of(law: &Law) -> Option<Acceleration> {
        let Law::Acceleration { inertia, cutoff } = *law else { return None };
        (inertia > 0.0).then_some(Acceleration { inertia, tau: 1.0 / (std::f64::consts::TAU * cutoff) })
    }

    /// inertia/(τ + T), N·m·s/rad (linear: N·s/m).
    pub fn gain(&self, period: f64) -> f64 {
        self.inertia / (self.tau + period)
    }

    /// The part T/(τ + T) of the way to the velocity that s goes in a sample.
    pub fn part(&self, period: f64) -> f64 {
        period / (self.tau + period)
    }
}

/// A law that the matrices represent exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LinearLaw {
    /// Stiffness of a spring, and the q at which it is slack.
    Spring(f64, f64),
    Damper(f64),
    /// A compensating damper.
    Compensating,
    Constant(f64),
}

/// `None` for a nonlinear coupling.
pub(crate) fn linear_law(coupling: &Coupling) -> Option<LinearLaw> {
    if coupling.limit.is_some() {
        return None;
    }
    match coupling.law {
        Law::Spring { stiffness, rest } => Some(LinearLaw::Spring(stiffness, rest)),
        Law::Damper { damping: Damping::Fixed(damping) } => Some(LinearLaw::Damper(damping)),
        Law::Damper { damping: Damping::Compensating } => Some(LinearLaw::Compensating),
        Law::Constant { torque } => Some(LinearLaw::Constant(torque)),
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

/// The (stiffness, damping) of a nonlinear coupling at its steepest slope. The limit of a coupling does not change it.
pub(crate) fn steepest(law: &Law) -> (f64, f64) {
    match *law {
        Law::Spring { stiffness, .. } => (stiffness, 0.0),
        Law::Damper { damping: Damping::Fixed(damping) } => (0.0, damping),
        // With the period: `ties` has it.
        Law::Damper { damping: Damping::Compensating } => (0.0, 0.0),
        Law::Wall { stiffness, damping, .. } => (stiffness, damping),
        Law::Detent { torque, pitch, .. } => (std::f64::consts::TAU * torque / pitch, 0.0),
        Law::DeadBand { stiffness, .. } => (stiffness, 0.0),
        // At its place; it falls by 2/e torque/width at most, less than that.
        Law::Magnet { torque, width, .. } => (std::f64::consts::E.sqrt() * torque / width, 0.0),
        // It may fall more steeply than it rises: the steeper of both.
        Law::Texture { torque, pitch, ref waveform, .. } => {
            (std::f64::consts::TAU * torque / pitch * largest(derivative(waveform.harmonics())), 0.0)
        }
        Law::Lugre { bristle_stiffness, bristle_damping, viscous, .. } => {
            (bristle_stiffness, bristle_damping + viscous)
        }
        Law::Coulomb { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. }
        | Law::Constant { .. } => (0.0, 0.0),
    }
}

/// The steepest rise that a texture shows somewhere, where its torque is below its limit; 0 of other laws. [`steepest`] is no less.
pub(crate) fn steepest_rise(coupling: &Coupling) -> f64 {
    let Law::Texture { torque, pitch, ref waveform, .. } = coupling.law else { return 0.0 };
    let limit = coupling.limit.unwrap_or(f64::INFINITY);
    let is_free = |i: usize| torque * around(waveform.harmonics(), i).abs() < limit;
    // The texture pushes along its waveform, and so resists where it falls.
    let rises = (0..POINTS).filter(|&i| is_free(i)).map(|i| -around(derivative(waveform.harmonics()), i));
    std::f64::consts::TAU * torque / pitch * rises.fold(0.0, f64::max)
}

/// Points of a circle at which a waveform is evaluated.
const POINTS: usize = 2048;

/// The harmonics of the derivative.
fn derivative(
    harmonics: impl Iterator<Item = (f64, f64, f64)> + Clone,
) -> impl Iterator<Item = (f64, f64, f64)> + Clone {
    harmonics.map(|(n, sine, cosine)| (n, -n * cosine, n * sine))
}

/// Σ (sine sin nθ + cosine cos nθ) at the point `i`.
fn around(harmonics: impl Iterator<Item = (f64, f64, f64)>, i: usize) -> f64 {
    // A check evaluates it hundreds of times, and n times a point of this circle is again one of its points.
    static CIRCLE: LazyLock<Vec<(f64, f64)>> =
        LazyLock::new(|| (0..POINTS).map(|i| (std::f64::consts::TAU / POINTS as f64 * i as f64).sin_cos()).collect());
    let part = |(n, sine, cosine): (f64, f64, f64)| {
        let (s, c) = CIRCLE[n as usize * i % POINTS];
        sine * s + cosine * c
    };
    harmonics.map(part).sum()
}

/// A bound on the size of Σ (sine sin nθ + cosine cos nθ), at most 2^-14 above it. Between points h apart it rises above the larger by no
/// more than (h/2)²/2 times its second derivative, which is at most N² times its own largest (Bernstein's inequality). The sizes of
/// the harmonics, added, are a bound too, and of one harmonic the exact one.
fn largest(harmonics: impl Iterator<Item = (f64, f64, f64)> + Clone) -> f64 {
    let seen = (0..POINTS).map(|i| around(harmonics.clone(), i).abs()).fold(0.0, f64::max);
    let curvature = (HARMONICS as f64 * std::f64::consts::TAU / POINTS as f64).powi(2) / 8.0;
    let added: f64 = harmonics.map(|(_, sine, cosine)| sine.hypot(cosine)).sum();
    added.min(seen / (1.0 - curvature))
}

/// The (stiffness, damping) of a nonlinear coupling at its flattest slope, falling slopes left out.
pub(crate) fn flattest(law: &Law) -> (f64, f64) {
    if let Law::Lugre { viscous, .. } = *law { (0.0, viscous) } else { (0.0, 0.0) }
}

/// The q over which a law has its steepest slope, ends not included; none where that is everywhere, or at places that repeat.
pub(crate) fn steep_over(law: &Law) -> Vec<[f64; 2]> {
    match *law {
        Law::Wall { side: Side::Above, at, .. } => vec![[at, f64::INFINITY]],
        Law::Wall { side: Side::Below, at, .. } => vec![[f64::NEG_INFINITY, at]],
        Law::DeadBand { rest, width, .. } => vec![[f64::NEG_INFINITY, rest - width], [rest + width, f64::INFINITY]],
        // At its place, and next to it from either side.
        Law::Magnet { at, .. } => vec![[at.next_down().next_down(), at.next_up().next_up()]],
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Detent { .. }
        | Law::Texture { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. }
        | Law::Constant { .. } => Vec::new(),
    }
}

/// The largest torque of a coupling; infinite where it has no bound of its own.
pub(crate) fn most(coupling: &Coupling) -> f64 {
    let own = match coupling.law {
        Law::Detent { torque, .. }
        | Law::Magnet { torque, .. }
        | Law::Coulomb { torque }
        | Law::Assist { torque, .. } => torque,
        Law::Texture { torque, ref waveform, .. } => torque * largest(waveform.harmonics()),
        Law::Constant { torque } => torque.abs(),
        Law::Acceleration { inertia: 0.0, .. } => 0.0,
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Wall { .. }
        | Law::DeadBand { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Acceleration { .. } => f64::INFINITY,
    };
    coupling.limit.map_or(own, |limit| own.min(limit))
}

/// Whether a law depends on the velocity, so that the estimator matters.
pub(crate) fn takes_velocity(law: &Law) -> bool {
    match *law {
        Law::Damper { damping: Damping::Fixed(damping) } | Law::Wall { damping, .. } => damping > 0.0,
        Law::Damper { damping: Damping::Compensating } | Law::Lugre { .. } => true,
        Law::Coulomb { torque } | Law::Assist { torque, .. } => torque > 0.0,
        Law::Acceleration { inertia, .. } => inertia > 0.0,
        Law::Spring { .. }
        | Law::Detent { .. }
        | Law::DeadBand { .. }
        | Law::Magnet { .. }
        | Law::Texture { .. }
        | Law::Integral { .. }
        | Law::Constant { .. } => false,
    }
}

/// Whether the torque that the law resists with never falls as the position or the velocity grows.
pub(crate) fn rises_only(law: &Law) -> bool {
    match *law {
        Law::Spring { .. } | Law::Damper { .. } | Law::Wall { .. } | Law::DeadBand { .. } | Law::Constant { .. } => {
            true
        }
        Law::Detent { .. }
        | Law::Magnet { .. }
        | Law::Texture { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. } => false,
    }
}

/// Whether the checker of proof files (`proof/`) covers the law.
pub(crate) fn is_known(law: &Law) -> bool {
    match *law {
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Wall { .. }
        | Law::Detent { .. }
        | Law::DeadBand { .. }
        | Law::Magnet { .. } => true,
        Law::Constant { torque } => torque == 0.0,
        Law::Texture { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. } => false,
    }
}

/// The q at which a hand feels the law, where the feel depends on q: a wall's face, and `reach` into a law that stiffens.
pub fn felt_at(law: &Law, reach: f64) -> Vec<f64> {
    match *law {
        Law::Wall { side: Side::Above, at, .. } => vec![at, at + reach],
        Law::Wall { side: Side::Below, at, .. } => vec![at, at - reach],
        Law::DeadBand { rest, width, .. } => vec![rest + width + reach, rest - width - reach],
        Law::Detent { pitch, phase, .. } | Law::Texture { pitch, phase, .. } => vec![phase + 0.2 * pitch],
        Law::Magnet { width, at, .. } => vec![at + 0.5 * width],
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. }
        | Law::Constant { .. } => Vec::new(),
    }
}

/// Whether the law has a wall's damping.
pub(crate) fn is_damped_wall(law: &Law) -> bool {
    matches!(*law, Law::Wall { damping, .. } if damping > 0.0)
}

/// Whether no proof covers convergence of the discrete-gradient step with this law at a body: its torque falls, or is the mean torque of no
/// energy.
pub(crate) fn may_not_settle(law: &Law) -> bool {
    !rises_only(law) || is_damped_wall(law)
}

/// Whether bristles give back more than they took: viscous < bristle_damping (stribeck - coulomb)/coulomb, without the quotient.
pub(crate) fn bristles_give(law: &Law) -> bool {
    matches!(*law, Law::Lugre { coulomb, stribeck, bristle_damping, viscous, .. }
        if viscous * coulomb < bristle_damping * (stribeck - coulomb))
}

/// Whether LuGre friction is a hysteresis that depends only on the path: one level for sticking and sliding, bristles without damping. The
/// remainder is a viscous damper.
pub(crate) fn is_hysteresis(law: &Law) -> bool {
    matches!(*law, Law::Lugre { coulomb, stribeck, bristle_damping, .. }
        if bristle_damping == 0.0 && stribeck == coulomb)
}

/// Whether an end is a body.
pub(crate) fn at_body(coupling: &Coupling) -> bool {
    let is_body = |end: End| match end {
        End::Body(_) => true,
        End::Puck | End::Ground => false,
    };
    is_body(coupling.first) || is_body(coupling.second)
}

/// Whether an end is the puck.
pub(crate) fn at_puck(coupling: &Coupling) -> bool {
    coupling.first == End::Puck || coupling.second == End::Puck
}
