//! hapt-core compiled by itself, for f32 and f64, behind two functions that the optimiser cannot see into. If any path through the core
//! could panic, the library would contain the standard panic routines; `cargo xtask test` looks for their names.
#![no_std]

use core::hint::black_box;

use hapt_core::{
    Body, CertifiedTime, Coupling, End, Estimator, Heat, Law, Limits, Loop, Reading, Real, Request, Spec, Supervisor,
    SupervisorState, WhenLate,
};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

/// Compiles a world that is unknown to the optimiser, and takes ten samples.
fn run<F: Real, const B: usize, const C: usize, const W: usize>(z: f64) -> f64 {
    let bodies = black_box([Body { inertia: z, position: z, velocity: z }; 5]);
    let coupling = Coupling { first: End::Puck, second: End::Body(0), law: Law::Spring { stiffness: z, rest: z }, limit: None };
    let couplings = black_box([coupling; 9]);
    let spec = black_box(Spec { advance: 3, estimator: Estimator::Foaw { window: 3 }, count: Some(z), limit: Some(z), levels: Some(2), bodies: &bodies, couplings: &couplings, ..Spec::new(z) });
    let Ok(compiled) = Loop::<F, B, C, W>::new(&spec) else { return 0.0 };
    let mut state = black_box(compiled.start());
    let mut sum = 0.0;
    for _ in 0..10 {
        sum += compiled.step(&mut state, F::from_f64(black_box(z)), F::from_f64(black_box(z))).torque.to_f64();
    }
    sum += guarded(z, &compiled, &spec);
    #[cfg(feature = "control")]
    {
        sum += bodies[black_box(z) as usize].inertia;
    }
    sum
}

/// The same under a supervisor.
fn guarded<F: Real, const B: usize, const C: usize, const W: usize>(
    z: f64,
    world: &Loop<F, B, C, W>,
    spec: &Spec,
) -> f64 {
    let heat = Heat { rms: z, time: z };
    let limits = black_box(Limits {
        fade: z,
        velocity: z,
        jump: z,
        overspeed: z,
        stuck: z,
        stuck_torque: z,
        torque: z,
        slew: z,
        motor: heat,
        driver: heat,
        stall: z,
        time: CertifiedTime { interval: z, delay: z, when_late: if z > 4.0 { WhenLate::Fade } else { WhenLate::Count } },
        link: z,
        link_faults: z > 0.0,
        energy: z,
        world_trips: z > 1.0,
        port_trips: z > 1.0,
        pulse: z,
        brake: z,
        recentre: z,
        zero_where_armed: z > 2.0,
        announcements: z > 3.0,
        inertia: z,
        damping: z,
        friction: z,
        delay: z,
    });
    let Ok(supervisor) = Supervisor::<F, B, C>::new(&limits, spec) else { return 0.0 };
    let (mut state, mut watch) = (black_box(world.start()), black_box(SupervisorState::START));
    let mut sum = 0.0;
    for _ in 0..10 {
        let f = |z| F::from_f64(black_box(z));
        let missed = black_box(z) as u32;
        let reading =
            Reading { position: f(z), velocity: f(z), announced: black_box(z) > 4.0, late: f(z), missed, silent: f(z) };
        let request = [None, Some(Request::Arm), Some(Request::Disarm), Some(Request::Stop), Some(Request::Clear)];
        let request = request.get(black_box(z) as usize).copied().flatten();
        sum += supervisor.step(&mut watch, world, &mut state, &reading, request).output.to_f64();
        if black_box(z) > 5.0 {
            watch.swap(f(z), f(z + 1.0));
        }
    }
    sum
}

/// On a microcontroller's numbers and capacity.
#[unsafe(no_mangle)] // So that the linker keeps it.
pub extern "C" fn hapt_proof_single(z: f64) -> f64 {
    run::<f32, 4, 8, 17>(z)
}

/// On a PC's numbers.
#[unsafe(no_mangle)] // So that the linker keeps it.
pub extern "C" fn hapt_proof_double(z: f64) -> f64 {
    run::<f64, 4, 8, 17>(z)
}
