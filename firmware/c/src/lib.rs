//! hapt's loop and supervisor for firmware in C. `hapt.h` describes the functions; this is their implementation.
#![no_std]

use core::ffi::{c_int, c_uint};
use core::mem::{align_of, size_of};
use core::slice;

use hapt_core::{Controller, ControllerState, Phase, Reading, Reason, Request};
use hapt_wire::unpack;

const BODIES: usize = 4;
const COUPLINGS: usize = 8;
const COUNTS: usize = 17;

/// `struct hapt`
#[repr(C, align(8))]
pub struct Room([u8; 4096]);

/// Its contents.
#[repr(C)]
struct Running {
    /// `LOADED`, and nothing else that a program might have in its memory.
    loaded: u32,
    controller: Controller<f32, BODIES, COUPLINGS, COUNTS>,
    state: ControllerState<f32, BODIES, COUPLINGS, COUNTS>,
}

/// `HAPT_FAULT`
const FAULT: c_uint = 5;

const LOADED: u32 = 0x7470_6168;
const _: () = assert!(size_of::<Running>() <= size_of::<Room>() && align_of::<Running>() <= align_of::<Room>());

/// `struct hapt_reading`
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CReading {
    position: f32,
    velocity: f32,
    late: f32,
    silent: f32,
    missed: c_uint,
    request: c_uint,
}

/// `struct hapt_guarded`
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct CGuarded {
    output: f32,
    torque: f32,
    phase: c_int,
    reason: c_int,
}

fn running<'a>(hapt: *mut Room) -> Option<&'a mut Running> {
    // SAFETY: the caller gives its own `struct hapt` or null, to one call at a time; its bytes are zeros or what `hapt_load` wrote. Until
    // the mark is there, only the mark is looked at, which any bytes make a number.
    unsafe {
        let running = hapt.cast::<Running>();
        let is_loaded = !running.is_null() && (&raw const (*running).loaded).read() == LOADED;
        if is_loaded { Some(&mut *running) } else { None }
    }
}

/// See `hapt.h`.
///
/// # Safety
/// `bytes` are `length` bytes, and `hapt` is a `struct hapt` of the caller's, which no other call is using.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hapt_load(hapt: *mut Room, bytes: *const u8, length: usize) -> c_int {
    if hapt.is_null() || bytes.is_null() {
        return -1;
    }
    // SAFETY: the caller says so.
    let bytes = unsafe { slice::from_raw_parts(bytes, length) };
    let Ok((limits, stored)) = unpack::<BODIES, COUPLINGS>(bytes) else { return -1 };
    let Ok(controller) = Controller::new(&stored.spec(), &limits) else { return -2 };
    let state = controller.start();
    // SAFETY: the room is the caller's, large enough and aligned (asserted above), and nothing refers to it.
    unsafe { hapt.cast::<Running>().write(Running { loaded: LOADED, controller, state }) };
    0
}

/// See `hapt.h`.
///
/// # Safety
/// As for [`hapt_guard`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hapt_step(hapt: *mut Room, position: f32, velocity: f32) -> f32 {
    let Some(Running { controller, state, .. }) = running(hapt) else { return 0.0 };
    controller.world().step(&mut state.world, position, velocity).command
}

/// See `hapt.h`.
///
/// # Safety
/// `hapt` and `reading` are the caller's, and no other call is using them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hapt_guard(hapt: *mut Room, reading: *const CReading) -> CGuarded {
    if reading.is_null() {
        return CGuarded::default();
    }
    // SAFETY: the caller says so.
    let CReading { position, velocity, late, silent, missed, request } = unsafe { *reading };
    let Some(Running { controller, state, .. }) = running(hapt) else { return CGuarded::default() };
    let reading = Reading { position, velocity, announced: false, late, missed, silent };
    if request == FAULT {
        state.trip(Reason::Driver);
    }
    let request = match request {
        1 => Some(Request::Arm),
        2 => Some(Request::Disarm),
        3 => Some(Request::Stop),
        4 => Some(Request::Clear),
        _ => None,
    };
    let guarded = controller.step(state, &reading, request);
    CGuarded {
        output: guarded.output,
        torque: guarded.sample.torque,
        phase: Phase::ALL.iter().position(|phase| *phase == guarded.phase).map_or(0, |phase| phase as c_int),
        reason: guarded.reason.map_or(0, Reason::code).into(),
    }
}

/// See `hapt.h`.
///
/// # Safety
/// As for [`hapt_guard`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hapt_body(hapt: *mut Room, body: c_uint, velocity: *mut f32) -> f32 {
    let Some(Running { state, .. }) = running(hapt) else { return 0.0 };
    let body = body as usize;
    if let Some(v) = state.world.now.velocity.get(body) {
        // SAFETY: null, or a float of the caller's.
        if let Some(place) = unsafe { velocity.as_mut() } {
            *place = *v;
        }
    }
    state.world.now.position.get(body).copied().unwrap_or(0.0)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
