//! Instructions a sample: hapt's loop bare and supervised, and the same loop in C (bench/step.c), on the worlds of a file.
//!
//! Under QEMU's `-icount` every instruction takes the same virtual time, and SysTick measures it. Each number is the difference of a long
//! run and a short one, less that of a run that does nothing.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_core::{Controller, Damping, End, Law, Loop, Phase, Reading, Request, Spec, State};
use hapt_firmware::console::{File, exit};
use hapt_firmware::trace::{BODIES, COUNTS, COUPLINGS, LIMITS, Trace};
use hapt_firmware::{stack, ticks};
use hapt_wire::Stored;

const SAMPLES: u32 = 1000;

#[entry]
fn main() -> ! {
    let mut console = File::console();
    let mut file = File::read_from(c"cases");
    let mut room = [0; 1024];
    ticks::count();
    while let Some(length) = number(&mut file) {
        let Some(bytes) = room.get_mut(..length as usize) else { exit(2) };
        if !file.fill(bytes) {
            exit(2);
        }
        let Ok(stored) = Stored::<BODIES, COUPLINGS>::read(bytes) else { exit(2) };
        let spec = stored.spec();
        let nothing = instructions(|z, v| z + v);
        let n = spec.bodies.len();
        let small = match n {
            1 => in_room::<1>(&spec),
            2 => in_room::<2>(&spec),
            _ => in_room::<4>(&spec),
        };
        let _ = write!(console, "{n}");
        // C's step is a linear world's, without an encoder.
        let is_linear = spec.couplings.iter().all(|coupling| {
            matches!(coupling.law, Law::Spring { rest: 0.0, .. } | Law::Damper { damping: Damping::Fixed(_) })
        });
        let in_c = if is_linear && n > 0 && spec.count.is_none() { in_c(&spec) } else { [f32::NAN; 2] };
        for count in [in_room::<BODIES>(&spec), small].as_flattened().iter().chain(&in_c) {
            let _ = write!(console, " {}", count - nothing);
        }
        let _ = writeln!(console);
    }
    let _ = writeln!(console, "stack {}", stack::used());
    exit(0)
}

/// hapt's loop with capacity for B bodies: bare, supervised, and supervised on the slow path of each sample.
fn in_room<const B: usize>(spec: &Spec) -> [f32; 3] {
    let Ok(controller) = Controller::<f32, B, COUPLINGS, COUNTS>::new(spec, &LIMITS) else { exit(4) };
    let controller = black_box(controller);
    let world = controller.world();
    let mut state = world.start();
    let bare = instructions(|position, velocity| world.step(&mut state, position, velocity).command);

    // An announcement is not accepted here, but takes the slow path.
    let [supervised, in_full] = [false, true].map(|announced| {
        let mut state = controller.start();
        let mut guarded = |position, velocity, request| {
            let reading = Reading { position, velocity, announced, late: 0.0, missed: 0, silent: 0.0 };
            controller.step(&mut state, &reading, request)
        };
        let mut trace = Trace::new(1e-3);
        let (position, velocity) = trace.next();
        guarded(position, velocity, Some(Request::Arm));
        for _ in 0..100 {
            let (position, velocity) = trace.next();
            guarded(position, velocity, None);
        }
        let mut phase = Phase::Disarmed;
        let count = instructions(|position, velocity| {
            let guarded = guarded(position, velocity, None);
            phase = guarded.phase;
            guarded.output
        });
        // A faulted loop would be cheap.
        if phase != Phase::Running {
            exit(5);
        }
        count
    });
    [bare, supervised, in_full]
}

/// Instructions a sample of the trace.
fn instructions(mut step: impl FnMut(f32, f32) -> f32) -> f32 {
    let mut run = |samples: u32| {
        let mut trace = Trace::new(1e-3);
        let start = ticks::now();
        for _ in 0..samples {
            let (position, velocity) = trace.next();
            black_box(step(position, velocity));
        }
        ticks::between(start, ticks::now())
    };
    let (short, long) = (run(SAMPLES), run(2 * SAMPLES));
    (long - short) as f32 / ticks::of_an_instruction() / SAMPLES as f32
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct CBodies {
    w: [f32; BODIES],
    v: [f32; BODIES],
}

#[repr(C)]
#[derive(Default)]
struct CWorld {
    bodies: i32,
    rate: f32,
    limit: f32,
    own: [f32; 2],
    springs: [f32; BODIES],
    dampers: [f32; BODIES],
    from_z: CBodies,
    from_zdot: CBodies,
    from_w: [CBodies; BODIES],
    from_wdot: [CBodies; BODIES],
}

#[repr(C)]
#[derive(Default)]
struct CState {
    now: CBodies,
    change: CBodies,
}

type CStep = unsafe extern "C" fn(&CWorld, &mut CState, f32, f32) -> f32;

unsafe extern "C" {
    fn hapt_c_any(world: &CWorld, state: &mut CState, z: f32, zdot: f32) -> f32;
    fn hapt_c_1(world: &CWorld, state: &mut CState, z: f32, zdot: f32) -> f32;
    fn hapt_c_2(world: &CWorld, state: &mut CState, z: f32, zdot: f32) -> f32;
    fn hapt_c_4(world: &CWorld, state: &mut CState, z: f32, zdot: f32) -> f32;
}

/// C's loop: for the world's number of bodies, and for a number fixed at compile time.
fn in_c(spec: &Spec) -> [f32; 2] {
    let Ok(world) = Loop::<f32, BODIES, COUPLINGS, COUNTS>::new(spec) else { exit(4) };
    let c = matrices(spec, &world);
    let typed: CStep = match spec.bodies.len() {
        1 => hapt_c_1,
        2 => hapt_c_2,
        _ => hapt_c_4,
    };
    [hapt_c_any as CStep, typed].map(|function| {
        let function = black_box(function);
        let mut state = CState::default();
        // SAFETY: the structures are C's, field by field.
        agree(&world, |z, v| unsafe { function(&c, &mut state, z, v) });
        // SAFETY: as above.
        instructions(|z, v| unsafe { function(&c, &mut state, z, v) })
    })
}

/// hapt and C give the same bits.
fn agree(world: &Loop<f32, BODIES, COUPLINGS, COUNTS>, mut step: impl FnMut(f32, f32) -> f32) {
    let mut state = world.start();
    let mut trace = Trace::new(1e-3);
    for _ in 0..SAMPLES {
        let (z, v) = trace.next();
        if step(z, v).to_bits() != world.step(&mut state, z, v).command.to_bits() {
            exit(6);
        }
    }
}

/// The matrices follow from the loop itself: it is affine, and evaluated at unit vectors.
fn matrices(spec: &Spec, world: &Loop<f32, BODIES, COUPLINGS, COUNTS>) -> CWorld {
    let zero = world.start();
    let change = |state: &State<f32, BODIES, COUPLINGS, COUNTS>, z, v| {
        let mut state = *state;
        world.step(&mut state, z, v);
        CBodies { w: state.change.position, v: state.change.velocity }
    };
    let mut c = CWorld {
        bodies: spec.bodies.len() as i32,
        rate: (1.0 / spec.period) as f32,
        limit: spec.limit.map_or(f32::INFINITY, |limit| limit as f32),
        from_z: change(&zero, 1.0, 0.0),
        from_zdot: change(&zero, 0.0, 1.0),
        ..Default::default()
    };
    for j in 0..spec.bodies.len() {
        let (mut moved, mut turned) = (zero, zero);
        moved.now.position[j] = 1.0;
        turned.now.velocity[j] = 1.0;
        (c.from_w[j], c.from_wdot[j]) = (change(&moved, 0.0, 0.0), change(&turned, 0.0, 0.0));
    }
    let mut own = [0.0; 2];
    for coupling in spec.couplings {
        match (coupling.first, coupling.second, coupling.law) {
            (End::Puck, End::Body(i), Law::Spring { stiffness, .. }) => {
                c.springs[i] += stiffness as f32;
                own[0] -= stiffness;
            }
            (End::Puck, End::Body(i), Law::Damper { damping: Damping::Fixed(damping) }) => {
                c.dampers[i] += damping as f32;
                own[1] -= damping;
            }
            _ => {}
        }
    }
    c.own = own.map(|gain| gain as f32);
    c
}

fn number(file: &mut File) -> Option<u32> {
    let mut bytes = [0; 4];
    file.fill(&mut bytes).then(|| u32::from_le_bytes(bytes))
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let _ = writeln!(File::console(), "{info}");
    exit(101)
}
