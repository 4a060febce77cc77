//! `hapt wheel`: its refusals. `cargo xtask guest` attaches it to a kernel, and plays every effect.

use std::path::Path;

use crate::common::{folder, hapt};

const RIG: &str = r#"
loop.period = "1 ms"
device.inertia = "0.02 kg m^2"
device.damping = "0.05 N m s/rad"
device.limit = "5 N m"
"#;

const COULOMB: &str = r#"
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
torque = "0.1 N m"
"#;

#[test]
fn what_cannot_be_a_wheel_is_refused_with_the_reason_and_leaves_nothing() {
    let stiff = format!(
        "{RIG}\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"200 N m/rad\"\n"
    );
    let linear = "motion = \"linear\"\nloop.period = \"1 ms\"\ndevice.inertia = \"1 kg\"\ndevice.limit = \"5 N\"\n";
    let network = "[stations.left]\nworld = \"rig.toml\"\n[stations.right]\nworld = \"rig.toml\"\n\
                   [[links]]\nkind = \"spring\"\nbetween = [\"left\", \"right\"]\nstiffness = \"1 N m/rad\"\nage_max = \"40 ms\"\n";
    let at = folder(&[
        ("rig.toml", RIG),
        ("stiff.toml", &stiff),
        ("coulomb.toml", &format!("{RIG}\n{COULOMB}")),
        ("linear.toml", linear),
        ("free.toml", &RIG.replace("device.limit = \"5 N m\"\n", "")),
        ("pair.toml", network),
    ]);
    let cases: &[(&[&str], &[&str])] = &[
        (&["rig.toml", "--range", "0 deg"], &["--range", "must be positive"]),
        (&["rig.toml", "--range=-900 deg"], &["--range", "must be positive"]),
        (&["rig.toml", "--range", "1e300 rad"], &["--range 1e300 rad", "1° to 36000°"]),
        (&["--range", "1e300 rad"], &["--range 1e300 rad", "1° to 36000°"]),
        (&["rig.toml", "--range", "0.5 deg", "--page"], &["--range 0.5 deg", "1° to 36000°"]),
        (&["rig.toml", "--range", "3 N"], &["--range", "an angle"]),
        (&["rig.toml", "--duration", "1 deg"], &["--duration", "a time"]),
        (&["rig.toml", "--device", "hapt:/dev/ttyACM0"], &["--device", "a board runs its loop by itself"]),
        (&["rig.toml", "--device", "joystick:0"], &["joystick"]),
        (&["rig.toml", "--set", "loop.peroid=2ms"], &["peroid"]),
        (&["nothing.toml"], &["nothing.toml"]),
        (&["linear.toml"], &["linear", "a wheel turns"]),
        (&["free.toml"], &["device.limit", "the largest torque"]),
        (&["stiff.toml"], &["needs 0.1000 N m s/rad of device.damping", "0.0500 at least", "hapt check"]),
        (&["coulomb.toml"], &["whatever the damping", "hapt check"]),
        (&["pair.toml"], &["pair.toml", "is a network"]),
        (&["rig.toml", "--log", "rig.toml"], &["rig.toml"]),
    ];
    for (args, says) in cases {
        let words: Vec<&str> = ["wheel"].iter().chain(*args).copied().collect();
        hapt(at.path(), &words).refused(2, says);
    }
    assert_eq!(std::fs::read_to_string(at.path().join("rig.toml")).unwrap(), RIG);
}

#[test]
fn without_the_kernels_module_it_says_which_one_to_load() {
    if Path::new("/sys/devices/platform/vhci_hcd.0").exists() {
        println!("SKIPPED: this kernel has the module");
        return;
    }
    let at = folder(&[("rig.toml", RIG)]);
    for words in [&["wheel"][..], &["wheel", "rig.toml", "--log", "run.mcap"]] {
        hapt(at.path(), words).refused(3, &["modprobe vhci-hcd"]);
    }
    assert!(!at.path().join("run.mcap").exists());
}
