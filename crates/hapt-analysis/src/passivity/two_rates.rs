//! Bodies that step at every n-th sample: the requirement is that of the same world with its bodies fixed (docs/theory.md, (T62)).
//!
//! Let S(z, x) be the energy of the world. At every n-th sample the bodies step from x to x⁺ with z held at z_k; the methods of the energy
//! theorem do not raise S in it, however long the step is. In the samples j up to the next step the torque is -∂S/∂z(z_j, x⁺). With
//! δ = z_{j+1} - z_j and K the largest ∂²S/∂z²,
//!
//! ```text
//! S(z_{j+1}, x⁺) - S(z_j, x⁺) ≤ -τ_j δ + K δ²/2
//! ```
//!
//! at each of them, so that the hand gets no more than what is stored and Σ (K/2 - b/T) δ², T being the period and not the step. Dampers
//! between puck and ground add the same as in parallel with a spring K: their torque depends only on the δ. That is the requirement of the
//! world whose bodies are fixed to ground. It needs the torque of the end of the step, without delay, and every coupling between puck and
//! bodies to be a law of the position.

use hapt_model::{Coupling, End, Output, World};

use crate::equations::continuous::of_step;
use crate::equations::delay::Delay;
use crate::equations::discrete::keeps_energy;
use crate::equations::laws;
use crate::error::Error;

/// Why the theorem does not cover a world whose bodies step at every n-th sample; `None` where it does.
pub(crate) fn outside(world: &World, couplings: &[Coupling]) -> Result<Option<&'static str>, Error> {
    let sampling = &world.sampling;
    let lag = Delay::of_loop(sampling)?;
    let is_damped = |c: &Coupling| laws::at_puck(c) && laws::at_body(c) && laws::takes_velocity(&c.law);
    Ok(if !keeps_energy(sampling.method) {
        Some("bodies that step every n-th sample are proved with zoh, trapezoidal and backward-euler only")
    } else if sampling.output != Output::End || sampling.advance > 0 {
        Some("bodies that step every n-th sample are proved with the torque of the end of their step only")
    } else if sampling.filter.is_some() {
        Some(
            "bodies that step every n-th sample are proved only where they see the position as measured: leave out loop.filter",
        )
    } else if lag.samples > 0 || lag.fraction > 0.0 {
        Some("bodies that step every n-th sample are proved only where the torque comes at once, and it comes late")
    } else if world.device.lag > 0.0 {
        Some("bodies that step every n-th sample are proved only where the torque comes at once, and the motor's lags")
    } else if couplings.iter().any(is_damped) {
        Some(
            "bodies that step every n-th sample are proved only where springs and other laws of the position couple them to the puck, and a \
             damper or a friction does here",
        )
    } else {
        None
    })
}

/// The world with its bodies fixed to ground, and those of the `couplings` that remain: a loop of one rate.
pub(crate) fn with_fixed_bodies(world: &World, couplings: &[Coupling]) -> World {
    let fixed = |end: End| if end.body().is_some() { End::Ground } else { end };
    // A compensating damper to ground is about the springs to ground, and not about those to the bodies.
    let couplings = of_step(couplings, &world.sampling);
    let at_puck = couplings.iter().filter(|c| laws::at_puck(c));
    let couplings = at_puck.map(|c| Coupling { first: fixed(c.first), second: fixed(c.second), ..*c }).collect();
    let mut world = world.clone();
    (world.bodies, world.names, world.couplings) = (Vec::new(), Vec::new(), couplings);
    world.sampling.bodies_every = 1;
    world
}
