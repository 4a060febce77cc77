//! An instance of an FMU: the common states, checks and calls of FMI 2.0 and 3.0. Errors are sentences for the importer's logger; a refused
//! call changes nothing.

use std::collections::BTreeMap;

use hapt_core::Error as CoreError;
use hapt_model::{ErrorKind, World, parameters};
use hapt_sim::Row;
use serde::{Deserialize, Serialize};

use crate::clock::Clock;
use crate::engine::{Engine, Memory, linear_response};
use crate::log::{Log, Status};
use crate::model::Model;
use crate::variable::{Role, Value, Variable, row, value};
use crate::{Kind, named};

/// The states of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Phase {
    /// Made, or reset.
    Instantiated,
    /// Between `EnterInitializationMode` and `ExitInitializationMode`.
    Initialization,
    /// At a communication point.
    Step,
    /// After `Terminate`.
    Terminated,
    /// After a run with a number that is not finite.
    Failed,
}

impl Phase {
    fn name(self) -> &'static str {
        match self {
            Phase::Instantiated => "instantiated",
            Phase::Initialization => "in initialization mode",
            Phase::Step => "at a communication point",
            Phase::Terminated => "terminated",
            Phase::Failed => "failed",
        }
    }
}

/// All variable data of an instance: an FMU state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Saved {
    phase: Phase,
    start: f64,
    stop: Option<f64>,
    time: f64,
    sample: u64,
    part: f64,
    inputs: [f64; 2],
    is_fresh: bool,
    sets: BTreeMap<usize, Value>,
    engine: Memory,
}

/// One instance.
#[derive(Debug)]
pub struct Instance {
    model: Model,
    /// The destination of its messages.
    pub log: Log,
    phase: Phase,
    start: f64,
    stop: Option<f64>,
    /// The communication point, as the importer gave it.
    time: f64,
    clock: Clock,
    inputs: [f64; 2],
    /// Inputs have been set since the last step.
    is_fresh: bool,
    /// The parameters that differ from the file, by value reference.
    sets: BTreeMap<usize, Value>,
    /// The values of all parameters, by value reference.
    values: BTreeMap<usize, Value>,
    /// The reason that the parameters set so far are inconsistent, if they are.
    pending: Option<String>,
    world: World,
    engine: Engine,
    /// The outputs' row for inputs of the next step.
    shown: Option<Row>,
}

/// A world with its parameters' values.
struct Changed {
    world: World,
    values: BTreeMap<usize, Value>,
}

/// The reason that parameters are refused.
enum Refused {
    /// Values that are each valid and inconsistent together.
    Combination(String),
    Single(String),
}

impl Instance {
    /// A new instance of `model`.
    ///
    /// # Errors
    /// In a sentence, which goes to `log` too: the core refuses the world.
    pub fn new(model: Model, log: Log) -> Result<Instance, String> {
        let world = model.world.clone();
        let parts = values(&model, &BTreeMap::new()).map_err(|error| named(&error)).and_then(|values| {
            let engine = Engine::new(model.kind, &world).map_err(|error| error.to_string())?;
            Ok((values, engine))
        });
        let (values, engine) = parts.inspect_err(|message| log.say(Status::Error, message))?;
        let clock = Clock::new(world.sampling.period, 0.0);
        Ok(Instance {
            model,
            log,
            phase: Phase::Instantiated,
            start: 0.0,
            stop: None,
            time: 0.0,
            clock,
            inputs: [0.0; 2],
            is_fresh: true,
            sets: BTreeMap::new(),
            values,
            pending: None,
            world,
            engine,
            shown: None,
        })
    }

    /// The FMU.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Its state.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The communication point in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    fn expect(&self, call: &str, phase: Phase) -> Result<(), String> {
        if self.phase == phase {
            return Ok(());
        }
        Err(format!("{call} is out of order: the instance is {}, and must be {}", self.phase.name(), phase.name()))
    }

    /// The start and stop time in s.
    ///
    /// # Errors
    /// In a sentence: out of order, or times that are not finite or not in order.
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), String> {
        self.expect("the start time", Phase::Instantiated)?;
        if !start.is_finite() {
            return Err(format!("the start time is {start}, and must be a finite number of seconds"));
        }
        if let Some(stop) = stop.filter(|stop| stop.is_nan() || *stop < start) {
            return Err(format!("the stop time {stop} s is not after the start time {start} s"));
        }
        (self.start, self.stop, self.time) = (start, stop, start);
        Ok(())
    }

    /// Begins the initialisation.
    ///
    /// # Errors
    /// Out of order.
    pub fn enter_initialization(&mut self) -> Result<(), String> {
        self.expect("EnterInitializationMode", Phase::Instantiated)?;
        self.phase = Phase::Initialization;
        Ok(())
    }

    /// Ends the initialisation.
    ///
    /// # Errors
    /// In a sentence: out of order, or inconsistent parameters.
    pub fn exit_initialization(&mut self) -> Result<(), String> {
        self.expect("ExitInitializationMode", Phase::Initialization)?;
        if let Some(message) = &self.pending {
            return Err(message.clone());
        }
        self.clock = Clock::new(self.world.sampling.period, self.start);
        self.engine.begin();
        self.shown = None;
        self.phase = Phase::Step;
        self.log.say(Status::Ok, &format!("initialised at {} s, period {} s", self.start, self.clock.period));
        Ok(())
    }

    /// Advances from the communication point `at` by `length`, both in s, with held inputs.
    ///
    /// # Errors
    /// In a sentence: out of order, a step that is not forward or does not begin here, or a run with a number that is not finite.
    pub fn do_step(&mut self, at: f64, length: f64) -> Result<(), String> {
        self.expect("DoStep", Phase::Step)?;
        if !(length.is_finite() && length > 0.0) {
            return Err(format!("the communication step is {length} s, and must be a finite time above 0"));
        }
        let slack = self.clock.tolerance();
        if at.is_nan() || (at - self.time).abs() > slack {
            let hint = if at < self.time { "; a saved FMU state goes back" } else { "" };
            return Err(format!(
                "the step begins at {at} s, and must begin at {} s, where the last one ended{hint}",
                self.time
            ));
        }
        let end = at + length;
        if let Some(stop) = self.stop.filter(|stop| end > stop + slack) {
            return Err(format!("the step ends at {end} s, after the stop time {stop} s"));
        }
        let next = self.clock.after(at, length)?;
        self.shown = None;
        self.is_fresh = false;
        if let Err(time) = self.engine.advance(&self.clock, &next, self.inputs) {
            self.phase = Phase::Failed;
            return Err(format!("the run stops being finite at t = {time} s: the loop has run away"));
        }
        (self.clock, self.time) = (next, end);
        Ok(())
    }

    /// Ends the run.
    ///
    /// # Errors
    /// Out of order.
    pub fn terminate(&mut self) -> Result<(), String> {
        self.expect("Terminate", Phase::Step)?;
        self.phase = Phase::Terminated;
        self.log.say(Status::Ok, &format!("terminated at {} s", self.time));
        Ok(())
    }

    /// Restores the initial state: every parameter and input has its start value.
    ///
    /// # Errors
    /// No known error; the world has been read before.
    pub fn reset(&mut self) -> Result<(), String> {
        let Changed { world, values } = self.read(&BTreeMap::new()).map_err(Refused::message)?;
        self.engine = Engine::new(self.model.kind, &world).map_err(|error| error.to_string())?;
        self.clock = Clock::new(world.sampling.period, 0.0);
        (self.world, self.values, self.pending, self.shown) = (world, values, None, None);
        self.sets.clear();
        (self.start, self.stop, self.time) = (0.0, None, 0.0);
        (self.inputs, self.is_fresh, self.phase) = ([0.0; 2], true, Phase::Instantiated);
        self.log.say(Status::Ok, "reset");
        Ok(())
    }

    /// The variable of a value reference.
    ///
    /// # Errors
    /// In a sentence: there is no such variable.
    pub fn variable(&self, reference: u32) -> Result<&Variable, String> {
        let all = &self.model.variables;
        all.get(reference as usize)
            .ok_or_else(|| format!("there is no value reference {reference}; there are 0 to {}", all.len() - 1))
    }

    /// The value of a variable.
    ///
    /// # Errors
    /// In a sentence: a reference that does not exist.
    pub fn get(&mut self, reference: u32) -> Result<Value, String> {
        let role = self.variable(reference)?.role;
        Ok(match role {
            Role::Time => Value::Real(self.time),
            Role::Input(input) => Value::Real(self.inputs.get(input).copied().unwrap_or(0.0)),
            Role::Signal(_) | Role::Body(..) => {
                self.show();
                let row = self.shown.as_ref().unwrap_or(self.engine.row());
                Value::Real(self.model.variables[reference as usize].read(row))
            }
            Role::Fixed | Role::Tunable => {
                let index = reference as usize;
                let value = self.sets.get(&index).or_else(|| self.values.get(&index));
                value.unwrap_or(&self.model.variables[index].start).clone()
            }
        })
    }

    /// Computes the row for inputs of the next step: before the first step, and of a loop without its device when its puck has been set at
    /// the instant of a sample.
    fn show(&mut self) {
        let is_ahead = match self.phase {
            Phase::Instantiated | Phase::Initialization => true,
            Phase::Step => self.model.kind == Kind::Loop && self.is_fresh && self.engine.is_due(&self.clock),
            Phase::Terminated | Phase::Failed => false,
        };
        if is_ahead && self.shown.is_none() {
            self.shown = Some(self.engine.preview(self.inputs));
        }
    }

    /// Sets inputs and parameters: all of them, or none on an error.
    ///
    /// # Errors
    /// In a sentence: a reference or type that does not match, a value that the world file would not accept, or a variable that may not be
    /// set now.
    pub fn set(&mut self, values: &[(u32, Value)]) -> Result<(), String> {
        let (mut inputs, mut sets) = (self.inputs, self.sets.clone());
        for (reference, value) in values {
            let variable = self.variable(*reference)?;
            let name = &variable.name;
            if !variable.start.is_like(value) {
                let (is, given) = (variable.start.type_name(), value.type_name());
                return Err(format!("{name} is a variable of type {is}, and was set as {given}"));
            }
            self.may_set(variable)?;
            match (variable.role, value) {
                (Role::Input(_), Value::Real(number)) if !number.is_finite() => {
                    return Err(format!("{name} is set to {number}, and must be a finite number"));
                }
                (Role::Input(input), Value::Real(number)) => inputs[input] = *number,
                _ => drop(sets.insert(*reference as usize, value.clone())),
            }
        }
        self.change(sets)?;
        if inputs.map(f64::to_bits) != self.inputs.map(f64::to_bits) || values.iter().any(|(vr, _)| self.is_input(*vr))
        {
            (self.inputs, self.is_fresh, self.shown) = (inputs, true, None);
        }
        Ok(())
    }

    fn is_input(&self, reference: u32) -> bool {
        matches!(self.variable(reference), Ok(Variable { role: Role::Input(_), .. }))
    }

    fn may_set(&self, variable: &Variable) -> Result<(), String> {
        let refuse = |why: &str| Err(format!("{} cannot be set: {why}", variable.name));
        match (variable.role, self.phase) {
            (Role::Time | Role::Signal(_) | Role::Body(..), _) => refuse("it is neither an input nor a parameter"),
            (_, Phase::Terminated | Phase::Failed) => refuse(&format!("the instance is {}", self.phase.name())),
            (Role::Fixed, Phase::Step) => refuse("it is fixed after the initialisation"),
            (Role::Input(_) | Role::Fixed | Role::Tunable, Phase::Instantiated | Phase::Initialization)
            | (Role::Input(_) | Role::Tunable, Phase::Step) => Ok(()),
        }
    }

    /// Changes to a world with these parameters. Before the first step, values that are valid only together may be set one by one.
    fn change(&mut self, sets: BTreeMap<usize, Value>) -> Result<(), String> {
        let bits = |sets: &BTreeMap<usize, Value>, index: usize| {
            let value = sets.get(&index).or_else(|| self.values.get(&index));
            value.map(Value::to_toml)
        };
        if self.pending.is_none() && sets.keys().all(|index| bits(&sets, *index) == bits(&self.sets, *index)) {
            return Ok(());
        }
        let is_running = self.phase == Phase::Step;
        let Changed { world, values } = match self.read(&sets) {
            Ok(changed) => changed,
            Err(Refused::Combination(message)) if !is_running => {
                self.log.say(Status::Warning, &format!("{message} (checked again when the initialisation ends)"));
                (self.sets, self.pending) = (sets, Some(message));
                return Ok(());
            }
            Err(refused) => return Err(refused.message()),
        };
        let compiled = if is_running {
            self.engine.change(&self.world, &world)
        } else {
            Engine::new(self.model.kind, &world).map(|engine| self.engine = engine)
        };
        compiled.map_err(|error: CoreError| error.to_string())?;
        (self.world, self.values, self.sets, self.pending, self.shown) = (world, values, sets, None, None);
        if is_running {
            self.log.say(Status::Ok, &format!("parameters changed at {} s", self.time));
        }
        Ok(())
    }

    /// The world with these parameters, through the reader's checks.
    fn read(&self, sets: &BTreeMap<usize, Value>) -> Result<Changed, Refused> {
        let texts = texts(&self.model, sets);
        let world = World::read(&self.model.source, &texts).map_err(|error| match error.kind {
            ErrorKind::Combination | ErrorKind::Unsupported | ErrorKind::Name => Refused::Combination(named(&error)),
            ErrorKind::Value | ErrorKind::Syntax | ErrorKind::Unreadable => Refused::Single(named(&error)),
        })?;
        hapt_sim::check(&world).map_err(|error| Refused::Combination(error.to_string()))?;
        let values = values(&self.model, sets).map_err(|error| Refused::Single(named(&error)))?;
        Ok(Changed { world, values })
    }

    /// The state.
    pub fn save(&self) -> Saved {
        Saved {
            phase: self.phase,
            start: self.start,
            stop: self.stop,
            time: self.time,
            sample: self.clock.sample,
            part: self.clock.part,
            inputs: self.inputs,
            is_fresh: self.is_fresh,
            sets: self.sets.clone(),
            engine: self.engine.memory(),
        }
    }

    /// Continues from a state of an instance of the same FMU.
    ///
    /// # Errors
    /// In a sentence: a state of another FMU.
    pub fn restore(&mut self, saved: &Saved) -> Result<(), String> {
        let is_fit = saved.sets.iter().all(|(index, value)| {
            self.model.variables.get(*index).is_some_and(|own| own.is_parameter() && own.start.is_like(value))
        });
        if !is_fit {
            return Err("the FMU state has parameters that this FMU does not have".into());
        }
        let (changed, pending) = match self.read(&saved.sets) {
            Ok(changed) => (changed, None),
            // It was saved between two values that are valid only together.
            Err(Refused::Combination(message)) => {
                (self.read(&BTreeMap::new()).map_err(Refused::message)?, Some(message))
            }
            Err(refused) => return Err(refused.message()),
        };
        let mut engine = Engine::new(self.model.kind, &changed.world).map_err(|error| error.to_string())?;
        engine.resume(&saved.engine);
        self.clock = Clock { sample: saved.sample, part: saved.part, ..Clock::new(engine.period(), saved.start) };
        (self.world, self.values, self.engine) = (changed.world, changed.values, engine);
        (self.sets, self.pending, self.shown) = (saved.sets.clone(), pending, None);
        (self.phase, self.start, self.stop, self.time) = (saved.phase, saved.start, saved.stop, saved.time);
        (self.inputs, self.is_fresh) = (saved.inputs, saved.is_fresh);
        Ok(())
    }

    /// A saved state as bytes, with a checksum and the FMU's token.
    ///
    /// # Errors
    /// No known error.
    pub fn serialize(&self, saved: &Saved) -> Result<Vec<u8>, String> {
        let bytes = postcard::to_extend(&(&self.model.token, saved), Vec::new()).map_err(|error| error.to_string())?;
        Ok([&bytes[..], &CHECKSUM.checksum(&bytes).to_le_bytes()].concat())
    }

    /// The state from bytes of [`Instance::serialize`].
    ///
    /// # Errors
    /// In a sentence: other bytes, or a state of another FMU.
    pub fn deserialize(&self, bytes: &[u8]) -> Result<Saved, String> {
        let wrong = || "the bytes are no serialised state of this FMU".to_string();
        let (body, sum) = bytes.split_last_chunk::<4>().ok_or_else(wrong)?;
        if CHECKSUM.checksum(body) != u32::from_le_bytes(*sum) {
            return Err(wrong());
        }
        let (read, rest) = postcard::take_from_bytes::<(String, Saved)>(body).map_err(|_| wrong())?;
        match read {
            (token, saved) if token == self.model.token && rest.is_empty() => Ok(saved),
            _ => Err(wrong()),
        }
    }

    /// ∂unknown/∂known of the linear part, one row for each unknown: outputs against inputs.
    ///
    /// # Errors
    /// In a sentence: an unknown that is no output, a known that is no input, or out of order.
    pub fn derivatives(&self, unknowns: &[u32], knowns: &[u32]) -> Result<Vec<Vec<f64>>, String> {
        if !matches!(self.phase, Phase::Initialization | Phase::Step) {
            return Err(format!("derivatives are out of order: the instance is {}", self.phase.name()));
        }
        for unknown in unknowns {
            let variable = self.variable(*unknown)?;
            if !variable.is_output() {
                return Err(format!("{} is no output: only outputs have derivatives", variable.name));
            }
        }
        let mut inputs = Vec::new();
        for known in knowns {
            let variable = self.variable(*known)?;
            let Role::Input(input) = variable.role else {
                return Err(format!("{} is no input: derivatives are in the direction of inputs", variable.name));
            };
            inputs.push(input);
        }
        // The outputs at an instant do not depend on the hand's torque at that instant.
        if self.model.kind == Kind::Whole {
            return Ok(vec![vec![0.0; knowns.len()]; unknowns.len()]);
        }
        let column = |motion| linear_response(&self.world, motion).map_err(|error| error.to_string());
        let columns = [column([1.0, 0.0])?, column([0.0, 1.0])?];
        let entry = |unknown: &u32, input: &usize| self.model.variables[*unknown as usize].read(&columns[*input]);
        Ok(unknowns.iter().map(|unknown| inputs.iter().map(|input| entry(unknown, input)).collect()).collect())
    }
}

/// The checksum of a serialised state.
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

impl Refused {
    fn message(self) -> String {
        match self {
            Refused::Combination(message) | Refused::Single(message) => message,
        }
    }
}

/// The parameters as overrides.
fn texts(model: &Model, sets: &BTreeMap<usize, Value>) -> Vec<String> {
    let text = |(index, value): (&usize, &Value)| {
        model.variables.get(*index).map(|variable| format!("{}={}", variable.name, value.to_toml()))
    };
    sets.iter().filter_map(text).collect()
}

/// The values of all parameters in a world with these set.
fn values(model: &Model, sets: &BTreeMap<usize, Value>) -> Result<BTreeMap<usize, Value>, hapt_model::Error> {
    let list = parameters(&model.source, &texts(model, sets))?;
    let indexed = model.variables.iter().enumerate().filter(|(_, variable)| variable.is_parameter());
    Ok(indexed
        .filter_map(|(index, variable)| {
            let parameter = list.iter().find(|parameter| parameter.path == variable.name)?;
            Some((index, value(row(&model.world, &parameter.path)?, parameter)?))
        })
        .collect())
}
