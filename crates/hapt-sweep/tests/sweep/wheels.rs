//! Held loops of one body are computed in lanes, bit-identical to single ones.

use hapt_analysis::sign;
use hapt_analysis::{Verdict, held_growth};
use hapt_model::{Method, Source};
use hapt_sweep::{Measure, Sweep};
use hapt_testing::prelude::*;

const WHEEL: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[[couplings]]
kind = "damper"
between = ["wheel", "ground"]
damping = 1e-3
[[couplings]]
kind = "spring"
between = ["ground", "wheel"]
stiffness = 0.2
[[couplings]]
kind = "damper"
between = ["puck", "wheel"]
damping = 0
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = 0.01
pitch = 0.2
"#;

/// A wall that the wheel may meet: no loop of springs and dampers.
const WALL: &str = r#"
[[couplings]]
kind = "wall"
between = ["wheel", "ground"]
side = "above"
at = 1
stiffness = 3
damping = 0.002
"#;

const AXES: [&str; 10] = [
    "couplings.0.stiffness=0.01..1e4:7:log",
    "couplings.1.damping=0..0.01:5",
    "couplings.2.stiffness=0..30:9",
    "couplings.3.damping=0..0.1:21",
    "couplings.4.torque=0..3:4",
    "bodies.wheel.inertia=1e-4..0.1:19:log",
    "bodies.wheel.position=-1..1:3",
    "device.inertia=1e-4..1e-3:3",
    "loop.period=1us..1s:14:log",
    "loop.delay=0..1ms:3",
];

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn a_held_cell_is_its_single_world(
        slow in 0..AXES.len(),
        fast in 0..AXES.len(),
        method in prop::sample::select(Method::ALL.to_vec()),
        follows in prop::sample::select(vec!["", "couplings.1.damping=compensating", "couplings.3.damping=compensating"]),
        wall in prop::bool::weighted(0.2),
        // With another measure, which needs complete worlds.
        other in prop::option::of(Just(Measure::FreeGrowth)),
        cut in 0.0..1.0f64,
    ) {
        let follows: Vec<String> = if follows.is_empty() { vec![] } else { vec![follows.to_string()] };
        let is_free = |axis: &str| follows.iter().all(|set| set.split('=').next() != axis.split('=').next());
        prop_assume!(slow != fast && is_free(AXES[slow]) && is_free(AXES[fast]));
        // These two take the new sample first, and no nonlinear coupling at a body.
        prop_assume!(!(wall && method.takes_new_sample_first()));
        let text = if wall { WHEEL.to_string() + WALL } else { WHEEL.to_string() };
        let sets = [follows, vec![format!("loop.method={}", method.name())]].concat();
        let measures: Vec<Measure> = [Measure::HeldGrowth, Measure::HeldVerdict].into_iter().chain(other).collect();
        let axes = [AXES[slow], AXES[fast]].map(String::from);
        let sweep = Sweep::new(&Source::from_text("w.toml", &text), &sets, &axes, &measures, None).unwrap();
        let middle = (cut * sweep.cells() as f64) as u64;
        for row in [sweep.rows(0..middle), sweep.rows(middle..sweep.cells())].iter().flatten() {
            let mut world = sweep.system.world().unwrap().clone();
            for (axis, value) in sweep.grid.axes.iter().zip(row) {
                prop_assert!(world.set_number(&axis.key, value.unwrap()));
            }
            let growth = held_growth(&world.bodies, &world.couplings, method, world.sampling.period).unwrap();
            prop_assert_eq!(row[2].map(f64::to_bits), growth.map(f64::to_bits), "{:?}", row);
            prop_assert_eq!(row[3], Some(sign(Verdict::of(growth))), "{:?}", row);
        }
    }
}
