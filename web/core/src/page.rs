//! Everything that runs in a page, sample after sample.

use alloc::boxed::Box;
use alloc::vec::Vec;

use hapt_core::{Controller, ControllerState, Error, Limits, Output, Phase, Reading, Reason, Request};
use hapt_plant::{Grip, Script, VirtualDevice, spec, stored_energy};
use hapt_wire::Stored;
use serde::{Deserialize, Serialize};

use crate::slot::{Slot, WorldDraft};

/// Room for a world, as on the desktop.
const BODIES: usize = 32;
const COUPLINGS: usize = 64;
const COUNTS: usize = 257;
/// The frame's columns before the bodies': the puck's true position and velocity, the measured ones, torque, command, what the motor is
/// asked for, and the energy that the world stores; SI.
pub const OWN: usize = 8;
/// The frame's columns; after [`OWN`] each body has its position and its velocity.
pub const COLUMNS: usize = OWN + 2 * BODIES;

type World = Controller<f64, BODIES, COUPLINGS, COUNTS>;

/// What a page needs beside the world's bytes. As bytes: postcard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// The device.
    pub device: spec::DeviceSpec,
    /// What the supervisor holds the loop to.
    pub limits: Limits,
    /// The output of a method that may have any.
    pub output: Output,
    /// The scenarios' hands, each for so many s.
    pub scenarios: Vec<(spec::Hand, f64)>,
}

/// A world that runs: the loop under its supervisor on the exact device, in whatever hand holds it.
pub struct Page {
    draft: WorldDraft,
    controller: World,
    state: ControllerState<f64, BODIES, COUPLINGS, COUNTS>,
    device: VirtualDevice,
    /// The device's coordinate of the world's 0, in rad (linear: m).
    zero: f64,
    request: Option<Request>,
    samples: u64,
    frame: [[f64; COLUMNS]; 3],
}

impl Page {
    /// From a world's bytes and a setup's, disarmed; `None` where they are none, or what they say cannot run.
    pub fn new(world: &[u8], setup: &[u8]) -> Option<Box<Self>> {
        let stored = Stored::<BODIES, COUPLINGS>::read(world).ok()?;
        let draft = WorldDraft::new(&stored.spec(), postcard::from_bytes(setup).ok()?);
        let controller = compile(&draft).ok()?;
        Some(Box::new(Page {
            state: controller.start(),
            device: VirtualDevice::new(&draft.setup.device),
            zero: 0.0,
            request: None,
            samples: 0,
            frame: [[0.0; COLUMNS]; 3],
            draft,
            controller,
        }))
    }

    /// How many bodies the world has.
    pub fn bodies(&self) -> usize {
        self.controller.world().bodies()
    }

    /// The output as it is now: some methods have but one.
    pub fn output(&self) -> Output {
        self.draft.spec().output
    }

    /// Where the supervisor stands, why, and what would have tripped on a real device.
    pub fn phase(&self) -> (Phase, Option<Reason>, Option<Reason>) {
        let state = &self.state.supervisor;
        (state.phase, state.reason, state.warning)
    }

    /// For each column the last value, the least and the greatest of the samples that [`Page::run`] has last taken.
    pub fn frame(&self) -> &[[f64; COLUMNS]; 3] {
        &self.frame
    }

    /// Something for the supervisor, at the next sample.
    pub fn ask(&mut self, request: Request) {
        self.request = Some(request);
    }

    /// The puck at rest at 0, the world at its start, and no torque.
    pub fn restart(&mut self) {
        self.device.restart();
        (self.state, self.zero, self.request) = (self.controller.start(), 0.0, None);
    }

    /// The visitor's hand takes hold, or, with `None`, whoever holds lets go.
    pub fn hold(&mut self, grip: Option<Grip>) {
        self.device.hold(grip);
    }

    /// Where the visitor's hand means to be, in rad (linear: m).
    pub fn intend(&mut self, position: f64) {
        self.device.intend(position);
    }

    /// A scenario's hand takes hold; `false` where there is no such scenario.
    pub fn begin(&mut self, scenario: usize) -> bool {
        let Some((hand, duration)) = self.draft.setup.scenarios.get(scenario) else { return false };
        self.device.begin(&mut Script::new(hand, *duration, self.controller.period()));
        true
    }

    /// Whether anybody holds the puck.
    pub fn is_held(&self) -> bool {
        self.device.is_held()
    }

    /// Changes one number of the world, of its coupling or body `index`, between two samples: bodies go on where they are, and the torque
    /// fades over. `false`, and nothing is changed, where there is no such number or the core refuses it.
    pub fn set(&mut self, slot: Slot, index: usize, value: f64) -> bool {
        let mut draft = self.draft.clone();
        if !draft.change(slot, index, value) {
            return false;
        }
        let Ok(controller) = compile(&draft) else { return false };
        let state = controller.transfer(&self.controller, &self.state, Some, Some);
        self.device.refit(&mut VirtualDevice::new(&draft.setup.device));
        (self.controller, self.state, self.draft) = (controller, state, draft);
        true
    }

    /// Takes so many samples.
    pub fn run(&mut self, samples: u32) {
        for sample in 0..samples {
            self.sample(sample == 0);
        }
    }

    fn sample(&mut self, is_first: bool) {
        if self.samples > 0 {
            self.device.travel();
        }
        self.samples += 1;
        let (place, velocity) = self.device.puck();
        let (position, velocity) = match place.is_finite() && velocity.is_finite() {
            true if self.zero == 0.0 => (place, velocity),
            true => (self.zero + place, velocity),
            // It has run away: that is shown once, as a fault, and the device begins anew.
            false => {
                self.device.restart();
                (f64::NAN, 0.0)
            }
        };
        let announced = self.device.announced();
        let reading = Reading { position, velocity, announced, late: 0.0, missed: 0, silent: 0.0 };
        let request = self.request.take();
        let guarded = self.controller.step(&mut self.state, &reading, request);
        self.device.command(guarded.output);
        // Where it is armed is 0, for the hand too.
        let by = self.state.supervisor.offset - self.zero;
        if by != 0.0 {
            self.device.shift(by);
            self.zero = self.state.supervisor.offset;
        }
        let position = self.device.puck().0;

        let Page { state, draft, frame: [last, least, greatest], .. } = self;
        let bodies = self.controller.world().bodies();
        let world = &state.world;
        let mut states = [(0.0, 0.0); BODIES];
        for (place, (w, v)) in states.iter_mut().zip(world.now.position.iter().zip(&world.now.velocity)) {
            *place = (*w, *v);
        }
        let states = states.get(..bodies).unwrap_or(&[]);
        let spec = draft.spec();
        let seen = guarded.sample;
        let own: [f64; OWN] = [
            position,
            velocity,
            seen.puck.position,
            seen.puck.velocity,
            seen.torque,
            seen.command,
            guarded.output,
            stored_energy(spec.bodies, spec.couplings, position, states, &world.bristles),
        ];
        let values = own.into_iter().chain(states.iter().flat_map(|&(w, v)| [w, v]));
        for (((value, last), least), greatest) in values.zip(last).zip(least).zip(greatest) {
            *last = value;
            // What is no number stays: it is worth being seen.
            if is_first || value < *least || value.is_nan() {
                *least = value;
            }
            if is_first || value > *greatest || value.is_nan() {
                *greatest = value;
            }
        }
    }
}

fn compile(draft: &WorldDraft) -> Result<World, Error> {
    World::new(&draft.spec(), &draft.setup.limits)
}
