//! A body that hangs with no other, the puck held: J ẅ + (C0 + T C1) ẇ + K w = 0, in closed form.
//!
//! With z = Ts the equation is z² + d z + x² = 0, x² = T² K/J and d = T (C0 + T C1)/J. Semi-implicit Euler acts as forward
//! Euler with x² more in d: see [`crate::stability::critical`].

use hapt_model::{Body, Coupling, End, Method};
use nalgebra::Complex;

use crate::equations::continuous::compensated;
use crate::equations::laws::{Straight, straight};
use crate::equations::structure::Part;
use crate::stability::multiplier::{Multiplier, Root, multiplier, pair};

/// Damping that is T K to this, relatively, is T K: what balances forward Euler balances it exactly.
const FOLLOWS: f64 = 1e-9;

/// What the equation is made of, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lone {
    pub inertia: f64,
    pub stiffness: f64,
    /// C0
    pub fixed: f64,
    /// C1
    pub following: f64,
}

/// The eigenvalues of one loop.
pub(crate) struct Spectrum {
    pub multipliers: Vec<Multiplier>,
    /// The roots z of the differential equation.
    pub roots: Vec<Root>,
}

impl Lone {
    /// Of a part of a world; `None` where it has more than one body.
    pub fn of_part(part: &Part) -> Option<Self> {
        let &[inertia] = &part.inertia[..] else { return None };
        // All that ties one body to the fixed side is one link.
        let link = part.links.first();
        let of = |number: fn(&crate::equations::structure::Link) -> f64| link.map_or(0.0, number);
        let (stiffness, fixed) = (of(|link| link.stiffness), of(|link| link.fixed));
        Some(Lone { inertia, stiffness, fixed, following: of(|link| link.per_period) })
    }

    /// Of a world; `None` where it has not one body, or has a nonlinear coupling at it.
    pub fn of_world(bodies: &[Body], couplings: &[Coupling]) -> Option<Self> {
        let &[Body { inertia, .. }] = bodies else { return None };
        let mut lone = Lone { inertia, stiffness: 0.0, fixed: 0.0, following: 0.0 };
        for coupling in couplings {
            if !touches(coupling)? {
                continue;
            }
            match straight(coupling)? {
                Straight::Spring(stiffness, _) => lone.stiffness += stiffness,
                Straight::Damper(damping) => lone.fixed += damping,
                Straight::Compensating => lone.following += compensated(coupling, couplings),
                Straight::Constant(_) => {}
            }
        }
        Some(lone)
    }

    /// `None` where a number leaves double precision, or is none of a body's.
    pub fn spectrum(self, method: Method, period: f64) -> Option<Spectrum> {
        let Lone { inertia, stiffness, fixed, .. } = self;
        if !(inertia > 0.0 && inertia.is_finite() && period > 0.0 && stiffness >= 0.0 && fixed >= 0.0) {
            return None;
        }
        let (multipliers, roots);
        if stiffness == 0.0 {
            // Nothing minds where it stands, nor, unless it is damped, how fast it goes.
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
        multipliers.iter().all(Multiplier::is_sound).then_some(Spectrum { multipliers, roots })
    }

    // The same operations for one loop and, inlined, for many side by side: the same bits.

    /// ω in rad/s.
    #[inline(always)]
    pub fn frequency(self) -> f64 {
        let rate = 1.0 / self.inertia.sqrt() * self.stiffness.sqrt();
        (rate * rate).sqrt()
    }

    /// With C1 = K, if that is what it nearly is and nothing else damps.
    #[inline(always)]
    pub fn balanced(self) -> Self {
        let follows = (self.fixed == 0.0) & ((self.following - self.stiffness).abs() <= FOLLOWS * self.stiffness);
        Lone { following: if follows { self.stiffness } else { self.following }, ..self }
    }

    /// Whether d is 0 or x² by structure.
    #[inline(always)]
    fn is_exact(self) -> bool {
        (self.fixed == 0.0) & ((self.following == 0.0) | (self.following == self.stiffness))
    }

    /// d for x = ωT, with x² more when `implicit`.
    #[inline(always)]
    pub fn damping(self, period: f64, x: f64, implicit: bool) -> f64 {
        let lone = self.balanced();
        let general = period * (lone.fixed + period * lone.following) / lone.inertia;
        let exact = if lone.following == 0.0 { 0.0 } else { x * x };
        let own = if lone.is_exact() { exact } else { general };
        if implicit { own + x * x } else { own }
    }

    /// |1 + z|² - 1 of a complex pair, x² - d: where dampers and springs nearly balance, from their difference.
    #[inline(always)]
    pub fn excess(self, period: f64, x: f64, d: f64, implicit: bool) -> f64 {
        let lone = self.balanced();
        let uncovered = if implicit { lone.following } else { lone.following - lone.stiffness };
        let general = -(period * (lone.fixed + period * uncovered) / lone.inertia);
        if lone.is_exact() { x * x - d } else { general }
    }
}

/// Whether a coupling is at the only body there is; `None` where it is at one that there is not.
pub(crate) fn touches(coupling: &Coupling) -> Option<bool> {
    let ends = [coupling.first, coupling.second];
    if ends.iter().any(|end| matches!(end, End::Body(1..))) {
        return None;
    }
    // With itself it does nothing.
    Some(ends[0] != ends[1] && ends.contains(&End::Body(0)))
}
