//! All real roots of a polynomial, without a grid.

/// p(x) for coefficients from the constant upwards.
pub(crate) fn value(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// The real roots of p in (low, high) at which it changes sign, increasing, to the last digit. Between neighbouring roots of
/// p' there is at most one, so the derivatives isolate them (Rolle).
pub(crate) fn sign_changes(p: &[f64], low: f64, high: f64) -> Vec<f64> {
    if p.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> = p.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect();
    let mut ends = vec![low];
    ends.extend(sign_changes(&derivative, low, high));
    ends.push(high);
    let mut roots = Vec::new();
    for pair in ends.windows(2) {
        let (mut a, mut b) = (pair[0], pair[1]);
        let rising = value(p, b) > 0.0;
        if (value(p, a) > 0.0) == rising {
            continue;
        }
        loop {
            let middle = 0.5 * (a + b);
            if middle <= a || middle >= b {
                break;
            }
            if (value(p, middle) > 0.0) == rising { b = middle } else { a = middle }
        }
        roots.push(a);
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn separated_roots_are_all_found(mut roots in prop::collection::vec(0.1..3.9f64, 1..7)) {
            roots.sort_by(f64::total_cmp);
            prop_assume!(roots.windows(2).all(|w| w[1] - w[0] > 0.05));
            let mut p = vec![1.0];
            for r in &roots {
                p.push(0.0);
                for i in (0..p.len()).rev() {
                    p[i] = if i > 0 { p[i - 1] } else { 0.0 } - r * p[i];
                }
            }
            let found = sign_changes(&p, 0.0, 4.0);
            prop_assert_eq!(found.len(), roots.len());
            for (a, b) in found.iter().zip(&roots) {
                prop_assert!((a - b).abs() < 1e-6);
            }
        }
    }
}
