//! Maximisation by the Nelder-Mead simplex, without derivatives (Nelder and Mead, The Computer Journal 7(4), 1965).

/// Maximises `value` from `start`. The first simplex has `width` along each coordinate. The search takes about `evaluations`
/// values; it completes a round that has begun, with at most N + 1 more. It ends early when the simplex has shrunk to 1e-4 of its
/// first width. Returns the best point and its value. A value that is not a number counts as the lowest. Deterministic: no random
/// numbers.
pub fn maximise<const N: usize>(
    start: [f64; N],
    width: [f64; N],
    evaluations: usize,
    mut value: impl FnMut(&[f64; N]) -> f64,
) -> ([f64; N], f64) {
    let mut evaluate = |x: &[f64; N]| {
        let h = value(x);
        (*x, if h.is_nan() { f64::NEG_INFINITY } else { h })
    };
    let mut all = vec![evaluate(&start)];
    for i in 0..N {
        let mut x = start;
        x[i] += width[i];
        all.push(evaluate(&x));
    }
    let mut used = N + 1;
    while used < evaluations {
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (best, worst) = (all[0], all[N]);
        let spread = |i: usize| all.iter().map(|(x, _)| (x[i] - best.0[i]).abs()).fold(0.0, f64::max);
        if (0..N).all(|i| spread(i) <= 1e-4 * width[i].abs()) {
            break;
        }
        let middle: [f64; N] = std::array::from_fn(|i| all[..N].iter().map(|(x, _)| x[i]).sum::<f64>() / N as f64);
        let along = |t: f64| std::array::from_fn(|i| middle[i] + t * (worst.0[i] - middle[i]));
        let mirrored = evaluate(&along(-1.0));
        used += 1;
        let next = if mirrored.1 > best.1 {
            used += 1;
            let further = evaluate(&along(-2.0));
            if further.1 > mirrored.1 { Some(further) } else { Some(mirrored) }
        } else if mirrored.1 > all[N - 1].1 {
            Some(mirrored)
        } else {
            used += 1;
            let (nearer, least) = if mirrored.1 > worst.1 {
                (evaluate(&along(-0.5)), mirrored.1)
            } else {
                (evaluate(&along(0.5)), worst.1)
            };
            (nearer.1 > least).then_some(nearer)
        };
        match next {
            Some(next) => all[N] = next,
            None => {
                for point in &mut all[1..] {
                    *point = evaluate(&std::array::from_fn(|i| 0.5 * (point.0[i] + best.0[i])));
                    used += 1;
                }
            }
        }
    }
    all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((start, f64::NEG_INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_the_maximum_of_a_quadratic_and_of_rosenbrocks_ridge() {
        let hill = |x: &[f64; 3]| -(x[0] - 1.0).powi(2) - 4.0 * (x[1] + x[0]).powi(2) - 0.5 * (x[2] - 3.0).powi(2);
        let (x, h) = maximise([0.0; 3], [0.7; 3], 400, hill);
        assert!(h > -1e-7 && (x[0] - 1.0).abs() < 1e-3 && (x[1] + 1.0).abs() < 1e-3 && (x[2] - 3.0).abs() < 1e-3);
        // Rosenbrock's valley, upside down.
        let (x, _) =
            maximise([-1.2, 1.0], [0.5; 2], 400, |x| -(1.0 - x[0]).powi(2) - 100.0 * (x[1] - x[0] * x[0]).powi(2));
        assert!((x[0] - 1.0).abs() < 1e-2 && (x[1] - 1.0).abs() < 2e-2, "{x:?}");
    }

    #[test]
    fn it_keeps_its_limit_of_evaluations_and_never_returns_nan() {
        let mut evaluations = 0;
        let (x, h) = maximise([2.0, 0.0], [1.0; 2], 30, |x| {
            evaluations += 1;
            if x[0] > 2.5 { f64::NAN } else { x[0] }
        });
        assert!(evaluations <= 33 && x[0] <= 2.5 && h == x[0]);
    }
}
