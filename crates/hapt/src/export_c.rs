//! `hapt export c`: a world as one C file, for the boards of others.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_analysis::Check;
use hapt_core::{Coupling, End, SafetyProfile};
use hapt_export_c::{About, Error, Exported, Float, Prefix, Tune, export, library};
use hapt_model::{EstimatorKind, Motion, World};

use crate::args::CArgs;
use crate::failure::Failure;
use crate::messages::say;
use crate::output::{self, Draft};
use crate::world::{Loaded, files, load};

pub fn run(args: &CArgs) -> Result<ExitCode, Failure> {
    output::format("-o", &args.out, &["c"])?;
    let header = args.header.clone().unwrap_or_else(|| args.out.with_extension("h"));
    output::format("--header", &header, &["h", "hpp"])?;
    let include = included(&header)?;
    let mut loaded = load(&args.world)?;
    let inputs = files(&args.world.path, &loaded.world);
    output::apart(&[("-o", &args.out), ("--header", &header)], &inputs)?;
    let stem = args.out.file_stem().unwrap_or_default().to_string_lossy();
    let prefix = Prefix::new(&stem).map_err(|error| Failure::input(format!("-o {}: {error}", args.out.display())))?;
    ours("-o", &args.out, Some(&prefix))?;
    ours("--header", &header, Some(&prefix))?;

    if loaded.world.device.limit.is_none() {
        return Err(Failure::input(
            "device.limit: a motor needs the largest torque that it may be commanded, such as \"800 N mm\"",
        ));
    }
    let takes_difference = loaded.world.sampling.estimator == EstimatorKind::Exact && !args.velocity;
    if takes_difference {
        let mut sets = args.world.sets.clone();
        sets.push("loop.estimator=difference".into());
        loaded.world = World::read(&loaded.source, &sets)?;
    }
    let check = hapt_analysis::check(&loaded.world)?;
    if !check.certified.holds() && !args.uncertified {
        let verdict = check.verdict_sentence();
        return Err(Failure::input(format!("{verdict}; hapt check says more, --uncertified writes it anyway")));
    }
    let float = if args.float == "f64" { Float::F64 } else { Float::F32 };
    let profile = if check.certified.holds() { SafetyProfile::Certified } else { SafetyProfile::Uncertified };
    let (world, limits) = (&loaded.world, loaded.world.board_limits(profile));
    let mut about = about(&loaded, &check, hash(world, profile)?);
    about.tunes = tuned(world, &about, args, float)?;
    if takes_difference {
        say(format_args!(
            "note: an encoder gives no true velocity: estimator difference in place of exact; --velocity for a device that measures it"
        ));
    }
    let exported = export(&world.spec(), &limits, &about, &prefix, &include, float).map_err(Failure::input)?;
    let mut drafts = vec![
        output::draft(&header, exported.header.as_bytes())?,
        output::draft(&args.out, exported.source.as_bytes())?,
    ];
    if let Some(folder) = &args.arduino {
        drafts.extend(arduino(folder, world, &about, &prefix, float)?);
    }
    for draft in drafts {
        finish(draft)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn finish(draft: Draft) -> Result<(), Failure> {
    let path = draft.finish().map_err(|error| Failure::write("the file", error))?;
    say(format_args!("wrote {}", path.display()));
    Ok(())
}

/// The name by which the C file includes its header.
fn included(header: &Path) -> Result<String, Failure> {
    let name = header.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain =
        !name.is_empty() && name.chars().all(|c| c.is_ascii_graphic() && !matches!(c, '"' | '\\' | '<' | '>' | '?'));
    if plain {
        Ok(name)
    } else {
        Err(Failure::input(format!("--header {}: C cannot include a file of this name", header.display())))
    }
}

/// Refuses to replace a file that this command did not write; one of C or its header also where it has other names than those of `prefix`.
fn ours(flag: &str, path: &Path, prefix: Option<&Prefix>) -> Result<(), Failure> {
    // Only regular files are read: a pipe would wait for its writer.
    if !path.is_file() {
        return match path.exists() {
            true => Err(Failure::input(format!("{flag} {}: this is no file; expected a new name", path.display()))),
            false => Ok(()),
        };
    }
    let there = std::fs::read(path).map_err(|error| Failure::input(format!("{flag} {}: {error}", path.display())))?;
    if there.is_empty() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&there);
    let whose = match prefix.map(|prefix| format!(" {}_init()", prefix.as_str())) {
        _ if !text.contains(hapt_export_c::MARK) => "and hapt did not write it".to_string(),
        Some(init) if !text.contains(&init) => format!("without{init}"),
        _ => return Ok(()),
    };
    Err(Failure::input(format!("{flag} {}: this file is there, {whose}; expected another name", path.display())))
}

/// The hash that `hapt flash` prints of the same world and limits.
fn hash(world: &World, profile: SafetyProfile) -> Result<u32, Failure> {
    let mut room = vec![0; 1 << 16];
    let bytes = hapt_wire::pack(&world.spec(), &world.board_limits(profile), &mut room).map_err(Failure::input)?;
    Ok(hapt_wire::hash(bytes))
}

fn about(loaded: &Loaded, check: &Check, hash: u32) -> About {
    let world = &loaded.world;
    let text = check.text(loaded.title(), &world.sampling, None, true);
    About {
        title: loaded.title().to_owned(),
        is_linear: world.motion == Motion::Linear,
        bodies: world.names.clone(),
        couplings: world.couplings.iter().map(|coupling| words(world, coupling)).collect(),
        is_certified: check.certified.holds(),
        certificate: text.trim().lines().map(str::to_owned).collect(),
        hash,
        tunes: Vec::new(),
    }
}

/// The largest ratio of a tuned number to the file's, and of the file's to it.
const TUNE_RATIO: f64 = 100.0;

/// The requested numbers, each with its certified range.
fn tuned(world: &World, about: &About, args: &CArgs, float: Float) -> Result<Vec<Tune>, Failure> {
    if !args.tunes.is_empty() && !about.is_certified {
        return Err(Failure::input(
            "--tune: the world is not certified, so no range of its numbers is; run hapt check for remedies",
        ));
    }
    let all = numbers(world);
    let mut tunes = Vec::new();
    for named in &args.tunes {
        let is_all = named == "all";
        let keys: Vec<&(Tune, f64)> = all.iter().filter(|(tune, _)| is_all || tune.key == *named).collect();
        let is_of_a_body =
            |name: &String| named.strip_prefix("bodies.").is_some_and(|rest| rest.starts_with(&format!("{name}.")));
        if world.names.iter().any(is_of_a_body) {
            return Err(Failure::input(format!(
                "--tune {named}: a body's numbers go through the matrices of the method, which only hapt computes: write another file for \
                 another value"
            )));
        }
        if keys.is_empty() {
            return Err(Failure::input(format!(
                "--tune {named}: expected a number of a coupling that the file gives, such as couplings.0.stiffness, or all"
            )));
        }
        for (tune, value) in keys {
            match with_range(world, about, tune, *value, float) {
                Ok(tune) if tunes.contains(&tune) => {}
                Ok(tune) => tunes.push(tune),
                Err(_) if is_all => {}
                Err(failure) => return Err(failure),
            }
        }
    }
    if tunes.is_empty() && !args.tunes.is_empty() {
        return Err(Failure::input(
            "--tune all: this world has no number that C can change: those of springs and dampers at bodies go through matrices that only hapt computes",
        ));
    }
    Ok(tunes)
}

/// Every number of every coupling, as if any value was certified, and its value in the file.
fn numbers(world: &World) -> Vec<(Tune, f64)> {
    let mut all = Vec::new();
    for (i, coupling) in world.couplings.iter().enumerate() {
        let mut law = coupling.law;
        let own: Vec<(&str, f64)> = law.quantities().map(|quantity| (quantity.name, *quantity.value)).collect();
        for (quantity, value) in own.into_iter().chain(coupling.limit.map(|limit| ("limit", limit))) {
            let (key, quantity) = (format!("couplings.{i}.{quantity}"), quantity.to_owned());
            all.push((Tune { key, coupling: i, quantity, range: [value / TUNE_RATIO, value * TUNE_RATIO] }, value));
        }
    }
    all
}

/// The number with its certified range, where the C can change it, which is tested first, as it is quick.
fn with_range(world: &World, about: &About, tune: &Tune, value: f64, float: Float) -> Result<Tune, Failure> {
    let limits = world.board_limits(SafetyProfile::Certified);
    let prefix = Prefix::new("trial").map_err(Failure::input)?;
    let can_be = |tune: &Tune| {
        let about = About { tunes: vec![tune.clone()], ..about.clone() };
        export(&world.spec(), &limits, &about, &prefix, "trial.h", float).map(|_| ())
    };
    let refuse = |why| Failure::input(Error::Tune { key: tune.key.clone(), why });
    can_be(tune).map_err(Failure::input)?;
    let set = |world: &mut World, value: f64| {
        let Some(coupling) = world.couplings.get_mut(tune.coupling) else { return };
        match coupling.law.quantities().find(|quantity| quantity.name == tune.quantity) {
            Some(quantity) => *quantity.value = value,
            None => coupling.limit = Some(value),
        }
    };
    let range = hapt_analysis::certified_interval(world, value, TUNE_RATIO, set)?
        .ok_or_else(|| refuse("no range around the file's value is certified"))?;
    let tune = Tune { range, ..tune.clone() };
    can_be(&tune).map_err(Failure::input)?;
    Ok(tune)
}

/// A coupling in the words of its file, in SI.
fn words(world: &World, coupling: &Coupling) -> String {
    let end = |end: End| match end {
        End::Puck => "puck",
        End::Ground => "ground",
        End::Body(i) => world.names.get(i).map_or("?", String::as_str),
    };
    let mut law = coupling.law;
    let numbers: Vec<String> =
        law.quantities().map(|quantity| format!("{} {}", quantity.name, quantity.value)).collect();
    let limit = coupling.limit.map(|limit| format!("limit {limit}"));
    let numbers: Vec<String> = numbers.into_iter().chain(limit).collect();
    let kind = coupling.law.kind().name();
    format!("{kind} between {} and {}: {}", end(coupling.first), end(coupling.second), numbers.join(", "))
}

/// The drafts of an Arduino library.
fn arduino(folder: &Path, world: &World, about: &About, prefix: &Prefix, float: Float) -> Result<Vec<Draft>, Failure> {
    let profile = if about.is_certified { SafetyProfile::Certified } else { SafetyProfile::Uncertified };
    let name = format!("{}.h", prefix.as_str());
    let Exported { source, header } =
        export(&world.spec(), &world.board_limits(profile), about, prefix, &name, float).map_err(Failure::input)?;
    let files = library(about, prefix, &world.spec());
    let code = [(format!("src/{}.c", prefix.as_str()), source), (format!("src/{}.h", prefix.as_str()), header)];
    let files: Vec<(PathBuf, String)> =
        code.into_iter().chain(files).map(|(place, text)| (folder.join(place), text)).collect();
    for (path, _) in &files {
        ours("--arduino", path, None)?;
    }
    let mut drafts = Vec::new();
    for (path, text) in files {
        if let Some(folder) = path.parent() {
            output::folder("--arduino", folder)?;
        }
        drafts.push(output::draft(&path, text.as_bytes())?);
    }
    Ok(drafts)
}
