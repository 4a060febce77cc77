//! A world for a board that runs hapt's firmware, and the board that takes it.

use hapt_model::{EstimatorKind, SafetyProfile};

use crate::failure::Failure;
use crate::run::judged;
use crate::world::Loaded;

/// A world that a board may have.
pub struct Fit {
    /// As the board runs it.
    pub loaded: Loaded,
    /// What was set over the file for that.
    pub sets: Vec<String>,
    pub profile: SafetyProfile,
    /// As it goes over the wire.
    pub packed: Vec<u8>,
}

impl Fit {
    /// Judges a world as `hapt check` does, and fits it into a board: its numbers are f32, its room is small, and its motor has a limit. An
    /// encoder gives no true velocity, so that `exact` means `difference`, and is certified so.
    pub fn new(mut loaded: Loaded, sets: &[String], uncertified: bool) -> Result<Self, Failure> {
        let mut sets = sets.to_vec();
        let world = &mut loaded.world;
        if world.device.limit.is_none() {
            let why = "the world does not say what the motor may be asked for";
            return Err(Failure::input(format!("device.limit: missing; {why}, such as limit = \"800 N mm\"")));
        }
        if world.sampling.estimator == EstimatorKind::Exact {
            world.sampling.estimator = EstimatorKind::Difference;
            sets.push("loop.estimator=difference".into());
        }
        let profile = judged(world, uncertified)?;
        let packed = hapt_live::packed(world, profile).map_err(Failure::input)?;
        Ok(Fit { loaded, sets, profile, packed })
    }
}

#[cfg(unix)]
pub use here::{open, open_with_motor, runs, send};
#[cfg(not(unix))]
pub use nowhere::runs;

#[cfg(not(unix))]
mod nowhere {
    use hapt_live::Runs;

    use crate::board_run::unreachable;
    use crate::device::Port;
    use crate::failure::Failure;

    pub fn runs(port: &Port) -> Result<Runs, Failure> {
        Err(unreachable(&port.path))
    }
}

#[cfg(unix)]
mod here {
    use hapt_link::{Error, Link, Refusal};
    use hapt_live::Runs;

    use super::Fit;
    use crate::device::Port;
    use crate::failure::Failure;
    use crate::people;

    /// The board at a port.
    pub fn open(port: &Port) -> Result<Link, Failure> {
        let link = Link::open_at(&port.path, port.baud)?;
        if link.board().core != hapt_core::SOURCE {
            people::say(
                "warning: the board's core was built from another source than this hapt's; its torques may differ from hapt's",
            );
        }
        Ok(link)
    }

    /// The board at a port, to run the loop behind a page.
    pub fn runs(port: &Port) -> Result<Runs, Failure> {
        open_with_motor(port).map(|link| Runs::Board(Box::new(link)))
    }

    /// The board at a port, if it has an encoder and a motor.
    pub fn open_with_motor(port: &Port) -> Result<Link, Failure> {
        let link = open(port)?;
        if link.board().externally_clocked {
            let message = "has no encoder and no motor: it waits for samples, to be tried in lockstep";
            return Err(Failure::input(format!("the board {} {message}", link.board().name)));
        }
        Ok(link)
    }

    /// Gives the board a world, where it does not run it already; its hash.
    pub fn send(link: &mut Link, fit: &Fit) -> Result<u32, Failure> {
        Ok(link.load(&fit.packed)?)
    }

    impl From<Error> for Failure {
        fn from(error: Error) -> Self {
            match error {
                Error::Refused {
                    why: Refusal::Room | Refusal::World | Refusal::Period | Refusal::NoLimit | Refusal::Exact,
                    ..
                } => Failure::input(error),
                _ => Failure::System(error.to_string()),
            }
        }
    }
}
