//! The hands-off loop as one linear map: puck, bodies, estimator memory and commands in flight from one sample to the next.
//!
//! ```text
//! s_{k+1} = s_k + D s_k
//! ```
//!
//! Increments, because the eigenvalues cluster near 1: those of D are λ - 1, and no computation here subtracts 1 from a number
//! near it. s_k is the state at t_k, with z_k measured:
//!
//! | part of s_k | its next value |
//! | --- | --- |
//! | z, if springs join the puck to ground | by the motor's held commands, exactly |
//! | ż | the same |
//! | the bodies' modes, see [`crate::equations::port`]: positions relative to the shift of the puck unless it is grounded, velocities | by the method |
//! | v̂_k, the measured velocity, where a damper acts on the puck and the estimator is not exact | pole v̂_k + Σ g_i δ_{k+1-i} |
//! | δ_k, δ_{k-1}, ... with δ_k = z_k - z_{k-1}, as many as the estimator uses | z_{k+1} - z_k, then shifted by one |
//! | the commands before this sample's, as many as are in flight | this sample's, then shifted by one |
//! | the motor's torque, where it lags behind its command | by the held commands, exactly |
//!
//! The estimator's taps sum to 0, so it is a sum of displacements, g_i = Σ_{j≤i} taps_j, and its memory is invariant under shifts. All
//! estimators are exact for uniform motion, so pole - 1 = -T Σ g.
//!
//! With the delay (d + a)T, 0 ≤ a < 1, the motor holds the command of sample k-d-1 for aT from t_k on, then that of k-d. Over
//! a stretch h under the torque τ the puck, J z̈ + b ż = τ, obeys with x = bh/J
//!
//! ```text
//! Δż = (e^{-x} - 1) ż + (h/J) φ₁ τ,    Δz = h φ₁ ż + (h²/J) φ₂ τ,    φ₁ = (1 - e^{-x})/x,    φ₂ = (x - 1 + e^{-x})/x²
//! ```
//!
//! With the spring of a hand, or a motor that lags, the puck is advanced by the exponential in [`DrivenPuck`].

use hapt_model::Sampling;
use nalgebra::{DMatrix, RowDVector};

use crate::equations::delay::{Delay, MAX_IN_FLIGHT};
use crate::equations::discrete::Discrete;
use crate::equations::estimator::Filter;
use crate::equations::port::Port;
use crate::equations::puck::DrivenPuck;
use crate::error::Error;
use crate::numerics::phi::{phi1, phi2};

/// D of the module documentation. `damping` is b of the device, `filter` that of the estimator at this period.
///
/// # Errors
/// [`Error::InFlight`]; [`Error::Step`] and [`Error::Eigenvalues`] when numbers leave double precision.
pub(crate) fn closed_loop(
    port: &Port,
    sampling: &Sampling,
    damping: f64,
    filter: &Filter,
    period: f64,
) -> Result<DMatrix<f64>, Error> {
    let delay = Delay::of(sampling.delay.seconds(period), period)?;
    if filter.taps.len() > MAX_IN_FLIGHT + 1 {
        let value = (filter.taps.len() - 1) as f64;
        return Err(Error::Value { what: "the estimator's window", value, wanted: "500 samples at most" });
    }
    let uncoupled = port.is_uncoupled();
    // State that nothing uses is omitted.
    let in_flight = if uncoupled { 0 } else { delay.in_flight() };
    let estimated = port.has_damper() && !filter.taps.is_empty();
    let memory = if estimated { filter.taps.len().saturating_sub(2) } else { 0 };
    let bodies: usize = port.blocks.iter().map(|b| b.positions + b.equations.bodies()).sum();

    let z = port.grounded.then_some(0);
    let v = usize::from(port.grounded);
    let first_body = v + 1;
    let estimate = if estimated { first_body + bodies } else { v };
    let first_memory = first_body + bodies + usize::from(estimated);
    let first_in_flight = first_memory + memory;
    let motor = (port.lag > 0.0 && !uncoupled).then_some(first_in_flight + in_flight);
    let order = first_in_flight + in_flight + usize::from(motor.is_some());
    let unit = |i: usize| RowDVector::from_fn(order, |_, j| if i == j { 1.0 } else { 0.0 });

    // One sample of each block, and the torque.
    let mut torque = RowDVector::zeros(order);
    let mut own = [-port.stiffness, -(port.fixed + period * port.per_period)];
    let mut steps = Vec::with_capacity(port.blocks.len());
    let mut at = first_body;
    for block in &port.blocks {
        let step = Discrete::new(&block.equations, sampling.method, sampling.output, sampling.advance, period)?;
        let (m, p) = (block.equations.bodies(), block.positions);
        (0..p).for_each(|j| torque[at + j] += step.torque.state[j]);
        (0..m).for_each(|j| torque[at + p + j] += step.torque.state[m + j]);
        own[0] += step.torque.puck[0];
        own[1] += step.torque.puck[1];
        steps.push((block, step, at));
        at += m + p;
    }
    // Without a spring to ground the torque does not depend on z.
    if let Some(z) = z {
        torque[z] += own[0];
    }
    if port.has_damper() {
        torque[estimate] += own[1];
    }

    // The puck, over both parts of the period.
    let j = port.inertia;
    let rate = damping / j;
    let (h1, h2) = (delay.fraction * period, period - delay.fraction * period);
    let command = |age: usize| if age == 0 { torque.clone() } else { unit(first_in_flight + age - 1) };
    let (mut dz, mut dv);
    let mut motor_change = RowDVector::zeros(order);
    if motor.is_some() || port.spring > 0.0 {
        (dz, dv) = (RowDVector::zeros(order), RowDVector::zeros(order));
        let puck = DrivenPuck { inertia: j, damping, spring: port.spring, lag: motor.map_or(0.0, |_| port.lag) };
        let at =
            |place: Option<usize>, change: &RowDVector<f64>| place.map_or_else(|| change.clone(), |i| unit(i) + change);
        for (h, age) in [(h1, delay.samples + 1), (h2, delay.samples)].into_iter().filter(|(h, _)| *h > 0.0) {
            let change = puck.over(h);
            // Without a spring to ground nothing depends on z.
            let state = [at(z, &dz), at(Some(v), &dv), at(motor, &motor_change)];
            for (i, row) in [&mut dz, &mut dv, &mut motor_change].into_iter().enumerate() {
                for (part, factor) in state.iter().zip(change.matrix.row(i).iter()) {
                    *row += part * *factor;
                }
                if !uncoupled {
                    *row += command(age) * change.push[i];
                }
            }
        }
    } else {
        dz = unit(v) * (period * phi1(rate * period));
        dv = unit(v) * (-rate * period).exp_m1();
        if !uncoupled {
            let new = command(delay.samples);
            dz += &new * (h2 * h2 / j * phi2(rate * h2));
            dv += new * (h2 / j * phi1(rate * h2));
            if delay.fraction > 0.0 {
                let old = command(delay.samples + 1);
                let push = h1 / j * phi1(rate * h1);
                dz += &old * (h1 * h1 / j * phi2(rate * h1) + push * h2 * phi1(rate * h2));
                dv += old * (push * (-rate * h2).exp());
            }
        }
    }

    let mut d = DMatrix::zeros(order, order);
    if let Some(z) = z {
        d.set_row(z, &dz);
    }
    d.set_row(v, &dv);
    if let Some(motor) = motor {
        d.set_row(motor, &motor_change);
    }
    if estimated {
        let mut sum = 0.0;
        let gains: Vec<f64> = filter.taps.iter().take(filter.taps.len() - 1).map(|tap| (sum += tap, sum).1).collect();
        let mut row = &dz * gains.first().copied().unwrap_or(0.0);
        for (i, gain) in gains.iter().enumerate().skip(1) {
            row[first_memory + i - 1] += gain;
        }
        row[estimate] -= if filter.pole == 0.0 { 1.0 } else { period * gains.iter().sum::<f64>() };
        d.set_row(estimate, &row);
    }
    for i in 0..memory {
        let mut row = if i == 0 { dz.clone() } else { unit(first_memory + i - 1) };
        row[first_memory + i] -= 1.0;
        d.set_row(first_memory + i, &row);
    }
    for i in 0..in_flight {
        let mut row = command(i);
        row[first_in_flight + i] -= 1.0;
        d.set_row(first_in_flight + i, &row);
    }
    let estimate_change = d.row(estimate).into_owned();
    for (block, step, at) in &steps {
        let (m, p) = (block.equations.bodies(), block.positions);
        // Positions beyond p are not part of the state: their columns are 0.
        let places = (0..p).map(|i| (i, at + i)).chain((0..m).map(|i| (m + i, at + p + i))).collect::<Vec<_>>();
        for &(i, place) in &places {
            let mut row = RowDVector::zeros(order);
            for &(j, column) in &places {
                row[column] += step.d[(i, j)];
            }
            let held = |j: usize| step.previous[(i, j)] + step.current[(i, j)];
            if let Some(z) = z {
                row[z] += held(0);
            }
            if port.has_damper() {
                row[estimate] += held(1);
            }
            // The methods that take the new sample first: u_{k+1} = u_k + Δu.
            let mut along = 0.0;
            if sampling.method.takes_new_sample_first() {
                along += step.current[(i, 0)];
                if port.has_damper() {
                    row += &estimate_change * step.current[(i, 1)];
                }
            }
            if z.is_none() && i < p {
                along -= block.shift[i];
            }
            row += &dz * along;
            d.set_row(place, &row);
        }
    }
    if d.iter().all(|x| x.is_finite()) { Ok(d) } else { Err(Error::Eigenvalues { order }) }
}
