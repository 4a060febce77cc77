//! A force-feedback wheel's reports: chunks, each a length byte and as many bytes of a report; after each a sample is rendered.

use hapt_core::wheel::{Device, Timing, Wheel};
use hapt_wire::pid::{Control, Kind, Operation, Pool, Report, Scale};

use crate::messages::outcome;

const LIMIT: f64 = 5.0;

/// A wheel receives the input; the number identifies the accepted reports.
///
/// # Panics
/// When a torque is not within the limit, or a report is not written as it was read.
pub fn run(bytes: &[u8]) -> u64 {
    let device = Device { friction: 0.02, count: 1e-3, ..Device::ideal(Timing::even(1e-3), 0.02, LIMIT) };
    let wheel = Wheel::<f32>::new(&device).unwrap_or_else(|error| panic!("{error}"));
    let scale = Scale { torque: LIMIT as f32, angle: 7.85, velocity: 20.0, acceleration: 200.0 };
    let (mut state, mut pool, mut rest, mut taken, mut now) = (wheel.start(), Pool::new(), bytes, 0_u64, 0_u64);
    while let Some((length, after)) = rest.split_first() {
        let (chunk, next) = after.split_at(usize::from(length & 0x1f).min(after.len()));
        rest = next;
        if let Some(report) = Report::read(chunk) {
            let (written, length) = report.write();
            assert_eq!(Report::read(&written[..length]), Some(report), "{report:?}");
            let is_known = pool.take(&report, now);
            taken = taken.wrapping_mul(31) ^ outcome(&(chunk.first(), is_known));
        }
        // The top bits of the length move the wheel and the clock.
        now += 1000 << (length >> 5);
        let position = f32::from(*length) / 16.0 - 8.0;
        let (effects, count) = pool.effects(now, &scale);
        let given = wheel.step(&mut state, position, &effects[..count], pool.revision());
        assert!(f64::from(given.torque.abs()) <= LIMIT, "{given:?}");
    }
    taken
}

/// Every effect, made and started.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut session = Vec::new();
    let mut add = |report: Report| {
        let (bytes, length) = report.write();
        session.push(length as u8);
        session.extend(&bytes[..length]);
    };
    add(Report::Control(Control::Reset));
    for (block, kind) in Kind::ALL.into_iter().enumerate() {
        add(Report::Create(kind));
        add(Report::Constant { block, magnitude: 5000 });
        add(Report::Operation { block, operation: Operation::Start, loops: 2 });
    }
    vec![session, vec![0; 64], vec![0xff; 64]]
}
