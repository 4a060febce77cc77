//! What each law is to an argument. Every match here names every law, so that a new one does not compile until somebody has said
//! which theorems cover it.

use hapt_model::{Clampable, Coupling, Damping, End, Law};

/// What a theorem may assume of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Springs and dampers.
    Linear,
    /// A torque that does not depend on the motion.
    Constant,
    /// A potential with a steepest rise, with a damping that only ever takes, or either of them clamped.
    Potential,
    /// Dry friction, whose torque jumps with the sign of the velocity.
    Coulomb,
    /// Friction with bristles, which have a state of their own.
    Lugre,
}

impl Kind {
    pub fn of(law: &Law) -> Kind {
        match law {
            Law::Spring { .. } | Law::Damper { .. } => Kind::Linear,
            Law::Constant { .. } => Kind::Constant,
            Law::Wall { .. } | Law::Detent { .. } => Kind::Potential,
            Law::Clamped {
                law: Clampable::Spring { .. } | Clampable::Damper { .. } | Clampable::Wall { .. }, ..
            } => Kind::Potential,
            Law::Coulomb { .. } => Kind::Coulomb,
            Law::Lugre { .. } => Kind::Lugre,
        }
    }

    /// Whether the torque is no affine function of the motion.
    pub fn is_nonlinear(self) -> bool {
        match self {
            Kind::Linear | Kind::Constant => false,
            Kind::Potential | Kind::Coulomb | Kind::Lugre => true,
        }
    }
}

pub(crate) fn is_nonlinear(coupling: &Coupling) -> bool {
    Kind::of(&coupling.law).is_nonlinear()
}

/// The largest torque that a law can ask for; infinite where it has no bound of its own.
pub(crate) fn most(law: &Law) -> f64 {
    match *law {
        Law::Clamped { limit, .. } => limit,
        Law::Detent { torque, .. } | Law::Coulomb { torque } => torque,
        Law::Constant { torque } => torque.abs(),
        Law::Spring { .. } | Law::Damper { .. } | Law::Wall { .. } | Law::Lugre { .. } => f64::INFINITY,
    }
}

/// Whether a law takes the velocity, so that it matters how the loop comes by it.
pub(crate) fn takes_velocity(law: &Law) -> bool {
    match *law {
        Law::Damper { damping } | Law::Clamped { law: Clampable::Damper { damping }, .. } => match damping {
            Damping::Fixed(damping) => damping > 0.0,
            Damping::Compensating => true,
        },
        Law::Wall { damping, .. } | Law::Clamped { law: Clampable::Wall { damping, .. }, .. } => damping > 0.0,
        Law::Coulomb { torque } => torque > 0.0,
        Law::Lugre { .. } => true,
        Law::Spring { .. }
        | Law::Detent { .. }
        | Law::Constant { .. }
        | Law::Clamped { law: Clampable::Spring { .. }, .. } => false,
    }
}

/// Whether the law has a wall's damping, clamped or not.
pub(crate) fn is_damped_wall(law: &Law) -> bool {
    match *law {
        Law::Wall { damping, .. } | Law::Clamped { law: Clampable::Wall { damping, .. }, .. } => damping > 0.0,
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Detent { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Constant { .. }
        | Law::Clamped { law: Clampable::Spring { .. } | Clampable::Damper { .. }, .. } => false,
    }
}

/// Whether the discrete-gradient step has no proof that its rounds come to agree with this law at a body: it falls, or has no energy
/// whose mean torque it is.
pub(crate) fn may_not_settle(law: &Law) -> bool {
    match *law {
        Law::Detent { .. } | Law::Coulomb { .. } | Law::Lugre { .. } => true,
        Law::Wall { damping, .. } | Law::Clamped { law: Clampable::Wall { damping, .. }, .. } => damping > 0.0,
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Constant { .. }
        | Law::Clamped { law: Clampable::Spring { .. } | Clampable::Damper { .. }, .. } => false,
    }
}

/// Whether an end moves in the world.
pub(crate) fn at_body(coupling: &Coupling) -> bool {
    let is_body = |end: End| match end {
        End::Body(_) => true,
        End::Puck | End::Ground => false,
    };
    is_body(coupling.first) || is_body(coupling.second)
}

/// Whether an end is the puck.
pub(crate) fn at_puck(coupling: &Coupling) -> bool {
    coupling.first == End::Puck || coupling.second == End::Puck
}
