//! What the hand feels against frequency: the torque that resists a hand which moves as e^{jωt}, over its position.
//!
//! ```text
//! K(jω) = H(e^{jωT}) · (1 - e^{-jωT})/(jωT) · e^{-jω delay}
//! ```
//!
//! H is the port of the loop, from the sampled position to the command, the rest is the fundamental of the held torque. What
//! the hold makes beside it, at ω ± 2πn/T, is left out; at the Nyquist frequency itself that meets the fundamental, and the
//! last row is the limit from below. Encoder, levels, limit and Coulomb friction are left out too.
//!
//! A single number is felt as a spring, a damper and a mass: k + jωb - ω²m. Spring and mass cannot be told apart at one frequency,
//! so each of the three is the one that would do alone: k = Re K, b = Im K/ω, m = -Re K/ω². (Colgate and Brown, "Factors
//! affecting the Z-width of a haptic display", ICRA 1994, speak of impedance in the same way.)
//!
//! The ideal is the same of the differential equations: continuous velocities, no hold, no delay.

use std::f64::consts::{PI, TAU};

use hapt_model::{Coupling, EstimatorKind, World};
use nalgebra::Complex;
use serde::Serialize;

use crate::equations::continuous::{Slopes, bent_anywhere};
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::laws::{Kind, most};
use crate::error::Error;
use crate::impedance::ideal::{Ideal, Tied};
use crate::impedance::{Impedance, Pole, Rule};
use crate::numerics::phi::exp_m1;
use crate::stability::MARGINAL;

type C = Complex<f64>;

/// What is asked for and what is rendered part where they differ by this, relatively.
pub const APART: f64 = 0.1;

/// For so long, as a ratio of frequencies, they have to stay apart; and the steps of its logarithm at which that is looked at.
const LASTS: f64 = 1.01;
const STEP: f64 = 2.5e-3;

/// So far above the springs and dampers at the puck an impedance counts as without bound: a millionth beside a resonance that
/// nothing damps. Nearer to it, the digits are those of where it is.
const WITHOUT_BOUND: f64 = 1e6;

/// One impedance as each of three elements, the one that would do alone: see the module's head.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Elements {
    /// Re K, N·m/rad (linear: N/m).
    pub stiffness: f64,
    /// Im K/ω, N·m·s/rad (linear: N·s/m).
    pub damping: f64,
    /// -Re K/ω², kg·m² (linear: kg).
    pub inertia: f64,
}

/// The impedances at one frequency; `None` where one is without bound, at a resonance that nothing damps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Hz
    pub frequency_hz: f64,
    /// By the loop.
    pub rendered: Option<Elements>,
    /// By the differential equations.
    pub ideal: Option<Elements>,
    /// By the loop and the device together, which is all that the hand feels.
    pub whole: Option<Elements>,
}

/// One of the three.
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

/// What a slow hand is to feel, and how far up it does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Asked {
    /// Which of the three.
    pub element: Element,
    /// Its size in SI, without the device's own.
    pub value: f64,
    /// The lowest frequency from which on the rendered one differs from it by [`APART`]; `None`: nowhere up to Nyquist.
    pub from_asked_hz: Option<f64>,
    /// The same beside the ideal at each frequency.
    pub from_ideal_hz: Option<f64>,
}

/// A swing of the world with the puck held, where little stiffness becomes much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Resonance {
    /// Of the loop's pole, Hz.
    pub frequency_hz: f64,
    /// -cos arg ln λ; 0 within 1e-9 per second of undamped, below 0 when it grows.
    pub damping_ratio: f64,
}

/// The impedance of a world's loop.
#[derive(Clone, Debug)]
pub struct Felt {
    period: f64,
    lag: Delay,
    /// Pole and taps of v = (1 - z⁻¹) W z; `None` for the true velocity.
    slope: Option<(f64, Vec<f64>)>,
    port: Impedance,
    stiffness: f64,
    ideal: Ideal,
    tied: Tied,
    device: [f64; 2],
    notes: Vec<String>,
}

impl Elements {
    fn of(k: C, omega: f64) -> Self {
        // What is 0 but for rounding is 0, and never -0.
        let exact = |x: f64| if x.abs() < 4.0 * f64::EPSILON * k.norm() { 0.0 } else { x };
        Elements { stiffness: exact(k.re), damping: exact(k.im) / omega, inertia: 0.0 - exact(k.re) / (omega * omega) }
    }
}

impl Felt {
    /// The impedance of `world`, nonlinear couplings on `slopes`: [`Slopes::Steep`] as the certificate takes them.
    ///
    /// # Errors
    /// As [`crate::passivity()`].
    pub fn new(world: &World, slopes: &Slopes) -> Result<Felt, Error> {
        let sampling = &world.sampling;
        let period = sampling.period;
        let rule = Rule { method: sampling.method, output: sampling.output, advance: sampling.advance, period };
        let mut port = Impedance::new(&world.bodies, &world.couplings, slopes, rule)?;
        if !port.is_finite() {
            return Err(Error::Eigenvalues { order: port.poles.len() });
        }
        let seen: Vec<Pole> = port.poles.iter().filter(|p| port.has_residue(p, period)).copied().collect();
        port.poles = seen;
        let ideal = Ideal::new(world, slopes)?;
        let tied = ideal.tied();
        let notes = notes(world, slopes, &port);
        let stiffness = if let Tied::Spring(stiffness) = tied { stiffness } else { 0.0 };
        let device = [world.device.inertia, world.device.damping];
        Ok(Felt {
            period,
            lag: Delay::of_loop(sampling)?,
            slope: slope(world),
            port,
            stiffness,
            ideal,
            tied,
            device,
            notes,
        })
    }

    /// Half of the sampling rate, Hz: above it a sampled hand cannot be told from a slower one.
    pub fn nyquist_hz(&self) -> f64 {
        0.5 / self.period
    }

    /// A frequency below which nothing new happens, Hz: a tenth of the world's slowest swing or decay, and no more than a
    /// thousandth of Nyquist.
    pub fn low_hz(&self) -> f64 {
        let nyquist = self.nyquist_hz();
        let rate = |p: &Pole| p.ln_abs.hypot(p.arg) / (TAU * self.period);
        let rates = self.port.poles.iter().map(rate).filter(|hz| hz.is_finite() && *hz > 1e-6 * nyquist);
        0.1 * rates.fold(1e-2 * nyquist, f64::min)
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
        // At the slowest frequencies an inertia leaves double precision.
        let finite = |e: &Elements| [e.stiffness, e.damping, e.inertia].iter().all(|x| x.is_finite());
        let rendered = self.rendered(omega).map(|k| Elements::of(k, omega)).filter(finite);
        let [inertia, damping] = self.device;
        let whole = rendered.map(|e| Elements {
            stiffness: e.stiffness - omega * omega * inertia,
            damping: e.damping + damping,
            inertia: e.inertia + inertia,
        });
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
            Some((pole, taps)) => {
                taps.iter().rev().fold(C::from(0.0), |sum, tap| sum * back + tap) / (1.0 - pole * back)
            }
        };
        // -F
        let mut sum = self.port.direct * back * w;
        for pole in &self.port.poles {
            // 1/(z - λ) = z⁻¹/(1 - λ/z)
            let inverse = -back / exp_m1(C::new(pole.ln_abs, pole.arg - phi));
            let [one, still_back, moving, moving_back] = pole.gains;
            sum += inverse * (one + still_back * back + w * (moving + moving_back * back));
        }
        let h = self.stiffness - exp_m1(C::new(0.0, phi)) * sum;
        let hold = step / C::new(0.0, phi);
        let late = C::from_polar(1.0, -phi * (self.lag.samples as f64 + self.lag.part));
        self.bounded(h * hold * late, omega)
    }

    /// K(jω) of the differential equations.
    fn ideal_at(&self, omega: f64) -> Option<C> {
        self.bounded(self.ideal.at(omega)?, omega)
    }

    fn bounded(&self, k: C, omega: f64) -> Option<C> {
        let [stiffness, damping] = self.port.at_puck;
        (k.norm() <= WITHOUT_BOUND * (stiffness + omega * damping)).then_some(k)
    }

    /// The device's own inertia and damping, SI: -ω²J + jωb comes to the rendered impedance.
    pub fn device(&self) -> [f64; 2] {
        self.device
    }

    /// The springs and dampers at the puck, SI, from which an impedance gets its scale.
    pub fn at_puck(&self) -> [f64; 2] {
        self.port.at_puck
    }

    /// What a reader of the numbers has to know.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Swings that are damped by less than a tenth of critical, by frequency.
    pub fn resonances(&self) -> Vec<Resonance> {
        let of = |p: &Pole| {
            let ln_abs = if p.ln_abs.abs() < MARGINAL * self.period { 0.0 } else { p.ln_abs };
            Resonance { frequency_hz: p.arg / (TAU * self.period), damping_ratio: (0.0 - ln_abs) / ln_abs.hypot(p.arg) }
        };
        let mut all: Vec<Resonance> = self.port.poles.iter().filter(|p| p.arg > 0.0 && p.arg < PI).map(of).collect();
        all.retain(|r| r.damping_ratio < 0.1);
        all.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        all
    }

    /// What a slow hand is to feel, and up to which frequency it does: the stiffness where springs lead to ground; else the
    /// inertia of the bodies that hang on the puck, and, where dampers lead to ground, their damping.
    ///
    /// The ideal is compared by Re K (a damping by Im K) with a tenth of |K|, since Re K passes through 0 at every damped
    /// resonance. What lasts for less than a hundredth of its frequency is passed over: beside a resonance that nothing
    /// damps the slightest shift is much. It is looked for at steps of a 400th, from a tenth of [`Felt::low_hz`] up.
    pub fn asked(&self) -> Vec<Asked> {
        let (element, value) = match self.tied {
            Tied::Spring(stiffness) => (Element::Stiffness, stiffness),
            Tied::Damper(damping, inertia) => {
                let inertia = Some(inertia).filter(|inertia| *inertia > 0.0);
                let inertia = inertia.map(|inertia| self.departure(Element::Inertia, inertia));
                return std::iter::once(self.departure(Element::Damping, damping)).chain(inertia).collect();
            }
            Tied::Not(inertia) => (Element::Inertia, inertia),
        };
        if value > 0.0 { vec![self.departure(element, value)] } else { Vec::new() }
    }

    fn departure(&self, element: Element, value: f64) -> Asked {
        let part = |k: C| if element == Element::Damping { k.im } else { k.re };
        let asked = |omega: f64| match element {
            Element::Stiffness => value,
            Element::Damping => omega * value,
            Element::Inertia => -omega * omega * value,
        };
        let from_asked = |omega: f64| {
            let wanted = asked(omega);
            Some((part(self.rendered(omega)?) - wanted).abs() > APART * wanted.abs())
        };
        let from_ideal = |omega: f64| {
            let wanted = self.ideal_at(omega)?;
            Some(part(self.rendered(omega)? - wanted).abs() > APART * wanted.norm())
        };
        Asked { element, value, from_asked_hz: self.lowest(&from_asked), from_ideal_hz: self.lowest(&from_ideal) }
    }

    /// The lowest frequency, Hz, from which on `apart` holds for a hundredth of it; where that has no value it is passed over.
    fn lowest(&self, apart: &dyn Fn(f64) -> Option<bool>) -> Option<f64> {
        let (low, high) = (0.1 * TAU * self.low_hz(), PI / self.period);
        let count = ((high / low).ln() / STEP).ceil();
        let mut begun: Option<(f64, f64)> = None;
        let mut last = low;
        for i in 0..=count as usize {
            let omega = low * (high / low).powf(i as f64 / count);
            let Some(is) = apart(omega) else { continue };
            match begun {
                Some((_, from)) if is && omega >= LASTS * from => break,
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

/// The estimator as pole and taps of W. FOAW is a difference where the encoder is ideal, and its longest window where it counts.
fn slope(world: &World) -> Option<(f64, Vec<f64>)> {
    let ideal = world.device.encoder.is_none();
    let filters = Filter::of(&world.sampling, world.sampling.period);
    let filter = if ideal { filters.first() } else { filters.last() }?;
    let mut sum = 0.0;
    let mut taps: Vec<f64> = filter.taps.iter().map(|tap| (sum += tap, sum).1).collect();
    // All of them together are 0.
    taps.pop()?;
    Some((filter.pole, taps))
}

fn notes(world: &World, slopes: &Slopes, port: &Impedance) -> Vec<String> {
    let mut notes = Vec::new();
    let bent = bent_anywhere(&world.couplings);
    if !bent.is_empty() {
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
    let band = MARGINAL * world.sampling.period;
    if port.poles.iter().any(|p| p.ln_abs >= band) {
        notes.push(
            "the world grows by itself with the puck held: a hand that swings feels this only until the growth drowns it".into(),
        );
    }
    if port.at_puck[1] > 0.0 {
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
            EstimatorKind::Difference | EstimatorKind::LowPass | EstimatorKind::Foaw | EstimatorKind::FoawBest => {}
        }
    }
    notes
}
