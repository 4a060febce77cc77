//! The transfer of state from one world to the next, between two samples.

use crate::sense::{Memory, Sensor, Tracked, Velocity};
use crate::{Loop, Real, State};

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// The state with which this loop replaces `before`, whose state is `state`, from the next sample on. Body i continues from body
    /// `bodies(i)`, the bristle of coupling i from that of `bristles(i)`; `None`: from its initial state. The sensor's memory is kept where
    /// both have the same encoder.
    pub fn transfer(
        &self,
        before: &Self,
        state: &State<F, B, C, W>,
        bodies: impl Fn(usize) -> Option<usize>,
        bristles: impl Fn(usize) -> Option<usize>,
    ) -> State<F, B, C, W> {
        let mut next = self.start();
        let shorter = before.period - self.period;
        next.memory = self.sensor.transfer(&before.sensor, &state.memory, shorter);
        // x_k is one old period ago. A method that takes the new sample first makes the last step itself, from one new period ago.
        let goes_itself = self.new_sample_first && next.memory.last.is_some();
        // Where the bodies step every n-th sample, a step that has begun is interpolated by the number of samples since.
        let samples = |count: u32| before.period * F::from_f64(f64::from(count));
        let gone = samples(1 + before.skips - state.until_step.min(before.skips));
        let step = samples(1 + before.skips);
        let part = if goes_itself { gone - self.period } else { gone } / step;
        let is_moving = before.new_sample_first && state.memory.last.is_some();
        for (to, (position, velocity)) in next.now.position.iter_mut().zip(&mut next.now.velocity).enumerate() {
            let Some(from) = bodies(to) else { continue };
            let (Some(w), Some(v)) = (state.now.position.get(from), state.now.velocity.get(from)) else { continue };
            let (Some(dw), Some(dv)) = (state.change.position.get(from), state.change.velocity.get(from)) else {
                continue;
            };
            // x_{k+1} - x_k where the method has it already, else extrapolated at the velocity.
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
    /// The memory with which this sensor continues; `shorter` is how much shorter the period is, in s. Empty for another encoder.
    fn transfer<const W: usize>(&self, before: &Self, memory: &Memory<F, W>, shorter: F) -> Memory<F, W> {
        let Some(mut last) = memory.last.filter(|_| self.count == before.count) else { return Memory::EMPTY };
        // The puck's position one new period ago, extrapolated at its velocity.
        last.position += shorter * last.velocity;
        let filtered = match before.filter {
            Some(_) => memory.filtered + shorter * last.velocity,
            None => last.position,
        };
        let tracked = match before.velocity {
            Some(Velocity::Kalman(_) | Velocity::Levant(_)) => {
                Tracked { position: memory.tracked.position + shorter * last.velocity, ..memory.tracked }
            }
            None
            | Some(
                Velocity::Difference
                | Velocity::LowPass { .. }
                | Velocity::DifferenceOver { .. }
                | Velocity::Foaw { .. },
            ) => Tracked { position: last.position, acceleration: F::ZERO },
        };
        let foaw = |sensor: &Self| matches!(sensor.velocity, Some(Velocity::Foaw { .. }));
        let over = |sensor: &Self| matches!(sensor.velocity, Some(Velocity::DifferenceOver { .. }));
        let is_same = foaw(self) && foaw(before) || over(self) && over(before);
        if is_same && shorter == F::ZERO {
            return Memory { last: Some(last), filtered, tracked, ..*memory };
        }
        let mut next = Memory { last: Some(last), filtered, tracked, ..Memory::EMPTY };
        // The window begins anew: its counts are one period apart, of the period that has ended.
        if let Some(newest) = next.counts.first_mut() {
            *newest = match self.count {
                _ if over(self) => last.position,
                Some(size) => (last.position / size + F::HALF).floor(),
                None => F::ZERO,
            };
        }
        next
    }
}
