//! Calls in any order, with any arguments: no crash, and a refused call changes nothing.

use std::ffi::{c_int, c_void};
use std::ptr::{null, null_mut};

use hapt_fmi::{Kind, Version, fmi2, fmi3};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use crate::fmu::{Fmu, Instance, WHEEL, world};

/// A call with its arguments.
#[derive(Clone, Debug)]
enum Call {
    SetUp(f64, Option<f64>),
    Enter,
    Exit,
    Step(f64, f64),
    /// The next step, from the instance's time.
    Next(f64),
    Terminate,
    Reset,
    Get(Vec<u32>),
    Set(Vec<(u32, f64)>),
    Text(u32, String),
    Save,
    Restore,
    Derivative(Vec<u32>, Vec<u32>),
    Other(usize),
    Log(bool, String),
}

/// Numbers of all kinds, valid ones among them.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -1.0_f64..1.0,
        2 => prop::sample::select(vec![0.0, -0.0, 1e-3, 2.5e-3, 1e300, -1e300, 1e-300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        1 => any::<f64>(),
    ]
}

fn call() -> impl Strategy<Value = Call> {
    let reference = || prop_oneof![8 => 0_u32..30, 1 => any::<u32>()];
    let references = move || prop::collection::vec(reference(), 0..5);
    prop_oneof![
        1 => (number(), prop::option::of(number())).prop_map(|(start, stop)| Call::SetUp(start, stop)),
        2 => Just(Call::Enter),
        2 => Just(Call::Exit),
        1 => (number(), number()).prop_map(|(at, length)| Call::Step(at, length)),
        4 => (1e-5_f64..5e-3).prop_map(Call::Next),
        1 => Just(Call::Terminate),
        1 => Just(Call::Reset),
        3 => references().prop_map(Call::Get),
        4 => prop::collection::vec((reference(), number()), 0..4).prop_map(Call::Set),
        1 => (reference(), prop::sample::select(vec!["zoh", "tustin", "start", "exact", "", "x\ny", "%s%n"]))
            .prop_map(|(reference, text)| Call::Text(reference, text.into())),
        2 => Just(Call::Save),
        2 => Just(Call::Restore),
        1 => (references(), references()).prop_map(|(unknowns, knowns)| Call::Derivative(unknowns, knowns)),
        1 => (0_usize..20).prop_map(Call::Other),
        1 => (any::<bool>(), prop::sample::select(vec!["logAll", "logEvents", "nothing"]))
            .prop_map(|(on, name)| Call::Log(on, name.into())),
    ]
}

fn make(instance: &Instance, call: &Call, state: &mut *mut c_void) {
    match call {
        Call::SetUp(start, stop) => {
            let _ = instance.set_up(*start, *stop);
        }
        Call::Enter => {
            let _ = instance.enter();
        }
        Call::Exit => {
            let _ = instance.exit();
        }
        Call::Step(at, length) => {
            let _ = length.abs() < 10.0 && instance.step(*at, *length);
        }
        Call::Next(length) => {
            let _ = instance.step(instance.get("time_s"), *length);
        }
        Call::Terminate => {
            let _ = instance.terminate();
        }
        Call::Reset => {
            let _ = instance.reset();
        }
        Call::Get(references) => {
            let _ = instance.get_all(references);
        }
        Call::Set(pairs) => {
            let (references, values): (Vec<u32>, Vec<f64>) = pairs.iter().copied().unzip();
            let before = (instance.save(), instance.outputs());
            let earlier = instance.serialize(before.0);
            if !instance.set_all(&references, &values) {
                let after = instance.save();
                assert_eq!(instance.serialize(after), earlier, "a refused call changed something");
                instance.free(after);
            }
            instance.free(before.0);
        }
        Call::Text(reference, text) => {
            if let Some(variable) = instance.fmu.model.variables.get(*reference as usize) {
                let _ = instance.set_text(&variable.name, text);
            }
        }
        Call::Save => {
            if !state.is_null() {
                instance.free(*state);
            }
            *state = instance.save();
        }
        Call::Restore => {
            let _ = instance.restore(*state);
        }
        Call::Derivative(unknowns, knowns) => {
            let _ = instance.derivative(unknowns, knowns, &vec![1.0; knowns.len()]);
        }
        Call::Other(which) => other(instance, *which),
        Call::Log(on, name) => {
            let name = std::ffi::CString::new(name.as_str()).unwrap();
            let names = [name.as_ptr()];
            match instance.version {
                Version::Two => unsafe { fmi2::fmi2SetDebugLogging(instance.c, c_int::from(*on), 1, names.as_ptr()) },
                Version::Three => unsafe { fmi3::fmi3SetDebugLogging(instance.c, *on, 1, names.as_ptr()) },
            };
        }
    }
}

/// Null pointers, and functions of features that the FMU does not have: all are errors.
fn other(instance: &Instance, which: usize) {
    let c = instance.c;
    let status = unsafe {
        match (instance.version, which) {
            (Version::Two, 0) => fmi2::fmi2GetReal(c, null(), 1, null_mut()),
            (Version::Two, 1) => fmi2::fmi2GetReal(c, [1].as_ptr(), 1, null_mut()),
            (Version::Two, 2) => fmi2::fmi2SetReal(c, null(), 3, [1.0].as_ptr()),
            (Version::Two, 3) => fmi2::fmi2SetString(c, [1].as_ptr(), 1, [null()].as_ptr()),
            (Version::Two, 4) => fmi2::fmi2GetFMUstate(c, null_mut()),
            (Version::Two, 5) => fmi2::fmi2SetFMUstate(c, null_mut()),
            (Version::Two, 6) => fmi2::fmi2SerializeFMUstate(c, null_mut(), null_mut(), 8),
            (Version::Two, 7) => fmi2::fmi2DeSerializeFMUstate(c, null(), 8, &mut null_mut()),
            (Version::Two, 8) => fmi2::fmi2SetTime(c, 0.0),
            (Version::Two, 9) => fmi2::fmi2CancelStep(c),
            (Version::Two, 10) => fmi2::fmi2GetBoolean(c, [1].as_ptr(), 1, null_mut()),
            (Version::Two, 11) => fmi2::fmi2GetReal(c, [1].as_ptr(), usize::MAX, [0.0].as_mut_ptr()),
            (Version::Two, 12) => fmi2::fmi2GetReal(null_mut(), null(), 0, null_mut()),
            (Version::Two, 13) => fmi2::fmi2SetDebugLogging(c, 1, 2, null()),
            (Version::Two, _) => fmi2::fmi2SetRealInputDerivatives(c, null(), 0, null(), null()),
            (Version::Three, 0) => fmi3::fmi3GetFloat64(c, null(), 1, null_mut(), 1),
            (Version::Three, 1) => fmi3::fmi3GetFloat64(c, [1].as_ptr(), 1, [0.0].as_mut_ptr(), 2),
            (Version::Three, 2) => fmi3::fmi3SetFloat64(c, null(), 3, [1.0].as_ptr(), 3),
            (Version::Three, 3) => fmi3::fmi3SetString(c, [1].as_ptr(), 1, [null()].as_ptr(), 1),
            (Version::Three, 4) => fmi3::fmi3GetFMUState(c, null_mut()),
            (Version::Three, 5) => fmi3::fmi3SetFMUState(c, null_mut()),
            (Version::Three, 6) => fmi3::fmi3SerializeFMUState(c, null_mut(), null_mut(), 8),
            (Version::Three, 7) => fmi3::fmi3DeserializeFMUState(c, null(), 8, &mut null_mut()),
            (Version::Three, 8) => fmi3::fmi3EnterEventMode(c),
            (Version::Three, 9) => fmi3::fmi3GetClock(c, null(), 0, null_mut()),
            (Version::Three, 10) => fmi3::fmi3GetBoolean(c, [1].as_ptr(), 1, null_mut(), 1),
            (Version::Three, 11) => fmi3::fmi3GetFloat64(c, [1].as_ptr(), usize::MAX, [0.0].as_mut_ptr(), usize::MAX),
            (Version::Three, 12) => {
                fmi3::fmi3DoStep(null_mut(), 0.0, 1.0, false, null_mut(), null_mut(), null_mut(), null_mut())
            }
            (Version::Three, _) => fmi3::fmi3ActivateModelPartition(c, 0, 0.0),
        }
    };
    assert_eq!(status, 3, "{which}");
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn any_calls_in_any_order_come_back(
        calls in prop::collection::vec(call(), 0..80), three in any::<bool>(), whole in any::<bool>(),
    ) {
        let kind = if whole { Kind::Whole } else { Kind::Loop };
        let version = if three { Version::Three } else { Version::Two };
        let fmu = Fmu::new(kind, &world(WHEEL, &[]));
        let (one, other) = (fmu.instance(version), fmu.instance(version));
        let mut states = [null_mut(), null_mut()];
        for (k, call) in calls.iter().enumerate() {
            make(if k % 2 == 0 { &one } else { &other }, call, &mut states[k % 2]);
        }
        for (state, instance) in states.into_iter().zip([&one, &other]) {
            if !state.is_null() {
                instance.free(state);
            }
        }
    }
}

#[test]
fn calls_out_of_order_are_errors_that_name_the_state() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let instance = fmu.instance(Version::Two);
    let refused = |done: bool, words: &str| {
        assert!(!done && instance.message().contains(words), "{words:?} in {:?}", instance.message());
    };
    refused(instance.step(0.0, 1e-3), "DoStep is out of order: the instance is instantiated");
    refused(instance.exit(), "ExitInitializationMode is out of order");
    refused(instance.terminate(), "Terminate is out of order");
    refused(instance.set_up(f64::NAN, None), "the start time is NaN");
    refused(instance.set_up(1.0, Some(0.0)), "the stop time 0 s is not after the start time 1 s");
    assert!(instance.set_up(0.0, Some(0.01)) && instance.enter());
    refused(instance.enter(), "EnterInitializationMode is out of order: the instance is in initialization mode");
    assert!(instance.exit());
    refused(instance.step(0.0, -1e-3), "the communication step is -0.001 s, and must be a finite time above 0");
    refused(instance.step(0.0, 0.0), "above 0");
    refused(instance.step(0.0, f64::NAN), "above 0");
    refused(instance.step(f64::NAN, 1e-3), "the step begins at NaN s");
    assert!(instance.step(0.0, 5e-3));
    refused(instance.step(0.0, 1e-3), "must begin at 0.005 s, where the last one ended; a saved FMU state goes back");
    refused(instance.step(0.006, 1e-3), "must begin at 0.005 s");
    refused(instance.step(0.005, 6e-3), "after the stop time 0.01 s");
    assert!(instance.step(0.005, 5e-3) && instance.terminate());
    refused(instance.step(0.01, 1e-3), "the instance is terminated");
    refused(instance.set("hand_torque_Nm", 1.0), "hand_torque_Nm cannot be set: the instance is terminated");
    assert!(instance.outputs().iter().all(|value| value.is_finite()));
    let long = fmu.instance(Version::Three);
    long.start(0.0);
    assert!(!long.step(0.0, 1e9) && long.message().contains("at most 10^10"), "{}", long.message());
}

#[test]
fn an_unstable_loop_fails_with_its_instant_and_goes_back_to_a_state() {
    let text =
        WHEEL.replace("limit = \"822.25 N mm\"\n", "").replace("levels = 2048\n", "").replace("encoder = 4000\n", "");
    let text = text.replace("17.8 N mm/deg", "1e6 N m/rad");
    let fmu = Fmu::new(Kind::Whole, &world(&text, &["loop.method=forward-euler", "loop.output=start"]));
    let instance = fmu.instance(Version::Two);
    instance.start(0.0);
    let state = instance.save();
    assert!(instance.set("hand_torque_Nm", 0.1));
    let mut k = 0;
    while instance.step(f64::from(k) * 1e-3, 1e-3) {
        k += 1;
        assert!(k < 100_000, "it never runs away");
    }
    assert!(instance.message().contains("the run stops being finite at t = "), "{}", instance.message());
    assert!(!instance.step(f64::from(k) * 1e-3, 1e-3) && instance.message().contains("the instance is failed"));
    assert!(instance.restore(state) && instance.step(0.0, 1e-3));
    instance.free(state);
}
