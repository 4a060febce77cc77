//! The impedance at the puck against frequency: the torque that resists a motion e^{jωt}, divided by the position.
//!
//! ```text
//! K(jω) = H(e^{jωT}) · (1 - e^{-jωT})/(jωT) · e^{-jω delay}
//! ```
//!
//! H is the transfer function from the sampled position to the command. The other factors are the fundamental of the held torque.
//! The images of the hold at ω ± 2πn/T are omitted. At the Nyquist frequency an image coincides with the fundamental, and the last
//! row is the limit from below. Encoder, levels, limit and Coulomb friction are omitted too.
//!
//! One complex number is equivalent to a spring, a damper and a mass, k + jωb - ω²m. Spring and mass cannot be distinguished at one
//! frequency, so each of the three is the value of the one element that would render K: k = Re K, b = Im K/ω, m = -Re K/ω². (Colgate and
//! Brown, "Factors affecting the Z-width of a haptic display", ICRA 1994, use impedance in this sense.)
//!
//! The ideal is that of the differential equations: continuous velocities, no hold, no delay.
//!
//! With a handle on a shaft the whole is what a hand feels there: with K_z = K + jωb - ω²J at the puck and S = k + jωd of the shaft,
//! S K_z/(S + K_z) - ω²J_h. Rendered and ideal stay those at the puck.

use std::f64::consts::{PI, TAU};

use hapt_model::{Coupling, EstimatorKind, Handle, Motion, World};
use nalgebra::Complex;
use serde::Serialize;

use crate::equations::continuous::{Slopes, piecewise};
use crate::equations::delay::Delay;
use crate::equations::estimator::{Filter, PositionFilter};
use crate::equations::laws::{self, Kind, most};
use crate::error::{Error, at_one_rate};
use crate::impedance::ideal::{Ideal, LowFrequency};
use crate::impedance::{Discretisation, Pole, TransferFunction};
use crate::numerics::phi::exp_m1;
use crate::stability::MARGINAL;
use crate::text::number;

type C = Complex<f64>;

/// Relative deviation of the rendered from the nominal impedance that counts as a departure.
pub const TOLERANCE: f64 = 0.1;

/// Ratio of frequencies over which a departure has to last, and the step of the logarithm at which it is sampled.
const MIN_WIDTH: f64 = 1.01;
const STEP: f64 = 2.5e-3;

/// Ratio to the springs and dampers at the puck above which an impedance counts as unbounded, near an undamped resonance.
const UNBOUNDED: f64 = 1e6;

/// One impedance as each of three single elements, see the module documentation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Elements {
    /// Re K, N·m/rad (linear: N/m).
    pub stiffness: f64,
    /// Im K/ω, N·m·s/rad (linear: N·s/m).
    pub damping: f64,
    /// -Re K/ω², kg·m² (linear: kg).
    pub inertia: f64,
}

/// The impedances at one frequency; `None` where one is unbounded, at an undamped resonance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Hz
    pub frequency_hz: f64,
    /// By the loop.
    pub rendered: Option<Elements>,
    /// By the differential equations.
    pub ideal: Option<Elements>,
    /// By the loop and the device together: the total impedance, at the handle where there is one.
    pub whole: Option<Elements>,
}

/// The columns of impedances as a table: frequency, then rendered, ideal and whole.
pub fn columns(motion: Motion) -> Vec<String> {
    let of = |of: &str| suffixes(motion).map(|suffix| format!("{of}{suffix}"));
    let elements = ["", "ideal_", "whole_"].into_iter().flat_map(of);
    std::iter::once("frequency_hz".to_string()).chain(elements).collect()
}

/// Stiffness, damping and inertia in the names of columns.
pub fn suffixes(motion: Motion) -> [&'static str; 3] {
    match motion {
        Motion::Rotary => ["stiffness_Nm_per_rad", "damping_Nms_per_rad", "inertia_kgm2"],
        Motion::Linear => ["stiffness_N_per_m", "damping_Ns_per_m", "inertia_kg"],
    }
}

impl Row {
    /// The numbers of [`columns`].
    pub fn numbers(&self) -> impl Iterator<Item = Option<f64>> {
        let of = |of: Option<Elements>| [of.map(|e| e.stiffness), of.map(|e| e.damping), of.map(|e| e.inertia)];
        let elements = [self.rendered, self.ideal, self.whole].into_iter().flat_map(of);
        std::iter::once(Some(self.frequency_hz)).chain(elements)
    }
}

/// The type of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Element {
    /// Re K.
    Stiffness,
    /// Im K/ω.
    Damping,
    /// -Re K/ω².
    Inertia,
}

/// The nominal element of a world at low frequency, and the frequency up to which the loop renders it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Nominal {
    /// The type of the element.
    pub element: Element,
    /// Its value in SI, without the device.
    pub value: f64,
    /// The lowest frequency at which the rendered element departs from it by [`TOLERANCE`]; `None`: nowhere up to Nyquist.
    #[serde(rename = "from_asked_hz")]
    pub from_nominal_hz: Option<f64>,
    /// The same relative to the ideal at each frequency.
    pub from_ideal_hz: Option<f64>,
}

/// A resonance of the held world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Resonance {
    /// Of the discrete pole, Hz.
    pub frequency_hz: f64,
    /// -cos arg ln λ; 0 within 1e-9 per second of undamped, below 0 when it grows.
    pub damping_ratio: f64,
}

/// The impedance of a world's loop.
///
/// ```
/// use hapt_analysis::{Impedance, Slopes};
/// use hapt_model::{Source, World};
///
/// let source = r#"
///     [loop]
///     period = "1 ms"
///     [device]
///     inertia = 6.4e-4
///     [[couplings]]
///     kind = "spring"
///     between = ["puck", "ground"]
///     stiffness = 2.0
///     [scenarios.still]
///     duration = "1 s"
///     hand = { kind = "step", to = 0.0 }
/// "#;
/// let world = World::read(&Source::from_text("spring", source), &[])?;
/// let impedance = Impedance::new(&world, &Slopes::Steep)?;
/// // At low frequency the loop renders the spring, and the hold adds a damping of -KT/2.
/// let row = impedance.row(0.1).rendered.unwrap();
/// assert!((row.stiffness - 2.0).abs() < 1e-6);
/// assert!((row.damping + 0.5 * 2.0 * 1e-3).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Impedance {
    period: f64,
    lag: Delay,
    /// The time constant of the motor, s.
    motor_lag: f64,
    /// v = (1 - z⁻¹) W z; `None` for the true velocity.
    slope: Option<Slope>,
    transfer: TransferFunction,
    /// The gain of the integral terms, N·m/(rad·s), and the pole of the filter before them; 0: none.
    integral: (f64, f64),
    stiffness: f64,
    ideal: Ideal,
    low_frequency: LowFrequency,
    device: [f64; 2],
    handle: Option<Handle>,
    notes: Vec<String>,
}

impl Elements {
    fn of(k: C, omega: f64) -> Self {
        // Rounding residues become 0, never -0.
        let exact = |x: f64| if x.abs() < 4.0 * f64::EPSILON * k.norm() { 0.0 } else { x };
        Elements { stiffness: exact(k.re), damping: exact(k.im) / omega, inertia: 0.0 - exact(k.re) / (omega * omega) }
    }
}

impl Impedance {
    /// The impedance of `world`, nonlinear couplings linearised at `slopes`; the certificate uses [`Slopes::Steep`].
    ///
    /// # Errors
    /// As [`crate::passivity()`]; [`Error::BodiesEvery`].
    pub fn new(world: &World, slopes: &Slopes) -> Result<Impedance, Error> {
        let sampling = &world.sampling;
        at_one_rate(sampling, "the impedance")?;
        let period = sampling.period;
        let rule =
            Discretisation { method: sampling.method, output: sampling.output, advance: sampling.advance, period };
        let mut transfer = TransferFunction::new(&world.bodies, &world.couplings, slopes, rule)?;
        if !transfer.is_finite() {
            return Err(Error::Eigenvalues { order: transfer.poles.len() });
        }
        if let Some(filter) = PositionFilter::of(sampling, period) {
            transfer = transfer.behind(filter).ok_or(Error::Value {
                what: "loop.filter in Hz",
                value: sampling.filter.unwrap_or(0.0),
                wanted: "another, since its pole is that of a mode of the world to six digits",
            })?;
        }
        let seen: Vec<Pole> = transfer.poles.iter().filter(|p| transfer.has_residue(p, period)).copied().collect();
        transfer.poles = seen;
        let gain = world.couplings.iter().map(|c| laws::integral_gain(&c.law)).sum();
        let integral = (gain, PositionFilter::of(sampling, period).map_or(0.0, PositionFilter::pole));
        let ideal = Ideal::new(world, slopes)?;
        let low_frequency = ideal.low_frequency();
        let notes = notes(world, slopes, &transfer);
        let stiffness = if let LowFrequency::Spring(stiffness) = low_frequency { stiffness } else { 0.0 };
        let device = [world.device.inertia, world.device.damping];
        Ok(Impedance {
            period,
            lag: Delay::of_loop(sampling)?,
            motor_lag: world.device.lag,
            slope: slope(world),
            transfer,
            integral,
            stiffness,
            ideal,
            low_frequency,
            device,
            handle: world.device.handle,
            notes,
        })
    }

    /// Half of the sampling rate, Hz.
    pub fn nyquist_hz(&self) -> f64 {
        0.5 / self.period
    }

    /// A frequency in Hz below which the impedance has its low-frequency form: a tenth of the slowest mode, and at most a thousandth
    /// of Nyquist.
    pub fn low_hz(&self) -> f64 {
        let nyquist = self.nyquist_hz();
        let rate = |p: &Pole| p.ln_abs.hypot(p.arg) / (TAU * self.period);
        let rates = self.transfer.poles.iter().map(rate).filter(|hz| hz.is_finite() && *hz > 1e-6 * nyquist);
        0.1 * rates.fold(1e-2 * nyquist, f64::min)
    }

    /// The lowest and the highest frequency in Hz of a range up to Nyquist, from the given ends, each above 0; without them from
    /// [`Impedance::low_hz`] to Nyquist. `names` are those that the caller gives the two ends.
    ///
    /// # Errors
    /// A sentence about ends that do not rise from above 0 to at most Nyquist.
    pub fn range(&self, ends: [Option<f64>; 2], names: [&str; 2]) -> Result<[f64; 2], String> {
        let ([low, high], [from, to], nyquist) = (ends, names, self.nyquist_hz());
        let high = high.unwrap_or(nyquist);
        if high.is_nan() || high > nyquist * (1.0 + 1e-12) {
            let (high, nyquist) = (number(high), number(nyquist));
            return Err(format!(
                "{to}: {high} Hz is beyond {nyquist} Hz, half of the sampling rate, where frequencies are ambiguous"
            ));
        }
        let low = low.unwrap_or_else(|| self.low_hz().min(0.1 * high));
        match (low > 0.0, low < high) {
            (true, true) => Ok([low, high.min(nyquist)]),
            (true, false) => {
                Err(format!("{from}: {} Hz must be below {to}, which is {} Hz", number(low), number(high)))
            }
            (false, _) => Err(format!("{from}: {low} Hz must be positive")),
        }
    }

    /// `points` frequencies from `low` to `high`, equal ratios apart, both included.
    pub fn rows(&self, low: f64, high: f64, points: usize) -> Vec<Row> {
        let last = points.saturating_sub(1).max(1) as f64;
        let hz = |i: usize| if i + 1 == points && i > 0 { high } else { low * (high / low).powf(i as f64 / last) };
        (0..points).map(|i| self.row(hz(i))).collect()
    }

    /// The impedances at a frequency in Hz, above 0 and up to Nyquist.
    pub fn row(&self, frequency_hz: f64) -> Row {
        let omega = TAU * frequency_hz;
        // At very low frequencies the inertia may leave double precision.
        let finite = |e: &Elements| [e.stiffness, e.damping, e.inertia].iter().all(|x| x.is_finite());
        let rendered = self.rendered(omega).map(|k| Elements::of(k, omega)).filter(finite);
        let [inertia, damping] = self.device;
        let at_puck = |e: Elements| Elements {
            stiffness: e.stiffness - omega * omega * inertia,
            damping: e.damping + damping,
            inertia: e.inertia + inertia,
        };
        let whole = match self.handle {
            None => rendered.map(at_puck),
            Some(handle) => rendered.map(|e| Elements::of(beyond(handle, at_puck(e), omega), omega)),
        };
        let ideal = self.ideal_at(omega).map(|k| Elements::of(k, omega)).filter(finite);
        Row { frequency_hz, rendered, ideal, whole: whole.filter(finite) }
    }

    /// K(jω) of the loop.
    fn rendered(&self, omega: f64) -> Option<C> {
        let phi = omega * self.period;
        let back = C::from_polar(1.0, -phi);
        // 1 - z⁻¹
        let step = -exp_m1(C::new(0.0, -phi));
        let w = match &self.slope {
            None => C::new(0.0, omega) / step,
            Some(Slope::Taps { pole, taps }) => {
                taps.iter().rev().fold(C::from(0.0), |sum, tap| sum * back + tap) / (1.0 - pole * back)
            }
            // The error of the prediction is (1 - z⁻¹)³ z over this.
            Some(Slope::Kalman([a, b, c])) => {
                let all = step * step * step + a * back * step * step + back * (b * step + 0.5 * c * step + c * back);
                (b * step + c * back) / (self.period * all)
            }
        };
        // -F
        let mut sum = self.transfer.direct * back * w;
        for pole in &self.transfer.poles {
            // 1/(z - λ) = z⁻¹/(1 - λ/z)
            let inverse = -back / exp_m1(C::new(pole.ln_abs, pole.arg - phi));
            let [one, still_back, moving, moving_back] = pole.gains;
            sum += inverse * (one + still_back * back + w * (moving + moving_back * back));
        }
        let mut h = self.stiffness - exp_m1(C::new(0.0, phi)) * sum;
        let (gain, pole) = self.integral;
        if gain > 0.0 {
            // T/(1 - z⁻¹), behind (1 - p)/(1 - p z⁻¹)
            h += gain * self.period / step * (1.0 - pole) / (1.0 - pole * back);
        }
        let hold = step / C::new(0.0, phi);
        let late = C::from_polar(1.0, -phi * (self.lag.samples as f64 + self.lag.fraction));
        self.bounded(h * hold * late / C::new(1.0, omega * self.motor_lag), omega)
    }

    /// K(jω) of the differential equations.
    fn ideal_at(&self, omega: f64) -> Option<C> {
        self.bounded(self.ideal.at(omega)?, omega)
    }

    fn bounded(&self, k: C, omega: f64) -> Option<C> {
        let [stiffness, damping] = self.transfer.at_puck;
        (k.norm() <= UNBOUNDED * (stiffness + omega * damping)).then_some(k)
    }

    /// The device's own inertia and damping at the puck, SI: -ω²J + jωb comes to the rendered impedance.
    pub fn device(&self) -> [f64; 2] {
        self.device
    }

    /// The springs and dampers at the puck, SI: the scale of the impedance.
    pub fn at_puck(&self) -> [f64; 2] {
        self.transfer.at_puck
    }

    /// Conditions that apply to the numbers.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Resonances with less than a tenth of critical damping, by frequency.
    pub fn resonances(&self) -> Vec<Resonance> {
        let of = |p: &Pole| {
            let ln_abs = if p.ln_abs.abs() < MARGINAL * self.period { 0.0 } else { p.ln_abs };
            Resonance { frequency_hz: p.arg / (TAU * self.period), damping_ratio: (0.0 - ln_abs) / ln_abs.hypot(p.arg) }
        };
        let mut all: Vec<Resonance> =
            self.transfer.poles.iter().filter(|p| p.arg > 0.0 && p.arg < PI).map(of).collect();
        all.retain(|r| r.damping_ratio < 0.1);
        all.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        all
    }

    /// The elements that the world has at low frequency, and the frequency up to which the loop renders them: the stiffness where
    /// springs lead to ground; otherwise the inertia of the bodies coupled to the puck and, where dampers lead to ground, their damping.
    ///
    /// The comparison with the ideal is of Re K (Im K for a damping) with a tenth of |K|, since Re K passes through 0 at every damped
    /// resonance. Departures over less than a hundredth of the frequency are ignored: near an undamped resonance the smallest
    /// shift is a large deviation. The search has steps of a 400th, from a tenth of [`Impedance::low_hz`] up.
    pub fn nominal(&self) -> Vec<Nominal> {
        let (element, value) = match self.low_frequency {
            LowFrequency::Spring(stiffness) => (Element::Stiffness, stiffness),
            LowFrequency::Damper(damping, inertia) => {
                let inertia = Some(inertia).filter(|inertia| *inertia > 0.0);
                let inertia = inertia.map(|inertia| self.departure(Element::Inertia, inertia));
                return std::iter::once(self.departure(Element::Damping, damping)).chain(inertia).collect();
            }
            LowFrequency::Free(inertia) => (Element::Inertia, inertia),
        };
        if value > 0.0 { vec![self.departure(element, value)] } else { Vec::new() }
    }

    fn departure(&self, element: Element, value: f64) -> Nominal {
        let part = |k: C| if element == Element::Damping { k.im } else { k.re };
        let nominal = |omega: f64| match element {
            Element::Stiffness => value,
            Element::Damping => omega * value,
            Element::Inertia => -omega * omega * value,
        };
        let from_nominal = |omega: f64| {
            let wanted = nominal(omega);
            Some((part(self.rendered(omega)?) - wanted).abs() > TOLERANCE * wanted.abs())
        };
        let from_ideal = |omega: f64| {
            let wanted = self.ideal_at(omega)?;
            Some(part(self.rendered(omega)? - wanted).abs() > TOLERANCE * wanted.norm())
        };
        Nominal {
            element,
            value,
            from_nominal_hz: self.lowest_departure(&from_nominal),
            from_ideal_hz: self.lowest_departure(&from_ideal),
        }
    }

    /// The lowest frequency, Hz, from which on `apart` holds for a hundredth of it. Frequencies without a value are skipped.
    fn lowest_departure(&self, apart: &dyn Fn(f64) -> Option<bool>) -> Option<f64> {
        let (low, high) = (0.1 * TAU * self.low_hz(), PI / self.period);
        let count = ((high / low).ln() / STEP).ceil();
        let mut begun: Option<(f64, f64)> = None;
        let mut last = low;
        for i in 0..=count as usize {
            let omega = low * (high / low).powf(i as f64 / count);
            let Some(is) = apart(omega) else { continue };
            match begun {
                Some((_, from)) if is && omega >= MIN_WIDTH * from => break,
                None if is => begun = Some((last, omega)),
                Some(_) if !is => begun = None,
                _ => {}
            }
            last = omega;
        }
        let (mut not, mut yes) = begun?;
        loop {
            let middle = 0.5 * (not + yes);
            if middle <= not || middle >= yes {
                return Some(yes / TAU);
            }
            if apart(middle) == Some(true) { yes = middle } else { not = middle }
        }
    }
}

/// The impedance at the handle of a shaft, from the impedance at the puck.
fn beyond(handle: Handle, puck: Elements, omega: f64) -> C {
    let Handle { inertia, stiffness, damping } = handle;
    let (shaft, puck) = (C::new(stiffness, omega * damping), C::new(puck.stiffness, omega * puck.damping));
    // Keeps all digits of the softer of the two.
    let both = if shaft.norm() < puck.norm() { shaft / (1.0 + shaft / puck) } else { puck / (1.0 + puck / shaft) };
    both - omega * omega * inertia
}

/// An estimator as W.
#[derive(Clone, Debug)]
enum Slope {
    Taps {
        pole: f64,
        taps: Vec<f64>,
    },
    /// α, β, γ
    Kalman([f64; 3]),
}

/// The estimator. FOAW is a difference with an ideal encoder, and its longest window with a real one.
fn slope(world: &World) -> Option<Slope> {
    let ideal = world.device.encoder.is_none();
    let filters = Filter::of(&world.sampling, world.sampling.period);
    let filter = if ideal { filters.first() } else { filters.last() }?;
    if let Some(gains) = filter.kalman {
        return Some(Slope::Kalman(gains));
    }
    let mut sum = 0.0;
    let mut taps: Vec<f64> = filter.taps.iter().map(|tap| (sum += tap, sum).1).collect();
    // The taps sum to 0.
    taps.pop()?;
    Some(Slope::Taps { pole: filter.pole, taps })
}

fn notes(world: &World, slopes: &Slopes, transfer: &TransferFunction) -> Vec<String> {
    let mut notes = Vec::new();
    let indices = piecewise(&world.couplings);
    if !indices.is_empty() {
        let taken = match slopes {
            Slopes::Steep => "on its steepest rise, as the certificate takes it: a wall is touched, a bristle sticks",
            Slopes::Flat | Slopes::Chosen(_) => "flat: no wall is touched, a bristle slides",
        };
        notes.push(format!("every nonlinear coupling is taken {taken}"));
    }
    let nothing = |c: &Coupling| matches!(Kind::of(c), Kind::Coulomb | Kind::Constant) && most(c) != 0.0;
    for (index, _) in world.couplings.iter().enumerate().filter(|(_, c)| nothing(c)) {
        notes.push(format!("couplings.{index}: it has no slope and counts as nothing"));
    }
    if world.device.handle.is_some() {
        notes.push(
            "rendered and ideal are at the puck, resonances with the puck held; the whole is felt at the handle, beyond its shaft".into(),
        );
    }
    if !world.device.torque.is_none() {
        notes.push("gravity and cogging of the device are not linear and are left out".into());
    }
    if world.device.stops.is_some() {
        notes.push("end stops of the device are left out: this is felt between them".into());
    }
    if world.device.falling_friction() > 0.0 {
        notes.push(
            "friction of the device that falls with the speed is left out: it counts as no missing damping".into(),
        );
    }
    let band = MARGINAL * world.sampling.period;
    if transfer.poles.iter().any(|p| p.ln_abs >= band) {
        notes.push(
            "the world grows by itself with the puck held: a hand that swings feels this only until the growth drowns it".into(),
        );
    }
    if transfer.at_puck[1] > 0.0 {
        match world.sampling.estimator {
            EstimatorKind::Exact => notes.push(
                "dampers at the puck are given its true velocity, which no encoder has: name the estimator of your firmware"
                    .into(),
            ),
            EstimatorKind::Foaw | EstimatorKind::FoawBest if world.device.encoder.is_some() => {
                notes.push(format!(
                    "{} is taken at its longest window, {} samples, as in slow motion",
                    world.sampling.estimator.name(),
                    world.sampling.window
                ));
            }
            EstimatorKind::Levant => notes.push(
                "levant is taken as the difference, which it is as long as the velocity changes by no more than 1.1 loop.acceleration".into(),
            ),
            EstimatorKind::Difference
            | EstimatorKind::LowPass
            | EstimatorKind::Foaw
            | EstimatorKind::FoawBest
            | EstimatorKind::Kalman => {}
        }
    }
    notes
}
