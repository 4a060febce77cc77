//! Reduction of a run for drawing, without losing a peak.

/// A signal over time, reduced while it streams: the smallest and the largest value of each interval of rows, in time order.
///
/// The intervals double whenever there are too many, so that the memory does not depend on the number of rows.
#[derive(Clone, Debug)]
pub struct Extremes {
    /// The largest number of intervals; at least 2.
    room: usize,
    /// Rows per interval.
    rows: u64,
    /// Rows in the last interval.
    filled: u64,
    stretches: Vec<Stretch>,
    ends: Option<(Point, Point)>,
}

/// Time and value.
pub type Point = (f64, f64);

#[derive(Clone, Copy, Debug)]
struct Stretch {
    low: Point,
    high: Point,
}

impl Stretch {
    /// Joins it with the later `other`. Of equal values the first stays.
    fn with(self, other: Stretch) -> Stretch {
        Stretch {
            low: if other.low.1 < self.low.1 { other.low } else { self.low },
            high: if other.high.1 > self.high.1 { other.high } else { self.high },
        }
    }
}

/// Joins pairs of neighbours.
fn halve(stretches: &mut Vec<Stretch>) {
    let merge = |pair: &[Stretch]| pair.iter().copied().reduce(Stretch::with);
    *stretches = stretches.chunks(2).filter_map(merge).collect();
}

impl Extremes {
    /// For a drawing of up to `room` intervals.
    pub fn new(room: usize) -> Self {
        Extremes { room: room.max(2), rows: 1, filled: 0, stretches: Vec::new(), ends: None }
    }

    /// Adds the next row; a value that is not finite is omitted.
    pub fn add(&mut self, time: f64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let point = (time, value);
        self.ends = Some((self.ends.map_or(point, |(first, _)| first), point));
        let stretch = Stretch { low: point, high: point };
        match self.stretches.last_mut() {
            Some(last) if self.filled < self.rows => *last = last.with(stretch),
            _ => {
                if self.stretches.len() == self.room {
                    halve(&mut self.stretches);
                    // An unpaired last interval is half full and takes the new row.
                    let odd = self.room % 2 == 1;
                    self.filled = if odd { self.rows } else { 2 * self.rows };
                    self.rows *= 2;
                    if odd {
                        if let Some(last) = self.stretches.last_mut() {
                            *last = last.with(stretch);
                        }
                        self.filled += 1;
                        return;
                    }
                }
                self.stretches.push(stretch);
                self.filled = 0;
            }
        }
        self.filled += 1;
    }

    /// The curve to draw, of at most `room` intervals: first row, extremes in time order, last row.
    pub fn points(&self, room: usize) -> Vec<Point> {
        let mut stretches = self.stretches.clone();
        while stretches.len() > room.max(1) {
            halve(&mut stretches);
        }
        let mut points = Vec::with_capacity(2 * stretches.len() + 2);
        let mut push = |point: Point| {
            if points.last() != Some(&point) {
                points.push(point);
            }
        };
        let Some((first, last)) = self.ends else { return points };
        push(first);
        for Stretch { low, high } in stretches {
            let (early, late) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            push(early);
            push(late);
        }
        push(last);
        points
    }

    /// The smallest and the largest value; `None` before the first row.
    pub fn range(&self) -> Option<(f64, f64)> {
        self.stretches.iter().copied().reduce(Stretch::with).map(|all| (all.low.1, all.high.1))
    }
}

/// The time intervals in which a condition holds, such as clipping; the nearest ones are joined when there are too many, so that the
/// marked time always includes the true one.
#[derive(Clone, Debug)]
pub struct Stretches {
    room: usize,
    /// The largest gap of joined intervals.
    gap: f64,
    open: bool,
    list: Vec<(f64, f64)>,
}

impl Stretches {
    /// For up to `room` of them.
    pub fn new(room: usize) -> Self {
        Stretches { room: room.max(1), gap: 0.0, open: false, list: Vec::new() }
    }

    /// Adds the next row.
    pub fn add(&mut self, time: f64, holds: bool) {
        if holds {
            match self.list.last_mut() {
                Some(last) if self.open || time - last.1 <= self.gap => last.1 = time,
                _ => self.list.push((time, time)),
            }
            while self.list.len() > self.room {
                self.gap = (2.0 * self.gap).max(time / self.room as f64).max(f64::MIN_POSITIVE);
                self.join();
            }
        }
        self.open = holds;
    }

    fn join(&mut self) {
        let mut joined: Vec<(f64, f64)> = Vec::with_capacity(self.list.len());
        for &(from, to) in &self.list {
            match joined.last_mut() {
                Some(last) if from - last.1 <= self.gap => last.1 = to,
                _ => joined.push((from, to)),
            }
        }
        self.list = joined;
    }

    /// From and to, in time order.
    pub fn list(&self) -> &[(f64, f64)] {
        &self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn reduced(values: &[f64], room: usize) -> Extremes {
        let mut extremes = Extremes::new(room);
        for (k, &value) in values.iter().enumerate() {
            extremes.add(k as f64, value);
        }
        extremes
    }

    proptest! {
        #[test]
        fn no_extreme_disappears(
            values in prop::collection::vec(-1e6..1e6f64, 1..3000), room in 2usize..70, drawn in 1usize..70,
        ) {
            let extremes = reduced(&values, room);
            let points = extremes.points(drawn);
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            prop_assert_eq!(extremes.range(), Some((low, high)));
            prop_assert!(points.iter().any(|p| p.1 == low) && points.iter().any(|p| p.1 == high));
            // Every point is a row, in time order, the first and the last among them; and they are few.
            prop_assert!(points.iter().all(|p| values[p.0 as usize] == p.1));
            prop_assert!(points.windows(2).all(|w| w[0].0 < w[1].0));
            prop_assert_eq!((points[0].0, points[points.len() - 1].0), (0.0, (values.len() - 1) as f64));
            prop_assert!(points.len() <= 2 * room.min(drawn) + 2 && extremes.stretches.len() <= room);
        }

        #[test]
        fn a_peak_anywhere_is_drawn_within_a_stretch_of_its_time(at in 0usize..100_000, room in 2usize..200) {
            let mut extremes = Extremes::new(room);
            for k in 0..100_000 {
                extremes.add(k as f64, if k == at { 1.0 } else { 0.0 });
            }
            prop_assert!(extremes.points(room).contains(&(at as f64, 1.0)));
        }

        #[test]
        fn all_that_clips_is_marked(flags in prop::collection::vec(any::<bool>(), 0..2000), room in 1usize..50) {
            let mut stretches = Stretches::new(room);
            for (k, &flag) in flags.iter().enumerate() {
                stretches.add(k as f64, flag);
            }
            prop_assert!(stretches.list().len() <= room);
            for (k, _) in flags.iter().enumerate().filter(|(_, flag)| **flag) {
                prop_assert!(stretches.list().iter().any(|&(from, to)| from <= k as f64 && k as f64 <= to));
            }
        }
    }

    #[test]
    fn a_short_run_is_drawn_sample_by_sample() {
        let values = [0.0, 3.0, -1.0, 2.0];
        let points = reduced(&values, 100).points(100);
        assert_eq!(points, [(0.0, 0.0), (1.0, 3.0), (2.0, -1.0), (3.0, 2.0)]);
    }
}
