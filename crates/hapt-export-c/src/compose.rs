//! The file, composed of the parts that its world needs.

use hapt_core::{Estimator, Law, Limits, Output, Phase, Reason, Spec, WhenLate};

use crate::data::{Data, data};
use crate::names::{Prefix, comment};
use crate::numbers::{Collected, collected};
use crate::template::{self, Facts};
use crate::tune::{parameters, texts};
use crate::{About, Error, Exported, Float};

/// Relative: far more than the rounding to f32, and far less than the error beyond the range of f32.
const ROUNDING: f64 = 1e-4;

/// Every file that is written here has these words in its first lines.
pub const MARK: &str = "as C by hapt";

macro_rules! part {
    ($name:literal) => {
        include_str!(concat!("parts/", $name))
    };
}

/// The C of each law, in one file: its functions, and its own part of each function that has one for every law. Several laws share the
/// ramp.
const LAWS: [(&str, &str); 12] = [
    ("ramp", part!("law/ramp.c")),
    ("spring", part!("law/spring.c")),
    ("damper", part!("law/damper.c")),
    ("wall", part!("law/wall.c")),
    ("detent", part!("law/detent.c")),
    ("dead_band", part!("law/dead_band.c")),
    ("magnet", part!("law/magnet.c")),
    ("texture", part!("law/texture.c")),
    ("coulomb", part!("law/coulomb.c")),
    ("lugre", part!("law/lugre.c")),
    ("integral", part!("law/integral.c")),
    ("acceleration", part!("law/acceleration.c")),
];

/// Writes a world as C. `header` is the name by which the source includes its header.
///
/// # Errors
/// Where the core does not compile the world, or the numbers of the C cannot hold one of the world's.
pub fn export(
    spec: &Spec,
    limits: &Limits,
    about: &About,
    prefix: &Prefix,
    header: &str,
    float: Float,
) -> Result<Exported, Error> {
    let exact = collected::<f64>(spec, limits)?;
    let world = match float {
        Float::F64 => exact,
        Float::F32 => {
            let rounded = collected::<f32>(spec, limits)?;
            check(&exact, &rounded)?;
            rounded
        }
    };
    let mut facts = facts(spec, limits, about, &world, float);
    let code = facts.fill(&code(&facts));
    let Data { types, constant } = data(&world, &code, float);
    let parameters = parameters(spec, limits, &about.tunes, &code, float)?;
    let mut data =
        "/* ---- The compiled world: made of the world file, not to be changed by hand ---- */\n\n".to_owned();
    let mut code = code;
    if parameters.is_empty() {
        data += &types;
    } else {
        for (name, text) in texts(&parameters, float) {
            facts.text(name, text);
        }
        facts.text("world_types", types.trim_end());
        code += &facts.fill(part!("set.c"));
    }
    data += &constant;
    let (before, after) = code.split_once(WORLD).unwrap_or(("", &code));
    let head = head(spec, about, prefix.as_str(), float);
    let code = prefix.rename(&format!("{}{before}{data}{after}", facts.fill(part!("numbers.c"))));
    let source = format!("{head}#include \"{header}\"\n\n{code}");
    let declarations = facts.fill(&format!("{}{}", part!("header.h"), part!("supervisor/header.h")));
    let guard = format!("{}_H", prefix.as_str().to_uppercase());
    let header = format!(
        "{head}#ifndef {guard}\n#define {guard}\n\n{}\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
        prefix.rename(&declarations),
    );
    Ok(Exported { source, header })
}

/// Separates the code that needs no world from the code that takes one.
const WORLD: &str = "//world\n";

/// Every single number is unchanged, to the digits of f32. Those of matrices are sums of large and small, as everywhere.
fn check(exact: &Collected, rounded: &Collected) -> Result<(), Error> {
    let all = |world: &Collected| {
        let own: Vec<_> =
            world.numbers.iter().chain(world.elements.iter().flat_map(|element| &element.numbers)).cloned().collect();
        own
    };
    for (exact, rounded) in all(exact).iter().zip(&all(rounded)) {
        for (x, y) in exact.values.iter().zip(&rounded.values) {
            let is_near = (x - y).abs() <= ROUNDING * x.abs() || x == y;
            // "The largest number" stands for no bound.
            let is_bound = *x >= f64::from(f32::MAX);
            if exact.shape.is_empty() && !is_near && !is_bound {
                return Err(Error::Number { name: exact.name, given: *x });
            }
        }
    }
    Ok(())
}

/// The facts of the world that select the parts.
fn facts(spec: &Spec, limits: &Limits, about: &About, world: &Collected, float: Float) -> Facts {
    let mut facts = Facts::default();
    let n = spec.bodies.len();
    let yes = |name: &str| world.whole(name).is_some_and(|value| value != 0);
    let kinds: Vec<&str> = world.list("couplings").map(|coupling| coupling.kind).collect();
    let stored: Vec<&str> = world.list("parts").map(|part| part.kind).collect();
    let has_bodies = n > 0;
    let new_first = spec.method.takes_new_sample_first();
    let at_bodies = world.list("couplings").any(|coupling| {
        let is_body = |name: &str| coupling.wholes.iter().any(|(this, value)| *this == name && *value >= 0);
        is_body("first") || is_body("second")
    });
    let gradient = at_bodies && spec.method.finds_torques();
    let law = |name: &str| kinds.contains(&name);
    let (is_end, ahead) = (spec.output == Output::End, yes("advance"));
    let exact = spec.estimator == Estimator::Exact;
    let (windowed, over) = (world.whole("window").is_some(), world.whole("every").is_some());
    let low_pass = matches!(spec.estimator, Estimator::LowPass { .. });
    let kalman = matches!(spec.estimator, Estimator::Kalman { .. });
    let levant = matches!(spec.estimator, Estimator::Levant { .. });
    let tracked = kalman || levant;
    // The functions that the C of the world's laws calls.
    let own: Vec<&str> = LAWS.iter().filter(|(name, _)| law(name)).map(|(_, text)| *text).collect();
    let calls = |function: &str| own.iter().any(|text| text.contains(function));
    let (falling, nearest) = (gradient && calls("hapt_solve_falling("), gradient && calls("hapt_solve_nearest("));
    let (sin, exp) = (calls("hapt_sin("), calls("hapt_exp("));
    let bristles = law("lugre") || law("integral") || law("acceleration");
    let assist = spec.couplings.iter().any(|coupling| matches!(coupling.law, Law::Assist { .. }));
    let f64s = float == Float::F64;
    let all = yes("is_all");
    for (name, is_so) in [
        ("f32", !f64s),
        ("f64", f64s),
        ("bodies", has_bodies),
        ("nonlinear", !kinds.is_empty()),
        ("bristles", bristles),
        ("assist", assist),
        ("sources", assist || law("integral") || law("acceleration")),
        ("new_first", new_first),
        ("held_bodies", has_bodies && !new_first),
        ("new_first_bodies", has_bodies && new_first),
        ("skips", yes("skips")),
        ("end_bodies", has_bodies && is_end && !ahead),
        ("middle_bodies", has_bodies && spec.output == Output::Middle),
        ("ahead", ahead),
        ("array_loop", if ahead { has_bodies || bristles || gradient } else { has_bodies && is_end }),
        ("staged", yes("staged")),
        ("force", at_bodies),
        ("gradient", gradient),
        ("pushed", at_bodies && !gradient),
        ("exact", exact),
        ("difference", !exact && !low_pass && !windowed && !over && !tracked),
        ("low_pass", low_pass),
        ("foaw", windowed),
        ("over", over),
        ("kalman", kalman),
        ("levant", levant),
        ("tracked", tracked),
        ("ring", windowed || over),
        ("best", yes("best")),
        ("last", !exact || new_first || spec.filter.is_some()),
        ("filter", spec.filter.is_some()),
        ("filter_bodies", spec.filter.is_some() && has_bodies),
        ("count", spec.count.is_some()),
        ("levels", spec.levels.is_some()),
        ("floor", spec.count.is_some() || spec.levels.is_some() || sin),
        ("between", gradient || calls("hapt_between(")),
        ("curves", falling || nearest),
        ("falling", falling),
        ("nearest", nearest),
        ("pair", falling || nearest || law("texture")),
        ("ramp", falling),
        ("bits", sin || exp || levant),
        ("libm", sin || exp),
        ("sin", sin),
        ("exp", exp),
        ("sin64", sin && f64s),
        ("sin32", sin && !f64s),
        ("exp64", exp && f64s),
        ("exp32", exp && !f64s),
        ("sqrt64", levant && f64s),
        ("sqrt32", levant && !f64s),
        ("bits64", sin || ((exp || levant) && f64s)),
        ("doubles", sin || f64s),
        ("scalbn64", sin || (exp && f64s)),
        ("parts", !stored.is_empty() && !all),
        ("pairs", world.list("pairs").next().is_some() && !all),
        ("is_all", all),
        ("well", has_bodies || !all),
        ("energy_loop", has_bodies || (!all && (!stored.is_empty() || world.list("pairs").next().is_some()))),
        ("stores_spring", stored.contains(&"spring") || stored.contains(&"dead_band")),
        ("pulse", world.whole("pulse_samples").is_some()),
        ("recentre_counts", world.whole("recentre_idle").is_some() && spec.count.is_some()),
        ("recentre", world.whole("recentre_idle").is_some()),
        ("zero_where_armed", yes("zero_where_armed")),
        ("late_fault", limits.time.when_late == WhenLate::Fault),
        ("late_fade", limits.time.when_late == WhenLate::Fade),
        ("late_count", limits.time.when_late == WhenLate::Count),
        ("link_faults", yes("link_faults")),
        ("port_trips", yes("port_trips")),
        ("world_trips", yes("world_trips")),
        ("certified", about.is_certified),
        ("tuned", !about.tunes.is_empty()),
    ] {
        facts.set(name, is_so);
    }
    for kind in kinds {
        facts.set(kind, true);
    }
    for kind in &stored {
        facts.set(format!("parts_{kind}"), true);
    }
    for (name, value) in &world.wholes {
        facts.text(*name, value);
    }
    facts.text("n", n);
    facts.text("n_room", n.max(1));
    facts.text("couplings", world.list("couplings").count());
    facts.text("counts", world.whole("window").or(world.whole("every")).unwrap_or(0) + 1);
    facts.text("pairs", world.list("pairs").count());
    facts.text("parts", stored.len());
    facts.text("tuned", about.tunes.len());
    facts.text("method", spec.method.name());
    facts.text("output", spec.output.name());
    facts.text("period", format!("{} s", spec.period));
    facts.text("bodies", if has_bodies { comment(&about.bodies.join(", ")) } else { "none".to_owned() });
    units(&mut facts, about.is_linear);
    words(&mut facts);
    facts
}

/// The units of an angular or a linear world.
pub(crate) fn units(facts: &mut Facts, is_linear: bool) {
    let [position, velocity, torque] = if is_linear { ["m", "m/s", "N"] } else { ["rad", "rad/s", "N m"] };
    for (name, unit) in [("u.position", position), ("u.velocity", velocity), ("u.torque", torque)] {
        facts.text(name, unit);
    }
}

/// The code, before its names have their prefix.
fn code(facts: &Facts) -> String {
    let mut code = String::new();
    let mut put = |needs: &str, part: &str| {
        if needs.is_empty() || facts.has(needs) {
            code.push_str(&facts.with_laws(part, &LAWS));
        }
    };
    put("bits", part!("libm/bits.c"));
    put("scalbn64", part!("libm/scalbn64.c"));
    put("sin", part!("libm/floor64.c"));
    put("sin", part!("libm/rem_pio2_large.c"));
    put("sin64", part!("libm/sin64.c"));
    put("sin32", part!("libm/sin32.c"));
    put("exp64", part!("libm/exp64.c"));
    put("exp32", part!("libm/exp32.c"));
    put("exp64", part!("libm/expm1_64.c"));
    put("exp32", part!("libm/expm1_32.c"));
    put("sqrt64", part!("libm/sqrt64.c"));
    put("sqrt32", part!("libm/sqrt32.c"));
    put("", WORLD);
    put("pair", part!("pair.c"));
    for (name, law) in LAWS {
        put(name, template::functions(law));
    }
    put("nonlinear", part!("law/torque.c"));
    put("", part!("sense.c"));
    put("", part!("actuate.c"));
    put("force", part!("push.c"));
    put("gradient", part!("solve.c"));
    put("gradient", part!("gradient.c"));
    put("", part!("step.c"));
    put("", part!("supervisor/energy.c"));
    put("", part!("supervisor/ledger.c"));
    put("", part!("supervisor/motion.c"));
    put("pulse", part!("supervisor/pulse.c"));
    put("recentre", part!("supervisor/recentre.c"));
    put("", part!("supervisor/supervisor.c"));
    code
}

/// The head of the file, on itself and its world.
fn head(spec: &Spec, about: &About, prefix: &str, float: Float) -> String {
    let mut lines = Vec::new();
    if !about.is_certified {
        lines.push("NOT CERTIFIED: this world may gain energy and run away.".to_owned());
    }
    lines.push(format!("{}, written {MARK}. Made of a world file: change that, not this.", comment(&about.title)));
    lines.push(String::new());
    lines.push(format!("world {:08x}, hapt-core {:08x}", about.hash, hapt_core::SOURCE));
    let number = if float == Float::F32 { "float" } else { "double" };
    lines.push(format!(
        "method {}, output {}, period {} s, in {number}",
        spec.method.name(),
        spec.output.name(),
        spec.period
    ));
    for (i, body) in about.bodies.iter().enumerate() {
        lines.push(format!("body {i}: {}", comment(body)));
    }
    for (i, coupling) in about.couplings.iter().enumerate() {
        lines.push(format!("coupling {i}: {}", comment(coupling)));
    }
    lines.push(String::new());
    lines.extend(about.certificate.iter().map(|line| comment(line)));
    lines.push(String::new());
    lines.push(format!(
        "Call {prefix}_init() once and {prefix}_step() once a period. Every number and every line below is part of what"
    ));
    lines.push("the certificate is about; a change by hand ends it.".to_owned());
    let body: Vec<String> = lines.iter().map(|line| format!(" * {line}").trim_end().to_owned()).collect();
    let first = body.first().map_or("", |line| line.get(3..).unwrap_or(""));
    format!("/* {first}\n{}\n */\n", body.get(1..).unwrap_or(&[]).join("\n"))
}

/// The enumerations of phases and reasons, and their facts.
fn words(facts: &mut Facts) {
    let constant = |name: &str| name.to_uppercase().replace('-', "_");
    let phases: Vec<String> = Phase::ALL
        .iter()
        .enumerate()
        .map(|(i, phase)| format!("    HAPT_PHASE_{} = {i}", constant(phase.name())))
        .collect();
    facts.text("phases", phases.join(",\n"));
    let reasons: Vec<String> = Reason::ALL
        .iter()
        .map(|reason| {
            format!("    /* {} */\n    HAPT_REASON_{} = {}", reason.sentence(), constant(reason.name()), reason.code())
        })
        .collect();
    facts.text("reasons", reasons.join(",\n"));
    let cases: Vec<String> = Reason::ALL
        .iter()
        .map(|reason| {
            format!("    case HAPT_REASON_{}:\n        return \"{}\";", constant(reason.name()), reason.sentence())
        })
        .collect();
    facts.text("reason_cases", cases.join("\n"));
    let trusted: Vec<String> = Reason::ALL
        .iter()
        .filter(|reason| reason.trusts_the_encoder())
        .map(|reason| format!("reason == HAPT_REASON_{}", constant(reason.name())))
        .collect();
    facts.text("trusted", trusted.join(" || "));
}
