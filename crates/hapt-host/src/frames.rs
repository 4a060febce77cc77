//! The telemetry: a binary frame sixty times a second, with the last, the smallest and the largest value of every column since the frame
//! before, so that no peak of a loop at 1 kHz is lost on a page at 60 Hz.
//!
//! Little-endian: u8 version = 1, u8 kind = 1, u16 columns, u32 generation, f64 time of the last sample in s; then for each column f32
//! last, f32 smallest, f32 largest.

use hapt_model::World;
use hapt_sim::{Signal, body_columns, world_energy};

use crate::messages::ColumnInfo;
use crate::session::Sample;

/// Bytes before the columns.
pub const HEAD: usize = 16;
/// Gets a signal from a sample.
pub type Get = fn(&Sample<'_>) -> f64;

/// The columns before those of the bodies, which take two each, position and velocity, and of the couplings, each its torque on its first end.
///
/// They are a run's columns without the time, and with the output in place of the applied torque, which a board does not report; then the energy.
pub const COLUMNS: [(Signal, Get); 8] = [
    (Signal::PUCK, |sample| sample.position),
    (Signal::PUCK_VELOCITY, |sample| sample.record.velocity),
    (Signal::MEASURED, |sample| sample.record.measured),
    (Signal::MEASURED_VELOCITY, |sample| sample.record.measured_velocity),
    (Signal::TORQUE, |sample| sample.made(sample.record.torque)),
    (Signal::COMMAND, |sample| sample.made(sample.record.command)),
    (Signal::OUTPUT, |sample| sample.record.output),
    (Signal::ENERGY, |sample| sample.made(world_energy(sample.world, sample.position, sample.bodies(), &[]))),
];

/// The columns of a world's telemetry.
pub fn columns_of(world: &World) -> Vec<ColumnInfo> {
    let own = COLUMNS.iter().map(|(signal, _)| signal.column(world.motion));
    let all = own.chain(body_columns(world)).map(|column| ColumnInfo { name: column.name, unit: column.unit });
    let torque = Signal::TORQUE.column(world.motion);
    let couplings = (0..world.couplings.len())
        .map(|index| ColumnInfo { name: format!("coupling_{index}_{}", torque.name), unit: torque.unit });
    all.chain(couplings).collect()
}

/// The columns since the last frame.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Last, smallest, largest.
    columns: Vec<[f64; 3]>,
    /// Of the last sample.
    time: f64,
    generation: u32,
    /// Whether a torque was possible in the last sample.
    is_live: bool,
    /// The displayed positions and velocities of the bodies.
    bodies: Vec<(f64, f64)>,
}

impl Frames {
    /// Adds a sample. While no torque is possible the bodies keep the positions that they had when the torque ended, until the world is armed again or the
    /// device is restarted.
    pub fn add(&mut self, sample: &Sample<'_>) {
        let Sample { generation, time, record, .. } = *sample;
        let is_live = record.phase.is_active();
        if is_live || record.announced || self.bodies.len() != sample.bodies().len() {
            self.bodies.clear();
            self.bodies.extend_from_slice(sample.bodies());
        } else {
            self.bodies.iter_mut().for_each(|(_, velocity)| *velocity = 0.0);
        }
        let own = COLUMNS.iter().map(|(_, get)| get(sample));
        let bodies = self.bodies.iter().flat_map(|&(position, velocity)| [position, velocity]);
        let (spec, puck) = (sample.world.spec(), (sample.position, record.velocity));
        let torques =
            (0..spec.couplings.len()).map(|index| sample.made(spec.coupling_torque(index, puck, sample.bodies())));
        let values = own.chain(bodies).chain(torques);
        // Extremes of another world, or of the time before arming, are dropped.
        if generation != self.generation || is_live && !self.is_live {
            self.columns.clear();
        }
        (self.time, self.generation, self.is_live) = (time, generation, is_live);
        if self.columns.is_empty() {
            self.columns.extend(values.map(|value| [value; 3]));
            return;
        }
        for ([last, smallest, largest], value) in self.columns.iter_mut().zip(values) {
            // A NaN stays, so that the page shows it.
            *last = value;
            *smallest = if value < *smallest || value.is_nan() { value } else { *smallest };
            *largest = if value > *largest || value.is_nan() { value } else { *largest };
        }
    }

    /// The last, the smallest and the largest value of each column, in the frame's order.
    pub fn columns(&self) -> &[[f64; 3]] {
        &self.columns
    }

    /// Takes the frame and starts the next; `None` when there was no sample.
    pub fn take(&mut self) -> Option<Vec<u8>> {
        if self.columns.is_empty() {
            return None;
        }
        let mut frame = Vec::with_capacity(HEAD + 12 * self.columns.len());
        frame.extend([1, 1]);
        frame.extend((self.columns.len() as u16).to_le_bytes());
        frame.extend(self.generation.to_le_bytes());
        frame.extend(self.time.to_le_bytes());
        for value in self.columns.drain(..).flatten() {
            frame.extend((value as f32).to_le_bytes());
        }
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use hapt_core::Phase;
    use hapt_rt::Record;
    use hapt_sim::Measures;

    use super::*;
    use crate::testing::{record, world};

    fn add(frames: &mut Frames, world: &World, generation: u32, time: f64, record: &Record) {
        frames.add(&Sample { world, generation, time, position: record.position, record });
    }

    fn read(frame: &[u8]) -> (u32, f64, Vec<[f32; 3]>) {
        let numbers: Vec<f32> = frame[HEAD..].chunks(4).map(|x| f32::from_le_bytes(x.try_into().unwrap())).collect();
        let columns = numbers.chunks(3).map(|x| [x[0], x[1], x[2]]).collect();
        let generation = u32::from_le_bytes(frame[4..8].try_into().unwrap());
        (generation, f64::from_le_bytes(frame[8..16].try_into().unwrap()), columns)
    }

    #[test]
    fn a_frame_has_the_last_the_smallest_and_the_largest_of_every_column() {
        let world = world();
        let mut frames = Frames::default();
        assert_eq!(frames.take(), None);
        for (sample, (position, wheel)) in [(0.0, 1.0), (-2.0, 3.0), (1.0, 2.0)].into_iter().enumerate() {
            let record = record(sample as u64, |r| (r.position, r.bodies[0].0) = (position, wheel));
            add(&mut frames, &world, 7, sample as f64, &record);
        }
        let frame = frames.take().unwrap();
        assert_eq!(frame[..4], [1, 1, 10 + world.couplings.len() as u8, 0]);
        let (generation, time, columns) = read(&frame);
        assert_eq!((generation, time, columns.len()), (7, 2.0, columns_of(&world).len()));
        assert_eq!((columns[0], columns[8]), ([1.0, -2.0, 1.0], [2.0, 1.0, 3.0]));
        // k (z - w)²/2, the bodies at rest.
        let stiffness: f32 = 17.8e-3 * 180.0 / std::f32::consts::PI;
        for (is, separation) in columns[ENERGY_AT].into_iter().zip([1.0_f32, 1.0, 5.0]) {
            assert!((is - 0.5 * stiffness * separation * separation).abs() < 1e-4, "{columns:?}");
        }
        assert_eq!(frames.take(), None, "the next begins anew");
    }

    const ENERGY_AT: usize = 7;

    #[test]
    fn a_nan_is_kept_and_a_new_world_begins_a_new_frame() {
        let world = world();
        let mut frames = Frames::default();
        add(&mut frames, &world, 0, 0.0, &record(0, |r| r.torque = f64::NAN));
        add(&mut frames, &world, 0, 1.0, &record(1, |r| r.torque = 1.0));
        assert!(read(&frames.take().unwrap()).2[4][1].is_nan());
        add(&mut frames, &world, 0, 2.0, &record(2, |r| r.position = -9.0));
        add(&mut frames, &world, 1, 3.0, &record(3, |r| r.position = 1.0));
        let (generation, _, columns) = read(&frames.take().unwrap());
        assert_eq!((generation, columns[0]), (1, [1.0, 1.0, 1.0]));
    }

    /// A wheel of the notes is armed, turned, and stopped; then the puck is turned further, while the world is at its start.
    #[test]
    fn while_no_torque_is_possible_torque_and_energy_are_0_and_the_bodies_keep_their_positions() {
        let world = world();
        for phase in [Phase::Disarmed, Phase::Faulted] {
            let mut frames = Frames::default();
            let at = |sample, phase, position, wheel: (f64, f64)| {
                record(sample, |r| {
                    (r.phase, r.position, r.bodies[0]) = (phase, position, wheel);
                    (r.torque, r.command) = (wheel.0 - position, wheel.0 - position);
                })
            };
            add(&mut frames, &world, 0, 0.0, &at(0, Phase::Running, 1.0, (0.8, 0.3)));
            frames.take();
            add(&mut frames, &world, 0, 1.0, &at(1, phase, 1.1, (0.0, 0.0)));
            add(&mut frames, &world, 0, 2.0, &at(2, phase, 9.0, (0.0, 0.0)));
            let (_, _, columns) = read(&frames.take().unwrap());
            for none in [&columns[4..=5], &columns[ENERGY_AT..=ENERGY_AT], &columns[10..]].concat() {
                assert_eq!(none, [0.0; 3], "{columns:?}");
            }
            assert_eq!((columns[0], columns[8], columns[9]), ([9.0, 1.1, 9.0], [0.8; 3], [0.0; 3]));
            // A restart resets both.
            let back = record(3, |r| (r.phase, r.announced) = (phase, true));
            add(&mut frames, &world, 0, 3.0, &back);
            add(&mut frames, &world, 0, 4.0, &at(4, phase, 0.0, (0.0, 0.0)));
            let (_, _, columns) = read(&frames.take().unwrap());
            assert_eq!((columns[0], columns[8]), ([0.0; 3], [0.0; 3]));
        }
    }

    #[test]
    fn a_world_that_is_armed_again_shows_no_earlier_torque() {
        let world = world();
        let mut frames = Frames::default();
        for (time, phase, torque) in
            [(0.0, Phase::FadingOut, 10.0), (1.0, Phase::Disarmed, -7.0), (2.0, Phase::FadingIn, 0.25)]
        {
            add(&mut frames, &world, 0, time, &record(time as u64, |r| (r.phase, r.torque) = (phase, torque)));
        }
        assert_eq!(read(&frames.take().unwrap()).2[4], [0.25; 3]);
    }

    #[test]
    fn the_columns_have_the_names_of_their_signals() {
        let columns = columns_of(&world());
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(
            names[..10],
            [
                "puck_rad",
                "puck_rad_per_s",
                "measured_rad",
                "measured_rad_per_s",
                "torque_Nm",
                "command_Nm",
                "output_Nm",
                "energy_J",
                "wheel_rad",
                "wheel_rad_per_s",
            ]
        );
        assert_eq!(
            names[10..],
            *Vec::from_iter((0..world().couplings.len()).map(|i| format!("coupling_{i}_torque_Nm")))
        );
        assert_eq!((columns[1].unit, columns[ENERGY_AT].unit, columns[10].unit), ("rad/s", "J", "N m"));
    }

    #[test]
    fn the_page_finds_each_signal_in_its_column() {
        // web/src/protocol.ts: `export const COLUMN = { puck: 0, ... }`.
        let script = include_str!("../../../web/src/protocol.ts");
        let list = script.split_once("export const COLUMN = {").unwrap().1.split_once('}').unwrap().0;
        let names = list.split(',').filter_map(|row| row.split_once(':')).map(|(name, place)| {
            assert!(!place.trim().is_empty());
            (name.trim().to_string(), place.trim().parse::<usize>().unwrap())
        });
        let own = COLUMNS.iter().enumerate().map(|(place, (signal, _))| {
            let velocity = if signal.measures == Measures::Velocity { "Velocity" } else { "" };
            (format!("{}{velocity}", signal.stem), place)
        });
        assert_eq!(names.collect::<Vec<_>>(), own.chain([("bodies".into(), COLUMNS.len())]).collect::<Vec<_>>());
    }
}
