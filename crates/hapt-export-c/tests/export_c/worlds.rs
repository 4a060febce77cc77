//! Random worlds over all methods, estimators, outputs and laws, with random limits.

use hapt_core::{Body, CertifiedTime, Coupling, End, Estimator, Heat, Law, Limits, Method, Output, Spec, WhenLate};
use hapt_testing::laws::{SIZES, Sizes, some_limited};
use proptest::prelude::*;

/// A world that owns its lists.
#[derive(Clone, Debug)]
pub struct World {
    pub period: f64,
    pub method: Method,
    pub output: Output,
    pub advance: u32,
    pub bodies_every: u32,
    pub estimator: Estimator,
    pub filter: Option<f64>,
    pub count: Option<f64>,
    pub limit: Option<f64>,
    pub levels: Option<u32>,
    pub bodies: Vec<Body>,
    pub couplings: Vec<Coupling>,
    pub limits: Limits,
}

impl World {
    pub fn spec(&self) -> Spec<'_> {
        Spec {
            method: self.method,
            output: self.output,
            advance: self.advance,
            bodies_every: self.bodies_every,
            estimator: self.estimator,
            filter: self.filter,
            count: self.count,
            limit: self.limit,
            levels: self.levels,
            bodies: &self.bodies,
            couplings: &self.couplings,
            ..Spec::new(self.period)
        }
    }
}

fn law() -> impl Strategy<Value = (Law, Option<f64>)> {
    let sizes = Sizes { stiffness: 0.0..=20.0, torque: 0.0..=0.2, length: 0.02..=1.0, velocity: 1e-3..=5.0, ..SIZES };
    some_limited(sizes.laws(|law| !law.is_compensating()), 0.01..0.5_f64)
}

fn end(bodies: usize) -> impl Strategy<Value = End> {
    (0..bodies + 2).prop_map(|i| match i {
        0 => End::Puck,
        1 => End::Ground,
        i => End::Body(i - 2),
    })
}

fn estimator() -> impl Strategy<Value = Estimator> {
    prop_oneof![
        Just(Estimator::Exact),
        Just(Estimator::Difference),
        (5.0..300.0_f64).prop_map(|cutoff| Estimator::LowPass { cutoff }),
        (1_u32..16).prop_map(|window| Estimator::Foaw { window }),
        (1_u32..16).prop_map(|window| Estimator::FoawBest { window }),
        (2_u32..16).prop_map(|every| Estimator::DifferenceOver { every }),
        (5.0..300.0_f64).prop_map(|cutoff| Estimator::Kalman { cutoff }),
        (1.0..4.0_f64).prop_map(|power| Estimator::Levant { acceleration: 10_f64.powf(power) }),
    ]
}

/// Limits that readings exceed often enough.
fn limits(period: f64) -> impl Strategy<Value = Limits> {
    let or_none =
        |range: std::ops::Range<f64>| prop::option::weighted(0.5, range).prop_map(|x| x.unwrap_or(f64::INFINITY));
    let heat = move || (or_none(0.005..0.3), 0.01..2.0_f64).prop_map(|(rms, time)| Heat { rms, time });
    let first =
        (2.0..40.0_f64, or_none(1.0..30.0), or_none(0.004..0.06), or_none(0.5..8.0), or_none(0.02..0.5), 0.0..0.05_f64);
    let second = (
        or_none(0.2..1.5),
        or_none(0.005..0.3),
        heat(),
        heat(),
        or_none(0.5..4.0),
        (-7.0..-1.0_f64).prop_map(|power| 10_f64.powf(power)),
    );
    let time =
        (or_none(1.0..3.0), or_none(0.0..2.0), 0..3_usize).prop_map(move |(interval, delay, late)| CertifiedTime {
            interval: interval * period,
            delay: delay * period,
            when_late: [WhenLate::Fault, WhenLate::Fade, WhenLate::Count][late],
        });
    let third = (
        prop::option::of(0.02..0.2_f64),
        prop::option::of(0.001..0.05_f64),
        prop::option::of(0.0..20.0_f64),
        time,
        prop::option::of(2.0..20.0_f64),
    );
    (first, second, third, prop::array::uniform4(any::<bool>()), or_none(0.05..0.5)).prop_map(
        move |(first, second, third, [link_faults, world_trips, port_trips, zero_where_armed], link)| {
            let (fade, velocity, jump, overspeed, stuck, stuck_torque) = first;
            let (torque, slew, motor, driver, stall, energy) = second;
            let (pulse, brake, delay, time, recentre) = third;
            let (fade, delay) = (fade * period, delay.unwrap_or(0.0) * period);
            Limits {
                fade,
                velocity,
                jump,
                overspeed,
                stuck,
                stuck_torque,
                torque,
                slew,
                motor,
                driver,
                stall: stall * period,
                time,
                link: link + fade + delay + 2.0 * period,
                link_faults,
                energy,
                world_trips,
                port_trips,
                pulse: pulse.unwrap_or(0.0),
                brake: brake.unwrap_or(0.0),
                recentre: recentre.unwrap_or(0.0) * period,
                zero_where_armed,
                announcements: false,
                inertia: 6.4e-4,
                damping: 1.2e-3,
                friction: if recentre.is_some() { 0.5 } else { 5e-3 },
                delay,
            }
        },
    )
}

prop_compose! {
    /// A world of this method.
    fn any_world(method: Method)(n in 0_usize..4, count in 0_usize..8)(
        bodies in prop::collection::vec(
            (1e-4..0.05_f64, -0.3..0.3_f64, -1.0..1.0_f64)
                .prop_map(|(inertia, position, velocity)| Body { inertia, position, velocity }),
            n,
        ),
        couplings in prop::collection::vec((end(n), end(n), law()), count + 1),
        (estimator, filter) in (estimator(), prop::option::weighted(0.3, 5.0..300.0_f64)),
        output in 0..Output::ALL.len(),
        advance in prop::option::weighted(0.5, 1_u32..4),
        every in prop::option::weighted(0.5, 2_u32..5),
        encoder in prop::option::of(1e-4..1e-2_f64),
        limit in prop::option::weighted(0.8, 0.1..1.2_f64),
        levels in prop::option::weighted(0.3, 1_u32..200),
        (period, limits) in (2e-4..4e-3_f64).prop_flat_map(|period| (Just(period), limits(period))),
    ) -> World {
        let output = if method.takes_new_sample_first() { Output::Start } else { Output::ALL[output] };
        let is_end = output == Output::End;
        let couplings: Vec<Coupling> = couplings
            .into_iter()
            .filter(|(first, second, _)| first != second)
            .map(|(first, second, (law, limit))| Coupling { first, second, law, limit })
            .filter(|coupling| coupling.goes_with(method))
            .collect();
        let lugre = couplings.iter().any(|coupling| coupling.law.has_bristle() && coupling.is_at_body());
        let skips = !bodies.is_empty() && !method.takes_new_sample_first() && advance.is_none() && !lugre;
        World {
            period,
            method,
            output,
            advance: if is_end { advance.unwrap_or(0) } else { 0 },
            bodies_every: if skips { every.unwrap_or(1) } else { 1 },
            estimator,
            filter,
            count: encoder,
            limit,
            levels: limit.and(levels).map(|half| 2 * half),
            bodies,
            couplings,
            limits,
        }
    }
}

/// Worlds of a method that the core takes.
pub fn world(method: Method) -> impl Strategy<Value = World> {
    any_world(method).prop_filter("the core takes it", |world| {
        hapt_core::Controller::<f64, 8, 32, 257>::new(&world.spec(), &world.limits).is_ok()
    })
}
