//! The answers as JSON, the same on the command line and in Python; shapes are in `docs/identify.md`.

use serde_json::{Map, Value, json};

use crate::identified::Identified;
use crate::interval::Interval;
use crate::misfit::{Misfit, Part};
use crate::terms::{Term, TermKind};
use crate::torque::{BestFit, TorqueFit};

/// An interval, or null where the record does not determine the number.
pub(crate) fn value(interval: Option<Interval>) -> Value {
    interval.map_or(Value::Null, |x| json!({ "value": x.value, "low": x.low, "high": x.high }))
}

fn map<'a>(numbers: impl IntoIterator<Item = (&'a str, Option<Interval>)>) -> Map<String, Value> {
    numbers.into_iter().map(|(name, interval)| (name.to_string(), value(interval))).collect()
}

impl Identified {
    /// The numbers of a device that the model explains, with the misfit of the torque's equation where the record has a torque.
    pub fn json(&self, by_torque: Option<&TorqueFit>) -> Map<String, Value> {
        let mut json = map(self.named());
        json.insert("misfit".into(), by_torque.map_or(Value::Null, TorqueFit::misfit_json));
        if let Some(stops) = self.stops {
            json.insert("stops".into(), map(stops.named()).into());
        }
        if !self.terms.is_empty() {
            json.insert("terms".into(), self.terms.iter().map(Term::json).collect());
        }
        json
    }
}

impl TorqueFit {
    /// The numbers of a device that is richer than the model; `has_force`: the record has a second torque.
    pub fn json(&self, is_linear: bool, has_force: bool) -> Map<String, Value> {
        let mut json = map(self.named(is_linear));
        json.extend(map([
            ("inertia_by_torque", self.inertia_by_torque),
            ("inertia_by_motion", self.inertia_by_motion),
        ]));
        json.extend(map(has_force.then_some(("force", self.force))));
        json.insert("misfit".into(), self.misfit_json());
        if !self.terms.is_empty() {
            json.insert("terms".into(), self.terms.iter().map(Term::json).collect());
        }
        json
    }

    /// The misfit, and the numbers of its fit.
    fn misfit_json(&self) -> Value {
        let mut json = self.misfit.json();
        let BestFit { inertia, damping, friction, offset } = self.best;
        json["fit"] = json!({ "inertia": inertia, "damping": damping, "friction": friction, "offset": offset });
        json
    }
}

impl Misfit {
    /// The misfit with its kinds.
    pub(crate) fn json(&self) -> Value {
        let kind = |part: &Part| json!({ "kind": part.kind.word(), "share": part.share, "remedy": part.kind.remedy() });
        json!({ "share": self.share, "kinds": self.kinds.iter().map(kind).collect::<Vec<Value>>() })
    }
}

impl Term {
    /// The term with the further numbers of its kind, in SI.
    fn json(&self) -> Value {
        let Interval { value, low, high } = self.size;
        let mut json = json!({ "kind": self.kind.word(), "value": value, "low": low, "high": high });
        match self.kind {
            TermKind::Turn { times, phase } | TermKind::FrictionByPosition { times, phase } => {
                json["times_a_turn"] = times.into();
                json["phase_rad"] = phase.into();
            }
            TermKind::Stribeck { velocity, .. } => json["velocity"] = velocity.into(),
            TermKind::Stiffness | TermKind::Drag => {}
        }
        json
    }
}
