//! Sines and cosines of the multiples of angles, each from those of the one before: a sine of its own for each takes most of the time.

use nalgebra::Vector2;

fn unit(angle: f64) -> Vector2<f64> {
    let (sine, cosine) = angle.sin_cos();
    Vector2::new(sine, cosine)
}

/// Of the sum of two angles.
fn sum(a: &Vector2<f64>, b: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(a.x * b.y + a.y * b.x, a.y * b.y - a.x * b.x)
}

/// Sine and cosine of the multiples of an angle, from 0 times on.
pub(crate) fn multiples(angle: f64, most: u32) -> Vec<Vector2<f64>> {
    let once = unit(angle);
    std::iter::successors(Some(Vector2::new(0.0, 1.0)), |of| Some(sum(of, &once))).take(most as usize + 1).collect()
}

/// Sines and cosines of a growing multiple of each of many angles.
pub(crate) struct Multiples {
    once: Vec<Vector2<f64>>,
    now: Vec<Vector2<f64>>,
    times: u32,
}

impl Multiples {
    pub fn new(angles: &[f64]) -> Self {
        let once: Vec<Vector2<f64>> = angles.iter().map(|angle| unit(*angle)).collect();
        Multiples { now: once.clone(), once, times: 1 }
    }

    /// Those of this many times the angles: no fewer than before.
    pub fn of(&mut self, times: u32) -> &[Vector2<f64>] {
        while self.times < times {
            self.now.iter_mut().zip(&self.once).for_each(|(now, once)| *now = sum(now, once));
            self.times += 1;
        }
        &self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn multiples_are_those_of_the_functions(angle in -1e3..1e3f64, times in 1..60u32) {
            let own = unit(f64::from(times) * angle);
            // The product of the angle rounds too.
            let room = 1e-15 * f64::from(times) * angle.abs() + 1e-14;
            prop_assert!((multiples(angle, times)[times as usize] - own).norm() < room);
            prop_assert!((Multiples::new(&[angle]).of(times)[0] - own).norm() < room);
        }
    }
}
