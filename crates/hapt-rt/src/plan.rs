//! A world compiled for the loop's thread.

use hapt_core::Supervisor;
use hapt_model::World;
use hapt_sim::DesktopLoop;

/// A world compiled, with its supervisor.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) world: DesktopLoop,
    pub(crate) supervisor: Supervisor<f64>,
    /// Where each body's state comes from in the plan before; `None`: from its start.
    pub(crate) carried: Vec<Option<usize>>,
    pub(crate) names: Vec<String>,
}

impl Plan {
    /// Compiles a world. Errors where the core does.
    pub fn new(world: &World) -> Result<Self, hapt_core::Error> {
        let compiled = DesktopLoop::new(&world.spec())?;
        let fade = 0.1 / world.sampling.period;
        let carried = vec![None; world.names.len()];
        Ok(Plan { world: compiled, supervisor: Supervisor::new(fade), carried, names: world.names.clone() })
    }

    /// The same, to follow `before`: bodies of the same name go on where they are.
    pub fn following(world: &World, before: &Plan) -> Result<Self, hapt_core::Error> {
        let mut plan = Plan::new(world)?;
        plan.carried = world.names.iter().map(|name| before.names.iter().position(|other| other == name)).collect();
        Ok(plan)
    }
}
