//! Numbers of the world that the C may change: which of the compiled world's numbers each one is.
//!
//! A number that goes through a method's matrices changes all of them, and only the core computes those. Any other is itself, its opposite or
//! its half among the compiled numbers. This is found by compiling the world with values of the whole range, so that no law is
//! described a second time.

use hapt_core::{Coupling, Limits, Real, Spec};

use crate::data::{PART_NUMBERS, is_used, number, place};
use crate::numbers::{Collected, Constant, collected};
use crate::{Error, Float};

/// A number of a coupling that the C may change, within its certified range.
#[derive(Clone, Debug, PartialEq)]
pub struct Tune {
    /// Its key in the world file, such as `couplings.0.stiffness`.
    pub key: String,
    /// The coupling's place in the spec.
    pub coupling: usize,
    /// The quantity of its law, or `limit`.
    pub quantity: String,
    /// The range in which the world is certified with all else as it is.
    pub range: [f64; 2],
}

/// Values of a range at which the world is compiled, its ends among them.
const TRIALS: usize = 33;

/// A parameter in C.
#[derive(Debug)]
pub(crate) struct Parameter {
    /// Its name behind the prefix.
    pub name: String,
    pub key: String,
    /// The least, the file's, and the largest value, as numbers of the C's.
    pub values: [f64; 3],
    /// The new value of each place of the compiled world, such as `wall[0].stiffness` and `value`.
    pub sets: Vec<(String, &'static str)>,
}

/// The parameters of a world. `code` is the C that uses the compiled numbers.
pub(crate) fn parameters(
    spec: &Spec,
    limits: &Limits,
    tunes: &[Tune],
    code: &str,
    float: Float,
) -> Result<Vec<Parameter>, Error> {
    let all: Result<Vec<Parameter>, Error> = tunes
        .iter()
        .map(|tune| match float {
            Float::F32 => parameter::<f32>(spec, limits, tune, code, inward),
            Float::F64 => parameter::<f64>(spec, limits, tune, code, |range| range),
        })
        .collect();
    let all = all?;
    for (i, parameter) in all.iter().enumerate() {
        if all.iter().take(i).any(|other| other.name == parameter.name) {
            return Err(Error::Tune { key: parameter.key.clone(), why: "it is named twice" });
        }
    }
    Ok(all)
}

/// The numbers of f32 within a range.
fn inward([low, high]: [f64; 2]) -> [f64; 2] {
    let (mut least, mut most) = (low as f32, high as f32);
    if f64::from(least) < low {
        least = least.next_up();
    }
    if f64::from(most) > high {
        most = most.next_down();
    }
    [f64::from(least), f64::from(most)]
}

fn parameter<F: Real>(
    spec: &Spec,
    limits: &Limits,
    tune: &Tune,
    code: &str,
    inward: fn([f64; 2]) -> [f64; 2],
) -> Result<Parameter, Error> {
    let refuse = |why: &'static str| Error::Tune { key: tune.key.clone(), why };
    let given = with(spec, tune, None).ok_or_else(|| refuse("the world has no such number"))?.1;
    let file = F::from_f64(given).to_f64();
    let [low, high] = inward(tune.range);
    if !(low > 0.0 && low < high && high.is_finite() && (low..=high).contains(&file)) {
        return Err(refuse("there is no range of positive values around the file's"));
    }
    let base = collected::<F>(spec, limits)?;
    let step = (high / low).powf(1.0 / (TRIALS - 1) as f64);
    let mut trials = Vec::new();
    for i in 0..TRIALS {
        let x = if i + 1 == TRIALS { high } else { (low * step.powi(i as i32)).clamp(low, high) };
        let x = F::from_f64(x).to_f64();
        let (couplings, _) = with(spec, tune, Some(x)).ok_or_else(|| refuse("the world has no such number"))?;
        let changed = collected::<F>(&Spec { couplings: &couplings, ..*spec }, limits)?;
        if !is_alike(&base, &changed) {
            return Err(refuse("the compiled world has another form elsewhere in the range"));
        }
        trials.push((x, changed));
    }
    trials.push((file, base));
    let runs: Vec<(f64, Vec<(String, f64)>)> = trials.iter().map(|(x, world)| (*x, places(world, code))).collect();
    let mut sets = Vec::new();
    let [.., (_, file_places)] = &runs[..] else { return Err(refuse("it has no values")) };
    for (i, (name, was)) in file_places.iter().enumerate() {
        let at = |run: &(f64, Vec<(String, f64)>)| run.1.get(i).map(|(_, value)| *value);
        let is = |form: fn(F) -> F| {
            runs.iter().all(|run| at(run).map(f64::to_bits) == Some(form(F::from_f64(run.0)).to_f64().to_bits()))
        };
        if runs.iter().all(|run| at(run).map(f64::to_bits) == Some(was.to_bits())) {
            continue;
        }
        let form = if is(|x| x) {
            "value"
        } else if is(|x| -x) {
            "-value"
        } else if is(|x| F::HALF * x) {
            "(hapt_real)0.5 * value"
        } else {
            return Err(refuse(
                "other numbers of the compiled world follow from it, which only hapt computes: write another file for another value",
            ));
        };
        sets.push((name.clone(), form));
    }
    Ok(Parameter {
        name: tune.key.to_uppercase().replace('.', "_"),
        key: tune.key.clone(),
        values: [low, file, high],
        sets,
    })
}

/// The couplings with a value of this number, and the value that it has; `None` where there is none.
fn with(spec: &Spec, tune: &Tune, value: Option<f64>) -> Option<(Vec<Coupling>, f64)> {
    let mut couplings = spec.couplings.to_vec();
    let coupling = couplings.get_mut(tune.coupling)?;
    let was = if tune.quantity == "limit" {
        let limit = coupling.limit?;
        coupling.limit = Some(value.unwrap_or(limit));
        limit
    } else {
        let quantity = coupling.law.quantities().find(|quantity| quantity.name == tune.quantity)?;
        let was = *quantity.value;
        *quantity.value = value.unwrap_or(was);
        was
    };
    Some((couplings, was))
}

/// Whether two compiled worlds differ in their numbers only.
fn is_alike(one: &Collected, other: &Collected) -> bool {
    let shapes = |numbers: &[Constant], others: &[Constant]| {
        numbers.len() == others.len() && numbers.iter().zip(others).all(|(x, y)| x.name == y.name && x.shape == y.shape)
    };
    one.wholes == other.wholes
        && shapes(&one.numbers, &other.numbers)
        && one.elements.len() == other.elements.len()
        && one.elements.iter().zip(&other.elements).all(|(x, y)| {
            x.list == y.list && x.kind == y.kind && x.wholes == y.wholes && shapes(&x.numbers, &y.numbers)
        })
}

/// Every number of a compiled world that the C has, with its place there.
fn places(world: &Collected, code: &str) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    let mut put = |name: String, constant: &Constant| {
        for (i, value) in constant.values.iter().enumerate() {
            let mut index = String::new();
            let mut rest = i;
            for length in constant.shape.iter().rev() {
                index = format!("[{}]{index}", rest % length);
                rest /= length;
            }
            all.push((format!("{name}.{}{index}", constant.name).trim_start_matches('.').to_owned(), *value));
        }
    };
    for constant in world.numbers.iter().filter(|constant| is_used(code, constant.name)) {
        put(String::new(), constant);
    }
    for list in ["couplings", "pairs", "parts"] {
        let elements: Vec<_> = world.list(list).collect();
        if list != "couplings" && !code.contains(&format!("world->{list}")) {
            continue;
        }
        for (i, element) in elements.iter().enumerate() {
            let own = place(&elements, i);
            for (j, constant) in element.numbers.iter().enumerate() {
                let name = match list {
                    "couplings" => format!("{}[{own}]", element.kind),
                    "parts" if j >= PART_NUMBERS => format!("stored_{}[{own}]", element.kind),
                    list => format!("{list}[{i}]"),
                };
                put(name, constant);
            }
        }
    }
    all
}

/// The names of the parameters, their ranges, and what each one sets.
pub(crate) fn texts(parameters: &[Parameter], float: Float) -> [(&'static str, String); 3] {
    let names: Vec<String> = parameters
        .iter()
        .enumerate()
        .map(|(i, Parameter { name, key, values: [low, file, high], .. })| {
            let about = format!("{key}: from {low:?} to {high:?}, the file's {file:?}");
            format!("    /* {about} */\n    HAPT_{name} = {i}")
        })
        .collect();
    let ranges: Vec<String> = parameters
        .iter()
        .map(|parameter| format!("    {{{}}}", parameter.values.map(|x| number(x, float)).join(", ")))
        .collect();
    let cases: String = parameters
        .iter()
        .map(|Parameter { name, sets, .. }| {
            let sets: String = sets.iter().map(|(place, to)| format!("        world->{place} = {to};\n")).collect();
            format!("    case HAPT_{name}:\n{sets}        break;\n")
        })
        .collect();
    [("parameters", names.join(",\n")), ("ranges", ranges.join(",\n")), ("set_cases", cases.trim_end().to_owned())]
}
