//! The modes of the differential equation of the free loop, which the samples are to follow.

use hapt_model::Method;
use nalgebra::DMatrix;

use crate::equations::laws::Acceleration;
use crate::equations::modal::Modal;
use crate::equations::port::Port;
use crate::equations::structure::Part;
use crate::error::Error;
use crate::numerics::eigenvalues::eigenvalues;
use crate::stability::held::spectrum;
use crate::stability::multiplier::Root;

/// Imaginary part, over the largest eigenvalue, below which a pair counts as two real ones.
const SPLIT: f64 = 1e-7;

/// z = Ts of the complex pairs of the differential equation of a part with the puck, the device damping, the handle and the hand.
pub(super) fn continuous_pairs(part: &Part, port: &Port, damping: f64, period: f64) -> Result<Vec<Root>, Error> {
    let mut whole = part.clone();
    if damping > 0.0 || port.spring > 0.0 {
        whole.fix(0, port.spring, damping);
    }
    whole.inertia[0] = port.inertia;
    if let Some((handle, grip)) = port.handle {
        let place = whole.add(handle.inertia + grip.inertia, 0, handle.stiffness, handle.damping);
        if grip.stiffness > 0.0 || grip.damping > 0.0 {
            whole.fix(place, grip.stiffness, grip.damping);
        }
    }
    if whole.integral > 0.0 || !whole.accelerations.is_empty() {
        return with_states(&whole, period);
    }
    Ok(spectrum(&Modal::new(&whole)?, Method::Zoh, period)?.1)
}

/// The same of a part with an integral term or torques along the acceleration: ẇ = v, M v̇ = -K w - C v + e₀ (Σ J_c (v₀ - s)/τ - integral i), i̇ = w₀,
/// ṡ = (v₀ - s)/τ.
fn with_states(part: &Part, period: f64) -> Result<Vec<Root>, Error> {
    let n = part.inertia.len();
    let sum = (part.integral > 0.0).then_some(2 * n);
    let first = 2 * n + usize::from(sum.is_some());
    let order = first + part.accelerations.len();
    let mut a = DMatrix::<f64>::zeros(order, order);
    for (i, inertia) in part.inertia.iter().enumerate() {
        a[(i, n + i)] = 1.0;
        for link in &part.links {
            let damping = link.fixed + period * link.per_period;
            let (own, other) = match (link.body, link.other) {
                (body, other) if body == i => (i, other),
                (body, Some(other)) if other == i => (i, Some(body)),
                _ => continue,
            };
            for (j, sign) in [(Some(own), -1.0), (other, 1.0)].into_iter().filter_map(|(j, sign)| Some((j?, sign))) {
                a[(n + i, j)] += sign * link.stiffness / inertia;
                a[(n + i, n + j)] += sign * damping / inertia;
            }
        }
    }
    if let Some(sum) = sum {
        a[(n, sum)] = -part.integral / part.inertia[0];
        a[(sum, 0)] = 1.0;
    }
    for (s, Acceleration { inertia, tau }) in (first..).zip(&part.accelerations) {
        let gain = inertia / tau;
        a[(n, n)] += gain / part.inertia[0];
        a[(n, s)] -= gain / part.inertia[0];
        (a[(s, n)], a[(s, s)]) = (tau.recip(), -tau.recip());
    }
    // A position on which nothing depends has the eigenvalue 0.
    while let Some(at) = (0..a.ncols()).find(|&j| a.column(j).iter().all(|x| *x == 0.0)) {
        a = a.remove_row(at).remove_column(at);
    }
    let values = eigenvalues(&a)?;
    // Rounding splits a shift and its momentum.
    let largest = values.iter().map(|s| s.norm()).fold(0.0, f64::max);
    Ok(values.into_iter().filter(|s| s.im > SPLIT * largest).map(|s| Root::from(s * period)).collect())
}
