//! A plane of values as coloured cells, with the edge between two sides drawn.

use std::fmt::Write as _;

use crate::ticks::number;

/// Cells in rows from the bottom up and columns from the left, all of one size.
#[derive(Clone, Debug)]
pub struct Map {
    /// The number of columns.
    pub columns: usize,
    /// Row after row, the lowest first; `None` where there is no value.
    pub values: Vec<Option<f64>>,
    /// The colours of values.
    pub scale: Scale,
    /// The value at which a line separates two regions.
    pub edge: Option<f64>,
}

/// The mapping of values to colours.
#[derive(Clone, Debug, PartialEq)]
pub enum Scale {
    /// Viridis, by these bounds between neighbouring colours, upwards; at most 7.
    Sequential(Vec<f64>),
    /// Blue below 0 and orange above, each darker beyond these sizes, upwards; at most 3.
    Signed(Vec<f64>),
    /// At most three values, the worst first, each with a name and the colour of such a region of a boundary.
    Named(&'static [(f64, &'static str)]),
}

impl Scale {
    /// The scale for values of one kind: signed when some are below 0 and some above, by powers of ten from the largest down.
    pub fn of(values: impl Iterator<Item = f64> + Clone) -> Scale {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        if low < 0.0 && high > 0.0 {
            let top = low.abs().max(high);
            // The power of ten below the largest.
            let power = 10f64.powf((0.5 * top).log10().floor());
            return Scale::Signed(vec![0.01 * power, 0.1 * power, power]);
        }
        // No values, or only one.
        if low >= high {
            return Scale::Sequential(Vec::new());
        }
        let by_ratio = low > 0.0 && high / low > 300.0;
        let bound = |i: u32| {
            let part = f64::from(i) / 8.0;
            if by_ratio { low * (high / low).powf(part) } else { low + (high - low) * part }
        };
        Scale::Sequential((1..8).map(bound).collect())
    }

    /// The class of a value's colour.
    fn class(&self, value: f64) -> String {
        match self {
            // Fewer colours are spread over the palette.
            Scale::Sequential(bounds) => {
                let level = bounds.iter().filter(|bound| value >= **bound).count();
                format!("m{}", if bounds.is_empty() { 4 } else { level * 8 / bounds.len().max(1) })
            }
            Scale::Signed(sizes) => {
                let level = sizes.iter().filter(|size| value.abs() >= **size).count();
                format!("{}{level}", if value > 0.0 { "p" } else { "n" })
            }
            // The colours of a boundary's regions: the worst, the middle, the best.
            Scale::Named(names) => match place(names, value) {
                0 => "p2".into(),
                i if i + 1 == names.len() => "n1".into(),
                _ => "p0".into(),
            },
        }
    }

    /// The priority of a value where one drawn cell stands for several.
    fn weight(&self, value: f64) -> f64 {
        match self {
            Scale::Named(names) => -(place(names, value) as f64),
            Scale::Sequential(_) | Scale::Signed(_) => value.abs(),
        }
    }

    /// The legend: each colour's class and its values.
    pub(crate) fn legend(&self) -> Vec<(String, String)> {
        let text = |x: f64| number(x, 3);
        match self {
            Scale::Sequential(bounds) => {
                let below = bounds.first().map(|b| (self.class(f64::NEG_INFINITY), format!("below {}", text(*b))));
                let above = bounds.iter().map(|b| (self.class(*b), format!("from {}", text(*b))));
                below.into_iter().chain(above).collect()
            }
            Scale::Signed(sizes) => {
                let sizes: Vec<f64> = std::iter::once(0.0).chain(sizes.iter().copied()).collect();
                let below = sizes.iter().rev().map(|size| (self.class(-size.max(f64::MIN_POSITIVE)), *size));
                let below = below.map(|(class, size)| {
                    (class, if size == 0.0 { "up to 0".into() } else { format!("below −{}", text(size)) })
                });
                let above = sizes
                    .iter()
                    .map(|size| (self.class(size.max(f64::MIN_POSITIVE)), format!("above {}", text(*size))));
                below.chain(above).collect()
            }
            Scale::Named(names) => names.iter().map(|(value, name)| (self.class(*value), name.to_string())).collect(),
        }
    }
}

/// The index of a value among those with names; that of the worst where it has none.
fn place(names: &[(f64, &str)], value: f64) -> usize {
    names.iter().position(|(named, _)| *named == value).unwrap_or(0)
}

impl Map {
    fn rows(&self) -> usize {
        self.values.len().checked_div(self.columns).unwrap_or(0)
    }

    fn at(&self, column: usize, row: usize) -> Option<f64> {
        self.values.get(row * self.columns + column).copied().flatten()
    }

    /// The colours and their meaning, with an entry for cells without a value where there are any.
    pub(crate) fn legend(&self) -> Vec<(String, String)> {
        let mut legend = self.scale.legend();
        let used = |class: &str| self.values.iter().flatten().any(|value| self.scale.class(*value) == class);
        legend.retain(|(class, _)| used(class));
        // One value has one colour, and no bounds.
        if let (Scale::Sequential(bounds), Some(value)) = (&self.scale, self.values.iter().flatten().next())
            && bounds.is_empty()
        {
            legend.push((self.scale.class(*value), format!("{} everywhere", number(*value, 3))));
        }
        if self.values.iter().any(Option::is_none) {
            legend.push(("none".into(), "no value".into()));
        }
        legend
    }

    /// Fewer cells, for a drawing of at most this many columns and rows: of each block the value of largest magnitude, or the worst of
    /// those with names.
    pub fn reduced(&self, columns: usize, rows: usize) -> Map {
        let step = |have: usize, room: usize| have.div_ceil(room.max(1)).max(1);
        let (dx, dy) = (step(self.columns, columns), step(self.rows(), rows));
        let (columns, rows) = (self.columns.div_ceil(dx), self.rows().div_ceil(dy));
        let block = |i: usize| {
            let (column, row) = (i % columns * dx, i / columns * dy);
            let cells = (row..(row + dy).min(self.rows()))
                .flat_map(|y| (column..(column + dx).min(self.columns)).map(move |x| (x, y)));
            cells
                .filter_map(|(x, y)| self.at(x, y))
                .max_by(|a, b| self.scale.weight(*a).total_cmp(&self.scale.weight(*b)))
        };
        Map { columns, values: (0..columns * rows).map(block).collect(), ..self.clone() }
    }

    /// Draws into a view of this size: runs of one colour as rectangles, and the edge as a line between cells.
    pub(crate) fn draw(&self, svg: &mut String, width: f64, height: f64) {
        let rows = self.rows();
        if rows == 0 {
            return;
        }
        let (dx, dy) = (width / self.columns as f64, height / rows as f64);
        // One path per colour.
        let mut paths: Vec<(String, String)> = Vec::new();
        for row in 0..rows {
            let class =
                |column: usize| self.at(column, row).map_or("none".to_string(), |value| self.scale.class(value));
            let mut start = 0;
            while start < self.columns {
                let colour = class(start);
                let mut end = start + 1;
                while end < self.columns && class(end) == colour {
                    end += 1;
                }
                let (x, y, wide) = (start as f64 * dx, height - (row + 1) as f64 * dy, (end - start) as f64 * dx);
                let at = paths.iter().position(|(class, _)| *class == colour).unwrap_or_else(|| {
                    paths.push((colour, String::new()));
                    paths.len() - 1
                });
                // With a small overlap, so that no gap is visible.
                let _ = write!(paths[at].1, "M{x:.2} {y:.2}h{:.2}v{:.2}h-{:.2}z", wide + 0.3, dy + 0.3, wide + 0.3);
                start = end;
            }
        }
        for (class, d) in paths {
            let _ = write!(svg, "<path class=\"cell {class}\" d=\"{d}\"/>");
        }
        let Some(edge) = self.edge else { return };
        let side = |column: usize, row: usize| self.at(column, row).map(|value| value > edge);
        let mut d = String::new();
        for row in 0..rows {
            for column in 0..self.columns {
                let here = side(column, row);
                let (x, y) = ((column + 1) as f64 * dx, height - (row + 1) as f64 * dy);
                let differs = |other: Option<bool>| here.is_some() && other.is_some() && here != other;
                if column + 1 < self.columns && differs(side(column + 1, row)) {
                    let _ = write!(d, "M{x:.2} {y:.2}v{dy:.2}");
                }
                if row + 1 < rows && differs(side(column, row + 1)) {
                    let _ = write!(d, "M{:.2} {y:.2}h{dx:.2}", x - dx);
                }
            }
        }
        if !d.is_empty() {
            // Light below dark, so that it is visible on every colour.
            let _ = write!(svg, "<path class=\"halo\" d=\"{d}\"/><path class=\"edge\" d=\"{d}\"/>");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_with_two_sides_has_its_edge_between_them() {
        let map = Map {
            columns: 2,
            values: vec![Some(-1.0), Some(2.0), Some(-3.0), None],
            scale: Scale::of([-1.0, 2.0, -3.0].into_iter()),
            edge: Some(0.0),
        };
        let mut svg = String::new();
        map.draw(&mut svg, 20.0, 20.0);
        assert!(svg.contains("class=\"edge\" d=\"M10.00 10.00v10.00\""), "{svg}");
        assert!(svg.contains("cell none"), "{svg}");
    }

    #[test]
    fn a_block_keeps_its_largest_value() {
        let values = (0..64).map(|i| Some(if i == 27 { -9.0 } else { 1.0 })).collect();
        let map = Map { columns: 8, values, scale: Scale::Sequential(Vec::new()), edge: None };
        let small = map.reduced(2, 2);
        assert_eq!((small.columns, small.values.len()), (2, 4));
        assert_eq!(small.values.iter().filter(|v| **v == Some(-9.0)).count(), 1);
    }

    #[test]
    fn names_have_a_colour_each_and_a_block_shows_the_worst() {
        let scale = Scale::Named(&[(1.0, "unstable"), (0.0, "marginal"), (-1.0, "stable")]);
        let values = (0..64).map(|i| Some(if i == 27 { 1.0 } else { -1.0 })).collect();
        let map = Map { columns: 8, values, scale, edge: Some(0.5) }.reduced(2, 2);
        assert_eq!(map.values.iter().filter(|v| **v == Some(1.0)).count(), 1);
        let legend = map.legend();
        // The names that occur in the map.
        assert_eq!(legend.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>(), ["unstable", "stable"]);
        assert_ne!(legend[0].0, legend[1].0);
    }

    #[test]
    fn the_legend_of_a_map_of_one_value_has_that_value() {
        let map = Map { columns: 2, values: vec![Some(0.5); 4], scale: Scale::of([0.5].into_iter()), edge: None };
        assert_eq!(map.legend(), [("m4".to_string(), "0.5 everywhere".to_string())]);
    }

    #[test]
    fn every_colour_of_a_scale_is_in_its_legend() {
        for scale in
            [Scale::of([1.0, 5.0].into_iter()), Scale::of([-1.0, 5.0].into_iter()), Scale::of([1.0, 1e6].into_iter())]
        {
            let legend = scale.legend();
            for i in -1000..1000 {
                let class = scale.class(f64::from(i) * 0.01);
                assert!(legend.iter().any(|(c, _)| *c == class), "{class} of {scale:?}");
            }
        }
    }
}
