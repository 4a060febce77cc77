//! A network of stations as one page.

use hapt_analysis::NetworkCheck;
use hapt_model::{Law, Motion, Parameter, System};
use hapt_sim::StationRow;
use maud::{Markup, html};

use crate::diagram::diagram;
use crate::extremes::Extremes;
use crate::figure::{Axis, Figure, Panel, Style};
use crate::page::{Drawing, document, parameters};
use crate::svg::Width;
use crate::ticks::number;
use crate::traces::{Signal, Traces, scaled};
use crate::units::{self, effort_name, say_effort, say_energy, say_time};

/// The data of one scenario of a network; their size does not depend on its length.
#[derive(Clone, Debug)]
pub struct NetworkScenario {
    /// Its name.
    pub name: String,
    /// How often each end of each link has let go.
    pub let_go: Vec<[u64; 2]>,
    /// The reason of an early end, if any.
    pub failure: Option<String>,
    motion: Motion,
    stations: Vec<StationRun>,
}

#[derive(Clone, Debug)]
struct StationRun {
    name: String,
    traces: Traces,
    link: Extremes,
    samples: u64,
    peak: f64,
    hand: f64,
}

impl NetworkScenario {
    /// The scenario `name` before its first row.
    pub fn new(network: &System, name: &str) -> Self {
        let station = |station: &hapt_model::Station| StationRun {
            name: station.name.clone(),
            traces: Traces::new(network.motion, &station.world.names, station.world.device.limit),
            link: Extremes::new(Width::Wide.stretches()),
            samples: 0,
            peak: 0.0,
            hand: 0.0,
        };
        NetworkScenario {
            name: name.into(),
            let_go: Vec::new(),
            failure: None,
            motion: network.motion,
            stations: network.stations.iter().map(station).collect(),
        }
    }

    /// Adds the next row.
    pub fn add(&mut self, row: &StationRow<'_>) {
        let StationRow { station, row, link, .. } = *row;
        let Some(of) = self.stations.get_mut(station) else { return };
        let puck = std::iter::once((row.puck, row.puck_velocity));
        of.traces.add(row.time, puck.chain(row.bodies.iter().copied()), row.torque + link, row.applied);
        of.link.add(row.time, link);
        of.samples += 1;
        of.peak = of.peak.max(row.command.abs());
        of.hand = row.ledger.hand;
    }

    /// Positions, velocities and torques of all stations over time.
    fn motion(&self, width: Width, room: usize) -> Figure {
        let runs: Vec<(String, Traces)> =
            self.stations.iter().map(|station| (station.name.clone(), station.traces.clone())).collect();
        let title = format!("{}: motion and {} of every station", self.name, effort_name(self.motion));
        let signals = [Signal::Position, Signal::Velocity, Signal::Torque];
        Traces::overlay_with(&title, &runs, &signals, room.min(width.stretches()))
    }

    /// The torque of the links at every station over time.
    fn links(&self, width: Width, room: usize) -> Figure {
        let ranges = || self.stations.iter().filter_map(|station| station.link.range());
        let largest = ranges().map(|(low, high)| low.abs().max(high.abs())).fold(0.0, f64::max);
        let unit = units::effort(self.motion, largest);
        let spans = self.stations.iter().map(|station| station.traces.span());
        let (from, to) =
            spans.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)));
        let time = units::time(to);
        let values = ranges().flat_map(|(low, high)| [low * unit.per_si, high * unit.per_si]);
        let mut panel = Panel::new(
            "",
            Axis::from_to("time", time.name, from * time.per_si, to * time.per_si),
            Axis::around(&format!("{} of the links", effort_name(self.motion)), unit.name, values),
        );
        for (i, station) in self.stations.iter().enumerate() {
            let points = station.link.points(room.min(width.stretches()));
            panel.curve(&station.name, Style::Signal(i), scaled(points, time.per_si, unit.per_si));
        }
        let most = |station: &StationRun| {
            let (low, high) = station.link.range().unwrap_or((0.0, 0.0));
            format!("{} {}", station.name, unit.say(low.abs().max(high.abs()), 4))
        };
        let most: Vec<String> = self.stations.iter().map(most).collect();
        let what = effort_name(self.motion);
        Figure {
            title: format!("{}: {what} of the links on each puck", self.name),
            alt: format!("The {what} of the links over time, a curve a station. At most: {}.", most.join(", ")),
            panels: vec![panel],
            columns: 1,
        }
    }

    fn text(&self, network: &System) -> Markup {
        html! {
            @if let Some(failure) = &self.failure { p.verdict.unstable { b { "Ended early" } ": " (failure) } }
            dl {
                @for station in &self.stations {
                    dt { (station.name) }
                    dd {
                        (station.samples) " samples, command at most " (say_effort(station.peak, self.motion)) "; the hand gave "
                        (say_energy(station.hand))
                    }
                }
                @for (link, [first, second]) in network.links.iter().zip(&self.let_go) {
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

/// A network with its certificate and its runs.
#[derive(Debug)]
pub struct NetworkReport<'n> {
    /// Its title, or its file's name.
    pub title: String,
    /// The file's name without folder and ending, under which its files are written.
    pub stem: String,
    /// In SI.
    pub network: &'n System,
    /// The text of each station's world.
    pub parameters: &'n [Vec<Parameter>],
    /// Its certificate.
    pub check: &'n NetworkCheck,
    /// The runs of the scenarios.
    pub runs: Vec<NetworkScenario>,
    /// Where its wheels are to be grabbed, from its page.
    pub live: Option<String>,
}

/// The approximate number of intervals of all curves on a page.
const INTERVALS: usize = 12_000;

impl NetworkReport<'_> {
    /// Every figure, in the order of the page: a world for each station, then two for each run.
    pub fn drawings(&self) -> Vec<Drawing> {
        let world = |station: &hapt_model::Station| {
            let of = |own| diagram(&station.world, own).svg;
            Drawing::one(
                &format!("{}-world", station.name),
                &format!("The world of {}", station.name),
                of(false),
                of(true),
            )
        };
        let mut list: Vec<Drawing> = self.network.stations.iter().map(world).collect();
        let curves: usize = self.network.stations.iter().map(|station| 2 * (station.world.bodies.len() + 1) + 2).sum();
        let room = (INTERVALS / (curves * self.runs.len()).max(1)).clamp(12, Width::Wide.stretches());
        for run in &self.runs {
            list.push(Drawing::new(&format!("{}-motion", run.name), |width| run.motion(width, room)));
            list.push(Drawing::new(&format!("{}-links", run.name), |width| run.links(width, room)));
        }
        list
    }

    /// The page; `drawings` are [`NetworkReport::drawings`].
    pub fn page(&self, drawings: &[Drawing], index: bool) -> String {
        let (worlds, runs) = drawings.split_at(drawings.len() - 2 * self.runs.len());
        let sentence = self.check.verdict_sentence();
        let (name, capital, colour) = match self.check.certified {
            true => ("certified", "Certified", "stable"),
            false => ("not certified", "Not certified", "unstable"),
        };
        document(
            &self.title,
            html! {
                main {
                    @if index { p.soft { a href="index.html" { "All worlds" } } }
                    h1 { (self.title) }
                    p.soft { (self.line()) }
                    p class={ "verdict " (colour) } { b { (capital) } (sentence.strip_prefix(name).unwrap_or(&sentence)) "." }
                    @if let Some(live) = &self.live {
                        p { a href=(live) { "Grab the wheels" } ": all stations run in your browser, with the links between them, for your mouse or several fingers." }
                    }
                    dl {
                        @for station in &self.check.stations {
                            dt { (station.name) } dd { (station.sentence()) "." }
                            @for reason in &station.not_proved { dt { "not proved" } dd { (reason) "." } }
                        }
                    }
                    @if let Some((what, heading, lines)) = self.check.proposal() {
                        @if lines.is_empty() {
                            p { "No single change of these numbers makes it passive." }
                        } @else {
                            p { (if what == "margins" { "Margins: " } else { "Remedies: " }) (heading) "." }
                            pre { (lines.join("\n")) }
                        }
                    }
                    @for note in &self.check.notes { p.soft { "Note: " (note) "." } }
                    h2 { "Links" }
                    (self.links())
                    @for (run, drawings) in self.runs.iter().zip(runs.chunks(2)) {
                        h2 { "Scenario " (run.name) }
                        (run.text(self.network))
                        @for drawing in drawings { (drawing.markup()) }
                    }
                    @for ((station, drawing), list) in self.network.stations.iter().zip(worlds).zip(self.parameters) {
                        h2 { "Station " (station.name) }
                        p.soft { (station.file) ", " (say_time(station.world.sampling.period)) " a sample" }
                        (drawing.markup())
                        (parameters(list))
                    }
                }
            },
        )
    }

    /// "2 stations, 1 link"
    pub(crate) fn line(&self) -> String {
        let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        format!("{}, {}", count(self.network.stations.len(), "station"), count(self.network.links.len(), "link"))
    }

    fn links(&self) -> Markup {
        let [unit, damping] = match self.network.motion {
            Motion::Rotary => ["N·m/rad", "N·m·s/rad"],
            Motion::Linear => ["N/m", "N·s/m"],
        };
        html! {
            div.scroll tabindex="0" {
                table {
                    thead { tr { th { "between" } th { "kind" } th { "stiffness (" (unit) ")" } th { "passive up to" } th { "damping (" (damping) ")" } th { "age_max" } th { "limit" } th { "on the way" } th { "lost" } } }
                    tbody {
                        @for (link, check) in self.network.links.iter().zip(&self.check.links) {
                            tr {
                                td { (between(self.network, link.between)) }
                                td { (if matches!(link.law, Law::Wall { .. }) { "wall" } else { "spring" }) }
                                td.number { (number(check.stiffness, 4)) }
                                td.number { (check.stiffness_max.map_or("none".into(), |k| number(k, 4))) }
                                td.number { (number(check.damping, 4)) }
                                td.number { (say_time(check.age_max_s)) }
                                td.number { (link.limit.map_or("none".into(), |limit| say_effort(limit, self.network.motion))) }
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
