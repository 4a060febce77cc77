//! hapt-core compiled alone, for f32 and f64, behind two functions that nothing is known about. If any way through the core
//! could panic, the library would contain the standard panic routines; `cargo xtask test` looks for their names.
#![no_std]

use core::hint::black_box;

use hapt_core::{Body, Coupling, End, Estimator, Law, Loop, Method, Output, Real, Spec};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

/// Compiles a world that the optimiser knows nothing about, and takes ten samples.
fn run<F: Real, const B: usize, const C: usize, const W: usize>(z: f64) -> f64 {
    let bodies = black_box([Body { inertia: z, position: z, velocity: z }; 5]);
    let coupling = Coupling { first: End::Puck, second: End::Body(0), law: Law::Spring { stiffness: z, rest: z } };
    let couplings = black_box([coupling; 9]);
    let spec = black_box(Spec {
        period: z,
        method: Method::Zoh,
        output: Output::End,
        advance: 3,
        estimator: Estimator::Foaw { window: 3 },
        count: Some(z),
        limit: Some(z),
        levels: Some(2),
        bodies: &bodies,
        couplings: &couplings,
    });
    let Ok(compiled) = Loop::<F, B, C, W>::new(&spec) else { return 0.0 };
    let mut state = black_box(compiled.start());
    let mut sum = 0.0;
    for _ in 0..10 {
        sum += compiled.step(&mut state, F::from_f64(black_box(z)), F::from_f64(black_box(z))).torque.to_f64();
    }
    #[cfg(feature = "control")]
    {
        sum += bodies[black_box(z) as usize].inertia;
    }
    sum
}

/// On a microcontroller's numbers and room.
#[unsafe(no_mangle)] // So that the linker keeps it.
pub extern "C" fn hapt_proof_single(z: f64) -> f64 {
    run::<f32, 4, 8, 17>(z)
}

/// On a PC's numbers.
#[unsafe(no_mangle)] // So that the linker keeps it.
pub extern "C" fn hapt_proof_double(z: f64) -> f64 {
    run::<f64, 4, 8, 17>(z)
}
