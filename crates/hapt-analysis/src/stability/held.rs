//! Stability of the held world: only the bodies, the puck fixed.

use hapt_model::{Body, Coupling, Method};

use crate::equations::continuous::{Slopes, linearise, piecewise_at_bodies};
use crate::equations::modal::Modal;
use crate::equations::slopes::combinations;
use crate::equations::structure::{Part, inertias, parts};
use crate::error::{Error, positive};
use crate::numerics::last::Last;
use crate::stability::critical::{Critical, of_part};
use crate::stability::multiplier::{Multiplier, Root, multiplier, pair};
use crate::stability::roots::{balance_of, roots};
use crate::stability::single_body::SingleBody;
use crate::stability::{Eigenvalue, MARGINAL, Stability, assemble, growth};

/// The result of one part of the world.
#[derive(Clone, Debug)]
struct PartResult {
    multipliers: Vec<Multiplier>,
    /// z = Ts of the complex pairs, Im z > 0.
    pairs: Vec<Root>,
    critical: Critical,
}

/// Eigenvalues, growth, critical period and modes of bodies joined by couplings, the puck held.
///
/// Work, for each combination of slopes: O(n³) in the bodies of a part, and some hundred times that for the critical period of
/// forward Euler and RK4 with compensating dampers.
///
/// # Errors
/// [`Error::Value`] for a period or inertia that is not positive, [`Error::NoSuchBody`], [`Error::Eigenvalues`] when numbers
/// leave double precision.
pub fn held(bodies: &[Body], couplings: &[Coupling], method: Method, period: f64) -> Result<Stability, Error> {
    analyse(bodies, couplings, method, period, Critical::Unbounded)
}

/// Only the growth of [`held`], in 1/s.
///
/// # Errors
/// As [`held`].
pub fn held_growth(bodies: &[Body], couplings: &[Coupling], method: Method, period: f64) -> Result<Option<f64>, Error> {
    GROWTH.with(|last| {
        last.answer(
            |(of, joined, rule)| *rule == (method, period) && of == bodies && joined == couplings,
            || (bodies.to_vec(), couplings.to_vec(), (method, period)),
            // The result of `analyse` for one body on springs and dampers.
            || match SingleBody::of_world(bodies, couplings).and_then(|body| body.spectrum(method, period)) {
                Some(found) => Ok(growth(&found.multipliers, period)),
                None => Ok(analyse(bodies, couplings, method, period, Critical::Never)?.growth_per_s),
            },
        )
    })
}

/// Bodies and couplings under a method and a period.
type Question = (Vec<Body>, Vec<Coupling>, (Method, f64));

thread_local! {
    static GROWTH: Last<Question, Option<f64>> = const { Last::new() };
}

/// Only the eigenvalues of [`held`].
///
/// # Errors
/// As [`held`].
pub fn held_eigenvalues(
    bodies: &[Body],
    couplings: &[Coupling],
    method: Method,
    period: f64,
) -> Result<Vec<Eigenvalue>, Error> {
    Ok(analyse(bodies, couplings, method, period, Critical::Never)?.eigenvalues)
}

/// The critical period is searched where it may be below `critical`.
fn analyse(
    bodies: &[Body],
    couplings: &[Coupling],
    method: Method,
    period: f64,
    mut critical: Critical,
) -> Result<Stability, Error> {
    positive("the period", period)?;
    let inertia = inertias(bodies)?;
    // Combinations differ in few parts: each part is computed once.
    let mut known: Vec<(Part, PartResult)> = Vec::new();
    let mut worst: Option<(f64, Vec<PartResult>)> = None;
    for slopes in combinations(&piecewise_at_bodies(couplings)) {
        let mut all = Vec::new();
        for part in parts(&inertia, &linearise(bodies, couplings, &slopes)?) {
            let found = match known.iter().find(|(p, _)| *p == part) {
                Some((_, found)) => found.clone(),
                None => {
                    let modal = Modal::new(&part)?;
                    let (multipliers, pairs) = of_held(&part, &modal, method, period)?;
                    let found = PartResult { multipliers, pairs, critical: of_part(&modal, method, critical)? };
                    known.push((part, found.clone()));
                    found
                }
            };
            critical = critical.min(found.critical);
            all.push(found);
        }
        let growth =
            all.iter().flat_map(|f| &f.multipliers).map(|m| m.growth(period)).fold(f64::NEG_INFINITY, f64::max);
        // Of combinations that differ only by rounding, the first (flat) one counts.
        if worst.as_ref().is_none_or(|(most, _)| growth > most + MARGINAL) {
            worst = Some((growth, all));
        }
    }
    let found = worst.map(|(_, found)| found).unwrap_or_default();
    let all: Vec<Multiplier> = found.iter().flat_map(|f| f.multipliers.iter().copied()).collect();
    let pairs: Vec<Root> = found.iter().flat_map(|f| f.pairs.iter().copied()).collect();
    Ok(assemble(&all, &all, &pairs, critical, period))
}

/// The 2n discrete eigenvalues of bodies joined by couplings, the puck held, nonlinear couplings linearised at the given slopes. Not
/// sorted.
///
/// # Errors
/// As [`held`].
pub fn multipliers(
    bodies: &[Body],
    couplings: &[Coupling],
    slopes: &Slopes,
    method: Method,
    period: f64,
) -> Result<Vec<Multiplier>, Error> {
    positive("the period", period)?;
    let mut all = Vec::new();
    for part in parts(&inertias(bodies)?, &linearise(bodies, couplings, slopes)?) {
        all.extend(of_held(&part, &Modal::new(&part)?, method, period)?.0);
    }
    Ok(all)
}

/// As [`spectrum`], in closed form for a single body.
fn of_held(part: &Part, modal: &Modal, method: Method, period: f64) -> Result<(Vec<Multiplier>, Vec<Root>), Error> {
    match SingleBody::of_part(part).and_then(|body| body.spectrum(method, period)) {
        Some(found) => Ok((found.multipliers, found.roots.into_iter().filter(swings).collect())),
        None => spectrum(modal, method, period),
    }
}

/// Whether a root oscillates. A solver returns a double real root as a pair √eps apart, which does not.
fn swings(root: &Root) -> bool {
    root.z.im > 4.0 * f64::EPSILON.sqrt() * root.z.norm()
}

/// λ of every mode, and z = Ts of the differential equation's complex pairs.
pub(crate) fn spectrum(part: &Modal, method: Method, period: f64) -> Result<(Vec<Multiplier>, Vec<Root>), Error> {
    // Semi-implicit Euler is forward Euler on a world with T K more damping: see `critical`.
    let implicit = if method == Method::SemiImplicitEuler { 1.0 } else { 0.0 };
    let mut discrete = Vec::new();
    let mut continuous = Vec::new();
    for (modes, compensation) in [(&part.undamped, 0.0), (&part.compensated, 1.0)] {
        for x in modes.iter().map(|omega| omega * period) {
            discrete.extend(pair(x, (compensation + implicit) * x * x));
            continuous.extend(pair(x, compensation * x * x));
        }
    }
    if !part.coupled.is_empty() {
        let modes = &part.coupled;
        let forward = (method == Method::ForwardEuler).then(|| balance_of(modes, period, &modes.uncovered));
        let own = roots(modes, period, false, forward.as_ref())?;
        match method {
            Method::SemiImplicitEuler => {
                discrete.extend(roots(modes, period, true, Some(&balance_of(modes, period, &modes.per_period)))?);
            }
            Method::ForwardEuler
            | Method::BackwardEuler
            | Method::Trapezoidal
            | Method::Zoh
            | Method::Rk4
            | Method::Tustin
            | Method::Foh => discrete.extend(own.iter().copied()),
        }
        continuous.extend(own);
    }
    let unit_count = std::iter::repeat_n(Multiplier::ONE, part.unit_count);
    let multipliers: Vec<_> = unit_count.chain(discrete.into_iter().map(|root| multiplier(method, root))).collect();
    if !multipliers.iter().all(Multiplier::is_representable) {
        return Err(Error::Eigenvalues { order: multipliers.len() });
    }
    Ok((multipliers, continuous.into_iter().filter(swings).collect()))
}
