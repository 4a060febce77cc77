//! A comparison of several worlds.

use hapt_model::Motion;
use maud::{Markup, html};

use crate::extremes::Point;
use crate::figure::Figure;
use crate::page::{Drawing, Report, critical, document, loop_line, rate, verdict_name};
use crate::stability::{Half, growth_by_period, period_panel};
use crate::svg::Width;
use crate::units::{say_effort, say_time};

/// The largest number of worlds in one figure.
const MAX_PANELS: usize = 12;
/// The largest number of worlds with separate colours.
const MAX_CURVES: usize = 7;

/// The drawings of the index, from the worlds of the pages.
pub fn index_drawings(reports: &[Report<'_>]) -> Vec<Drawing> {
    let mut list = Vec::new();
    for motion in [Motion::Rotary, Motion::Linear] {
        let runs: Vec<_> = reports
            .iter()
            .filter(|report| report.world().is_some() && report.system.motion == motion)
            .filter_map(|report| Some((report, report.runs.first()?)))
            .take(MAX_PANELS)
            .collect();
        if runs.len() > 1 {
            let size = runs.iter().map(|(_, run)| run.traces[0].largest_effort()).fold(0.0, f64::max);
            let (name, what) = match motion {
                Motion::Rotary => ("torques", "Torque"),
                Motion::Linear => ("forces", "Force"),
            };
            list.push(Drawing::new(name, |width| {
                let panel = |(report, run): &(&Report<'_>, &crate::Run<'_>)| {
                    let title = clipped(&report.title, if width == Width::Wide { 36 } else { 32 });
                    run.traces[0].torque_panel(&title, size, width)
                };
                let sentences: Vec<String> = runs
                    .iter()
                    .map(|(report, run)| {
                        format!("{} peaks at {}", report.title, say_effort(run.summary.peak_torque(), motion))
                    })
                    .collect();
                Figure {
                    title: format!("{what} in the first scenario of each world"),
                    alt: format!("{what} over time, a panel a world on one scale: {}.", sentences.join("; ")),
                    panels: runs.iter().map(panel).collect(),
                    columns: 2,
                }
            }));
        }
    }
    // A decade to either side of all periods: with a distant critical period on the axis the curves would be flat.
    let worlds = || reports.iter().filter_map(|report| Some((report, report.world()?)));
    let periods = || worlds().map(|(_, (_, check))| check.period_s);
    let span = (0.1 * periods().fold(f64::INFINITY, f64::min), 10.0 * periods().fold(0.0, f64::max));
    let curves: Vec<(&str, Vec<Point>)> = worlds()
        .map(|(report, (world, check))| (report.title.as_str(), growth_by_period(Half::Held, world, check, span)))
        .filter(|(_, curve)| !curve.is_empty())
        .take(MAX_CURVES)
        .collect();
    if curves.len() > 1 {
        let borrowed: Vec<(&str, &[Point])> = curves.iter().map(|(name, curve)| (*name, curve.as_slice())).collect();
        if let Some(panel) = period_panel(&borrowed) {
            let names: Vec<&str> = curves.iter().map(|(name, _)| *name).collect();
            let figure = Figure {
                title: "Growth against period".into(),
                alt: format!("Growth of the held worlds against the sampling period: {}.", names.join("; ")),
                panels: vec![panel],
                columns: 1,
            };
            list.push(Drawing::new("periods", |_| figure.clone()));
        }
    }
    list
}

/// At most `most` characters of a text.
fn clipped(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.into(),
    }
}

/// The page that compares the worlds and networks, with links to their pages.
pub fn index_page(reports: &[Report<'_>], drawings: &[Drawing]) -> String {
    let (worlds, networks): (Vec<&Report<'_>>, Vec<_>) = reports.iter().partition(|report| report.world().is_some());
    document(
        "Worlds side by side",
        None,
        html! {
            main {
                h1 { "Worlds side by side" }
                @if !worlds.is_empty() { div.scroll tabindex="0" { (table(&worlds)) } }
                @if !networks.is_empty() { (table_of_networks(&networks)) }
                @for drawing in drawings { (drawing.markup()) }
            }
        },
    )
}

fn table_of_networks(networks: &[&Report<'_>]) -> Markup {
    html! {
        table {
            thead { tr { th { "network" } th { "certified" } th { "stations and links" } } }
            tbody {
                @for report in networks {
                    tr {
                        td { a href={ (report.stem) ".html" } { (report.title) } }
                        td class={ "state " (if report.check.is_certified() { "stable" } else { "unstable" }) } {
                            (if report.check.is_certified() { "yes" } else { "no" })
                        }
                        td { (report.line()) }
                    }
                }
            }
        }
    }
}

fn table(reports: &[&Report<'_>]) -> Markup {
    let worlds = reports.iter().filter_map(|report| Some((report, report.world()?)));
    html! {
        table {
            thead {
                tr { th { "world" } th { "certified" } th { "held" } th { "growth per s" } th { "critical period" } th { "hands-off" } th { "peak torque" } th { "first clipped" } th { "loop" } }
            }
            tbody {
                @for (report, (world, check)) in worlds {
                    tr {
                        td { a href={ (report.stem) ".html" } { (report.title) } }
                        td class={ "state " (if check.certified.holds() { "stable" } else { "unstable" }) } {
                            (if check.certified.holds() { "yes" } else { "no" })
                        }
                        td class={ "state " (verdict_name(&check.held)) } { (verdict_name(&check.held)) }
                        td.number { (check.held.growth_per_s.map_or("none".into(), rate)) }
                        td.number { (critical(&check.held)) }
                        td class={ "state " (verdict_name(&check.free)) } { (verdict_name(&check.free)) }
                        td.number { @for run in &report.runs { (say_effort(run.summary.peak_torque(), world.motion)) br; } }
                        td.number {
                            @for run in &report.runs {
                                @match (world.device.limit, run.summary.stations[0].first_clipped) {
                                    (None, _) => "no limit",
                                    (_, Some((_, time))) => (say_time(time)),
                                    (_, None) => "never",
                                }
                                br;
                            }
                        }
                        td { (loop_line(world)) }
                    }
                }
            }
        }
    }
}
