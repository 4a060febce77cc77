//! Whether the drive uses the torque that it was told. Questions feed its watchdog too: where torque frames alone are lost, nothing else
//! tells.

use hapt_core::Reason;
use hapt_rt::DriveFault;

use super::codec::Command;

/// It is asked in every second sample, for as long as it is armed.
const EVERY: u32 = 2;
/// Answers in a row that disagree: ten samples.
const WRONG: u32 = 5;
/// Answers in a row by which the motor makes another torque or none, and for how long, in s: many times what a current takes to follow, and
/// longer than a heartbeat that says why.
const IDLE: (u32, f64) = (10, 0.15);
/// Samples without an answer, however many were lost.
const UNPROVEN: u32 = 30;
/// What agrees, in parts of the torque and of the largest one: what it uses, and what its motor makes.
const USED: [f64; 2] = [0.01, 1e-3];
const MADE: [f64; 2] = [0.5, 0.02];
/// From so many parts of the largest torque on a current tells the motor's constant.
const TELLS: f64 = 0.02;

const DISAGREES: DriveFault = DriveFault {
    code: Command::Torques as u32,
    what: "it does not use the torque that it is told: torque frames are lost or late, or vel_limit in torque mode, torque_soft_max or \
           anticogging changes it",
    reason: Some(Reason::Late),
};
const NOT_MADE: DriveFault = DriveFault {
    code: Command::Torques as u32,
    what: "its motor does not make the torque that it is told: it is idle, torque frames are lost, or its current is limited",
    reason: None,
};
const SILENT: DriveFault = DriveFault {
    code: Command::Torques as u32,
    what: "it does not say which torque it uses",
    reason: Some(Reason::Late),
};

/// What it was told, and how long ago it said that it goes by it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proof {
    /// The question: its torques, or before 0.6 its currents.
    pub kind: Command,
    /// The largest torque, N·m; 0 where none is known.
    most: f64,
    /// N·m per A, once it is known; 1 where it says torques.
    constant: Option<f64>,
    /// The last torque and the one before it, N·m.
    told: [f64; 2],
    /// Answers in a row that disagree.
    wrong: u32,
    /// With the time since it was none, s.
    idle: (u32, f64),
    /// Samples since it answered.
    unproven: u32,
    sample: u32,
}

impl Proof {
    /// By the answers to this question, of a motor that is asked for so much at most.
    pub fn new(kind: Command, most: f64) -> Self {
        let most = if most.is_finite() { most.abs() } else { 0.0 };
        let constant = (kind == Command::Torques).then_some(1.0);
        Proof { kind, most, constant, told: [0.0; 2], wrong: 0, idle: (0, 0.0), unproven: 0, sample: 0 }
    }

    /// It has been told this torque.
    pub fn tell(&mut self, torque: f64) {
        self.told = [torque, self.told[0]];
    }

    /// The next sample, so many s after the last one; whether to ask in it.
    pub fn pass(&mut self, period: f64) -> bool {
        (self.sample, self.unproven) = (self.sample.wrapping_add(1), self.unproven + 1);
        self.idle.1 += period;
        self.sample.is_multiple_of(EVERY)
    }

    /// What it uses and what its motor makes. An answer to this sample's question knows the last torque; any other one that or the one
    /// before.
    pub fn hear(&mut self, uses: f64, makes: f64, is_fresh: bool) {
        let [last, before] = self.told;
        if self.constant.is_none() && is_fresh && last.abs() > TELLS * self.most && uses != 0.0 {
            self.constant = Some(last / uses);
        }
        let agrees = |said: f64, [part, floor]: [f64; 2]| match self.constant {
            Some(constant) => {
                let near = |told: f64| (constant * said - told).abs() <= part * told.abs() + floor * self.most;
                near(last) || !is_fresh && near(before)
            }
            // Currents say nothing of a small torque as long as the motor is not known.
            None => last.abs() <= TELLS * self.most,
        };
        let lets_go = (self.constant.unwrap_or(1.0) * uses).abs() <= USED[1] * self.most;
        let (uses, makes) = (agrees(uses, USED), agrees(makes, MADE));
        // One that uses none is idle, and its heartbeat says why.
        self.wrong = if uses || lets_go { 0 } else { self.wrong + 1 };
        self.idle = if makes && (uses || !lets_go) { (0, 0.0) } else { (self.idle.0 + 1, self.idle.1) };
        self.unproven = 0;
    }

    /// It is not armed yet.
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
    use proptest::prelude::*;

    use super::*;

    /// So many samples of a torque that changes all the time: asked, told, and what the drive says it uses and makes of the last ones.
    fn fault(kind: Command, samples: u32, drive: impl Fn(&[f64]) -> Option<(f64, f64)>) -> Option<DriveFault> {
        let mut proof = Proof::new(kind, 1.0);
        let mut told = vec![0.0, 0.0, 0.0];
        for k in 0..samples {
            if proof.pass(1e-3)
                && let Some((uses, makes)) = drive(&told)
            {
                proof.hear(uses, makes, true);
            }
            if let Some(fault) = proof.fault() {
                return Some(fault);
            }
            let torque = 0.3 + 0.2 * (0.1 * f64::from(k)).sin();
            proof.tell(torque);
            told.push(torque);
        }
        None
    }

    fn newest(told: &[f64], age: usize) -> f64 {
        told[told.len() - 1 - age]
    }

    proptest! {
        /// Whatever the motor's constant is.
        #[test]
        fn a_drive_that_uses_what_it_is_told_is_believed(constant in 0.01_f64..5.0, lag in 0.7_f64..1.2) {
            let torques = |told: &[f64]| Some((newest(told, 0), lag * newest(told, 0)));
            let currents = |told: &[f64]| Some((newest(told, 0) / constant, lag * newest(told, 0) / constant));
            prop_assert_eq!(fault(Command::Torques, 1000, torques), None);
            prop_assert_eq!(fault(Command::Current, 1000, currents), None);
        }

        #[test]
        fn a_drive_that_does_not_is_found_out(constant in 0.01_f64..5.0, held in 0.01_f64..1.0, age in 1_usize..3) {
            for (kind, one) in [(Command::Torques, 1.0), (Command::Current, constant)] {
                let lost = |told: &[f64]| Some((if told.len() < 60 { newest(told, 0) } else { held } / one, newest(told, 0) / one));
                prop_assert_eq!(fault(kind, 60 + 40, lost), Some(DISAGREES));
                let late = |told: &[f64]| Some((newest(told, if told.len() < 60 { 0 } else { age }) / one, newest(told, 0) / one));
                // At the turn of a sine the torque hardly changes.
                if kind == Command::Torques {
                    prop_assert_eq!(fault(kind, 60 + 60, late), Some(DISAGREES));
                }
                let idle = |told: &[f64]| Some((newest(told, 0) / one, if told.len() < 60 { newest(told, 0) / one } else { 0.0 }));
                prop_assert_eq!(fault(kind, 60 + 160, idle), Some(NOT_MADE));
                let none = |told: &[f64]| (told.len() < 60).then_some(newest(told, 0) / one).or(Some(0.0)).map(|one| (one, one));
                prop_assert_eq!(fault(kind, 60 + 160, none), Some(NOT_MADE));
                let silent = |told: &[f64]| (told.len() < 60).then(|| (newest(told, 0) / one, newest(told, 0) / one));
                prop_assert_eq!(fault(kind, 60 + 32, silent), Some(SILENT));
            }
        }
    }
}
