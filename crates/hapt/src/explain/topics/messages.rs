//! Terms of messages, and of world files.

use super::Topic;

pub const TOPICS: &[Topic] = &[
    Topic {
        name: "not-finite",
        aliases: &["stops-being-finite", "overflow", "nan", "infinity"],
        line: "\"the run stops being finite\": the loop diverged",
        text: r#"The numbers have left the range of double precision, because an unstable loop grew for too long. The
run ends there with exit code 3, and a file keeps its rows up to the last finite one. The limit
clamps the motor's torque and does not act on the virtual bodies, so it does not help here. Check
the loop, then change the method or the period:

  hapt check @notes/euler --set loop.period=1s                     unstable
  hapt check @notes/default --set loop.period=1s | grep ^held      marginal
"#,
    },
    Topic {
        name: "units",
        aliases: &["unit", "dimension", "quantity", "quantities"],
        line: "numbers with units, and the angle as a dimension",
        text: r#"A quantity is "1 ms", "45 deg", "17.8 N mm/deg", "6.4e-4 kg m^2", or a bare number in SI (rad, m, s,
kg, N, N m). Units: rad deg ° rev rpm m cm mm um s ms us Hz kHz N mN kg g J Nm Nmm mNm, and in kgf
gf lbf oz (a force: oz in); products by a space, · or *, quotients by / (a/b c is (a/b)·c), powers
by ^2 or ². The angle is a dimension: N m is a torque, N m/rad a stiffness, and neither is accepted
for the other, because a forgotten degree is a factor of 57.3. Only an inertia has both forms:
kg m^2 or N m s^2/rad. A bare number far from what devices have is taken, with a warning that names
the unit probably meant. A count is one of the file's encoder: "100 count", "0.2 mNm/count".

  hapt sim @notes/wheel --set loop.period=2ms              2 ms a sample
  hapt sim @notes/wheel --set 'couplings.0.stiffness=1 J/rad'
"#,
    },
    Topic {
        name: "unknown-key",
        aliases: &["key", "keys", "did-you-mean"],
        line: "a key that does not exist at that place of the world file",
        text: r#"Every key has a name and a place, so that a misspelt key is an error and not a default. The message
names the nearest key, or the place of the key. A key of one kind of coupling or hand is unknown to
the others. All keys, with docs and defaults, for your editor:

  hapt explain schema                                              "compensating"
  hapt init my-world --template wall

An editor with taplo (Even Better TOML) reads the schema by the file's first line, #:schema.
"#,
    },
    Topic {
        name: "samples",
        aliases: &["duration", "samples-limit", "too-many-samples"],
        line: "at most 10^10 samples in a scenario",
        text: r#"A scenario has round(duration/T) + 1 samples, from t = 0 to the duration. More than 10^10 are
refused for every output: usually a unit is wrong, such as "1 us" for "1 ms". The memory of a run
does not depend on its length; a CSV file has a line a sample.

  hapt sim @notes/euler --set scenarios.step.duration=1s   1 s at 1 ms a sample
"#,
    },
    Topic {
        name: "path",
        aliases: &["file", "csv", "path-file"],
        line: "a hand that follows a file",
        text: r#"hand = { kind = "path", file = "turn.csv" }: two columns, times increasing, straight in between. The
header has the unit, time_s,puck_deg for a position; a torque hand's path has time_s,torque_Nmm. The
file is in the folder of the world file or below it; for standard input and built-in worlds, in the
current folder. # begins a comment.

  hapt sim @notes/wheel --out runs

The columns time_s and puck_rad of such a run, in a separate file, are a path again.
"#,
    },
    Topic {
        name: "signs",
        aliases: &["sign", "q", "between"],
        line: "the sign convention of torques",
        text: r#"A torque is the torque ON THE PUCK, positive when it pushes toward larger angles. A coupling acts on
q, its first end relative to the second; its torque acts on the first end, the opposite on the
second. So `between = ["puck", "wheel"]` with a spring gives -k (puck - wheel) on the puck.

  hapt sim @notes/wheel                                    800 N mm

The notes' (2.18) and (2.22) print the torque on the virtual wheel under the name of the reaction:
with that sign the released wheel runs away.
"#,
    },
    Topic {
        name: "exit-codes",
        aliases: &["exit-code", "codes", "exit"],
        line: "how a command ends: 0, 1, 2, 3, 130, 143",
        text: r#"0     done; for `hapt check`: certified. Also when the reader of the output closes it early
1     `hapt check` has not certified the loop: unstable or not passive; `hapt worst` broke it
2     bad usage or bad input: nothing was done
3     the system failed, or a run stopped being finite: its file ends before that
130   interrupted (Ctrl-C): unfinished files are removed
143   terminated: the same

  hapt check @notes/euler            unstable
"#,
    },
];
