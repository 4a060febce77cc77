//! The required device damping as a function of frequency.
//!
//! The motor applies the torque -H z after a delay of d samples and a fraction a. Between samples the hand is arbitrary. With τ
//! before and τ' after the change of the torque, the losses of the device are least for uniform motion between the changes,
//!
//! ```text
//! b δ²/T - (a τ + (1 - a) τ') δ - a (1 - a) T (τ' - τ)²/(4b),    δ = z_{k+1} - z_k
//! ```
//!
//! so that over all frequencies φ = ωT the damping b has to satisfy (Colgate and Schenkel, J. Robotic Systems 14(1), 1997, for
//! a = 0)
//!
//! ```text
//! b² - b m - h ≥ 0,   m = -T Re{Z H/(z - 1)},   h = a (1 - a) T² |H|²/4,   Z = z⁻ᵈ (1 - a + a z⁻¹)
//! ```
//!
//! A motor that follows its command with a time constant τ is the hold of the response r(t) = t - τ + τ e^{-t/τ} to a ramp. The
//! hand chooses its velocity at φ and at all aliases ω of φ. The form of rank two that H makes of them has the same condition, with
//! m = -Re{H Y}, h = |H|² (A - |Y|²)/4 and
//!
//! ```text
//! Y = (1 - z⁻¹) Σ r(kT - delay) z⁻ᵏ = z⁻ᵈ⁻¹ (T/(z - 1) + (1 - a) T + W),   W = τ (p (1 - z⁻¹)/(1 - E z⁻¹) - 1)
//! A = Σ 1/(ω² (1 + ω² τ²)) = T²/(2 - 2 cos φ) - (τT/2) (1 - E²)/|1 - E z⁻¹|²,    E = e^{-T/τ},   p = e^{-(1 - a)T/τ}
//! A - |Y|² = T²/4 - (τT/2) (1 - E²)/|1 - E z⁻¹|² - |(1/2 - a) T + W|² + T τ p (1 - E) (1 + cos φ)/|1 - E z⁻¹|²
//! ```
//!
//! where the poles at φ = 0 are cancelled by hand in the last. Without a lag it is a (1 - a) T².
//!
//! With H = K + (z - 1) F the static part is a sum of cosines, T K (1/2 + Σ Re z⁻ⁱ, i = 1..d), which is accurate toward φ = 0.

mod condition;

pub(crate) use condition::{Condition, Enough};

use nalgebra::Complex;

use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::impedance::{Pole, TransferFunction};
use crate::numerics::phi::exp_m1;
use crate::numerics::series::{Inverse, Real, Series, TERMS};

type C = Complex<f64>;

/// W of v = (1 - z⁻¹) W z: Σ taps\[i\] z⁻ⁱ/(1 - pole z⁻¹), in 1/s.
#[derive(Clone, Debug, PartialEq)]
struct VelocityFilter {
    taps: Vec<f64>,
    pole: f64,
    /// ln pole
    ln_pole: f64,
}

/// m and h.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DampingCurve {
    period: f64,
    lag: Delay,
    /// Time constant of the motor, s.
    motor: f64,
    /// The term of h in place of a (1 - a) without a lag.
    spread: f64,
    /// Whether the curve is |H| instead.
    is_gain: bool,
    slope: VelocityFilter,
    stiffness: f64,
    direct: f64,
    /// All stiffness at the puck, and its damping over a period, N·m/rad.
    size: f64,
    /// Of m, N·m·s/rad.
    constant: f64,
    /// m contains Σ taps\[i\] Re z⁻ⁱ, from i = 1 on.
    taps: Vec<f64>,
    poles: Vec<Pole>,
}

impl VelocityFilter {
    fn of(filter: &Filter, period: f64) -> VelocityFilter {
        if filter.taps.is_empty() {
            // The true velocity is treated as the difference.
            return VelocityFilter { taps: vec![1.0 / period], pole: 0.0, ln_pole: f64::NEG_INFINITY };
        }
        if filter.pole > 0.0 {
            let ln_pole = (-period * filter.taps[0]).ln_1p();
            return VelocityFilter { taps: vec![filter.taps[0]], pole: filter.pole, ln_pole };
        }
        let mut sum = 0.0;
        let mut taps: Vec<f64> = filter
            .taps
            .iter()
            .map(|tap| {
                sum += tap;
                sum
            })
            .collect();
        taps.pop();
        VelocityFilter { taps, pole: 0.0, ln_pole: f64::NEG_INFINITY }
    }
}

/// λⁿ
fn power(pole: &Pole, n: f64) -> C {
    C::new(pole.ln_abs * n, pole.arg * n).exp()
}

impl DampingCurve {
    /// `motor` is the time constant with which the motor follows its command, s.
    pub fn new(transfer: &TransferFunction, filter: &Filter, lag: Delay, motor: f64, period: f64) -> DampingCurve {
        let mut curve = DampingCurve {
            period,
            lag,
            motor,
            spread: lag.fraction * (1.0 - lag.fraction),
            is_gain: false,
            slope: VelocityFilter::of(filter, period),
            stiffness: transfer.stiffness,
            direct: transfer.direct,
            size: transfer.at_puck[0] + transfer.at_puck[1] / period,
            constant: 0.5 * period * transfer.stiffness,
            taps: vec![0.0; lag.samples + 2],
            poles: transfer.poles.clone(),
        };
        // (1 - a) of a delay d and a of d + 1.
        curve.taps[1..=lag.samples].fill(period * transfer.stiffness);
        curve.taps[lag.samples + 1] = lag.fraction * period * transfer.stiffness;
        curve
    }

    /// The curve of |H|, N·m/rad, whose supremum is the largest gain from positions to torques.
    pub fn gain(transfer: &TransferFunction, filter: &Filter, period: f64) -> DampingCurve {
        let at_once = Delay { samples: 0, fraction: 0.0 };
        DampingCurve { is_gain: true, ..DampingCurve::new(transfer, filter, at_once, 0.0, period) }
    }

    /// The curve whose h has `spread` in place of a (1 - a), without a lag.
    pub fn with_spread(self, spread: f64) -> DampingCurve {
        DampingCurve { spread, ..self }
    }

    /// The scale of m: T K and all dampers at the puck, more with a lag `motor`.
    pub fn size(transfer: &TransferFunction, motor: f64, period: f64) -> f64 {
        (period * transfer.at_puck[0] + transfer.at_puck[1]) * (1.0 + motor / period)
    }

    /// Moves the `chosen` poles from the curve to its constant and its cosines, and returns their residues in Z F: ρλ/(z - λ) has the
    /// real part -Re ρ/2 on the whole circle, and the rest of the numerator is a polynomial in z⁻¹. For delays of whole samples
    /// only.
    pub fn extract(&mut self, chosen: impl Fn(&Pole) -> bool) -> Vec<(Pole, C)> {
        let (out, rest): (Vec<Pole>, Vec<Pole>) = self.poles.iter().partition(|p| chosen(p));
        self.poles = rest;
        out.into_iter().map(|pole| (pole, self.extract_pole(&pole))).collect()
    }

    fn extract_pole(&mut self, pole: &Pole) -> C {
        let [one, back, slope, slope_back] = pole.gains;
        let lambda = power(pole, 1.0);
        let d = self.lag.samples;
        let moving = slope != C::from(0.0) || slope_back != C::from(0.0);
        let reach = d + 1 + if moving { self.slope.taps.len() } else { 0 };
        // The numerator with its delay, by powers of z⁻¹.
        let mut numerator = vec![C::from(0.0); reach + 1];
        numerator[d] += one;
        numerator[d + 1] += back;
        if moving {
            // A low-pass, g z/(z - π): its value at λ belongs to this pole, the rest to its own pole.
            let own = if self.slope.pole > 0.0 { 1.0 / (1.0 - self.slope.pole / lambda) } else { C::from(1.0) };
            for (i, tap) in self.slope.taps.iter().enumerate() {
                numerator[d + i] += slope * own * *tap;
                numerator[d + i + 1] += slope_back * own * *tap;
            }
            if self.slope.pole > 0.0 {
                let left = -self.slope.taps[0] * self.slope.pole / (lambda - self.slope.pole);
                let gains = [left * slope, left * slope_back, C::from(0.0), C::from(0.0)];
                self.poles.push(Pole { ln_abs: self.slope.ln_pole, arg: 0.0, gains });
            }
        }
        let (mut at_pole, mut tap) = (C::from(0.0), C::from(0.0));
        self.taps.resize(self.taps.len().max(reach + 1), 0.0);
        for i in (0..=reach).rev() {
            at_pole += numerator[i] * power(pole, -(i as f64));
            if i > 0 {
                // (z⁻ʲ - λ⁻ʲ)/(z - λ) = -Σ z⁻ⁱ λ^{i - j - 1}, i = 1..j
                tap = (tap - numerator[i]) / lambda;
                self.taps[i] += self.period * tap.re;
            }
        }
        let residue = -at_pole / lambda;
        self.constant += 0.5 * self.period * residue.re;
        residue
    }

    /// The poles of the curve.
    pub fn poles(&self) -> &[Pole] {
        &self.poles
    }

    /// Takes a pole for one with a modulus of e^`ln_abs` at most.
    pub fn slow_down(&mut self, pole: &Pole, ln_abs: f64) {
        self.poles.iter_mut().filter(|p| *p == pole).for_each(|p| p.ln_abs = p.ln_abs.min(ln_abs));
    }

    /// The scale of residues, N·m/rad: stiffness, and damping over a period.
    pub fn gain_size(&self) -> f64 {
        self.size
    }

    /// Omits poles.
    pub fn drop_poles(&mut self, unwanted: impl Fn(&Pole) -> bool) {
        self.poles.retain(|p| !unwanted(p));
    }

    /// T, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// The angles near which the curve may bend.
    pub fn angles(&self) -> Vec<f64> {
        self.poles.iter().map(|p| p.arg).filter(|a| *a >= 0.0).collect()
    }

    /// Half of the length of an interval that begins at an angle and over which a series of few terms is a good bound: half of its middle's
    /// distance from the nearest pole, and small compared with the delay.
    pub fn reach(&self, from: f64) -> f64 {
        let most = 1.0 / (2 + self.taps.len().max(self.slope.taps.len())) as f64;
        let motor = (self.motor > 0.0).then(|| -self.period / self.motor);
        let slope = (self.slope.pole > 0.0).then_some(self.slope.ln_pole);
        let own = self.poles.iter().map(|p| (p.ln_abs, p.arg));
        let all = own.chain(motor.into_iter().chain(slope).map(|ln_abs| (ln_abs, 0.0)));
        let square = |from: f64| {
            all.clone().map(|(ln_abs, arg)| ln_abs * ln_abs + (arg - from).powi(2)).fold(f64::INFINITY, f64::min)
        };
        let first = square(from).sqrt() / 3.0;
        (0.5 * square(from + first.min(most)).sqrt()).max(first).min(most)
    }

    /// m and h over [φ - r, φ + r]; `None` when the interval is too long for a series. At a point, r = 0, one term is enough.
    pub fn over<const N: usize>(&self, phi: f64, r: f64) -> Option<(Real<N>, Real<N>)> {
        let inverse = Inverse::<N>::new(r);
        // 1/(z - λ) = z0⁻¹/(e^{jru} - λ/z0)
        let resolvent = |ln_abs: f64, arg: f64| inverse.of(-exp_m1(C::new(ln_abs, arg - phi)));
        let turn = |n: f64| Series::<N>::turn(C::from_polar(1.0, n * phi), n, r);
        let mut sums = [Series::ZERO; 4];
        for pole in &self.poles {
            let resolvent = resolvent(pole.ln_abs, pole.arg)?;
            for (sum, gain) in sums.iter_mut().zip(&pole.gains) {
                if *gain != C::from(0.0) {
                    sum.add(*gain, &resolvent);
                }
            }
        }
        let (back, unit) = (turn(-1.0), C::from_polar(1.0, -phi));
        let [mut still, still_back, mut moving, moving_back] = sums;
        for sum in [&mut still, &mut moving] {
            let mut turned = Series::ZERO;
            turned.add(unit, sum);
            *sum = turned;
        }
        let add_back = |sum: &mut Series<N>, other: &Series<N>| {
            if !other.is_zero() {
                sum.add(unit, &back.times(other));
            }
        };
        add_back(&mut still, &still_back);
        add_back(&mut moving, &moving_back);
        moving.add(C::from(self.direct), &back);
        if !moving.is_zero() {
            let mut slope = fir(&self.slope.taps, phi, r);
            if self.slope.pole > 0.0 {
                // z/(z - π) = e^{jru}/(e^{jru} - π/z0)
                slope = slope.times(&Series::turn(C::from(1.0), 1.0, r)).times(&resolvent(self.slope.ln_pole, 0.0)?);
            }
            still.add(C::from(1.0), &moving.times(&slope));
        }
        // `still` is now -F.
        // -H
        let whole = || {
            let mut step = Series::turn(C::from_polar(1.0, phi), 1.0, r);
            step.c[0] = exp_m1(C::new(0.0, phi));
            let mut all = Series::constant(C::from(-self.stiffness));
            all.add(C::from(1.0), &step.times(&still));
            all
        };
        if self.is_gain {
            let all = whole();
            return Some((Real::ZERO, all.times(&all.conjugate()).real()));
        }
        let a = self.lag.fraction;
        let lag = turn(-(self.lag.samples as f64));
        let mut lagged = still.times(&lag);
        let mut h = Real::ZERO;
        if a > 0.0 {
            let mut shifted = lagged.times(&back);
            shifted.c.iter_mut().for_each(|c| *c *= a);
            shifted.rest *= a;
            shifted.add(C::from(1.0 - a), &lagged);
            lagged = shifted;
        }
        let mut late = Series::ZERO;
        if self.motor > 0.0 {
            let all = whole();
            let motor = self.motor_over(&resolvent(-self.period / self.motor, 0.0)?, phi, r);
            late = all.times(&motor.torque).times(&lag).times(&back);
            h = all.times(&all.conjugate()).times(&motor.spread).real().scaled(0.25);
        } else if self.spread > 0.0 {
            let all = whole();
            h = all.times(&all.conjugate()).real().scaled(0.25 * self.spread * self.period * self.period);
        }
        let mut m = fir(&self.taps, phi, r);
        m.c[0] += self.constant;
        m.add(C::from(self.period), &lagged);
        m.add(C::from(1.0), &late);
        Some((m.real(), h))
    }

    /// The terms of the motor's lag over [φ - r, φ + r], `resolvent` being 1/(e^{jru} - E/z0).
    fn motor_over<const N: usize>(&self, resolvent: &Series<N>, phi: f64, r: f64) -> MotorTerms<N> {
        let (motor, period) = (self.motor, self.period);
        let rest = (1.0 - self.lag.fraction) * period;
        let (kept, late) = ((-period / motor).exp(), (-rest / motor).exp());
        // 1/(1 - E z⁻¹)
        let inverse = resolvent.times(&Series::turn(C::from(1.0), 1.0, r));
        let square = inverse.times(&inverse.conjugate());
        // 1 - z⁻¹
        let mut step = Series::turn(-C::from_polar(1.0, -phi), -1.0, r);
        step.c[0] = -exp_m1(C::new(0.0, -phi));
        let mut torque = Series::constant(C::from(-motor));
        torque.add(C::from(motor * late), &step.times(&inverse));
        let mut lead = torque;
        lead.c[0] += rest - 0.5 * period;
        // 1 + cos φ
        let mut cosine = Series::constant(C::from(1.0));
        cosine.add(C::from(0.5), &Series::turn(C::from_polar(1.0, phi), 1.0, r));
        cosine.add(C::from(0.5), &Series::turn(C::from_polar(1.0, -phi), -1.0, r));
        let gone = -(-period / motor).exp_m1();
        let mut spread = Series::constant(C::from(0.25 * period * period));
        spread.add(C::from(-0.5 * motor * period * gone * (1.0 + kept)), &square);
        spread.add(C::from(-1.0), &lead.times(&lead.conjugate()));
        spread.add(C::from(period * motor * late * gone), &cosine.times(&square));
        MotorTerms { torque, spread }
    }
}

/// W, and A - |Y|².
struct MotorTerms<const N: usize> {
    torque: Series<N>,
    spread: Series<N>,
}

/// Σ taps\[i\] z⁻ⁱ over [φ - r, φ + r].
fn fir<const N: usize>(taps: &[f64], phi: f64, r: f64) -> Series<N> {
    let mut sum = Series::<N>::ZERO;
    for (i, tap) in taps.iter().enumerate().filter(|(_, tap)| **tap != 0.0) {
        // tap e^{-ijφ} (-i r)^k/k!, with the turn j^k of each term after the loop.
        let (turn, mut part) = (C::from_polar(1.0, -(i as f64) * phi), *tap);
        for (k, c) in sum.c.iter_mut().enumerate() {
            *c += turn * part;
            part *= -(i as f64) * r * INVERSE[k];
        }
        // As of a turn, the remainder is below its first term.
        sum.rest += part.abs();
    }
    for k in 1..N {
        sum.c[k] = (0..k).fold(sum.c[k], |c, _| C::new(-c.im, c.re));
    }
    sum
}

/// 1/(k + 1)
const INVERSE: [f64; TERMS] = {
    let (mut inverse, mut k) = ([0.0; TERMS], 0);
    while k < TERMS {
        inverse[k] = 1.0 / (k as f64 + 1.0);
        k += 1;
    }
    inverse
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passivity::supremum::{Wanted, supremum};

    #[test]
    fn a_virtual_mass_by_double_differences_is_at_most_half_of_b_t() {
        // H = M (1 - z⁻¹)²/T²: F = M (1 - z⁻¹) z⁻¹/T², a pole at 0.
        let (mass, period) = (0.3, 2e-3);
        let gain = C::from(mass / (period * period));
        let pole = Pole { ln_abs: f64::NEG_INFINITY, arg: 0.0, gains: [-gain, gain, C::from(0.0), C::from(0.0)] };
        let transfer = TransferFunction {
            stiffness: 0.0,
            direct: 0.0,
            poles: vec![pole],
            at_puck: [gain.re, 0.0],
            is_accurate: true,
        };
        let filter = Filter { pole: 0.0, taps: Vec::new(), kalman: None };
        let curve = DampingCurve::new(&transfer, &filter, Delay { samples: 0, fraction: 0.0 }, 0.0, period);
        let found = supremum(&curve, DampingCurve::size(&transfer, 0.0, period), Wanted::Value).unwrap();
        assert!((found.value / (2.0 * mass / period) - 1.0).abs() < 1e-12, "{found:?}");
        assert_eq!(found.at, Some(std::f64::consts::PI));
    }
}
