//! Properties of a page: it is small and self-contained, and has alternative texts.

use hapt_model::{Source, System, World};
use hapt_report::{Width, read_csv};
use hapt_sim::{CsvWriter, Simulation};

use crate::common::{all_pages, pages};

const NAMESPACE: &str = "http://www.w3.org/2000/svg";

#[test]
fn every_page_is_under_a_megabyte_and_self_contained() {
    for made in all_pages() {
        assert!(made.page.len() < 1_000_000, "{} has {} bytes", made.stem, made.page.len());
        for text in made.drawings.iter().map(|d| d.file.as_str()).chain([made.page.as_str()]) {
            let own = text.replace(NAMESPACE, "");
            for away in ["http:", "https:", "//", "url(", "@import", "<script", "<link", "<img", "src=", "onload"] {
                assert!(!own.contains(away), "{}: {away}", made.stem);
            }
        }
    }
}

#[test]
fn every_figure_has_an_alternative_text() {
    for made in all_pages() {
        let figures = made.page.matches("<svg xmlns").count();
        let words: Vec<&str> =
            made.page.split("role=\"img\" aria-label=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
        assert_eq!(words.len(), figures, "{}", made.stem);
        assert!(words.iter().all(|alt| alt.len() > 40 && alt.ends_with('.')), "{}: {words:?}", made.stem);
        for drawing in &made.drawings {
            assert!(
                drawing.file.contains("<title>") && drawing.file.contains("<desc>"),
                "{}-{}",
                made.stem,
                drawing.name
            );
        }
    }
}

#[test]
fn no_figure_has_a_nan_coordinate() {
    for made in all_pages() {
        for drawing in &made.drawings {
            for word in ["NaN", "inf"] {
                let drawn = drawing.file.split("</desc>").nth(1).unwrap();
                assert!(
                    !drawn.split(['"', ' ', 'M', 'L']).any(|part| part == word),
                    "{}-{}: {word}",
                    made.stem,
                    drawing.name
                );
            }
        }
    }
}

#[test]
fn a_worlds_text_is_escaped() {
    let page = all_pages().into_iter().find(|made| made.stem == "every-coupling").unwrap().page;
    assert!(page.contains("&lt;script&gt;alert(1)&lt;/script&gt; &amp;") && !page.contains("<script"));
}

#[test]
fn the_forward_euler_page_shows_growth_clipping_and_the_prediction() {
    let made = all_pages();
    let euler = made.iter().find(|made| made.stem == "euler").unwrap();
    for words in [
        "Virtual wheel, forward Euler",
        "forward Euler is never stable on an undamped mode",
        "first at sample 1491 (1.491 s)",
        "0.0197388 per second fitted to the run, 0.0197388 predicted",
        "17.77777777777778 N mm/deg",
        "1.01859 N m/rad",
        "predicted ±e^(growth·t)",
        "clipped",
        "present period, 1 ms",
        "lens near 1",
    ] {
        assert!(euler.page.contains(words), "{words}");
    }
    let damped = made.iter().find(|made| made.stem == "damped").unwrap();
    assert!(damped.page.contains("critical period, 318.3 ms"));
    let index = made.iter().find(|made| made.stem == "index").unwrap();
    assert!(index.page.contains("href=\"euler.html\"") && index.page.contains("href=\"trapezoidal.html\""));
}

#[test]
fn the_envelope_contains_the_whole_growing_run_and_touches_it() {
    let path = crate::common::worlds().into_iter().find(|path| path.ends_with("euler.toml")).unwrap();
    let system = System::read(&Source::open(path).unwrap(), &[]).unwrap();
    let check = hapt_analysis::check_system(&system, false).unwrap();
    let name = system.scenarios()[0];
    let mut simulation = hapt_sim::Run::new(&system, name).unwrap();
    let mut run = hapt_report::Run::new(&system, name, &simulation, &check);
    let mut rows = Vec::new();
    while let Some(row) = simulation.next() {
        let row = row.unwrap();
        run.add(&row);
        rows.push((row.row.time, row.row.torque));
    }
    // Predicted from the first turn; a run that grew by one percent more per second would leave it.
    let envelope = run.envelope().unwrap();
    assert_eq!(envelope.centre, 0.0);
    let filled = rows.iter().map(|(t, torque)| torque.abs() / (envelope.size * (envelope.growth * t).exp()));
    let most = filled.clone().skip(9000).fold(0.0, f64::max);
    assert!((0.9999..1.00001).contains(&most), "{most}");
    assert!(filled.fold(0.0, f64::max) < 1.00001);
}

#[test]
fn a_csv_draws_the_same_curves_as_the_run() {
    let text = crate::common::hard_worlds().into_iter().find(|(name, _)| name == "every-coupling").unwrap().1;
    let source = Source::from_text("every-coupling", text);
    let world = World::read(&source, &[]).unwrap();
    let scenario = world.scenario("swing").unwrap();
    let mut simulation = Simulation::new(&world, scenario).unwrap();
    let mut csv = CsvWriter::new(Vec::new(), &world).unwrap();
    while let Some(row) = simulation.next() {
        csv.write(row.unwrap()).unwrap();
    }
    let csv = csv.finish().unwrap();
    let again = read_csv(csv.as_slice(), |_| Ok(world.device.limit), (0.0, f64::INFINITY)).unwrap();
    let again = again.figure("swing: motion and torque", None, Width::Wide, 400).svg(Width::Wide, true);
    let made = pages(&[("every".into(), source)]);
    let drawn = made[0].drawings.iter().find(|drawing| drawing.name == "swing-motion").unwrap();
    assert_eq!(again, drawn.file);
}

#[test]
fn an_invalid_csv_is_refused_with_its_line() {
    let head = "time_s,puck_rad,puck_rad_per_s,torque_Nm,applied_Nm";
    for (text, line, words) in [
        (String::new(), "line 1", "no header"),
        ("a,b,c\n1,2,3\n".into(), "line 1", "no column time_s"),
        ("time_s,x\n0,0\n".into(), "line 1", "neither puck_rad nor puck_m"),
        ("time_s,puck_rad\n0,0\n".into(), "line 1", "no column puck_rad_per_s"),
        (format!("{head}\n"), "line 2", "no rows"),
        (format!("{head}\n0,0,0,0,0\n1,0,0,x,0\n"), "line 3", "field 4 is \"x\""),
        (format!("{head}\n0,0,0,0,NaN\n"), "line 2", "field 5"),
        (format!("{head}\n0,0,0,0\n"), "line 2", "4 fields; the header has 5"),
        (format!("{head}\n1,0,0,0,0\n1,0,0,0,0\n"), "line 3", "must increase"),
    ] {
        let message = read_csv(text.as_bytes(), |_| Ok(None), (0.0, f64::INFINITY)).unwrap_err().to_string();
        assert!(message.starts_with(line) && message.contains(words), "{text:?}: {message}");
    }
}

/// Hand, motor, gravity and cogging give; damping, friction, stops and shaft take.
#[test]
fn the_energies_of_a_run_have_every_part_of_its_device() {
    let device = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"6e-4 kg m^2\"\ndamping = \"1e-3 N m s/rad\"\nfriction = \"2 N mm\"\n";
    let parts = [
        (
            "gravity = { torque = \"60 N mm\", phase = \"90 deg\" }\n",
            "gravity and cogging ",
            "given by gravity and cogging",
        ),
        ("stops = { high = \"10 deg\", stiffness = 30, damping = 0.02 }\n", "the stops ", "taken by the stops"),
        ("handle = { inertia = 5e-4, stiffness = 20, damping = 1e-3 }\n", "the shaft ", "taken by the shaft"),
    ];
    let push = "[scenarios.push]\nduration = \"0.5 s\"\nhand = { kind = \"torque\", moves = { kind = \"step\", to = \"100 N mm\" } }\n";
    for among in 0..8 {
        let has = |i: usize| among & (1 << i) != 0;
        let own: String = parts.iter().enumerate().filter(|(i, _)| has(*i)).map(|(_, part)| part.0).collect();
        let made = pages(&[("parts".into(), Source::from_text("parts", format!("{device}{own}{push}")))]);
        let made = made.first().unwrap();
        let sentence = made.page.split("the hand gave").nth(1).unwrap().split("</dd>").next().unwrap();
        let energy = made.drawings.iter().find(|drawing| drawing.name.ends_with("energy")).unwrap();
        for (i, (_, said, drawn)) in parts.iter().enumerate() {
            assert_eq!(sentence.contains(said), has(i), "{own}: {sentence}");
            assert_eq!(energy.file.contains(drawn), has(i), "{own}: {drawn}");
        }
    }
}
