//! Bodies and the springs between ends: the whole energy of most worlds.
//!
//! Springs between the same two ends are combined, so that each body has two at most in addition to those to other bodies, at places
//! that are known when the world is compiled: their energies are sums without branches.

use crate::supervisor::sums::Sums;
use crate::{Constants, End, Real, Spec, State};

/// The energy of all springs between the same two ends: k/2 · (x - rest)².
#[derive(Clone, Copy, Debug)]
pub(crate) struct Well<F> {
    /// k/2
    pub half: F,
    pub rest: F,
}

/// A body's motion, and its springs to the puck (x = z - w) and to ground (x = w).
#[derive(Clone, Copy, Debug)]
struct Member<F> {
    /// J/2
    inertia: F,
    puck: Well<F>,
    ground: Well<F>,
}

/// A spring between two bodies, by their places: x is the first less the second.
#[derive(Clone, Copy, Debug)]
struct Pair<F> {
    bodies: [usize; 2],
    well: Well<F>,
}

/// All of a world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Springs<F, const B: usize, const C: usize> {
    members: [Member<F>; B],
    /// Between puck and ground: x = z.
    own: Well<F>,
    /// The least energy of parallel springs with different rests.
    least: F,
    pairs: [Pair<F>; C],
    pair_count: usize,
}

impl<F: Real, const B: usize, const C: usize> Springs<F, B, C> {
    /// The bodies of a world, without springs.
    pub fn new(spec: &Spec) -> Self {
        let mut members = [Member { inertia: F::ZERO, puck: Well::NONE, ground: Well::NONE }; B];
        for (member, body) in members.iter_mut().zip(spec.bodies) {
            member.inertia = F::HALF * F::from_f64(body.inertia);
        }
        let pairs = [Pair { bodies: [0; 2], well: Well::NONE }; C];
        Springs { members, own: Well::NONE, least: F::ZERO, pairs, pair_count: 0 }
    }

    /// Adds a spring. Seen from its other end it stores the same, with the opposite rest.
    pub fn add(&mut self, first: End, second: End, well: Well<F>) {
        let mirrored = Well { rest: -well.rest, ..well };
        let (ends, well) = match (first, second) {
            (End::Ground, _) | (End::Body(_), End::Puck) => ((second, first), mirrored),
            ends => (ends, well),
        };
        let together = match ends {
            (End::Body(i), End::Body(j)) => {
                if let Some(room) = self.pairs.get_mut(self.pair_count) {
                    *room = Pair { bodies: [i, j], well };
                    self.pair_count += 1;
                }
                None
            }
            (End::Puck, End::Body(i)) => self.members.get_mut(i).map(|body| &mut body.puck),
            (End::Body(i), End::Ground) => self.members.get_mut(i).map(|body| &mut body.ground),
            (End::Puck, End::Ground) => Some(&mut self.own),
            // Two equal ends: refused when the loop was compiled.
            (End::Puck, End::Puck) | (End::Ground, _) | (End::Body(_), End::Puck) => None,
        };
        if let Some(together) = together {
            self.least += together.add(well);
        }
    }

    pub fn constants(&self, n: usize, to: &mut dyn Constants) {
        let column =
            |of: fn(&Member<F>) -> F| move |i: usize| self.members.get(i).map_or(0.0, |body| of(body).to_f64());
        to.array("half_inertia", "J/2 of each body", &[n], &column(|body| body.inertia));
        to.array("puck_half", "k/2 of its springs to the puck", &[n], &column(|body| body.puck.half));
        to.array("puck_rest", "and their rest", &[n], &column(|body| body.puck.rest));
        to.array("ground_half", "k/2 of its springs to ground", &[n], &column(|body| body.ground.half));
        to.array("ground_rest", "and their rest", &[n], &column(|body| body.ground.rest));
        to.number("own_half", "k/2 of the springs from the puck to ground", self.own.half.to_f64());
        to.number("own_rest", "and their rest", self.own.rest.to_f64());
        to.number("least", "what springs that disagree about their rest store at their best, J", self.least.to_f64());
        for pair in self.pairs.iter().take(self.pair_count) {
            to.element("pairs", "pair");
            to.whole("first", "body", pair.bodies[0] as i64);
            to.whole("second", "body", pair.bodies[1] as i64);
            to.number("half", "k/2 of the spring between them", pair.well.half.to_f64());
            to.number("rest", "", pair.well.rest.to_f64());
            to.end();
        }
    }

    /// Whether [`Springs::of_bodies`] has everything.
    pub fn are_at_bodies(&self) -> bool {
        self.own.half == F::ZERO && self.least == F::ZERO && self.pair_count == 0
    }

    /// Before and after the step that `state` has just taken: of the first n bodies, and of their springs to puck and ground.
    #[inline(always)]
    pub fn of_bodies<const W: usize>(&self, n: usize, state: &State<F, B, C, W>, puck: F) -> Sums<F> {
        let mut sums = Sums::NONE;
        let positions = state.now.position.iter().zip(&state.change.position);
        let velocities = state.now.velocity.iter().zip(&state.change.velocity);
        for ((member, (w, dw)), (v, dv)) in self.members.iter().zip(positions).zip(velocities).take(n) {
            let Member { inertia, puck: to_puck, ground: to_ground } = member;
            let end = *v + *dv;
            let (x, y) = (puck - *w - to_puck.rest, *w - to_ground.rest);
            sums.before += *inertia * (*v * *v) + to_puck.at(x) + to_ground.at(y);
            sums.after += *inertia * (end * end) + to_puck.at(x - *dw) + to_ground.at(y + *dw);
        }
        sums
    }

    /// Those of the other springs.
    pub fn of_others<const W: usize>(&self, sums: &mut Sums<F>, state: &State<F, B, C, W>, puck: F) {
        let own = self.least + self.own.at(puck - self.own.rest);
        sums.before += own;
        sums.after += own;
        let (from, change) = (&state.now.position, &state.change.position);
        for Pair { bodies, well } in self.pairs.iter().take(self.pair_count) {
            let [(w, dw), (other, moved)] = bodies.map(|i| match (from.get(i), change.get(i)) {
                (Some(w), Some(dw)) => (*w, *dw),
                _ => (F::ZERO, F::ZERO),
            });
            let x = w - other - well.rest;
            sums.before += well.at(x);
            sums.after += well.at(x + (dw - moved));
        }
    }
}

impl<F: Real> Well<F> {
    const NONE: Self = Well { half: F::ZERO, rest: F::ZERO };

    /// Its energy at a distance x.
    #[inline(always)]
    fn at(&self, x: F) -> F {
        self.half * (x * x)
    }

    /// Adds another well, and returns the energy of both at their common rest.
    fn add(&mut self, other: Self) -> F {
        let apart = self.rest - other.rest;
        let sum = self.half + other.half;
        let part = if self.half > F::ZERO { self.half / sum } else { F::ZERO };
        *self = Well { half: sum, rest: other.rest + part * apart };
        part * other.at(apart)
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;
    use crate::{Body, Loop};

    fn end() -> impl Strategy<Value = End> {
        prop_oneof![Just(End::Puck), Just(End::Ground), (0_usize..3).prop_map(End::Body)]
    }

    proptest! {
        /// Every spring's k/2 (q - rest)² and every body's J v²/2, one by one.
        #[test]
        fn springs_together_store_what_they_would_apart(
            springs in prop::collection::vec((end(), end(), 0.1..10.0_f64, -1.0..1.0_f64), 0..8),
            moved in prop::array::uniform3((-1.0..1.0_f64, -1.0..1.0_f64, -0.1..0.1_f64, -0.1..0.1_f64)),
            puck in -1.0..1.0_f64,
        ) {
            let bodies: [Body; 3] = core::array::from_fn(|i| Body {
                inertia: 0.5 + i as f64, position: moved[i].0, velocity: moved[i].1,
            });
            let spec = Spec { bodies: &bodies, ..Spec::new(1e-3) };
            let mut state = Loop::<f64, 4, 8, 17>::new(&spec).unwrap().start();
            for (i, body) in moved.iter().enumerate() {
                (state.change.position[i], state.change.velocity[i]) = (body.2, body.3);
            }
            let mut all = Springs::<f64, 4, 8>::new(&spec);
            let (mut before, mut after) = (0.0, 0.0);
            for (body, (_, v, _, dv)) in bodies.iter().zip(moved) {
                before += body.inertia * v * v / 2.0;
                after += body.inertia * (v + dv) * (v + dv) / 2.0;
            }
            for (first, second, stiffness, rest) in springs.into_iter().filter(|(first, second, ..)| first != second) {
                all.add(first, second, Well { half: stiffness / 2.0, rest });
                let at = |end, part: f64| match end {
                    End::Puck => puck,
                    End::Ground => 0.0,
                    End::Body(i) => moved[i].0 + part * moved[i].2,
                };
                let stored = |part| {
                    let x: f64 = at(first, part) - at(second, part) - rest;
                    stiffness * x * x / 2.0
                };
                before += stored(0.0);
                after += stored(1.0);
            }
            let mut sums = all.of_bodies(3, &state, puck);
            let of_bodies = (sums.before, sums.after);
            all.of_others(&mut sums, &state, puck);
            prop_assert!((sums.before - before).abs() < 1e-12 * (1.0 + before), "{} {before}", sums.before);
            prop_assert!((sums.after - after).abs() < 1e-12 * (1.0 + after), "{} {after}", sums.after);
            prop_assert!(!all.are_at_bodies() || of_bodies == (sums.before, sums.after));
        }
    }
}
