//! Analyses of a world, identification from a record, the design of a wheel, and the names of measures, couplings and hands.

use std::sync::Arc;

use hapt_analysis::design::Specification;
use hapt_analysis::equations::continuous::linearise;
use hapt_analysis::equations::estimator::{Filter, PositionFilter};
use hapt_analysis::error::at_one_rate;
use hapt_analysis::impedance::rendered::columns;
use hapt_analysis::{Continuous, Discrete, Impedance, Slopes};
use hapt_identify::{Claims, Known, Record};
use hapt_model::keys::{self, Takes};
use hapt_model::{CouplingKind, Device, Dimension, HandKind, Handle, Motion, Source, World, parse_positive};
use hapt_sweep::Measure;
use hapt_sweep::boundary::{Boundary, Claim, Edge, Point};
use nalgebra::DMatrix;
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde_json::{Value, json};

use crate::error::{internal, of_sweep, value};
use crate::interrupt::{Stop, in_parallel, unwanted};

/// Columns of equal lengths by name.
pub type Columns = Vec<(String, Vec<f64>)>;

/// The impedance at the puck; NaN where it is unbounded.
pub fn impedance(
    world: &World,
    slopes: &Slopes,
    low: Option<&str>,
    high: Option<&str>,
    points: usize,
    stop: &Stop,
) -> Result<Option<(Columns, Value)>, String> {
    let impedance = Impedance::new(world, slopes).map_err(|error| error.to_string())?;
    let frequency = |name: &str, text: Option<&str>| {
        let value = text.map(|text| parse_positive(text, Dimension::FREQUENCY)).transpose();
        value.map_err(|error| format!("{name}: {error}"))
    };
    let [low, high] = impedance.range([frequency("low", low)?, frequency("high", high)?], ["low", "high"])?;
    let mut table: Columns = columns(world.motion).into_iter().map(|name| (name, Vec::with_capacity(points))).collect();
    for row in impedance.rows(low, high, points) {
        if stop.is_set() {
            return Ok(None);
        }
        for ((_, column), number) in table.iter_mut().zip(row.numbers()) {
            column.push(number.unwrap_or(f64::NAN));
        }
    }
    let [inertia, damping] = impedance.device();
    let rest = json!({
        "period_s": world.sampling.period,
        "nyquist_hz": impedance.nyquist_hz(),
        "asked": impedance.nominal(),
        "resonances": impedance.resonances(),
        "device": { "inertia": inertia, "damping": damping },
        "notes": impedance.notes(),
    });
    Ok(Some((table, rest)))
}

/// The claims with these names, each once.
fn edges(names: &[String]) -> PyResult<Vec<Edge>> {
    let mut edges = Vec::new();
    for name in names {
        let edge = Edge::from_name(name).ok_or_else(|| {
            let all = Edge::ALL.map(Edge::name).join(", ");
            PyValueError::new_err(format!("there is no claim {name:?}; there are {all}"))
        })?;
        if !edges.contains(&edge) {
            edges.push(edge);
        }
    }
    Ok(edges)
}

/// The result of [`boundary`]: `(claim, x, y, hz)` of each piece; `(claim, whether it fails everywhere, the points where its edge is
/// lost, the reason for a missing verdict)` of each claim.
pub type Edges<'py> = (Vec<Bound<'py, PyTuple>>, Vec<(&'static str, Option<bool>, Vec<(f64, f64)>, Option<String>)>);

/// The boundaries of claims about a world or network in the plane of two axes; without `claims`, of all that apply to it.
pub fn boundary<'py>(
    py: Python<'py>,
    source: Source,
    sets: Vec<String>,
    axes: Vec<String>,
    claims: &[String],
) -> PyResult<Edges<'py>> {
    let edges = edges(claims)?;
    let work = move |stop: &Stop| Boundary::until(&source, &sets, &axes, &edges, &|| stop.is_set());
    let found = in_parallel(py, 0, work)?.map_err(|error| of_sweep(py, error, "boundary"))?;
    let mut pieces = Vec::new();
    for claim in &found.claims {
        for piece in &claim.pieces {
            let column =
                |of: &dyn Fn(&Point) -> f64| piece.points.iter().map(of).collect::<Vec<f64>>().into_pyarray(py);
            let (x, y) = (column(&|point| point.values[0]), column(&|point| point.values[1]));
            let hz = column(&|point| point.hz.unwrap_or(f64::NAN));
            pieces.push((claim.edge.name(), x, y, hz).into_pyobject(py)?);
        }
    }
    let of = |claim: Claim| {
        let lost = claim.lost.iter().map(|&[x, y]| (x, y)).collect();
        (claim.edge.name(), claim.everywhere, lost, claim.undecided)
    };
    Ok((pieces, found.claims.into_iter().map(of).collect()))
}

/// The design of the notes' wheel: `(JSON, world file, what the numbers do not keep)`. Quantities are texts with a unit, or numbers in SI.
#[pyfunction]
pub fn design(
    travel: &str,
    torque: &str,
    frequency: &str,
    period: &str,
) -> PyResult<(String, String, Option<&'static str>)> {
    let wheel = Specification { travel, torque, frequency, period }.wheel("").map_err(value)?;
    Ok((serde_json::to_string(&wheel.design).map_err(internal)?, wheel.file, wheel.note))
}

/// The device identified from a record, as `(JSON, warnings)`.
#[pyfunction]
pub fn identify(
    py: Python<'_>,
    times: PyReadonlyArray1<'_, f64>,
    positions: PyReadonlyArray1<'_, f64>,
    torques: PyReadonlyArray1<'_, f64>,
    inertia: Option<f64>,
    linear: bool,
) -> PyResult<(String, Vec<String>)> {
    let [times, positions, torques] = [&times, &positions, &torques].map(|array| array.as_array().to_vec());
    let work = move |stop: &Stop| {
        let record = Record::new(times, positions, torques)?;
        let known = Known { inertia, is_linear: linear, ..Known::default() };
        let is_set = || stop.is_set();
        let by_torque = hapt_identify::fit_torque_until(&record, &known, &is_set);
        let found = match hapt_identify::identify_until(&record, &known, by_torque.as_ref(), &is_set) {
            None => return Ok(None),
            Some(Ok(found)) => (found.json(by_torque.as_ref()), found.warnings()),
            // The model does not explain the motion: the result is the fit of the torque's equation, as on the command line.
            Some(Err(error)) => {
                let richer = matches!(error, hapt_identify::Error::Residual(_) | hapt_identify::Error::Unexplained);
                let fit = by_torque.filter(|_| richer).ok_or_else(|| error.clone())?;
                (fit.json(linear, false), vec![error.to_string()])
            }
        };
        Ok::<_, hapt_identify::Error>((!is_set()).then_some(found))
    };
    let (json, warnings) = in_parallel(py, 0, work)?.map_err(value)?.ok_or_else(unwanted)?;
    let json = Value::Object(json);
    Ok((json.to_string(), warnings.into_iter().map(|warning| warning.to_string()).collect()))
}

/// The comparison of a record with a world's device, as JSON.
pub fn against(
    py: Python<'_>,
    world: Arc<World>,
    times: &PyReadonlyArray1<'_, f64>,
    positions: &PyReadonlyArray1<'_, f64>,
    torques: &PyReadonlyArray1<'_, f64>,
) -> PyResult<String> {
    let [times, positions, torques] = [times, positions, torques].map(|array| array.as_array().to_vec());
    let work = move |stop: &Stop| {
        let record = Record::new(times, positions, torques).map_err(|error| error.to_string())?;
        let claims = Claims::of(&world);
        if let Some(own) = claims.other_period(&record) {
            return Err(format!(
                "times are {own} s apart, but loop.period is {} s: the record must be one of this world's loop",
                claims.period
            ));
        }
        let is_linear = world.motion == Motion::Linear;
        let found = hapt_identify::against_until(&record, &claims, is_linear, &|| stop.is_set());
        found.transpose().map_err(|error| error.to_string())
    };
    Ok(in_parallel(py, 0, work)?.map_err(value)?.ok_or_else(unwanted)?.json().to_string())
}

/// `(name, unit, meaning)` of every measure of a sweep; the unit is that of a rotary world.
#[pyfunction]
pub fn measures() -> Vec<(&'static str, &'static str, &'static str)> {
    Measure::ALL.map(|measure| (measure.name(), measure.unit(Motion::Rotary), measure.meaning())).to_vec()
}

/// The kinds of couplings with their keys.
#[pyfunction]
pub fn coupling_keys() -> Vec<(&'static str, Vec<&'static str>)> {
    kinds("couplings.*", CouplingKind::NAMES)
}

/// The kinds of hands with their keys.
#[pyfunction]
pub fn hand_keys() -> Vec<(&'static str, Vec<&'static str>)> {
    kinds("scenarios.*.hand", HandKind::NAMES)
}

fn kinds(table: &str, names: &[&'static str]) -> Vec<(&'static str, Vec<&'static str>)> {
    let of = |kind: &'static str| {
        let rows = keys::rows(table).filter(|row| row.kinds.is_empty() || row.kinds.contains(&kind));
        let mut found: Vec<&'static str> =
            rows.filter(|row| !matches!(row.takes, Takes::Named { .. })).map(|row| row.name()).collect();
        found.dedup();
        (kind, found)
    };
    names.iter().map(|kind| of(kind)).collect()
}

/// The matrices of the state spaces, by rows, as JSON: `world`, from (z_k, v_k) to the torque on the puck, discrete; `device`, from the
/// torque to (z, ż), continuous; the pole of the position's filter, null without one; the velocity estimators as filters, v_k = pole
/// v_{k-1} + Σ taps[i] z_{k-i}, no taps for the true velocity; `period` and `delay` in s.
///
/// ```text
/// s_{k+1} = (1 + d) x_k + previous u_k,    x_k = s_k + current u_k      the methods that take the new sample first
/// x_{k+1} = (1 + d) x_k + current u_k                                  the others
/// ```
///
/// The last states are i_{k-1} where integral terms act on the puck, i_k = i_{k-1} + T z_k, and s_{k-1} of every torque along the acceleration,
/// s_k = s_{k-1} + T (v_k - s_{k-1})/(τ + T). The constant part (rest positions, constants) is
/// left out. Nonlinear couplings have their steepest slope.
pub fn state_spaces(world: &World) -> Result<Value, hapt_analysis::Error> {
    let sampling = &world.sampling;
    at_one_rate(sampling, "a state space")?;
    let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Steep)?;
    let step = Discrete::new(&continuous, sampling.method, sampling.output, sampling.advance, sampling.period)?;
    let whole = DMatrix::identity(step.d.nrows(), step.d.ncols()) + &step.d;
    let state = DMatrix::from_row_slice(1, whole.ncols(), step.torque.state.as_slice());
    let puck = DMatrix::from_row_slice(1, 2, &step.torque.puck);
    let (input, direct) = match sampling.method.takes_new_sample_first() {
        true => (&step.previous + &whole * &step.current, puck + &state * &step.current),
        false => (step.current.clone(), puck),
    };
    let terms = linearise(&world.bodies, &world.couplings, &Slopes::Steep)?;
    let (integral, period): (f64, f64) = (terms.iter().map(|c| c.integral).sum(), sampling.period);
    let mut system = (whole, input, state, direct);
    if integral > 0.0 {
        system = with_state(system, [1.0, period, 0.0], [-integral, -integral * period, 0.0]);
    }
    for acceleration in terms.iter().filter_map(|term| term.acceleration) {
        let (part, gain) = (acceleration.part(period), acceleration.gain(period));
        system = with_state(system, [1.0 - part, 0.0, part], [-gain, 0.0, gain]);
    }
    let (whole, input, state, direct) = system;
    let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> { m.row_iter().map(|row| row.iter().copied().collect()).collect() };
    let (a, b) = device(&world.device);
    let filters = Filter::of(sampling, sampling.period);
    Ok(json!({
        "world": { "a": rows(&whole), "b": rows(&input), "c": rows(&state), "d": rows(&direct) },
        "device": { "a": rows(&a), "b": rows(&b), "c": rows(&DMatrix::identity(2, a.nrows())), "d": [[0.0, 0.0], [0.0, 0.0]] },
        "filter": PositionFilter::of(sampling, sampling.period).map(PositionFilter::pole),
        "estimators": filters.iter().map(|f| json!({ "pole": f.pole, "taps": f.taps, "kalman": f.kalman })).collect::<Vec<_>>(),
        "period": sampling.period,
        "delay": sampling.delay_s(),
    }))
}

/// A state space from (z_k, v_k) to a torque, by its matrices.
type System = (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>, DMatrix<f64>);

/// The same with one more state, the last: its next value and its torque, each by itself before the sample, by z_k and by v_k.
fn with_state((a, b, c, mut d): System, next: [f64; 3], torque: [f64; 3]) -> System {
    let order = a.nrows();
    let (mut a, mut b) = (a.resize(order + 1, order + 1, 0.0), b.resize_vertically(order + 1, 0.0));
    let mut c = c.resize_horizontally(order + 1, 0.0);
    (a[(order, order)], b[(order, 0)], b[(order, 1)]) = next.into();
    c[(0, order)] = torque[0];
    d[(0, 0)] += torque[1];
    d[(0, 1)] += torque[2];
    (a, b, c, d)
}

/// The device without Coulomb friction as ẏ = A y + B u: puck, handle if there is one (position and velocity each), and the torque of a
/// motor with a lag; u is the motor's command and the hand's torque.
fn device(device: &Device) -> (DMatrix<f64>, DMatrix<f64>) {
    let (puck, order) = (device.inertia.recip(), 2 + if device.handle.is_some() { 2 } else { 0 });
    let motor = (device.lag > 0.0).then_some(order);
    let order = order + usize::from(motor.is_some());
    let (mut a, mut b) = (DMatrix::zeros(order, order), DMatrix::zeros(order, 2));
    (a[(0, 1)], a[(1, 1)]) = (1.0, -device.damping * puck);
    match device.handle {
        None => b[(1, 1)] = puck,
        Some(Handle { inertia, stiffness, damping }) => {
            a[(2, 3)] = 1.0;
            b[(3, 1)] = inertia.recip();
            for (row, gain) in [(1, puck), (3, -inertia.recip())] {
                for (column, torque) in [-stiffness, -damping, stiffness, damping].into_iter().enumerate() {
                    a[(row, column)] += gain * torque;
                }
            }
        }
    }
    match motor {
        None => b[(1, 0)] = puck,
        Some(motor) => {
            a[(1, motor)] = puck;
            (a[(motor, motor)], b[(motor, 0)]) = (-device.lag.recip(), device.lag.recip());
        }
    }
    (a, b)
}
