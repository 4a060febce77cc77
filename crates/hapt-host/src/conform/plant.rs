//! The wheel's dynamics, identified from its motion under a known torque.

use super::meaning::SLOW;
use super::motion::Course;

/// The wheel without effects, in parts of half its range and of its largest torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// The acceleration of the largest torque, 1/s².
    pub strength: f64,
    /// The torque of a velocity of 1/s, of the motion's direction, and of a position of 1.
    pub damping: f64,
    /// As above.
    pub friction: f64,
    /// As above.
    pub spring: f64,
    /// A constant torque.
    pub bias: f64,
    /// From a request to its torque, s.
    pub latency: f64,
    /// The root mean square of the residual.
    pub noise: f64,
}

/// The unknowns of the fit: strength, damping, friction, spring, bias, each times the strength but the first.
const UNKNOWNS: usize = 5;
/// The latencies that are tried, in steps of 2 ms.
const LATENCIES: u32 = 60;

impl Plant {
    /// The plant with the smallest residual, where `push` is the requested torque at a time.
    pub fn fit(course: &Course, push: impl Fn(f64) -> f64) -> Option<Self> {
        let all = |of: fn(&super::meaning::WheelMotion) -> f64| {
            course.means(&course.motion.iter().map(of).collect::<Vec<_>>())
        };
        let acceleration = course.means(&course.raw);
        let known = [
            all(|motion| -motion.velocity),
            all(|motion| -(motion.velocity / SLOW).clamp(-1.0, 1.0)),
            all(|motion| -motion.position),
            vec![1.0; acceleration.len()],
        ];
        let fits = (0..LATENCIES).filter_map(|step| {
            let latency = 2e-3 * f64::from(step);
            let pushed: Vec<f64> = (0..course.motion.len()).map(|at| push(course.time(at) - latency)).collect();
            let pushed = course.means(&pushed);
            let rows = || {
                (0..acceleration.len())
                    .map(|i| ([pushed[i], known[0][i], known[1][i], known[2][i], known[3][i]], acceleration[i]))
            };
            let x = least_squares(rows())?;
            let off: f64 = rows().map(|(row, y)| (y - dot(&row, &x)).powi(2)).sum();
            let noise = (off / acceleration.len().max(1) as f64).sqrt() / x[0].abs();
            let [strength, damping, friction, spring, bias] = x;
            let of = |x: f64| x / strength.abs();
            Some(Plant {
                strength,
                damping: of(damping),
                friction: of(friction).max(0.0),
                spring: of(spring),
                bias: of(bias),
                latency,
                noise,
            })
        });
        fits.filter(|plant| plant.noise.is_finite()).min_by(|a, b| a.noise.total_cmp(&b.noise))
    }

    /// Lower and upper bounds of the means of the torque on the wheel other than that of its own damping, friction and spring. At rest a torque
    /// below friction is not determined.
    pub fn acted(&self, course: &Course) -> Vec<(f64, f64)> {
        let strength = self.strength.abs();
        let of = |dry: fn(f64) -> f64| -> Vec<f64> {
            let at = course.motion.iter().zip(&course.raw).map(|(motion, acceleration)| {
                acceleration / strength + self.damping * motion.velocity + self.spring * motion.position - self.bias
                    + self.friction * dry(motion.velocity)
            });
            course.means(&at.collect::<Vec<_>>())
        };
        let (least, most) = (
            of(|velocity| if velocity > SLOW { 1.0 } else { -1.0 }),
            of(|velocity| if velocity < -SLOW { -1.0 } else { 1.0 }),
        );
        least.into_iter().zip(most).collect()
    }
}

fn dot(a: &[f64; UNKNOWNS], b: &[f64; UNKNOWNS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The solution of the normal equations, by elimination with the largest pivot; `None` where they are singular.
fn least_squares(rows: impl Iterator<Item = ([f64; UNKNOWNS], f64)>) -> Option<[f64; UNKNOWNS]> {
    let mut matrix = [[0.0; UNKNOWNS + 1]; UNKNOWNS];
    for (row, y) in rows {
        for i in 0..UNKNOWNS {
            for j in 0..UNKNOWNS {
                matrix[i][j] += row[i] * row[j];
            }
            matrix[i][UNKNOWNS] += row[i] * y;
        }
    }
    for i in 0..UNKNOWNS {
        let pivot = (i..UNKNOWNS).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs()))?;
        matrix.swap(i, pivot);
        let row = matrix[i];
        if row[i].abs() < 1e-12 {
            return None;
        }
        for (j, other) in matrix.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let factor = other[i] / row[i];
            debug_assert_ne!(i, j);
            other.iter_mut().zip(row).for_each(|(x, own)| *x -= factor * own);
        }
    }
    Some(std::array::from_fn(|i| matrix[i][UNKNOWNS] / matrix[i][i]))
}
