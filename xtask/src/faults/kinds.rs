//! The faults: the effect of each on the wires, and its right reasons.

use fastrand::Rng;
use hapt_analysis::free_growth;
use hapt_core::{Reason, Request, SafetyProfile};
use hapt_model::{Body, Coupling, Device, End, Law, Method, Output, World};
use hapt_sim::Grip;

use crate::faults::test_bench::TestBench;

hapt_core::named! {
    /// A kind of fault, with its name in the table.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Kind {
        None => "none, to compare with",
        Dropped => "one sample lost",
        Doubled => "one sample twice",
        Swapped => "two samples in the wrong order",
        Frozen => "encoder frozen",
        FrozenSwinging => "encoder frozen beside a body that swings on",
        Flipped => "one bit of the position flipped, once",
        Jump => "position jumps and stays there (up to a turn)",
        EncoderReversed => "encoder runs the other way",
        Delay => "positions 1 to 8 samples old",
        Jitter => "positions 0 to 3 samples old, at random",
        NotANumber => "NaN or infinite",
        MotorGain => "motor 0.1 to 5 times as strong",
        MotorReversed => "motor pushes the other way",
        Hit => "a hammer hits the puck",
        Unstable => "world swapped to an unstable one",
        Link => "link lost",
        Stalled => "process stalled for 6 to 300 samples",
        Clock => "clock stepped by 10 ms to an hour",
        Stop => "stop",
        ArmedReversed => "encoder or motor reversed before arming",
        ArmedDead => "encoder dead before arming",
    }
}

use Reason::{Jump, Late, Link, NotFinite, Overspeed, PortEnergy, Reversed, Slew, Stop, Stuck, Velocity, WorldEnergy};

impl Kind {
    /// Whether every such fault has to be caught.
    pub fn must_trip(self) -> bool {
        matches!(
            self,
            Kind::NotANumber
                | Kind::FrozenSwinging
                | Kind::Link
                | Kind::Stalled
                | Kind::Clock
                | Kind::Stop
                | Kind::ArmedReversed
                | Kind::ArmedDead
        )
    }

    /// Whether it is there when the loop is armed.
    pub fn before_arming(self) -> bool {
        matches!(self, Kind::ArmedReversed | Kind::ArmedDead)
    }

    /// The reasons that are right.
    pub fn right(self) -> &'static [Reason] {
        match self {
            Kind::None => &[],
            Kind::Dropped | Kind::Doubled | Kind::Swapped | Kind::Flipped | Kind::Jump => {
                &[Jump, Velocity, Overspeed, Slew]
            }
            // The puck runs away unseen, or jumps when the encoder recovers.
            Kind::Frozen => &[Stuck, Jump],
            Kind::FrozenSwinging => &[Stuck],
            Kind::EncoderReversed | Kind::MotorReversed | Kind::MotorGain => {
                &[Overspeed, Velocity, Jump, Slew, PortEnergy]
            }
            Kind::Delay => &[Overspeed, Velocity, Jump, Slew, PortEnergy],
            Kind::Jitter => &[Overspeed, Velocity, Jump, Slew, PortEnergy],
            Kind::NotANumber => &[NotFinite],
            // A delay may still charge the account.
            Kind::Hit => &[Jump, Velocity, Overspeed, Slew, PortEnergy],
            Kind::Unstable => &[PortEnergy, WorldEnergy, Overspeed, Velocity, Jump, Slew, NotFinite],
            Kind::Link => &[Link],
            Kind::Stalled | Kind::Clock => &[Late],
            Kind::Stop => &[Stop],
            Kind::ArmedReversed => &[Reversed],
            Kind::ArmedDead => &[Stuck],
        }
    }

    /// Applies the fault `age` samples after its start; returns the request at this sample.
    pub fn act(self, rng: &mut Rng, test_bench: &mut TestBench, age: u32) -> Option<Request> {
        let first = age == 0;
        let period = test_bench.world.sampling.period;
        let log = |rng: &mut Rng, from: f64, to: f64| from * (to / from).powf(rng.f64());
        let wires = &mut test_bench.wires;
        match self {
            Kind::Dropped if first => wires.missed = 1,
            Kind::Doubled => wires.frozen = first,
            Kind::Swapped => wires.age = if age == 1 { 2 } else { 0 },
            Kind::Frozen | Kind::FrozenSwinging | Kind::ArmedDead => wires.frozen = true,
            Kind::Flipped if first => wires.flipped = Some(rng.u32(0..20)),
            Kind::Jump if first => wires.offset = log(rng, 1e-4, 6.0) * if rng.bool() { 1.0 } else { -1.0 },
            Kind::EncoderReversed if first => (wires.scale, wires.offset) = (-1.0, 2.0 * test_bench.device.puck().0),
            Kind::Delay if first => wires.age = rng.usize(1..9),
            Kind::Jitter => wires.age = rng.usize(0..4),
            Kind::NotANumber if first => {
                wires.instead = Some([f64::NAN, f64::INFINITY, f64::NEG_INFINITY][rng.usize(..3)]);
            }
            Kind::MotorGain if first => wires.gain = log(rng, 0.1, 5.0),
            Kind::MotorReversed => wires.gain = -1.0,
            Kind::ArmedReversed if first => {
                if rng.bool() {
                    wires.gain = -1.0;
                } else {
                    wires.scale = -1.0;
                }
            }
            Kind::Hit if first => {
                let inertia = log(rng, 1e-4, 1e-2);
                let stiffness = (log(rng, 0.1, 1.0) / period).powi(2) * inertia;
                test_bench.device.hold(Some(Grip { inertia, damping: 0.0, stiffness }));
                let place = test_bench.device.puck().0;
                test_bench.device.intend(place + log(rng, 0.1, 3.0));
            }
            // It bounces off.
            Kind::Hit if age == 5 => test_bench.device.hold(None),
            Kind::Unstable if first => {
                let world = unstable(rng, &test_bench.world);
                // Such a world fits: it compiles.
                let _ = test_bench.swap(&world, SafetyProfile::Uncertified);
            }
            Kind::Link => wires.cut = true,
            Kind::Stalled if first => wires.missed = log(rng, 6.0, 300.0) as u32,
            Kind::Clock if first => wires.late = log(rng, 0.01f64.max(6.0 * period), 3600.0),
            Kind::Stop if first => return Some(Request::Stop),
            _ => {}
        }
        None
    }
}

/// A world on the same device that grows with the puck held, and with it free: forward Euler, undamped.
fn unstable(rng: &mut Rng, world: &World) -> World {
    let mut world = world.clone();
    (world.sampling.method, world.sampling.output, world.sampling.advance) = (Method::ForwardEuler, Output::Start, 0);
    let Device { inertia, .. } = world.device;
    world.names = vec!["b0".into()];
    world.bodies = vec![Body { inertia, position: 0.1, velocity: 0.0 }];
    let mut angle = 0.1 + rng.f64();
    loop {
        let stiffness = inertia * (angle / world.sampling.period).powi(2);
        let law = Law::Spring { stiffness, rest: 0.0 };
        world.couplings = vec![Coupling { first: End::Puck, second: End::Body(0), law, limit: None }];
        // High damping keeps it stable for a while.
        if free_growth(&world).ok().flatten().is_some_and(|growth| growth * world.sampling.period > 0.01) {
            return world;
        }
        angle *= 1.5;
    }
}
