//! The functions of FMI 2.0 (fmi2Functions.h), in the order of the standard.
#![allow(unsafe_code)]
#![allow(clippy::missing_safety_doc)] // The pointers are those of the standard.
#![allow(missing_docs)] // The functions are those of the standard.

use std::ffi::{CString, c_char, c_int, c_void};

use crate::Version;
use crate::c::{self, Component};
use crate::log::{Log, Status};

type Status2 = c_int;
type Boolean = c_int;

/// `fmi2CallbackLogger`
pub type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, Status2, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`. Rust allocates its own memory; no step is asynchronous.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CallbackFunctions {
    pub logger: Option<Logger>,
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, Status2)>,
    pub component_environment: *mut c_void,
}

/// `fmi2EventInfo`
#[repr(C)]
pub struct EventInfo {
    pub new_discrete_states_needed: Boolean,
    pub terminate_simulation: Boolean,
    pub nominals_changed: Boolean,
    pub values_changed: Boolean,
    pub next_event_time_defined: Boolean,
    pub next_event_time: f64,
}

/// The status in FMI 2.0: no call returns 2, Discard.
fn code(status: Status) -> Status2 {
    match status {
        Status::Ok => 0,
        Status::Warning => 1,
        Status::Error => 3,
        Status::Fatal => 4,
    }
}

unsafe fn call(c: *mut c_void, name: &str, body: impl FnOnce(&mut Component) -> Result<(), String>) -> Status2 {
    // SAFETY: as promised by the caller.
    code(unsafe { c::call(c, name, body) })
}

/// The importer's logger, whose messages are printf formats.
fn log(name: &str, functions: &CallbackFunctions, is_on: bool) -> Log {
    let (logger, environment) = (functions.logger, functions.component_environment);
    let name = CString::new(name).unwrap_or_default();
    let sink = move |status: Status, message: &str| {
        let category = CString::new(status.category()).unwrap_or_default();
        let message = CString::new(message.replace('%', "%%").replace('\0', " ")).unwrap_or_default();
        if let Some(logger) = logger {
            // SAFETY: the importer's own function and environment; all texts live until it returns.
            unsafe { logger(environment, name.as_ptr(), code(status), category.as_ptr(), message.as_ptr()) };
        }
    };
    Log::new(Box::new(sink), is_on)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetDebugLogging(
    c: *mut c_void,
    on: Boolean,
    count: usize,
    categories: *const *const c_char,
) -> Status2 {
    unsafe {
        call(c, "fmi2SetDebugLogging", |component| {
            component.instance.log.set(on != 0, &c::texts(categories, count, "categories")?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    instance_name: *const c_char,
    fmu_type: c_int,
    guid: *const c_char,
    resources: *const c_char,
    functions: *const CallbackFunctions,
    _visible: Boolean,
    logging_on: Boolean,
) -> *mut c_void {
    unsafe {
        let Some(functions) = functions.as_ref() else { return std::ptr::null_mut() };
        let name = c::text(instance_name, "instanceName");
        let log = log(name.as_deref().unwrap_or_default(), functions, logging_on != 0);
        c::instantiate(log, || {
            if name?.is_empty() {
                return Err("fmi2Instantiate: the instance's name is empty".into());
            }
            if fmu_type != 1 {
                return c::not_here("model exchange");
            }
            c::open(Version::Two, c::text(guid, "the guid")?, c::folder(c::text(resources, "fmuResourceLocation")?)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(c: *mut c_void) {
    unsafe { c::free(c) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetupExperiment(
    c: *mut c_void,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start: f64,
    stop_defined: Boolean,
    stop: f64,
) -> Status2 {
    unsafe {
        call(c, "fmi2SetupExperiment", |component| {
            component.instance.set_up(start, (stop_defined != 0).then_some(stop))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2EnterInitializationMode(c: *mut c_void) -> Status2 {
    unsafe { call(c, "fmi2EnterInitializationMode", |component| component.instance.enter_initialization()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2ExitInitializationMode(c: *mut c_void) -> Status2 {
    unsafe { call(c, "fmi2ExitInitializationMode", |component| component.instance.exit_initialization()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Terminate(c: *mut c_void) -> Status2 {
    unsafe { call(c, "fmi2Terminate", |component| component.instance.terminate()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Reset(c: *mut c_void) -> Status2 {
    unsafe { call(c, "fmi2Reset", |component| component.instance.reset()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(c: *mut c_void, vr: *const u32, count: usize, values: *mut f64) -> Status2 {
    unsafe { call(c, "fmi2GetReal", |component| c::get(component, vr, count, values)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetInteger(c: *mut c_void, vr: *const u32, count: usize, values: *mut i32) -> Status2 {
    unsafe { call(c, "fmi2GetInteger", |component| c::get(component, vr, count, values)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBoolean(c: *mut c_void, _: *const u32, count: usize, _: *mut Boolean) -> Status2 {
    unsafe { call(c, "fmi2GetBoolean", |_| c::none_of("Boolean", count)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetString(
    c: *mut c_void,
    vr: *const u32,
    count: usize,
    values: *mut *const c_char,
) -> Status2 {
    unsafe { call(c, "fmi2GetString", |component| c::get_texts(component, vr, count, values)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(c: *mut c_void, vr: *const u32, count: usize, values: *const f64) -> Status2 {
    unsafe { call(c, "fmi2SetReal", |component| c::set(component, vr, count, values)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetInteger(c: *mut c_void, vr: *const u32, count: usize, values: *const i32) -> Status2 {
    unsafe { call(c, "fmi2SetInteger", |component| c::set(component, vr, count, values)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetBoolean(c: *mut c_void, _: *const u32, count: usize, _: *const Boolean) -> Status2 {
    unsafe { call(c, "fmi2SetBoolean", |_| c::none_of("Boolean", count)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetString(
    c: *mut c_void,
    vr: *const u32,
    count: usize,
    values: *const *const c_char,
) -> Status2 {
    unsafe { call(c, "fmi2SetString", |component| c::set_texts(component, vr, count, values)) }
}

c::saved_states! {
    Status2: fmi2GetFMUstate, fmi2SetFMUstate, fmi2FreeFMUstate, fmi2SerializedFMUstateSize, fmi2SerializeFMUstate, fmi2DeSerializeFMUstate
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: *mut c_void,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    sensitivity: *mut f64,
) -> Status2 {
    unsafe {
        call(c, "fmi2GetDirectionalDerivative", |component| {
            c::Derivative {
                unknowns: (unknowns, unknown_count),
                knowns: (knowns, known_count),
                seed: (seed, known_count),
                sensitivity: (sensitivity, unknown_count),
            }
            .directional(component)
        })
    }
}

/// The functions of model exchange, which importers load with all others.
macro_rules! model_exchange {
    ($($name:ident($($argument:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(c: *mut c_void, $(_: $argument),*) -> Status2 {
            unsafe { call(c, stringify!($name), |_| c::not_here("model exchange")) }
        }
    )*};
}

model_exchange! {
    fmi2EnterEventMode();
    fmi2NewDiscreteStates(*mut EventInfo);
    fmi2EnterContinuousTimeMode();
    fmi2CompletedIntegratorStep(Boolean, *mut Boolean, *mut Boolean);
    fmi2SetTime(f64);
    fmi2SetContinuousStates(*const f64, usize);
    fmi2GetDerivatives(*mut f64, usize);
    fmi2GetEventIndicators(*mut f64, usize);
    fmi2GetContinuousStates(*mut f64, usize);
    fmi2GetNominalsOfContinuousStates(*mut f64, usize);
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetRealInputDerivatives(
    c: *mut c_void,
    _: *const u32,
    _: usize,
    _: *const c_int,
    _: *const f64,
) -> Status2 {
    unsafe { call(c, "fmi2SetRealInputDerivatives", |_| Err("inputs are held, not interpolated".into())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealOutputDerivatives(
    c: *mut c_void,
    _: *const u32,
    _: usize,
    _: *const c_int,
    _: *mut f64,
) -> Status2 {
    unsafe { call(c, "fmi2GetRealOutputDerivatives", |_| Err("outputs have no derivatives in time".into())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2DoStep(c: *mut c_void, at: f64, length: f64, _no_set_prior: Boolean) -> Status2 {
    unsafe { call(c, "fmi2DoStep", |component| component.instance.do_step(at, length)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2CancelStep(c: *mut c_void) -> Status2 {
    unsafe { call(c, "fmi2CancelStep", |_| Err("no step is asynchronous".into())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetStatus(c: *mut c_void, _kind: c_int, _value: *mut Status2) -> Status2 {
    unsafe { call(c, "fmi2GetStatus", |_| Err("no step is asynchronous".into())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealStatus(c: *mut c_void, kind: c_int, value: *mut f64) -> Status2 {
    unsafe {
        call(c, "fmi2GetRealStatus", |component| {
            // fmi2LastSuccessfulTime
            if kind != 2 {
                return Err(format!("there is no status {kind} of type Real"));
            }
            c::put(value, component.instance.time());
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetIntegerStatus(c: *mut c_void, kind: c_int, _: *mut c_int) -> Status2 {
    unsafe { call(c, "fmi2GetIntegerStatus", |_| Err(format!("there is no status {kind} of type Integer"))) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBooleanStatus(c: *mut c_void, kind: c_int, value: *mut Boolean) -> Status2 {
    unsafe {
        call(c, "fmi2GetBooleanStatus", |_| {
            // fmi2Terminated: the FMU never ends a simulation by itself.
            if kind != 3 {
                return Err(format!("there is no status {kind} of type Boolean"));
            }
            c::put(value, 0);
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetStringStatus(c: *mut c_void, kind: c_int, _: *mut *const c_char) -> Status2 {
    unsafe { call(c, "fmi2GetStringStatus", |_| Err(format!("there is no status {kind} of type String"))) }
}
