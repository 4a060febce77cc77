//! Pieces of a motion between events: linear in position, velocity and the motor's gap to its command.

/// Terms of a series after the constant one, and the longest piece in the fastest time constants: 1/17! is the last digit.
const ORDER: usize = 16;
const REACH: f64 = 1.0;
/// A term of a series below this size is dropped.
const SMALLEST: f64 = 1e-18;
/// Pieces whose lengths differ by this part count as equal: their times differ by rounding.
const EVEN: f64 = 1e-10;
/// The number of maps that are kept.
const MAPS: usize = 8;
/// A root is located in at most this many steps.
const STEPS: usize = 160;

/// Position, velocity and the gap: the motor's torque minus the command that is held.
pub(super) type State = [f64; 3];

/// The coefficients of their series, up to an order.
pub(super) struct Series {
    of: [State; ORDER + 1],
    order: usize,
}

/// velocity · v + position · z + constant
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub position: f64,
    pub velocity: f64,
    pub constant: f64,
}

/// The coefficients of the linear motion of a piece.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Rates {
    /// The constant drive.
    pub drive: f64,
    /// The coefficient of the velocity.
    pub loss: f64,
    /// The coefficient of the position.
    pub spring: f64,
    /// The decay rate of the gap, in 1/s.
    pub decay: f64,
}

/// The motion over a piece of one length: the state at its end, and in its middle, is linear in the state before it and in the drive.
#[derive(Clone, Copy)]
struct Map {
    rates: Rates,
    length: f64,
    middle: Linear,
    last: Linear,
}

/// Maps of pieces that recur, and the last one that did not.
pub(super) struct Maps {
    maps: Vec<Map>,
    missed: Option<(Rates, f64)>,
}

/// The state per unit of position, velocity, gap, and drive.
type Linear = [State; 4];

impl Rates {
    /// The series of a motion from a state.
    pub fn series(&self, state: State, gain: f64, length: f64) -> Series {
        let Rates { drive, loss, spring, decay } = *self;
        let fastest = self.fastest();
        // Up to the term that is below the last digit.
        let (mut order, mut term) = (2, 0.5 * (fastest * length).powi(2));
        while order < ORDER && term > SMALLEST {
            order += 1;
            term *= fastest * length / order as f64;
        }
        let mut of = [[0.0; 3]; ORDER + 1];
        of[0] = state;
        for n in 0..order {
            let [z, v, gap] = of[n];
            let more = if n == 0 { drive } else { 0.0 };
            let over = ((n + 1) as f64).recip();
            of[n + 1] = [v * over, (more - loss * v - spring * z + gain * gap) * over, -decay * gap * over];
        }
        Series { of, order }
    }

    /// The same of a motor without a gap.
    pub fn slow(&self) -> Rates {
        Rates { decay: 0.0, ..*self }
    }

    /// Whether the series are accurate over a length.
    pub fn reaches(&self, length: f64) -> bool {
        self.fastest() * length <= REACH
    }

    /// The part of a piece over which the series are accurate.
    pub fn reached(&self, length: f64) -> f64 {
        length.min(REACH / self.fastest())
    }

    fn fastest(&self) -> f64 {
        self.loss.abs().max(self.spring.abs().sqrt()).max(self.decay)
    }

    /// Whether both differ only in the drive.
    fn is_alike(&self, other: &Rates) -> bool {
        self.loss == other.loss && self.spring == other.spring && self.decay == other.decay
    }
}

impl Map {
    /// From series over a half, or over a part of it that they reach, which is doubled up to it.
    fn new(rates: Rates, gain: f64, length: f64) -> Map {
        // At most so many that no rate of a device needs more.
        let doubled = (0.5 * length * rates.fastest() / REACH).log2().ceil().clamp(0.0, 64.0) as i32;
        let part = 0.5 * length * 0.5f64.powi(doubled);
        let unit = |i: usize| {
            let of = Rates { drive: if i == 3 { 1.0 } else { 0.0 }, ..rates };
            of.series(std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }), gain, part).at(part)
        };
        let mut middle = [unit(0), unit(1), unit(2), unit(3)];
        for _ in 0..doubled {
            middle = twice(&middle);
        }
        Map { rates, length, middle, last: twice(&middle) }
    }
}

/// A linear motion after itself, under the same drive.
fn twice(by: &Linear) -> Linear {
    std::array::from_fn(|i| moved(by, &by[i], if i == 3 { 1.0 } else { 0.0 }))
}

impl Maps {
    pub fn new() -> Maps {
        Maps { maps: Vec::with_capacity(MAPS), missed: None }
    }

    /// The state in the middle of a piece and at its end, where a map of such a piece exists.
    pub fn places(&mut self, rates: &Rates, gain: f64, length: f64, state: &State) -> Option<[State; 2]> {
        let is_it = |old: &Rates, before: f64| (before - length).abs() <= EVEN * length && old.is_alike(rates);
        let mut place = self.maps.iter().position(|map| is_it(&map.rates, map.length));
        if place.is_none() {
            let came = self.missed.is_some_and(|(old, before)| is_it(&old, before));
            self.missed = Some((*rates, length));
            // Without a map, a piece that no series reaches would have to be cut.
            if !came && rates.reaches(length) {
                return None;
            }
            if self.maps.len() == MAPS {
                self.maps.pop();
            }
            place = Some(self.maps.len());
            self.maps.push(Map::new(*rates, gain, length));
        }
        let place = place?;
        // Maps in use are kept: those of the two parts of a period in which a torque arrives, at the first places.
        let near = if place > 1 { place - 1 } else { place };
        if near != place {
            self.maps.swap(place, near);
        }
        let map = self.maps.get(near)?;
        Some([moved(&map.middle, state, rates.drive), moved(&map.last, state, rates.drive)])
    }
}

/// The state after a linear motion.
fn moved(by: &Linear, [z, v, gap]: &State, drive: f64) -> State {
    let at = |i: usize| by[0][i] * z + by[1][i] * v + by[2][i] * gap + by[3][i] * drive;
    [at(0), at(1), at(2)]
}

impl Series {
    pub fn at(&self, t: f64) -> State {
        let mut sum = [0.0; 3];
        for [z, v, gap] in self.of[..=self.order].iter().rev() {
            sum = [z + t * sum[0], v + t * sum[1], gap + t * sum[2]];
        }
        sum
    }

    /// The first time within `end` at which a line is above 0, where it is above 0 at the end.
    pub fn crossing(&self, line: &Line, end: f64) -> f64 {
        let value = |t: f64| line.value(&self.at(t));
        let (mut low, mut high) = (0.0, end);
        let (mut at_low, mut at_high) = (value(low), value(high));
        // From a zero the line may fall at first.
        let mut before = end;
        while at_low >= 0.0 {
            before *= 0.5;
            if before <= 1e-3 * end {
                return 0.0;
            }
            if value(before) < 0.0 {
                (low, at_low) = (before, value(before));
            }
        }
        for step in 0..STEPS {
            // Regula falsi, every third step a bisection.
            let part = if step % 3 == 2 { 0.5 } else { at_low / (at_low - at_high) };
            let secant = low + part * (high - low);
            let t = if secant > low && secant < high { secant } else { 0.5 * (low + high) };
            if t <= low || t >= high {
                break;
            }
            let there = value(t);
            if there > 0.0 {
                (high, at_high) = (t, there);
            } else {
                (low, at_low) = (t, there);
            }
        }
        high
    }
}

impl Line {
    pub fn value(&self, [z, v, _]: &State) -> f64 {
        self.position * z + self.velocity * v + self.constant
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two conditions are met at one instant where a stop begins at the place of a rest: the second is searched within no time.
    #[test]
    fn a_condition_is_met_at_once_within_no_time() {
        let rates = Rates { drive: 1.0, loss: 0.0, spring: 0.0, decay: 1.0 };
        let line = Line { position: 0.0, velocity: 1.0, constant: 0.0 };
        for velocity in [0.0, 1.0] {
            let series = rates.series([0.0, velocity, 0.0], 1.0, 1e-3);
            assert_eq!(series.crossing(&line, 0.0).to_bits(), 0);
        }
    }
}
