//! Reports of world files, made in the manner of the command line.

use std::path::{Path, PathBuf};

use hapt_analysis::check_system;
use hapt_model::{Source, System, parameters};
use hapt_report::{Drawing, Report, Run, index_drawings, index_page};

/// Every shipped world.
pub fn worlds() -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds")]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(found.len() >= 12, "worlds are missing: {found:?}");
    found
}

/// Difficult worlds for a page: (stem, file).
pub fn hard_worlds() -> Vec<(String, String)> {
    let device = "[loop]\nperiod = \"1 ms\"\nmethod = \"forward-euler\"\n[device]\ninertia = \"1e-3 kg m^2\"\nlimit = \"1 N m\"\n";
    let step = "[scenarios.step]\nduration = \"2 s\"\nhand = { kind = \"step\", to = \"45 deg\" }\n";
    let mut chain = format!("title = \"A chain of twenty bodies with long names\"\n{device}");
    let mut before = "puck".to_string();
    for i in 0..20 {
        let name = format!("a-body-with-a-long-name-{i}");
        chain += &format!("[bodies.{name}]\ninertia = \"1e-3 kg m^2\"\n");
        chain += &format!(
            "[[couplings]]\nkind = \"spring\"\nbetween = [\"{before}\", \"{name}\"]\nstiffness = \"1 N m/rad\"\n"
        );
        chain += &format!(
            "[[couplings]]\nkind = \"damper\"\nbetween = [\"{name}\", \"ground\"]\ndamping = \"1e-3 N m s/rad\"\n"
        );
        before = name;
    }
    chain += step;
    let title = "</title><script>alert(1)</script> & \\\"a title\\\" that goes on and on without end, averyveryveryveryveryverylongwordinit";
    let every = format!(
        "title = \"{title}\"\n{device}[bodies.a]\ninertia = \"1e-2 kg m^2\"\n[bodies.b]\ninertia = \"1e-2 kg m^2\"\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"a\"]\nstiffness = \"3 N m/rad\"\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"a\"]\ndamping = \"compensating\"\n\
         [[couplings]]\nkind = \"friction\"\nbetween = [\"a\", \"b\"]\ntorque = \"5 N mm\"\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"b\"]\nstiffness = \"3 N m/rad\"\n\
         [[couplings]]\nkind = \"detent\"\nbetween = [\"a\", \"ground\"]\ntorque = \"20 N mm\"\npitch = \"15 deg\"\n\
         [[couplings]]\nkind = \"constant\"\nbetween = [\"b\", \"ground\"]\ntorque = \"-20 N mm\"\n\
         [[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nat = \"30 deg\"\nstiffness = \"1 N m/rad\"\n\
         {step}[scenarios.swing]\nduration = \"1 s\"\nhand = {{ kind = \"sine\", amplitude = \"20 deg\", frequency = \"3 Hz\", release = \"0.5 s\" }}\n"
    );
    let away = format!(
        "{}[bodies.w]\ninertia = \"1e-3 kg m^2\"\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"w\"]\nstiffness = \"1 N m/rad\"\n{}",
        device.replace("1 ms", "1 s"),
        step.replace("2 s", "1000 s")
    );
    let bare = format!("{device}{step}");
    let idle = device.to_string();
    let list = [("chain", chain), ("every-coupling", every), ("away", away), ("bare", bare), ("no-scenario", idle)];
    list.map(|(name, text)| (name.to_string(), text)).into()
}

/// A page with its figures.
#[allow(dead_code)] // Not every test program uses both.
pub struct Made {
    pub stem: String,
    pub page: String,
    pub drawings: Vec<Drawing>,
}

/// The pages of these worlds, and the index of them all.
pub fn pages(sources: &[(String, Source)]) -> Vec<Made> {
    let read = |(stem, source): &(String, Source)| {
        let system = System::read(source, &[]).unwrap_or_else(|error| panic!("{stem}: {error}"));
        let list = vec![parameters(source, &[]).unwrap()];
        let check = check_system(&system, false).unwrap();
        (stem.clone(), system, list, check)
    };
    let ready: Vec<_> = sources.iter().map(read).collect();
    let reports: Vec<Report<'_>> = ready
        .iter()
        .map(|(stem, system, parameters, check)| {
            let runs = system.scenarios().into_iter().map(|name| {
                let mut simulation = hapt_sim::Run::new(system, name).unwrap();
                let mut run = Run::new(system, name, &simulation, check);
                while let Some(row) = simulation.next() {
                    match row {
                        Ok(row) => run.add(&row),
                        Err(error) => run.failure = Some(error.to_string()),
                    }
                }
                run
            });
            let title = system.title.clone().unwrap_or_else(|| stem.clone());
            Report {
                title,
                stem: stem.clone(),
                system,
                parameters,
                check,
                proposal: None,
                runs: runs.collect(),
                live: None,
                plots: None,
            }
        })
        .collect();
    let mut made: Vec<Made> = reports
        .iter()
        .map(|report| {
            let drawings = report.drawings();
            Made { stem: report.stem.clone(), page: report.page(&drawings, true), drawings }
        })
        .collect();
    let drawings = index_drawings(&reports);
    made.push(Made { stem: "index".into(), page: index_page(&reports, &drawings), drawings });
    made
}

/// The pages of every shipped world, the difficult ones and the index.
pub fn all_pages() -> Vec<Made> {
    let shipped = worlds().into_iter().map(|path| {
        let stem = path.file_stem().unwrap().to_str().unwrap().to_string();
        (stem, Source::open(path).unwrap())
    });
    let hard = hard_worlds().into_iter().map(|(stem, text)| (stem.clone(), Source::from_text(stem, text)));
    pages(&shipped.chain(hard).collect::<Vec<_>>())
}
