//! The loops of one world with other numbers: what [`Loops`] of them are made of.

use hapt_model::World;

use crate::batch::loops::Loops;
use crate::equations::continuous::compensated_by;
use crate::equations::laws::{Straight, straight};
use crate::stability::single_body::{Lone, touches};

/// A number on which the loop of the only body hangs, the puck held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// The period.
    Period,
    /// The body's inertia.
    Inertia,
    /// The stiffness of a spring or the damping of a damper at the body: the coupling's index.
    Coupling(usize),
}

impl Number {
    /// The number under a dotted path of the world file; `None` where the held loop does not hang on it.
    pub fn of(world: &World, path: &str) -> Option<Number> {
        let names: Vec<&str> = path.split('.').map(str::trim).collect();
        match names[..] {
            ["loop", "period"] => Some(Number::Period),
            ["bodies", _, "inertia"] => Some(Number::Inertia),
            ["couplings", index, name] => {
                let index = index.parse().ok()?;
                let coupling = world.couplings.get(index).filter(|coupling| touches(coupling) == Some(true))?;
                let hangs = match (straight(coupling)?, name) {
                    (Straight::Spring(..), "stiffness") => true,
                    (Straight::Damper(_) | Straight::Compensating, "damping") => true,
                    (
                        Straight::Spring(..) | Straight::Damper(_) | Straight::Compensating | Straight::Constant(_),
                        _,
                    ) => false,
                };
                hangs.then_some(Number::Coupling(index))
            }
            _ => None,
        }
    }
}

/// N loops of a world, its only body on springs and dampers, the puck held.
#[derive(Clone, Debug)]
pub struct Wheels<const N: usize> {
    inertia: [f64; N],
    period: [f64; N],
    /// At the body, in the world's order.
    ties: Vec<Tie<N>>,
    /// Their sums: K, C0 and C1.
    sums: [[f64; N]; 3],
}

#[derive(Clone, Debug)]
struct Tie<const N: usize> {
    /// The coupling's index.
    coupling: usize,
    kind: Kind,
    value: [f64; N],
}

#[derive(Clone, Debug)]
enum Kind {
    Spring,
    Damper,
    /// Follows the springs of these couplings.
    Following(Vec<usize>),
}

impl<const N: usize> Wheels<N> {
    /// N times the loop of the world; `None` where it has not one body, or has a nonlinear coupling at it.
    pub fn new(world: &World) -> Option<Self> {
        Lone::of_world(&world.bodies, &world.couplings)?;
        let at_body = |(coupling, of): (usize, &hapt_model::Coupling)| {
            if touches(of) != Some(true) {
                return None;
            }
            let (kind, value) = match straight(of)? {
                Straight::Spring(stiffness, _) => (Kind::Spring, stiffness),
                Straight::Damper(damping) => (Kind::Damper, damping),
                Straight::Compensating => {
                    let counts = |i: &usize| compensated_by(of, &world.couplings[*i]);
                    (Kind::Following((0..world.couplings.len()).filter(counts).collect()), 0.0)
                }
                Straight::Constant(_) => return None,
            };
            Some(Tie { coupling, kind, value: [value; N] })
        };
        let inertia = world.bodies.first()?.inertia;
        Some(Wheels {
            inertia: [inertia; N],
            period: [world.sampling.period; N],
            ties: world.couplings.iter().enumerate().filter_map(at_body).collect(),
            sums: [[0.0; N]; 3],
        })
    }

    /// Sets a number of one of the loops.
    pub fn set(&mut self, lane: usize, number: Number, value: f64) {
        let column = match number {
            Number::Period => Some(&mut self.period),
            Number::Inertia => Some(&mut self.inertia),
            Number::Coupling(index) => self.ties.iter_mut().find(|tie| tie.coupling == index).map(|tie| &mut tie.value),
        };
        if let Some(place) = column.and_then(|column| column.get_mut(lane)) {
            *place = value;
        }
    }

    /// The loops as they now are.
    pub fn loops(&mut self) -> Loops<'_> {
        // In the order in which a world's own are summed.
        self.sums = [[0.0; N]; 3];
        let [stiffness, fixed, following] = &mut self.sums;
        let add = |sum: &mut [f64; N], value: &[f64; N]| sum.iter_mut().zip(value).for_each(|(sum, x)| *sum += x);
        for tie in &self.ties {
            match &tie.kind {
                Kind::Spring => add(stiffness, &tie.value),
                Kind::Damper => add(fixed, &tie.value),
                Kind::Following(couplings) => {
                    let mut own = [0.0; N];
                    let springs = self.ties.iter().filter(|tie| couplings.contains(&tie.coupling));
                    springs.for_each(|spring| add(&mut own, &spring.value));
                    add(following, &own);
                }
            }
        }
        let [stiffness, fixed, following] = &self.sums;
        Loops { inertia: &self.inertia, stiffness, fixed, following, period: &self.period }
    }
}
