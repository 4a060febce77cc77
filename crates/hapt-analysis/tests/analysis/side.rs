//! Loops side by side against the same loops as worlds, one by one.

use hapt_analysis::{Continuous, Discrete, Slopes, Verdict, held, held_growth};
use hapt_analysis::{Loops, sign};
use hapt_model::{Body, Coupling, Damping, End, Law, Method, Output};
use hapt_testing::prelude::*;

/// J, K to the puck, K to ground, C0, T, and whether a damper of T K is in parallel with all of it, or with the spring to the puck.
#[derive(Clone, Copy, Debug)]
struct Wheel {
    inertia: f64,
    springs: [f64; 2],
    fixed: f64,
    follows: Follows,
    period: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Follows {
    Nothing,
    Puck,
    All,
}

impl Wheel {
    fn bodies(&self) -> [Body; 1] {
        [Body { inertia: self.inertia, position: 0.0, velocity: 0.0 }]
    }

    fn couplings(&self) -> Vec<Coupling> {
        let spring = |second, stiffness| (stiffness > 0.0).then_some((second, Law::Spring { stiffness, rest: 0.0 }));
        let damper = |second, damping| Some((second, Law::Damper { damping }));
        let between_puck = |law| Coupling { first: End::Puck, second: End::Ground, law, limit: None };
        let laws = [
            spring(End::Puck, self.springs[0]),
            spring(End::Ground, self.springs[1]),
            damper(End::Ground, Damping::Fixed(self.fixed)),
            match self.follows {
                Follows::Nothing => None,
                Follows::Puck if self.springs[0] == 0.0 => None,
                Follows::Puck => damper(End::Puck, Damping::Compensating),
                Follows::All => damper(End::Ground, Damping::Compensating),
            },
        ];
        let of_wheel =
            laws.into_iter().flatten().map(|(second, law)| Coupling { first: End::Body(0), second, law, limit: None });
        // Couplings that are not at the wheel have no effect, however nonlinear they are.
        of_wheel.chain([between_puck(Law::Detent { torque: 1.0, pitch: 0.1, phase: 0.0 })]).collect()
    }

    fn growth(&self, method: Method) -> Option<f64> {
        held_growth(&self.bodies(), &self.couplings(), method, self.period).unwrap()
    }
}

/// The results of a batch of these wheels.
fn ask(wheels: &[Wheel], ask: impl Fn(Loops<'_>, &mut [f64])) -> Vec<f64> {
    let column = |of: fn(&Wheel) -> f64| wheels.iter().map(of).collect::<Vec<_>>();
    let (inertia, stiffness) = (column(|w| w.inertia), column(|w| 0.0 + w.springs[0] + w.springs[1]));
    let per_period = column(|w| match w.follows {
        Follows::Nothing => 0.0,
        Follows::Puck => w.springs[0],
        Follows::All => 0.0 + w.springs[0] + w.springs[1],
    });
    let (fixed, period) = (column(|w| w.fixed), column(|w| w.period));
    let loops =
        Loops { inertia: &inertia, stiffness: &stiffness, fixed: &fixed, per_period: &per_period, period: &period };
    let mut out = vec![0.0; wheels.len()];
    ask(loops, &mut out);
    out
}

fn follows() -> impl Strategy<Value = Follows> {
    prop::sample::select(vec![Follows::Nothing, Follows::Puck, Follows::All])
}

/// Of all sizes, in and out of proportion, and some without springs or dampers.
fn wide() -> impl Strategy<Value = Wheel> {
    let some = |log: std::ops::Range<f64>| prop_oneof![1 => Just(0.0), 6 => log.prop_map(|x| 10f64.powf(x))];
    (-6.0..3.0f64, [some(-4.0..8.0), some(-4.0..8.0)], some(-9.0..4.0), follows(), -7.0..1.5f64).prop_map(
        |(inertia, springs, fixed, follows, period)| {
            let (inertia, period) = (10f64.powf(inertia), 10f64.powf(period));
            Wheel { inertia, springs, fixed, follows, period }
        },
    )
}

/// Within `away`, relatively, of where forward Euler, semi-implicit Euler and RK4 leave the circle: by the damping that forward Euler
/// requires, by the largest period of the others.
fn at_an_edge() -> impl Strategy<Value = Wheel> {
    let away =
        (prop::bool::ANY, -17.0..-8.0f64).prop_map(|(more, log)| 10f64.powf(log) * if more { 1.0 } else { -1.0 });
    (-5.0..1.0f64, -2.0..5.0f64, -6.0..0.0f64, 0..4usize, away).prop_map(|(inertia, stiffness, period, edge, away)| {
        let (inertia, stiffness, period) = (10f64.powf(inertia), 10f64.powf(stiffness), 10f64.powf(period));
        let of = |x: f64| x * x * inertia / (period * period) * (1.0 + away);
        let (springs, fixed) = match edge {
            0 => ([stiffness, 0.0], stiffness * period * (1.0 + away)),
            // A growth of ±1e-9 1/s: 2 J per second of it, on top of that.
            1 => (
                [stiffness, 0.0],
                stiffness * period + 2e-9 * inertia * if away > 0.0 { 1.0 } else { -1.0 } * (1.0 + away),
            ),
            2 => ([of(2.0), 0.0], 0.0),
            _ => ([of(8f64.sqrt()), 0.0], 0.0),
        };
        Wheel { inertia, springs, fixed: fixed.max(0.0), follows: Follows::Nothing, period }
    })
}

fn many(of: impl Strategy<Value = Wheel>) -> impl Strategy<Value = Vec<Wheel>> {
    prop::collection::vec(of, 1..200)
}

proptest! {
    #[test]
    fn a_verdict_and_a_growth_are_those_of_the_world(wheels in prop_oneof![many(wide()), many(at_an_edge())]) {
        for method in Method::ALL {
            let verdicts = ask(&wheels, |loops, out| loops.verdicts(method, out));
            let growths = ask(&wheels, |loops, out| loops.growths(method, out));
            for ((wheel, verdict), growth) in wheels.iter().zip(verdicts).zip(growths) {
                let full = wheel.growth(method);
                prop_assert_eq!(verdict, sign(Verdict::of(full)), "{}: {:?} {:?}", method.name(), wheel, full);
                prop_assert_eq!(growth.to_bits(), full.unwrap_or(f64::NAN).to_bits(), "{}: {:?}", method.name(), wheel);
            }
        }
    }

    /// The same from the matrix of the step: λ₁ λ₂ is its determinant and λ₁ + λ₂ its trace, and the whole answer gives the growth.
    #[test]
    fn the_closed_form_has_the_steps_trace_and_determinant(wheel in wide(), x in -3.0..0.3f64) {
        let stiffness = wheel.springs[0] + wheel.springs[1];
        // Damping within 1e-9 of T K counts as T K.
        let nearly = (1e-300..=2e-9 * stiffness).contains(&wheel.springs[1]);
        prop_assume!(!(nearly && wheel.follows == Follows::Puck));
        let rate = (stiffness / wheel.inertia).sqrt().max(wheel.fixed / wheel.inertia).max(1.0);
        let wheel = Wheel { period: 10f64.powf(x) / rate, ..wheel };
        let (bodies, couplings) = (wheel.bodies(), wheel.couplings());
        let equations = Continuous::new(&bodies, &couplings, &Slopes::Flat).unwrap();
        for method in Method::ALL {
            let found = held(&bodies, &couplings, method, wheel.period).unwrap();
            let growth = wheel.growth(method);
            prop_assert_eq!(found.growth_per_s.map(f64::to_bits), growth.map(f64::to_bits), "{}", method.name());
            let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
            let d = Discrete::new(&equations, method, output, 0, wheel.period).unwrap().d;
            let [one, other] = &found.eigenvalues[..] else { continue };
            // In μ = λ - 1, so that nothing is lost near 1.
            let [a, b] = [one, other].map(|v| nalgebra::Complex::new(v.re - 1.0, v.im));
            prop_assert!(((a + b).re - d.trace()).abs() < 1e-13 * (1.0 + d.trace().abs()), "{}", method.name());
            prop_assert!(((a * b).re - d.determinant()).abs() < 1e-13 * (1.0 + d.norm_squared()), "{}", method.name());
        }
    }
}

/// Numbers that no world has are not loops, and do not change the results of their neighbours.
#[test]
fn what_is_no_number_has_no_verdict() {
    let wheel = Wheel { inertia: 0.02, springs: [1.0, 0.0], fixed: 0.0, follows: Follows::Nothing, period: 1e-3 };
    let odd = [f64::NAN, 0.0, -1.0, f64::INFINITY].map(|inertia| Wheel { inertia, ..wheel });
    let wheels: Vec<Wheel> = odd.into_iter().flat_map(|odd| [odd, wheel]).collect();
    for out in [
        ask(&wheels, |loops, out| loops.verdicts(Method::ForwardEuler, out)),
        ask(&wheels, |loops, out| loops.growths(Method::ForwardEuler, out)),
    ] {
        for pair in out.chunks(2) {
            assert!(pair[0].is_nan() && pair[1] > 0.0, "{out:?}");
        }
    }
}
