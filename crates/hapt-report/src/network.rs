//! The page of a network of stations.

use hapt_analysis::NetworkCheck;
use hapt_model::{Law, Motion, Station, System};
use hapt_sim::Signal as Column;
use maud::{Markup, html};
use serde_json::Value;

use crate::diagram::diagram;
use crate::extremes::Extremes;
use crate::figure::{Axis, Figure, Panel, Style};
use crate::page::{Drawing, PLOTS, Report, parameters, run_data};
use crate::recorded::{CurveStyle, Recorded, moving, torque};
use crate::run::Run;
use crate::svg::Width;
use crate::ticks::number;
use crate::traces::{Signal, Traces, scaled};
use crate::units::{self, effort_name, say_effort, say_energy, say_time};

impl Run<'_> {
    /// Positions, velocities and torques of all stations over time.
    fn motions(&self, width: Width, room: usize) -> Figure {
        let names = self.system.stations.iter().map(|station| station.name.clone());
        let runs: Vec<(String, Traces)> = names.zip(self.traces.iter().cloned()).collect();
        let title = format!("{}: motion and {} of every station", self.name, effort_name(self.system.motion));
        let signals = [Signal::Position, Signal::Velocity, Signal::Torque];
        Traces::overlay_with(&title, &runs, &signals, room.min(width.stretches()))
    }

    /// The run at each station for the plots of a page, in about `bytes` bytes together; `name` begins the names of its files.
    fn station_plots(&self, name: &str, bytes: usize) -> Vec<Value> {
        let (motion, stations) = (self.system.motion, &self.system.stations);
        let each = bytes / stations.len().max(1);
        let data = |(recorded, station): (&Recorded, &Station)| {
            let [positions, velocities] = moving(&station.world);
            let first = 2 * positions.len();
            let torques = vec![
                torque(motion, "asked for", first, Column::TORQUE, CurveStyle::Signal(0)),
                torque(motion, "applied", first + 1, Column::APPLIED, CurveStyle::Dashed(1)),
                torque(motion, "of the links", first + 2, Column::LINK, CurveStyle::Signal(2)),
            ];
            let limits: Vec<f64> = station.world.device.limit.iter().flat_map(|limit| [*limit, -limit]).collect();
            let panels = [
                recorded.panel("position", positions, |size| units::position(motion, size), &[]),
                recorded.panel("velocity", velocities, |size| units::velocity(motion, size), &[]),
                recorded.panel(effort_name(motion), torques, |size| units::effort(motion, size), &limits),
            ];
            recorded.data(&format!("{name}-{}", station.name), &panels, each)
        };
        self.recorded.iter().zip(stations).map(data).collect()
    }

    /// The torque of the links at every station over time.
    fn of_links(&self, width: Width, room: usize) -> Figure {
        let ranges = || self.links.iter().filter_map(Extremes::range);
        let largest = ranges().map(|(low, high)| low.abs().max(high.abs())).fold(0.0, f64::max);
        let (motion, names) = (self.system.motion, self.system.stations.iter().map(|station| station.name.as_str()));
        let unit = units::effort(motion, largest);
        let spans = self.traces.iter().map(Traces::span);
        let (from, to) =
            spans.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)));
        let time = units::time(to);
        let values = ranges().flat_map(|(low, high)| [low * unit.per_si, high * unit.per_si]);
        let mut panel = Panel::new(
            "",
            Axis::from_to("time", time.name, from * time.per_si, to * time.per_si),
            Axis::around(&format!("{} of the links", effort_name(motion)), unit.name, values),
        );
        for (i, (name, link)) in names.clone().zip(&self.links).enumerate() {
            let points = link.points(room.min(width.stretches()));
            panel.curve(name, Style::Signal(i), scaled(points, time.per_si, unit.per_si));
        }
        let most = |(name, link): (&str, &Extremes)| {
            let (low, high) = link.range().unwrap_or((0.0, 0.0));
            format!("{name} {}", unit.say(low.abs().max(high.abs()), 4))
        };
        let most: Vec<String> = names.zip(&self.links).map(most).collect();
        let what = effort_name(motion);
        Figure {
            title: format!("{}: {what} of the links on each puck", self.name),
            alt: format!("The {what} of the links over time, a curve a station. At most: {}.", most.join(", ")),
            panels: vec![panel],
            columns: 1,
        }
    }

    fn linked(&self) -> Markup {
        let network = self.system;
        html! {
            @if let Some(failure) = &self.failure { p.verdict.unstable { b { "Ended early" } ": " (failure) } }
            dl {
                @for (station, seen) in network.stations.iter().zip(&self.summary.stations) {
                    dt { (station.name) }
                    dd {
                        (seen.rows) " samples, command at most " (say_effort(seen.peak_command, network.motion)) "; the hand gave "
                        (say_energy(seen.ledger.hand))
                    }
                }
                @for (link, [first, second]) in network.links.iter().zip(&self.releases) {
                    @if first + second > 0 {
                        dt { (between(network, link.between)) }
                        dd {
                            "let go " (first) " times at " (network.stations[link.between[0]].name) ", " (second) " times at "
                            (network.stations[link.between[1]].name)
                        }
                    }
                }
            }
        }
    }
}

fn between(network: &System, ends: [usize; 2]) -> String {
    let [one, other] = ends.map(|at| network.stations[at].name.as_str());
    format!("{one} to {other}")
}

/// The approximate number of intervals of all curves on a page.
const INTERVALS: usize = 12_000;

impl Report<'_> {
    /// Every figure of a network, in the order of the page: a world for each station, then two for each run.
    pub(crate) fn drawings_of_network(&self) -> Vec<Drawing> {
        let world = |station: &hapt_model::Station| {
            let of = |own| diagram(&station.world, own).svg;
            Drawing::one(
                &format!("{}-world", station.name),
                &format!("The world of {}", station.name),
                of(false),
                of(true),
            )
        };
        let mut list: Vec<Drawing> = self.system.stations.iter().map(world).collect();
        let curves: usize = self.system.stations.iter().map(|station| 2 * (station.world.bodies.len() + 1) + 2).sum();
        let room = (INTERVALS / (curves * self.runs.len()).max(1)).clamp(12, Width::Wide.stretches());
        for run in &self.runs {
            list.push(Drawing::new(&format!("{}-motion", run.name), |width| run.motions(width, room)));
            list.push(Drawing::new(&format!("{}-links", run.name), |width| run.of_links(width, room)));
        }
        list
    }

    /// The page of a network with this certificate below its title.
    pub(crate) fn of_network(&self, check: &NetworkCheck, drawings: &[Drawing]) -> Markup {
        let (worlds, runs) = drawings.split_at(drawings.len() - 2 * self.runs.len());
        let sentence = check.verdict_sentence();
        let (name, capital, colour) = match check.certified {
            true => ("certified", "Certified", "stable"),
            false => ("not certified", "Not certified", "unstable"),
        };
        html! {
            p.soft { (self.line()) }
            p class={ "verdict " (colour) } { b { (capital) } (sentence.strip_prefix(name).unwrap_or(&sentence)) "." }
            @if let Some(live) = &self.live {
                p { a href=(live) { "Grab the wheels" } ": all stations run in your browser, with the links between them, for your mouse or several fingers." }
            }
            dl {
                @for station in &check.stations {
                    dt { (station.name) } dd { (station.sentence()) "." }
                    @for reason in &station.not_proved { dt { "not proved" } dd { (reason) "." } }
                }
            }
            @if let Some((what, heading, lines)) = check.proposal() {
                @if lines.is_empty() {
                    p { "No single change of these numbers makes it passive." }
                } @else {
                    p { (if what == "margins" { "Margins: " } else { "Remedies: " }) (heading) "." }
                    pre tabindex="0" { (lines.join("\n")) }
                }
            }
            @for note in &check.notes { p.soft { "Note: " (note) "." } }
            h2 { "Links" }
            (self.links(check))
            @for (run, drawings) in self.runs.iter().zip(runs.chunks(2)) {
                h2 { "Scenario " (run.name) }
                (run.linked())
                @let still = html! { @for drawing in drawings { (drawing.markup()) } };
                @if self.plots.is_some() {
                    (run_data(&run.station_plots(&format!("{}-{}", self.stem, run.name), PLOTS / self.runs.len()), &still))
                } @else {
                    (still)
                }
            }
            @for ((station, drawing), list) in self.system.stations.iter().zip(worlds).zip(self.parameters) {
                h2 { "Station " (station.name) }
                p.soft { (station.file) ", " (say_time(station.world.sampling.period)) " a sample" }
                (drawing.markup())
                (parameters(list))
            }
        }
    }

    /// "2 stations, 1 link"
    pub(crate) fn line(&self) -> String {
        let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        format!("{}, {}", count(self.system.stations.len(), "station"), count(self.system.links.len(), "link"))
    }

    fn links(&self, check: &NetworkCheck) -> Markup {
        let [unit, damping] = match self.system.motion {
            Motion::Rotary => ["N·m/rad", "N·m·s/rad"],
            Motion::Linear => ["N/m", "N·s/m"],
        };
        html! {
            div.scroll tabindex="0" {
                table {
                    thead { tr { th { "between" } th { "kind" } th { "stiffness (" (unit) ")" } th { "passive up to" } th { "damping (" (damping) ")" } th { "age_max" } th { "limit" } th { "on the way" } th { "lost" } } }
                    tbody {
                        @for (link, check) in self.system.links.iter().zip(&check.links) {
                            tr {
                                td { (between(self.system, link.between)) }
                                td { (if matches!(link.law, Law::Wall { .. }) { "wall" } else { "spring" }) }
                                td.number { (number(check.stiffness, 4)) }
                                td.number { (check.stiffness_max.map_or("none".into(), |k| number(k, 4))) }
                                td.number { (number(check.damping, 4)) }
                                td.number { (say_time(check.age_max_s)) }
                                td.number { (link.limit.map_or("none".into(), |limit| say_effort(limit, self.system.motion))) }
                                td.number { (say_time(link.delay)) " to " (say_time(link.delay_max_s())) }
                                td.number { (number(100.0 * link.loss, 3)) " %" }
                            }
                        }
                    }
                }
            }
        }
    }
}
