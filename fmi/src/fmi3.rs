//! The functions of FMI 3.0 (fmi3Functions.h).
#![allow(unsafe_code)]
#![allow(clippy::missing_safety_doc)] // The pointers are those of the standard.
#![allow(missing_docs)] // The functions are those of the standard.

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::PathBuf;

use crate::Version;
use crate::c::{self, Component};
use crate::log::{Log, Status};

type Status3 = c_int;

/// `fmi3LogMessageCallback`
pub type Logger = unsafe extern "C" fn(*mut c_void, Status3, *const c_char, *const c_char);

/// The status in FMI 3.0: no call returns 2, Discard.
fn code(status: Status) -> Status3 {
    match status {
        Status::Ok => 0,
        Status::Warning => 1,
        Status::Error => 3,
        Status::Fatal => 4,
    }
}

unsafe fn call(c: *mut c_void, name: &str, body: impl FnOnce(&mut Component) -> Result<(), String>) -> Status3 {
    // SAFETY: as promised by the caller.
    code(unsafe { c::call(c, name, body) })
}

fn log(environment: *mut c_void, logger: Option<Logger>, is_on: bool) -> Log {
    let sink = move |status: Status, message: &str| {
        let category = CString::new(status.category()).unwrap_or_default();
        let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
        if let Some(logger) = logger {
            // SAFETY: the importer's own function and environment; all texts live until it returns.
            unsafe { logger(environment, code(status), category.as_ptr(), message.as_ptr()) };
        }
    };
    Log::new(Box::new(sink), is_on)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetDebugLogging(
    c: *mut c_void,
    on: bool,
    count: usize,
    categories: *const *const c_char,
) -> Status3 {
    unsafe {
        call(c, "fmi3SetDebugLogging", |component| {
            component.instance.log.set(on, &c::texts(categories, count, "categories")?)
        })
    }
}

/// An instance of a kind that this FMU does not have.
unsafe fn refused(kind: &str, environment: *mut c_void, logger: Option<Logger>) -> *mut c_void {
    c::instantiate(log(environment, logger, false), || c::not_here(kind))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    _instance_name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    logger: Option<Logger>,
) -> *mut c_void {
    unsafe { refused("model exchange", environment, logger) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    instance_name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    logging_on: bool,
    event_mode_used: bool,
    _early_return_allowed: bool,
    _intermediate_variables: *const u32,
    intermediate_count: usize,
    environment: *mut c_void,
    logger: Option<Logger>,
    _intermediate_update: *const c_void,
) -> *mut c_void {
    unsafe {
        c::instantiate(log(environment, logger, logging_on), || {
            if c::text(instance_name, "instanceName")?.is_empty() {
                return Err("fmi3InstantiateCoSimulation: the instance's name is empty".into());
            }
            if event_mode_used || intermediate_count > 0 {
                return Err("this FMU has neither event mode nor intermediate variables".into());
            }
            c::open(Version::Three, c::text(token, "the token")?, PathBuf::from(c::text(resources, "resourcePath")?))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    _instance_name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    logger: Option<Logger>,
    _clock_update: *const c_void,
    _lock_preemption: *const c_void,
    _unlock_preemption: *const c_void,
) -> *mut c_void {
    unsafe { refused("scheduled execution", environment, logger) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(c: *mut c_void) {
    unsafe { c::free(c) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3EnterInitializationMode(
    c: *mut c_void,
    _tolerance_defined: bool,
    _tolerance: f64,
    start: f64,
    stop_defined: bool,
    stop: f64,
) -> Status3 {
    unsafe {
        call(c, "fmi3EnterInitializationMode", |component| {
            component.instance.set_up(start, stop_defined.then_some(stop))?;
            component.instance.enter_initialization()
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3ExitInitializationMode(c: *mut c_void) -> Status3 {
    unsafe { call(c, "fmi3ExitInitializationMode", |component| component.instance.exit_initialization()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Terminate(c: *mut c_void) -> Status3 {
    unsafe { call(c, "fmi3Terminate", |component| component.instance.terminate()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Reset(c: *mut c_void) -> Status3 {
    unsafe { call(c, "fmi3Reset", |component| component.instance.reset()) }
}

/// Variables are scalars: as many values as references.
fn scalars(references: usize, values: usize) -> Result<usize, String> {
    if references == values {
        return Ok(values);
    }
    Err(format!("{values} values for {references} value references: every variable is a scalar"))
}

/// Reading and setting numbers of a type that variables have.
macro_rules! numbers {
    ($($get:ident, $set:ident: $type:ty;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(
            c: *mut c_void,
            references: *const u32,
            count: usize,
            values: *mut $type,
            value_count: usize,
        ) -> Status3 {
            unsafe {
                call(c, stringify!($get), |component| {
                    c::get(component, references, scalars(count, value_count)?, values)
                })
            }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            c: *mut c_void,
            references: *const u32,
            count: usize,
            values: *const $type,
            value_count: usize,
        ) -> Status3 {
            unsafe {
                call(c, stringify!($set), |component| {
                    c::set(component, references, scalars(count, value_count)?, values)
                })
            }
        }
    )*};
}

numbers! {
    fmi3GetFloat64, fmi3SetFloat64: f64;
    fmi3GetInt64, fmi3SetInt64: i64;
}

/// Reading and setting variables of a type that no variable has.
macro_rules! no_numbers {
    ($($get:ident, $set:ident: $name:literal, $type:ty;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(
            c: *mut c_void,
            _references: *const u32,
            count: usize,
            _values: *mut $type,
            _value_count: usize,
        ) -> Status3 {
            unsafe { call(c, stringify!($get), |_| c::none_of($name, count)) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            c: *mut c_void,
            _references: *const u32,
            count: usize,
            _values: *const $type,
            _value_count: usize,
        ) -> Status3 {
            unsafe { call(c, stringify!($set), |_| c::none_of($name, count)) }
        }
    )*};
}

no_numbers! {
    fmi3GetFloat32, fmi3SetFloat32: "Float32", f32;
    fmi3GetInt8, fmi3SetInt8: "Int8", i8;
    fmi3GetUInt8, fmi3SetUInt8: "UInt8", u8;
    fmi3GetInt16, fmi3SetInt16: "Int16", i16;
    fmi3GetUInt16, fmi3SetUInt16: "UInt16", u16;
    fmi3GetInt32, fmi3SetInt32: "Int32", i32;
    fmi3GetUInt32, fmi3SetUInt32: "UInt32", u32;
    fmi3GetUInt64, fmi3SetUInt64: "UInt64", u64;
    fmi3GetBoolean, fmi3SetBoolean: "Boolean", bool;
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetString(
    c: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut *const c_char,
    value_count: usize,
) -> Status3 {
    unsafe {
        call(c, "fmi3GetString", |component| c::get_texts(component, references, scalars(count, value_count)?, values))
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetString(
    c: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const *const c_char,
    value_count: usize,
) -> Status3 {
    unsafe {
        call(c, "fmi3SetString", |component| c::set_texts(component, references, scalars(count, value_count)?, values))
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetNumberOfVariableDependencies(c: *mut c_void, _: u32, _: *mut usize) -> Status3 {
    unsafe {
        call(c, "fmi3GetNumberOfVariableDependencies", |_| Err("dependencies are in the model description".into()))
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetVariableDependencies(
    c: *mut c_void,
    _: u32,
    _: *mut usize,
    _: *mut u32,
    _: *mut usize,
    _: *mut c_int,
    _: usize,
) -> Status3 {
    unsafe { call(c, "fmi3GetVariableDependencies", |_| Err("dependencies are in the model description".into())) }
}

c::saved_states! {
    Status3: fmi3GetFMUState, fmi3SetFMUState, fmi3FreeFMUState, fmi3SerializedFMUStateSize, fmi3SerializeFMUState, fmi3DeserializeFMUState
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetDirectionalDerivative(
    c: *mut c_void,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> Status3 {
    unsafe {
        call(c, "fmi3GetDirectionalDerivative", |component| {
            c::Derivative {
                unknowns: (unknowns, unknown_count),
                knowns: (knowns, known_count),
                seed: (seed, scalars(known_count, seed_count)?),
                sensitivity: (sensitivity, scalars(unknown_count, sensitivity_count)?),
            }
            .directional(component)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetAdjointDerivative(
    c: *mut c_void,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> Status3 {
    unsafe {
        call(c, "fmi3GetAdjointDerivative", |component| {
            c::Derivative {
                unknowns: (unknowns, unknown_count),
                knowns: (knowns, known_count),
                seed: (seed, scalars(unknown_count, seed_count)?),
                sensitivity: (sensitivity, scalars(known_count, sensitivity_count)?),
            }
            .adjoint(component)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    c: *mut c_void,
    at: f64,
    length: f64,
    _no_set_prior: bool,
    event_handling_needed: *mut bool,
    terminate_simulation: *mut bool,
    early_return: *mut bool,
    last_successful_time: *mut f64,
) -> Status3 {
    unsafe {
        call(c, "fmi3DoStep", |component| {
            let done = component.instance.do_step(at, length);
            for flag in [event_handling_needed, terminate_simulation, early_return] {
                c::put(flag, false);
            }
            c::put(last_successful_time, component.instance.time());
            done
        })
    }
}

/// The functions of features that this FMU does not have; importers load them with all others.
macro_rules! not_here {
    ($($name:ident($($argument:ty),*) of $kind:literal;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(c: *mut c_void, $(_: $argument),*) -> Status3 {
            unsafe { call(c, stringify!($name), |_| c::not_here($kind)) }
        }
    )*};
}

not_here! {
    fmi3GetBinary(*const u32, usize, *mut usize, *mut *const u8, usize) of "binary variables";
    fmi3SetBinary(*const u32, usize, *const usize, *const *const u8, usize) of "binary variables";
    fmi3GetClock(*const u32, usize, *mut bool) of "clocks";
    fmi3SetClock(*const u32, usize, *const bool) of "clocks";
    fmi3EnterConfigurationMode() of "structural parameters";
    fmi3ExitConfigurationMode() of "structural parameters";
    fmi3GetIntervalDecimal(*const u32, usize, *mut f64, *mut c_int) of "clocks";
    fmi3GetIntervalFraction(*const u32, usize, *mut u64, *mut u64, *mut c_int) of "clocks";
    fmi3GetShiftDecimal(*const u32, usize, *mut f64) of "clocks";
    fmi3GetShiftFraction(*const u32, usize, *mut u64, *mut u64) of "clocks";
    fmi3SetIntervalDecimal(*const u32, usize, *const f64) of "clocks";
    fmi3SetIntervalFraction(*const u32, usize, *const u64, *const u64) of "clocks";
    fmi3SetShiftDecimal(*const u32, usize, *const f64) of "clocks";
    fmi3SetShiftFraction(*const u32, usize, *const u64, *const u64) of "clocks";
    fmi3EnterEventMode() of "event mode";
    fmi3EvaluateDiscreteStates() of "event mode";
    fmi3UpdateDiscreteStates(*mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64) of "event mode";
    fmi3EnterStepMode() of "event mode";
    fmi3EnterContinuousTimeMode() of "model exchange";
    fmi3CompletedIntegratorStep(bool, *mut bool, *mut bool) of "model exchange";
    fmi3SetTime(f64) of "model exchange";
    fmi3SetContinuousStates(*const f64, usize) of "model exchange";
    fmi3GetContinuousStateDerivatives(*mut f64, usize) of "model exchange";
    fmi3GetEventIndicators(*mut f64, usize) of "model exchange";
    fmi3GetContinuousStates(*mut f64, usize) of "model exchange";
    fmi3GetNominalsOfContinuousStates(*mut f64, usize) of "model exchange";
    fmi3GetNumberOfEventIndicators(*mut usize) of "model exchange";
    fmi3GetNumberOfContinuousStates(*mut usize) of "model exchange";
    fmi3GetOutputDerivatives(*const u32, usize, *const i32, *mut f64, usize) of "output derivatives";
    fmi3ActivateModelPartition(u32, f64) of "scheduled execution";
}
