//! Numbers that the C changes, against the core with the same values.

use std::fmt::Write as _;
use std::fs;

use hapt_core::{Body, Controller, Coupling, Damping, End, Estimator, Law, Limits, Method, Output, Phase, Real, Side};
use hapt_export_c::{About, Error, Float, Prefix, Tune, export};
use hapt_testing::laws::goes_to_bodies;

use crate::bits::{BODIES, COUNTS, COUPLINGS, drawn, fed, random, readings, run, some};
use crate::compiler::{SANITIZERS, compile, compilers};
use crate::worlds::World;

/// Every positive number of every coupling, with a range around it.
fn numbers(world: &World) -> Vec<Tune> {
    let mut all = Vec::new();
    for (i, coupling) in world.couplings.iter().enumerate() {
        let mut law = coupling.law;
        let own: Vec<(&str, f64)> = law.quantities().map(|quantity| (quantity.name, *quantity.value)).collect();
        let limit = coupling.limit.map(|limit| ("limit", limit));
        for (quantity, value) in own.into_iter().chain(limit).filter(|(_, value)| *value > 1e-6) {
            let range = [0.3 * value, 2.5 * value];
            all.push(Tune {
                key: format!("couplings.{i}.{quantity}"),
                coupling: i,
                quantity: quantity.to_owned(),
                range,
            });
        }
    }
    all
}

fn written(world: &World, i: usize, tunes: &[Tune], float: Float) -> Result<(String, String), Error> {
    let about = About { is_certified: true, tunes: tunes.to_vec(), ..About::default() };
    let prefix = Prefix::new(&format!("w{i}")).unwrap();
    let written = export(&world.spec(), &world.limits, &about, &prefix, &format!("w{i}.h"), float)?;
    Ok((written.source, written.header))
}

/// Those that the C can change: the rest goes through the matrices of a method.
fn tunable(world: &World, float: Float) -> Vec<Tune> {
    let all = numbers(world).into_iter();
    all.filter(|tune| match written(world, 0, core::slice::from_ref(tune), float) {
        Ok(_) => true,
        Err(Error::Tune { .. }) => false,
        Err(error) => panic!("{error}"),
    })
    .collect()
}

fn with(world: &World, tune: &Tune, value: f64) -> World {
    let mut couplings: Vec<Coupling> = world.couplings.clone();
    let coupling = &mut couplings[tune.coupling];
    match coupling.law.quantities().find(|quantity| quantity.name == tune.quantity) {
        Some(quantity) => *quantity.value = value,
        None => coupling.limit = Some(value),
    }
    World { couplings, ..world.clone() }
}

/// The parameter that is requested at each sample, or -1, and its value.
fn requests(world: &World, tunes: &[Tune], samples: usize, seed: u64) -> Vec<[f64; 2]> {
    let mut seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut of = move || random(&mut seed);
    (0..samples)
        .map(|k| {
            if !(k == 1 || of() < 0.2) {
                return [-1.0, 0.0];
            }
            let which = (of() * (tunes.len() as f64 + 0.2)) as usize;
            let Some(tune) = tunes.get(which) else { return [tunes.len() as f64, 1.0] };
            let [low, high] = tune.range;
            let value = match (of() * 6.0) as usize {
                0 => value(world, tune),
                1 => [f64::NAN, f64::INFINITY, -low, 0.0][(of() * 4.0) as usize],
                2 => [0.99 * low, 1.01 * high][(of() * 2.0) as usize],
                _ => low + of() * (high - low),
            };
            [which as f64, value]
        })
        .collect()
}

fn value(world: &World, tune: &Tune) -> f64 {
    let mut law = world.couplings[tune.coupling].law;
    let own = law.quantities().find(|quantity| quantity.name == tune.quantity).map(|quantity| *quantity.value);
    own.or(world.couplings[tune.coupling].limit).unwrap()
}

/// The core's results with these values compiled, and the expected result of every request.
fn core<F: Real>(
    world: &World,
    tunes: &[Tune],
    readings: &[[f64; 8]],
    requests: &[[f64; 2]],
) -> (Vec<f64>, [usize; 5]) {
    let compiled = |world: &World| {
        Box::new(Controller::<F, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &world.limits).unwrap())
    };
    let f = F::from_f64;
    let file = |i: usize| f(value(world, &tunes[i]));
    let mut controller = compiled(world);
    let mut state = controller.start();
    let (mut phase, mut changed) = (Phase::Disarmed, None);
    let (mut shown, mut seen) = (Vec::new(), [0; 5]);
    for (row, &[which, wanted]) in readings.iter().zip(requests) {
        let mut code = 0;
        if which >= 0.0 {
            let i = which as usize;
            let inside = |tune: &Tune| {
                let x = f(wanted).to_f64();
                x >= tune.range[0] && x <= tune.range[1]
            };
            code = match tunes.get(i) {
                None => 1,
                Some(tune) if !inside(tune) => 2,
                Some(_) if phase != Phase::Disarmed => 3,
                Some(_) if changed.is_some_and(|other| other != i) && f(wanted) != file(i) => 4,
                Some(tune) => {
                    if f(wanted) != file(i) {
                        changed = Some(i);
                        controller = compiled(&with(world, tune, f(wanted).to_f64()));
                    } else if changed == Some(i) {
                        changed = None;
                        controller = compiled(world);
                    }
                    0
                }
            };
            seen[code] += 1;
        }
        let output = fed(&controller, &mut state, world, row);
        phase = output.phase;
        shown.extend([code as f64, output.output.to_f64(), f64::from(phase as u8), output.sample.torque.to_f64()]);
        shown.extend([state.supervisor.account().to_f64(), state.supervisor.made().to_f64()]);
    }
    (shown, seen)
}

fn program(worlds: &[(World, Vec<Tune>)], samples: usize) -> String {
    let mut main = String::from("#include \"ports.c\"\n");
    let mut calls = String::new();
    for (i, (world, _)) in worlds.iter().enumerate() {
        let given = if world.estimator == Estimator::Exact { "reading.velocity = (w_real)in[1]; " } else { "" };
        let body = format!(
            "#include \"w{i}.c\"\nstatic w_controller self{i};\nstatic void run{i}(void) {{\n    double in[10];\n    int k, code;\n    \
             w_init(&self{i});\n    for (k = 0; k < {samples}; k++) {{\n        w_reading reading;\n        \
             if (!get(in, sizeof in)) return;\n        code = 0;\n        \
             if (in[8] >= 0) code = (int)w_set(&self{i}, (w_parameter)(int)in[8], (w_real)in[9]);\n        \
             if (in[6] == in[6]) w_commanded(&self{i}, (w_real)in[6]);\n        \
             if (in[7] > 0) w_trip(&self{i}, (w_reason)(int)in[7]);\n        \
             if (in[5] == 1) w_arm(&self{i}); else if (in[5] == 2) w_disarm(&self{i}); else if (in[5] == 3) w_stop(&self{i}); \
             else if (in[5] == 4) w_clear(&self{i});\n        reading.position = (w_real)in[0]; {given}reading.late = (w_real)in[2]; \
             reading.missed = (uint32_t)in[3]; reading.silent = (w_real)in[4];\n        put(code); \
             put(w_step_reading(&self{i}, &reading)); put(self{i}.phase); put(self{i}.sample.torque); put(self{i}.account); \
             put(self{i}.made);\n    }}\n}}\n"
        );
        // The bare loop has no parameters.
        main += &body.replace("w_", &format!("w{i}_"));
        writeln!(calls, "    (void)w{i}_state_step; run{i}();").unwrap();
    }
    main + "int main(void) {\n" + &calls + "    return 0;\n}\n"
}

fn agree(worlds: &[(World, Vec<Tune>)], float: Float, compiler: &str, options: &[&str]) -> [usize; 5] {
    let folder = tempfile::tempdir().unwrap();
    let mut input = Vec::new();
    let mut wanted = Vec::new();
    let mut seen = [0; 5];
    for (i, (world, tunes)) in worlds.iter().enumerate() {
        let (source, header) = written(world, i, tunes, float).unwrap();
        fs::write(folder.path().join(format!("w{i}.c")), source).unwrap();
        fs::write(folder.path().join(format!("w{i}.h")), header).unwrap();
        let readings = readings(world, i as u64 + 1, true);
        let requests = requests(world, tunes, readings.len(), i as u64 + 1);
        let (shown, codes) = match float {
            Float::F32 => core::<f32>(world, tunes, &readings, &requests),
            Float::F64 => core::<f64>(world, tunes, &readings, &requests),
        };
        wanted.extend(shown);
        seen.iter_mut().zip(codes).for_each(|(all, new)| *all += new);
        input.extend(readings.iter().zip(&requests).flat_map(|(x, y)| x.iter().chain(y)).flat_map(|x| x.to_le_bytes()));
    }
    let samples = input.len() / (80 * worlds.len());
    fs::write(folder.path().join("main.c"), program(worlds, samples)).unwrap();
    fs::write(folder.path().join("ports.c"), include_str!("desktop.c")).unwrap();
    compile(compiler, &[&["-std=c99", "-o", "program", "main.c"], options].concat(), folder.path());
    let output = run(folder.path(), &input);
    let shown: Vec<f64> = output.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
    assert_eq!(shown.len(), wanted.len());
    for (j, (given, wanted)) in shown.iter().zip(&wanted).enumerate() {
        let same = given.to_bits() == wanted.to_bits() || (given.is_nan() && wanted.is_nan());
        let world = j / (6 * samples);
        assert!(
            same,
            "world {world}, sample {}, number {}: {given:?}, not {wanted:?}; {:?}",
            j / 6 % samples,
            j % 6,
            worlds[world]
        );
    }
    seen
}

/// Random worlds with all numbers that the C can change, requested at random: inside and outside the range, under a torque and without.
#[test]
fn a_number_set_in_c_has_the_bits_of_the_core_with_the_same_number() {
    let mut seen = [0; 5];
    for (i, worlds) in drawn(some(6), hapt_testing::cases_from(1, 1)).chunks(8).enumerate() {
        let float = [Float::F32, Float::F64][i % 2];
        let worlds: Vec<(World, Vec<Tune>)> = worlds
            .iter()
            .map(|world| (world.clone(), tunable(world, float)))
            .filter(|(_, tunes)| !tunes.is_empty())
            .collect();
        let compilers = compilers();
        // Sanitizers take three quarters of a compiler's time: the first worlds have them, by gcc, which always has their libraries.
        let (compiler, options) =
            if i < 2 { ("gcc", &SANITIZERS[..]) } else { (compilers[i % compilers.len()], &["-O1"][..]) };
        let codes = agree(&worlds, float, compiler, options);
        seen.iter_mut().zip(codes).for_each(|(all, new)| *all += new);
    }
    assert!(seen.iter().all(|count| *count > 10), "every answer occurs: {seen:?}");
}

/// Between puck and ground the number is used directly; at a body, a spring's goes through the matrices of the method.
#[test]
fn numbers_that_stand_in_no_matrix_can_be_set_and_others_are_refused() {
    let some = drawn(1, hapt_testing::cases_from(1, 1)).remove(0);
    let world = |law: Law, limit: Option<f64>, first: End| World {
        method: Method::Zoh,
        output: Output::End,
        advance: 0,
        bodies_every: 1,
        bodies: vec![Body { inertia: 0.01, position: 0.0, velocity: 0.0 }],
        couplings: vec![Coupling { limit, ..law.between(first, End::Ground) }],
        // An origin that slips needs the stiffness in a number of its own.
        limits: Limits { recentre: 0.0, ..some.limits },
        ..some.clone()
    };
    let spring = Law::Spring { stiffness: 2.0, rest: 0.1 };
    let wall = Law::Wall { side: Side::Below, at: 0.1, stiffness: 1.0, damping: 0.01 };
    let body = End::Body(0);
    // Except for laws with a state or a waveform, the loop has the numbers of nonlinear laws unchanged: all of them can be set.
    let as_they_are = Law::ALL.into_iter().filter(|law| law.between(body, End::Ground).linear().is_none());
    for mut law in as_they_are.filter(|law| goes_to_bodies(law) && law.waveform().is_none()) {
        let mut names = Vec::new();
        for (quantity, i) in law.quantities().zip(1..) {
            *quantity.value = 0.1 * f64::from(i);
            names.push(quantity.name.to_owned());
        }
        let tunable: Vec<String> =
            tunable(&world(law, None, End::Puck), Float::F32).into_iter().map(|tune| tune.quantity).collect();
        assert_eq!(tunable, names, "{law:?}");
    }
    for (law, limit, first, wanted) in [
        // Its torque at 0, stiffness · rest, is a number of its own.
        (spring, None, End::Puck, &[][..]),
        (Law::Spring { stiffness: 2.0, rest: 0.0 }, None, End::Puck, &["stiffness"]),
        (spring, Some(0.3), End::Puck, &["stiffness", "rest", "limit"]),
        (spring, None, body, &[]),
        (spring, Some(0.3), body, &["stiffness", "rest", "limit"]),
        (Law::Damper { damping: Damping::Fixed(0.01) }, None, End::Puck, &["damping"]),
        (Law::Damper { damping: Damping::Fixed(0.01) }, None, body, &[]),
        (wall, Some(0.3), body, &["at", "stiffness", "damping", "limit"]),
        // Its gain is stiffness/time: half of the stiffness, or a third.
        (Law::Integral { stiffness: 1.0, time: 2.0, rest: 0.1 }, None, End::Puck, &["stiffness", "rest"]),
        (Law::Integral { stiffness: 1.0, time: 3.0, rest: 0.1 }, None, End::Puck, &["rest"]),
        (Law::Constant { torque: 0.01 }, None, End::Puck, &["torque"]),
    ] {
        let world = world(law, limit, first);
        let tunable: Vec<String> = tunable(&world, Float::F32).into_iter().map(|tune| tune.quantity).collect();
        assert_eq!(tunable, wanted, "{law:?} {limit:?} {first:?}");
    }
    let world = world(wall, None, End::Puck);
    let tune = |quantity: &str, range: [f64; 2]| Tune {
        key: format!("couplings.0.{quantity}"),
        coupling: 0,
        quantity: quantity.to_owned(),
        range,
    };
    for tunes in [
        vec![tune("torque", [0.5, 2.0])],
        vec![tune("stiffness", [2.0, 3.0])],
        vec![tune("stiffness", [1.0, 1.0])],
        vec![tune("stiffness", [0.0, 2.0])],
        vec![tune("stiffness", [0.5, f64::NAN])],
        vec![tune("stiffness", [0.5, f64::INFINITY])],
        vec![tune("stiffness", [0.5, 2.0]); 2],
        vec![Tune { coupling: 7, ..tune("stiffness", [0.5, 2.0]) }],
    ] {
        let refused = written(&world, 0, &tunes, Float::F32);
        assert!(matches!(refused, Err(Error::Tune { .. })), "{tunes:?}");
    }
}
