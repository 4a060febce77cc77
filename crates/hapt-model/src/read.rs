//! From the tree to the [`World`]: the checks that the table of keys cannot express.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_core::spec::CouplingKind;
use hapt_core::{Body, Coupling, End, Law, Method, Output, Side};
use hapt_plant::spec::{Drive, Hand, Shape, Switching};

use crate::device::device;
use crate::document::{Document, Place};
use crate::error::{Error, ErrorKind};
use crate::fields::{Context, Fields, entries, items, kind, one_of};
use crate::keys;
use crate::kinds::{Compensated, EstimatorKind, HandKind, Motion, ShapeKind, TimingKind};
use crate::path::{self, Carries};
use crate::safety::Safety;
use crate::sampling::Sampling;
use crate::source::Source;
use crate::support;
use crate::timing::Timing;
use crate::waveform;
use crate::words;
use crate::world::{Compensation, Device, Scenario, World};

/// Samples in a scenario.
const MOST_SAMPLES: f64 = 1e10;

impl World {
    /// Reads and checks a world. Each of `sets` is an override `KEY=VALUE` of a key by its dotted path; the last of a key
    /// wins. A path file is read too.
    ///
    /// # Errors
    /// The first mistake found: its key, what would be right, and where it stands.
    pub fn read(source: &Source, sets: &[String]) -> Result<World, Error> {
        let document = Document::new(source, sets)?;
        if let Some(place) = document.place("stations") {
            let message = "this file is a network, which joins the worlds of several stations; expected a world";
            return Err(document.error(ErrorKind::Combination, "stations", message, &place));
        }
        let root =
            Context { document: &document, motion: Motion::Rotary, pattern: "", path: String::new(), hand: None };
        let top = Fields::new(root, Some(&document.root))?;
        let motion = one_of(&top, "motion", &Motion::ALL, Motion::name)?.ok_or_else(|| top.missing("motion"))?;
        let table = |name: &'static str| Context { motion, ..top.inner(name, name) };

        let sampling = sampling(&Fields::new(table("loop"), top.node("loop"))?)?;
        let device = device(&Fields::new(table("device"), top.node("device"))?, sampling.period)?;
        let safety = Safety::read(&Fields::new(table("safety"), top.node("safety"))?, device.limit)?;

        let (mut names, mut bodies) = (Vec::new(), Vec::new());
        for entry in entries(&top, "bodies") {
            let context = Context { path: format!("bodies.{}", entry.key), pattern: "bodies.*", ..table("bodies") };
            let fields = Fields::new(context, Some(&entry.node))?;
            if entry.key == keys::HANDLE && device.handle.is_some() {
                let message = "the columns of this name are those of [device.handle]; the body needs another name";
                return Err(top.error_at(ErrorKind::Combination, "bodies.handle", message, &entry.place));
            }
            names.push(entry.key.clone());
            bodies.push(Body {
                inertia: fields.number("inertia")?,
                position: fields.number("position")?,
                velocity: fields.number("velocity")?,
            });
        }

        let mut paths = path::Reader::new(source, motion);
        let (mut rows, mut couplings) = (Vec::new(), Vec::new());
        for (index, node) in items(&top, "couplings").iter().enumerate() {
            let context = Context { path: format!("couplings.{index}"), pattern: "couplings.*", ..table("couplings") };
            let fields = Fields::new(context, Some(node))?;
            couplings.push(coupling(&fields, &names, &paths)?);
            rows.push(fields);
        }
        for (fields, coupling) in rows.iter().zip(&couplings) {
            check_coupling(fields, coupling, &couplings, &names, &sampling)?;
        }
        let compensations = compensations(&top, motion, (&sampling, &device), &mut couplings)?;
        if sampling.bodies_every > 1 && bodies.is_empty() {
            let message = format!("{} samples a step, and this world has no bodies; expected 1", sampling.bodies_every);
            let fields = Fields::new(table("loop"), top.node("loop"))?;
            return Err(fields.error(ErrorKind::Combination, "bodies_every", message));
        }
        if sampling.recentre.is_some() {
            let fields = Fields::new(table("loop"), top.node("loop"))?;
            let wrong = |message: &str| Err(fields.error(ErrorKind::Combination, "recentre", message));
            if !compensations.is_empty() {
                return wrong(
                    "a [[compensation]] counts from the device's own position, and the origin would slip away from it; expected one of both",
                );
            }
            if let Some(coupling) =
                couplings.iter().find(|c| c.law.is_endless() && [c.first, c.second].contains(&End::Puck))
            {
                let noun = coupling.law.noun();
                return wrong(&format!(
                    "the origin slips to where the torque of springs, walls and detents is 0, and {noun} at the puck would carry it along; expected \
                     one of both"
                ));
            }
            if device.least_friction() == 0.0 {
                return wrong(match device.changing_friction() > 0.0 {
                    true => {
                        "the origin slips under torques within the device's friction, and at some positions it has none; expected a smaller \
                         device.friction_by_position.share"
                    }
                    false => {
                        "the origin slips under torques within the device's friction, and it has none; expected device.friction"
                    }
                });
            }
        }

        let mut scenarios = Vec::new();
        for entry in entries(&top, "scenarios") {
            let context =
                Context { path: format!("scenarios.{}", entry.key), pattern: "scenarios.*", ..table("scenarios") };
            let fields = Fields::new(context, Some(&entry.node))?;
            scenarios.push(scenario(entry.key.clone(), &fields, (&sampling, &device), &mut paths)?);
        }
        Ok(World {
            title: top.text("title"),
            motion,
            sampling,
            device,
            safety,
            names,
            bodies,
            couplings,
            compensations,
            scenarios,
        })
    }

    /// The scenario of this name.
    ///
    /// # Errors
    /// There is none; the message names the nearest, or all of them.
    pub fn scenario(&self, name: &str) -> Result<&Scenario, Error> {
        self.scenarios.iter().find(|scenario| scenario.name == name).ok_or_else(|| {
            let names = || self.scenarios.iter().map(|scenario| scenario.name.as_str());
            let hint = match words::did_you_mean(name, names()) {
                _ if self.scenarios.is_empty() => "; it has none at all".to_string(),
                hint if hint.is_empty() => {
                    format!("; it has {}", words::all_of(names()))
                }
                hint => hint,
            };
            let message = format!("the world has no scenario {}{hint}", words::quoted(name));
            Error { kind: ErrorKind::Name, key: String::new(), message, location: None }
        })
    }
}

fn sampling(fields: &Fields<'_>) -> Result<Sampling, Error> {
    let method = one_of(fields, "method", &Method::ALL, Method::name)?.ok_or_else(|| fields.missing("method"))?;
    let estimator = one_of(fields, "estimator", &EstimatorKind::ALL, EstimatorKind::name)?;
    let estimator = estimator.ok_or_else(|| fields.missing("estimator"))?;
    let usual = if method.takes_new_sample_first() { Output::Start } else { Output::End };
    let output = one_of(fields, "output", &Output::ALL, Output::name)?.unwrap_or(usual);
    let sampling = Sampling {
        period: fields.number("period")?,
        method,
        output,
        advance: fields.whole("advance")?,
        bodies_every: fields.whole("bodies_every")?,
        interval_max: fields.optional_number("interval_max")?,
        delay: fields.delay("delay")?,
        delay_max: fields.optional_delay("delay_max")?,
        filter: fields.optional_number("filter")?,
        recentre: fields.optional_number("recentre")?,
        estimator,
        cutoff: fields.optional_number("cutoff")?,
        acceleration: fields.optional_number("acceleration")?,
        every: fields.whole("every")?,
        window: fields.whole("window")?,
    };

    let combination = |name, message: String| Err(fields.error(ErrorKind::Combination, name, message));
    if method.takes_new_sample_first() && output != Output::Start {
        let (given, method) = (output.name(), method.name());
        return combination(
            "output",
            format!("method {method:?} has its torque from x_k: the output is \"start\", not {given:?}"),
        );
    }
    if sampling.advance > 0 && output != Output::End {
        let given = output.name();
        return combination(
            "advance",
            format!("an advance goes with output \"end\" only, and the output is {given:?}"),
        );
    }
    let every = sampling.bodies_every;
    if every > 1 && method.takes_new_sample_first() {
        let method = method.name();
        return combination(
            "bodies_every",
            format!("{every} samples a step go with the methods that hold the puck over it, and {method:?} does not"),
        );
    }
    if every > 1 && sampling.advance > 0 {
        return combination("bodies_every", format!("{every} samples a step go without loop.advance; expected 1"));
    }
    if let Some((key, message)) = sampling.fault() {
        return combination(key, message);
    }
    if let Some((key, None)) = sampling.required() {
        return Err(fields.missing(key));
    }
    Ok(sampling)
}

fn coupling(fields: &Fields<'_>, names: &[String], files: &path::Reader<'_>) -> Result<Coupling, Error> {
    let [(first_name, first_place), (second_name, second_place)] = fields.ends("between")?;
    let first = end(fields, first_name, first_place, names)?;
    let second = end(fields, second_name, second_place, names)?;
    if first == second {
        let message = format!("both ends are {}; a coupling is between two different ones", words::quoted(first_name));
        return Err(fields.error(ErrorKind::Value, "between", message));
    }
    let law = law(fields, files)?;
    // The table of keys has a limit for the laws that take one, and for no others.
    Ok(Coupling { first, second, law, limit: fields.optional_number("limit")? })
}

/// The compensations of the device's torques. Their couplings are added to the others.
fn compensations(
    top: &Fields<'_>,
    motion: Motion,
    (sampling, device): (&Sampling, &Device),
    couplings: &mut Vec<Coupling>,
) -> Result<Vec<Compensation>, Error> {
    let mut list: Vec<Compensation> = Vec::new();
    for (index, node) in items(top, "compensation").iter().enumerate() {
        let (path, pattern) = (format!("compensation.{index}"), "compensation.*");
        let fields = Fields::new(Context { path, motion, ..top.inner("compensation", pattern) }, Some(node))?;
        let of = fields.name("of").and_then(Compensated::from_name).ok_or_else(|| fields.missing("of"))?;
        let share = fields.number("share")?;
        let wrong = |key, message| Err(fields.error(ErrorKind::Combination, key, message));
        let own = |owner: Compensated, key: &'static str| {
            let number = fields.optional_number(key)?;
            match (of == owner, number) {
                (true, None) => Err(fields.missing(key)),
                (false, Some(_)) => {
                    let message = format!("{} has no {key}: only {} has one", of.name(), owner.name());
                    Err(fields.error(ErrorKind::Combination, key, message))
                }
                (true, Some(_)) | (false, None) => Ok(number),
            }
        };
        let (velocity, cutoff) = (own(Compensated::Friction, "velocity")?, own(Compensated::Inertia, "cutoff")?);
        let compensation = Compensation { of, share, velocity, cutoff };
        let coupling = device.compensation(compensation);
        let is_there = of != Compensated::Friction || device.least_friction() > 0.0;
        let Some(coupling) = coupling.filter(|_| is_there) else {
            let wanted = match of {
                Compensated::Friction => {
                    "device.friction above 0, of both directions and at every position".to_string()
                }
                Compensated::Inertia => "device.inertia above 0".to_string(),
                Compensated::Gravity | Compensated::Cogging => format!("a table [device.{}]", of.name()),
            };
            return wrong("of", format!("the device has no {} to take back; expected {wanted}", of.name()));
        };
        if list.iter().any(|other| other.of == of) {
            return wrong("of", format!("{} is compensated already; expected one share of it", of.name()));
        }
        if coupling.law.is_at_puck() && sampling.advance > 0 {
            let message = "is taken back by the velocity, which goes with loop.advance = 0 only";
            return wrong("of", format!("{} {message}", of.name()));
        }
        if let Some(message) = too_fast(&coupling.law, sampling) {
            return wrong("cutoff", message);
        }
        if couplings.len() == keys::MOST_COUPLINGS {
            return wrong("of", format!("with it the world has more than {} couplings", keys::MOST_COUPLINGS));
        }
        couplings.push(coupling);
        list.push(compensation);
    }
    Ok(list)
}

/// Why a torque along the acceleration has a cutoff that is too high for the period.
fn too_fast(law: &Law, sampling: &Sampling) -> Option<String> {
    let Law::Acceleration { cutoff, .. } = *law else { return None };
    let rate = 1.0 / sampling.period;
    (cutoff * sampling.period > 1.0).then(|| {
        format!("{cutoff} Hz is above the sampling rate; expected {rate} Hz at most, since samples show nothing faster")
    })
}

/// The law of the coupling's kind that its other keys decide on, with its numbers.
fn law(fields: &Fields<'_>, files: &path::Reader<'_>) -> Result<Law, Error> {
    let kind = kind(fields, CouplingKind::from_name)?;
    let side = one_of(fields, "side", &[Side::Above, Side::Below], Side::name)?;
    let is_compensating = fields.name("damping") == Some(keys::COMPENSATING);
    let has_bristle = kind == CouplingKind::Friction && is_lugre(fields)?;
    let is_meant = |law: &Law| {
        law.kind() == kind
            && law.side() == side
            && law.is_compensating() == is_compensating
            && law.has_bristle() == has_bristle
    };
    let mut law = Law::ALL.into_iter().find(is_meant).ok_or_else(|| fields.missing("kind"))?;
    for quantity in law.quantities() {
        *quantity.value = fields.number(quantity.name)?;
    }
    if let Some(waveform) = law.waveform_mut() {
        *waveform = waveform::read(fields, files)?;
    }
    Ok(law)
}

/// Friction is Coulomb's by its `torque`, or LuGre's by its six keys.
fn is_lugre(fields: &Fields<'_>) -> Result<bool, Error> {
    let lugre: Vec<&str> = keys::rows("couplings.*")
        .filter(|row| row.kinds == ["friction"] && row.name() != "torque")
        .map(|row| row.name())
        .collect();
    let given = lugre.iter().find(|name| fields.has(name));
    match (fields.has("torque"), given) {
        (true, None) => Ok(false),
        (true, Some(name)) => {
            let message = format!("torque (Coulomb friction) and {name} (LuGre friction) do not go together");
            Err(fields.error(ErrorKind::Combination, name, message))
        }
        (false, Some(_)) => Ok(true),
        (false, None) => {
            let keys = lugre.join(", ");
            let message = format!("friction has either torque (Coulomb) or all of {keys} (LuGre)");
            Err(fields.error(ErrorKind::Name, "torque", message))
        }
    }
}

fn end(fields: &Fields<'_>, name: &str, place: &Place, names: &[String]) -> Result<End, Error> {
    match name {
        "puck" => return Ok(End::Puck),
        "ground" => return Ok(End::Ground),
        _ => {}
    }
    names.iter().position(|body| body == name).map(End::Body).ok_or_else(|| {
        let known = || ["puck", "ground"].into_iter().chain(names.iter().map(String::as_str));
        let hint = match words::did_you_mean(name, known()) {
            hint if hint.is_empty() => format!("; an end is {}", words::alternatives(known())),
            hint => hint,
        };
        let message = format!("{} is not a body of this world{hint}", words::quoted(name));
        fields.error_at(ErrorKind::Name, "between", message, place)
    })
}

/// Checks that depend on the other couplings, and on the loop.
fn check_coupling(
    fields: &Fields<'_>,
    coupling: &Coupling,
    all: &[Coupling],
    names: &[String],
    sampling: &Sampling,
) -> Result<(), Error> {
    if coupling.law.is_compensating() && !has_spring(coupling, all) {
        let name = |end| match end {
            End::Puck => "the puck",
            End::Ground => "ground",
            End::Body(index) => names.get(index).map_or("", String::as_str),
        };
        let (first, second) = (name(coupling.first), name(coupling.second));
        let message = match (coupling.first, coupling.second) {
            (End::Body(_), End::Ground) => format!("there is no spring at {first} to compensate"),
            (End::Ground, End::Body(_)) => format!("there is no spring at {second} to compensate"),
            (End::Puck, _) | (End::Ground, End::Puck | End::Ground) | (End::Body(_), End::Puck | End::Body(_)) => {
                format!("there is no spring between {first} and {second} to compensate")
            }
        };
        return Err(fields.error(ErrorKind::Combination, "damping", message));
    }
    let noun = coupling.law.noun();
    if coupling.law.is_at_puck() && coupling.is_at_body() {
        let message = format!("{noun} acts between \"puck\" and \"ground\" only");
        return Err(fields.error(ErrorKind::Unsupported, "between", message));
    }
    if coupling.law.is_at_puck() && sampling.advance > 0 {
        let message = format!("{noun} goes with loop.advance = 0 only, since it depends on how the hand will move");
        return Err(fields.error(ErrorKind::Unsupported, "kind", message));
    }
    if let Some(message) = too_fast(&coupling.law, sampling) {
        return Err(fields.error(ErrorKind::Combination, "cutoff", message));
    }
    if sampling.bodies_every > 1 && coupling.is_at_body() && coupling.law.has_bristle() {
        let message = "LuGre friction at a body goes with loop.bodies_every = 1 only; use coulomb";
        return Err(fields.error(ErrorKind::Unsupported, "kind", message));
    }
    match support::refusal(sampling.method, coupling) {
        Some(message) if coupling.is_at_body() => Err(fields.error(ErrorKind::Unsupported, "kind", message)),
        Some(_) | None => Ok(()),
    }
}

/// Whether any spring is there that a compensating damper takes its damping from.
fn has_spring(damper: &Coupling, all: &[Coupling]) -> bool {
    let ends = |coupling: &Coupling| [coupling.first, coupling.second];
    all.iter().filter(|other| other.law.spring().is_some()).any(|spring| match ends(damper) {
        [body @ End::Body(_), End::Ground] | [End::Ground, body @ End::Body(_)] => ends(spring).contains(&body),
        pair => pair.iter().all(|end| ends(spring).contains(end)),
    })
}

fn scenario(
    name: String,
    fields: &Fields<'_>,
    (sampling, device): (&Sampling, &Device),
    paths: &mut path::Reader<'_>,
) -> Result<Scenario, Error> {
    let duration = fields.number("duration")?;
    let period = sampling.period;
    let samples = (duration / period).round() + 1.0;
    if samples > MOST_SAMPLES {
        let message = format!(
            "{duration:?} s at a period of {period:?} s is {samples:e} samples; at most {MOST_SAMPLES:e} are allowed"
        );
        return Err(fields.error(ErrorKind::Combination, "duration", message));
    }
    let hand = Fields::new(fields.inner("hand", "scenarios.*.hand"), fields.node("hand"))?;
    let intended = || Fields::new(hand.inner("moves", "scenarios.*.hand.moves"), hand.node("moves"));
    let mut moves = |carries| shape(&intended()?, carries, paths);
    let drive = match kind(&hand, HandKind::from_name)? {
        HandKind::Torque => Drive::Torque(moves(Carries::Torque)?),
        HandKind::Grip => Drive::Grip {
            inertia: hand.optional_number("inertia")?.unwrap_or(0.0),
            damping: hand.number("damping")?,
            stiffness: hand.number("stiffness")?,
            moves: moves(Carries::Position)?,
            switching: switching(&hand, duration)?,
        },
        HandKind::Step | HandKind::Ramp | HandKind::Sine | HandKind::Path => {
            Drive::Position(shape(&hand, Carries::Position, paths)?)
        }
    };
    let held = Hand { drive, release: hand.optional_number("release")? };
    if let Some((key, message)) = device.hand_fault(&held, sampling) {
        return Err(match key.strip_prefix("moves.") {
            Some(key) => intended()?.error(ErrorKind::Combination, key, message),
            None => hand.error(ErrorKind::Combination, key, message),
        });
    }
    Ok(Scenario { name, duration, hand: held, timing: timing(fields, sampling, duration, paths)? })
}

fn timing(fields: &Fields<'_>, sampling: &Sampling, duration: f64, files: &path::Reader<'_>) -> Result<Timing, Error> {
    let Some(node) = fields.node("timing") else { return Ok(Timing::Even) };
    let table = Fields::new(fields.inner("timing", "scenarios.*.timing"), Some(node))?;
    let timing = Timing::read(&table, kind(&table, TimingKind::from_name)?, sampling, duration, files)?;
    let samples = duration / timing.shortest(sampling);
    if samples > MOST_SAMPLES {
        let message = format!(
            "{duration:?} s may take {samples:e} samples in the shortest intervals; at most {MOST_SAMPLES:e} are allowed"
        );
        return Err(table.error(ErrorKind::Combination, "kind", message));
    }
    Ok(timing)
}

/// The two keys of a grip that releases and grips again.
fn switching(hand: &Fields<'_>, duration: f64) -> Result<Option<Switching>, Error> {
    let without = |key, other| {
        let message = format!("stands without {other}: a hand that opens and takes hold again has both");
        Err(hand.error(ErrorKind::Combination, key, message))
    };
    match (hand.optional_number("hold")?, hand.optional_number("open")?) {
        (None, None) => Ok(None),
        (Some(_), None) => without("hold", "open"),
        (None, Some(_)) => without("open", "hold"),
        (Some(hold), Some(open)) => {
            let times = duration / (hold + open);
            if times > MOST_SAMPLES {
                let message = format!(
                    "a hand that holds for {hold:?} s and opens for {open:?} s takes hold {times:e} times in {duration:?} s; at \
                     most {MOST_SAMPLES:e} are allowed"
                );
                return Err(hand.error(ErrorKind::Combination, "hold", message));
            }
            Ok(Some(Switching { hold, open }))
        }
    }
}

fn shape(fields: &Fields<'_>, carries: Carries, paths: &mut path::Reader<'_>) -> Result<Shape, Error> {
    Ok(match kind(fields, ShapeKind::from_name)? {
        ShapeKind::Step => Shape::Step { to: fields.number("to")?, at: fields.number("at")? },
        ShapeKind::Ramp => {
            Shape::Ramp { to: fields.number("to")?, at: fields.number("at")?, over: fields.number("over")? }
        }
        ShapeKind::Sine => Shape::Sine {
            amplitude: fields.number("amplitude")?,
            frequency: fields.number("frequency")?,
            phase: fields.number("phase")?,
        },
        ShapeKind::Path => {
            let file = fields.text("file").ok_or_else(|| fields.missing("file"))?;
            let points = paths.read(&file, carries).map_err(|failure| match failure.location {
                // A mistake in the path file is shown there, one in its name here.
                Some(_) => Error { key: format!("{}.file", fields.table_path()), ..failure },
                None => fields.error(failure.kind, "file", failure.message),
            })?;
            Shape::Path { file, points }
        }
    })
}
