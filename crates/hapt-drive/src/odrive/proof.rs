//! Verification that the drive applies the commanded torque. Requests feed its watchdog too: only this check detects the loss of only the
//! torque frames.

use hapt_core::Reason;
use hapt_rt::DriveFault;

use super::codec::Command;

/// It is requested in every second sample while the drive is armed.
const EVERY: u32 = 2;
/// Consecutive disagreeing answers that fail: ten samples.
const WRONG: u32 = 5;
/// Consecutive answers with another motor torque or none that fail, and their shortest duration in s: many times the current's response
/// time, and longer than the period of the heartbeat, which reports the reason.
const IDLE: (u32, f64) = (10, 0.15);
/// Samples without an answer that fail.
const UNPROVEN: u32 = 30;
/// The tolerances, relative to the torque and to the largest one: of the setpoint, and of the motor's torque.
const USED_TOLERANCE: [f64; 2] = [0.01, 1e-3];
const MADE_TOLERANCE: [f64; 2] = [0.5, 0.02];
/// The part of the largest torque above which a current determines the motor's constant.
const MIN_TORQUE_RATIO: f64 = 0.02;

const DISAGREES: DriveFault = DriveFault {
    code: Command::Torques as u32,
    what: "it does not apply the commanded torque: torque frames are lost or late, or vel_limit in torque mode, torque_soft_max or \
           anticogging changes it",
    reason: Some(Reason::Late),
};
const NOT_MADE: DriveFault = DriveFault {
    code: Command::Torques as u32,
    what: "its motor does not make the commanded torque: it is idle, torque frames are lost, or its current is limited",
    reason: None,
};
const SILENT: DriveFault =
    DriveFault { code: Command::Torques as u32, what: "it does not report its torque", reason: Some(Reason::Late) };

/// The last commands, and the time since the drive confirmed one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proof {
    /// The request: its torques, or before 0.6 its currents.
    pub kind: Command,
    /// The largest torque, N·m; 0 where none is known.
    most: f64,
    /// N·m per A, once it is known; 1 where the answers are torques.
    constant: Option<f64>,
    /// The last torque and the one before it, N·m.
    commanded: [f64; 2],
    /// Consecutive disagreeing answers.
    wrong: u32,
    /// Consecutive answers with another motor torque, with the time since the first, s.
    idle: (u32, f64),
    /// Samples since the last answer.
    unproven: u32,
    sample: u32,
}

impl Proof {
    /// The check by the answers to this request, for this largest torque.
    pub fn new(kind: Command, most: f64) -> Self {
        let most = if most.is_finite() { most.abs() } else { 0.0 };
        let constant = (kind == Command::Torques).then_some(1.0);
        Proof { kind, most, constant, commanded: [0.0; 2], wrong: 0, idle: (0, 0.0), unproven: 0, sample: 0 }
    }

    /// Registers a command.
    pub fn record_command(&mut self, torque: f64) {
        self.commanded = [torque, self.commanded[0]];
    }

    /// Advances to the next sample, this many s after the last one; returns whether to send a request in it.
    pub fn pass(&mut self, period: f64) -> bool {
        (self.sample, self.unproven) = (self.sample.wrapping_add(1), self.unproven + 1);
        self.idle.1 += period;
        self.sample.is_multiple_of(EVERY)
    }

    /// Compares the setpoint and the motor's torque. An answer to this sample's request refers to the last command; any other one to that
    /// or the one before.
    pub fn receive(&mut self, uses: f64, makes: f64, is_fresh: bool) {
        let [last, before] = self.commanded;
        if self.constant.is_none() && is_fresh && last.abs() > MIN_TORQUE_RATIO * self.most && uses != 0.0 {
            self.constant = Some(last / uses);
        }
        let agrees = |current: f64, [part, floor]: [f64; 2]| match self.constant {
            Some(constant) => {
                let near = |commanded: f64| {
                    (constant * current - commanded).abs() <= part * commanded.abs() + floor * self.most
                };
                near(last) || !is_fresh && near(before)
            }
            // Small currents are inconclusive until the motor's constant is known.
            None => last.abs() <= MIN_TORQUE_RATIO * self.most,
        };
        let is_zero = (self.constant.unwrap_or(1.0) * uses).abs() <= USED_TOLERANCE[1] * self.most;
        let (uses, makes) = (agrees(uses, USED_TOLERANCE), agrees(makes, MADE_TOLERANCE));
        // A setpoint of zero means idle, and the heartbeat reports the reason.
        self.wrong = if uses || is_zero { 0 } else { self.wrong + 1 };
        self.idle = if makes && (uses || !is_zero) { (0, 0.0) } else { (self.idle.0 + 1, self.idle.1) };
        self.unproven = 0;
    }

    /// Resets the check while the drive is not armed.
    pub fn rest(&mut self) {
        (self.wrong, self.idle, self.unproven) = (0, (0, 0.0), 0);
    }

    pub fn fault(&self) -> Option<DriveFault> {
        match () {
            () if self.wrong >= WRONG => Some(DISAGREES),
            () if self.idle.0 >= IDLE.0 && self.idle.1 > IDLE.1 => Some(NOT_MADE),
            () if self.unproven >= UNPROVEN => Some(SILENT),
            () => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    /// This many samples of a varying torque: requested, commanded, and answered with setpoint and motor torque.
    fn fault(kind: Command, samples: u32, drive: impl Fn(&[f64]) -> Option<(f64, f64)>) -> Option<DriveFault> {
        let mut proof = Proof::new(kind, 1.0);
        let mut commanded = vec![0.0, 0.0, 0.0];
        for k in 0..samples {
            if proof.pass(1e-3)
                && let Some((uses, makes)) = drive(&commanded)
            {
                proof.receive(uses, makes, true);
            }
            if let Some(fault) = proof.fault() {
                return Some(fault);
            }
            let torque = 0.3 + 0.2 * (0.1 * f64::from(k)).sin();
            proof.record_command(torque);
            commanded.push(torque);
        }
        None
    }

    fn newest(commanded: &[f64], age: usize) -> f64 {
        commanded[commanded.len() - 1 - age]
    }

    proptest! {
        /// For any constant of the motor.
        #[test]
        fn a_drive_that_uses_the_commanded_torque_passes(constant in 0.01_f64..5.0, lag in 0.7_f64..1.2) {
            let torques = |commanded: &[f64]| Some((newest(commanded, 0), lag * newest(commanded, 0)));
            let currents = |commanded: &[f64]| Some((newest(commanded, 0) / constant, lag * newest(commanded, 0) / constant));
            prop_assert_eq!(fault(Command::Torques, 1000, torques), None);
            prop_assert_eq!(fault(Command::Current, 1000, currents), None);
        }

        #[test]
        fn a_drive_that_uses_another_torque_fails(constant in 0.01_f64..5.0, held in 0.01_f64..1.0, age in 1_usize..3) {
            for (kind, one) in [(Command::Torques, 1.0), (Command::Current, constant)] {
                let lost = |commanded: &[f64]| Some((if commanded.len() < 60 { newest(commanded, 0) } else { held } / one, newest(commanded, 0) / one));
                prop_assert_eq!(fault(kind, 60 + 40, lost), Some(DISAGREES));
                let late = |commanded: &[f64]| Some((newest(commanded, if commanded.len() < 60 { 0 } else { age }) / one, newest(commanded, 0) / one));
                // At the turn of a sine the torque hardly changes.
                if kind == Command::Torques {
                    prop_assert_eq!(fault(kind, 60 + 60, late), Some(DISAGREES));
                }
                let idle = |commanded: &[f64]| Some((newest(commanded, 0) / one, if commanded.len() < 60 { newest(commanded, 0) / one } else { 0.0 }));
                prop_assert_eq!(fault(kind, 60 + 160, idle), Some(NOT_MADE));
                let none = |commanded: &[f64]| (commanded.len() < 60).then_some(newest(commanded, 0) / one).or(Some(0.0)).map(|one| (one, one));
                prop_assert_eq!(fault(kind, 60 + 160, none), Some(NOT_MADE));
                let silent = |commanded: &[f64]| (commanded.len() < 60).then(|| (newest(commanded, 0) / one, newest(commanded, 0) / one));
                prop_assert_eq!(fault(kind, 60 + 32, silent), Some(SILENT));
            }
        }
    }
}
