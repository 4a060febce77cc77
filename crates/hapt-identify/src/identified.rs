//! The result of an identification, as plain data.

use hapt_plant::spec::Stops;

use crate::counts::Lattice;
use crate::interval::Interval;
use crate::puck::Puck;
use crate::terms::Term;

/// The quantities that are known before the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// J in kg·m² (linear: kg): then the motor's gain is found instead, and a coast-down gives damping and friction.
    pub inertia: Option<f64>,
    /// The positions are linear, so that their lattice is not a part of a turn.
    pub is_linear: bool,
    /// The approximate lag of the motor, in s: the fits start there, and the other numbers are those of a fit with a lag.
    pub lag: Option<f64>,
    /// The damping k²/R that a motor on a voltage adds, in N·m·s/rad (N·s/m): the damping that is found is the rest.
    pub back_damping: f64,
}

impl Known {
    /// The device's own damping.
    pub(crate) fn own(&self, damping: Interval) -> Interval {
        let less = |x: f64| (x - self.back_damping).max(0.0);
        Interval { value: less(damping.value), low: less(damping.low), high: less(damping.high) }
    }
}

/// Two parameters whose estimates are so correlated that the record does not determine them separately.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrelatedPair {
    /// inertia, damping, friction, delay; with a handle also lag, share of the handle, shaft stiffness, shaft damping.
    pub names: [&'static str; 2],
    /// The correlation of their estimates, from -1 to 1.
    pub correlation: f64,
}

/// The residuals of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Root mean square, in rad (linear: m).
    pub rms: f64,
    /// Correlation of neighbours: about 0 if the residuals are noise.
    pub correlation: f64,
}

/// The parameters of a device that a record determines. `None`: not determined. Damping, friction and delay are also `None` where the
/// whole interval is below 0, which no device has.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// J in kg·m² (linear: kg).
    pub inertia: Option<Interval>,
    /// b in N·m·s/rad (N·s/m).
    pub damping: Option<Interval>,
    /// Coulomb's, in N·m (N).
    pub friction: Option<Interval>,
    /// From the sample to the change of the torque, in s. Where the interval of the lag begins at 0, the record does not separate them, and
    /// this is the delay of a motor without a lag.
    pub delay: Option<Interval>,
    /// The time constant with which the torque follows its command, in s. An interval from 0: not separated from a delay, and the value is
    /// 0.
    pub lag: Option<Interval>,
    /// Delay and lag together, in s: the mean time from a command to its torque, whatever the lag is.
    pub late: Option<Interval>,
    /// 1 where a positive torque increases the position, else -1.
    pub sign: Option<Interval>,
    /// A constant torque on the puck that was not commanded, in N·m (N): a motor's offset, a tilted table. `None` where the record does not
    /// distinguish it from friction.
    pub offset: Option<Interval>,
    /// The true torque per commanded torque, where the inertia is known beforehand.
    pub gain: Option<Interval>,
    /// The encoder's counts a revolution, a whole number; none for a linear device.
    pub counts: Option<Interval>,
    /// The lattice of the positions, in rad (m).
    pub lattice: Option<Lattice>,
    /// b/J in 1/s and f/J in rad/s² (m/s²), which a coast-down determines.
    pub rates: [Option<Interval>; 2],
    /// The end stops that the record reaches; `None`: it reaches none.
    pub stops: Option<FoundStops>,
    /// Friction that falls with the speed, where the caller asked for it.
    pub stribeck: Option<FoundStribeck>,
    /// Torques of the position and changes of friction with it, besides end stops.
    pub terms: Vec<Term>,
    /// The same by harmonics, where the caller asked for them.
    pub(crate) waves: Option<FoundWaves>,
    /// The fit itself, with damping, friction and delay of 0 or more wherever that explains the record.
    pub puck: Puck,
    /// The positions of the device at each sample from `first` on, where it has end stops or Stribeck friction.
    pub(crate) positions: Option<Vec<f64>>,
    /// The first sample that is fitted.
    pub first: usize,
    /// Its residuals.
    pub residual: Residual,
    /// A torque in the residuals that depends on the position, which the equation does not contain.
    pub unmodelled: Option<PositionTorque>,
    /// The positions' standard deviation, in rad (m).
    pub spread: f64,
    /// Whether the residuals are only rounding: a simulation without noise.
    pub is_exact: bool,
    /// Largest over smallest eigenvalue of the estimates' correlations.
    pub condition: f64,
    /// The pairs of parameters that the record does not separate.
    pub correlated: Vec<CorrelatedPair>,
}

/// End stops of the device: springs and dampers with the same numbers at both ends of the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundStops {
    /// The place of the stop toward smaller positions, in rad (m); `None`: the record does not reach it.
    pub low: Option<Interval>,
    /// The place of the stop toward larger positions.
    pub high: Option<Interval>,
    /// Their stiffness, in N·m/rad (N/m).
    pub stiffness: Interval,
    /// Their damping, in N·m·s/rad (N·s/m).
    pub damping: Interval,
}

/// The ratios of the ends of a stiffness' interval above which a stop may be another torque near a turn, and above which the stiffness is
/// not determined.
const LOOSEST: f64 = 4.0;
const VAGUEST: f64 = 1e4;

impl FoundStops {
    /// Whether they are certainly stops. Other torques near a turn of the puck are fitted by a stop too, whose stiffness the record then
    /// does not determine.
    pub(crate) fn are_sure(&self) -> bool {
        self.stiffness.high < LOOSEST * self.stiffness.low
    }

    /// Whether their stiffness is determined at all.
    pub(crate) fn are_determined(&self) -> bool {
        self.stiffness.high < VAGUEST * self.stiffness.low
    }
}

impl Identified {
    /// The same with intervals of inertia, damping, friction, gain, constant torque, stops and Stribeck friction that include those of
    /// another fit.
    pub(crate) fn widened(self, other: &Identified) -> Self {
        let both = |one: Option<Interval>, other: Option<Interval>| one.map(|x| other.map_or(x, |other| x.with(other)));
        let stops = self.stops.map(|x| match other.stops {
            None => x,
            Some(other) => FoundStops {
                low: both(x.low, other.low),
                high: both(x.high, other.high),
                stiffness: x.stiffness.with(other.stiffness),
                damping: x.damping.with(other.damping),
            },
        });
        let stribeck = self.stribeck.map(|x| match other.stribeck {
            None => x,
            Some(other) => {
                FoundStribeck { torque: x.torque.with(other.torque), velocity: x.velocity.with(other.velocity) }
            }
        });
        let with = |waves: Option<FoundWaves>| {
            let (one, other) = (waves?, other.waves);
            let widened = |one: Harmonics, other: Option<Harmonics>| match other {
                None => one,
                Some(other) => std::array::from_fn(|n| std::array::from_fn(|i| both(one[n][i], other[n][i]))),
            };
            Some(FoundWaves {
                gravity: widened(one.gravity, other.map(|x| x.gravity)),
                cogging: widened(one.cogging, other.map(|x| x.cogging)),
                changes: widened(one.changes, other.map(|x| x.changes)),
            })
        };
        // Both fits have the same terms.
        let terms =
            self.terms.iter().zip(&other.terms).map(|(x, y)| Term { size: x.size.with(y.size), ..*x }).collect();
        Identified {
            terms,
            waves: with(self.waves),
            inertia: both(self.inertia, other.inertia),
            damping: both(self.damping, other.damping),
            friction: both(self.friction, other.friction),
            gain: both(self.gain, other.gain),
            offset: both(self.offset, other.offset),
            rates: [0, 1].map(|i| both(self.rates[i], other.rates[i])),
            stops,
            stribeck,
            ..self
        }
    }
}

impl FoundStops {
    /// The values without their intervals.
    pub fn values(&self) -> Stops {
        let [low, high] = [self.low, self.high].map(|x| x.map(|x| x.value));
        Stops { low, high, stiffness: self.stiffness.value, damping: self.damping.value }
    }

    /// Each number by its name in JSON.
    pub fn named(&self) -> [(&'static str, Option<Interval>); 4] {
        let FoundStops { low, high, stiffness, damping } = *self;
        [("low", low), ("high", high), ("stiffness", Some(stiffness)), ("damping", Some(damping))]
    }
}

/// Friction that is this much larger at rest, and falls linearly to Coulomb friction at this velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundStribeck {
    /// The additional torque at rest, in N·m (N).
    pub torque: Interval,
    /// The velocity from which on there is none, in rad/s (m/s).
    pub velocity: Interval,
}

/// The sine and the cosine part of each harmonic; `None`: it is not fitted.
pub(crate) type Harmonics = [[Option<Interval>; 2]; 4];

/// Torques of the position by harmonics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FoundWaves {
    /// In N·m, of sin z and cos z.
    pub gravity: Harmonics,
    /// In N·m (N).
    pub cogging: Harmonics,
    /// Parts of the friction.
    pub changes: Harmonics,
}

/// A torque that depends on the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionTorque {
    /// Its periods in a turn; 0: it is proportional to the position, as a spring's.
    pub times_a_turn: u32,
    /// Its amplitude in N·m of commanded torque; of a spring the stiffness in N·m/rad (linear: N/m).
    pub size: f64,
    /// The part of the residuals' squares that it explains.
    pub explains: f64,
}
