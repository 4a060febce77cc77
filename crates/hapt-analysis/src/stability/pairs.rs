//! The modes of the differential equation of the free loop, which the samples are to follow.

use hapt_model::Method;
use nalgebra::DMatrix;

use crate::equations::modal::Modal;
use crate::equations::port::Port;
use crate::equations::structure::Part;
use crate::error::Error;
use crate::numerics::eigenvalues::eigenvalues;
use crate::stability::held::spectrum;
use crate::stability::multiplier::Root;

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
    if whole.integral > 0.0 {
        return with_integral(&whole, period);
    }
    Ok(spectrum(&Modal::new(&whole)?, Method::Zoh, period)?.1)
}

/// The same of a part with an integral term: ẇ = v, M v̇ = -K w - C v - gain e₀ i, i̇ = w₀.
fn with_integral(part: &Part, period: f64) -> Result<Vec<Root>, Error> {
    let n = part.inertia.len();
    let mut a = DMatrix::<f64>::zeros(2 * n + 1, 2 * n + 1);
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
    a[(n, 2 * n)] = -part.integral / part.inertia[0];
    a[(2 * n, 0)] = 1.0;
    let values = eigenvalues(&a)?;
    Ok(values.into_iter().filter(|s| s.im > 0.0).map(|s| Root::from(s * period)).collect())
}
