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
//! | z, if springs or integral terms join the puck to ground | by the motor's held commands, exactly |
//! | ż | the same |
//! | the bodies' modes, see [`crate::equations::port`]: positions relative to the shift of the puck unless it is grounded, velocities | by the method |
//! | v̂_k, the measured velocity, where a damper acts on the puck and the estimator is not exact | pole v̂_k + Σ g_i δ_{k+1-i} |
//! | r = ẑ - z and T â of a Kalman filter, in place of the next row, with e = δ_{k+1} - r - T v̂ - T (T â)/2 | (α - 1) e, T â + γ e/T; v̂ + T â + β e/T |
//! | δ_k, δ_{k-1}, ... with δ_k = z_k - z_{k-1}, as many as the estimator uses | z_{k+1} - z_k, then shifted by one |
//! | the commands before this sample's, as many as are in flight | this sample's, then shifted by one |
//! | the motor's torque, where it lags behind its command | by the held commands, exactly |
//! | s = h - z and ḣ of a handle on a shaft | the same |
//! | i_k = Σ T y up to this sample, where an integral term acts on the puck | i_k + T y_{k+1} |
//! | s_{k-1} of a torque along the acceleration, the velocity behind its low-pass | s_{k-1} + T (v̂_k - s_{k-1})/(τ + T) |
//! | r = y - z, where the world sees the position y behind a filter of pole p | p r - p dz |
//! | where the bodies do not step at every sample, the torque of the springs at the puck at this sample | that at the next, if no body stepped |
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
//! **Bodies that step at every n-th sample.** One sample takes the bodies over n periods, D_1. In the n - 1 others they stand still, and the
//! torque of the springs follows the puck by dz, -K dz, D_0. The map of all of them is 1 + D = (1 + D_0)ⁿ⁻¹ (1 + D_1), composed as
//! increments,
//!
//! ```text
//! (1 + D_0) (1 + D_1) = 1 + D_1 + D_0 + D_0 D_1
//! ```
//!
//! The first sample computes the torque of the springs anew, so that it is no state between one step of the bodies and the next.
//!
//! With the spring of a hand, or a motor that lags, the puck is advanced by the exponential in [`DrivenPuck`], with a handle by that in
//! [`DrivenShaft`].

use hapt_model::Sampling;
use nalgebra::{DMatrix, RowDVector};

use crate::equations::delay::{Delay, MAX_IN_FLIGHT};
use crate::equations::discrete::Discrete;
use crate::equations::estimator::{Filter, PositionFilter};
use crate::equations::port::{Block, Port};
use crate::equations::puck::DrivenPuck;
use crate::equations::shaft::DrivenShaft;
use crate::error::Error;
use crate::numerics::phi::{phi1, phi2};

/// D of the module documentation, over a step of the bodies. `damping` is b of the device, `filter` that of the estimator at this period.
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
    let parts = ClosedLoop::new(port, sampling, filter, period, delay.in_flight())?;
    let hold = Hold { interval: period, before: delay.fraction * period, age: delay.samples };
    let mut d = parts.map(&parts.puck(damping, hold));
    if let Some(springs) = parts.springs {
        let still = parts.still();
        d = after(d, &powered(still.map(&still.puck(damping, hold)), sampling.bodies_every - 1));
        d = d.remove_row(springs).remove_column(springs);
    }
    if d.iter().all(|x| x.is_finite()) { Ok(d) } else { Err(Error::Eigenvalues { order: parts.order }) }
}

/// Adds gain · (v̂_k - s_{k-1}) of the torques along the acceleration; the places are those of v̂ and of the first s.
fn along_acceleration(torque: &mut RowDVector<f64>, port: &Port, (estimate, smoothed): (usize, usize), period: f64) {
    for (i, acceleration) in port.accelerations.iter().enumerate() {
        torque[estimate] += acceleration.gain(period);
        torque[smoothed + i] -= acceleration.gain(period);
    }
}

/// The increment of a map after another.
fn after(first: DMatrix<f64>, then: &DMatrix<f64>) -> DMatrix<f64> {
    let both = then * &first;
    first + then + both
}

/// The increment of `times` maps one after the other.
fn powered(map: DMatrix<f64>, mut times: u32) -> DMatrix<f64> {
    let (mut all, mut map) = (DMatrix::zeros(map.nrows(), map.ncols()), map);
    while times > 0 {
        if times % 2 == 1 {
            all = after(all, &map);
        }
        times /= 2;
        if times > 0 {
            map = after(map.clone(), &map);
        }
    }
    all
}

/// The commands under which the puck moves between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hold {
    /// From one sample to the next, s.
    pub interval: f64,
    /// How long the older of two commands still holds, s.
    pub before: f64,
    /// The age in samples of the command that follows.
    pub age: usize,
}

/// The change of the device from one sample to the next, as rows on the state: of the puck's position and velocity, of the motor's
/// torque, where it lags, and with a handle on a shaft of its deflection and of the handle's velocity.
pub(crate) type DeviceChange = Vec<RowDVector<f64>>;

/// One sample of each block, and the indices of the quantities in the state.
#[derive(Clone)]
pub(crate) struct ClosedLoop<'a> {
    port: &'a Port,
    sampling: &'a Sampling,
    filter: &'a Filter,
    period: f64,
    in_flight: usize,
    memory: usize,
    estimated: bool,
    steps: Vec<(&'a Block, Discrete, usize)>,
    /// This sample's command, as a row on the state.
    torque: RowDVector<f64>,
    /// The number of states.
    pub order: usize,
    /// The index of z, if springs join the puck to ground.
    pub position: Option<usize>,
    /// The index of ż.
    pub velocity: usize,
    estimate: usize,
    first_memory: usize,
    first_in_flight: usize,
    /// The index of the motor's torque, if it lags.
    pub motor: Option<usize>,
    /// The index of the deflection of a handle's shaft; the handle's velocity is after it.
    handle: Option<usize>,
    /// The index of y - z of the position's filter.
    filtered: Option<(usize, PositionFilter)>,
    /// The index of the sum of an integral term.
    integral: Option<usize>,
    /// The index of the low-passed velocity of the first torque along the acceleration; those of the others are after it.
    smoothed: usize,
    /// The index of the torque of the springs at the puck, if the bodies do not step at every sample: the last.
    springs: Option<usize>,
    /// The torque by position and velocity of the puck itself.
    own: [f64; 2],
    /// Whether the bodies stand still.
    stands: bool,
}

impl<'a> ClosedLoop<'a> {
    /// The estimator takes steps of `period`, the bodies steps of several periods where they do not step at every sample; `in_flight`
    /// commands before this sample's are kept.
    ///
    /// # Errors
    /// As [`closed_loop`].
    pub fn new(
        port: &'a Port,
        sampling: &'a Sampling,
        filter: &'a Filter,
        period: f64,
        in_flight: usize,
    ) -> Result<Self, Error> {
        if filter.taps.len() > MAX_IN_FLIGHT + 1 {
            let value = (filter.taps.len() - 1) as f64;
            return Err(Error::Value { what: "the estimator's window", value, wanted: "500 samples at most" });
        }
        let uncoupled = port.is_uncoupled();
        // State that nothing uses is omitted.
        let in_flight = if uncoupled { 0 } else { in_flight };
        let estimated = port.takes_velocity() && !filter.taps.is_empty();
        let memory = match filter.kalman {
            _ if !estimated => 0,
            Some(_) => 2,
            None => filter.taps.len().saturating_sub(2),
        };
        let bodies: usize = port.blocks.iter().map(|b| b.positions + b.equations.bodies()).sum();

        let z = port.grounded.then_some(0);
        let v = usize::from(port.grounded);
        let first_body = v + 1;
        let estimate = if estimated { first_body + bodies } else { v };
        let first_memory = first_body + bodies + usize::from(estimated);
        let first_in_flight = first_memory + memory;
        let motor = (port.lag > 0.0 && !uncoupled).then_some(first_in_flight + in_flight);
        let first_of_handle = first_in_flight + in_flight + usize::from(motor.is_some());
        let handle = port.handle.map(|_| first_of_handle);
        let order = first_of_handle + if handle.is_some() { 2 } else { 0 };
        let filtered = PositionFilter::of(sampling, period).filter(|_| !uncoupled).map(|filter| (order, filter));
        let order = order + usize::from(filtered.is_some());
        let integral = (port.integral > 0.0).then_some(order);
        let smoothed = order + usize::from(integral.is_some());
        let order = smoothed + port.accelerations.len();
        let springs = (sampling.bodies_every > 1).then_some(order);
        let order = order + usize::from(springs.is_some());

        let step_of_bodies = f64::from(sampling.bodies_every) * period;
        let mut torque = RowDVector::zeros(order);
        let of_port = [-port.stiffness, -(port.fixed + step_of_bodies * port.per_period)];
        let mut own = of_port;
        let mut steps = Vec::with_capacity(port.blocks.len());
        let mut at = first_body;
        for block in &port.blocks {
            let step =
                Discrete::new(&block.equations, sampling.method, sampling.output, sampling.advance, step_of_bodies)?;
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
        if let Some((r, _)) = filtered {
            torque[r] += own[0];
        }
        if port.has_damper() {
            torque[estimate] += own[1];
        }
        if let Some(i) = integral {
            torque[i] -= port.integral;
        }
        along_acceleration(&mut torque, port, (estimate, smoothed), period);
        Ok(ClosedLoop {
            port,
            sampling,
            filter,
            period,
            in_flight,
            memory,
            estimated,
            steps,
            torque,
            order,
            position: z,
            velocity: v,
            estimate,
            first_memory,
            first_in_flight,
            motor,
            handle,
            filtered,
            integral,
            smoothed,
            springs,
            own: of_port,
            stands: false,
        })
    }

    /// The same at a sample at which the bodies stand still.
    fn still(&self) -> Self {
        let mut torque = RowDVector::zeros(self.order);
        if let Some(springs) = self.springs {
            torque[springs] = 1.0;
        }
        if let Some(i) = self.integral {
            torque[i] -= self.port.integral;
        }
        if self.port.has_damper() {
            torque[self.estimate] += self.own[1];
        }
        along_acceleration(&mut torque, self.port, (self.estimate, self.smoothed), self.period);
        ClosedLoop { torque, stands: true, ..self.clone() }
    }

    /// The index of the command of one sample ago, if any is in flight.
    pub fn first_in_flight(&self) -> usize {
        self.first_in_flight
    }

    fn unit(&self, i: usize) -> RowDVector<f64> {
        RowDVector::from_fn(self.order, |_, j| if i == j { 1.0 } else { 0.0 })
    }

    /// The command of `age` samples ago, as a row on the state.
    pub fn command(&self, age: usize) -> RowDVector<f64> {
        if age == 0 { self.torque.clone() } else { self.unit(self.first_in_flight + age - 1) }
    }

    /// The puck's change over a hold, with a device damping of `damping`.
    pub fn puck(&self, damping: f64, hold: Hold) -> DeviceChange {
        let (port, order, v) = (self.port, self.order, self.velocity);
        let uncoupled = port.is_uncoupled();
        let j = port.inertia;
        let rate = damping / j;
        let (h1, h2) = (hold.before, hold.interval - hold.before);
        let (mut dz, mut dv);
        let mut motor_change = RowDVector::zeros(order);
        if let Some((handle, grip)) = port.handle {
            let lag = self.motor.map_or(0.0, |_| port.lag);
            let puck = DrivenPuck { inertia: j, damping, spring: port.spring, lag };
            return self.with_handle(&DrivenShaft { puck, handle, grip }, hold);
        }
        if self.motor.is_some() || port.spring != 0.0 {
            (dz, dv) = (RowDVector::zeros(order), RowDVector::zeros(order));
            let puck =
                DrivenPuck { inertia: j, damping, spring: port.spring, lag: self.motor.map_or(0.0, |_| port.lag) };
            let at = |place: Option<usize>, change: &RowDVector<f64>| {
                place.map_or_else(|| change.clone(), |i| self.unit(i) + change)
            };
            for (h, age) in [(h1, hold.age + 1), (h2, hold.age)].into_iter().filter(|(h, _)| *h > 0.0) {
                let change = puck.over(h);
                // Without a spring to ground nothing depends on z.
                let state = [at(self.position, &dz), at(Some(v), &dv), at(self.motor, &motor_change)];
                for (i, row) in [&mut dz, &mut dv, &mut motor_change].into_iter().enumerate() {
                    for (part, factor) in state.iter().zip(change.matrix.row(i).iter()) {
                        *row += part * *factor;
                    }
                    if !uncoupled {
                        *row += self.command(age) * change.push[i];
                    }
                }
            }
        } else {
            dz = self.unit(v) * (hold.interval * phi1(rate * hold.interval));
            dv = self.unit(v) * (-rate * hold.interval).exp_m1();
            if !uncoupled {
                let new = self.command(hold.age);
                dz += &new * (h2 * h2 / j * phi2(rate * h2));
                dv += new * (h2 / j * phi1(rate * h2));
                if h1 > 0.0 {
                    let old = self.command(hold.age + 1);
                    let push = h1 / j * phi1(rate * h1);
                    dz += &old * (h1 * h1 / j * phi2(rate * h1) + push * h2 * phi1(rate * h2));
                    dv += old * (push * (-rate * h2).exp());
                }
            }
        }
        vec![dz, dv, motor_change]
    }

    /// The same with a handle on a shaft.
    fn with_handle(&self, shaft: &DrivenShaft, hold: Hold) -> DeviceChange {
        // Without a spring to ground nothing depends on z.
        let places = self.places();
        let mut rows = vec![RowDVector::zeros(self.order); places.len()];
        let parts = [(hold.before, hold.age + 1), (hold.interval - hold.before, hold.age)];
        for (h, age) in parts.into_iter().filter(|(h, _)| *h > 0.0) {
            let change = shaft.over(h);
            let state: Vec<RowDVector<f64>> = places
                .iter()
                .zip(&rows)
                .map(|(at, row)| at.map_or_else(|| row.clone(), |i| self.unit(i) + row))
                .collect();
            for (i, row) in rows.iter_mut().enumerate() {
                for (part, factor) in state.iter().zip(change.matrix.row(i).iter()) {
                    *row += part * *factor;
                }
                if !self.port.is_uncoupled() {
                    *row += self.command(age) * change.push[i];
                }
            }
        }
        rows
    }

    /// Where the rows of a [`DeviceChange`] stand in the state.
    pub fn places(&self) -> Vec<Option<usize>> {
        let handle = self.handle.into_iter().flat_map(|at| [Some(at), Some(at + 1)]);
        [self.position, Some(self.velocity), self.motor].into_iter().chain(handle).collect()
    }

    /// D, affine in the change of the device.
    pub fn map(&self, change: &DeviceChange) -> DMatrix<f64> {
        let ClosedLoop { port, sampling, filter, period, order, memory, estimate, first_memory, .. } = *self;
        let (z, estimated) = (self.position, self.estimated);
        let dz = &change[0];
        let mut d = DMatrix::zeros(order, order);
        for (place, row) in self.places().into_iter().zip(change) {
            if let Some(place) = place {
                d.set_row(place, row);
            }
        }
        // The change of y - z.
        let behind = self.filtered.map(|(r, filter)| {
            let mut row = dz * -filter.pole();
            row[r] -= filter.gain();
            d.set_row(r, &row);
            row
        });
        // The loop counts each sample as one period, for any true interval.
        if let Some(i) = self.integral {
            let mut row = dz * period;
            for place in z.into_iter().chain(self.filtered.map(|(r, _)| r)) {
                row[place] += period;
            }
            if let Some(behind) = &behind {
                row += behind * period;
            }
            d.set_row(i, &row);
        }
        if let Some([of_position, of_velocity, of_acceleration]) = filter.kalman.filter(|_| estimated) {
            let (behind, acceleration) = (first_memory, first_memory + 1);
            let mut error = dz.clone();
            error[behind] -= 1.0;
            error[estimate] -= period;
            error[acceleration] -= 0.5 * period;
            let mut row = &error * (of_velocity / period);
            row[acceleration] += 1.0;
            d.set_row(estimate, &row);
            let mut row = &error * (of_position - 1.0);
            row[behind] -= 1.0;
            d.set_row(behind, &row);
            d.set_row(acceleration, &(&error * (of_acceleration / period)));
        } else if estimated {
            let mut sum = 0.0;
            let gains: Vec<f64> =
                filter.taps.iter().take(filter.taps.len() - 1).map(|tap| (sum += tap, sum).1).collect();
            let mut row = dz * gains.first().copied().unwrap_or(0.0);
            for (i, gain) in gains.iter().enumerate().skip(1) {
                row[first_memory + i - 1] += gain;
            }
            row[estimate] -= if filter.pole == 0.0 { 1.0 } else { period * gains.iter().sum::<f64>() };
            d.set_row(estimate, &row);
        }
        let displacements = if filter.kalman.is_some() { 0 } else { memory };
        for i in 0..displacements {
            let mut row = if i == 0 { dz.clone() } else { self.unit(first_memory + i - 1) };
            row[first_memory + i] -= 1.0;
            d.set_row(first_memory + i, &row);
        }
        for i in 0..self.in_flight {
            let mut row = self.command(i);
            row[self.first_in_flight + i] -= 1.0;
            d.set_row(self.first_in_flight + i, &row);
        }
        let estimate_change = d.row(estimate).into_owned();
        for (i, acceleration) in port.accelerations.iter().enumerate() {
            let part = acceleration.part(period);
            d[(self.smoothed + i, estimate)] = part;
            d[(self.smoothed + i, self.smoothed + i)] = -part;
        }
        for (block, step, at) in &self.steps {
            let (m, p) = (block.equations.bodies(), block.positions);
            // Positions beyond p are not part of the state: their columns are 0.
            let places = (0..p).map(|i| (i, at + i)).chain((0..m).map(|i| (m + i, at + p + i))).collect::<Vec<_>>();
            for &(i, place) in &places {
                let mut row = RowDVector::zeros(order);
                if self.stands {
                    if z.is_none() && i < p {
                        row -= dz * block.shift[i];
                    }
                    d.set_row(place, &row);
                    continue;
                }
                for &(j, column) in &places {
                    row[column] += step.d[(i, j)];
                }
                let held = |j: usize| step.previous[(i, j)] + step.current[(i, j)];
                for place in z.into_iter().chain(self.filtered.map(|(r, _)| r)) {
                    row[place] += held(0);
                }
                if port.has_damper() {
                    row[estimate] += held(1);
                }
                // The methods that take the new sample first: u_{k+1} = u_k + Δu.
                let mut along = 0.0;
                if sampling.method.takes_new_sample_first() {
                    along += step.current[(i, 0)];
                    if let Some(behind) = &behind {
                        row += behind * step.current[(i, 0)];
                    }
                    if port.has_damper() {
                        row += &estimate_change * step.current[(i, 1)];
                    }
                }
                if z.is_none() && i < p {
                    along -= block.shift[i];
                }
                row += dz * along;
                d.set_row(place, &row);
            }
        }
        if let Some(springs) = self.springs {
            let mut row = &self.torque + dz * self.own[0];
            if let Some(behind) = &behind {
                row += behind * self.own[0];
            }
            if port.has_damper() {
                row[estimate] -= self.own[1];
            }
            if let Some(i) = self.integral {
                row[i] += port.integral;
            }
            for (i, acceleration) in port.accelerations.iter().enumerate() {
                row[estimate] -= acceleration.gain(period);
                row[self.smoothed + i] += acceleration.gain(period);
            }
            row[springs] -= 1.0;
            d.set_row(springs, &row);
        }
        d
    }
}
