//! The comparison of logged torques with replayed ones.

use crate::Error;
use crate::log::Sample;

/// The result of a replay.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replay {
    /// Samples that were repeated and compared.
    pub compared: u64,
    /// The number of them that differ in a bit.
    pub different: u64,
    /// The first difference.
    pub first: Option<Difference>,
    /// Samples that could not be repeated, as the log lacks the loop's state.
    pub skipped: u64,
    /// Gaps: sequences of samples that were lost while recording.
    pub gaps: u64,
}

/// Two torques that should be equal.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its sample, from 0.
    pub sample: u64,
    /// Its time in s.
    pub time: f64,
    /// Their column.
    pub column: String,
    /// The torque in the log.
    pub logged: f64,
    /// The torque of the present core.
    pub replayed: f64,
}

impl Replay {
    pub(crate) fn compare(&mut self, sample: &Sample, number: u64, torques: &[(usize, f64)]) {
        self.compared += 1;
        let logged = |place: usize| sample.values.get(place).copied().unwrap_or(f64::NAN);
        let Some(&(place, replayed)) = torques.iter().find(|(place, x)| logged(*place).to_bits() != x.to_bits()) else {
            return;
        };
        self.different += 1;
        self.first.get_or_insert_with(|| Difference {
            sample: number,
            time: logged(0),
            column: sample.plan.columns.get(place).map(|column| column.name.clone()).unwrap_or_default(),
            logged: logged(place),
            replayed,
        });
    }
}

pub(crate) fn world_error(error: hapt_core::Error) -> Error {
    Error::World(error.to_string())
}
