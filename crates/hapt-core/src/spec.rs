//! The parts of a loop as plain data in SI: rotary worlds in rad, N·m and kg·m², linear ones in m, N and kg.
//!
//! A [`Spec`] is what [`crate::Loop::new`] compiles; the laboratory derives its own matrices from the
//! same data and shares nothing else with the loop.

pub use crate::law::{CouplingKind, Damping, HARMONICS, Law, Linear, Quantity, Range, Side, Slopes, Waveform};

/// An end of a coupling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum End {
    /// The part of the device that the hand holds, at position z.
    Puck,
    /// The fixed frame: position 0, at rest.
    Ground,
    /// A virtual inertia, by its index in [`Spec::bodies`].
    Body(usize),
}

impl End {
    /// The index of the body that it is; `None` for the puck and ground.
    pub const fn body(self) -> Option<usize> {
        match self {
            End::Body(index) => Some(index),
            End::Puck | End::Ground => None,
        }
    }

    /// Whether it is the puck.
    pub const fn is_puck(self) -> bool {
        match self {
            End::Puck => true,
            End::Ground | End::Body(_) => false,
        }
    }
}

/// A virtual inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Body {
    /// J_w in kg·m² (linear: mass in kg), positive.
    pub inertia: f64,
    /// Initial position in rad (linear: m).
    pub position: f64,
    /// Initial velocity in rad/s (linear: m/s).
    pub velocity: f64,
}

/// A massless virtual element between two different ends. It acts on q = q_first - q_second, the first end as seen from the
/// second; its torque acts on the first end, the opposite on the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// The end that takes the law's torque.
    pub first: End,
    /// The end that takes the opposite.
    pub second: End,
    /// The torque as a function of q and q̇.
    pub law: Law,
    /// The torque, on both ends, is held within ±this: N·m (linear: N), positive; `None`: any. For the laws that
    /// take one ([`Law::takes_limit`]).
    pub limit: Option<f64>,
}

impl Coupling {
    /// Whether either end is a body.
    pub const fn is_at_body(&self) -> bool {
        self.first.body().is_some() || self.second.body().is_some()
    }

    /// As matrices; `None` for a nonlinear law, and for one with a limit.
    pub fn linear(&self) -> Option<Linear> {
        if self.limit.is_some() { None } else { self.law.linear() }
    }

    /// The energy in J that it stores at q, with the present deflection of a friction's bristle: a spring k (q - rest)²/2, a wall k (q -
    /// at)²/2 inside, a detent torque · pitch/2π · (1 - cos 2π(q - phase)/pitch), a constant -torque · q, bristles σ0 s²/2. With a limit a
    /// spring or wall stores k x²/2 up to the x at which it reaches its limit, and limit · x from there on; a dead band likewise, from its
    /// edge on. A magnet stores torque · width · √e · (1 - exp(-x²/2)), a texture its harmonics' energies, each from its lowest on.
    pub fn stored(&self, q: f64, bristle: f64) -> f64 {
        self.law.stored(q, bristle, self.limit.unwrap_or(f64::INFINITY))
    }

    /// Whether the method takes it. At a body, explicit methods evaluate a nonlinear torque at the start of the step, and those that hold
    /// their torques find it over the step; LuGre's bristle has no such step. The methods that take the new sample first would evaluate it
    /// at the start of the step, where it generates energy, and so does a constant. An integral term, an assist and a torque along the
    /// acceleration are allowed only between puck and ground.
    pub fn goes_with(&self, method: Method) -> bool {
        if !self.is_at_body() {
            return true;
        }
        if self.law.is_at_puck() {
            return false;
        }
        if self.law.has_bristle() {
            return method.is_explicit();
        }
        let is_straight = self.linear().is_some() && self.law.constant().is_none();
        is_straight || !method.takes_new_sample_first()
    }
}

impl Law {
    /// This law between two ends, without a limit.
    pub const fn between(self, first: End, second: End) -> Coupling {
        Coupling { first, second, law: self, limit: None }
    }
}

/// The sign with which the torque of a coupling between these ends acts on the puck; 0 where it is not tied to it.
pub(crate) const fn sign_at_puck(first: End, second: End) -> f64 {
    match (first.is_puck(), second.is_puck()) {
        (true, false) => 1.0,
        (false, true) => -1.0,
        (true, true) | (false, false) => 0.0,
    }
}

crate::named! {
    /// The rule that takes the bodies over one period. x = (positions, velocities), u = (z, ż) of the puck.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub enum Method {
        /// x_{k+1} = x_k + T f(x_k, u_k)
        ForwardEuler => "forward-euler",
        /// x_{k+1} = x_k + T f(x_{k+1}, u_k)
        BackwardEuler => "backward-euler",
        /// v_{k+1} = v_k + T a(x_k, v_k, u_k), then positions x_{k+1} = x_k + T v_{k+1}
        SemiImplicitEuler => "semi-implicit-euler",
        /// x_{k+1} = x_k + T/2 (f(x_k, u_k) + f(x_{k+1}, u_k))
        Trapezoidal => "trapezoidal",
        /// Exact for u held at u_k over the step.
        Zoh => "zoh",
        /// Classical Runge-Kutta, u held at u_k.
        Rk4 => "rk4",
        /// x_k = x_{k-1} + T/2 (f(x_{k-1}, u_{k-1}) + f(x_k, u_k))
        Tustin => "tustin",
        /// Exact for u running straight from u_{k-1} to u_k.
        Foh => "foh",
    }
}

impl Method {
    /// Whether the method takes the new sample first and the torque from x_k afterwards (`tustin`, `foh`); the others hold
    /// u_k over the coming step.
    pub const fn takes_new_sample_first(self) -> bool {
        match self {
            Method::Tustin | Method::Foh => true,
            Method::ForwardEuler
            | Method::BackwardEuler
            | Method::SemiImplicitEuler
            | Method::Trapezoidal
            | Method::Zoh
            | Method::Rk4 => false,
        }
    }

    /// Whether a step has stages in between, at which nonlinear torques are taken anew.
    pub const fn has_stages(self) -> bool {
        match self {
            Method::Rk4 => true,
            Method::ForwardEuler
            | Method::BackwardEuler
            | Method::SemiImplicitEuler
            | Method::Trapezoidal
            | Method::Zoh
            | Method::Tustin
            | Method::Foh => false,
        }
    }

    /// Whether a body's nonlinear torque is found so that the step gains no energy (the discrete-gradient step).
    pub const fn finds_torques(self) -> bool {
        match self {
            Method::Zoh | Method::Trapezoidal | Method::BackwardEuler => true,
            Method::ForwardEuler | Method::SemiImplicitEuler | Method::Rk4 | Method::Tustin | Method::Foh => false,
        }
    }

    /// Whether the rule evaluates a body's nonlinear torque at the present state (the explicit ones).
    pub const fn is_explicit(self) -> bool {
        match self {
            Method::ForwardEuler | Method::SemiImplicitEuler | Method::Rk4 => true,
            Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Tustin | Method::Foh => false,
        }
    }
}

crate::named! {
    /// Which state of the bodies gives the torque of sample k.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub enum Output {
        /// x_k, as the notes' diagrams have it.
        Start => "start",
        /// (x_k + x_{k+1})/2
        Middle => "middle",
        /// The positions of x_{k+1} with the mean velocities over the step, (w_{k+1} - w_k)/T.
        End => "end",
    }
}

/// How the loop gets the puck's velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Estimator {
    /// The true velocity.
    Exact,
    /// v_k = (z_k - z_{k-1})/T
    Difference,
    /// v_k = (τ v_{k-1} + z_k - z_{k-1})/(τ + T), τ = 1/(2π cutoff)
    LowPass {
        /// Hz, positive.
        cutoff: f64,
    },
    /// First-order adaptive windowing, end-fit (Janabi-Sharifi et al., IEEE TCST 8(6), 2000).
    Foaw {
        /// The largest window in samples, positive.
        window: u32,
    },
    /// The same with the least-squares slope over the window.
    FoawBest {
        /// The largest window in samples, positive.
        window: u32,
    },
    /// v_k = (z_k - z_{k-n})/(nT), n = `every`; before its first sample the puck counts as at rest.
    DifferenceOver {
        /// n in samples, positive.
        every: u32,
    },
    /// The steady Kalman filter of a puck whose jerk is white noise, which predicts with a constant acceleration ([`crate::kalman_gains`]).
    Kalman {
        /// Hz, positive.
        cutoff: f64,
    },
    /// The first-order sliding-mode differentiator with an implicit step (Levant, Automatica 34(3), 1998; Brogliato, Polyakov and Efimov,
    /// IEEE TAC 65(8), 2020).
    Levant {
        /// L in rad/s² (linear: m/s²), positive: the largest acceleration that it follows exactly.
        acceleration: f64,
    },
}

/// The whole loop: what [`crate::Loop::new`] compiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec<'a> {
    /// T in s, positive.
    pub period: f64,
    /// The integrator.
    pub method: Method,
    /// Which state gives the torque; only `Start` with the methods that take the new sample first.
    pub output: Output,
    /// With `End` only: further steps ahead for the torque, puck held still; at most 1000.
    pub advance: u32,
    /// The bodies step by this many periods, at every such sample, and stand still in between; from 1 (every sample) to 1000. More than 1
    /// needs a body, a method that holds u_k, no `advance`, and no LuGre friction at a body.
    pub bodies_every: u32,
    /// The puck's velocity.
    pub estimator: Estimator,
    /// Hz, positive: bodies and couplings see the measured position behind one pole, y_k = y_{k-1} + (1 - e^{-2π filter T}) (z_k - y_{k-1}),
    /// y_0 = z_0. The velocity is that of z. `None`: they see z.
    pub filter: Option<f64>,
    /// The size of one encoder count in rad (linear: m), positive; `None`: ideal.
    pub count: Option<f64>,
    /// The largest torque that may be commanded, positive; `None`: any.
    pub limit: Option<f64>,
    /// Steps of 2 limit/levels, positive and even, with a limit only; `None`: ideal.
    pub levels: Option<u32>,
    /// The virtual inertias.
    pub bodies: &'a [Body],
    /// The virtual elements between them, the puck and ground.
    pub couplings: &'a [Coupling],
}

impl Spec<'_> {
    /// A loop of `period` seconds without bodies and couplings, on an ideal device: the torque of the end of each step of zoh, the true velocity.
    pub const fn new(period: f64) -> Self {
        Spec {
            period,
            method: Method::Zoh,
            output: Output::End,
            advance: 0,
            bodies_every: 1,
            estimator: Estimator::Exact,
            filter: None,
            count: None,
            limit: None,
            levels: None,
            bodies: &[],
            couplings: &[],
        }
    }

    /// The time in s over which the bodies step: `bodies_every` periods.
    pub fn step(&self) -> f64 {
        f64::from(self.bodies_every) * self.period
    }

    /// The time in s by which a compensating damper multiplies its springs: the bodies' step at a body, else the period.
    pub(crate) fn compensates_over(&self, damper: &Coupling) -> f64 {
        if damper.is_at_body() { self.step() } else { self.period }
    }
}
