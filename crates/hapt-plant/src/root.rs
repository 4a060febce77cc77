//! The zero of a function between two places.

/// Where f, not positive at `low` and positive at `high`, changes sign: the end on which it is positive, to the last bits. By
/// false position after Illinois, with bisection wherever that stalls.
pub fn root(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    root_between((low, f(low)), (high, f(high)), f)
}

/// The same where f is known at both ends.
pub fn root_between((mut low, f_low): (f64, f64), (mut high, mut f_high): (f64, f64), f: impl Fn(f64) -> f64) -> f64 {
    let mut f_low = f_low.min(0.0);
    let (mut bisect, mut last_was_high) = (false, None);
    for _ in 0..200 {
        let width = high - low;
        if width <= 4.0 * f64::EPSILON * high {
            break;
        }
        let secant = low + width * (-f_low / (f_high - f_low));
        let inside = secant > low && secant < high;
        let middle = if bisect || !inside { low + 0.5 * width } else { secant };
        let value = f(middle);
        let is_high = value > 0.0;
        // The value at an end that stays twice in a row is halved, so that the next point falls on its side.
        let stays = last_was_high == Some(is_high);
        if is_high {
            (high, f_high) = (middle, value);
            f_low *= if stays { 0.5 } else { 1.0 };
        } else {
            (low, f_low) = (middle, value);
            f_high *= if stays { 0.5 } else { 1.0 };
        }
        last_was_high = Some(is_high);
        bisect = high - low > 0.5 * width;
    }
    high
}
