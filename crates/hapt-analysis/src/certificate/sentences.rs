//! The verdicts of a check in sentences.

use std::f64::consts::TAU;

use hapt_model::keys::Measure;

use crate::certificate::check::{Check, ESTIMATE, Status};
use crate::passivity::Cause;
use crate::stability::{Mode, NOT_SEARCHED, Stability, Verdict};
use crate::text::{short, time, with_unit};
use crate::theorems::{Passivity, PatternVerdict};

/// Whether the loop preserves the amplitude of the mode, within the resolution of a verdict.
fn is_kept(mode: &Mode) -> bool {
    mode.discrete_damping_ratio.is_some_and(|ratio| ratio.abs() < 1e-12)
}

/// The method's name in a sentence.
fn spoken(method: &str) -> &str {
    match method {
        "forward-euler" => "forward Euler",
        "backward-euler" => "backward Euler",
        "semi-implicit-euler" => "semi-implicit Euler",
        "rk4" => "RK4",
        "trapezoidal" => "the trapezoidal rule",
        other => other,
    }
}

/// A growth rate in words.
fn pace(growth: f64) -> String {
    let ten = (10.0 * growth).exp();
    if ten < 1e3 {
        format!("a factor {ten:.2} in 10 s")
    } else {
        format!("doubling every {}", time(std::f64::consts::LN_2 / growth))
    }
}

impl Check {
    /// The whole verdict in one sentence.
    pub fn verdict_sentence(&self) -> String {
        let is_lacking = self.passivity.is_refuted;
        let reasons = [
            (self.held.verdict == Verdict::Unstable && !self.has_handle, "it is unstable with the puck held"),
            (self.held.verdict == Verdict::Unstable && self.has_handle, "it is unstable with the handle held"),
            (self.grows_free, "it is unstable hands-off"),
            (is_lacking, "the linear loop is not passive"),
            (!is_lacking && !self.passivity.is_certified(), "no theorem says that it is passive"),
            (
                self.passivity.is_certified() && !self.uneven.is_certified(),
                "no theorem says that it is passive for all times and tolerances that the file allows",
            ),
        ];
        let reasons: Vec<&str> = reasons.into_iter().filter(|(holds, _)| *holds).map(|(_, words)| words).collect();
        let is_proved = self.passivity.proved.holds() && self.uneven.proved.holds();
        let below = match self.kept_speed() {
            Some(speed) => format!(" below {speed}"),
            None => String::new(),
        };
        match self.status {
            Status::Certified if is_proved => {
                format!("certified: stable held and hands-off, and passive against every passive hand{below}")
            }
            Status::Certified => format!(
                "certified: stable held and hands-off, and passive{below}; what is not proved of the device stands below"
            ),
            Status::Open => format!("open, not certified: nothing was found against it, but {}", reasons.join("; ")),
            Status::Refuted => format!("not certified: {}", reasons.join("; ")),
        }
    }

    /// The speed below which friction makes it passive, where that is what certifies it.
    pub(super) fn kept_speed(&self) -> Option<String> {
        let speeds =
            [(self.passivity.by_friction, self.passivity.speed_max), (self.uneven.by_friction, self.uneven.speed_max)];
        let speeds = speeds.into_iter().filter_map(|(by_friction, speed)| speed.filter(|_| by_friction));
        speeds.reduce(f64::min).map(|speed| with_unit(speed, Measure::Velocity, self.motion))
    }

    /// The verdict on the held world in one sentence, with its reason.
    pub fn sentence(&self) -> String {
        if self.has_handle {
            return self.loop_sentence(&self.held, "with the handle held");
        }
        let held = &self.held;
        let method = spoken(self.method);
        let Some(growth) = held.growth_per_s else {
            return "stable: nothing moves once the puck is held".to_string();
        };
        match held.verdict {
            Verdict::Unstable => {
                let pace = pace(growth);
                let reason = match (held.critical_period_reason, held.critical_period_s) {
                    (Some("never"), _) if held.modes.iter().any(|m| m.damping_ratio == 0.0) => {
                        format!("{method} is never stable on an undamped mode")
                    }
                    (Some("never"), _) => {
                        format!("at every period {method} takes more damping from a mode than its dampers give")
                    }
                    (_, Some(limit)) if limit < self.period_s => {
                        format!(
                            "{method} is stable here up to a period of {}, and this one is {}",
                            time(limit),
                            time(self.period_s)
                        )
                    }
                    _ => format!("{method} at this period takes it out of the unit circle"),
                };
                format!("unstable: the held world grows by {} per second ({pace}); {reason}", short(growth))
            }
            Verdict::Marginal => {
                let reason = if held.eigenvalues.iter().any(|e| e.im == 0.0 && e.re == 1.0 && e.abs == 1.0) {
                    if self.notes.iter().any(|note| note.starts_with(ESTIMATE)) {
                        "where the nonlinear couplings are slack, something stays where it is shifted to"
                    } else {
                        "something is tied by no spring and stays where it is shifted to"
                    }
                } else if self.method == "forward-euler" {
                    "its dampers undo what forward Euler adds to a swing"
                } else if held.modes.iter().any(|mode| mode.damping_ratio > 0.0 && is_kept(mode)) {
                    "the damping takes just what the method adds to a swing"
                } else {
                    "a swing keeps its size, because nothing damps it"
                };
                let room = held.critical_period_s.map_or(String::new(), |t| format!(", up to a period of {}", time(t)));
                format!("marginal: the held world neither grows nor decays; {reason}{room}")
            }
            Verdict::Stable => {
                let room = match held.critical_period_s {
                    Some(limit) => format!("{method} stays so up to a period of {}", time(limit)),
                    None => format!("{method} stays so at every period"),
                };
                format!(
                    "stable: a disturbance of the held world decays by at least {} per second; {room}",
                    short(-growth)
                )
            }
        }
    }

    /// The verdict on the free loop in one sentence, with its reason.
    pub fn free_sentence(&self) -> String {
        let sentence = self.loop_sentence(&self.free, "hands-off") + &self.pushed();
        match self.passivity.speed_max.filter(|_| self.free.verdict == Verdict::Unstable) {
            Some(speed) => format!(
                "{sentence}; with the friction of the device it comes to rest as long as nothing pushes it faster than {}",
                with_unit(speed, Measure::Velocity, self.motion)
            ),
            None if self.free.verdict == Verdict::Unstable && !self.grows_free => {
                format!("{sentence}; {}", self.grows_nowhere())
            }
            None => sentence,
        }
    }

    /// Why eigenvalues that grow hands-off do not refute.
    pub(super) fn grows_nowhere(&self) -> &'static str {
        match self.passivity.is_within_friction {
            true => "the device's friction, which this leaves out, takes what makes it grow",
            false => "no position of the puck has these slopes together",
        }
    }

    /// The verdict on the whole loop in one sentence, with its reason; `held` says who holds it.
    fn loop_sentence(&self, of: &Stability, held: &str) -> String {
        let Some(growth) = of.growth_per_s else {
            return format!("stable: {held}, the loop keeps its state, and no torque acts on the puck");
        };
        let limit = of.critical_period_s;
        match of.verdict {
            Verdict::Unstable => {
                // The first eigenvalue is the largest.
                let step = f64::from(self.bodies_every) * self.period_s;
                let swing = of.eigenvalues.first().map_or(0.0, |v| v.im.atan2(v.re).abs() / (TAU * step));
                let how =
                    if swing > 0.0 { format!("swinging at {} Hz", short(swing)) } else { "without a swing".into() };
                let reason = match (of.critical_period_reason, limit) {
                    (Some("never"), _) => "so it does at every shorter period that was examined".to_string(),
                    (Some(NOT_SEARCHED), _) => "its dampers take less than the hold of the torque feeds it".to_string(),
                    (_, Some(limit)) if limit < self.period_s => {
                        format!("it holds up to a period of {}, and this one is {}", time(limit), time(self.period_s))
                    }
                    _ => "the hold of the torque between samples feeds it more than its dampers take".to_string(),
                };
                format!(
                    "unstable: {held}, the loop grows by {} per second ({}), {how}; {reason}",
                    short(growth),
                    pace(growth)
                )
            }
            Verdict::Marginal => {
                let room = limit.map_or(String::new(), |t| format!(", up to a period of {}", time(t)));
                format!(
                    "marginal: {held}, the loop neither grows nor decays; something in it swings or drifts for ever{room}"
                )
            }
            Verdict::Stable => {
                let room = match limit {
                    Some(limit) => format!("it stays so up to a period of {}", time(limit)),
                    None if of.critical_period_reason == Some(NOT_SEARCHED) => {
                        "a limit of the period was not searched".to_string()
                    }
                    None => "no limit of the period was found".to_string(),
                };
                format!("stable: {held}, the loop comes to rest by at least {} per second; {room}", short(-growth))
            }
        }
    }

    /// The verdict on passivity in one sentence, with its reason; dampings in SI.
    pub fn passivity_sentence(&self) -> String {
        let Passivity { required_damping, device_damping, at_hz, passive, proved, cause, is_covered, .. } =
            &self.passivity;
        let linear = if proved.holds() { "" } else { " (the linear loop)" };
        let Some(required) = required_damping else {
            let reason = match *cause {
                Some(Cause::Grows { hz }) => {
                    format!("the hand feels a motion at {} Hz that grows by itself", short(hz))
                }
                Some(Cause::GrowsUnseen { hz }) => {
                    format!(
                        "the world has a motion at {} Hz that grows by itself, little as the hand feels of it",
                        short(hz)
                    )
                }
                Some(Cause::NegativeResidue { hz }) => {
                    format!("the mode at {} Hz is undamped, and its torque is out of phase with the hand", short(hz))
                }
                Some(Cause::FractionalDelay { hz }) => {
                    format!("the mode at {} Hz is undamped, and the delay is not a whole number of samples", short(hz))
                }
                Some(Cause::MotorLag { hz }) => {
                    format!("the mode at {} Hz is undamped, and the motor lags behind its command", short(hz))
                }
                Some(Cause::Outside { .. }) | None => {
                    return "not known to be passive at any device damping: no theorem covers it".to_string();
                }
                Some(Cause::Integral) => {
                    "an integral term gives energy to slow hands, whatever the damping is".to_string()
                }
                Some(Cause::Coulomb) => "Coulomb friction at the puck has no finite slope".to_string(),
            };
            return format!("not passive at any device damping{linear}: {reason}");
        };
        let place = match *at_hz {
            None => "the same at every frequency".to_string(),
            Some(0.0) => "most toward 0 Hz".to_string(),
            Some(hz) => format!("most at {} Hz", short(hz)),
        };
        let unit = Measure::Damping.dimension(self.motion).symbol();
        let (has, wanted) = (short(*device_damping), short(*required));
        let requires = format!("{wanted} {unit}, {place}, and the device has {has}");
        if passive.holds() && self.passivity.by_friction {
            let speed =
                self.passivity.speed_max.map_or(String::new(), |v| with_unit(v, Measure::Velocity, self.motion));
            return format!(
                "passive against every passive hand that moves the puck no faster than {speed}, and safety.overspeed keeps it below: \
                 without friction it requires a device damping of {requires}"
            );
        }
        if passive.holds() {
            return format!("passive against every passive hand{linear}: it requires a device damping of {requires}");
        }
        if !is_covered && (required <= device_damping || !self.passivity.is_refuted) {
            return format!(
                "not known to be passive: no theorem covers it, and the linear loop requires a device damping of {requires} at the worst of its \
                 slopes"
            );
        }
        let more = short(required - device_damping);
        let friction = match self.passivity.speed_max {
            Some(speed) => format!(
                "; friction of the device makes up for it below {}, which safety.overspeed can keep",
                with_unit(speed, Measure::Velocity, self.motion)
            ),
            None => String::new(),
        };
        if !self.passivity.is_refuted {
            return format!(
                "not known to be passive{linear}: a device damping of {wanted} {unit} is enough, and the device has {has}, {more} too \
                 little{friction}"
            );
        }
        format!("not passive{linear}: it requires a device damping of {requires}, {more} too little{friction}")
    }

    /// The verdict for all intervals, delays and devices that the file allows, in one sentence; `None` where it states none.
    pub fn uneven_sentence(&self) -> Option<String> {
        let found = &self.uneven;
        if !found.is_stated {
            return None;
        }
        let linear = if found.proved.holds() { "" } else { " (the linear loop)" };
        let [least, most] = found.delay_s;
        let delay = if least == most { time(least) } else { format!("{} to {}", time(least), time(most)) };
        let delay = if most > 0.0 { format!("delays of {delay}") } else { "no delay".to_string() };
        let all = if found.is_even {
            "with every device within its tolerances".to_string()
        } else if found.interval_s[0] == found.interval_s[1] {
            format!("at even samples under every pattern of {delay}")
        } else {
            format!("under every pattern of intervals up to {} and {delay}", time(found.interval_max_s))
        };
        let hands_off = self.patterns_sentence();
        let Some(required) = found.required_damping else {
            return Some(format!("not known to be passive {all}, at any damping; {hands_off}"));
        };
        let unit = Measure::Damping.dimension(self.motion).symbol();
        let (has, wanted) = (short(found.device_damping), short(required));
        if !found.passive.holds() && (required <= found.device_damping || !found.is_covered) {
            return Some(format!(
                "not known to be passive {all}: no theorem covers it, and the linear loop requires a device damping of {wanted} {unit}, and the \
                 device has {has} at least; {hands_off}"
            ));
        }
        let verdict = if found.passive.holds() { "passive" } else { "not known to be passive" };
        let friction = match found.speed_max.filter(|_| found.by_friction) {
            Some(speed) => {
                let speed = with_unit(speed, Measure::Velocity, self.motion);
                format!(", and its friction makes up for the rest below {speed}, which safety.overspeed keeps")
            }
            None => String::new(),
        };
        Some(format!(
            "{verdict} {all}{linear}: a device damping of {wanted} {unit} is enough, and the device has {has} at least{friction}; {hands_off}"
        ))
    }

    /// The verdict on the hands-off loop under every pattern.
    fn patterns_sentence(&self) -> String {
        let free = &self.uneven.free;
        let (under_none, one) = match self.uneven.is_even {
            true => ("with no such device", "such a device"),
            false => ("under no such pattern", "such a pattern"),
        };
        match (free.verdict(), free.pattern()) {
            (PatternVerdict::Broken, Some(found)) => format!(
                "hands-off it grows by {} per second ({}) under {}",
                short(found.growth_per_s),
                pace(found.growth_per_s),
                found.description()
            ),
            (PatternVerdict::Proved, _) => format!("hands-off it grows {under_none}"),
            (PatternVerdict::Open | PatternVerdict::Broken, _) => {
                let reason = free.reason().unwrap_or("no proof is known");
                format!("hands-off it is not known whether {one} makes it grow: {reason}")
            }
        }
    }

    /// The stiffness that the encoder's counts and the motor's levels allow, in one sentence; `None` where both are ideal.
    pub fn quantisation_sentence(&self) -> Option<String> {
        let found = &self.quantisation;
        let unit = |measure: Measure| measure.dimension(self.motion).symbol();
        let most = format!("{} {}", short(found.max_stiffness?), unit(Measure::Stiffness));
        let what = if self.has_counts { "the encoder's counts" } else { "the motor's levels" };
        Some(if found.lacks_friction() {
            let torque = unit(Measure::Torque);
            format!(
                "dampers and levels require a friction of {} {torque}, and the device has {} {torque}: it may buzz",
                short(found.least_friction),
                short(found.friction)
            )
        } else if found.ok {
            format!("friction and damping of the device absorb {what} up to {most} at the puck, and there is less")
        } else {
            format!(
                "friction and damping of the device absorb {what} only up to {most} at the puck, and there is more: it may buzz"
            )
        })
    }
}
