//! An importer: an FMU's resources in a folder, and the calls of either version under one name.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};
use std::rc::Rc;

use hapt_fmi::fmi2::{self, CallbackFunctions};
use hapt_fmi::{Kind, Model, Version, fmi3};
use hapt_model::{Source, World};
use tempfile::TempDir;

/// The notes' wheel on a device with friction and a delay of less than a period.
pub const WHEEL: &str = r#"
title = "Wheel"
loop = { period = "1 ms", delay = "0.3 ms" }
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "2 N mm"
limit = "822.25 N mm"
encoder = 4000
levels = 2048
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[[couplings]]
kind = "wall"
side = "above"
between = ["puck", "ground"]
stiffness = "20 N mm/deg"
at = "20 deg"
[scenarios.push]
duration = "0.3 s"
hand = { kind = "torque", moves = { kind = "step", to = "60 N mm" }, release = "0.2 s" }
"#;

pub fn world(text: &str, sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    World::read(&Source::from_text("test.toml", text), &sets).unwrap()
}

/// Messages of the instance's logger.
pub type Messages = Rc<RefCell<Vec<String>>>;

unsafe extern "C" fn log3(environment: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    unsafe {
        let messages = &*environment.cast::<RefCell<Vec<String>>>();
        messages.borrow_mut().push(CStr::from_ptr(message).to_str().unwrap().to_string());
    }
}

// A function with arguments of C's `...` cannot be written in Rust; the fixed ones are all that the FMU passes.
unsafe extern "C" fn log2(
    environment: *mut c_void,
    _: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    unsafe { log3(environment, status, category, message) }
}

/// An unpacked FMU.
pub struct Fmu {
    pub model: Model,
    /// The token of FMI 2.0 and of FMI 3.0.
    pub tokens: [String; 2],
    folder: TempDir,
}

impl Fmu {
    pub fn new(kind: Kind, world: &World) -> Fmu {
        let [two, model] = [Version::Two, Version::Three].map(|version| Model::new(kind, version, world).unwrap());
        let tokens = [two.token, model.token.clone()];
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("world.toml"), &model.source.text).unwrap();
        Fmu { model, tokens, folder }
    }

    pub fn instance(&self, version: Version) -> Instance<'_> {
        let messages = Messages::default();
        let c = self.raw(version, self.token(version), &messages);
        assert!(!c.is_null(), "{:?}", messages.borrow());
        Instance { c, version, fmu: self, messages }
    }

    pub fn token(&self, version: Version) -> &str {
        &self.tokens[usize::from(version == Version::Three)]
    }

    /// With this token; null where the instance is refused.
    pub fn raw(&self, version: Version, token: &str, messages: &Messages) -> *mut c_void {
        let folder = self.folder.path().to_str().unwrap();
        let (name, token) = (c"one".as_ptr(), CString::new(token).unwrap());
        let environment = Rc::as_ptr(messages).cast_mut().cast::<c_void>();
        unsafe {
            match version {
                Version::Two => {
                    type Fixed = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char);
                    let logger = Some(std::mem::transmute::<Fixed, fmi2::Logger>(log2));
                    let functions = CallbackFunctions {
                        logger,
                        allocate_memory: None,
                        free_memory: None,
                        step_finished: None,
                        component_environment: environment,
                    };
                    let uri = CString::new(format!("file://{folder}")).unwrap();
                    fmi2::fmi2Instantiate(name, 1, token.as_ptr(), uri.as_ptr(), &functions, 0, 0)
                }
                Version::Three => {
                    let folder = CString::new(folder).unwrap();
                    let (token, folder) = (token.as_ptr(), folder.as_ptr());
                    fmi3::fmi3InstantiateCoSimulation(
                        name,
                        token,
                        folder,
                        false,
                        false,
                        false,
                        false,
                        null(),
                        0,
                        environment,
                        Some(log3),
                        null(),
                    )
                }
            }
        }
    }

    pub fn reference(&self, name: &str) -> u32 {
        let all = &self.model.variables;
        all.iter().position(|variable| variable.name == name).unwrap_or_else(|| panic!("no {name}")) as u32
    }

    /// The value references of the outputs.
    pub fn outputs(&self) -> Vec<u32> {
        let all = self.model.variables.iter().enumerate();
        all.filter(|(_, variable)| variable.is_output()).map(|(reference, _)| reference as u32).collect()
    }
}

/// An instance by either version.
pub struct Instance<'a> {
    pub c: *mut c_void,
    pub version: Version,
    pub fmu: &'a Fmu,
    pub messages: Messages,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        unsafe {
            match self.version {
                Version::Two => fmi2::fmi2FreeInstance(self.c),
                Version::Three => fmi3::fmi3FreeInstance(self.c),
            }
        }
    }
}

/// OK or an error; no other status is returned.
fn is_ok(status: c_int) -> bool {
    assert!(status == 0 || status == 3, "status {status}");
    status == 0
}

impl Instance<'_> {
    pub fn start(&self, at: f64) {
        assert!(self.set_up(at, None) && self.enter() && self.exit(), "{:?}", self.messages.borrow());
    }

    /// In FMI 3.0 these are arguments of the next call, which `enter` makes with 0: `set_up` enters there.
    pub fn set_up(&self, start: f64, stop: Option<f64>) -> bool {
        let (has_stop, stop) = (stop.is_some(), stop.unwrap_or(0.0));
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2SetupExperiment(self.c, 0, 0.0, start, has_stop.into(), stop),
                Version::Three => fmi3::fmi3EnterInitializationMode(self.c, false, 0.0, start, has_stop, stop),
            }
        })
    }

    pub fn enter(&self) -> bool {
        match self.version {
            Version::Two => is_ok(unsafe { fmi2::fmi2EnterInitializationMode(self.c) }),
            Version::Three => true,
        }
    }

    pub fn exit(&self) -> bool {
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2ExitInitializationMode(self.c),
                Version::Three => fmi3::fmi3ExitInitializationMode(self.c),
            }
        })
    }

    pub fn step(&self, at: f64, length: f64) -> bool {
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2DoStep(self.c, at, length, 0),
                Version::Three => {
                    let (mut a, mut b, mut c, mut time) = (true, true, true, f64::NAN);
                    let status = fmi3::fmi3DoStep(self.c, at, length, false, &mut a, &mut b, &mut c, &mut time);
                    assert!(!(a || b || c || time.is_nan()));
                    status
                }
            }
        })
    }

    pub fn terminate(&self) -> bool {
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2Terminate(self.c),
                Version::Three => fmi3::fmi3Terminate(self.c),
            }
        })
    }

    pub fn reset(&self) -> bool {
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2Reset(self.c),
                Version::Three => fmi3::fmi3Reset(self.c),
            }
        })
    }

    pub fn get_all(&self, references: &[u32]) -> Option<Vec<f64>> {
        let mut values = vec![f64::NAN; references.len()];
        let n = references.len();
        let status = unsafe {
            match self.version {
                Version::Two => fmi2::fmi2GetReal(self.c, references.as_ptr(), n, values.as_mut_ptr()),
                Version::Three => fmi3::fmi3GetFloat64(self.c, references.as_ptr(), n, values.as_mut_ptr(), n),
            }
        };
        is_ok(status).then_some(values)
    }

    pub fn get(&self, name: &str) -> f64 {
        self.get_all(&[self.fmu.reference(name)]).unwrap()[0]
    }

    /// Every output.
    pub fn outputs(&self) -> Vec<f64> {
        self.get_all(&self.fmu.outputs()).unwrap()
    }

    pub fn set_all(&self, references: &[u32], values: &[f64]) -> bool {
        let n = references.len();
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2SetReal(self.c, references.as_ptr(), n, values.as_ptr()),
                Version::Three => fmi3::fmi3SetFloat64(self.c, references.as_ptr(), n, values.as_ptr(), n),
            }
        })
    }

    pub fn set(&self, name: &str, value: f64) -> bool {
        self.set_all(&[self.fmu.reference(name)], &[value])
    }

    pub fn set_text(&self, name: &str, text: &str) -> bool {
        let (reference, text) = (self.fmu.reference(name), CString::new(text).unwrap());
        let texts = [text.as_ptr()];
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2SetString(self.c, &reference, 1, texts.as_ptr()),
                Version::Three => fmi3::fmi3SetString(self.c, &reference, 1, texts.as_ptr(), 1),
            }
        })
    }

    pub fn text(&self, name: &str) -> String {
        let (reference, mut texts) = (self.fmu.reference(name), [null::<c_char>()]);
        unsafe {
            assert!(is_ok(match self.version {
                Version::Two => fmi2::fmi2GetString(self.c, &reference, 1, texts.as_mut_ptr()),
                Version::Three => fmi3::fmi3GetString(self.c, &reference, 1, texts.as_mut_ptr(), 1),
            }));
            CStr::from_ptr(texts[0]).to_str().unwrap().to_string()
        }
    }

    pub fn save(&self) -> *mut c_void {
        let mut state = null_mut();
        assert!(is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2GetFMUstate(self.c, &mut state),
                Version::Three => fmi3::fmi3GetFMUState(self.c, &mut state),
            }
        }));
        state
    }

    pub fn restore(&self, state: *mut c_void) -> bool {
        is_ok(unsafe {
            match self.version {
                Version::Two => fmi2::fmi2SetFMUstate(self.c, state),
                Version::Three => fmi3::fmi3SetFMUState(self.c, state),
            }
        })
    }

    pub fn free(&self, mut state: *mut c_void) {
        unsafe {
            assert!(is_ok(match self.version {
                Version::Two => fmi2::fmi2FreeFMUstate(self.c, &mut state),
                Version::Three => fmi3::fmi3FreeFMUState(self.c, &mut state),
            }));
        }
        assert!(state.is_null());
    }

    pub fn serialize(&self, state: *mut c_void) -> Vec<u8> {
        let mut size = 0;
        unsafe {
            match self.version {
                Version::Two => {
                    assert!(is_ok(fmi2::fmi2SerializedFMUstateSize(self.c, state, &mut size)));
                    let mut bytes = vec![0; size];
                    assert!(is_ok(fmi2::fmi2SerializeFMUstate(self.c, state, bytes.as_mut_ptr(), size)));
                    bytes
                }
                Version::Three => {
                    assert!(is_ok(fmi3::fmi3SerializedFMUStateSize(self.c, state, &mut size)));
                    let mut bytes = vec![0; size];
                    assert!(is_ok(fmi3::fmi3SerializeFMUState(self.c, state, bytes.as_mut_ptr(), size)));
                    bytes
                }
            }
        }
    }

    pub fn deserialize(&self, bytes: &[u8]) -> Option<*mut c_void> {
        let mut state = null_mut();
        let status = unsafe {
            match self.version {
                Version::Two => fmi2::fmi2DeSerializeFMUstate(self.c, bytes.as_ptr(), bytes.len(), &mut state),
                Version::Three => fmi3::fmi3DeserializeFMUState(self.c, bytes.as_ptr(), bytes.len(), &mut state),
            }
        };
        is_ok(status).then_some(state)
    }

    pub fn derivative(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> Option<Vec<f64>> {
        let (m, n) = (unknowns.len(), knowns.len());
        let mut out = vec![f64::NAN; m];
        let (unknowns, knowns, seeds) = (unknowns.as_ptr(), knowns.as_ptr(), seed.as_ptr());
        let place = out.as_mut_ptr();
        let status = unsafe {
            match self.version {
                Version::Two => fmi2::fmi2GetDirectionalDerivative(self.c, unknowns, m, knowns, n, seeds, place),
                Version::Three => {
                    fmi3::fmi3GetDirectionalDerivative(self.c, unknowns, m, knowns, n, seeds, n, place, m)
                }
            }
        };
        is_ok(status).then_some(out)
    }

    /// The last message.
    pub fn message(&self) -> String {
        self.messages.borrow().last().cloned().unwrap_or_default()
    }
}
