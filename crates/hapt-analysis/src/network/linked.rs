//! The verdict on other links between stations whose own certificates are known, for a page that has no room for all certificates.

use hapt_model::System;
use serde::{Deserialize, Serialize};

use super::burden::Burden;
use super::text::{StationVerdict, sentence};
use super::{NetworkCheck, StationCheck, unproved_of_links};
use crate::error::Error;

/// The findings on a station without its links.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StationFindings {
    /// Whether it is certified.
    pub certified: bool,
    /// Whether that is proved of its whole loop.
    pub proved: bool,
    /// The device damping that its world requires, N·m·s/rad (linear: N·s/m); `None`: no finite damping is known to suffice.
    pub required_damping: Option<f64>,
}

/// The verdict on a network by what is known of its stations.
#[derive(Clone, Debug, PartialEq)]
pub struct Linked {
    /// As [`NetworkCheck::certified`].
    pub certified: bool,
    /// As [`NetworkCheck::verdict_sentence`].
    pub sentence: String,
    /// The largest factor on the stiffness of every link with which it is passive; `None`: there is none.
    pub stiffness_scale: Option<f64>,
    /// The same on the `age_max` of every link.
    pub age_scale: Option<f64>,
}

impl Linked {
    /// No certificate, and the reason.
    pub fn refused(why: &str) -> Self {
        let sentence = format!("not certified: {why}");
        Linked { certified: false, sentence, stiffness_scale: None, age_scale: None }
    }
}

impl NetworkCheck {
    /// The findings on each station without its links.
    pub fn station_findings(&self) -> Vec<StationFindings> {
        let of = |StationCheck { local, .. }: &StationCheck| StationFindings {
            certified: local.certified.holds(),
            proved: local.uneven.not_proved.is_empty(),
            required_damping: local.uneven.proved_damping(),
        };
        self.stations.iter().map(of).collect()
    }

    /// Its verdict.
    pub fn linked(&self) -> Linked {
        Linked {
            certified: self.certified,
            sentence: self.verdict_sentence(),
            stiffness_scale: self.remedies.as_ref().and_then(|remedies| remedies.stiffness_scale),
            age_scale: self.remedies.as_ref().and_then(|remedies| remedies.age_scale),
        }
    }
}

/// The verdict of [`super::check_network`], without the certificates of the stations' worlds: `findings` are those of the
/// stations, in their order.
///
/// # Errors
/// As [`super::check_network`].
pub fn check_links(network: &System, findings: &[StationFindings]) -> Result<Linked, Error> {
    let demands: Vec<Option<f64>> = findings.iter().map(|of| of.required_damping).collect();
    let burden = Burden::of(network, &demands)?;
    let required = burden.required();
    let mut found = Vec::new();
    for (index, (station, findings)) in network.stations.iter().zip(findings).enumerate() {
        found.push(StationVerdict {
            name: &station.name,
            certified_locally: findings.certified,
            bounded: required[index].is_some(),
            passive: required[index].is_some_and(|b| b <= burden.damping[index]),
            proved: findings.proved && unproved_of_links(network, index)?.is_empty(),
        });
    }
    Ok(Linked {
        certified: found.iter().all(|station| station.passive && station.certified_locally),
        sentence: sentence(found.iter().copied()),
        stiffness_scale: burden.stiffness_scale(),
        age_scale: burden.age_scale(),
    })
}
