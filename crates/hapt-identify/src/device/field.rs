//! Torques of the position on a puck: a spring, gravity, cogging, and the changes of friction with the position.

/// Harmonics of a wave.
pub(super) const HARMONICS: usize = 4;

/// Σ (sineₙ sin nθ + cosineₙ cos nθ), θ = rate (z - phase).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wave {
    /// In rad per rad (m).
    pub rate: f64,
    /// In rad (m).
    pub phase: f64,
    /// Sine and cosine of each harmonic.
    parts: [[f64; 2]; HARMONICS],
    /// How many of them it has, up to the last one.
    count: usize,
}

/// All of them, torques per inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Waves {
    /// The stiffness of a spring to ground over J, and the place where it is relaxed.
    pub spring: f64,
    pub middle: f64,
    /// The factors of sin z and cos z.
    pub gravity: [f64; 2],
    pub cogging: Wave,
    /// The change of the friction of either direction, as a part of it.
    pub changes: Wave,
    /// Half of the difference between the frictions toward smaller positions and toward larger ones, over J: it changes with the position
    /// as friction does.
    pub lean: f64,
}

/// A torque of the position at a place, with its first two derivatives; the spring is not in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Field {
    pub value: f64,
    pub slope: f64,
    pub bend: f64,
}

impl Field {
    /// Adds p sin nθ + q cos nθ with the sine and the cosine of nθ, whose rate by the position is given.
    fn add(&mut self, [p, q]: [f64; 2], (sine, cosine): (f64, f64), rate: f64) {
        let value = p * sine + q * cosine;
        self.value += value;
        self.slope += rate * (p * cosine - q * sine);
        self.bend -= rate * rate * value;
    }
}

/// Sine and cosine of a multiple of an angle, in as many steps as the number has binary digits.
fn power(once: (f64, f64), mut times: u32) -> (f64, f64) {
    let sum = |a: (f64, f64), b: (f64, f64)| (a.0 * b.1 + a.1 * b.0, a.1 * b.1 - a.0 * b.0);
    let (mut of, mut doubled) = ((0.0, 1.0), once);
    while times > 0 {
        if times % 2 == 1 {
            of = sum(of, doubled);
        }
        doubled = sum(doubled, doubled);
        times /= 2;
    }
    of
}

impl Wave {
    pub fn new(rate: f64, phase: f64, parts: [[f64; 2]; HARMONICS]) -> Self {
        let last = parts.iter().rposition(|part| *part != [0.0; 2]);
        Wave { rate, phase, parts, count: last.map_or(0, |n| n + 1) }
    }

    fn is_none(&self) -> bool {
        self.count == 0
    }

    /// Sine and cosine of its first harmonic at a place, of which those of the position itself may be known.
    fn first(&self, z: f64, known: Option<(f64, f64)>) -> (f64, f64) {
        let times = self.rate as u32;
        match known {
            Some(once) if self.phase == 0.0 && f64::from(times) == self.rate => power(once, times),
            Some(_) | None => (self.rate * (z - self.phase)).sin_cos(),
        }
    }

    /// Adds the wave times a factor, with the sine and cosine of its first harmonic.
    fn add(&self, field: &mut Field, (sine, cosine): (f64, f64), factor: f64) {
        let mut of = (sine, cosine);
        for (n, part) in self.parts[..self.count].iter().enumerate() {
            field.add(part.map(|x| factor * x), of, self.rate * (n + 1) as f64);
            of = (of.0 * cosine + of.1 * sine, of.1 * cosine - of.0 * sine);
        }
    }

    fn at(&self, z: f64) -> f64 {
        let mut field = Field::default();
        self.add(&mut field, self.first(z, None), 1.0);
        field.value
    }
}

impl Waves {
    /// The largest number of radians of any wave per radian (m) of the position; `None`: there is none.
    pub fn steepest(&self) -> Option<f64> {
        let of = |wave: &Wave| wave.rate * wave.count as f64;
        let gravity = if self.gravity == [0.0; 2] { 0.0 } else { 1.0 };
        Some([&self.cogging, &self.changes].map(of).into_iter().fold(gravity, f64::max)).filter(|most| *most > 0.0)
    }

    /// All but the spring, where the friction over J acts on the puck by this.
    pub fn field(&self, z: f64, friction: f64) -> Field {
        let mut field = Field::default();
        let once = (self.gravity != [0.0; 2]).then(|| z.sin_cos());
        if let Some(once) = once {
            field.add(self.gravity, once, 1.0);
        }
        if !self.cogging.is_none() {
            self.cogging.add(&mut field, self.cogging.first(z, once), 1.0);
        }
        if !self.changes.is_none() {
            self.changes.add(&mut field, self.changes.first(z, once), self.lean + friction);
        }
        field
    }

    /// The torque over J on a puck that rests at a place, friction aside.
    pub fn at_rest(&self, z: f64) -> f64 {
        self.field(z, 0.0).value - self.spring * (z - self.middle)
    }

    /// The change of friction at a place, as a part of its mean.
    pub fn changes_at(&self, z: f64) -> f64 {
        if self.changes.is_none() { 0.0 } else { self.changes.at(z) }
    }

    /// The level of friction at a place, as a part of its mean.
    pub fn level(&self, z: f64) -> f64 {
        (1.0 + self.changes_at(z)).max(0.0)
    }
}
