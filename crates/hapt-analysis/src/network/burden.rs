//! The damping that links require of the stations' devices: the matrix M of the network, and what keeps it from being indefinite.

use hapt_model::{EstimatorKind, LASTING, Law, Link, Station, System};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::error::Error;
use crate::passivity::timing::Timing;

/// To the safe side, in parts of a value.
const SAFE: f64 = 1e-9;

/// The parts of M.
pub(super) struct Burden {
    /// b_i: the least damping of each device.
    pub damping: Vec<f64>,
    /// d_i: what the world without links requires; `None` where no finite damping suffices.
    demand: Vec<Option<f64>>,
    links: Vec<LinkBurden>,
}

/// What a link requires of its two stations, per stiffness.
struct LinkBurden {
    between: [usize; 2],
    stiffness: f64,
    /// a_i and a_j, s.
    own: [f64; 2],
    /// A_ij + A_ji, s.
    ages: f64,
    /// The part of `ages` that is due to age_max.
    age_max: f64,
    damping: f64,
    /// What the station's own sampling requires per damping, at each end.
    own_damping: [f64; 2],
    late: [Late; 2],
}

/// What the mean velocity of the other end requires at an end per damping, (T64): the root of a factor on its ∫ż².
#[derive(Clone, Copy)]
struct Late {
    /// The contribution of the time for which a mean acts.
    lasting: f64,
    /// By age_max.
    aged: f64,
}

impl Late {
    /// The time between two samples, counted in message numbers, is too short by this factor at most.
    const SHORT: f64 = 9.0 / 8.0;

    fn of(network: &System, link: &Link, side: usize) -> Late {
        let own = &network.stations[link.between[side]];
        let other = &network.stations[link.between[1 - side]];
        let shortest = link.period.unwrap_or(other.world.sampling.period);
        let short = Late::SHORT / (1.0 + other.drift);
        let lasting = own.true_age(LASTING.max(own.hold() / shortest));
        Late { lasting: short * lasting, aged: short * own.true_age(link.age_max) / shortest }
    }

    fn gain(&self, age: f64) -> f64 {
        self.lasting.min(age * self.aged).sqrt()
    }
}

/// Whether (T64) bounds the damping of a link, with this station's estimate of its own puck's velocity.
pub(super) fn bounds_damping(station: &Station) -> bool {
    match station.world.sampling.estimator {
        EstimatorKind::Difference => station.world.sampling.every == 1,
        EstimatorKind::LowPass => true,
        EstimatorKind::Exact
        | EstimatorKind::Foaw
        | EstimatorKind::FoawBest
        | EstimatorKind::Kalman
        | EstimatorKind::Levant => false,
    }
}

/// What a link requires for the station's own sampling, per stiffness, s.
fn own(station: &Station, link: &Link) -> Result<f64, Error> {
    let timing = Timing::of(&station.world);
    let is_linear = link.limit.is_none() && matches!(link.law, Law::Spring { .. });
    if is_linear || timing.is_at_once() {
        return timing.of_laws([1.0, 0.0]);
    }
    // q depends on the other's puck too: its displacements are bounded one by one, as in (T46).
    Ok(2.0 * timing.longest / std::f64::consts::PI + timing.delay[1] + timing.lag[1])
}

/// Parts of the links' numbers: the stiffness of each, and the damping and age of all.
struct Parts<F> {
    stiffness: F,
    damping: f64,
    age: f64,
}

/// All of them.
fn whole() -> Parts<impl Fn(usize) -> f64> {
    Parts { stiffness: |_| 1.0, damping: 1.0, age: 1.0 }
}

impl Burden {
    pub fn of(network: &System, demand: &[Option<f64>]) -> Result<Burden, Error> {
        let mut links = Vec::new();
        for link in &network.links {
            let [one, other] = link.between.map(|at| &network.stations[at]);
            let age_max = 0.5 * (one.true_age(link.age_max) + other.true_age(link.age_max));
            let per_damping = |station: &Station| Timing::of(&station.world).of_laws([0.0, 1.0]);
            let lags: f64 = [one, other].iter().map(|station| station.world.device.lag_range()[1]).sum();
            links.push(LinkBurden {
                between: link.between,
                stiffness: link.stiffness(),
                own: [own(one, link)?, own(other, link)?],
                ages: 2.0 * age_max + lags,
                age_max,
                damping: link.damping,
                own_damping: [per_damping(one)?, per_damping(other)?],
                late: [0, 1].map(|side| Late::of(network, link, side)),
            });
        }
        let is_bounded = |at: usize| {
            let own = network.links.iter().filter(|link| link.damping > 0.0 && link.between.contains(&at));
            own.count() == 0 || bounds_damping(&network.stations[at])
        };
        let demand = demand.iter().enumerate().map(|(at, demand)| demand.filter(|_| is_bounded(at))).collect();
        let damping = network.stations.iter().map(|station| station.world.device.damping_range()[0]).collect();
        Ok(Burden { damping, demand, links })
    }

    /// M of links with these parts of their numbers; `None` where a station has no finite demand.
    fn matrix(&self, parts: &Parts<impl Fn(usize) -> f64>) -> Option<DMatrix<f64>> {
        let n = self.damping.len();
        let mut m = DMatrix::zeros(n, n);
        for i in 0..n {
            m[(i, i)] = self.damping[i] - self.demand[i]?;
        }
        for (index, link) in self.links.iter().enumerate() {
            let [i, j] = link.between;
            let k = link.stiffness * (parts.stiffness)(index);
            let d = link.damping * parts.damping;
            m[(i, i)] -= k * link.own[0] + d * link.own_damping[0];
            m[(j, j)] -= k * link.own[1] + d * link.own_damping[1];
            let ages = link.ages + 2.0 * (parts.age - 1.0) * link.age_max;
            let cross = 0.5 * (k * ages + d * link.late.iter().map(|late| late.gain(parts.age)).sum::<f64>());
            m[(i, j)] -= cross;
            m[(j, i)] -= cross;
        }
        Some(m)
    }

    /// What each station requires. Weights of 1 where they are enough, or where no weights are; else those of the eigenvector of M's least
    /// eigenvalue.
    pub fn required(&self) -> Vec<Option<f64>> {
        let even = self.weighted(&vec![1.0; self.damping.len()]);
        let is_met = |all: &[Option<f64>]| all.iter().zip(&self.damping).all(|(b, own)| b.is_some_and(|b| b <= *own));
        if is_met(&even) {
            return even;
        }
        let shared = self.weights().map(|weights| self.weighted(&weights)).filter(|shared| is_met(shared));
        shared.unwrap_or(even)
    }

    fn weighted(&self, x: &[f64]) -> Vec<Option<f64>> {
        let mut required = self.demand.clone();
        for link in &self.links {
            let [i, j] = link.between;
            let (k, d) = (link.stiffness, link.damping);
            let cross = 0.5 * (k * link.ages + d * link.late.iter().map(|late| late.gain(1.0)).sum::<f64>());
            let mut add = |at: usize, side: usize, weight: f64| {
                if let Some(b) = &mut required[at] {
                    *b += k * link.own[side] + d * link.own_damping[side] + cross * weight;
                }
            };
            add(i, 0, x[j] / x[i]);
            add(j, 1, x[i] / x[j]);
        }
        required
    }

    /// x > 0 with M x ≥ 0 where M is positive definite: x = M⁻¹ 1, since M has no positive number off its diagonal.
    fn weights(&self) -> Option<Vec<f64>> {
        let m = self.matrix(&whole())?;
        if least_eigenvalue(&m) <= 0.0 {
            return None;
        }
        let x = m.cholesky()?.solve(&DVector::repeat(self.damping.len(), 1.0));
        x.iter().all(|x| *x > 0.0).then(|| x.iter().copied().collect())
    }

    /// Minus the least eigenvalue of M: by how much the dampings together are too small; `None` where a station has no finite demand.
    pub fn excess(&self) -> Option<f64> {
        Some(-least_eigenvalue(&self.matrix(&whole())?))
    }

    /// The most power that torques of these sizes, of either sign, feed: fᵀ M⁻¹ f/4. `None` where nothing bounds it.
    pub fn power(&self, torques: &[f64]) -> Option<f64> {
        let f = DVector::from_column_slice(torques);
        if f.amax() == 0.0 {
            return Some(0.0);
        }
        let m = self.matrix(&whole())?;
        if least_eigenvalue(&m) <= 0.0 {
            return None;
        }
        Some(0.25 * f.dot(&m.cholesky()?.solve(&f)) * (1.0 + SAFE))
    }

    /// The eigenvector of M's least eigenvalue, none of whose numbers is below 0.
    pub fn favoured(&self) -> Option<Vec<f64>> {
        let eigen = SymmetricEigen::new(self.matrix(&whole())?);
        let at = eigen.eigenvalues.imin();
        Some(eigen.eigenvectors.column(at).iter().map(|x| x.abs()).collect())
    }

    fn is_passive(&self, parts: &Parts<impl Fn(usize) -> f64>) -> bool {
        self.matrix(parts).is_some_and(|m| least_eigenvalue(&m) >= 0.0)
    }

    /// The largest factor up to which `holds`, on the safe side; `None` where it does not hold at 0, `f64::MAX` is never reached.
    fn largest(holds: impl Fn(f64) -> bool) -> Option<f64> {
        if !holds(0.0) {
            return None;
        }
        let mut high = 1.0;
        while holds(high) && high < 1e30 {
            high *= 2.0;
        }
        let mut low = 0.0;
        while high - low > SAFE * high && high > 1e-30 {
            let middle = 0.5 * (low + high);
            if holds(middle) { low = middle } else { high = middle }
        }
        (high < 1e30).then_some(low)
    }

    /// The largest stiffness of one link, the others as they are.
    pub fn stiffness_max(&self, index: usize) -> Option<f64> {
        let mut unit = Burden { damping: self.damping.clone(), demand: self.demand.clone(), links: Vec::new() };
        unit.links.extend(
            self.links
                .iter()
                .enumerate()
                .map(|(at, link)| LinkBurden { stiffness: if at == index { 1.0 } else { link.stiffness }, ..*link }),
        );
        Burden::largest(|k| {
            unit.is_passive(&Parts { stiffness: |at| if at == index { k } else { 1.0 }, damping: 1.0, age: 1.0 })
        })
    }

    pub fn stiffness_scale(&self) -> Option<f64> {
        Burden::largest(|scale| self.is_passive(&Parts { stiffness: |_| scale, damping: 1.0, age: 1.0 }))
    }

    pub fn age_scale(&self) -> Option<f64> {
        Burden::largest(|age| self.is_passive(&Parts { age, ..whole() }))
    }

    /// `None` without a damped link, too.
    pub fn damping_scale(&self) -> Option<f64> {
        let is_damped = self.links.iter().any(|link| link.damping > 0.0);
        is_damped.then(|| Burden::largest(|damping| self.is_passive(&Parts { damping, ..whole() })))?
    }

    /// The least damping of one device, the others as they are: by the complement of Schur.
    pub fn least_damping(&self, index: usize) -> Option<f64> {
        let m = self.matrix(&whole())?;
        let others = m.clone().remove_row(index).remove_column(index);
        if others.nrows() > 0 && least_eigenvalue(&others) <= 0.0 {
            return None;
        }
        let column = m.column(index).clone_owned().remove_row(index);
        let needed = if others.nrows() == 0 { 0.0 } else { column.dot(&others.cholesky()?.solve(&column)) };
        let least = self.damping[index] - m[(index, index)] + needed;
        Some((least * (1.0 + SAFE)).max(0.0))
    }
}

fn least_eigenvalue(m: &DMatrix<f64>) -> f64 {
    SymmetricEigen::new(m.clone()).eigenvalues.min()
}
