//! Compares the torque that acted on a wheel with the requested one.

use super::cases::{Case, Scale};
use super::effect::Law;
use super::meaning::{Action, KnownError, Played, torque};
use super::motion::Course;
use super::plant::Plant;
use super::run::Seen;

/// The root mean square of a difference that counts as none, in parts of the largest torque.
pub const NEAR: f64 = 0.02;
/// A difference within this multiple of the noise also counts as none.
const NOISES: f64 = 3.0;
/// An error explains a difference where less than this part of the difference remains.
const EXPLAINED: f64 = 0.4;

/// For a difference beyond this part of the tolerance, a law that is rendered as another one is searched for.
const HIDDEN: f64 = 0.25;

/// A law whose torque is below this part of the tolerance is missing.
const MIN_LAW: f64 = 0.2;

/// The result of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The wheel renders the standard's meaning.
    Conforms,
    /// The wheel renders a known error of drivers.
    Known(KnownError),
    /// The wheel renders something else.
    Differs,
}

/// A case with its result.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Its name.
    pub name: &'static str,
    /// The request, in a sentence.
    pub asks: String,
    /// The result.
    pub verdict: Verdict,
    /// The root mean square of the difference, in shares of the largest torque.
    pub off: f64,
    /// The wheel's scale of the law, where the case has found one: the torque of full coefficient at 1/s, in motion, or at 1/s².
    pub scale: Option<(Law, f64)>,
    /// The time in s, the torque that acted, and the one that was meant, in parts of the largest, positive to the right.
    pub torques: Vec<(f64, f64, f64)>,
}

/// Judges the cases of one wheel, in their order.
pub struct Judge {
    plant: Plant,
    scales: Vec<(Law, f64)>,
}

/// A hypothesis, and its distance from the torque that acted.
struct Fit {
    meant: Vec<f64>,
    off: f64,
    scale: f64,
    /// The root mean square of the part in the wheel's own scale.
    own: f64,
}

impl Judge {
    /// The judge of a wheel with this plant.
    pub fn new(plant: Plant) -> Self {
        Judge { plant, scales: Vec::new() }
    }

    /// The tolerance of a difference, in parts of the largest torque.
    pub fn near(&self) -> f64 {
        NEAR.max(NOISES * self.plant.noise)
    }

    /// The result of the case; `None` where the trace of the wheel is too short.
    pub fn judge(&mut self, case: &Case, seen: &Seen) -> Option<Finding> {
        let course = Course::of(&seen.trace)?;
        let acted = self.plant.acted(&course);
        if acted.is_empty() {
            return None;
        }
        let begin = seen.trace.first()?.0;
        // With the actual times of the actions, in place of the planned ones.
        let mut effects = case.effects.clone();
        for (at, effect) in effects.iter_mut().enumerate() {
            effect.actions = done(seen, at);
        }
        let fit = |error| self.fit(case, &effects, seen, &course, &acted, error);
        let plain = fit(None);
        let near = self.near();
        let fitted = self.fitted(case.scale);
        let is_missing = fitted && plain.own < (MIN_LAW * near).max(NOISES * self.plant.noise);
        // A fitted scale can hide that another law is rendered.
        let hides = fitted && (is_missing || plain.off > HIDDEN * near);
        let verdict = if plain.off <= near && !hides {
            Verdict::Conforms
        } else {
            // Of two equal explanations the first counts: a sawtooth that runs the other way is also an inverted one.
            let first = (self.plant.strength < 0.0).then_some(&KnownError::Inverted);
            let others = first.into_iter().chain(KnownError::ALL).map(|error| (*error, fit(Some(*error)).off));
            let best = others.min_by(|a, b| a.1.total_cmp(&b.1));
            let enough = if hides { EXPLAINED * plain.off } else { near.max(EXPLAINED * plain.off) };
            let explained = best.filter(|(_, off)| *off <= enough && *off < plain.off);
            let plainly = match (is_missing, plain.off <= near) {
                (true, true) => Verdict::Known(KnownError::Nothing),
                (false, true) => Verdict::Conforms,
                (_, false) => Verdict::Differs,
            };
            explained.map_or(plainly, |(error, _)| Verdict::Known(error))
        };
        let off = plain.off;
        let scale = match case.scale {
            Scale::Finds(law) => Some((law, plain.scale)).filter(|_| verdict == Verdict::Conforms),
            Scale::Stated | Scale::Uses(_) => None,
        };
        self.scales.extend(scale);
        let times = course.middles().map(|at| course.time(at) - begin);
        let middle = acted.iter().map(|(least, most)| 0.5 * (least + most));
        let push = self.pushes(case, seen, &course, None);
        let torques = times.zip(middle.zip(plain.meant).zip(push)).map(|(time, ((acted, meant), push))| {
            // Without the torque of the swing.
            (time, acted - push, meant - push)
        });
        Some(Finding { name: case.name, asks: case.asks.clone(), verdict, off, scale, torques: torques.collect() })
    }

    /// Whether the wheel's own scale is to be fitted: by the case that finds it, or where that case has found none.
    fn fitted(&self, scale: Scale) -> bool {
        match scale {
            Scale::Stated => false,
            Scale::Finds(_) => true,
            Scale::Uses(law) => self.scales.iter().all(|(known, _)| *known != law),
        }
    }

    /// The means of the swing's torque.
    fn pushes(&self, case: &Case, seen: &Seen, course: &Course, error: Option<KnownError>) -> Vec<f64> {
        let gain = if error == Some(KnownError::Gain) { 1.0 } else { case.gain };
        // The fit of the plant has found whether the sign is inverted.
        let gain = gain * self.plant.strength.signum();
        let at = |at: usize| gain * seen.push(course.time(at) - self.plant.latency);
        course.means(&(0..course.motion.len()).map(at).collect::<Vec<_>>())
    }

    fn fit(
        &self,
        case: &Case,
        effects: &[Played],
        seen: &Seen,
        course: &Course,
        acted: &[(f64, f64)],
        error: Option<KnownError>,
    ) -> Fit {
        let one = |at: usize| {
            let time = course.time(at) - self.plant.latency;
            let effect = torque(effects, case.gain, time, &course.motion[at], error);
            // The torque of the swing has started first.
            let stops_push = error == Some(KnownError::Last) && effects.iter().any(|effect| effect.plays(time, error));
            (effect, stops_push)
        };
        let all: Vec<_> = (0..course.motion.len()).map(one).collect();
        let stated = course.means(&all.iter().map(|(torque, _)| torque.stated).collect::<Vec<_>>());
        let scaled = course.means(&all.iter().map(|(torque, _)| torque.scaled).collect::<Vec<_>>());
        let slack = course.means(&all.iter().map(|(torque, _)| torque.slack).collect::<Vec<_>>());
        let kept = course.means(&all.iter().map(|(_, stops)| f64::from(u8::from(!stops))).collect::<Vec<_>>());
        let push = self.pushes(case, seen, course, error);
        let fixed: Vec<f64> =
            stated.iter().zip(&push).zip(&kept).map(|((stated, push), kept)| stated + push * kept).collect();
        let scale = if self.fitted(case.scale) {
            let middle = acted.iter().map(|(least, most)| 0.5 * (least + most));
            let all = middle.zip(&fixed).zip(&scaled).zip(&slack).filter(|(_, slack)| **slack == 0.0);
            let (product, square) = all
                .fold((0.0, 0.0), |sum, (((acted, fixed), own), _)| (sum.0 + (acted - fixed) * own, sum.1 + own * own));
            if square > 0.0 { (product / square).max(0.0) } else { 0.0 }
        } else {
            let known = self.scales.iter().find(|(law, _)| case.scale == Scale::Uses(*law));
            known.map_or(0.0, |(_, scale)| *scale)
        };
        let meant: Vec<f64> = fixed.iter().zip(&scaled).map(|(fixed, own)| fixed + scale * own).collect();
        let squared =
            |values: &mut dyn Iterator<Item = f64>| (values.map(|x| x * x).sum::<f64>() / acted.len() as f64).sqrt();
        let off =
            squared(&mut meant.iter().zip(acted).zip(&slack).map(|((meant, (least, most)), slack)| {
                meant - meant.max(least - scale * slack).min(most + scale * slack)
            }));
        let own = squared(&mut scaled.iter().map(|own| scale * own));
        Fit { meant, off, scale, own }
    }
}

/// The actions on an effect, with their times.
fn done(seen: &Seen, at: usize) -> Vec<(f64, Action)> {
    seen.done.iter().filter(|(of, ..)| *of == at).map(|(_, when, action)| (*when, *action)).collect()
}
