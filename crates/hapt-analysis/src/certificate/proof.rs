//! The proof file of a check: what makes its claims checkable without hapt (docs/theory.md, "Proof files").

use hapt_model::World;
use serde::Serialize;

use crate::certificate::check::{Check, Status};
use crate::error::Error;
use crate::passivity::timing::Timing;
use crate::theorems::witness::{Witness, Witnessed, exact, witness};

/// The claims that hold, those with a witness and those without. It serialises to the proof file.
#[derive(Clone, Debug, Serialize)]
pub struct Proof {
    format: u32,
    status: Status,
    /// The parts of the device that the claims are not about.
    left_out: Vec<&'static str>,
    claims: Vec<Witnessable>,
    without_witness: Vec<Bare>,
}

/// A claim, and what shows it. Numbers are exact decimals.
#[derive(Clone, Debug, Serialize)]
struct Witnessable {
    claim: &'static str,
    theorem: &'static str,
    times: Times,
    device_damping: String,
    required_damping: String,
    witness: Witness,
}

#[derive(Clone, Debug, Serialize)]
struct Times {
    period: String,
    intervals: [String; 2],
    delay: [String; 2],
    lag: [String; 2],
}

/// A claim without a witness, and the theorems that make it.
#[derive(Clone, Debug, Serialize)]
struct Bare {
    claim: &'static str,
    theorem: String,
}

/// The proof of what `check` claims of `world`.
///
/// ```
/// use hapt_analysis::{check, proof};
/// use hapt_model::{Source, World};
///
/// let file = r#"
/// loop.period = "1 ms"
/// device = { inertia = "6.4e-4 kg m^2", damping = "1.2e-3 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "2 N m/rad"
/// "#;
/// let world = World::read(&Source::from_text("spring.toml", file), &[])?;
/// let proof = serde_json::to_value(proof(&world, &check(&world)?)?)?;
/// assert_eq!(proof["claims"][2]["claim"], "passive");
/// assert_eq!(proof["claims"][2]["witness"]["laws"][0]["stiffness"], "2");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`crate::check()`].
pub fn proof(world: &World, check: &Check) -> Result<Proof, Error> {
    let device = &world.device;
    let left_out =
        [("encoder", device.encoder.is_some()), ("levels", device.levels.is_some()), ("limit", device.limit.is_some())];
    let (mut claims, mut without_witness) = (Vec::new(), Vec::new());
    for claim in ["held", "free", "passive"] {
        let made = check.theorems.iter().filter(|theorem| theorem.claims.contains(&claim));
        let theorems: Vec<&str> = made.map(|theorem| theorem.id).collect();
        if theorems.is_empty() {
            continue;
        }
        match witness(world, claim == "held")? {
            Some(Witnessed { theorem, required, witness }) => claims.push(Witnessable {
                claim,
                theorem: theorem.id,
                times: Times::of(world),
                device_damping: exact(device.damping_range()[0]),
                required_damping: exact(required),
                witness,
            }),
            None => without_witness.push(Bare { claim, theorem: theorems.join(", ") }),
        }
    }
    let left_out = left_out.into_iter().filter_map(|(part, is_there)| is_there.then_some(part)).collect();
    Ok(Proof { format: 1, status: check.status, left_out, claims, without_witness })
}

impl Times {
    fn of(world: &World) -> Times {
        let timing = Timing::of(world);
        let exact = |range: [f64; 2]| range.map(exact);
        Times {
            period: self::exact(timing.period),
            intervals: exact(timing.intervals()),
            delay: exact(timing.delay),
            lag: exact(timing.lag),
        }
    }
}
