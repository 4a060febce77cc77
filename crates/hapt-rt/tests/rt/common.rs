//! Worlds in a few lines, and a device whose positions are a function of the sample.
#![allow(dead_code)]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_core::{Phase, Request};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Device, Failure, Moment, Position, Record};

/// A world file's text as a world.
pub fn world(text: &str) -> World {
    World::read(&Source::from_text("test.toml", text), &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The Michigan wheel at this period, with the further keys `rest`.
pub fn wheel(period: &str, rest: &str) -> World {
    world(&format!(
        "[loop]\nperiod = \"{period}\"\n[device]\ninertia = \"6.4e-4 kg m^2\"\ndamping = \"1.2e-3 N m s/rad\"\n{rest}"
    ))
}

/// A spring between two ends.
pub fn spring(first: &str, second: &str, stiffness: f64) -> String {
    format!("[[couplings]]\nkind = \"spring\"\nbetween = [\"{first}\", \"{second}\"]\nstiffness = {stiffness}\n")
}

/// A constant torque on the puck.
pub fn constant(torque: f64) -> String {
    format!("[[couplings]]\nkind = \"constant\"\nbetween = [\"puck\", \"ground\"]\ntorque = {torque}\n")
}

/// A device whose puck has the position and velocity `at(sample)`.
pub struct ScriptedDevice<F> {
    pub at: F,
    pub samples: u64,
    pub torque: Torque,
}

/// The torque that was last written to a device, readable from any thread.
#[derive(Clone, Default)]
pub struct Torque(Arc<AtomicU64>);

impl Torque {
    pub fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::SeqCst))
    }
}

impl<F: FnMut(u64) -> Result<(f64, f64), Failure> + Send> ScriptedDevice<F> {
    pub fn new(at: F) -> (Box<Self>, Torque) {
        let torque = Torque::default();
        (Box::new(ScriptedDevice { at, samples: 0, torque: torque.clone() }), torque)
    }
}

impl<F: FnMut(u64) -> Result<(f64, f64), Failure> + Send> Device for ScriptedDevice<F> {
    fn read(&mut self) -> Result<Position, Failure> {
        let (position, velocity) = (self.at)(self.samples)?;
        self.samples += 1;
        Ok(Position { position, velocity, announced: true })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.torque.0.store(torque.to_bits(), Ordering::SeqCst);
        Ok(())
    }
}

/// Takes the next sample, on time.
pub fn sample(cycle: &mut Cycle, is_first: bool, request: Option<Request>) -> Record {
    let moment = Moment { periods: u32::from(!is_first), ..Moment::default() };
    cycle.pass(moment.periods);
    cycle.sample(&moment, request).unwrap()
}

/// Arms, and takes samples until the torque has faded in.
pub fn armed(cycle: &mut Cycle) -> Record {
    sample(cycle, true, None);
    let mut record = sample(cycle, false, Some(Request::Arm));
    for _ in 0..100_000 {
        if record.phase == Phase::Running {
            return record;
        }
        record = sample(cycle, false, None);
    }
    panic!("never running: {record:?}");
}
