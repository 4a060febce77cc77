//! A check in the few lines that a person reads first.

use std::f64::consts::{LN_2, TAU};
use std::fmt::Write as _;

use hapt_model::keys::Measure;

use crate::certificate::check::{Check, Status};
use crate::stability::{Stability, Verdict};
use crate::text::{short, time, with_unit};
use crate::theorems::PatternVerdict;

impl Check {
    /// The answer: whether it is certified, whether it is safe hands-off and safe in a hand, and which properties of the device no theorem
    /// covers.
    ///
    /// Safe: it does not grow, and no passive hand draws energy from it.
    pub fn headline(&self) -> String {
        let status = match self.status {
            Status::Certified => "Certified",
            Status::Open => "Not certified, for want of a theorem",
            Status::Refuted => "Not certified",
        };
        let mut parts = Vec::new();
        if self.held.verdict == Verdict::Unstable {
            parts.push(format!("it grows while the {} is held still", self.moved()));
        }
        parts.push(self.hands_off().to_string() + &self.falls());
        parts.push(self.in_a_hand());
        let omits = self.omits();
        if !omits.is_empty() {
            parts.push(format!("not proved: {}", omits.join(", ")));
        }
        format!("{status}: {}", parts.join("; "))
    }

    /// Whether a theorem makes the claim: `held`, `free` or `passive`.
    pub fn claims(&self, claim: &str) -> bool {
        self.theorems.iter().any(|theorem| theorem.claims.contains(&claim))
    }

    /// Hands-off, at even samples and under all that the file allows.
    fn hands_off(&self) -> &'static str {
        let is_certified = self.certified.holds();
        let under_all = self.uneven.free.verdict();
        if self.uneven.is_stated && !is_certified && under_all != PatternVerdict::Proved {
            let grows = under_all == PatternVerdict::Broken || self.grows_free;
            return if grows { "not safe to let go" } else { "not proved safe to let go" };
        }
        // Whether only friction keeps it from growing, at even or at uneven samples.
        let by_friction = is_certified && self.uneven.is_stated && under_all != PatternVerdict::Proved;
        match (self.free.verdict, self.claims("free")) {
            (_, true) if by_friction => "safe to let go, as long as its speed is kept",
            (Verdict::Unstable, true) if self.kept_speed().is_none() => "safe to let go, on the device's friction",
            (Verdict::Unstable, true) => "safe to let go, as long as its speed is kept",
            (Verdict::Unstable, false) if self.grows_free => "not safe to let go",
            (Verdict::Marginal, true) => "safe to let go, though it may never come to rest",
            (Verdict::Stable, true) => "safe to let go",
            (_, false) => "not proved safe to let go",
        }
    }

    /// How gravity or cogging moves a released puck.
    fn falls(&self) -> String {
        let passive = self.passivity.is_certified() && self.uneven.is_certified();
        let Some(fall) = self.fall else { return String::new() };
        let speed = match fall.speed.filter(|_| passive) {
            Some(speed) => format!(" from rest at up to {}", with_unit(speed, Measure::Velocity, self.motion)),
            None => String::new(),
        };
        format!(", and {} may move the {}{speed}", fall.by, self.moved())
    }

    /// The last clause on a free loop that comes to rest: where gravity or cogging pushes the puck away.
    pub(super) fn pushed(&self) -> String {
        match self.fall.filter(|_| self.free.verdict != Verdict::Unstable) {
            Some(fall) => format!(
                "; but {} pushes it from where no spring holds it: doubles in {} there",
                fall.by,
                time(LN_2 / fall.growth_per_s)
            ),
            None => String::new(),
        }
    }

    /// The name of the part that a hand holds.
    fn moved(&self) -> &'static str {
        if self.has_handle { "handle" } else { "puck" }
    }

    fn in_a_hand(&self) -> String {
        let (even, uneven) = (&self.passivity, &self.uneven);
        let is_passive = even.is_certified() && uneven.is_certified();
        let kept = match self.kept_speed() {
            Some(speed) if is_passive => format!(" up to {speed}"),
            _ => String::new(),
        };
        match (is_passive, even.is_refuted || uneven.is_refuted) {
            (true, _) => format!("safe in any passive hand{kept}"),
            (false, true) => "not safe in every passive hand".into(),
            (false, false) => "not proved safe in every passive hand".into(),
        }
    }

    /// The properties of the device that no theorem covers, in a few words each.
    fn omits(&self) -> Vec<&'static str> {
        let mut omits = self.passivity.omits.clone();
        omits.extend(self.uneven.omits.iter().filter(|what| !self.passivity.omits.contains(what)));
        omits
    }

    /// The headline's reasons: a line each for held, free and passive, with one number; counts where they are too coarse.
    pub(super) fn summary(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(text, "held      {}", self.pace_held());
        let _ = writeln!(text, "free      {}", self.pace_free());
        let _ = writeln!(text, "passive   {}", self.share());
        if let Some(uneven) = self.uneven_sentence() {
            let _ = writeln!(text, "uneven    {uneven}");
        }
        if let Some(counts) = self.quantisation_sentence().filter(|_| !self.quantisation.ok) {
            let _ = writeln!(text, "counts    {counts}");
        }
        text
    }

    fn pace_held(&self) -> String {
        let held = &self.held;
        if held.growth_per_s.is_none() {
            return "stable: nothing moves once the puck is held".into();
        }
        pace(held, "")
    }

    fn pace_free(&self) -> String {
        let free = &self.free;
        if free.growth_per_s.is_none() {
            return "stable: the loop keeps its state, and no torque acts on the puck".into();
        }
        // The first eigenvalue is the largest.
        let step = f64::from(self.bodies_every) * self.period_s;
        let hz = free.eigenvalues.first().map_or(0.0, |v| v.im.atan2(v.re).abs() / (TAU * step));
        let swing = if hz > 0.0 { format!(", swinging at {} Hz", short(hz)) } else { String::new() };
        let friction = match self.passivity.speed_max.filter(|_| free.verdict == Verdict::Unstable) {
            Some(speed) => format!(
                "; the device's friction brings it to rest below {}",
                with_unit(speed, Measure::Velocity, self.motion)
            ),
            None if free.verdict == Verdict::Unstable && !self.grows_free => format!("; {}", self.grows_nowhere()),
            None => String::new(),
        };
        pace(free, &swing) + &friction + &self.pushed()
    }

    /// The required damping as a share of the device's.
    fn share(&self) -> String {
        let found = &self.passivity;
        let Some(required) = found.required_damping else { return self.passivity_sentence() };
        let holds = found.is_certified();
        if !holds && (required <= found.device_damping || !found.is_covered && !found.is_refuted) {
            return self.passivity_sentence();
        }
        let unit = Measure::Damping.dimension(self.motion).symbol();
        let share = required / found.device_damping;
        let speed = match found.speed_max {
            Some(speed) if found.by_friction => format!(
                "; friction pays for it below {}, which safety.overspeed keeps",
                with_unit(speed, Measure::Velocity, self.motion)
            ),
            Some(speed) => format!(
                "; friction pays for it below {}, which safety.overspeed can keep",
                with_unit(speed, Measure::Velocity, self.motion)
            ),
            None => String::new(),
        };
        match (holds && !found.by_friction, found.device_damping > 0.0) {
            (true, _) if required == 0.0 => "passive whatever the device's damping".into(),
            (true, _) => format!("passive with {} % of the device's damping", short(100.0 * share)),
            (false, true) => format!(
                "{} {} times the device's damping: {} {unit}, and it has {}{speed}",
                self.needs(),
                short(share),
                short(required),
                short(found.device_damping)
            ),
            (false, false) => {
                format!("{} a damping of {} {unit}, and the device has none{speed}", self.needs(), short(required))
            }
        }
    }

    /// The damping is needed, or known to be enough.
    fn needs(&self) -> &'static str {
        let found = &self.passivity;
        if found.by_friction {
            "passive by friction: without it, it needs"
        } else if found.is_refuted {
            "not passive: it needs"
        } else {
            "not known to be passive: it is with"
        }
    }
}

/// How fast it grows or comes to rest, and up to which period.
fn pace(of: &Stability, swing: &str) -> String {
    let growth = of.growth_per_s.unwrap_or(0.0);
    let room = match (of.critical_period_s, of.verdict) {
        (Some(limit), Verdict::Unstable) => format!(" (stable up to a period of {})", time(limit)),
        (Some(limit), _) => format!(" (up to a period of {})", time(limit)),
        (None, _) => String::new(),
    };
    match of.verdict {
        Verdict::Unstable => format!("unstable: doubles in {}{swing}{room}", time(LN_2 / growth)),
        Verdict::Marginal => format!("marginal: neither grows nor comes to rest{room}"),
        Verdict::Stable => format!("stable: halves in {}{room}", time(LN_2 / -growth)),
    }
}
