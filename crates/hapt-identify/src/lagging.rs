//! The puck over a stretch in which the motor's torque approaches its command, in closed form.
//!
//! A unit of acceleration that decays with the rate κ adds to velocity and position, with x = |κ - β| t and μ the smaller of both,
//!
//! ```text
//! E(t) = ∫ e^-β(t - s) e^-κs ds = e^-μt t φ1(x),    F(t) = ∫ E = (t φ1(βt) - E)/κ,    G(t) = ∫ s e^-β(t - s) e^-κs ds
//! dE/dκ = -G,  dE/dβ = G - t E,  dF/dκ = (G - F)/κ,  dF/dβ = (t² φ1'(βt) + t E - G)/κ
//! ```

use crate::stretch::Stretch;

/// Steps to a stop; a bisection to the last bit takes no more.
const MOST_STEPS: usize = 64;

/// The rates of speed and torque, in 1/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lagging {
    pub beta: f64,
    pub rate: f64,
}

/// The change that a decaying acceleration of 1 adds over a stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Added {
    pub travel: f64,
    pub speed: f64,
    pub travel_of_beta: f64,
    pub speed_of_beta: f64,
    pub travel_of_rate: f64,
    pub speed_of_rate: f64,
}

impl Lagging {
    /// Over `length` s, of which `stretch` is the same without the decaying part.
    pub fn over(self, length: f64, stretch: &Stretch) -> Added {
        let Lagging { beta, rate } = self;
        let (plain, _) = stretch.of_velocity();
        let (slope, _) = stretch.of_beta(1.0, 0.0, beta);
        let speed = self.speed(length);
        let travel = (plain - speed) / rate;
        // ∫ of the time since the start under the slower of both exponentials.
        let x = (rate - beta).abs() * length;
        let weight = (-beta.min(rate) * length).exp() * length * length * first_moment(x);
        let moment = if rate >= beta { weight } else { length * speed - weight };
        Added {
            travel,
            speed,
            travel_of_beta: (slope + length * speed - moment) / rate,
            speed_of_beta: moment - length * speed,
            travel_of_rate: (moment - travel) / rate,
            speed_of_rate: -moment,
        }
    }

    /// E(t).
    fn speed(self, t: f64) -> f64 {
        let x = (self.rate - self.beta).abs() * t;
        (-self.beta.min(self.rate) * t).exp() * t * if x < 1e-9 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
    }

    /// When a speed of `v` >= 0 is 0 under the accelerations `a`, which stays, and `gap`, which decays; within `rest` s.
    pub fn first_rest(self, v: f64, a: f64, gap: f64, rest: f64) -> Option<f64> {
        let v = v.max(0.0);
        let at = |t: f64| Stretch::new(self.beta, t).travel(v, a).1 + gap * self.speed(t);
        // The speed turns where its rate e^-βt (rate at 0) - κ gap E(t) is 0, at most once.
        let start = a + gap - self.beta * v;
        let along = start / (self.rate * gap);
        let x = (self.rate - self.beta) * along;
        let turn = match x.abs() < 1e-9 {
            true => along * (1.0 + 0.5 * x),
            false => -(-x).ln_1p() / (self.rate - self.beta),
        };
        // A puck that starts from rest first moves in its direction, whatever the rounding error of its rate.
        let is_inside = turn > 0.0 && turn < rest && (v > 0.0 || start > 0.0);
        let mut from = 0.0;
        for to in [is_inside.then_some(turn), Some(rest)].into_iter().flatten() {
            if at(to) < 0.0 {
                return Some(self.zero(at, a, gap, [from, to]));
            }
            from = to;
        }
        None
    }

    /// The zero of a speed that falls from 0 or more to below 0: Newton's steps, and bisection where they leave the interval.
    fn zero(self, at: impl Fn(f64) -> f64, a: f64, gap: f64, [mut low, mut high]: [f64; 2]) -> f64 {
        let mut t = 0.5 * (low + high);
        for _ in 0..MOST_STEPS {
            let v = at(t);
            if v < 0.0 {
                high = t;
            } else {
                low = t;
            }
            let slope = a - self.beta * v + gap * (-self.rate * t).exp();
            let step = t - v / slope;
            let next = if step > low && step < high { step } else { 0.5 * (low + high) };
            if (next - t).abs() <= 4.0 * f64::EPSILON * t {
                return next;
            }
            t = next;
        }
        t
    }
}

/// ∫ w e^-xw dw from 0 to 1.
fn first_moment(x: f64) -> f64 {
    if x < 0.5 {
        // Σ (-x)^k/(k! (k + 2)), from the last that counts.
        let (mut sum, mut k) = (0.0, 14.0);
        while k >= 0.0 {
            sum = 1.0 / (k + 2.0) - x / (k + 1.0) * sum;
            k -= 1.0;
        }
        return sum;
    }
    let decay = (-x).exp();
    ((1.0 - decay) / x - decay) / x
}
