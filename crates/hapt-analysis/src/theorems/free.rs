//! The hands-off loop: proved not to grow under any pattern of intervals and delays, broken by one, or open.
//!
//! Three theorems prove it. A loop that is passive grows under no pattern: a hand that does nothing is a passive hand. A linear loop at even
//! samples is decided by its eigenvalues. Beyond these one quadratic form of the state has to shrink at every sample, for any interval,
//! delay and slopes of the nonlinear laws. Eigenvalues of several linear loops prove nothing about a change between them.

use hapt_model::{Coupling, Damping, Law, World};
use serde::Serialize;

use crate::equations::continuous::settled;
use crate::equations::laws::{self, is_nonlinear};
use crate::equations::positions::at_positions;
use crate::error::Error;
use crate::passivity::timing::Timing;
use crate::passivity::within::beyond_least_friction;
use crate::stability::MARGINAL;
use crate::stability::Verdict;
use crate::stability::free::free_growth;
use crate::stability::patterns::{Pattern, even, have_common_form, search};
use crate::text::time;
use crate::theorems::assumptions::nonlinear_estimator;
use crate::theorems::stable::winds_up;
use crate::theorems::{Claimed, FREE_FORM, FREE_LINEAR, FREE_PASSIVE, Theorem};

/// The verdict on the hands-off loop under every pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PatternVerdict {
    /// It grows under none.
    Proved,
    /// It grows under one.
    Broken,
    /// Neither is known.
    Open,
}

/// The hands-off loop under every pattern of intervals and delays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FreePatterns {
    verdict: PatternVerdict,
    /// The proof: `"passivity"`, `"eigenvalues"` or `"common form"`.
    by: Option<&'static str>,
    /// The pattern that breaks it.
    pattern: Option<Pattern>,
    /// Why it is open.
    reason: Option<String>,
    #[serde(skip)]
    claimed: Claimed,
}

/// Largest number of slopes that vary.
const VARYING: usize = 5;

impl FreePatterns {
    /// Proved by passivity, which a theorem claims.
    pub(super) fn by_passivity(passive: &Claimed) -> FreePatterns {
        let claimed = passive.and(&Claimed::by(&[&FREE_PASSIVE]));
        FreePatterns { claimed, ..FreePatterns::by("passivity", &FREE_PASSIVE) }
    }

    fn by(what: &'static str, theorem: &'static Theorem) -> FreePatterns {
        let claimed = Claimed::by(&[theorem]);
        FreePatterns { verdict: PatternVerdict::Proved, by: Some(what), pattern: None, reason: None, claimed }
    }

    fn open(reason: impl Into<String>) -> FreePatterns {
        let (pattern, claimed) = (None, Claimed::NO);
        FreePatterns { verdict: PatternVerdict::Open, by: None, pattern, reason: Some(reason.into()), claimed }
    }

    fn broken(pattern: Pattern) -> FreePatterns {
        let (pattern, claimed) = (Some(pattern), Claimed::NO);
        FreePatterns { verdict: PatternVerdict::Broken, by: None, pattern, reason: None, claimed }
    }

    /// The verdict.
    pub fn verdict(&self) -> PatternVerdict {
        self.verdict
    }

    /// The proof.
    pub fn proved_by(&self) -> Option<&'static str> {
        self.by
    }

    /// The pattern that breaks it.
    pub fn pattern(&self) -> Option<&Pattern> {
        self.pattern.as_ref()
    }

    /// Why it is open.
    pub fn reason(&self) -> Option<&str> {
        self.reason.as_deref()
    }

    /// The claim that it grows under none.
    pub fn claimed(&self) -> &Claimed {
        &self.claimed
    }

    /// Without a proof by passivity.
    ///
    /// # Errors
    /// As [`crate::free`].
    pub(super) fn of(world: &World) -> Result<FreePatterns, Error> {
        if let Some(rest) = beyond_least_friction(world) {
            let found = FreePatterns::of(&rest)?;
            let is_broken = found.verdict == PatternVerdict::Broken;
            return Ok(if is_broken {
                found
            } else {
                FreePatterns::open("torques that the device's friction takes are covered by a proof of passivity only")
            });
        }
        let (sampling, timing) = (&world.sampling, Timing::of(world));
        let tolerances = &world.device.tolerances;
        if [tolerances.inertia, tolerances.damping, tolerances.lag] != [0.0; 3] {
            return Ok(FreePatterns::open("tolerances of the device are covered by a proof of passivity only"));
        }
        if winds_up(world) {
            return Ok(FreePatterns::open(
                "the motor's limit cuts the torque of an integral term, or of one along the acceleration: no theorem covers large swings",
            ));
        }
        if !world.device.is_plain() {
            for near in at_positions(world).into_iter().filter(|_| timing.is_even()) {
                let growth = free_growth(&near)?;
                if Verdict::of(growth) == Verdict::Unstable {
                    return Ok(FreePatterns::broken(even(world, growth)));
                }
            }
            let device = &world.device;
            let what = match (device.torque.is_none(), device.stops.is_some(), device.changing_friction() > 0.0) {
                (false, ..) => "gravity and cogging of the device are",
                (true, true, _) => "end stops of the device are",
                (true, false, true) => "friction of the device that changes with the position is",
                (true, false, false) => "friction of the device that falls with the speed is",
            };
            return Ok(FreePatterns::open(format!("{what} covered by a proof of passivity only")));
        }
        if sampling.recentre.is_some() {
            return Ok(FreePatterns::open(
                "an origin that slips, by loop.recentre, is covered by a proof of passivity only",
            ));
        }
        if world.couplings.iter().any(is_nonlinear) {
            return of_laws(world, timing);
        }
        let growth = free_growth(world)?;
        let grows = Verdict::of(growth) == Verdict::Unstable;
        if timing.is_even() {
            return Ok(match (grows, nonlinear_estimator(world)) {
                (true, _) => FreePatterns::broken(even(world, growth)),
                (false, Some(why)) => FreePatterns::open(format!("{why}, and no proof covers that")),
                (false, None) => FreePatterns::by("eigenvalues", &FREE_LINEAR),
            });
        }
        let even = grows.then(|| even(world, growth));
        if sampling.delay_max_s() > sampling.period {
            let open = || FreePatterns::open("a delay longer than the period is not analysed under patterns");
            return Ok(even.map_or_else(open, FreePatterns::broken));
        }
        if sampling.bodies_every > 1 {
            return Ok(FreePatterns::open("patterns are searched in loops whose bodies step at every sample"));
        }
        let found = search(world, nonlinear_estimator(world).is_none())?;
        let worse = found.grows.into_iter().chain(even).max_by(|a, b| a.growth_per_s.total_cmp(&b.growth_per_s));
        if let Some(pattern) = worse.filter(|pattern| pattern.growth_per_s > MARGINAL) {
            return Ok(FreePatterns::broken(pattern));
        }
        Ok(match found.form_s {
            Some([least, _]) if least == timing.intervals()[0] => FreePatterns::by("common form", &FREE_FORM),
            Some([least, longest]) => FreePatterns::open(format!(
                "a common quadratic form shrinks under all intervals from {} to {}, and no proof covers shorter ones",
                time(least),
                time(longest)
            )),
            None if let Some(why) = nonlinear_estimator(world) => FreePatterns::open(format!(
                "{why}; no pattern that was tried makes the loop grow with its shortest window, or in small motions"
            )),
            None if Verdict::of(growth) == Verdict::Marginal => FreePatterns::open(
                "a motion of the loop neither grows nor decays at even samples; no pattern that was tried makes it grow",
            ),
            None => {
                FreePatterns::open("no pattern that was tried makes it grow, and no common quadratic form was found")
            }
        })
    }
}

/// Nonlinear laws: one form for all slopes that they may have.
fn of_laws(world: &World, timing: Timing) -> Result<FreePatterns, Error> {
    if Verdict::of(free_growth(world)?) == Verdict::Unstable {
        return Ok(FreePatterns::open(
            "the linear loop grows at some slopes of its nonlinear couplings, and no proof covers the others",
        ));
    }
    let open = |why: &str| Ok(FreePatterns::open(format!("nonlinear couplings without a proof of passivity: {why}")));
    if !timing.is_even() {
        return open("no proof covers them under uneven time");
    }
    if nonlinear_estimator(world).is_some() || world.sampling.bodies_every > 1 {
        return open("no proof covers them with FOAW or levant, or with bodies that step at every n-th sample");
    }
    let Some(worlds) = corners(world) else {
        return open(
            "a common quadratic form is looked for where walls, dead bands and couplings with a limit join puck and ground",
        );
    };
    Ok(match have_common_form(&worlds)? {
        true => FreePatterns::by("common form", &FREE_FORM),
        false => FreePatterns::open(
            "nonlinear couplings without a proof of passivity: no common quadratic form of their slopes was found",
        ),
    })
}

/// The size of a spring or damper that has no effect but to keep the states of the loop the same.
const NOTHING: f64 = 1e-250;

/// The linear worlds at all corners of the slopes; `None` where a law is not such that its torque differs from that at rest by a spring and a
/// damper, each between 0 and its steepest.
///
/// For a wall f = max(0, k u + b v) inside, u > 0, and the rest position u*: f - f* = α k (u - u*) + β b v, with α and β in [0, 1] of their own.
/// Outside, u ≤ 0, α = u*/(u* - u), or 0 where u* ≤ 0. Inside and pushing it is (1, 1) for u* ≥ 0, else (u/(u - u*), 1). Inside and held
/// at 0, k u + b v < 0, f - f* lies between 0 and a sum of two terms of its own sign. A limit makes all of it smaller by a factor.
fn corners(world: &World) -> Option<Vec<World>> {
    let all = settled(&world.couplings, world.sampling.period);
    let linear: Vec<Coupling> = all.iter().filter(|c| !is_nonlinear(c)).copied().collect();
    let mut slopes = Vec::new();
    for law in all.iter().filter(|c| is_nonlinear(c)) {
        if laws::at_body(law) || !laws::rises_only(&law.law) {
            return None;
        }
        let (stiffness, damping) = laws::steepest(&law.law);
        let parts = [
            (stiffness, Law::Spring { stiffness, rest: 0.0 }, Law::Spring { stiffness: NOTHING, rest: 0.0 }),
            (
                damping,
                Law::Damper { damping: Damping::Fixed(damping) },
                Law::Damper { damping: Damping::Fixed(NOTHING) },
            ),
        ];
        let between = |law_: Law| law_.between(law.first, law.second);
        let varying = parts.into_iter().filter(|(size, ..)| *size > 0.0);
        slopes.extend(varying.map(|(_, steep, flat)| [between(flat), between(steep)]));
    }
    if slopes.len() > VARYING {
        return None;
    }
    let world_at = |bits: u32| {
        let chosen = slopes.iter().enumerate().map(|(i, slope)| slope[(bits >> i & 1) as usize]);
        World { couplings: linear.iter().copied().chain(chosen).collect(), ..world.clone() }
    };
    Some((0..1u32 << slopes.len()).map(world_at).collect())
}
