//! The check of a world.

use hapt_model::keys::Measure;
use hapt_model::{Compensated, Coupling, End, EstimatorKind, Law, Method, Motion, World};
use serde::Serialize;

use crate::certificate::remedies::Remedies;
use crate::equations::continuous::{piecewise, piecewise_at_bodies};
use crate::equations::laws::{self, Kind, is_nonlinear};
use crate::equations::slopes::COMBINED;
use crate::error::Error;
use crate::passivity::quantisation::{Quantisation, count_power, quantisation};
use crate::passivity::required::requirement;
use crate::passivity::two_rates::with_fixed_bodies;
use crate::passivity::within::taken;
use crate::stability::clamped::{held_world, held_world_at_this_period};
use crate::stability::fall::{Fall, fall};
use crate::stability::free::{free, free_at_this_period, shortest_period};
use crate::stability::{Stability, Verdict};
use crate::text::{short, time, with_unit};
use crate::theorems::assumptions::{laws_cost, takes_estimate};
use crate::theorems::stable::{free_claim, grows, held_claim};
use crate::theorems::{Claimed, Passivity, PatternVerdict, Theorem, Uneven, passivity, uneven};

/// The result of `check`. It serialises to the mapping that `hapt check --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// T in s.
    pub period_s: f64,
    /// The method's name in world files.
    pub method: &'static str,
    /// The output's name in world files.
    pub output: &'static str,
    /// Only the world, the puck held still; with a handle on a shaft the loop, the handle held still.
    pub held: Stability,
    /// World, estimator, delay, hold and device together, hands-off.
    pub free: Stability,
    /// The loop against any passive hand.
    pub passivity: Passivity,
    /// The same for all intervals, delays and devices that the file allows.
    pub uneven: Uneven,
    /// The stiffness that quantisation allows.
    pub quantisation: Quantisation,
    /// Remedies, or the margins of a certified world; `None` where they were not requested.
    pub remedies: Option<Remedies>,
    /// Held, free and passive, each by a theorem that covers the world with all that the file allows.
    pub certified: Claimed,
    /// `certified`; `refuted` where something was found against it; otherwise `open`: no theorem covers the world.
    pub status: Status,
    /// The theorems that make the claims.
    pub theorems: Vec<TheoremUse>,
    /// Conditions that apply to the numbers.
    pub notes: Vec<String>,
    /// Whether the hands-off loop grows at slopes that one position has, by more than torques that the device's friction takes.
    #[serde(skip)]
    pub grows_free: bool,
    /// How the puck leaves a place where gravity or cogging pushes it away.
    #[serde(skip)]
    pub(crate) fall: Option<Fall>,
    #[serde(skip)]
    pub(crate) motion: Motion,
    /// Samples per step of the bodies. The eigenvalues of `held` and `free` are over one such step.
    #[serde(skip)]
    pub bodies_every: u32,
    #[serde(skip)]
    pub(crate) has_counts: bool,
    #[serde(skip)]
    pub(crate) has_handle: bool,
}

/// The status of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Theorems claim that it is stable and passive.
    Certified,
    /// Nothing was found against it, and no theorem covers it.
    Open,
    /// It is unstable, or some passive hand can extract energy, by the linear loop at some slopes.
    Refuted,
}

/// A theorem, and what it claims of this world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TheoremUse {
    /// Its name in docs/theory.md.
    pub id: &'static str,
    /// `held`, `free`, `passive`.
    pub claims: Vec<&'static str>,
    /// Its assumptions, all of which hold for this world.
    pub assumes: &'static [&'static str],
}

/// Analyses a world: its loop's period and method, its bodies and couplings.
///
/// ```
/// use hapt_analysis::check;
/// use hapt_model::{Source, World};
///
/// // A spring of k at the puck is passive up to b >= kT/2 (Colgate and Schenkel): 2.4 N·m/rad for these numbers.
/// let file = r#"
/// loop.period = "1 ms"
/// device = { inertia = "6.4e-4 kg m^2", damping = "1.2e-3 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "2 N m/rad"
/// "#;
/// let source = Source::from_text("spring.toml", file);
/// let soft = check(&World::read(&source, &[])?)?;
/// assert!(soft.certified.holds() && (soft.passivity.required_damping.unwrap() - 1e-3).abs() < 1e-9);
/// let stiff = check(&World::read(&source, &["couplings.0.stiffness=3 N m/rad".to_string()])?)?;
/// assert!(!stiff.certified.holds());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error::Eigenvalues`] and [`Error::Step`] when its numbers go beyond double precision; [`Error::InFlight`] when its delay is
/// more periods than the analysis carries; [`Error::Value`] and [`Error::NoSuchBody`] for a world
/// that no reader has checked.
pub fn check(world: &World) -> Result<Check, Error> {
    with_stability(world, held_world(world)?, free(world)?)
}

/// As [`check`], without the critical period of the free loop. That search is most of the work and changes no verdict. For interactive
/// use, while a value is being changed.
///
/// # Errors
/// As [`check`].
pub fn quick_check(world: &World) -> Result<Check, Error> {
    with_stability(world, held_world_at_this_period(world)?, free_at_this_period(world)?)
}

fn with_stability(world: &World, held: Stability, free: Stability) -> Result<Check, Error> {
    let sampling = &world.sampling;
    let (passivity, uneven, fall) = (passivity(world)?, uneven(world)?, fall(world)?);
    let is_stable = |of: &Stability| of.verdict != Verdict::Unstable;
    let is_passive = passivity.is_certified() && uneven.is_certified();
    let by_friction = is_passive && (passivity.by_friction || uneven.by_friction);
    let passive = uneven.passive.and(&passivity.passive).when(is_passive);
    let held_claim = held_claim(world, &held, &passive);
    let is_within_friction = is_passive && passivity.is_within_friction && uneven.is_within_friction;
    let rests_on_friction = by_friction || is_within_friction;
    let free_claim = free_claim(world, &free, &passive, rests_on_friction);
    let certified = held_claim.and(&free_claim).and(&passive);
    let is_broken = uneven.free.verdict() == PatternVerdict::Broken && !rests_on_friction;
    let grows_free = grows(world, &free)?;
    let is_refuted = !is_stable(&held) || grows_free || passivity.is_refuted || uneven.is_refuted || is_broken;
    let status = match (certified.holds(), is_refuted) {
        (true, _) => Status::Certified,
        (false, true) => Status::Refuted,
        (false, false) => Status::Open,
    };
    Ok(Check {
        period_s: sampling.period,
        method: sampling.method.name(),
        output: sampling.output.name(),
        theorems: theorems([("held", &held_claim), ("free", &free_claim), ("passive", &passive)]),
        certified,
        status,
        held,
        free,
        passivity,
        uneven,
        quantisation: quantisation(world)?,
        remedies: None,
        notes: notes(world, fall)?,
        grows_free,
        fall,
        motion: world.motion,
        bodies_every: sampling.bodies_every,
        has_counts: world.device.encoder.is_some(),
        has_handle: world.device.handle.is_some(),
    })
}

/// The theorems of these claims, each once.
fn theorems(claims: [(&'static str, &Claimed); 3]) -> Vec<TheoremUse> {
    let mut all: Vec<TheoremUse> = Vec::new();
    for (claim, claimed) in claims {
        for theorem in claimed.theorems() {
            let Theorem { id, assumes, .. } = *theorem;
            match all.iter_mut().find(|used| used.id == *id) {
                Some(used) if !used.claims.contains(&claim) => used.claims.push(claim),
                Some(_) => {}
                None => all.push(TheoremUse { id, claims: vec![claim], assumes }),
            }
        }
    }
    all
}

/// The beginning of the note on the linear estimate.
pub(crate) const ESTIMATE: &str = "held is a linear estimate of a nonlinear world";

fn notes(world: &World, fall: Option<Fall>) -> Result<Vec<String>, Error> {
    let mut notes = Vec::new();
    let indices = piecewise_at_bodies(&world.couplings);
    let looked = |indices: usize, flat: &str| match indices {
        0 => flat.to_string(),
        n if n <= COMBINED => format!("the worst of {} combinations of flat and steep slopes counts", 1u32 << n),
        n => format!("the worst counts of all flat, all steep and each of {n} nonlinear couplings alone steep"),
    };
    if world.couplings.iter().any(|c| is_nonlinear(c) && laws::at_body(c)) {
        let looked = looked(indices.len(), "its nonlinear couplings at bodies have slope 0 and count as absent");
        notes.push(format!("{ESTIMATE}: {looked}"));
    }
    let method = world.sampling.method;
    if method != Method::ForwardEuler {
        for (index, _) in world.couplings.iter().enumerate().filter(|(_, c)| c.law.is_compensating()) {
            notes.push(format!(
                "couplings.{index}: a compensating damper undoes the growth of forward Euler; with {} it only damps",
                method.name()
            ));
        }
    }
    // Without a spring or a restoring nonlinear coupling a shift of the body is neutral.
    for (index, _) in world.bodies.iter().enumerate() {
        let holds = |mut law: Law| law.strength().is_some_and(|strength| *strength.value > 0.0);
        let body = End::Body(index);
        if !world.couplings.iter().any(|c| holds(c.law) && (c.first == body || c.second == body)) {
            let name = world.names.get(index).map_or("", String::as_str);
            notes.push(format!("body {name}: no spring is tied to it, so it stays where it is shifted to"));
        }
    }
    if world.couplings.iter().any(|c| is_nonlinear(c) && Kind::of(c) != Kind::Acceleration) {
        let indices = piecewise(&world.couplings);
        let looked = looked(indices.len(), "its nonlinear couplings have slope 0 and count as absent");
        notes.push(format!("free is a linear estimate of a nonlinear world: {looked}"));
    }
    let sampling = &world.sampling;
    match sampling.estimator {
        EstimatorKind::Foaw | EstimatorKind::FoawBest if sampling.window > 1 => notes.push(format!(
            "free takes {} at its longest window, {} samples, and at its shortest, 1: the worse of the two counts",
            sampling.estimator.name(),
            sampling.window
        )),
        EstimatorKind::Levant if takes_estimate(world) => notes.push(
            "free takes levant as the difference, which it is as long as the velocity changes by no more than 1.1 loop.acceleration".to_string(),
        ),
        EstimatorKind::Exact
        | EstimatorKind::Difference
        | EstimatorKind::LowPass
        | EstimatorKind::Foaw
        | EstimatorKind::FoawBest
        | EstimatorKind::Kalman
        | EstimatorKind::Levant => {}
    }
    if may_not_settle(world) {
        notes.push(
            "the couplings at bodies may swing the lightest by 2 rad a step or more: a step may find no torques of all couplings that agree, and then \
             loses energy; hapt sim counts such steps"
                .to_string(),
        );
    }
    if sampling.bodies_every > 1 {
        notes.push(format!(
            "loop.bodies_every: the eigenvalues of held and free are those of {every} samples, a step of the bodies; critical periods are \
             those of a sample",
            every = sampling.bodies_every
        ));
    }
    if world.couplings.iter().any(laws::at_puck) {
        notes.push(format!("free: its critical period is searched from {} up", time(shortest_period(sampling))));
    }
    if let Some(count_power) = count_power(world)? {
        notes.push(format!(
            "the encoder's counts can feed the bodies, and a hand by them, with a count_power of at most {} W: for one body K²Δ²/(16 B), K its \
             stiffness to the puck, Δ the count, B its damping to ground",
            short(count_power)
        ));
    }
    if world.device.handle.is_some() {
        notes.push(
            "device.handle: shaft, handle and hand are one passive hand to the motor, so passive and uneven hold whatever their numbers; held \
             and free are about these, held with the handle held still"
                .to_string(),
        );
    }
    notes.extend(device_torque(world, fall));
    notes.extend(changing_friction(world));
    notes.extend(falling_friction(world));
    if world.device.stops.is_some() {
        notes.push(
            "device.stops: stops store and take, so they are a part of the passive hand, and passive and uneven hold wherever they are; free is \
             between them, and its eigenvalues alone prove nothing"
                .to_string(),
        );
    }
    notes.extend(compensations(world)?);
    notes.extend(at_puck(world));
    Ok(notes)
}

/// How gravity and cogging enter the verdicts.
fn device_torque(world: &World, fall: Option<Fall>) -> Option<String> {
    let torque = &world.device.torque;
    let of = match (torque.gravity.is_some(), torque.cogging.is_some()) {
        (true, true) => "device.gravity and device.cogging",
        (true, false) => "device.gravity",
        (false, _) => "device.cogging",
    };
    let away = match fall {
        Some(fall) => format!(
            "where it falls as steeply, no spring holds the puck: its motion grows by {} per second until it rests elsewhere",
            short(fall.growth_per_s)
        ),
        None => "where it falls as steeply, springs hold the puck".into(),
    };
    (!torque.is_none()).then(|| {
        format!(
            "{of}: a torque that stores energy and gives none over a turn is a part of the passive hand, so passive and uneven hold whatever it \
             is; free takes its slope as 0 and as {steepest} that hold the puck, the worse of the two; {away}",
            steepest = with_unit(torque.steepest(), Measure::Stiffness, world.motion)
        )
    })
}

/// How friction that changes with the position enters the verdicts.
fn changing_friction(world: &World) -> Option<String> {
    let torque = |torque: f64| with_unit(torque, Measure::Torque, world.motion);
    let device = &world.device;
    (device.changing_friction() > 0.0).then(|| {
        format!(
            "device.friction_by_position: friction takes at every position, so passive and uneven hold, with {} as what it takes at least; free is \
             without friction, and its eigenvalues alone prove nothing",
            torque(device.friction_range()[0])
        )
    })
}

/// How friction that falls with the speed enters the verdicts.
fn falling_friction(world: &World) -> Option<String> {
    let (falls, device) = (world.device.falling_friction(), &world.device);
    let velocity = device.stribeck?.velocity;
    let slow = match falls > device.damping_range()[0] {
        true => "more than its damping: a puck that is driven slowly may stick and slip",
        false => "less than its damping: a faster puck always meets more",
    };
    (falls > 0.0).then(|| {
        format!(
            "device.stribeck: friction takes at every speed, so passive and uneven hold, with device.friction as what it takes at least; it falls \
             by {falls} below {velocity}, {slow}. free is without friction, and its eigenvalues alone prove nothing",
            falls = with_unit(falls, Measure::Damping, world.motion),
            velocity = with_unit(velocity, Measure::Velocity, world.motion),
        )
    })
}

/// The part of the device's damping that each compensation of a torque of the device requires.
fn compensations(world: &World) -> Result<Vec<String>, Error> {
    let mut notes = Vec::new();
    for coupling in &world.couplings {
        let Some((of, share)) = world.device.compensated_by(coupling) else { continue };
        if of == Compensated::Friction {
            let least = world.device.friction_range()[0];
            let others = taken(&world.couplings) - laws::most(coupling);
            let share_max = ((least - others) / world.device.least_friction()).clamp(0.0, 1.0);
            let torque = |torque: f64| with_unit(torque, Measure::Torque, world.motion);
            notes.push(format!(
                "compensation of friction: it takes {} of device.friction back by the measured velocity, {}: friction is {} at least, which pays for as \
                 much and for nothing else, so that a share of {} is the most beside the other couplings; free has neither",
                short(share),
                torque(laws::most(coupling)),
                torque(least),
                short(share_max)
            ));
            continue;
        }
        if let Law::Acceleration { cutoff, .. } = coupling.law {
            if coupling.limit.is_some() {
                continue;
            }
            let alone = with_fixed_bodies(world, &[*coupling]);
            let cost = requirement(&alone, &alone.couplings)?.damping;
            let costs = cost.map_or("whose cost has no proof behind this estimator".into(), |cost| {
                let cost = with_unit(cost, Measure::Damping, world.motion);
                format!("which by itself costs {cost} of the device's damping: more than it takes off at the frequencies that pass")
            });
            notes.push(format!(
                "compensation of inertia: it takes {} of device.inertia back by the measured acceleration behind a low-pass of {}, {costs}",
                short(share),
                with_unit(cutoff, Measure::Frequency, world.motion)
            ));
            continue;
        }
        let of = of.name();
        let cost = laws_cost(world, [laws::steepest(&coupling.law).0, 0.0])?;
        notes.push(format!(
            "compensation of {of}: it takes {} of device.{of} back by the measured position: a law of its steepest slope, which costs {} of the \
             device's damping",
            short(share),
            with_unit(cost, Measure::Damping, world.motion)
        ));
    }
    Ok(notes)
}

/// Whether a step that finds its nonlinear torques may not find them. Couplings of one body, or between the same two, have one equation, whose
/// solution a bracket finds; several such equations have been solved in all random worlds where the couplings together swing the lightest body by less
/// than 2 rad a step.
fn may_not_settle(world: &World) -> bool {
    let bodies = |c: &Coupling| {
        let [a, b] = [c.first.body(), c.second.body()];
        if a < b { [a, b] } else { [b, a] }
    };
    let mut at_bodies = world.couplings.iter().filter(|c| is_nonlinear(c) && laws::at_body(c));
    let Some(first) = at_bodies.next().filter(|_| world.sampling.method.finds_torques()) else { return false };
    let lightest = world.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
    let stiffness: f64 = world.couplings.iter().filter(|c| laws::at_body(c)).map(|c| c.law.slopes().stiffness).sum();
    let step = world.sampling.step();
    at_bodies.any(|c| bodies(c) != bodies(first)) && stiffness / lightest * (step * step) >= 4.0
}

/// Notes on couplings at the puck that passivity omits or excludes.
fn at_puck(world: &World) -> impl Iterator<Item = String> {
    let damping = world.device.damping;
    world.couplings.iter().enumerate().filter(|(_, c)| laws::at_puck(c)).filter_map(move |(index, c)| match (Kind::of(c), laws::most(c)) {
        (Kind::Coulomb, torque) if torque > 0.0 => Some(format!(
            "couplings.{index}: Coulomb friction at the puck jumps with the sign of the velocity, so no finite damping makes \
             it passive, but the device's own friction of as much does; LuGre friction with its bristles has a finite slope"
        )),
        (Kind::Constant, torque) if torque != 0.0 => {
            let speed = if damping > 0.0 {
                let speed = with_unit(torque / damping, Measure::Velocity, world.motion);
                format!("at up to {speed}, its torque over the device's damping")
            } else {
                "ever faster, because the device has no damping".to_string()
            };
            Some(format!(
                "couplings.{index}: a constant torque at the puck gives energy without bound and counts 0 in passivity; hands \
                 off, where nothing else holds the puck, it drives it {speed}"
            ))
        }
        (Kind::Integral, _) if laws::integral_gain(&c.law) > 0.0 => Some(format!(
            "couplings.{index}: an integral term gives energy to a hand that moves slowly to and fro, whatever the damping is, but a limit within \
             the device's friction, which takes as much. Hands-off the eigenvalues decide beyond such a limit, which they leave out; held away from \
             its rest its torque grows, which held leaves out"
        )),
        (Kind::Acceleration, torque) if torque.is_finite() => Some(format!(
            "couplings.{index}: a torque along the acceleration with a limit is passive where the device's friction takes as much; free leaves the \
             limit out"
        )),
        (Kind::Assist, torque) if torque > 0.0 => Some(format!(
            "couplings.{index}: an assist pushes along with the hand, and is passive where the device's friction takes as much; free leaves out both"
        )),
        (
            Kind::Linear | Kind::Constant | Kind::Potential | Kind::Coulomb | Kind::Lugre | Kind::Integral | Kind::Assist | Kind::Acceleration,
            _,
        ) => None,
    })
}
