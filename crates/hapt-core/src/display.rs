//! The torque of each coupling, for displays.

use crate::compile::compensated;
use crate::law::Linear;
use crate::nonlinear::{Nonlinear, Relative};
use crate::{Damping, End, Law, Spec};

/// Long enough for a bristle to settle, in s.
const SETTLING: f64 = 1e9;

impl Spec<'_> {
    /// The torque of a coupling on its first end in N·m (linear: N), with the positions and velocities of puck and bodies as given, for
    /// displays: the state of a law with a memory is not among them. LuGre friction has its torque of steady sliding, a torque
    /// along the acceleration 0, an integral term the torque that it reaches in its `time` at this q. 0 where there is no such coupling.
    pub fn coupling_torque(&self, index: usize, puck: (f64, f64), bodies: &[(f64, f64)]) -> f64 {
        let Some(coupling) = self.couplings.get(index) else { return 0.0 };
        let at = |end: End| match end {
            End::Puck => puck,
            End::Ground => (0.0, 0.0),
            End::Body(i) => bodies.get(i).copied().unwrap_or((0.0, 0.0)),
        };
        let (first, second) = (at(coupling.first), at(coupling.second));
        let q = Relative { position: first.0 - second.0, velocity: first.1 - second.1 };
        let springs = if coupling.law.is_compensating() { compensated(self.couplings, coupling) } else { None };
        let compensating = self.compensates_over(coupling) * springs.unwrap_or(0.0);
        if let Some(Linear { stiffness, damping, torque }) = coupling.linear() {
            let damping = match damping {
                Damping::Fixed(damping) => damping,
                Damping::Compensating => compensating,
            };
            return torque - stiffness * q.position - damping * q.velocity;
        }
        let settling = if let Law::Integral { time, .. } = coupling.law { time } else { SETTLING };
        let law = Nonlinear::<f64>::new(coupling, compensating, self.method.finds_torques());
        law.map_or(0.0, |law| law.torque(q, law.bend(0.0, q, settling)))
    }
}
