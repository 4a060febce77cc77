//! The check of a network as text: what `hapt check` prints of it.

use std::fmt::Write as _;

use hapt_model::Motion;
use hapt_model::keys::Measure;

use super::{FixedRates, NetworkCheck, StationCheck};
use crate::certificate::rounding::{Certified, within};
use crate::text::{short, time};

/// An edge in four digits, none of which goes beyond it.
fn up_to(x: f64) -> String {
    short(within(x, Certified::Below))
}

/// The facts on a station in the sentence.
#[derive(Clone, Copy)]
pub(super) struct StationVerdict<'a> {
    pub name: &'a str,
    /// Whether it is certified without links.
    pub certified_locally: bool,
    /// Whether some damping is known to suffice with them.
    pub bounded: bool,
    /// Whether its device has it.
    pub passive: bool,
    pub proved: bool,
}

/// One sentence: certified, or why not.
pub(super) fn sentence<'a>(stations: impl Iterator<Item = StationVerdict<'a>> + Clone) -> String {
    let named = |which: &dyn Fn(&StationVerdict<'_>) -> bool| {
        let names: Vec<&str> = stations.clone().filter(|station| which(station)).map(|station| station.name).collect();
        names.join(", ")
    };
    let uncertified = named(&|station| !station.certified_locally);
    if !uncertified.is_empty() {
        return format!("not certified: already without links these stations are not: {uncertified}");
    }
    let unbounded = named(&|station| !station.bounded);
    if !unbounded.is_empty() {
        return format!("not certified: with the links no finite damping is known to suffice at {unbounded}");
    }
    let lacking = named(&|station| !station.passive);
    if !lacking.is_empty() {
        return format!("not certified: with the links these stations have too little damping: {lacking}");
    }
    let unproved = named(&|station| !station.proved);
    match unproved.is_empty() {
        true => "certified: passive for any clocks and any loss".into(),
        false => format!(
            "certified: passive for any clocks and any loss, as far as the linear loops go; not proved at {unproved}"
        ),
    }
}

/// A sentence as the first line of an answer.
fn capitalised(sentence: &str) -> String {
    let mut rest = sentence.chars();
    rest.next().map_or_else(String::new, |first| std::iter::once(first.to_ascii_uppercase()).chain(rest).collect())
}

/// The symbol of a measure's unit.
fn unit(measure: Measure, motion: Motion) -> String {
    measure.dimension(motion).symbol()
}

impl NetworkCheck {
    /// One sentence: certified, or why not.
    pub fn verdict_sentence(&self) -> String {
        sentence(self.stations.iter().map(|station| StationVerdict {
            name: &station.name,
            certified_locally: station.local.certified.holds(),
            bounded: station.required_damping.is_some(),
            passive: station.passive,
            proved: station.proved,
        }))
    }

    /// Title, verdicts with their numbers, and remedies or margins, as lines for a terminal; with `why` the reasons why something is not proved,
    /// and notes.
    pub fn text(&self, title: &str, why: bool) -> String {
        let mut text = format!("{}\n\nnetwork   {title}\n", capitalised(&self.verdict_sentence()));
        for station in &self.stations {
            let _ = writeln!(text, "station   {}: {}", station.name, station.sentence());
            for reason in station.not_proved.iter().filter(|_| why) {
                let _ = writeln!(text, "          not proved: {reason}");
            }
        }
        for link in &self.links {
            let [one, other] = &link.between;
            let unit = self.unit(Measure::Stiffness);
            let most =
                link.stiffness_max.map_or("passive with none".into(), |k| format!("passive up to {} {unit}", up_to(k)));
            let damping = match link.damping {
                0.0 => String::new(),
                damping => format!("; damping {} {}", short(damping), self.unit(Measure::Damping)),
            };
            let _ = writeln!(
                text,
                "link      {one} to {other}: stiffness {} {unit}, {most}{damping}; positions act up to an age of {}",
                short(link.stiffness),
                time(link.age_max_s)
            );
        }
        let _ = writeln!(text, "fixed     {}", self.fixed.sentence());
        match self.proposal() {
            None => {}
            Some((name, _, lines)) if lines.is_empty() => {
                let none = match name {
                    "margins" => "no change of a single number was found that makes it lose its passivity",
                    _ => "no single change of these numbers makes it passive",
                };
                text += &format!("{name:<9} {none}\n");
            }
            Some((name, heading, lines)) => {
                let lines: String = lines.iter().map(|line| format!("  {line}\n")).collect();
                text += &format!("{name:<9} {heading}:\n{lines}");
            }
        }
        for note in self.notes.iter().filter(|_| why) {
            let _ = writeln!(text, "note      {note}");
        }
        text
    }

    fn unit(&self, measure: Measure) -> String {
        unit(measure, self.stations.first().map_or(Motion::Rotary, |station| station.local.motion))
    }

    /// Margins where it is passive, else remedies: the name, a description, and a line for each; without lines there are none. `None`
    /// where they were left out.
    pub fn proposal(&self) -> Option<(&'static str, &'static str, Vec<String>)> {
        let remedies = self.remedies.as_ref()?;
        let is_passive = self.stations.iter().all(|station| station.passive);
        let (name, heading) = if is_passive {
            ("margins", "passive as far as each of these, one at a time")
        } else {
            ("remedies", "each of these makes it passive")
        };
        let mut lines = Vec::new();
        if let Some(scale) = remedies.stiffness_scale.filter(|scale| *scale > 0.0) {
            lines.push(format!("stiffness of every link times {}", up_to(scale)));
        }
        if let Some(scale) = remedies.age_scale.filter(|scale| *scale > 0.0) {
            lines.push(format!("age_max of every link times {}", up_to(scale)));
        }
        if let Some(scale) = remedies.damping_scale.filter(|scale| *scale > 0.0) {
            lines.push(format!("damping of every link times {}", up_to(scale)));
        }
        for (station, damping) in &remedies.device_damping {
            let least = damping.map(|damping| short(within(damping, Certified::Above)));
            lines.extend(
                least.map(|least| format!("device.damping of {station}: {least} {}", self.unit(Measure::Damping))),
            );
        }
        Some((name, heading, lines))
    }
}

impl FixedRates {
    /// The verdict at the file's own times, or why there is none.
    pub fn sentence(&self) -> String {
        let reasons = || self.not_proved.join("; ");
        let Some(passive) = self.passive else { return format!("no second verdict at fixed times: {}", reasons()) };
        let verdict = match (passive, self.proved) {
            (true, true) => "passive".to_string(),
            (true, false) => format!("passive, as far as the linear loops go (not proved: {})", reasons()),
            (false, _) => "not passive".into(),
        };
        let edge = match self.stiffness_scale {
            Some(scale) if self.exact => format!("; the edge is at links {} times as stiff", up_to(scale)),
            Some(scale) => format!("; it is up to links {} times as stiff at least", up_to(scale)),
            None if passive => String::new(),
            None => ", with links of any stiffness".into(),
        };
        format!("at the file's own periods, phases and delays, which never change: {verdict}{edge}")
    }
}

impl StationCheck {
    /// The damping that it requires and has, or why it is not certified by itself.
    pub fn sentence(&self) -> String {
        let StationCheck { required_damping, device_damping, local, .. } = self;
        let unit = unit(Measure::Damping, local.motion);
        let own = format!("{} {unit}", short(*device_damping));
        match (local.certified.holds(), required_damping) {
            (false, _) => local.verdict_sentence().to_string(),
            (true, None) => "no finite damping is known to suffice".into(),
            (true, Some(b)) if self.passive => {
                format!("passive, requires a damping of {} {unit}, the device has {own}", short(*b))
            }
            (true, Some(b)) => {
                format!("not passive, requires a damping of {} {unit}, the device has {own}", short(*b))
            }
        }
    }
}
