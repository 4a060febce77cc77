//! One world going on where another was, between two samples.

use crate::sense::{Memory, Sensor, Velocity};
use crate::{Loop, Real, State};

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// The state before the next sample, which this loop takes in place of `before`, whose state is `state`. Body i goes on where body
    /// `bodies(i)` was, the bristle of coupling i where that of `bristles(i)` was; `None`: from its start. Where the encoder's counts are the
    /// same, so does what the sensor remembers.
    pub fn carry(
        &self,
        before: &Self,
        state: &State<F, B, C, W>,
        bodies: impl Fn(usize) -> Option<usize>,
        bristles: impl Fn(usize) -> Option<usize>,
    ) -> State<F, B, C, W> {
        let mut next = self.start();
        let shorter = before.period - self.period;
        next.memory = self.sensor.carry(&before.sensor, &state.memory, shorter);
        // x_k is one old period ago. Who takes the new sample first makes the last step itself, from one new period ago on.
        let goes_itself = self.new_sample_first && next.memory.last.is_some();
        let part = if goes_itself { shorter / before.period } else { F::ONE };
        let is_moving = before.new_sample_first && state.memory.last.is_some();
        for (to, (position, velocity)) in next.now.position.iter_mut().zip(&mut next.now.velocity).enumerate() {
            let Some(from) = bodies(to) else { continue };
            let (Some(w), Some(v)) = (state.now.position.get(from), state.now.velocity.get(from)) else { continue };
            let (Some(dw), Some(dv)) = (state.change.position.get(from), state.change.velocity.get(from)) else {
                continue;
            };
            // x_{k+1} - x_k, where the method knows it already; else at its velocity.
            let dw = if is_moving { before.period * *v } else { *dw };
            (*position, *velocity) = (*w + part * dw, *v + part * *dv);
        }
        for (to, bristle) in next.bristles.iter_mut().enumerate() {
            if let Some(s) = bristles(to).and_then(|from| state.bristles.get(from)) {
                *bristle = *s;
            }
        }
        next
    }
}

impl<F: Real> Sensor<F> {
    /// What it goes on with, periods shorter by so much, in s; nothing where its counts are others.
    fn carry<const W: usize>(&self, before: &Self, memory: &Memory<F, W>, shorter: F) -> Memory<F, W> {
        let Some(mut last) = memory.last.filter(|_| self.count == before.count) else { return Memory::EMPTY };
        // Where the puck, at its velocity, was one new period ago.
        last.position += shorter * last.velocity;
        let foaw = |sensor: &Self| match sensor.velocity {
            Some(Velocity::Foaw { .. }) => true,
            None | Some(Velocity::Difference | Velocity::LowPass { .. }) => false,
        };
        if foaw(self) && foaw(before) && shorter == F::ZERO {
            return Memory { last: Some(last), ..*memory };
        }
        let mut next = Memory { last: Some(last), ..Memory::EMPTY };
        // The window begins there: counts of another period are no counts of this one.
        if let (Some(size), Some(newest)) = (self.count, next.counts.first_mut()) {
            *newest = (last.position / size + F::HALF).floor();
        }
        next
    }
}
