//! A body that is coupled to no other, the puck held: J ẅ + (C0 + T C1) ẇ + K w = 0, in closed form.
//!
//! With z = Ts the equation is z² + d z + x² = 0, x² = T² K/J and d = T (C0 + T C1)/J. Semi-implicit Euler acts as forward
//! Euler with x² more in d: see [`crate::stability::critical`].

use hapt_model::{Body, Coupling, End, Method};
use nalgebra::Complex;

use crate::equations::continuous::compensated;
use crate::equations::laws::{LinearLaw, linear_law};
use crate::equations::structure::Part;
use crate::stability::multiplier::{Multiplier, Root, multiplier, pair};

/// Relative difference up to which a damping counts as T K, so that compensation of forward Euler is exact.
const FOLLOWS: f64 = 1e-9;

/// The coefficients of the equation, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SingleBody {
    pub inertia: f64,
    pub stiffness: f64,
    /// C0
    pub fixed: f64,
    /// C1
    pub per_period: f64,
}

/// The eigenvalues of one loop.
pub(crate) struct Spectrum {
    pub multipliers: Vec<Multiplier>,
    /// The roots z of the differential equation.
    pub roots: Vec<Root>,
}

impl SingleBody {
    /// From a part of a world; `None` where it has more than one body.
    pub fn of_part(part: &Part) -> Option<Self> {
        let &[inertia] = &part.inertia[..] else { return None };
        // All couplings of one body to the fixed side form one link.
        let link = part.links.first();
        let of = |number: fn(&crate::equations::structure::Link) -> f64| link.map_or(0.0, number);
        let (stiffness, fixed) = (of(|link| link.stiffness), of(|link| link.fixed));
        Some(SingleBody { inertia, stiffness, fixed, per_period: of(|link| link.per_period) })
    }

    /// From a world with exactly one body; `None` for any other, or with a nonlinear coupling at the body.
    pub fn of_world(bodies: &[Body], couplings: &[Coupling]) -> Option<Self> {
        let &[Body { inertia, .. }] = bodies else { return None };
        let mut body = SingleBody { inertia, stiffness: 0.0, fixed: 0.0, per_period: 0.0 };
        for coupling in couplings {
            if !is_at_body(coupling)? {
                continue;
            }
            match linear_law(coupling)? {
                LinearLaw::Spring(stiffness, _) => body.stiffness += stiffness,
                LinearLaw::Damper(damping) => body.fixed += damping,
                LinearLaw::Compensating => body.per_period += compensated(coupling, couplings),
                LinearLaw::Constant(_) => {}
            }
        }
        Some(body)
    }

    /// `None` where a number leaves double precision or its valid range.
    pub fn spectrum(self, method: Method, period: f64) -> Option<Spectrum> {
        let SingleBody { inertia, stiffness, fixed, .. } = self;
        if !(inertia > 0.0 && inertia.is_finite() && period > 0.0 && stiffness >= 0.0 && fixed >= 0.0) {
            return None;
        }
        let (multipliers, roots);
        if stiffness == 0.0 {
            // The position is neutral, and without damping the velocity is too.
            let slows = (fixed > 0.0).then(|| Root::from(Complex::from(-period * fixed / inertia)));
            let other = slows.map_or(Multiplier::ONE, |root| multiplier(method, root));
            (multipliers, roots) = (vec![Multiplier::ONE, other], slows.into_iter().collect());
        } else {
            let omega = self.frequency();
            if !(omega > 0.0 && (omega * omega).is_normal()) {
                return None;
            }
            let x = omega * period;
            let of = |implicit| {
                let d = self.damping(period, x, implicit);
                let excess = Some(self.excess(period, x, d, implicit));
                pair(x, d).map(|root| Root { excess: excess.filter(|_| root.z.im != 0.0), ..root })
            };
            multipliers = of(method == Method::SemiImplicitEuler).map(|root| multiplier(method, root)).to_vec();
            roots = of(false).to_vec();
        }
        multipliers.iter().all(Multiplier::is_representable).then_some(Spectrum { multipliers, roots })
    }

    // One loop and, inlined, a batch use the same operations: the results are the same to the bit.

    /// ω in rad/s.
    #[inline(always)]
    pub fn frequency(self) -> f64 {
        let rate = 1.0 / self.inertia.sqrt() * self.stiffness.sqrt();
        (rate * rate).sqrt()
    }

    /// With C1 = K exactly, if it nearly is and there is no other damping.
    #[inline(always)]
    pub fn balanced(self) -> Self {
        let follows = (self.fixed == 0.0) & ((self.per_period - self.stiffness).abs() <= FOLLOWS * self.stiffness);
        SingleBody { per_period: if follows { self.stiffness } else { self.per_period }, ..self }
    }

    /// Whether d is 0 or x² by structure.
    #[inline(always)]
    fn is_exact(self) -> bool {
        (self.fixed == 0.0) & ((self.per_period == 0.0) | (self.per_period == self.stiffness))
    }

    /// d for x = ωT, with x² more when `implicit`.
    #[inline(always)]
    pub fn damping(self, period: f64, x: f64, implicit: bool) -> f64 {
        let body = self.balanced();
        let general = period * (body.fixed + period * body.per_period) / body.inertia;
        let exact = if body.per_period == 0.0 { 0.0 } else { x * x };
        let own = if body.is_exact() { exact } else { general };
        if implicit { own + x * x } else { own }
    }

    /// |1 + z|² - 1 of a complex pair, x² - d; where dampers nearly compensate springs, from their difference.
    #[inline(always)]
    pub fn excess(self, period: f64, x: f64, d: f64, implicit: bool) -> f64 {
        let body = self.balanced();
        let uncovered = if implicit { body.per_period } else { body.per_period - body.stiffness };
        let general = -(period * (body.fixed + period * uncovered) / body.inertia);
        if body.is_exact() { x * x - d } else { general }
    }
}

/// Whether a coupling acts on body 0; `None` where it names another body.
pub(crate) fn is_at_body(coupling: &Coupling) -> Option<bool> {
    let ends = [coupling.first, coupling.second];
    if ends.iter().any(|end| matches!(end, End::Body(1..))) {
        return None;
    }
    // A coupling between equal ends has no effect.
    Some(ends[0] != ends[1] && ends.contains(&End::Body(0)))
}
