//! One sample of the world under a method, in increment form:
//!
//! ```text
//! x_{k+1} = x_k + d x_k + current u_k + constant                          the six held methods
//! x_k = x_{k-1} + d x_{k-1} + previous u_{k-1} + current u_k + constant   tustin and foh
//! torque_k = torque.state x_k + torque.puck u_k + torque.constant
//! ```
//!
//! x = (positions, velocities) of the bodies, u = (z, ż) of the puck: `current` multiplies the newest sample that the step
//! takes, `previous` the one before, which is 0 for the held methods.
//!
//! `d` is A_d - 1 of (2.7), computed without that subtraction: at T = 1 ms a wheel of 1 Hz changes A_d by only 6e-3, and its
//! growth is eight digits smaller.
//!
//! Every held step is Δ = F (A x + B u + f): the method determines F.
//!
//! | method | F | why |
//! | --- | --- | --- |
//! | forward Euler | T | its definition, (2.8) |
//! | backward Euler | T (1 - TA)⁻¹ | Δ = T (A (x + Δ) + B u + f) |
//! | semi-implicit Euler | T \[\[1, T\], \[0, 1\]\] | the positions take v + Δv |
//! | trapezoidal | T (1 - TA/2)⁻¹ | Δ = T (A (x + Δ/2) + B u + f) |
//! | zoh | T φ₁(TA) | ∫ e^{At} dt over the step |
//! | rk4 | T (1 + TA/2 + (TA)²/6 + (TA)³/24) | its four slopes, inserted |
//! | tustin | as trapezoidal | u is the mean of both samples |
//! | foh | as zoh | u's slope enters by T φ₂(TA) = ∫ e^{A(T-t)} t/T dt |

use hapt_model::{Method, Output};
use nalgebra::{DMatrix, DVector, RowDVector};

use crate::equations::continuous::{Continuous, Torque};
use crate::error::{Error, positive};
use crate::numerics::balance::{balance, scaled, unscaled};
use crate::numerics::phi::phi;

/// One sample of a world of n bodies, see the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// 2n × 2n, A_d - 1.
    pub d: DMatrix<f64>,
    /// 2n × 2, on u_{k-1}.
    pub previous: DMatrix<f64>,
    /// 2n × 2, on u_k.
    pub current: DMatrix<f64>,
    /// 2n.
    pub constant: DVector<f64>,
    /// The torque on the puck, before levels and limit, as a function of x_k and u_k.
    pub torque: Torque,
}

impl Discrete {
    /// Discretises `world` at `period`, which also sets the compensating dampers. The torque is that of the state which `output`
    /// names; for `Output::End`, after `advance` further steps with the puck held. Work grows with `advance` n².
    ///
    /// # Errors
    /// [`Error::Value`] for a period that is not positive, [`Error::Output`] for `tustin` and `foh` with anything but
    /// `Output::Start`, [`Error::Step`] when a matrix leaves double precision.
    pub fn new(world: &Continuous, method: Method, output: Output, advance: u32, period: f64) -> Result<Self, Error> {
        positive("the period", period)?;
        if method.takes_new_sample_first() && (output != Output::Start || advance > 0) {
            return Err(Error::Output { method, output });
        }
        let rates = world.rates(period);
        let n = world.bodies();
        let (f, slope) = filter(method, &rates.a, n, period).ok_or(Error::Step { method })?;
        let all = &f * &rates.b;
        let (previous, current) = match method {
            Method::Tustin => (&all * 0.5, &all * 0.5),
            Method::Foh => {
                let current = slope * &rates.b;
                (&all - &current, current)
            }
            Method::ForwardEuler
            | Method::BackwardEuler
            | Method::SemiImplicitEuler
            | Method::Trapezoidal
            | Method::Zoh
            | Method::Rk4 => (DMatrix::zeros(2 * n, 2), all),
        };
        let mut discrete = Discrete {
            d: &f * &rates.a,
            previous,
            current,
            constant: &f * &rates.constant,
            torque: world.torque(period),
        };
        discrete.torque = discrete.output(output, advance, period);
        let finite =
            [&discrete.d, &discrete.previous, &discrete.current].iter().all(|m| m.iter().all(|x| x.is_finite()))
                && discrete.constant.iter().chain(discrete.torque.state.iter()).all(|x| x.is_finite());
        if finite { Ok(discrete) } else { Err(Error::Step { method }) }
    }

    /// The torque for the state that `output` selects; `self.torque` is the law at an instant.
    fn output(&self, output: Output, advance: u32, period: f64) -> Torque {
        let law = &self.torque;
        let n = self.constant.len() / 2;
        match output {
            Output::Start => law.clone(),
            // h·(x + x')/2 = h·x + h·Δ/2
            Output::Middle => self.after(&law.state, &(&law.state * 0.5), law, false),
            // The positions of x' with the mean velocities, (w' - w)/T = Δ_w/T.
            Output::End => {
                let positions = RowDVector::from_fn(2 * n, |_, j| if j < n { law.state[j] } else { 0.0 });
                let change =
                    RowDVector::from_fn(
                        2 * n,
                        |_, j| if j < n { law.state[j] + law.state[n + j] / period } else { 0.0 },
                    );
                // Backwards: each step expresses the row by the state before. Only the step from x_k has the puck's velocity;
                // in the later ones the puck rests at z_k.
                let mut torque = self.after(&positions, &change, law, advance > 0);
                for step in 1..=advance {
                    let row = torque.state.clone();
                    torque.state.fill(0.0);
                    torque = self.after(&row, &row, &torque, step < advance);
                }
                torque
            }
        }
    }

    /// `on_state`·x + `on_change`·(x' - x) as a function of (x, u), added to the puck's part and constant of `rest`;
    /// `standing` omits the puck's velocity.
    fn after(&self, on_state: &RowDVector<f64>, on_change: &RowDVector<f64>, rest: &Torque, standing: bool) -> Torque {
        let input = on_change * &self.current;
        Torque {
            state: on_state + on_change * &self.d,
            puck: [rest.puck[0] + input[0], rest.puck[1] + if standing { 0.0 } else { input[1] }],
            constant: rest.constant + (on_change * &self.constant)[0],
        }
    }
}

/// F of the module documentation, and T φ₂(TA) for foh (otherwise empty), for the state (positions, velocities) of `n` bodies.
/// The computation uses balanced coordinates, because in SI positions and velocities of a stiff world differ by many powers
/// of ten. `None` when a solve fails.
fn filter(method: Method, a: &DMatrix<f64>, n: usize, period: f64) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let x = a * period;
    let one = DMatrix::<f64>::identity(2 * n, 2 * n);
    let s = balance(&x);
    let x = scaled(&x, &s);
    if !x.iter().all(|v| v.is_finite()) {
        return None;
    }
    let mut slope = DMatrix::zeros(2 * n, 2 * n);
    let f = match method {
        Method::ForwardEuler => one,
        Method::BackwardEuler => (one - &x).lu().try_inverse()?,
        Method::Trapezoidal | Method::Tustin => (one - &x * 0.5).lu().try_inverse()?,
        Method::Zoh => phi(&x).0,
        Method::Foh => {
            let (phi1, phi2) = phi(&x);
            slope = unscaled(&phi2, &s) * period;
            phi1
        }
        Method::Rk4 => {
            let third = &one + &x * 0.25;
            let second = &one + &x * third / 3.0;
            &one + &x * second * 0.5
        }
        Method::SemiImplicitEuler => {
            // The upper right block of A is 1 for the n bodies, so T times it is that of X.
            let mut f = one;
            f.view_mut((0, n), (n, n)).copy_from(&x.view((0, n), (n, n)));
            f
        }
    };
    Some((unscaled(&f, &s) * period, slope))
}

/// Whether a step with the puck held does not raise the energy of any world of springs and dampers, nor with the discrete gradient of nonlinear
/// couplings.
pub(crate) fn keeps_energy(method: Method) -> bool {
    match method {
        Method::Zoh | Method::Trapezoidal | Method::BackwardEuler => true,
        Method::ForwardEuler | Method::SemiImplicitEuler | Method::Rk4 | Method::Tustin | Method::Foh => false,
    }
}
