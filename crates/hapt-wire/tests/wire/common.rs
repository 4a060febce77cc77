//! A simulated board and its host.
#![allow(dead_code)] // Each test module uses a part of it.

use hapt_core::{Phase, SafetyProfile};
use hapt_model::{Source, World};
use hapt_wire::device::{Board, Endpoint, Measurement, Motor, WorldStorage};
use hapt_wire::{
    Command, DeviceMessage, HostMessage, MAX_FRAME_BYTES, PIECE, PROTOCOL, Reader, Refusal, Telemetry, frame, hash,
    pack,
};

/// With an encoder.
pub const BOARD: Board = Board { name: "bench", firmware: "1.2.3", externally_clocked: false, periods: [5e-5, 1e-2] };
/// Without one.
pub const EXTERNALLY_CLOCKED: Board = Board { externally_clocked: true, ..BOARD };

pub const WHEEL: &str = r#"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "5 N mm"
limit = "822.25 N mm"
encoder = 4000
[safety]
pulse = 0
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1.02 N m/rad"
"#;

pub fn world(text: &str, sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    World::read(&Source::from_text("w.toml", text), &sets).unwrap()
}

pub fn packed(world: &World) -> Vec<u8> {
    pack(&world.spec(), &world.limits(SafetyProfile::Certified), &mut [0; 4096]).unwrap().to_vec()
}

/// A message from the board.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    Hello { world: Option<u32>, sequence: u32, sample: u64, phase: Phase },
    Done(u32),
    Refused(u32, Refusal),
    Value(u32, u8, u32),
    Telemetry(Telemetry),
}

/// A host with a board on a perfect line; tests corrupt bytes themselves.
pub struct TestHost<'w> {
    pub endpoint: Endpoint<'w>,
    pub sequence: u32,
    reader: Reader<512>,
    /// The measurement of the next samples.
    pub seen: Measurement,
    /// The messages from the board that the test has not taken.
    pub received: Vec<Received>,
    /// The motor command of the last sample.
    pub motor: Motor,
}

impl<'w> TestHost<'w> {
    pub fn new(board: Board, storage: &'w mut [WorldStorage; 2]) -> Self {
        let [one, other] = storage;
        let mut host = TestHost {
            endpoint: Endpoint::new(board, one, other),
            sequence: 0,
            reader: Reader::new(),
            seen: Measurement::default(),
            received: Vec::new(),
            motor: Motor::default(),
        };
        host.send(Command::Hello { protocol: PROTOCOL });
        assert!(matches!(host.received.pop(), Some(Received::Hello { .. })));
        host
    }

    /// The frame of a command that is valid for the next 100 samples.
    pub fn framed(&mut self, command: Command) -> Vec<u8> {
        self.sequence += 1;
        self.framed_as(self.sequence, self.endpoint.next() + 100, command)
    }

    pub fn framed_as(&self, sequence: u32, not_after: u64, command: Command) -> Vec<u8> {
        frame(&HostMessage { sequence, not_after, command }, &mut [0; MAX_FRAME_BYTES]).unwrap().to_vec()
    }

    pub fn send(&mut self, command: Command) {
        let bytes = self.framed(command);
        self.put(&bytes);
    }

    /// Writes bytes to the line.
    pub fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(motor) = self.endpoint.push(*byte) {
                self.motor = motor;
            }
            self.listen();
        }
    }

    /// Takes a sample.
    pub fn sample(&mut self) -> Motor {
        let seen = self.seen;
        self.motor = self.endpoint.sample(&seen);
        self.listen();
        self.motor
    }

    fn listen(&mut self) {
        let mut room = [0; MAX_FRAME_BYTES];
        while let Some(bytes) = self.endpoint.answer(&mut room) {
            for byte in bytes {
                self.received.extend(self.reader.push::<DeviceMessage>(*byte).map(|message| match message {
                    DeviceMessage::Hello(hello) => {
                        assert_eq!((hello.board, hello.firmware), (BOARD.name, BOARD.firmware));
                        let phase = Phase::ALL[usize::from(hello.phase)];
                        let (world, sequence, sample) = (hello.world, hello.sequence, hello.sample);
                        Received::Hello { world, sequence, sample, phase }
                    }
                    DeviceMessage::Done { sequence } => Received::Done(sequence),
                    DeviceMessage::Refused { sequence, why } => Received::Refused(sequence, why),
                    DeviceMessage::Value { sequence, parameter, value } => Received::Value(sequence, parameter, value),
                    DeviceMessage::Telemetry(telemetry) => Received::Telemetry(telemetry),
                }));
            }
        }
    }

    /// The outcome of a command; a supervisor's request gets a sample.
    #[track_caller]
    pub fn ask(&mut self, command: Command) -> Result<(), Refusal> {
        self.received.clear();
        self.send(command);
        if matches!(command, Command::Arm { .. } | Command::Disarm | Command::Clear | Command::Stop)
            && self.received.is_empty()
        {
            self.sample();
        }
        match self.received.iter().find(|received| !matches!(received, Received::Telemetry(_))) {
            Some(Received::Done(sequence) | Received::Value(sequence, ..)) if *sequence == self.sequence => Ok(()),
            Some(Received::Refused(sequence, why)) if *sequence == self.sequence => Err(*why),
            other => panic!("{command:?} was answered by {other:?}"),
        }
    }

    /// Sends a world's bytes, up to the commit.
    pub fn upload(&mut self, bytes: &[u8]) -> Result<(), Refusal> {
        self.ask(Command::Begin { length: bytes.len() as u16, hash: hash(bytes) })?;
        for (i, piece) in bytes.chunks(PIECE).enumerate() {
            self.ask(Command::Piece { at: (i * PIECE) as u16, bytes: piece })?;
        }
        Ok(())
    }

    pub fn load(&mut self, bytes: &[u8]) -> Result<u32, Refusal> {
        self.upload(bytes)?;
        self.ask(Command::Commit)?;
        Ok(hash(bytes))
    }

    /// The supervisor's phase, and the hash of the running world.
    pub fn state(&mut self) -> (Phase, Option<u32>) {
        self.received.clear();
        self.send(Command::Hello { protocol: PROTOCOL });
        match self.received[..] {
            [Received::Hello { phase, world, .. }] => (phase, world),
            ref other => panic!("{other:?}"),
        }
    }

    /// Armed and at full torque, the puck at rest.
    #[track_caller]
    pub fn run(&mut self, text: &str) -> u32 {
        self.run_world(&packed(&world(text, &[])))
    }

    /// The same, from a world's bytes.
    #[track_caller]
    pub fn run_world(&mut self, bytes: &[u8]) -> u32 {
        let hash = self.load(bytes).unwrap();
        self.ask(Command::Arm { world: hash }).unwrap();
        for _ in 0..300 {
            self.heartbeat();
            self.sample();
        }
        assert_eq!(self.state().0, Phase::Running);
        hash
    }

    pub fn heartbeat(&mut self) {
        self.send(Command::Heartbeat);
    }
}

pub fn storage() -> [WorldStorage; 2] {
    [WorldStorage::EMPTY, WorldStorage::EMPTY]
}
