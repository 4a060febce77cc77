//! The roundest numbers next to an edge that a search has found.

/// Largest relative distance of a remedy from its edge.
const NEAR: f64 = 4e-7;
/// Largest relative distance of the line that shows the remedy in the file's unit: wider, so that a round number near the edge is near
/// every remedy within [`NEAR`] of it. Together they are 1e-6.
pub(crate) const NEAR_IN_FILE: f64 = 6e-7;

/// Largest number of significant digits that is tried.
const DIGITS: usize = 12;

/// On which side of an edge the certified values are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Certified {
    Above,
    Below,
}

/// The numbers within a part `near` of `edge`, of one to [`DIGITS`] significant digits: for each count of digits the nearest, then its
/// neighbour on the certified side. None where the edge is 0.
pub(crate) fn candidates(edge: f64, side: Certified, near: f64) -> impl Iterator<Item = f64> {
    let is_near = move |x: &f64| (x - edge).abs() <= near * edge.abs();
    let of_digits = move |digits: usize| {
        let nearest = decimal(edge, digits - 1);
        let step = 10f64.powf(edge.abs().log10().floor() - (digits - 1) as f64);
        let neighbour = match side {
            Certified::Above => decimal(nearest + step, digits - 1),
            Certified::Below => decimal(nearest - step, digits - 1),
        };
        [nearest, neighbour]
    };
    let most = if edge.is_normal() { DIGITS } else { 0 };
    (1..=most).flat_map(of_digits).filter(is_near)
}

/// x with this many digits after the first.
fn decimal(x: f64, places: usize) -> f64 {
    format!("{x:.places$e}").parse().unwrap_or(x)
}

/// The number of fewest digits within [`NEAR`] of `edge` that `holds`, which decides by the certificate; `edge` itself where none does.
pub(crate) fn roundest(edge: f64, side: Certified, holds: impl FnMut(&f64) -> bool) -> f64 {
    candidates(edge, side, NEAR).find(holds).unwrap_or(edge)
}

/// The number of four digits next to an edge, on its certified side.
pub(crate) fn within(edge: f64, side: Certified) -> f64 {
    let holds = |x: &f64| match side {
        Certified::Above => *x >= edge,
        Certified::Below => *x <= edge,
    };
    let nearest = decimal(edge, 3);
    let step = 10f64.powf(edge.abs().log10().floor() - 3.0);
    let neighbour = decimal(if side == Certified::Above { nearest + step } else { nearest - step }, 3);
    [nearest, neighbour].into_iter().find(holds).unwrap_or(edge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn four_digits_stay_on_the_certified_side(edge in 1e-9..1e9f64, above in any::<bool>()) {
            let found = within(edge, if above { Certified::Above } else { Certified::Below });
            prop_assert!((found >= edge) == above || found == edge);
            prop_assert!((found / edge - 1.0).abs() <= 1.001e-3);
            prop_assert_eq!(found, decimal(found, 3));
        }

        #[test]
        fn a_round_edge_that_a_search_has_missed_is_found(
            digits in 1..9999u32, exponent in -9..9i32, off in -1e-7..1e-7f64, above in any::<bool>(),
        ) {
            let edge: f64 = format!("{digits}e{exponent}").parse().unwrap();
            let side = if above { Certified::Above } else { Certified::Below };
            prop_assert_eq!(roundest(edge * (1.0 + off), side, |_| true), edge);
        }

        #[test]
        fn what_holds_on_one_side_alone_is_rounded_to_that_side(edge in 1e-9..1e9f64, above in any::<bool>()) {
            let side = if above { Certified::Above } else { Certified::Below };
            let found = roundest(edge, side, |x| if above { *x >= edge } else { *x <= edge });
            prop_assert!((found >= edge) == above || found == edge);
            prop_assert!((found / edge - 1.0).abs() <= NEAR);
            // Seven digits are always within it.
            prop_assert!(format!("{found:e}").split('e').next().unwrap().len() <= 9, "{}", found);
        }
    }
}
