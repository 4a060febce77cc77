//! The sketch with its torque controlled by current.

use hapt_core::{Phase, Reason};
use hapt_drive::simplefoc::{MotorConstant, VOLTS_PER_TORQUE};
use hapt_drive::{Drive, DriveLimits, Error};
use hapt_rt::{Failure, Record};
use hapt_testing::in_time;

use super::board::{Board, TORQUE_CONSTANT};
use super::{CEILING, LONG_PERIOD_US, PERIOD_US, world_of_the_board};

#[test]
fn a_certified_world_brings_the_puck_to_rest_on_the_sketch_by_current() {
    in_time(|| {
        let world = world_of_the_board();
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        let Some(board) = Board::by_current(LONG_PERIOD_US) else { return };
        // If the machine pauses, the board's watchdog ends a run; a board that keeps no torque fails them all.
        let run = || {
            let mut looped = board.running(&world);
            (0..300).map(|_| looped.sample(None).ok().filter(|record| record.phase == Phase::Running)).collect()
        };
        let records: Option<Vec<Record>> = (0..20).find_map(|_| run());
        // From where the board was armed.
        let last = &records.expect("a run without a pause")[280..];
        assert!(last.iter().all(|record| (record.measured - 0.3).abs() < 0.01), "{:?}", last[0]);
        assert!(board.largest() > 0.0 && board.largest() <= CEILING);
        board.goes_off();
    });
}

/// The board's unit is requested, and never set: an address of another unit has no torque, and neither has one beyond the sketch's LIMIT.
#[test]
fn an_address_in_volts_is_refused_by_a_board_that_controls_a_current() {
    in_time(|| {
        let terms = DriveLimits { watchdog: 0.01, torque: 0.1 };
        let Some(board) = Board::by_current(PERIOD_US) else { return };
        let error = board.drive(MotorConstant::VoltsPerTorque(VOLTS_PER_TORQUE)).start(&terms).unwrap_err();
        assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains("torque-constant"), "{error}");
        let mut drive = board.drive(MotorConstant::TorqueConstant(TORQUE_CONSTANT));
        let error = drive.start(&DriveLimits { torque: 0.2, ..terms }).unwrap_err();
        assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains("at most 3 A"), "{error}");
        assert_eq!(board.largest(), 0.0);
        drive.start(&terms).unwrap();
    });
}

/// Another command on the board's line changes the meaning of its targets: the motor is off, and stays so until the board starts anew.
#[test]
fn a_type_of_control_that_changes_under_way_ends_the_loop_by_name_and_leaves_no_torque() {
    in_time(|| {
        let world = world_of_the_board();
        // To voltage, to an estimated current, to a velocity.
        for change in ["MT0\n", "MT3\n", "MC1\n"] {
            let Some(mut board) = Board::by_current(LONG_PERIOD_US) else { return };
            let mut looped = board.running(&world);
            let mut waits = Some(change);
            board.intercept(move |to_board, bytes| match waits {
                Some(change) if to_board && bytes.ends_with(b"\n") => {
                    waits = None;
                    [bytes, change.as_bytes()].concat()
                }
                _ => bytes.to_vec(),
            });
            match looped.ends(50).expect("it ends") {
                Err(Failure::Drive(fault)) => assert_eq!(fault.reason, Some(Reason::Driver), "{fault}"),
                // If the machine pauses.
                Err(Failure::Gone) | Ok(Reason::Late) => {}
                other => panic!("{change:?}: {other:?}"),
            }
            board.goes_off();
            drop(looped);
            let terms = DriveLimits { watchdog: 0.01, torque: 0.1 };
            let mut drive = board.drive(MotorConstant::TorqueConstant(TORQUE_CONSTANT));
            assert!(matches!(drive.start(&terms), Err(Error::Fault { .. })), "{change:?}");
            board.switch_off();
            board.switch_on(true);
            drive.start(&terms).unwrap();
        }
    });
}
