//! A world sent over a wire arrives unchanged or is refused.

use hapt_core::{Body, Coupling, End, Estimator, Law, Method, Output, Spec};
use hapt_testing::laws::laws;
use hapt_testing::prelude::*;
use hapt_wire::{Error, Stored, write};
use proptest::sample::select;

fn ends() -> impl Strategy<Value = End> {
    prop_oneof![Just(End::Puck), Just(End::Ground), (0..4usize).prop_map(End::Body)]
}

/// Every kind of world, with numbers of any bits.
#[derive(Clone, Debug)]
struct Any {
    numbers: (f64, Option<f64>, Option<f64>, Option<u32>, u32, u32),
    method: Method,
    output: Output,
    estimator: Estimator,
    filter: Option<f64>,
    bodies: Vec<Body>,
    couplings: Vec<Coupling>,
}

impl Any {
    fn spec(&self) -> Spec<'_> {
        let (period, count, limit, levels, advance, bodies_every) = self.numbers;
        let &Any { method, output, estimator, filter, .. } = self;
        let (bodies, couplings) = (&self.bodies[..], &self.couplings[..]);
        Spec {
            method,
            output,
            advance,
            bodies_every,
            estimator,
            filter,
            count,
            limit,
            levels,
            bodies,
            couplings,
            ..Spec::new(period)
        }
    }
}

fn worlds() -> impl Strategy<Value = Any> {
    let estimator = prop_oneof![
        Just(Estimator::Exact),
        Just(Estimator::Difference),
        any::<f64>().prop_map(|cutoff| Estimator::LowPass { cutoff }),
        any::<u32>().prop_map(|window| Estimator::Foaw { window }),
        any::<u32>().prop_map(|window| Estimator::FoawBest { window }),
        any::<u32>().prop_map(|every| Estimator::DifferenceOver { every }),
        any::<f64>().prop_map(|cutoff| Estimator::Kalman { cutoff }),
        any::<f64>().prop_map(|acceleration| Estimator::Levant { acceleration }),
    ];
    let body = (any::<f64>(), any::<f64>(), any::<f64>());
    let body = body.prop_map(|(inertia, position, velocity)| Body { inertia, position, velocity });
    let coupling = (ends(), ends(), laws(|_| true, |_, _| any::<f64>()), any::<Option<f64>>()).prop_map(
        |(first, second, law, limit)| Coupling { first, second, law, limit: limit.filter(|_| law.takes_limit()) },
    );
    let lists = (prop::collection::vec(body, 0..5), prop::collection::vec(coupling, 0..9));
    // A world of either version.
    let every = prop_oneof![Just(1), any::<u32>()];
    let numbers = (any::<(f64, Option<f64>, Option<f64>, Option<u32>, u32)>(), every);
    let numbers = numbers
        .prop_map(|((period, count, limit, levels, advance), every)| (period, count, limit, levels, advance, every));
    (((numbers, select(&Method::ALL[..]), select(&Output::ALL[..])), (estimator, any::<Option<f64>>())), lists)
        .prop_map(|(((numbers, method, output), (estimator, filter)), (bodies, couplings))| Any {
            numbers,
            method,
            output,
            estimator,
            filter,
            bodies,
            couplings,
        })
}

proptest! {
    #[test]
    fn a_world_comes_back_to_the_bit(world in worlds()) {
        let mut room = [0; 4096];
        let bytes = write(&world.spec(), &mut room).unwrap();
        let stored = Stored::<4, 8>::read(bytes).unwrap();
        // Debug prints every distinguishable number differently.
        prop_assert_eq!(format!("{:?}", stored.spec()), format!("{:?}", world.spec()));
    }

    #[test]
    fn truncated_or_corrupted_bytes_are_no_world(world in worlds(), at in any::<prop::sample::Index>(), bit in 0..8u8) {
        let mut room = [0; 4096];
        let bytes = write(&world.spec(), &mut room).unwrap().to_vec();
        let cut = at.index(bytes.len());
        prop_assert!(Stored::<4, 8>::read(&bytes[..cut]).is_err());
        let mut flipped = bytes.clone();
        flipped[cut] ^= 1 << bit;
        prop_assert!(Stored::<4, 8>::read(&flipped).is_err());
        let mut longer = bytes;
        longer.push(0);
        prop_assert!(Stored::<4, 8>::read(&longer).is_err());
    }

    #[test]
    fn random_bytes_are_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = Stored::<4, 8>::read(&bytes);
    }

    #[test]
    fn too_small_a_room_is_an_error(world in worlds(), room in 0..64usize) {
        let mut small = vec![0; room];
        let mut large = [0; 4096];
        let whole = write(&world.spec(), &mut large).unwrap();
        match write(&world.spec(), &mut small) {
            Ok(bytes) => prop_assert_eq!(bytes, whole),
            Err(error) => prop_assert!(error == Error::NoRoom && room < whole.len()),
        }
    }
}

#[test]
fn too_many_bodies_or_couplings_are_refused_with_their_number() {
    let bodies = [Body { inertia: 1.0, position: 0.0, velocity: 0.0 }; 5];
    let spec = Spec { bodies: &bodies, ..Spec::new(1e-3) };
    let mut room = [0; 512];
    let bytes = write(&spec, &mut room).unwrap();
    assert_eq!(Stored::<4, 8>::read(bytes).unwrap_err(), Error::TooManyBodies { given: 5, room: 4 });
    let other = [&[4], &bytes[1..]].concat();
    assert_eq!(Stored::<4, 8>::read(&other).unwrap_err(), Error::Version { given: 4 });
}

/// A board that reads only version 1 refuses worlds whose bodies it would step too often or with another position, and takes every other world.
#[test]
fn bodies_at_every_nth_sample_are_another_version() {
    let body = Body { inertia: 0.02, position: 0.0, velocity: 0.0 };
    let spring = Law::Spring { stiffness: 1.0, rest: 0.0 }.between(End::Puck, End::Body(0));
    let spec = |bodies_every, filter| Spec {
        bodies_every,
        filter,
        bodies: std::slice::from_ref(&body),
        couplings: std::slice::from_ref(&spring),
        ..Spec::new(1e-3)
    };
    let mut room = [0; 512];
    for (bodies_every, filter, version) in
        [(1, None, 1), (2, None, 2), (1000, None, 2), (1, Some(50.0), 3), (3, Some(1e3), 3)]
    {
        let bytes = write(&spec(bodies_every, filter), &mut room).unwrap();
        assert_eq!(bytes[0], version);
        assert_eq!(Stored::<4, 8>::read(bytes).unwrap().spec(), spec(bodies_every, filter));
    }
}
