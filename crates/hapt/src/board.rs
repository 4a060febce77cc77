//! A world for a board that runs hapt's firmware, and the board that takes it.

use hapt_core::{Phase, Reason};
use hapt_host::board::{Error, Link};
use hapt_host::{Backend, Machine};
use hapt_model::{EstimatorKind, SafetyProfile};

use crate::device::Port;
use crate::failure::Failure;
use crate::messages;
use crate::run::judged;
use crate::world::Loaded;

/// A world that a board may have.
pub struct Fit {
    /// As the board runs it.
    pub loaded: Loaded,
    /// The overrides for that.
    pub sets: Vec<String>,
    pub profile: SafetyProfile,
    /// The bytes for the wire.
    pub packed: Vec<u8>,
}

impl Fit {
    /// Judges a world as `hapt check` does, and fits it into a board: its numbers are f32, its room is small, and its motor has a limit. An
    /// encoder gives no true velocity, so that `exact` means `difference`, and is certified so.
    pub fn new(mut loaded: Loaded, sets: &[String], uncertified: bool) -> Result<Self, Failure> {
        let mut sets = sets.to_vec();
        let world = &mut loaded.world;
        if world.device.limit.is_none() {
            let why = "the world does not give the largest torque of the motor";
            return Err(Failure::input(format!("device.limit: missing; {why}, such as limit = \"800 N mm\"")));
        }
        if world.sampling.estimator == EstimatorKind::Exact {
            world.sampling.estimator = EstimatorKind::Difference;
            sets.push("loop.estimator=difference".into());
        }
        let profile = judged(world, uncertified)?;
        let packed = hapt_host::packed(world, profile).map_err(Failure::input)?;
        Ok(Fit { loaded, sets, profile, packed })
    }
}

/// The board at a port.
pub fn open(port: &Port) -> Result<Link, Failure> {
    let link = Link::open_at(&port.path, port.baud)?;
    if link.board().core != hapt_core::SOURCE {
        messages::say(
            "warning: the board's core was built from another source than this hapt's; its torques may differ from hapt's",
        );
    }
    Ok(link)
}

/// The board at a port, to run a loop, and its name. It needs an encoder and a motor.
pub fn backend(port: &Port, every: f64) -> Result<(Backend, String), Failure> {
    let link = open(port)?;
    if link.board().externally_clocked {
        let message = "has no encoder and no motor: it waits for samples, to be tried in lockstep";
        return Err(Failure::input(format!("the board {} {message}", link.board().name)));
    }
    let on = format!("the board {}", link.board().name);
    Ok((Backend::Board { link: Box::new(link), every }, on))
}

/// Clears the fault that an earlier session has left on a board.
pub fn clear(machine: &mut Machine) -> Result<(), Failure> {
    if let Backend::Board { link, .. } = &mut machine.backend
        && link.board().phase == Some(Phase::Faulted)
    {
        let why = link.board().reason.map_or("The board reports no reason.", Reason::sentence);
        messages::say(format_args!("the board was faulted, and is cleared: {why}"));
        link.clear()?;
    }
    Ok(())
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let is_input = matches!(&error, Error::Refused { why, .. } if why.is_about_the_world());
        if is_input { Failure::input(error) } else { Failure::System(error.to_string()) }
    }
}
