//! The numbers of a compiled world by name, for those who write the loop down in another language.

use crate::matrix::Vector;
use crate::nonlinear::{LoopLaw, Nonlinear};
use crate::sense::Velocity;
use crate::step::{Loop, Moment};
use crate::{End, Real};

/// Receives the numbers of a compiled world, each with its name in these sources and a word about it. An f32 is given exactly.
pub trait Constants {
    /// A whole number: a count, a place, or 1 for yes and 0 for no.
    fn whole(&mut self, name: &'static str, about: &'static str, value: i64);
    /// A number of the loop's.
    fn number(&mut self, name: &'static str, about: &'static str, value: f64);
    /// Numbers in rows: `shape` is their count in each dimension, the last one varies fastest, and `at` is the number at a place.
    fn array(&mut self, name: &'static str, about: &'static str, shape: &[usize], at: &dyn Fn(usize) -> f64);
    /// Begins one more element of a list: what follows is its own, until [`Constants::end`]. Elements of a kind have the same names.
    fn element(&mut self, list: &'static str, kind: &'static str);
    /// Ends an element.
    fn end(&mut self);
}

/// An end as a number: the index of a body, [`PUCK`], or [`GROUND`].
pub(crate) fn end_code(end: End) -> i64 {
    match end {
        End::Body(i) => i as i64,
        End::Puck => PUCK,
        End::Ground => GROUND,
    }
}

/// The puck as an end among [`Constants`].
pub const PUCK: i64 = -1;
/// The fixed frame as an end among [`Constants`].
pub const GROUND: i64 = -2;

/// Vectors of n bodies, each as positions and then velocities.
fn vectors<'v, F: Real, const B: usize>(
    to: &mut dyn Constants,
    name: &'static str,
    about: &'static str,
    shape: &[usize],
    n: usize,
    of: &dyn Fn(usize) -> Option<&'v Vector<F, B>>,
) {
    to.array(name, about, shape, &|place| {
        let n = n.max(1);
        let Some(vector) = of(place / (2 * n)) else { return 0.0 };
        let half = if (place / n) % 2 == 0 { &vector.position } else { &vector.velocity };
        half.get(place % n).map_or(0.0, |x| x.to_f64())
    });
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// All numbers that a sample takes.
    pub fn constants(&self, to: &mut dyn Constants) {
        let n = self.bodies;
        to.whole("bodies", "bodies", n as i64);
        to.number("period", "T in s", self.period.to_f64());
        to.number("rate", "1 over the bodies' step, in 1/s", self.rate.to_f64());
        to.whole("skips", "samples after each step of the bodies in which they stand still", i64::from(self.skips));
        to.whole("staged", "whether a step has Runge-Kutta's four stages", i64::from(self.staged));
        let advance = if let Moment::Ahead(advance) = self.moment { advance } else { 0 };
        to.whole("advance", "further steps for the torque", i64::from(advance));
        vectors(to, "start", "positions and velocities at the start", &[2, n], n, &|_| Some(&self.start));
        let about = "[body][its position, its velocity][change of positions, of velocities][of body]";
        vectors(to, "state", about, &[n, 2, 2, n], n, &|i| {
            let response = self.state.get(i / 2)?;
            Some(if i % 2 == 0 { &response.position } else { &response.velocity })
        });
        let about =
            "what the puck's position and velocity do: [position, velocity][change of positions, of velocities]";
        for (name, input) in [("input_new", &self.input_new), ("input_old", &self.input_old)] {
            vectors(to, name, about, &[2, 2, n], n, &|i| Some(if i == 0 { &input.position } else { &input.velocity }));
        }
        vectors(to, "drift", "the change that constant torques make", &[2, n], n, &|_| Some(&self.drift));
        if let Some(force) = &self.force {
            let about = "[body][change of positions, of velocities] by a unit of torque on it, held over a step";
            vectors(to, "force", about, &[n, 2, n], n, &|i| force.get(i));
        }
        if let Some(gradient) = &self.gradient {
            to.array("inertia", "of the bodies", &[n], &|i| gradient.inertia.get(i).map_or(0.0, |x| x.to_f64()));
            to.whole("contacts", "nonlinear couplings at bodies", gradient.contacts as i64);
        }
        to.number("port_offset", "the constant torque on the puck", self.port.offset.to_f64());
        to.array("port_puck", "torque on the puck by its own position and velocity", &[2], &|i| {
            self.port.puck.get(i).map_or(0.0, |x| x.to_f64())
        });
        let about = "torque on the puck by the bodies' positions and velocities";
        vectors(to, "port_bodies", about, &[2, n], n, &|_| Some(&self.port.bodies));
        to.number("sample_rate", "1/T in 1/s", self.sensor.rate.to_f64());
        if let Some(filter) = self.sensor.filter {
            to.number("filter", "what the world sees of the position: y = y + filter (z - y)", filter.to_f64());
        }
        if let Some(count) = self.sensor.count {
            to.number("count", "one count of the encoder", count.to_f64());
        }
        match self.sensor.velocity {
            None | Some(Velocity::Difference) => {}
            Some(Velocity::LowPass { keep, gain }) => {
                to.number("keep", "the low-pass filter: v = keep v + gain (z - last z)", keep.to_f64());
                to.number("gain", "in 1/s", gain.to_f64());
            }
            Some(Velocity::Foaw { window, best }) => {
                to.whole("window", "FOAW's longest window in samples", window as i64);
                to.whole("best", "whether it takes the least-squares slope", i64::from(best));
            }
            Some(Velocity::DifferenceOver { every, rate }) => {
                to.whole("every", "samples over which the velocity is taken", every as i64);
                to.number("every_rate", "1 over their time, in 1/s", rate.to_f64());
            }
            Some(Velocity::Kalman(kalman)) => {
                to.number("half_square", "T²/2, of the Kalman filter's prediction", kalman.half.to_f64());
                to.number("of_position", "the part of its error that the position takes", kalman.position.to_f64());
                to.number("of_velocity", "that the velocity takes, in 1/s", kalman.velocity.to_f64());
                to.number("of_acceleration", "that the acceleration takes, in 1/s²", kalman.acceleration.to_f64());
            }
            Some(Velocity::Levant(levant)) => {
                to.number("change", "the largest change of Levant's velocity in a sample", levant.change.to_f64());
                to.number(
                    "reach",
                    "the largest error of its prediction that it follows at once",
                    levant.reach.to_f64(),
                );
                to.number("pull", "of its square root, times T", levant.pull.to_f64());
            }
        }
        to.number("passes", "up to here a torque is commanded as it is", self.actuator.passes.to_f64());
        to.number("beyond", "what is commanded beyond", self.actuator.beyond.to_f64());
        if let Some(limit) = self.actuator.limit {
            to.number("limit", "the largest command", limit.to_f64());
        }
        if let Some(step) = self.actuator.step {
            to.number("level", "one level of the command", step.to_f64());
        }
        for nonlinear in self.nonlinear.iter().take(self.nonlinear_count) {
            match nonlinear {
                Some(nonlinear) => nonlinear.constants(to),
                None => {
                    to.element("couplings", "linear");
                    to.end();
                }
            }
        }
    }
}

impl<F: Real> Nonlinear<F> {
    fn constants(&self, to: &mut dyn Constants) {
        to.element("couplings", self.curve.kind());
        to.whole("first", "the end that takes the torque", end_code(self.first));
        to.whole("second", "the end that takes the opposite", end_code(self.second));
        to.whole("found", "whether a step finds its torque", i64::from(self.is_found));
        self.curve.numbers(|name, value| to.number(name, "", value.to_f64()));
        if let LoopLaw::Texture(texture) = &self.curve {
            for (name, factors) in [("sine", texture.sine), ("cosine", texture.cosine)] {
                to.array(name, "", &[factors.len()], &|i| factors.get(i).map_or(0.0, |x| x.to_f64()));
            }
        }
        to.end();
    }
}
