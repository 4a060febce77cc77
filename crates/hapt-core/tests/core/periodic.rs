//! Laws that repeat, with phases of any size.

use hapt_core::{Coupling, End, Law, Loop, Real, Spec, Waveform};
use hapt_testing::prelude::*;

/// The torque on the puck at these positions.
fn torques<F: Real>(coupling: Coupling, positions: &[f64]) -> Vec<f64> {
    let couplings = [coupling];
    let world = Loop::<F, 1, 1, 2>::new(&Spec { couplings: &couplings, ..Spec::new(1e-3) }).unwrap();
    let mut state = world.start();
    positions.iter().map(|&q| world.step(&mut state, F::from_f64(q), F::ZERO).torque.to_f64()).collect()
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// A phase of any number of pitches moves the torque and nothing else: its slope stays within the certificate's bound, and its size the
    /// same.
    #[test]
    fn the_steepness_does_not_depend_on_the_phase(
        pitch in 1e-3..1.0f64, torque in 1e-3..1.0f64, decades in -3.0..300.0f64, negative in any::<bool>(),
        harmonic in 0..4_usize, is_detent in any::<bool>(),
    ) {
        let phase = if negative { -10f64.powf(decades) } else { 10f64.powf(decades) };
        let mut waveform = Waveform { sine: [0.0; 4], cosine: [0.0; 4] };
        waveform.sine[harmonic] = 1.0;
        let law = if is_detent { Law::Detent { torque, pitch, phase } } else { Law::Texture { torque, pitch, phase, waveform } };
        let steepest = law.slopes().stiffness;
        let parts = 2000;
        let positions: Vec<f64> = (0..=parts).map(|i| (2.0 * f64::from(i) / f64::from(parts) - 1.0) * pitch).collect();
        let coupling = law.between(End::Puck, End::Ground);
        for (found, rounding) in [(torques::<f64>(coupling, &positions), 1e-9), (torques::<f32>(coupling, &positions), 1e-4)] {
            let most = found.iter().fold(0.0, |most: f64, torque| most.max(torque.abs()));
            prop_assert!((most - torque).abs() < 1e-3 * torque, "{most} of {torque}");
            for (pair, at) in found.windows(2).zip(positions.windows(2)) {
                prop_assert!((pair[1] - pair[0]).abs() <= steepest * (at[1] - at[0]) + rounding * torque, "{pair:?} at {at:?}");
            }
        }
    }
}
