//! A million loops of one body under forward Euler, the puck held: which of them grow, and how fast.

use anyhow::{Result, ensure};
use hapt_analysis::Loops;
use hapt_analysis::closed_form::forward_euler_growth;
use hapt_model::Method;

use crate::timed;

const PERIOD: f64 = 1e-3;
/// Values of stiffness, and of inertia: those of `bench/python/loops.py`.
const SIDE: usize = 1000;

fn at(from: f64, to: f64, i: usize) -> f64 {
    from + (to - from) * i as f64 / (SIDE - 1) as f64
}

/// A row of the grid after the other, in a row's memory: `ask` of each, then `read` its answers.
fn rows(mut ask: impl FnMut(Loops<'_>, &mut [f64]), mut read: impl FnMut(usize, &[f64])) {
    let inertia: Vec<f64> = (0..SIDE).map(|i| at(0.01, 0.05, i)).collect();
    let (mut stiffness, none, period) = (vec![0.0; SIDE], vec![0.0; SIDE], vec![PERIOD; SIDE]);
    let mut answers = vec![0.0; SIDE];
    for row in 0..SIDE {
        stiffness.fill(at(0.5, 2.0, row));
        let columns =
            Loops { inertia: &inertia, stiffness: &stiffness, fixed: &none, per_period: &none, period: &period };
        ask(columns, &mut answers);
        read(row, &answers);
    }
}

/// The largest relative error against ln(1 + x²)/(2T) is the answer.
pub fn growths(repeats: usize) -> Result<()> {
    let ask = |columns: Loops<'_>, answers: &mut [f64]| columns.growths(Method::ForwardEuler, answers);
    timed(repeats, SIDE * SIDE, || {
        rows(ask, |_, answers| _ = std::hint::black_box(answers));
        Ok(())
    })?;
    let mut error = 0.0_f64;
    rows(ask, |row, answers| {
        for (i, growth) in answers.iter().enumerate() {
            let exact = forward_euler_growth((at(0.5, 2.0, row) / at(0.01, 0.05, i)).sqrt(), PERIOD);
            error = error.max(((growth - exact) / exact).abs());
        }
    });
    println!("{error:e}");
    Ok(())
}

/// How many are not unstable is the answer, and it is none.
pub fn verdicts(repeats: usize) -> Result<()> {
    let ask = |columns: Loops<'_>, answers: &mut [f64]| columns.verdicts(Method::ForwardEuler, answers);
    timed(repeats, SIDE * SIDE, || {
        rows(ask, |_, answers| _ = std::hint::black_box(answers));
        Ok(())
    })?;
    let mut others = 0;
    rows(ask, |_, answers| others += answers.iter().filter(|verdict| **verdict != 1.0).count());
    ensure!(others == 0, "{others} loops are said not to grow");
    println!("{others}");
    Ok(())
}
