//! Commands of a record as they arrive at the motor.

/// Commands that are held from their arrival, `delay` s after their times, until the next.
pub(crate) struct Arrivals<'a> {
    times: &'a [f64],
    torques: &'a [f64],
    delay: f64,
    next: usize,
}

impl<'a> Arrivals<'a> {
    pub fn new(times: &'a [f64], torques: &'a [f64], delay: f64) -> Self {
        Arrivals { times, torques, delay, next: 0 }
    }

    /// The next command other than `held` that arrives by `until`, with its instant; `None`: the torque stays.
    pub fn change(&mut self, until: f64, held: f64) -> Option<(f64, f64)> {
        while let (Some(&at), Some(&torque)) = (self.times.get(self.next), self.torques.get(self.next)) {
            let at = at + self.delay;
            if at > until {
                return None;
            }
            self.next += 1;
            if torque != held {
                return Some((at, torque));
            }
        }
        None
    }
}
