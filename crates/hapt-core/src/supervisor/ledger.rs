//! The two energy ledgers: at the port, and inside of the world.
//!
//! **Port** (Hannaford and Ryu, IEEE T-RA 18(1), 2002). Over one sample the hand puts in -τ dz against the torque that was held, and the
//! device's own damping dissipates at least b dz²/T of it, which pays for the hold:
//!
//! ```text
//! account += -τ_held dz + b dz²/T + the constants' work on bodies
//! ```
//!
//! τ_held is the torque that the world computed one hold and the delay before the motor took it, without the constants on the puck. What
//! levels, limit, fades and swaps subtract from that torque, or add to it, is credited at the same instant and at the same rate, so that it
//! cancels: the ledger is about the world. For a passive world the account never falls below minus the energy that the world has stored. It
//! starts at the stored energy plus `most`, and never exceeds that later, so that a hand that has put in energy for an hour has no credit
//! for a fault. Below 0 the hand has received `most` beyond the stored energy.
//!
//! A delay of d samples charges for a displacement later than the damping has paid for it: of a spring K, with -τ_held dz = K z_{k-d-1}
//! dz_k,
//!
//! ```text
//! K z_{k-d-1} dz_k ≥ Δ(K z²/2) - K (d + 1) dz_k²/2 - K (dz_{k-1}² + ... + dz_{k-d}²)/2
//! ```
//!
//! and each dz² is charged d times more after its own sample. A passive spring has K (2d + 1)/2 ≤ b/T, so that the part of the account
//! that is still to be charged is at most `under_way` = b/(T (2d + 1)) Σ (d - j) dz_{k-j}². This amount is allowed beyond the bound. It is
//! summed with the weights d (d/(d+1))^j ≥ d - j, which need no memory.
//!
//! A filter y_k = p y_{k-1} + (1 - p) z_k of the position holds a torque back as well. With u = z - y, of the same spring
//!
//! ```text
//! K y_{k-1} dz_k + K (1 + p)/(2(1 - p)) dz_k² ≥ Δ(K z²/2) + Δ(K u²/(2p)),   u_k² ≤ p²/(1 - p) (dz_k² + p dz_{k-1}² + p² dz_{k-2}² + ...)
//! ```
//!
//! and a delay after it charges dy², where dy² ≤ dz² - (1 - p)/p Δ(u²). With s = d + p/(1 - p) a passive spring has K (s + 1/2) ≤ b/T, and
//! the part that is still to be charged is at most K/2 (d (1 + p) + p/(1 - p)) Σ (s/(s+1))^j dz_{k-j}², for d ≤ 13 and any p.
//!
//! **World.** A held puck exchanges no energy, and the port does not show an integrator that generates energy. So the energy that steps
//! generate is summed too, never below 0: `made`. Exact zoh, trapezoidal and backward Euler keep it at 0, linear or nonlinear;
//! semi-implicit Euler keeps its own energy and is measured by that; forward Euler generates (ωT)² of the oscillating energy per sample.

use crate::supervisor::Limits;
use crate::supervisor::sums::Step;
use crate::{Constants, Real, Spec};

/// Torques that a delay may hold back; the port's ledger rests with longer delays.
pub(crate) const HELD: usize = 16;

/// The constants of both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ledger<F> {
    pub most: F,
    /// b/T
    pub damping: F,
    /// Whole samples of the delay, and the part of one beyond them.
    delay: usize,
    part: F,
    /// Whether the delay is a whole number of samples, and few enough.
    whole: bool,
    /// The amount that a unit of dz² adds to `under_way`, and the part of it that is left a sample later; both 0 without a delay and a
    /// filter.
    under_way: [F; 2],
}

/// The state of both.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Books<F> {
    pub account: F,
    pub made: F,
    /// The part of the account that a delay or a filter will still charge.
    under_way: F,
    /// The torques of the last samples, the newest at `newest`.
    held: [F; HELD],
    newest: usize,
    /// The last measured position; `None` where the ledgers begin anew.
    position: Option<F>,
}

impl<F: Real> Books<F> {
    pub const CLOSED: Self =
        Books { account: F::ZERO, made: F::ZERO, under_way: F::ZERO, held: [F::ZERO; HELD], newest: 0, position: None };

    /// From the next sample on another world.
    pub fn reopen(&mut self) {
        self.position = None;
    }

    /// The world's origin slips by `slip`, which adds to the next position: no work is done.
    pub fn slip(&mut self, slip: F) {
        self.position = self.position.map(|position| position + slip);
    }

    /// The couplings' torque on the puck in the last sample.
    pub fn torque(&self) -> F {
        self.held(0)
    }

    fn held(&self, age: usize) -> F {
        self.held.get((self.newest % HELD + HELD - age % HELD) % HELD).copied().unwrap_or(F::ZERO)
    }

    fn push(&mut self, torque: F) {
        self.newest = (self.newest % HELD + 1) % HELD;
        if let Some(place) = self.held.get_mut(self.newest) {
            *place = torque;
        }
    }
}

impl<F: Real> Ledger<F> {
    /// Of limits, for the loop of `spec`.
    pub fn new(limits: &Limits, spec: &Spec) -> Self {
        let (period, delay) = (spec.period, limits.delay / spec.period);
        let whole = libm::floor(delay + 1e-6);
        let part = F::from_f64(if delay > whole { delay - whole } else { 0.0 });
        let samples = libm::ceil(if delay > 1e-6 { delay - 1e-6 } else { 0.0 });
        // p = `kept`. Numerators and denominators are multiplied by 1 - p, so that they stay finite for any slow filter.
        let gain = spec.filter.map_or(1.0, |filter| -libm::expm1(-core::f64::consts::TAU * filter * period));
        let kept = 1.0 - gain;
        let damping = limits.damping / period;
        let held = gain * samples + kept;
        let share = 0.5 * damping * (held + gain * kept * samples) / (gain * (delay + 0.5) + kept);
        Ledger {
            most: F::from_f64(limits.energy),
            damping: F::from_f64(damping),
            delay: whole as usize,
            part,
            whole: (whole as usize) < HELD - 2 && part <= F::ZERO,
            under_way: [share, held / (held + gain)].map(F::from_f64),
        }
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        to.number("energy", "the most energy beyond what is stored, J", self.most.to_f64());
        to.number("ledger_damping", "the device's damping over T", self.damping.to_f64());
        to.whole("ledger_delay", "whole samples of the delay", self.delay as i64);
        to.number("ledger_part", "the part of a sample beyond them", self.part.to_f64());
        to.whole("ledger_whole", "whether there is none", i64::from(self.whole));
        let [share, left] = self.under_way;
        to.number("ledger_share", "what is charged later, by displacement squared", share.to_f64());
        to.number("ledger_left", "what is left of it a sample later", left.to_f64());
    }

    /// Whether it keeps the account at the port: not with a delay of more samples than it remembers.
    pub fn keeps_account(&self) -> bool {
        self.delay < HELD - 2
    }

    /// One sample, after `missed` missed ones: the world's torque without constants, the puck's measured position.
    #[inline(always)]
    pub fn enter(&self, books: &mut Books<F>, step: &Step<F>, position: F, torque: F, missed: u32) {
        let account = match books.position {
            Some(last) if self.whole && missed == 0 => {
                let dz = position - last;
                let held = books.held(self.delay);
                books.account + (self.damping * (dz * dz) - held * dz + step.given)
            }
            last => self.otherwise(books, last, step, (position, torque), missed),
        };
        let mut most = step.stored + self.most;
        if self.under_way[0] > F::ZERO {
            let dz = position - books.position.unwrap_or(position);
            let [share, left] = self.under_way;
            books.under_way = left * books.under_way + share * (dz * dz);
            most += books.under_way;
        }
        books.account = if account > most { most } else { account };
        let made = books.made + step.made;
        books.made = if made < F::ZERO { F::ZERO } else { made };
        books.push(torque);
        books.position = Some(position);
    }

    /// The account where the ledgers begin, samples were missed, or the delay is not whole.
    #[cold]
    #[inline(never)]
    fn otherwise(
        &self,
        books: &mut Books<F>,
        last: Option<F>,
        step: &Step<F>,
        (position, torque): (F, F),
        missed: u32,
    ) -> F {
        let most = step.stored + self.most;
        let Some(last) = last else {
            (books.made, books.under_way) = (F::ZERO, F::ZERO);
            // An earlier torque that the motor still holds is booked as the world's, as fades are: the stored energy belongs to this
            // torque.
            books.held = [torque; HELD];
            return most;
        };
        if self.delay >= HELD - 2 {
            return most;
        }
        let dz = position - last;
        let mut paid = self.damping * (dz * dz);
        if missed > 0 {
            // The motor held its torque while no sample came.
            for _ in 0..missed.min(HELD as u32 - 1) {
                books.push(books.held(0));
            }
            paid = paid / F::from_f64(f64::from(missed) + 1.0);
        }
        let mut held = books.held(self.delay);
        if self.part > F::ZERO {
            held += self.part * (books.held(self.delay + 1) - held);
        }
        books.account + (paid - held * dz + step.given)
    }
}
