//! Ticks of axes, and formatting of numbers.

/// The ticks of an axis from `low` to `high`, about `wanted` and at least three, with distances of 1, 2 or 5 times a power of
/// ten.
pub fn linear(low: f64, high: f64, wanted: usize) -> Vec<f64> {
    let more = (wanted.max(3)..12).map(|more| spaced(low, high, more));
    std::iter::once(spaced(low, high, wanted))
        .chain(more)
        .find(|ticks| ticks.len() > 2)
        .unwrap_or_else(|| vec![low, high])
}

fn spaced(low: f64, high: f64, wanted: usize) -> Vec<f64> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return vec![low];
    }
    let rough = span / wanted.max(1) as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|&s| s >= rough * 0.999).unwrap_or(rough);
    let first = (low / step - 1e-9).ceil();
    let count = ((high / step + 1e-9).floor() - first).clamp(0.0, 100.0) as u64;
    // + 0, so that zero is never "-0".
    (0..=count).map(|i| (first + i as f64) * step + 0.0).collect()
}

/// The same for a logarithmic axis: powers of ten, with 2 and 5 between them where there is room.
pub fn logarithmic(low: f64, high: f64, wanted: usize) -> Vec<f64> {
    let (from, to) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (high / low).log10();
    let factors: &[f64] = match wanted as f64 / decades.max(1e-9) {
        room if room >= 3.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let every = ((decades / wanted.max(1) as f64).ceil() as i32).max(1);
    let inside = |x: &f64| *x >= low * (1.0 - 1e-9) && *x <= high * (1.0 + 1e-9);
    (from..=to)
        .filter(|power| power.rem_euclid(every) == 0)
        .flat_map(|power| factors.iter().map(move |factor| factor * 10f64.powi(power)))
        .filter(inside)
        .collect()
}

/// The labels of ticks, with the digits that their step needs.
pub fn labels(ticks: &[f64]) -> Vec<String> {
    let largest = ticks.iter().fold(0.0, |most: f64, t| most.max(t.abs()));
    let step = ticks.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() && step > 0.0 { step } else { largest.max(1e-300) };
    let digits = (-(step * 1.0001).log10().floor()).max(0.0) as usize;
    let scientific = largest >= 1e6 || (largest < 1e-3 && largest > 0.0);
    let label = |&tick: &f64| {
        if tick == 0.0 {
            "0".to_string()
        } else if scientific {
            let places = ((largest / step).log10().ceil().clamp(0.0, 6.0)) as usize;
            power(&format!("{tick:.places$e}"))
        } else {
            minus(&format!("{tick:.digits$}"))
        }
    };
    ticks.iter().map(label).collect()
}

/// A single number, as on a logarithmic axis or in a sentence: with `digits` significant digits and without trailing zeros.
pub fn number(x: f64, digits: usize) -> String {
    if x == 0.0 {
        return "0".into();
    }
    if !x.is_finite() {
        return "not finite".into();
    }
    let digits = digits.max(1);
    let exponent = x.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        return power(&format!("{x:.*e}", digits - 1));
    }
    let places = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
    minus(&trimmed(&format!("{x:.places$}")))
}

fn trimmed(text: &str) -> String {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text.into(),
    }
}

/// 1.50e-5 as 1.5·10⁻⁵.
fn power(text: &str) -> String {
    let Some((mantissa, exponent)) = text.split_once('e') else { return minus(text) };
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
    };
    let exponent: String = exponent.chars().map(raised).collect();
    match trimmed(mantissa).as_str() {
        "1" => format!("10{exponent}"),
        "-1" => format!("−10{exponent}"),
        mantissa => format!("{}·10{exponent}", minus(mantissa)),
    }
}

/// With a typographic minus sign.
fn minus(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(linear(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(labels(&linear(-974.0, 974.0, 5)), ["−500", "0", "500"]);
        assert_eq!(labels(&linear(0.0, 0.3, 4)), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(linear(-36.0, 36.0, 3), [-20.0, 0.0, 20.0]);
        assert_eq!(logarithmic(0.1, 10.0, 6), [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(logarithmic(1e-6, 1.0, 4).len(), 4);
    }

    #[test]
    fn numbers_have_few_digits_and_a_real_minus() {
        for (x, text) in [
            (0.0197388, "0.01974"),
            (-822.25, "−822.2"),
            (1.0, "1"),
            (1.5e-5, "1.5·10⁻⁵"),
            (-1e9, "−10⁹"),
            (120.0, "120"),
        ] {
            assert_eq!(number(x, 4), text);
        }
    }
}
