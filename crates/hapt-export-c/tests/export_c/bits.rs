//! The C at every sample, against the core.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use hapt_core::{Controller, ControllerState, Estimator, Method, Reading, Real, Request, SafeOutput};
use hapt_export_c::{About, Float, Prefix, export};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, TestRunner};

use crate::compiler::{
    ARM, AVR, BOARDS, Board, FREESTANDING, QEMU, SANITIZERS, SIMAVR, compile, compilers, has_avr, has_board,
};
use crate::worlds::{World, world};

pub const BODIES: usize = 8;
pub const COUPLINGS: usize = 32;
pub const COUNTS: usize = 257;
/// Samples of each run.
const SAMPLES: usize = 600;
/// Numbers of a sample in: position, velocity, late, missed, silent, request, the delay of the last command or NaN, a reason to trip or 0.
const IN: usize = 8;

/// Worlds of every method in turn.
pub fn worlds(count: usize) -> Vec<World> {
    drawn(count, hapt_testing::cases(1))
}

/// The same with random numbers of this test.
pub fn drawn(count: usize, config: Config) -> Vec<World> {
    let mut runner = TestRunner::new(config);
    Method::ALL
        .into_iter()
        .cycle()
        .take(count)
        .map(|method| world(method).new_tree(&mut runner).unwrap().current())
        .collect()
}

/// A number from 0 to 1.
pub fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64
}

/// Readings of a puck that a hand moves, with the faults of a device: jumps, standstills, NaN, lateness, silence, requests. Numbers are
/// rounded to those of the C.
pub fn readings(world: &World, seed: u64, is_wild: bool) -> Vec<[f64; IN]> {
    let mut seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let (mut position, mut velocity, mut stands) = (0.0, 0.0, 0_u32);
    let (mut silent, mut late) = (0.0, 0.0);
    // Often enough for an origin that slips while the puck rests.
    let rests = if world.limits.recentre > 0.0 { 0.1 } else { 0.01 };
    (0..SAMPLES)
        .map(|k| {
            let mut of = || random(&mut seed);
            velocity = 0.995 * velocity + (of() - 0.5) * 0.8;
            stands = if stands > 0 {
                stands - 1
            } else if of() < rests {
                (of() * 120.0) as u32
            } else {
                0
            };
            if stands == 0 {
                position += velocity * world.period;
            }
            let wild = |part: f64, of: &mut dyn FnMut() -> f64| is_wild && of() < part;
            if wild(0.004, &mut of) {
                position += (of() - 0.5) * 0.4;
            }
            if wild(0.001, &mut of) {
                position += (of() - 0.5) * 1e9;
            }
            let shown = if wild(0.001, &mut of) { [f64::NAN, f64::INFINITY][(of() * 2.0) as usize] } else { position };
            late = if wild(0.03, &mut of) { of() * 3.0 * world.period } else { 0.5 * late };
            let missed = if wild(0.01, &mut of) { (of() * 4.0).floor() } else { 0.0 };
            silent = if wild(0.02, &mut of) { silent + of() * 0.3 } else { 0.0 };
            let request = match k {
                3 => 1.0,
                _ if wild(0.03, &mut of) => (of() * 5.0).floor(),
                _ if k % 40 == 0 => {
                    if k % 80 == 0 {
                        4.0
                    } else {
                        1.0
                    }
                }
                _ => 0.0,
            };
            let delay = if wild(0.05, &mut of) { of() * 2.0 * world.period } else { f64::NAN };
            let trip = if wild(0.002, &mut of) { 16.0 } else { 0.0 };
            [shown, velocity, late, missed, silent, request, delay, trip]
        })
        .collect()
}

/// A sample of the core with one of the readings, as it is fed to the C.
pub fn fed<F: Real>(
    controller: &Controller<F, BODIES, COUPLINGS, COUNTS>,
    state: &mut ControllerState<F, BODIES, COUPLINGS, COUNTS>,
    world: &World,
    &[position, velocity, late, missed, silent, request, delay, trip]: &[f64; IN],
) -> SafeOutput<F> {
    let f = F::from_f64;
    if !delay.is_nan() {
        state.commanded(f(delay));
    }
    if trip > 0.0 {
        state.trip(hapt_core::Reason::from_code(trip as u8).unwrap());
    }
    let velocity = if world.estimator == Estimator::Exact { velocity } else { 0.0 };
    let reading = Reading {
        position: f(position),
        velocity: f(velocity),
        announced: false,
        late: f(late),
        missed: missed as u32,
        silent: f(silent),
    };
    let request =
        [None, Some(Request::Arm), Some(Request::Disarm), Some(Request::Stop), Some(Request::Clear)][request as usize];
    controller.step(state, &reading, request)
}

/// The core's results for them, in the form of the C's.
fn core<F: Real>(world: &World, readings: &[[f64; IN]]) -> Vec<f64> {
    let spec = world.spec();
    let controller = Controller::<F, BODIES, COUPLINGS, COUNTS>::new(&spec, &world.limits).unwrap();
    let (mut bare, mut state) = (controller.world().start(), controller.start());
    let (mut shown, f) = (Vec::new(), F::from_f64);
    let count = couplings(&controller);
    for row @ &[position, velocity, ..] in readings {
        let sample = controller.world().step(&mut bare, f(position), f(velocity));
        for x in [sample.puck.position, sample.puck.velocity, sample.torque, sample.command] {
            shown.push(x.to_f64());
        }
        for i in 0..world.bodies.len() {
            for x in [bare.now.position[i], bare.now.velocity[i], bare.change.position[i], bare.change.velocity[i]] {
                shown.push(x.to_f64());
            }
        }
        for i in 0..count {
            shown.push(bare.bristles[i].to_f64());
            shown.push(bare.contacts.torques[i].to_f64());
        }
        shown.push(f64::from(bare.contacts.unsettled));
        let SafeOutput { sample, output, phase, reason, warning, .. } = fed(&controller, &mut state, world, row);
        let code = |reason: Option<hapt_core::Reason>| reason.map_or(0.0, |reason| f64::from(reason.code()));
        let supervisor = &state.supervisor;
        let phase = f64::from(phase as u8);
        shown.extend([output.to_f64(), phase, code(reason), code(warning), sample.torque.to_f64()]);
        shown.extend([supervisor.account().to_f64(), supervisor.made().to_f64(), supervisor.gain.to_f64()]);
        shown.extend([supervisor.offset.to_f64(), f64::from(supervisor.outside())]);
    }
    shown
}

/// Couplings up to the last nonlinear one.
fn couplings<F: Real>(controller: &Controller<F, BODIES, COUPLINGS, COUNTS>) -> usize {
    struct Count(usize);
    impl hapt_core::Constants for Count {
        fn whole(&mut self, _: &'static str, _: &'static str, _: i64) {}
        fn number(&mut self, _: &'static str, _: &'static str, _: f64) {}
        fn array(&mut self, _: &'static str, _: &'static str, _: &[usize], _: &dyn Fn(usize) -> f64) {}
        fn element(&mut self, list: &'static str, _: &'static str) {
            self.0 += usize::from(list == "couplings");
        }
        fn end(&mut self) {}
    }
    let mut count = Count(0);
    controller.world().constants(&mut count);
    count.0
}

/// A program in C, one translation unit, that takes the readings of each world and prints its results.
fn program(worlds: &[World]) -> String {
    let mut main = String::from("#include \"ports.c\"\n");
    for i in 0..worlds.len() {
        writeln!(main, "#include \"w{i}.c\"").unwrap();
    }
    for (i, world) in worlds.iter().enumerate() {
        let controller = Controller::<f64, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &world.limits).unwrap();
        let count = couplings(&controller);
        let exact = world.estimator == Estimator::Exact;
        let velocity = if exact { ", (w_real)in[1]" } else { "" };
        let mut body = format!(
            "static w_state bare{i};\nstatic w_controller self{i};\nstatic void run{i}(void) {{\n    double in[{IN}];\n    int k;\n    \
             w_state_init(&bare{i}); w_init(&self{i});\n    for (k = 0; k < {SAMPLES}; k++) {{\n        w_sample sample; w_reading reading;\n        \
             if (!get(in, sizeof in)) return;\n        sample = w_state_step(&bare{i}, (w_real)in[0]{velocity});\n        \
             put(sample.position); put(sample.velocity); put(sample.torque); put(sample.command);\n"
        );
        for j in 0..world.bodies.len() {
            for half in ["now", "change"] {
                writeln!(body, "        put(bare{i}.{half}.position[{j}]); put(bare{i}.{half}.velocity[{j}]);")
                    .unwrap();
            }
        }
        let source = written(world, i, Float::F64).1;
        let (lugre, gradient) = (source.contains("bristle["), source.contains("contact["));
        for j in 0..count {
            let of = |has: bool, name: &str| if has { format!("bare{i}.{name}[{j}]") } else { "0".to_owned() };
            writeln!(body, "        put({}); put({});", of(lugre, "bristle"), of(gradient, "contact")).unwrap();
        }
        let unsettled = if gradient { format!("bare{i}.unsettled") } else { "0".to_owned() };
        let given = if exact { "reading.velocity = (w_real)in[1]; " } else { "" };
        let arm = if i % 2 == 0 { "w_arm" } else { "w_arm_uncertified" };
        write!(
            body,
            "        put({unsettled});\n        if (in[6] == in[6]) w_commanded(&self{i}, (w_real)in[6]);\n        \
             if (in[7] > 0) w_trip(&self{i}, (w_reason)(int)in[7]);\n        \
             if (in[5] == 1) {arm}(&self{i}); else if (in[5] == 2) w_disarm(&self{i}); else if (in[5] == 3) w_stop(&self{i}); \
             else if (in[5] == 4) w_clear(&self{i});\n        reading.position = (w_real)in[0]; {given}reading.late = (w_real)in[2]; \
             reading.missed = (uint32_t)in[3]; reading.silent = (w_real)in[4];\n        put(w_step_reading(&self{i}, &reading));\n        \
             put(self{i}.phase); put(self{i}.reason); put(self{i}.warning); put(self{i}.sample.torque); put(self{i}.account); \
             put(self{i}.made); put(self{i}.gain); put(self{i}.offset); put(self{i}.outside);\n    }}\n}}\n"
        )
        .unwrap();
        main += &body.replace("w_", &format!("w{i}_"));
    }
    main += "int main(void) {\n";
    for i in 0..worlds.len() {
        writeln!(main, "    run{i}();").unwrap();
    }
    main + "    return 0;\n}\n"
}

pub fn written(world: &World, i: usize, float: Float) -> (String, String) {
    let about = About {
        title: format!("World {i}: */ ?\u{3f}/ \\"),
        bodies: (0..world.bodies.len()).map(|i| format!("body {i}")).collect(),
        is_certified: i.is_multiple_of(2),
        ..About::default()
    };
    let prefix = Prefix::new(&format!("w{i}")).unwrap();
    let written = export(&world.spec(), &world.limits, &about, &prefix, &format!("w{i}.h"), float).unwrap();
    (written.source, written.header)
}

/// Compiles the worlds in one run of the compiler and compares every number of every sample. For a [`Board`]'s name it runs under QEMU.
pub fn agree(worlds: &[World], float: Float, compiler: &str, options: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    for (i, world) in worlds.iter().enumerate() {
        let (source, header) = written(world, i, float);
        fs::write(folder.path().join(format!("w{i}.c")), source).unwrap();
        fs::write(folder.path().join(format!("w{i}.h")), header).unwrap();
    }
    fs::write(folder.path().join("main.c"), program(worlds)).unwrap();
    let board = Board::named(compiler);
    let ports = if board.is_some() { include_str!("cortex_m.c") } else { include_str!("desktop.c") };
    fs::write(folder.path().join("ports.c"), ports).unwrap();
    let mut arguments = [&["-std=c99", "-o", "program", "main.c"], options].concat();
    if let Some(board) = board {
        fs::write(folder.path().join("board.ld"), board.script()).unwrap();
        arguments.extend(board.flags);
        arguments.extend(FREESTANDING);
    }
    compile(if board.is_some() { ARM } else { compiler }, &arguments, folder.path());
    let readings: Vec<_> =
        worlds.iter().enumerate().map(|(i, world)| readings(world, i as u64 + 1, i % 3 != 0)).collect();
    let input: Vec<u8> = readings.iter().flatten().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let output = match board {
        Some(board) => run_on_board(board, folder.path(), &input),
        None => run(folder.path(), &input),
    };
    let shown: Vec<f64> = output.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
    let mut at = 0;
    for (i, (world, readings)) in worlds.iter().zip(&readings).enumerate() {
        let wanted = match float {
            Float::F32 => core::<f32>(world, readings),
            Float::F64 => core::<f64>(world, readings),
        };
        let each = wanted.len() / SAMPLES;
        for (j, wanted) in wanted.iter().enumerate() {
            let given = shown[at + j];
            let same = given.to_bits() == wanted.to_bits() || (given.is_nan() && wanted.is_nan());
            assert!(
                same,
                "world {i} by {compiler} {options:?} {float:?}, sample {}, number {} of {each}: {given:?}, not {wanted:?}; {world:?}",
                j / each,
                j % each
            );
        }
        at += wanted.len();
    }
    assert_eq!(at, shown.len());
}

pub fn run(folder: &Path, input: &[u8]) -> Vec<u8> {
    let mut child = Command::new(folder.join("program"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    std::thread::scope(|scope| {
        scope.spawn(move || stdin.write_all(input));
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "the program in C ended with {}", output.status);
        output.stdout
    })
}

fn run_on_board(board: &Board, folder: &Path, input: &[u8]) -> Vec<u8> {
    fs::write(folder.join("in"), input).unwrap();
    let mut qemu = Command::new(QEMU);
    qemu.args(["-machine", board.machine, "-display", "none", "-serial", "none", "-monitor", "none"]);
    qemu.args(["-semihosting-config", "enable=on,target=native", "-kernel", "program"]);
    let ran = qemu.current_dir(folder).stdin(Stdio::null()).output().unwrap();
    assert!(
        ran.status.success(),
        "the board's program ended with {}: {}",
        ran.status,
        String::from_utf8_lossy(&ran.stderr)
    );
    fs::read(folder.join("out")).unwrap()
}

/// The number of worlds in `cargo test`; eight times as many with `HAPT_ONE_IN=1`.
pub fn some(count: u64) -> usize {
    hapt_testing::seeds(8 * count).end as usize
}

/// Random worlds of all methods, estimators and laws, by one compiler with its usual options.
#[test]
fn the_c_of_a_world_has_the_cores_bits() {
    for (i, worlds) in worlds(some(3)).chunks(8).enumerate() {
        agree(worlds, [Float::F32, Float::F64][i % 2], "gcc", &["-O2"]);
    }
}

/// Each with an encoder and without, with a filter and without: Levant's differentiator for a hand that it follows, and for one that is
/// too fast.
#[test]
fn estimators_that_track_the_position_have_the_cores_bits() {
    let estimators = [
        Estimator::Kalman { cutoff: 50.0 },
        Estimator::Levant { acceleration: 30.0 },
        Estimator::Levant { acceleration: 1e4 },
    ];
    let some = drawn(Method::ALL.len(), hapt_testing::cases_from(1, 1));
    let mut worlds = Vec::new();
    for estimator in estimators {
        for count in [None, Some(1e-3)] {
            for filter in [None, Some(40.0)] {
                let world = some[worlds.len() % some.len()].clone();
                worlds.push(World { estimator, count, filter, ..world });
            }
        }
    }
    for float in [Float::F32, Float::F64] {
        agree(&worlds, float, "gcc", &["-O2"]);
    }
}

/// Of any number that is not negative: subnormal ones, squares and their neighbours too.
#[test]
fn the_square_root_in_c_is_the_cores() {
    let some = drawn(1, hapt_testing::cases_from(1, 1)).remove(0);
    let world = World { estimator: Estimator::Levant { acceleration: 100.0 }, ..some };
    let main = "#include \"ports.c\"\n#include \"w0.c\"\nint main(void) {\n    double x;\n    \
                while (get(&x, sizeof x)) put(w0_sqrt((w0_real)x));\n    return 0;\n}\n";
    for float in [Float::F32, Float::F64] {
        let mut seed = 1;
        let mut bits = || (random(&mut seed) * (1_u64 << 53) as f64) as u64;
        let mut numbers = vec![0.0, -0.0, f64::INFINITY, f64::NAN];
        for i in 0..100_000 {
            // 63 bits: no sign.
            let any = (bits() << 10) ^ bits();
            match float {
                Float::F32 => {
                    let square = f32::from_bits((any >> 32) as u32).powi(2);
                    let x = [any as u32 >> 1, any as u32 >> (9 + i % 23), square.to_bits(), square.to_bits() ^ 1];
                    numbers.extend(x.map(|x| f64::from(f32::from_bits(x))));
                }
                Float::F64 => {
                    let square = f64::from_bits(any).powi(2);
                    let x = [any, any >> (11 + i % 52), square.to_bits(), square.to_bits() ^ 1];
                    numbers.extend(x.map(f64::from_bits));
                }
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let (source, header) = written(&world, 0, float);
        for (name, text) in
            [("w0.c", source.as_str()), ("w0.h", &header), ("ports.c", include_str!("desktop.c")), ("main.c", main)]
        {
            fs::write(folder.path().join(name), text).unwrap();
        }
        compile("gcc", &[&["-std=c99", "-o", "program", "main.c"], &SANITIZERS[..]].concat(), folder.path());
        let input: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let output = run(folder.path(), &input);
        assert_eq!(output.len(), input.len());
        for (x, root) in numbers.iter().zip(output.chunks_exact(8)) {
            let root = f64::from_le_bytes(root.try_into().unwrap());
            let wanted = match float {
                Float::F32 => f64::from((*x as f32).sqrt()),
                Float::F64 => x.sqrt(),
            };
            let same = root.to_bits() == wanted.to_bits() || (root.is_nan() && wanted.is_nan());
            assert!(same, "{float:?}: of {x:?} {root:?}, not {wanted:?}");
        }
    }
}

/// A handful of worlds, by every compiler and with every degree of optimisation.
#[test]
fn no_compiler_and_no_optimisation_changes_a_bit() {
    let worlds = worlds(4);
    for compiler in compilers() {
        for (i, option) in ["-O0", "-O1", "-O2", "-O3"].into_iter().enumerate() {
            agree(&worlds, [Float::F32, Float::F64][i % 2], compiler, &[option]);
        }
    }
}

/// The processors of makers' boards: with a floating-point unit for f32 (STM32F4 and G4; RP2350), and without one (RP2040), where 16 KiB of
/// RAM take one world.
///
/// gcc's own subtraction of doubles for Thumb-2 (libgcc 12.2) gives 1 - b wrong by a unit in the last place for some b from 2^-33 to 2^-32.
/// The exponential of LuGre friction meets that; on a Cortex-M0+ gcc has another subtraction.
#[test]
fn every_cortex_m_has_the_cores_bits() {
    if has_board() {
        let worlds = worlds(some(1).max(2));
        let has_exp = |world: &World| world.couplings.iter().any(|coupling| coupling.law.has_bristle());
        for board in BOARDS {
            for (i, world) in worlds.iter().enumerate() {
                let world = std::slice::from_ref(world);
                agree(world, Float::F32, board.name, &[["-O2", "-O3", "-Os"][i % 3]]);
                if board.name == "cortex-m0plus" || !has_exp(&world[0]) {
                    agree(world, Float::F64, board.name, &["-Os"]);
                }
            }
        }
    }
}

/// Bytes of an ATmega328P: flash, and RAM without a stack of 400.
const FLASH: u64 = 32 << 10;
const RAM: u64 = 2048 - 400;

/// Arduino's Uno, Nano and Hapkit: numbers of 32 bits only, and no unit for them. Worlds that need more are refused by the compiler.
#[test]
fn an_atmega328p_has_the_bits_of_a_computer_or_refuses() {
    if !has_avr() {
        return;
    }
    let (mut ran, mut refused) = (0, 0);
    for (i, world) in worlds(some(10)).iter().enumerate() {
        let about = About { is_certified: false, ..About::default() };
        let prefix = Prefix::new("w").unwrap();
        let c = export(&world.spec(), &world.limits, &about, &prefix, "w.h", Float::F32).unwrap();
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("w.c"), &c.source).unwrap();
        fs::write(folder.path().join("w.h"), &c.header).unwrap();
        fs::write(folder.path().join("avr.c"), include_str!("avr.c")).unwrap();
        let period = format!("-DPERIOD={:?}f", world.period as f32);
        let exact = if world.estimator == Estimator::Exact { "-DEXACT" } else { "-DESTIMATED" };
        let flags = ["-std=c99", "-Os", &period, exact, "avr.c", "-o"];
        let avr = [&["-mmcu=atmega328p", "-DF_CPU=16000000UL"], &flags[..], &["program.elf"]].concat();
        let built = Command::new(AVR).args(avr).current_dir(folder.path()).output().unwrap();
        let printed = String::from_utf8_lossy(&built.stderr);
        if c.source.contains("doubles of 64 bits") {
            assert!(
                !built.status.success() && printed.contains("a world without detents and textures"),
                "world {i}: {printed}"
            );
            refused += 1;
            continue;
        }
        // Many bodies and couplings do not fit into 32 KiB, and with the stack into 2 KiB.
        let (flash, ram) =
            if built.status.success() { memory(&folder.path().join("program.elf")) } else { (u64::MAX, u64::MAX) };
        if flash > FLASH || ram > RAM {
            assert!(built.status.success() || printed.contains("region"), "world {i}: {printed}");
            continue;
        }
        assert!(!printed.contains("w.c:"), "world {i}: {printed}");
        compile("gcc", &[&flags[..], &["program"]].concat(), folder.path());
        let board = Command::new(SIMAVR)
            .args(["-m", "atmega328p", "-f", "16000000", "program.elf"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let board = [board.stdout, board.stderr].concat();
        let lines = |text: &[u8]| -> Vec<String> {
            let text = String::from_utf8_lossy(text).into_owned();
            text.lines().filter_map(|line| Some(line.get(line.find("99 ")? + 3..)?.get(..8)?.to_owned())).collect()
        };
        let wanted = lines(&run(folder.path(), &[]));
        assert_eq!(wanted.len(), 6);
        assert_eq!(lines(&board), wanted, "world {i}: {}; {world:?}", String::from_utf8_lossy(&board));
        ran += 1;
    }
    println!("{ran} ran, {refused} were refused");
    assert!(ran > 0 && refused > 0, "{ran} ran, {refused} were refused");
}

/// The flash and RAM of a program.
fn memory(program: &Path) -> (u64, u64) {
    let output = Command::new("avr-size").arg(program).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let row: Vec<u64> = text.lines().nth(1).unwrap().split_whitespace().filter_map(|x| x.parse().ok()).collect();
    (row[0] + row[1], row[1] + row[2])
}
