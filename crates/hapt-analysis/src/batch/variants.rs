//! Variants of one world with different numbers, as [`Loops`].

use hapt_model::World;

use crate::batch::loops::Loops;
use crate::equations::continuous::compensated_by;
use crate::equations::laws::{LinearLaw, linear_law};
use crate::stability::single_body::{SingleBody, is_at_body};

/// A parameter of the held loop of the only body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// The period.
    Period,
    /// The samples to a step of the body.
    BodiesEvery,
    /// The body's inertia.
    Inertia,
    /// The stiffness of a spring or the damping of a damper at the body: the coupling's index.
    Coupling(usize),
}

impl Parameter {
    /// The parameter at a dotted path of the world file; `None` where the held loop does not depend on it.
    pub fn of(world: &World, path: &str) -> Option<Parameter> {
        let names: Vec<&str> = path.split('.').map(str::trim).collect();
        match names[..] {
            ["loop", "period"] => Some(Parameter::Period),
            ["loop", "bodies_every"] => Some(Parameter::BodiesEvery),
            ["bodies", _, "inertia"] => Some(Parameter::Inertia),
            ["couplings", index, name] => {
                let index = index.parse().ok()?;
                let coupling = world.couplings.get(index).filter(|coupling| is_at_body(coupling) == Some(true))?;
                let hangs = match (linear_law(coupling)?, name) {
                    (LinearLaw::Spring(..), "stiffness") => true,
                    (LinearLaw::Damper(_) | LinearLaw::Compensating, "damping") => true,
                    (
                        LinearLaw::Spring(..) | LinearLaw::Damper(_) | LinearLaw::Compensating | LinearLaw::Constant(_),
                        _,
                    ) => false,
                };
                hangs.then_some(Parameter::Coupling(index))
            }
            _ => None,
        }
    }
}

/// N variants of the held loop of a world with one body on springs and dampers.
#[derive(Clone, Debug)]
pub struct Variants<const N: usize> {
    inertia: [f64; N],
    period: [f64; N],
    /// The samples to a step of the body, and the step in s.
    every: [f64; N],
    step: [f64; N],
    /// The couplings at the body, in file order.
    terms: Vec<Term<N>>,
    /// Their sums: K, C0 and C1.
    sums: [[f64; N]; 3],
}

#[derive(Clone, Debug)]
struct Term<const N: usize> {
    /// The coupling's index.
    coupling: usize,
    kind: Kind,
    value: [f64; N],
}

#[derive(Clone, Debug)]
enum Kind {
    Spring,
    Damper,
    /// A compensating damper, with the indices of its springs.
    Following(Vec<usize>),
}

impl<const N: usize> Variants<N> {
    /// N copies of the loop of a world with exactly one body; `None` for any other, with a nonlinear coupling at the body, or with a handle
    /// on a shaft.
    pub fn new(world: &World) -> Option<Self> {
        if world.device.handle.is_some() {
            return None;
        }
        SingleBody::of_world(&world.bodies, &world.couplings)?;
        let at_body = |(coupling, of): (usize, &hapt_model::Coupling)| {
            if is_at_body(of) != Some(true) {
                return None;
            }
            let (kind, value) = match linear_law(of)? {
                LinearLaw::Spring(stiffness, _) => (Kind::Spring, stiffness),
                LinearLaw::Damper(damping) => (Kind::Damper, damping),
                LinearLaw::Compensating => {
                    let counts = |i: &usize| compensated_by(of, &world.couplings[*i]);
                    (Kind::Following((0..world.couplings.len()).filter(counts).collect()), 0.0)
                }
                LinearLaw::Constant(_) => return None,
            };
            Some(Term { coupling, kind, value: [value; N] })
        };
        let inertia = world.bodies.first()?.inertia;
        Some(Variants {
            inertia: [inertia; N],
            period: [world.sampling.period; N],
            every: [f64::from(world.sampling.bodies_every); N],
            step: [world.sampling.step(); N],
            terms: world.couplings.iter().enumerate().filter_map(at_body).collect(),
            sums: [[0.0; N]; 3],
        })
    }

    /// Sets a parameter of one variant.
    pub fn set(&mut self, lane: usize, number: Parameter, value: f64) {
        let column = match number {
            Parameter::Period => Some(&mut self.period),
            Parameter::BodiesEvery => Some(&mut self.every),
            Parameter::Inertia => Some(&mut self.inertia),
            Parameter::Coupling(index) => {
                self.terms.iter_mut().find(|term| term.coupling == index).map(|term| &mut term.value)
            }
        };
        if let Some(place) = column.and_then(|column| column.get_mut(lane)) {
            *place = value;
        }
    }

    /// The loops with the present parameters.
    pub fn loops(&mut self) -> Loops<'_> {
        self.step = std::array::from_fn(|i| self.every[i] * self.period[i]);
        // The same order of summation as for a single world, so that the bits agree.
        self.sums = [[0.0; N]; 3];
        let [stiffness, fixed, per_period] = &mut self.sums;
        let add = |sum: &mut [f64; N], value: &[f64; N]| sum.iter_mut().zip(value).for_each(|(sum, x)| *sum += x);
        for term in &self.terms {
            match &term.kind {
                Kind::Spring => add(stiffness, &term.value),
                Kind::Damper => add(fixed, &term.value),
                Kind::Following(couplings) => {
                    let mut own = [0.0; N];
                    let springs = self.terms.iter().filter(|term| couplings.contains(&term.coupling));
                    springs.for_each(|spring| add(&mut own, &spring.value));
                    add(per_period, &own);
                }
            }
        }
        let [stiffness, fixed, per_period] = &self.sums;
        Loops { inertia: &self.inertia, stiffness, fixed, per_period, period: &self.step }
    }
}
