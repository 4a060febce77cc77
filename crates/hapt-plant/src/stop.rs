//! An end stop of the device: a spring and a damper that push the puck back, and never pull.
//!
//! With p the depth of the puck in the stop, the stop pushes with max(0, k p + c ṗ) while p > 0. It stores k p²/2. A puck that leaves faster than the
//! damper lets the spring follow loses contact with the face, and the stored energy is dissipated in the damper.

use core::f64::consts::{PI, TAU};

use crate::spec::Stops;
use crate::trajectory::Piece;

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Stop {
    /// 1: it limits motion toward larger positions; -1: toward smaller ones.
    side: f64,
    at: f64,
    stiffness: f64,
    damping: f64,
}

/// velocity · v + position · x + constant
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub velocity: f64,
    pub position: f64,
    pub constant: f64,
}

/// The contact between the puck and a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Touch {
    /// The puck is not in the stop.
    Beyond,
    /// The stop pushes.
    Pressed,
    /// The puck is in the stop, and leaves it faster than the stop follows.
    Left,
}

impl Line {
    pub fn value(&self, v: f64, x: f64) -> f64 {
        self.velocity * v + self.position * x + self.constant
    }

    fn negative(&self) -> Line {
        Line { velocity: -self.velocity, position: -self.position, constant: -self.constant }
    }
}

impl Stop {
    /// The stops toward larger and toward smaller positions, for a puck whose 0 is `origin` in the device's coordinate.
    pub fn both(stops: &Stops, origin: f64) -> [Option<Self>; 2] {
        let &Stops { low, high, stiffness, damping } = stops;
        let of = |side: f64, at: Option<f64>| at.map(|at| Stop { side, at: at - origin, stiffness, damping });
        [of(1.0, high), of(-1.0, low)]
    }

    pub fn at(&self) -> f64 {
        self.at
    }

    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// The puck's depth in it, 0 outside.
    fn depth(&self, x: f64) -> f64 {
        (self.side * (x - self.at)).max(0.0)
    }

    /// The energy that it stores, in J.
    pub fn stored(&self, x: f64) -> f64 {
        let depth = self.depth(x);
        0.5 * self.stiffness * depth * depth
    }

    /// Its torque on a puck that rests at x.
    pub fn torque_at(&self, x: f64) -> f64 {
        -self.side * self.stiffness * self.depth(x)
    }

    /// The sizes of the torques whose sum that is, 0 outside.
    pub fn rounded(&self, x: f64) -> f64 {
        if self.depth(x) > 0.0 { self.stiffness * (x.abs() + self.at.abs()) } else { 0.0 }
    }

    /// The depth in the stop, and the unclamped push.
    fn lines(&self) -> [Line; 2] {
        let Stop { side, at, stiffness, damping } = *self;
        let depth = Line { velocity: 0.0, position: side, constant: -side * at };
        let push = Line { velocity: side * damping, position: side * stiffness, constant: -(side * stiffness * at) };
        [depth, push]
    }

    /// The contact of a puck at x and v, and the lines whose zeros end it.
    pub fn touch(&self, x: f64, v: f64) -> (Touch, [Option<Line>; 2]) {
        let [depth, push] = self.lines();
        match (depth.value(v, x) > 0.0, push.value(v, x) > 0.0) {
            (false, _) => (Touch::Beyond, [Some(depth), None]),
            (true, true) => (Touch::Pressed, [Some(push.negative()), None]),
            (true, false) => (Touch::Left, [Some(push), Some(depth.negative())]),
        }
    }

    /// The energy dissipated in it during a motion that a hand prescribes, in J.
    pub fn lost(&self, motion: &Piece, from: f64, to: f64) -> f64 {
        let Some((amplitude, omega, phase)) = motion.sine() else {
            // A straight motion does not turn around: it enters or leaves, at instants that do not depend on where the search stands.
            let (x, v) = motion.at(from);
            let cuts = self.lines().map(|line| from - line.value(v, x) / (line.position * v));
            let next = |after: f64| cuts.into_iter().filter(|cut| *cut > after).fold(f64::INFINITY, f64::min);
            return self.lost_between(motion, from, to, next);
        };
        // Every whole turn loses the same energy.
        let turn = TAU / omega;
        let turns = libm::floor((to - from) / turn);
        let cut = |after: f64| {
            let [depth, push] = self.lines();
            let of = |line: Line| {
                // velocity · Aω cos θ + position · A sin θ = -constant
                let (sine, cosine) = (line.position * amplitude, line.velocity * amplitude * omega);
                let (size, angle) = (libm::hypot(sine, cosine), libm::atan2(cosine, sine));
                let part = -line.constant / size;
                (part.abs() <= 1.0).then(|| {
                    let first = libm::asin(part);
                    [first, PI - first].map(|theta| (theta - angle - phase) / omega)
                })
            };
            let next = |at: f64| {
                let at = at + turn * libm::ceil((after - at) / turn);
                if at > after { at } else { at + turn }
            };
            [depth, push].into_iter().filter_map(of).flatten().map(next).fold(f64::INFINITY, f64::min)
        };
        let whole = if turns > 0.0 { turns * self.lost_between(motion, from, from + turn, cut) } else { 0.0 };
        whole + self.lost_between(motion, from + turns * turn, to, cut)
    }

    /// Sums from one instant of contact or release to the next; `cut` gives the next such instant after a time.
    fn lost_between(&self, motion: &Piece, from: f64, to: f64, cut: impl Fn(f64) -> f64) -> f64 {
        let (mut lost, mut start) = (0.0, from);
        // A turn has eight such instants.
        for _ in 0..32 {
            let end = cut(start).min(to);
            let (x, v) = motion.at(0.5 * (start + end));
            lost += match self.touch(x, v).0 {
                Touch::Beyond => 0.0,
                Touch::Pressed => self.damping * motion.travel(start, end).0,
                Touch::Left => self.stored(motion.at(start).0) - self.stored(motion.at(end).0),
            };
            start = end;
            if start >= to {
                break;
            }
        }
        lost
    }
}
