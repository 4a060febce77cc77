//! A hand on the loop: the growth of the run is that of the eigenvalues.

use crate::common::{scenario, spring, wheel};
use hapt_analysis::{Grip, gripped_growth};
use hapt_model::*;
use hapt_sim::{Row, Simulation};
use hapt_testing::prelude::*;
use proptest::sample::select;

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    /// After any push the fastest-growing mode dominates in the end: its growth is the slope of the logarithm of a norm.
    #[test]
    fn a_run_with_a_grip_grows_by_the_gripped_loops_eigenvalue(
        method in select(Method::ALL.to_vec()), output in select(Output::ALL.to_vec()),
        estimator in select(vec![EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::LowPass]),
        delay in prop_oneof![Just(0.0), Just(2e-3), 0.0_f64..3e-3], grounded in prop_oneof![Just(0.0), 0.5_f64..5.0],
        (inertia, damping, stiffness) in (0.0_f64..2e-3, 0.0_f64..2e-3, 0.5_f64..50.0), at_puck in 0.0_f64..3e-3,
    ) {
        let output = if method.takes_new_sample_first() { Output::Start } else { output };
        let mut world = wheel(method, output);
        (world.sampling.estimator, world.sampling.cutoff, world.sampling.delay) = (estimator, Some(80.0), hapt_model::Delay::Seconds(delay));
        let law = Law::Damper { damping: Damping::Fixed(at_puck) };
        world.couplings.push(Coupling { first: End::Puck, second: End::Body(0), law, limit: None });
        // With weak damping, so that the mode is still measurable after a second.
        world.couplings.push(spring(End::Puck, End::Ground, grounded));
        world.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law: Law::Damper { damping: Damping::Fixed(1e-2) }, limit: None });
        world.device.damping = 2e-4;
        let expected = gripped_growth(&world, &Grip { inertia, damping, stiffness }).unwrap().unwrap();
        let hand = Drive::Grip { inertia, damping, stiffness, moves: Shape::Step { to: 0.1, at: 0.0 }, switching: None };
        let longest = (60.0 / expected.abs()).clamp(2.0, 40.0);
        let (mut times, mut logs) = (Vec::new(), Vec::new());
        let all = rows_within(&world, &scenario(longest, hand, None), 1e100);
        // The state's change over a tenth of a second has no rest position in it.
        for pair in all.windows(101).step_by(7) {
            let (a, b) = (&pair[0], &pair[100]);
            let far = [a.puck - b.puck, 1e-2 * (a.puck_velocity - b.puck_velocity), a.bodies[0].0 - b.bodies[0].0, 0.1 * (a.bodies[0].1 - b.bodies[0].1)];
            let size = far.iter().map(|x| x * x).sum::<f64>().sqrt();
            if size < 1e-9 {
                break;
            }
            times.push(a.time);
            logs.push(size.ln());
        }
        // The last third.
        let from = times.len() * 2 / 3;
        let (t, y) = (&times[from..], &logs[from..]);
        let n = t.len() as f64;
        prop_assume!(n > 50.0);
        let (mt, my) = (t.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
        let slope = t.iter().zip(y).map(|(t, y)| (t - mt) * (y - my)).sum::<f64>() / t.iter().map(|t| (t - mt).powi(2)).sum::<f64>();
        let span = t[t.len() - 1] - t[0];
        // The norm's oscillation, or a second mode nearly as slow, tilts the line by a few units over the span.
        prop_assert!((slope - expected).abs() < 0.02 * expected.abs() + 4.0 / span, "{slope} {expected} over {span} s");
    }
}

/// Every row while the puck is within `most`.
fn rows_within(world: &World, scenario: &Scenario, most: f64) -> Vec<Row> {
    let mut run = Simulation::new(world, scenario).unwrap();
    let mut all = Vec::new();
    while let Some(Ok(row)) = run.next() {
        if row.puck.abs() > most {
            break;
        }
        all.push(row.clone());
    }
    all
}
