//! What else can be asked of a loop.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "sweep",
        aliases: &["vary", "measure", "measures", "map"],
        line: "many worlds at once: a table, and a map",
        text: r#"`hapt sweep` goes through every combination of a few keys and writes a row for each: KEY=FROM..TO:N,
or :N:log for equal ratios. Measures of a run are peak_torque, final_energy and settling_time; of
the loop held_growth_per_s, free_growth_per_s, held_verdict, free_verdict (-1 stable, 0 marginal, 1
unstable), required_damping and certified (0 or 1). A measure without a value is empty. --plot draws
a curve or a map; --resume goes on after an interruption.

  hapt sweep @notes/default --vary loop.period=1ms..4ms:4 --measure certified --out map.csv
  cat map.csv

The row 0.003,0.0 says: at 3 ms it is not certified.
"#,
    },
    Topic {
        name: "impedance",
        aliases: &["felt", "feel", "rendered", "asked", "ideal"],
        line: "what a hand that swings feels, against frequency",
        text: r#"`hapt impedance`: the torque that resists a hand which moves as a sine, over its position, K. It is
said as the one spring (Re K), damper (Im K/ω) or mass (-Re K/ω²) that would do alone there; a mass
below 0 is felt as a spring, a damper below 0 gives energy. "asked" is what a slow hand is to feel,
"ideal" what the differential equations do, without samples, hold and delay. The device's own
inertia and damping come to it. At a resonance that nothing damps it is "unbounded".

  hapt impedance @notes/default            rendered to 10 % up to 0.301507 Hz
  hapt impedance @notes/default            the loop damps by -0.0005093 N m s/rad

That damping is -KT/2, the price of holding the torque: the device has to pay it.
"#,
    },
    Topic {
        name: "z-width",
        aliases: &["width", "zwidth"],
        line: "the springs and dampers that a device can stand for",
        text: r#"`hapt impedance --z-width` puts the world away and asks which spring K and damper B to ground the
device could render, at its period, delay and estimator. "passive": no passive hand can draw energy
from it. "stable": nothing grows when nobody holds it. The stable ones are many times more, and
feel stiffer; a hand may shake them. "counts" is up to where the encoder's steps are swallowed.

  hapt impedance @devices/eth-wall --z-width     passive   up to 2.6 N m/rad without a damper
  hapt impedance @devices/eth-wall --z-width --plot z.svg

2.6 N m/rad is 2b/T. A longer delay, a heavier filter and a coarser encoder narrow it.
"#,
    },
    Topic {
        name: "boundary",
        aliases: &["edge", "edges", "d-decomposition", "region"],
        line: "the exact edge of stability and of passivity over two keys",
        text: r#"`hapt boundary` finds where in the plane of two keys held, free and passive change, without a grid.
Where the keys are a stiffness and a damping at one place, the edge of stability comes from its
equation: λ = 1, λ = -1, λ = e^{jφ}, solved for both keys (D-decomposition). Else the edge is
followed by the change of the verdict. Beside every point the verdict is asked on both sides. An
island between the lines that are searched, five each way and the frame, can be missed.

  hapt boundary @devices/eth-wall --vary loop.delay=0..2ms --vary device.damping=0..0.01
"#,
    },
    Topic {
        name: "worst-hand",
        aliases: &["worst", "broken", "survived", "gap"],
        line: "the passive hand that draws most energy: the other side of the certificate",
        text: r#"`hapt worst` looks for a passive hand, a mass on a spring with some damping, that draws energy from
the loop: by eigenvalues, which is exact for the linear loop, and by runs with all that the device
has; then for hands that open and take hold again. It prints the scenario, or writes it by --out.

  hapt worst @notes/default                                survived, as certified
  hapt worst @notes/wheel | grep verdict                   broken

The exit code is 1 when broken. `gap` says what the certificate asks of the device's damping, and up
to what such a hand breaks the linear loop. In between nothing is known: a hand of several swings
may break it, and the certificate covers all of them.
"#,
    },
    Topic {
        name: "energy",
        aliases: &["energy-theorem", "ledger"],
        line: "the ledger of a run, and the theorem behind `output = \"end\"`",
        text: r#"`hapt sim` sums what hand and motor gave and what damping and friction took, exactly, between the
samples. A motor that gave energy has shaken the wheel, or returned what the world had stored.
The theorem: where the method keeps the stored energy with the puck held, and the torque is that at
the END of the step, a sample leaks at most K dz²/2; device damping b ≥ KT/2 pays for it, whatever
the hand does and whatever hangs on the spring. It is why hapt's default is zoh with output "end".

  hapt sim @notes/released --set loop.output=end           hand gave

See passivity.
"#,
    },
];
