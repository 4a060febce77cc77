//! The first zero of a function that has no formula.

use crate::error::Error;

/// Points a decade.
const PER_DECADE: f64 = 16.0;

/// The largest x in [low, high] up to which f has not been above 0, to the last digits, or `None` when it never is. f is seen
/// on a logarithmic grid; where it has a maximum below 0 that may rise above it between the points, that is looked at closer.
pub(crate) fn first_rise(
    mut f: impl FnMut(f64) -> Result<f64, Error>,
    low: f64,
    high: f64,
) -> Result<Option<f64>, Error> {
    let steps = ((high / low).log10() * PER_DECADE).ceil().clamp(2.0, 400.0);
    let ratio = (high / low).powf(1.0 / steps);
    let (mut x, mut seen) = (low, Vec::<(f64, f64)>::new());
    for _ in 0..=steps as usize {
        let y = f(x)?;
        if let [.., before, here] = seen[..] {
            // A parabola's vertex lies above its highest point by less than that stands above the lower neighbour.
            let stands = here.1 - before.1.min(y);
            if here.1 >= before.1 && here.1 >= y && here.1 + stands > 0.0 {
                let top = summit(&mut f, before.0, x)?;
                if top.1 > 0.0 {
                    return crossing(&mut f, before, top).map(Some);
                }
            }
        }
        if y > 0.0 {
            return match seen.last() {
                Some(&before) => crossing(&mut f, before, (x, y)).map(Some),
                None => Ok(Some(x)),
            };
        }
        seen.push((x, y));
        x *= ratio;
    }
    Ok(None)
}

/// A maximum between a and b, by golden section; at once when one above 0 is met.
fn summit(f: &mut impl FnMut(f64) -> Result<f64, Error>, mut a: f64, mut b: f64) -> Result<(f64, f64), Error> {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let mut left = (b - GOLDEN * (b - a), f(b - GOLDEN * (b - a))?);
    let mut right = (a + GOLDEN * (b - a), f(a + GOLDEN * (b - a))?);
    for _ in 0..32 {
        if left.1 > 0.0 || right.1 > 0.0 {
            break;
        }
        if left.1 > right.1 {
            (b, right) = (right.0, left);
            let x = b - GOLDEN * (b - a);
            left = (x, f(x)?);
        } else {
            (a, left) = (left.0, right);
            let x = a + GOLDEN * (b - a);
            right = (x, f(x)?);
        }
    }
    Ok(if left.1 > right.1 { left } else { right })
}

/// The last x before f rises above 0 between a, where it is not, and b, where it is: regula falsi with the Illinois
/// correction (Dowell and Jarratt, BIT 11, 1971). Where one step after the other does not halve what is left, the second is followed by
/// one that does, the third by two, and so on: f may be flat up to where it rises, another eigenvalue's rounding, and tell a secant
/// nothing.
pub(crate) fn crossing(
    f: &mut impl FnMut(f64) -> Result<f64, Error>,
    mut a: (f64, f64),
    mut b: (f64, f64),
) -> Result<f64, Error> {
    let (mut wa, mut wb) = (a.1, b.1);
    // Halvings still to come, and how many the next idle step costs.
    let (mut halvings, mut cost) = (0, 0);
    for _ in 0..120 {
        let width = b.0 - a.0;
        let middle = 0.5 * (a.0 + b.0);
        if middle <= a.0 || middle >= b.0 || width < 2.0 * f64::EPSILON * b.0 {
            break;
        }
        let secant = (a.0 * wb - b.0 * wa) / (wb - wa);
        let halves = halvings > 0 || !(secant > a.0 && secant < b.0);
        let x = if halves { middle } else { secant };
        let y = f(x)?;
        if y > 0.0 {
            (b, wb) = ((x, y), y);
            wa *= 0.5;
        } else {
            (a, wa) = ((x, y), y);
            wb *= 0.5;
        }
        if halves {
            halvings = i32::max(halvings - 1, 0);
        } else if b.0 - a.0 > 0.5 * width {
            halvings = cost;
            cost += 1;
        } else {
            cost = 0;
        }
    }
    Ok(a.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_many_zeros_is_found_to_the_last_digits() {
        let found = first_rise(|x| Ok((-x).sin()), 0.1, 100.0).unwrap().unwrap();
        assert!((found - std::f64::consts::PI).abs() < 1e-14, "{found}");
    }

    #[test]
    fn an_island_between_the_points_is_found() {
        // Above 0 for |ln x| < 0.01, an eighth of the grid's spacing.
        let island = |x: f64| Ok(1e-4 - x.ln().powi(2));
        let found = first_rise(island, 0.0123, 98.7).unwrap().unwrap();
        assert!((found.ln() + 0.01).abs() < 1e-12, "{found}");
    }

    /// What an eigenvalue on the circle beside the one that leaves it makes of a growth.
    #[test]
    fn where_a_flat_function_rises_is_found_in_little_more_than_halvings() {
        for power in [1, 2, 3] {
            let mut asked = 0;
            let mut kinked = |x: f64| {
                asked += 1;
                Ok((x - 2.4e-3).max(0.0).powi(power) - 1e-30)
            };
            let found = crossing(&mut kinked, (2.2e-3, -1e-30), (2.6e-3, 2e-4_f64.powi(power))).unwrap();
            let reached = 2.4e-3 + 1e-30_f64.powf(1.0 / f64::from(power));
            assert!((found / reached - 1.0).abs() < 1e-15, "{power}: {found}");
            // A bracket of a sixth of x has 49 halvings to the last digit.
            assert!(asked < 70, "{power}: {asked}");
        }
    }

    #[test]
    fn a_function_below_zero_has_none() {
        assert_eq!(first_rise(|x| Ok(-x), 0.1, 10.0).unwrap(), None);
    }
}
