//! One end of a link between two wheels: when its torque acts.

/// The newest message of the other end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard {
    /// How old its position is at most, in s.
    pub age: f64,
    /// Of its puck, in rad (linear: m).
    pub position: f64,
    /// Whether it has a position of this end that is young enough.
    pub hears: bool,
    /// Whether its torque acts.
    pub acts: bool,
}

/// One end of a link, sample by sample.
///
/// The first end decides whether the link acts, the second follows. The first acts when the other hears it and the ends have met: the torque
/// is 0 or has changed its sign. The second acts as long as the first says that it acts. Each lets go where no position is young
/// enough for all of the coming hold, or where its own loop is not ready. One that has let go waits until the other has, too.
///
/// ```
/// use hapt_core::{Heard, LinkEnd};
///
/// let spring = |other: f64| move |own: f64| -2.0 * (own - other);
/// let heard = |age, position| Some(Heard { age, position, hears: true, acts: false });
/// let mut end = LinkEnd::new(true, 20e-3, 1e-3);
/// // The ends are apart: nothing acts until they have met.
/// assert_eq!(end.sample(true, heard(5e-3, 0.0), |other| spring(other)(0.1)), 0.0);
/// assert_eq!(end.sample(true, heard(5e-3, 0.1), |other| spring(other)(0.1)), 0.0);
/// assert!(end.acts());
/// assert_eq!(end.sample(true, heard(5e-3, 0.0), |other| spring(other)(0.1)), -0.2);
/// // 19.5 ms now are more than 20 ms at the end of the hold.
/// assert_eq!(end.sample(true, heard(19.5e-3, 0.0), |other| spring(other)(0.1)), 0.0);
/// assert_eq!(end.let_go(), 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkEnd {
    first: bool,
    age_max: f64,
    hold: f64,
    hears: bool,
    acts: bool,
    /// The torque at the last sample that found a position young enough, whether it acted or not.
    torque: Option<f64>,
    let_go: u64,
}

impl LinkEnd {
    /// An end that has let go. No position acts beyond the age `age_max`; a torque acts for `hold` after its sample; both in s.
    pub fn new(first: bool, age_max: f64, hold: f64) -> Self {
        LinkEnd { first, age_max, hold, hears: false, acts: false, torque: None, let_go: 0 }
    }

    /// The torque of a sample: that of `torque`, a function of the other's position, where this end acts, else 0. An end whose own loop is
    /// not `ready`, disarmed or before its zero is set, lets go.
    pub fn sample(&mut self, ready: bool, heard: Option<Heard>, torque: impl FnOnce(f64) -> f64) -> f64 {
        // Up to what rounding makes of a sum of times. A NaN is not young.
        let is_young = |heard: &Heard| heard.age + self.hold <= self.age_max * (1.0 + 1e-12);
        let young = heard.filter(|heard| ready && is_young(heard));
        let torque = young.map(|young| torque(young.position)).filter(|torque| torque.is_finite());
        let acted = self.acts;
        let met = torque.is_some_and(|now| now == 0.0 || self.torque.is_some_and(|before| before * now < 0.0));
        self.acts = torque.is_some()
            && young.is_some_and(|young| match self.first {
                true => young.hears && (acted || (!young.acts && met)),
                false => young.acts,
            });
        self.let_go += u64::from(acted && !self.acts);
        self.hears = torque.is_some();
        // Of an end that is not ready the position may jump, which is no meeting.
        self.torque = torque.filter(|_| young.is_some_and(|young| young.hears));
        torque.filter(|_| self.acts).unwrap_or(0.0)
    }

    /// The greatest age in s at which a position acts.
    pub fn age_max(&self) -> f64 {
        self.age_max
    }

    /// From now on no position acts beyond this age in s.
    pub fn set_age_max(&mut self, age_max: f64) {
        self.age_max = age_max;
    }

    /// Whether the other's position was young enough at the last sample.
    pub fn hears(&self) -> bool {
        self.hears
    }

    /// Whether its torque acted at the last sample.
    pub fn acts(&self) -> bool {
        self.acts
    }

    /// How often it has let go.
    pub fn let_go(&self) -> u64 {
        self.let_go
    }
}
