//! Inputs that are the same everywhere, and the sum over all outputs of a loop for them.
//!
//! This file is compiled twice, into the firmware and into the program that tests it on a PC: equal sums show that two processors have the
//! same bits in every state and every torque.

use hapt_core::{CertifiedTime, Controller, Heat, Limits, Loop, Reading, Request, Spec, State};
use hapt_wire::Stored;

/// A microcontroller's capacity.
pub const BODIES: usize = 4;
/// Couplings.
pub const COUPLINGS: usize = 8;
/// Remembered counts.
pub const COUNTS: usize = 17;

/// A loop in it.
pub type World = Loop<f32, BODIES, COUPLINGS, COUNTS>;

/// A puck that swings and is pushed about, so that counts, walls and limits are met: only additions and products, which every processor
/// rounds alike.
pub struct Trace {
    random: u32,
    rate: f32,
    position: f32,
    step: f32,
}

impl Trace {
    /// For a loop of this period in s.
    pub fn new(period: f32) -> Self {
        Trace { random: 1, rate: 1.0 / period, position: 0.0, step: 0.0 }
    }

    /// Position in rad (linear: m) and velocity of the next sample.
    #[inline]
    pub fn next(&mut self) -> (f32, f32) {
        // Knuth's linear congruential generator, modulo 2^32; its upper bits, on [-1/2, 1/2).
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let push = (self.random >> 8) as f32 / 16_777_216.0 - 0.5;
        self.step = 0.999 * self.step - 0.0004 * self.position + 0.002 * push;
        self.position += self.step;
        (self.position, self.step * self.rate)
    }
}

/// FNV-1a over the bits of numbers (Fowler, Noll and Vo).
pub struct Sum(pub u64);

impl Sum {
    /// Of nothing.
    pub const EMPTY: Sum = Sum(0xcbf2_9ce4_8422_2325);

    fn add(&mut self, bits: u32) {
        self.0 = (self.0 ^ u64::from(bits)).wrapping_mul(0x0000_0100_0000_01b3);
    }

    fn numbers(&mut self, numbers: &[f32]) {
        for x in numbers {
            self.add(x.to_bits());
        }
    }

    fn bodies(&mut self, state: &State<f32, BODIES, COUPLINGS, COUNTS>, bodies: usize) {
        for (w, v) in state.now.position.iter().zip(&state.now.velocity).take(bodies) {
            self.numbers(&[*w, *v]);
        }
    }
}

/// The sums of `samples` samples of a world, bare and under a supervisor, and whether every number was finite. `None` for bytes that are
/// not a world, or a world that exceeds this capacity.
pub fn sums(bytes: &[u8], samples: u32) -> Option<(Sum, Sum, bool)> {
    let stored = Stored::<BODIES, COUPLINGS>::read(bytes).ok()?;
    let spec = stored.spec();
    let world = World::new(&spec).ok()?;
    let (bare, finite) = bare(&world, samples);
    Some((bare, guarded(&spec, samples)?, finite))
}

fn bare(world: &World, samples: u32) -> (Sum, bool) {
    let mut sum = Sum::EMPTY;
    let mut finite = true;
    let mut state = world.start();
    let mut trace = Trace::new(world.period());
    for _ in 0..samples {
        let (position, velocity) = trace.next();
        let sample = world.step(&mut state, position, velocity);
        sum.numbers(&[sample.puck.position, sample.puck.velocity, sample.torque, sample.command]);
        sum.bodies(&state, world.bodies());
        finite &= sample.torque.is_finite() && state.now.position.iter().all(|w| w.is_finite());
    }
    (sum, finite)
}

/// Armed, disarmed, stopped and cleared again and again.
fn guarded(spec: &Spec, samples: u32) -> Option<Sum> {
    let controller = Controller::<f32, BODIES, COUPLINGS, COUNTS>::new(spec, &LIMITS).ok()?;
    let mut sum = Sum::EMPTY;
    let mut state = controller.start();
    let mut trace = Trace::new(controller.period());
    for k in 0..samples {
        let (position, velocity) = trace.next();
        let request = match k % 1000 {
            0 | 500 => Some(Request::Arm),
            400 => Some(Request::Disarm),
            900 => Some(Request::Stop),
            950 => Some(Request::Clear),
            _ => None,
        };
        let reading = Reading { position, velocity, announced: false, late: 0.0, missed: 0, silent: 0.0 };
        let guarded = controller.step(&mut state, &reading, request);
        let supervisor = &state.supervisor;
        sum.numbers(&[guarded.output, guarded.sample.torque, supervisor.account(), supervisor.made()]);
        sum.bodies(&state.world, controller.world().bodies());
        sum.add(guarded.phase as u32);
        sum.add(guarded.reason.map_or(0, |reason| 1 + reason as u32));
        sum.add(guarded.warning.map_or(0, |reason| 1 + reason as u32));
    }
    Some(sum)
}

/// Those of a haptic wheel of a course, wide enough for the trace.
pub const LIMITS: Limits = Limits {
    fade: 0.05,
    velocity: f64::INFINITY,
    jump: f64::INFINITY,
    overspeed: f64::INFINITY,
    stuck: 0.2,
    stuck_torque: 0.1,
    torque: 0.82225,
    slew: f64::INFINITY,
    motor: Heat { rms: 0.6, time: 30.0 },
    driver: Heat { rms: 0.7, time: 1.0 },
    stall: f64::INFINITY,
    time: CertifiedTime::NOT_STATED,
    link: f64::INFINITY,
    link_faults: true,
    energy: 0.1,
    world_trips: false,
    port_trips: false,
    pulse: 0.0,
    brake: 1e-3,
    recentre: 0.0,
    zero_where_armed: true,
    announcements: false,
    inertia: 6.4e-4,
    damping: 1.2e-3,
    friction: 0.0,
    delay: 0.0,
};
