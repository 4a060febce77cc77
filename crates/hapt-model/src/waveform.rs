//! The waveform of a texture: from its harmonics, from samples over a period, or from a file of samples.

use std::f64::consts::TAU;

use hapt_core::{HARMONICS, Waveform};

use crate::error::{Error, ErrorKind, Location};
use crate::fields::Fields;
use crate::keys::{MOST_SAMPLES, NUMBERS};
use crate::path;
use crate::quantity::parse_in_unit;
use crate::unit::Unit;
use crate::words;

/// How far a sample, or the mean of all, may be from what the harmonics show: a part of the largest sample.
const TOLERANCE: f64 = 0.01;
/// The one column of a file.
const HEADER: &str = "waveform";

/// The waveform of a texture's keys.
pub(crate) fn read(fields: &Fields<'_>, files: &path::Reader<'_>) -> Result<Waveform, Error> {
    let given: Vec<&str> = ["sine", "cosine", "samples", "file"].into_iter().filter(|key| fields.has(key)).collect();
    match given[..] {
        ["sine"] | ["cosine"] | ["sine", "cosine"] => of_harmonics(fields),
        ["samples"] => {
            let samples = fields.numbers("samples").unwrap_or_default();
            of_samples(samples).map_err(|message| fields.error(ErrorKind::Value, "samples", message))
        }
        ["file"] => {
            let file = fields.text("file").unwrap_or_default();
            let fail = |message| fields.error(ErrorKind::Unreadable, "file", message);
            let samples = files.text(&file).and_then(|(name, text)| parse(&name, &text));
            let samples = samples.map_err(|failure| match failure.location {
                // A mistake in the file is shown there, one in its name here.
                Some(_) => Error { key: format!("{}.file", fields.table_path()), ..failure },
                None => fail(failure.message),
            })?;
            of_samples(&samples).map_err(|message| fields.error(ErrorKind::Value, "file", message))
        }
        [] => Err(fields.missing("sine")),
        [.., key] => {
            let message = "a waveform has one source: sine and cosine, or samples, or file";
            Err(fields.error(ErrorKind::Combination, key, message))
        }
    }
}

/// The waveform of a table that has only harmonics.
pub(crate) fn of_harmonics(fields: &Fields<'_>) -> Result<Waveform, Error> {
    if !fields.has("sine") && !fields.has("cosine") {
        return Err(fields.missing("sine"));
    }
    Ok(Waveform { sine: harmonics(fields, "sine"), cosine: harmonics(fields, "cosine") })
}

fn harmonics(fields: &Fields<'_>, key: &str) -> [f32; HARMONICS] {
    let mut all = [0.0; HARMONICS];
    all.iter_mut().zip(fields.numbers(key).unwrap_or_default()).for_each(|(place, number)| *place = *number as f32);
    all
}

/// The discrete Fourier series of samples at equal distances over one period; the message where the harmonics do not represent them.
fn of_samples(samples: &[f64]) -> Result<Waveform, String> {
    let count = samples.len();
    let angle = |i: usize| TAU * i as f64 / count as f64;
    let mean_of = |factor: &dyn Fn(usize) -> f64| {
        samples.iter().enumerate().map(|(i, sample)| sample * factor(i)).sum::<f64>() / count as f64
    };
    let largest = samples.iter().fold(0.0, |largest: f64, sample| largest.max(sample.abs()));
    let tolerance = TOLERANCE * largest;
    let mean = mean_of(&|_| 1.0);
    if mean.abs() > tolerance {
        return Err(format!(
            "the samples have a mean of {mean}, and a texture has none; subtract it from each, and add a coupling of kind \"constant\" \
             whose torque is {mean} times the texture's"
        ));
    }
    let mut waveform = Waveform::default();
    for (i, (sine, cosine)) in waveform.sine.iter_mut().zip(&mut waveform.cosine).enumerate() {
        let n = i + 1;
        // Half as many harmonics as samples; the last one of an even count has only its cosine.
        let share = match (2 * n).cmp(&count) {
            std::cmp::Ordering::Less => 2.0,
            std::cmp::Ordering::Equal => 1.0,
            std::cmp::Ordering::Greater => break,
        };
        // The product modulo the count, so that sines keep their digits.
        let of = |function: fn(f64) -> f64| {
            let factor = share * mean_of(&|i| function(angle(i * n % count)));
            if factor.abs() < 1e-13 * largest { 0.0 } else { factor as f32 }
        };
        *cosine = of(f64::cos);
        *sine = if share == 1.0 { 0.0 } else { of(f64::sin) };
    }
    let misses = samples.iter().enumerate().map(|(i, sample)| (i, (waveform.at(angle(i)) + mean - sample).abs()));
    match misses.max_by(|(_, a), (_, b)| a.total_cmp(b)) {
        Some((i, miss)) if miss > tolerance => Err(format!(
            "{HARMONICS} harmonics miss sample {} of {count} by {}, more than a hundredth of the largest; give smoother samples, or at \
             most {}, or the finer waves as a texture of a shorter pitch",
            i + 1,
            (1e3 * miss).round() / 1e3,
            2 * HARMONICS + 1
        )),
        Some(_) | None => Ok(waveform),
    }
}

/// The samples of a file: a header, and a number a line; blank lines and those that begin with # are left out.
fn parse(name: &str, text: &str) -> Result<Vec<f64>, Error> {
    let body = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut start = text.len() - body.len();
    let fail = |at: usize, length: usize, message: String| {
        let location = Some(Box::new(Location::new(name, text, at..at + length)));
        Err(Error { kind: ErrorKind::Syntax, key: String::new(), message, location })
    };
    let (mut has_header, mut samples) = (false, Vec::new());
    for line in body.split_inclusive('\n') {
        let at = start + (line.len() - line.trim_start().len());
        start += line.len();
        let content = line.trim();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        if !has_header {
            if path::unquoted(content) != HEADER {
                let message = format!("{} is no header; a waveform's is {HEADER:?}", words::quoted(content));
                return fail(at, content.len(), message);
            }
            has_header = true;
            continue;
        }
        match parse_in_unit(path::unquoted(content), Unit::ONE).filter(|sample| NUMBERS.contains(sample)) {
            Some(_) if samples.len() == MOST_SAMPLES => {
                return fail(at, content.len(), format!("a waveform has at most {MOST_SAMPLES} samples"));
            }
            Some(sample) => samples.push(sample),
            None => {
                let (quoted, largest) = (words::quoted(content), NUMBERS.end());
                return fail(at, content.len(), format!("{quoted} is no number from -{largest} to {largest}"));
            }
        }
    }
    if samples.len() < 2 {
        let message = format!("the file ends here; a waveform has the header {HEADER:?} and 2 samples at least");
        return fail(text.len(), 0, message);
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn sampled(waveform: &Waveform, count: usize) -> Vec<f64> {
        (0..count).map(|i| waveform.at(TAU * i as f64 / count as f64)).collect()
    }

    proptest! {
        #[test]
        fn samples_of_a_waveform_give_it_back(
            sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(-1.0_f32..1.0), count in 9_usize..100,
        ) {
            let waveform = Waveform { sine, cosine };
            let read = of_samples(&sampled(&waveform, count)).unwrap();
            for ((_, a, b), (_, c, d)) in waveform.harmonics().zip(read.harmonics()) {
                prop_assert!((a - c).abs() < 1e-6 && (b - d).abs() < 1e-6, "{waveform:?} {read:?}");
            }
        }

        #[test]
        fn up_to_nine_samples_without_a_mean_are_met(samples in prop::collection::vec(-1.0_f64..1.0, 2..=9)) {
            let mean = samples.iter().sum::<f64>() / samples.len() as f64;
            let samples: Vec<f64> = samples.iter().map(|sample| sample - mean).collect();
            let read = of_samples(&samples).unwrap();
            for (given, got) in samples.iter().zip(sampled(&read, samples.len())) {
                prop_assert!((given - got).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn what_harmonics_cannot_show_is_refused_with_what_would_be_right() {
        let mean = of_samples(&[1.0, 0.0, 0.5, 0.5]).unwrap_err();
        assert!(mean.contains("mean of 0.5") && mean.contains("constant"), "{mean}");
        let square: Vec<f64> = (0..16).map(|i| if i < 8 { 1.0 } else { -1.0 }).collect();
        let miss = of_samples(&square).unwrap_err();
        assert!(miss.contains("4 harmonics miss sample") && miss.contains("at most 9"), "{miss}");
        assert_eq!(of_samples(&[0.0, 0.0]), Ok(Waveform::default()));
    }

    #[test]
    fn a_file_has_a_header_and_a_number_a_line() {
        assert_eq!(parse("w.csv", "\u{feff}# made by hand\r\nwaveform\r\n 1 \r\n\r\n-1e0\n").unwrap(), [1.0, -1.0]);
        let message = |text: &str| parse("w.csv", text).unwrap_err().to_string();
        assert_eq!(
            message("waveform\n1\nx\n"),
            "\"x\" is no number from -1000 to 1000\n --> w.csv:3:1\n  |\n3 | x\n  | ^"
        );
        assert!(message("1\n-1\n").starts_with("\"1\" is no header; a waveform's is \"waveform\""));
        assert!(message("waveform\n1\n").starts_with("the file ends here"));
        assert!(message("waveform\n1\n1001\n").starts_with("\"1001\" is no number"));
        let many = format!("waveform\n{}", "0\n".repeat(MOST_SAMPLES + 1));
        assert!(message(&many).starts_with("a waveform has at most 4096 samples"));
    }
}
