//! One end of a link between two wheels, and the part of its torque that acts.

/// The part of a link's torque that acts, as the one byte that messages carry: none, or 2^(-(255 - n)/8) for 1 to 255.
///
/// Both ends compute with the same part to the bit. It steps by 9 %.
///
/// ```
/// use hapt_core::Strength;
///
/// assert_eq!((Strength::NONE.part(), Strength::WHOLE.part(), Strength(247).part()), (0.0, 1.0, 0.5));
/// assert_eq!(Strength::at_most(0.5), Strength(247));
/// assert_eq!(Strength::at_most(f64::NAN), Strength::NONE);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Strength(pub u8);

impl Strength {
    /// Nothing acts.
    pub const NONE: Strength = Strength(0);
    /// All of the torque.
    pub const WHOLE: Strength = Strength(u8::MAX);
    /// Steps from a part to its double.
    const STEPS: f64 = 8.0;

    /// From 0 to 1.
    pub fn part(self) -> f64 {
        if self == Strength::NONE { 0.0 } else { libm::exp2(f64::from(i16::from(self.0) - 255) / Strength::STEPS) }
    }

    /// The largest strength of at most `part`.
    pub fn at_most(part: f64) -> Self {
        if part.is_nan() || part <= 0.0 {
            return Strength::NONE;
        }
        let steps = libm::floor(255.0 + Strength::STEPS * libm::log2(part));
        // The cast saturates.
        let found = Strength(steps as u8);
        if found.part() > part { Strength(found.0.saturating_sub(1)) } else { found }
    }

    /// Whether anything acts.
    pub fn acts(self) -> bool {
        self != Strength::NONE
    }
}

/// The terms that an end of a link keeps to. Times in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkTerms {
    /// The greatest age of a position at any time that its torque acts.
    pub age_max: f64,
    /// How long a torque acts after its sample at most.
    pub hold: f64,
    /// Between two messages of the other end.
    pub period: f64,
    /// The torque with which ends that are apart are brought together, in N·m (linear: N).
    pub soft: f64,
}

/// The newest message of the other end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemoteState {
    /// How old its position is at most, in s.
    pub age: f64,
    /// The run of the other end in which it was sent: instants of two runs are not comparable.
    pub session: u64,
    /// When its position was taken, in s by the other's clock: only differences count.
    pub taken: f64,
    /// Of its puck, in rad (linear: m).
    pub position: f64,
    /// Of the first end: the part with which it acts. Of the second: the largest with which it can.
    pub strength: Strength,
}

/// The position that acts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Used {
    session: u64,
    taken: f64,
    position: f64,
    mean: Option<Mean>,
    age: f64,
    /// Its age at the end of the hold in which it acted first.
    fresh: f64,
}

/// The other's velocity, as its mean between two positions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mean {
    velocity: f64,
    /// Between the two positions, in s.
    span: f64,
    /// Since it began to act, in s.
    acted: f64,
}

/// One end of a link, sample by sample.
///
/// **The other's velocity** is its mean between the newest position and the one that acted before it. It acts for at most [`LASTING`] times
/// as long as the two are apart, or for one hold: beyond, the damping has no torque until the next position comes (docs/theory.md, (T64)).
///
/// **Release.** Where no newer position comes, the torque fades in the last quarter of `age_max`, and is 0 before a position is too old
/// for all of the coming hold. A position that comes on time acts as a whole, however little of `age_max` it leaves. An end whose own loop
/// is not ready releases at once. The other then uses no position that was sent after that, and fades within a quarter of `age_max`.
///
/// **Reconnection.** The first end begins when the other receives its messages and has released too. Its strength rises, by a factor of 2
/// in each `age_max`, only while its torque stays within [`LinkTerms::soft`]: ends that are apart are drawn together with at most this
/// torque, and the link acts as a whole when the ends have met. The second end follows.
///
/// Neither adds energy beyond a bound: docs/theory.md, (T54) and (T55).
///
/// ```
/// use hapt_core::{RemoteState, LinkEnd, LinkTerms, Strength};
///
/// let mut end = LinkEnd::new(true, LinkTerms { age_max: 20e-3, hold: 1e-3, period: 1e-3, soft: 0.01 });
/// let remote = |age, position| Some(RemoteState { age, session: 1, taken: 0.0, position, strength: Strength::WHOLE });
/// let mut sample = |age, other: f64| end.sample(1e-3, true, remote(age, other), |other, _| -2.0 * (0.1 - other));
/// // The ends are apart: they are drawn together softly, for as long as they are.
/// let drawn: Vec<f64> = (0..500).map(|_| sample(5e-3, 0.0)).collect();
/// assert!(drawn[0] < 0.0 && drawn[0] > -0.001 && drawn[499] < -0.009 && drawn[499] >= -0.01);
/// // They have met: the link is whole, and stays so.
/// (0..500).for_each(|_| drop(sample(5e-3, 0.1)));
/// assert_eq!(sample(5e-3, 0.0), -0.2);
/// // Nothing comes any more. 19.5 ms now are more than 20 ms at the end of the hold.
/// assert!(sample(17e-3, 0.0) > -0.1);
/// assert_eq!(sample(19.5e-3, 0.0), 0.0);
/// assert_eq!(end.releases(), 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkEnd {
    first: bool,
    terms: LinkTerms,
    strength: Strength,
    /// The largest strength with which the second end can act; the first end has received it when its own strength is no larger.
    cap: Strength,
    used: Option<Used>,
    /// Whether the other's position was young enough at the last sample.
    is_current: bool,
    /// Steps by which the strength may rise.
    rise: f64,
    releases: u64,
}

/// How long the other's mean velocity acts at most, in times of its own span.
pub const LASTING: f64 = 4.0;
/// In which part of `age_max` a torque fades.
const FADE: f64 = 0.25;
/// The part of the soft torque at which reconnection begins.
const BEGIN: f64 = 1.0 / 16.0;
/// A position is newer than another if it is younger by this time, in s: more than rounding.
const NEWER: f64 = 1e-9;

impl Used {
    /// The same at the next sample.
    fn later(self, elapsed: f64) -> Used {
        let mean = self.mean.map(|mean| Mean { acted: mean.acted + elapsed, ..mean });
        Used { age: self.age + elapsed, mean, ..self }
    }

    /// The other's velocity, where it may act for another `hold`.
    fn velocity(&self, hold: f64) -> Option<f64> {
        // Up to the rounding of a sum of times. The first hold counts in any case.
        let lasts = |mean: &Mean| mean.acted + hold <= (LASTING * mean.span).max(hold) * (1.0 + 1e-9);
        self.mean.filter(lasts).map(|mean| mean.velocity)
    }
}

impl LinkEnd {
    /// A released end.
    pub fn new(first: bool, terms: LinkTerms) -> Self {
        LinkEnd {
            first,
            terms,
            strength: Strength::NONE,
            cap: Strength::NONE,
            used: None,
            is_current: false,
            rise: 0.0,
            releases: 0,
        }
    }

    /// An end that acts as a whole from its first sample on, where both ends have acted before.
    pub fn holding(first: bool, terms: LinkTerms) -> Self {
        LinkEnd { strength: Strength::WHOLE, cap: Strength::WHOLE, ..LinkEnd::new(first, terms) }
    }

    /// The torque of a sample, `elapsed` seconds after the one before: a part of `torque`, which is a function of the other's position and,
    /// where it is known, of its velocity. An end whose own loop is not `ready`, disarmed or before its zero is set, releases.
    pub fn sample(
        &mut self,
        elapsed: f64,
        ready: bool,
        remote: Option<RemoteState>,
        torque: impl Fn(f64, Option<f64>) -> f64,
    ) -> f64 {
        self.take(elapsed, remote);
        self.is_current = ready
            && remote.is_some_and(|remote| self.is_young(remote.age) && torque(remote.position, None).is_finite());
        // The torque of the spring by itself, and with the damper: only the former decides on reconnection.
        let both = self.used.map(|used| [None, used.velocity(self.terms.hold)].map(|at| torque(used.position, at)));
        let full = both.filter(|both| both.iter().all(|torque| torque.is_finite()));
        let allowed = Strength::at_most(if ready && full.is_some() { self.fading() } else { 0.0 });
        let [stored, full] = full.unwrap_or_default();
        let other = remote.map_or(Strength::NONE, |remote| remote.strength);
        let before = self.strength;
        if !other.acts() {
            // The other has released: its last position fades.
            let faded = Strength::at_most(before.part() - elapsed / (FADE * self.terms.age_max));
            self.strength = faded.min(allowed);
        }
        match (other.acts(), self.first) {
            (false, true) => {}
            (false, false) if self.is_current && !self.strength.acts() => self.cap = Strength::WHOLE,
            (false, false) => self.cap = Strength::NONE,
            (true, true) => {
                self.strength = before.min(other).min(allowed);
                let is_fresh = self.is_current && allowed == Strength::WHOLE;
                match self.strength == before && is_fresh {
                    true => self.rise(elapsed, other, libm::fabs(stored)),
                    false => self.rise = 0.0,
                }
            }
            (true, false) => {
                if other <= self.cap {
                    self.cap = Strength::WHOLE;
                }
                self.strength = other.min(self.cap);
                if allowed < self.strength {
                    (self.strength, self.cap) = (allowed, allowed);
                }
            }
        }
        self.releases += u64::from(before.acts() && !self.strength.acts());
        if self.strength.acts() { self.strength.part() * full } else { 0.0 }
    }

    /// Keeps the newest position that the other sent while it acted, or could.
    fn take(&mut self, elapsed: f64, remote: Option<RemoteState>) {
        let LinkTerms { hold, period, .. } = self.terms;
        let before = self.used.map(|used| used.later(elapsed));
        self.used = match remote {
            Some(RemoteState { age, session, taken, position, strength }) if strength.acts() => {
                let same = before.filter(|before| before.age - age <= NEWER);
                let mean = before.filter(|before| before.session == session).and_then(|before| {
                    // The same position again is no news.
                    if taken <= before.taken {
                        return before.mean;
                    }
                    let span = (taken - before.taken).max(period);
                    Some(Mean { velocity: (position - before.position) / span, span, acted: 0.0 })
                });
                Some(Used { session, taken, position, mean, age, fresh: same.map_or(age + hold, |same| same.fresh) })
            }
            _ => before,
        };
    }

    fn is_young(&self, age: f64) -> bool {
        // Up to the rounding of a sum of times. A NaN is not young.
        age + self.terms.hold <= self.terms.age_max * (1.0 + 1e-12)
    }

    /// From 1 to 0: the part that the age of the position allows. It falls from where the next one is overdue.
    fn fading(&self) -> f64 {
        let LinkTerms { age_max, hold, period, .. } = self.terms;
        match self.used {
            Some(Used { age, fresh, .. }) if self.is_young(age) => {
                let from = (fresh + period + hold).max((1.0 - FADE) * age_max);
                if from < age_max { ((age_max - age - hold) / (age_max - from)).clamp(0.0, 1.0) } else { 1.0 }
            }
            _ => 0.0,
        }
    }

    /// Reconnects and raises the strength, up to `most`, as long as that part of the torque `full` is within the soft torque.
    fn rise(&mut self, elapsed: f64, most: Strength, full: f64) {
        let LinkTerms { age_max, soft, .. } = self.terms;
        if !self.strength.acts() {
            let begin = if full == 0.0 { 1.0 } else { BEGIN * soft / full };
            self.strength = Strength::at_most(begin).min(most);
            return;
        }
        self.rise = (self.rise + Strength::STEPS * elapsed / age_max).min(Strength::STEPS);
        while self.rise >= 1.0 {
            let next = Strength(self.strength.0.saturating_add(1));
            if self.strength >= most || next.part() * full > soft {
                self.rise = 0.0;
                return;
            }
            self.strength = next;
            self.rise -= 1.0;
        }
    }

    /// Its terms.
    pub fn terms(&self) -> LinkTerms {
        self.terms
    }

    /// Sets its terms, from the next sample on.
    pub fn set_terms(&mut self, terms: LinkTerms) {
        self.terms = terms;
    }

    /// The strength to send to the other end: of the first end the part with which it acts, of the second the largest with which it can.
    pub fn sent_strength(&self) -> Strength {
        if self.first { self.strength } else { self.cap }
    }

    /// The part of its torque that acted at the last sample.
    pub fn strength(&self) -> Strength {
        self.strength
    }

    /// The age in s, at the end of the last sample's hold, of the position that acts; `None` where none does.
    pub fn age(&self) -> Option<f64> {
        self.used.filter(|_| self.strength.acts()).map(|used| used.age + self.terms.hold)
    }

    /// The number of its releases.
    pub fn releases(&self) -> u64 {
        self.releases
    }
}
