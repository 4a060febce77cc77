//! The part of the world that contains the puck, in modal coordinates of the held world.
//!
//! With w = M^{-1/2} V y the bodies coupled to the puck obey ÿ + C ẏ + Ω² y = g z + c ż, and the torque on the puck is
//! gᵀ y + cᵀ ẏ - K z - B ż. A method is an affine map of positions and velocities, so it applies to y as well as to w. In y the
//! equations separate into blocks:
//!
//! * A mode that moves neither a damper nor a coupling to the puck is `unobservable` from it. It keeps the eigenvalues of the held
//!   world, with their closed forms. The same holds for one whose only damping is T times its stiffness.
//! * A mode that moves no damper but a spring to the puck is a block of its own.
//! * All modes that move dampers, and velocities without a restoring spring, form one block.
//!
//! Shifts are found on the graph of springs, not by rounding. A cluster of bodies without a spring to puck or ground can shift by itself;
//! its position is not a coordinate here. The puck with all bodies that springs join to it can shift without torque unless a spring joins
//! it to ground. Then Ω² η = g, where η is that shift in y, and the coordinates y - η z are invariant under it.

use hapt_model::Handle;
use nalgebra::{DMatrix, DVector};

use crate::equations::continuous::Continuous;
use crate::equations::grip::Grip;
use crate::equations::laws::Acceleration;
use crate::equations::modal::{Coupled, Modal, UndampedModes, form, hcat, of_one_frequency, reach, rows, separate};
use crate::equations::structure::{Link, Part, first_fixed};
use crate::error::Error;

/// Modes that dampers couple, or one undamped mode. The equations contain the puck's row and column, but 0 on its diagonal: that
/// part is [`Port::stiffness`] and the dampings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Block {
    /// ÿ + (C0 + T C1) ẏ + Ω² y = g z + c ż: unit inertias.
    pub equations: Continuous,
    /// Number of modes with a position; they come first.
    pub positions: usize,
    /// η of the module documentation, one per mode.
    pub shift: DVector<f64>,
}

/// See the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Port {
    /// J_z in kg·m², plus the inertia of a gripping hand.
    pub inertia: f64,
    /// The spring of a gripping hand, from the puck to ground, N·m/rad; 0: none.
    pub spring: f64,
    /// The time constant with which the motor's torque follows its command, s; 0: at once.
    pub lag: f64,
    /// A handle on a shaft, with the hand on it; `None`: the hand is on the puck.
    pub handle: Option<(Handle, Grip)>,
    pub blocks: Vec<Block>,
    /// Of all couplings at the puck: N·m/rad.
    pub stiffness: f64,
    /// Of all dampers at the puck, N·m·s/rad.
    pub fixed: f64,
    /// Of all compensating dampers at the puck, per second of period.
    pub per_period: f64,
    /// Of all integral terms at the puck: N·m/(rad·s).
    pub integral: f64,
    /// All torques along the acceleration at the puck.
    pub accelerations: Vec<Acceleration>,
    /// Whether springs or integral terms join the puck to ground, directly or through bodies.
    pub grounded: bool,
    /// Shifts that change no torque: eigenvalues of exactly 1.
    pub shifts: usize,
    /// The modes that are decoupled from the puck.
    pub unobservable: Modal,
}

/// Whether the link is between a body and the puck, which is the part's first member.
fn at_puck(link: &Link) -> bool {
    link.body == 0 && link.other.is_some()
}

/// 1 or 0.
fn one_if(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}

impl Port {
    /// The port of a part whose first member is the puck.
    ///
    /// # Errors
    /// [`Error::Eigenvalues`] when a frequency or damping is beyond double precision.
    pub fn new(part: &Part) -> Result<Self, Error> {
        let bodies = first_fixed(part);
        let n = bodies.inertia.len();
        // The links to the puck, as links of their bodies to the fixed side.
        let puck_links =
            Part { links: part.links.iter().filter(|l| at_puck(l)).map(Link::held).collect(), ..bodies.clone() };
        let grounded = part.integral > 0.0 || part.clusters.iter().any(|c| c.anchored && c.bodies.contains(&0));
        let shifted: Vec<usize> = part
            .clusters
            .iter()
            .filter(|c| c.bodies.contains(&0) && !grounded)
            .flat_map(|c| c.bodies.iter().filter_map(|b| b.checked_sub(1)))
            .collect();

        let UndampedModes { omega, modes, shifts } = UndampedModes::new(&bodies)?;
        let none = || DMatrix::<f64>::zeros(n, 0);
        let follows = bodies.links.iter().any(|l| l.per_period > 0.0);
        let difference = form(&bodies, &DMatrix::identity(n, n), |l| l.per_period - l.stiffness);
        let mut unobservable =
            Modal { unit_count: 0, undamped: vec![], compensated: vec![], coupled: Coupled::none(), shapes: none() };
        let (mut undamped_modes, mut damped, mut damped_omega) = (Vec::new(), none(), Vec::new());
        for (w, group) in of_one_frequency(&omega) {
            let shapes = modes.columns_range(group).into_owned();
            // Unit rows: the location of dampers and couplings counts, not their size.
            let dampers =
                |v: &DMatrix<f64>| rows(&bodies, v, |l, size| one_if(l.fixed > 0.0 || l.per_period > 0.0) / size);
            let puck = |v: &DMatrix<f64>| puck_rows(&puck_links, v);
            let (null, shapes) = separate(vcat(&[dampers(&shapes), puck(&shapes)]), shapes);
            unobservable.undamped.extend(std::iter::repeat_n(w, null.ncols()));
            let (null, shapes) = if follows {
                let fixed = rows(&bodies, &shapes, |l, size| one_if(l.fixed > 0.0) / size);
                let uncovered = &difference * &shapes / (w * w);
                separate(vcat(&[fixed, puck(&shapes), uncovered]), shapes)
            } else {
                (none(), shapes)
            };
            unobservable.compensated.extend(std::iter::repeat_n(w, null.ncols()));
            let (null, shapes) = separate(dampers(&shapes), shapes);
            undamped_modes.extend((0..null.ncols()).map(|j| (w, null.columns(j, 1).into_owned())));
            damped_omega.extend(std::iter::repeat_n(w, shapes.ncols()));
            damped = hcat(&damped, &shapes);
        }
        let block = |omega: &[f64], v: &DMatrix<f64>| Block {
            equations: equations(&bodies, &puck_links, omega, v),
            positions: omega.len(),
            shift: DVector::from_fn(v.ncols(), |j, _| {
                shifted.iter().map(|&i| bodies.inertia[i].sqrt() * v[(i, j)]).sum::<f64>()
            }),
        };
        let mut blocks: Vec<Block> = undamped_modes.iter().map(|(w, v)| block(&[*w], v)).collect();
        let damped = hcat(&damped, &shifts);
        if damped.ncols() > 0 {
            blocks.push(block(&damped_omega, &damped));
        }
        let own = |of: fn(&Link) -> f64| part.links.iter().filter(|l| l.body == 0).map(of).sum::<f64>();
        let port = Port {
            inertia: part.inertia[0],
            spring: 0.0,
            lag: 0.0,
            handle: None,
            blocks,
            stiffness: own(|l| l.stiffness),
            fixed: own(|l| l.fixed),
            per_period: own(|l| l.per_period),
            integral: part.integral,
            accelerations: part.accelerations.clone(),
            grounded,
            shifts: shifts.ncols() + usize::from(!grounded),
            unobservable,
        };
        if port.is_finite() { Ok(port) } else { Err(Error::Eigenvalues { order: 2 * n + 2 }) }
    }

    /// The port with a hand on the handle, or on the puck, and the damping of the puck: `damping` is that of the device. With a spring,
    /// the puck can no longer shift freely.
    pub fn gripped(mut self, damping: f64, grip: &Grip) -> (Port, f64) {
        if grip.stiffness > 0.0 && !self.grounded {
            self.grounded = true;
            self.shifts -= 1;
        }
        if let Some((_, hand)) = &mut self.handle {
            *hand = *grip;
            return (self, damping);
        }
        self.inertia += grip.inertia;
        self.spring += grip.stiffness;
        (self, damping + grip.damping)
    }

    /// The port with a spring of the device's own between puck and ground; one below 0 pushes the puck away.
    pub fn anchored(mut self, stiffness: f64) -> Port {
        if stiffness != 0.0 && !self.grounded {
            self.grounded = true;
            self.shifts -= 1;
        }
        self.spring += stiffness;
        self
    }

    /// The port with this handle on a shaft, free.
    pub fn with_handle(mut self, handle: Option<Handle>) -> Port {
        self.handle = handle.map(|handle| (handle, Grip::default()));
        self
    }

    /// The port with a motor whose torque follows its command with this time constant, s.
    pub fn lagging(mut self, lag: f64) -> Port {
        self.lag = lag;
        self
    }

    /// Whether no coupling acts on the puck.
    pub fn is_uncoupled(&self) -> bool {
        self.stiffness == 0.0 && self.integral == 0.0 && !self.takes_velocity()
    }

    /// Whether the torque depends on the estimated velocity of the puck.
    pub fn takes_velocity(&self) -> bool {
        self.has_damper() || !self.accelerations.is_empty()
    }

    /// Whether a damper acts on the puck.
    pub fn has_damper(&self) -> bool {
        self.fixed > 0.0 || self.per_period > 0.0
    }

    fn is_finite(&self) -> bool {
        let matrices =
            self.blocks.iter().flat_map(|b| [&b.equations.stiffness, &b.equations.fixed, &b.equations.per_period]);
        let numbers = [self.inertia, self.stiffness, self.fixed, self.per_period, self.integral];
        let inertias = self.accelerations.iter().map(|a| &a.inertia);
        matrices.flat_map(|m| m.iter()).chain(&numbers).chain(inertias).all(|x| x.is_finite())
    }

    /// The longest time constant of the equations in s, with a device damping of `damping`; 0 when there is none.
    pub fn slowest(&self, damping: f64) -> f64 {
        let times = |inertia: f64, damping: f64, stiffness: f64| {
            [inertia / damping, damping / stiffness, (inertia / stiffness).sqrt()]
        };
        let mut all = times(self.inertia, damping + self.fixed, self.stiffness).to_vec();
        all.push(self.lag);
        all.extend(self.accelerations.iter().map(|a| a.tau));
        // The integral with a spring, a damping and an inertia.
        let (k, b) = (self.stiffness / self.integral, (damping + self.fixed) / self.integral);
        all.extend([k, b.sqrt(), (self.inertia / self.integral).cbrt()]);
        all.extend(times(self.inertia, damping, self.stiffness));
        if let Some((Handle { inertia, stiffness, damping }, grip)) = self.handle {
            all.extend(times(inertia + grip.inertia, damping + grip.damping, stiffness));
        }
        for Block { equations: e, .. } in &self.blocks {
            all.extend((0..e.bodies()).flat_map(|i| times(1.0, e.fixed[(i, i)], e.stiffness[(i, i)])));
        }
        all.into_iter().filter(|t| t.is_finite()).fold(0.0, f64::max)
    }
}

/// The equations of modes v = V with frequencies `omega`, those without one last, and of the puck.
fn equations(bodies: &Part, puck_links: &Part, omega: &[f64], v: &DMatrix<f64>) -> Continuous {
    let m = v.ncols();
    let mut all = Continuous {
        inertia: DVector::from_element(m, 1.0),
        stiffness: DMatrix::zeros(m + 1, m + 1),
        fixed: DMatrix::zeros(m + 1, m + 1),
        per_period: DMatrix::zeros(m + 1, m + 1),
        force: DVector::zeros(m + 1),
    };
    for (i, w) in omega.iter().enumerate() {
        all.stiffness[(i, i)] = w * w;
    }
    let weights: [fn(&Link) -> f64; 3] = [|l| l.stiffness, |l| l.fixed, |l| l.per_period];
    for (matrix, weight) in [&mut all.stiffness, &mut all.fixed, &mut all.per_period].into_iter().zip(weights) {
        for link in puck_links.links.iter().filter(|l| weight(l) > 0.0) {
            let across = reach(bodies, link).transpose() * v;
            for j in 0..m {
                matrix[(j, m)] -= weight(link) * across[j];
                matrix[(m, j)] -= weight(link) * across[j];
            }
        }
    }
    for (matrix, weight) in [(&mut all.fixed, weights[1]), (&mut all.per_period, weights[2])] {
        let inner = form(bodies, v, weight);
        matrix.view_mut((0, 0), (m, m)).copy_from(&inner);
    }
    all
}

/// The force of each mode on the puck by springs, by dampers and by compensating dampers, relative to the largest that a mode
/// could exert. The contributions of several couplings add up or cancel.
fn puck_rows(puck_links: &Part, v: &DMatrix<f64>) -> DMatrix<f64> {
    let weights: [fn(&Link) -> f64; 3] = [|l| l.stiffness, |l| l.fixed, |l| l.per_period];
    let mut seen = DMatrix::zeros(3, v.ncols());
    for (mut row, weight) in seen.row_iter_mut().zip(weights) {
        let all = || puck_links.links.iter().map(|l| (reach(puck_links, l), weight(l)));
        let most: f64 = all().map(|(across, weight)| across.norm() * weight).sum();
        if most > 0.0 {
            all().for_each(|(across, weight)| row += across.transpose() * v * (weight / most));
        }
    }
    seen
}

/// Concatenates matrices vertically.
fn vcat(parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let columns = parts.first().map_or(0, |p| p.ncols());
    let mut all = DMatrix::zeros(parts.iter().map(|p| p.nrows()).sum(), columns);
    let mut row = 0;
    for part in parts {
        all.rows_mut(row, part.nrows()).copy_from(part);
        row += part.nrows();
    }
    all
}
