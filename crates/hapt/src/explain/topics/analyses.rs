//! Further analyses of a loop.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "sweep",
        aliases: &["vary", "measure", "measures", "map"],
        line: "many worlds at once: a table, and a map",
        text: r#"`hapt sweep` evaluates every combination of a few keys and writes a row for each: KEY=FROM..TO:N, or
:N:log for equal ratios. Measures of a run are peak_torque, final_energy and settling_time; of the
loop held_growth_per_s, free_growth_per_s, held_verdict, free_verdict (-1 stable, 0 marginal, 1
unstable), required_damping and certified (0 or 1). A measure without a value is empty. --plot draws
a curve or a map; --resume continues after an interruption.

  hapt sweep @notes/default --vary loop.period=1ms..4ms:4 --measure certified --out map.csv
  cat map.csv

The row 0.003,0.0 means: at 3 ms it is not certified.
"#,
    },
    Topic {
        name: "impedance",
        aliases: &["felt", "feel", "rendered", "asked", "ideal"],
        line: "the rendered impedance against frequency",
        text: r#"`hapt impedance`: the torque that resists a hand which moves as a sine, over its position, K. It is
given as an equivalent spring (Re K), damper (Im K/ω) or mass (-Re K/ω²) at each frequency; a mass
below 0 feels like a spring, a damper below 0 supplies energy. "asked" is the intended impedance for
slow motion, "ideal" that of the differential equations, without samples, hold and delay. The
device's own inertia and damping add to it. At an undamped resonance it is "unbounded".

  hapt impedance @notes/default            rendered to 10 % up to 0.301507 Hz
  hapt impedance @notes/default            the loop damps by -0.0005093 N m s/rad

That damping is -KT/2, the effect of holding the torque: the device must compensate for it.
"#,
    },
    Topic {
        name: "z-width",
        aliases: &["width", "zwidth"],
        line: "the springs and dampers that a device can render",
        text: r#"`hapt impedance --z-width` replaces the world by a spring K and a damper B to ground, and computes
which of them the device can render, at its period, delay and estimator. "passive": no passive hand
can extract energy. "stable": stable hands-off. The stable range is many times larger, and feels
stiffer; some hands may make it oscillate. "counts": friction and damping absorb the encoder's
counts.

  hapt impedance @devices/eth-wall --z-width     passive   up to 2.6 N m/rad without a damper
  hapt impedance @devices/eth-wall --z-width --plot z.svg

2.6 N m/rad is 2b/T. A longer delay, a heavier filter and a coarser encoder narrow it.
"#,
    },
    Topic {
        name: "boundary",
        aliases: &["edge", "edges", "d-decomposition", "region"],
        line: "the exact edges of stability and of passivity over two keys",
        text: r#"`hapt boundary` finds where in the plane of two keys held, free and passive change, without a grid.
Where the keys are a stiffness and a damping at one place, the edge of stability comes from its
equation: λ = 1, λ = -1, λ = e^{jφ}, solved for both keys (D-decomposition). Otherwise the edge is
traced by the change of the verdict. The verdict is computed on both sides of every point. An island
between the searched lines, five each way and the frame, can be missed.

  hapt boundary @devices/eth-wall --vary loop.delay=0..2ms --vary device.damping=0..0.01

Of a network of stations: `passive` is the edge for any clocks and any loss, `fixed` that at the
file's own times. Keys are such as links.0.stiffness and stations.left.device.damping.
"#,
    },
    Topic {
        name: "worst-hand",
        aliases: &["worst", "broken", "survived", "gap"],
        line: "the passive hand that extracts most energy: the test of the certificate",
        text: r#"`hapt worst` searches for a passive hand, a mass on a spring with some damping, that extracts energy
from the loop: by eigenvalues, exactly for the linear loop, and by runs with the whole device; then
for hands that open and grasp again. It prints the scenario, or writes it with --out.

  hapt worst @notes/default                                survived, as certified
  hapt worst @notes/wheel | grep verdict                   broken

The exit code is 1 when broken. `gap` gives the device damping that the certificate requires, and
the damping up to which such a hand breaks the linear loop. In between the answer is open: a hand
with several modes may break it, and the certificate covers all hands.

Of a network it searches for hands at all stations that draw energy together.
"#,
    },
    Topic {
        name: "energy",
        aliases: &["energy-theorem", "ledger"],
        line: "the ledger of a run, and the theorem behind `output = \"end\"`",
        text: r#"`hapt sim` integrates the work of hand, motor, damping and friction, exactly, between the samples. A
motor with positive work has driven the wheel, or returned energy that the world had stored. The
theorem: where the method keeps the stored energy with the puck held, and the torque is that at the
END of the step, a sample leaks at most K dz²/2; device damping b ≥ KT/2 compensates for it, for
every hand and every body behind the spring. This is why hapt's default is zoh with output "end".

  hapt sim @notes/released --set loop.output=end           hand gave

See passivity.
"#,
    },
];
