//! The results of a conformance test of a force-feedback wheel, as a page.

use maud::html;

use crate::extremes::Point;
use crate::figure::{Axis, Figure, Panel, Style};
use crate::page::{Drawing, document};
use crate::ticks::number;

/// One case.
#[derive(Clone, Debug)]
pub struct ConformanceCase {
    /// Its name.
    pub name: String,
    /// The request, in a sentence.
    pub asks: String,
    /// Whether the wheel renders the request.
    pub conforms: bool,
    /// The result, in a sentence.
    pub verdict: String,
    /// The root mean square of the difference, in % of the largest torque.
    pub off: f64,
    /// The torque that acted over time in s, in % of the largest torque.
    pub acted: Vec<Point>,
    /// The torque that was meant, in the same form.
    pub meant: Vec<Point>,
}

/// A wheel with its cases.
#[derive(Clone, Debug)]
pub struct ConformanceReport {
    /// The wheel's own name.
    pub wheel: String,
    /// The result of all cases, in a sentence.
    pub verdict: String,
    /// The identified numbers of the wheel, with their names.
    pub found: Vec<(String, String)>,
    /// In the order in which they were played.
    pub cases: Vec<ConformanceCase>,
    /// The known errors of drivers, and the cases in which this wheel has them.
    pub errors: Vec<(String, Vec<String>)>,
}

impl ConformanceReport {
    /// The page.
    pub fn page(&self) -> String {
        let drawings: Vec<Drawing> = self.cases.iter().map(drawing).collect();
        let good = self.cases.iter().all(|case| case.conforms);
        document(
            &format!("Effects of {}", self.wheel),
            None,
            html! {
                main {
                    h1 { "Effects of " (self.wheel) }
                    p.soft { "hapt wheel --conform: what the wheel makes of each effect, by its own motion" }
                    p class={ "verdict " (state(good)) } { (self.verdict) }
                    dl { @for (name, text) in &self.found { dt { (name) } dd { (text) } } }
                    div.scroll tabindex="0" {
                        table {
                            thead { tr { th { "case" } th { "asked for" } th { "off" } th { "found" } } }
                            tbody {
                                @for case in &self.cases {
                                    tr {
                                        td { (case.name) }
                                        td { (case.asks) }
                                        td.number { (format!("{:.2} %", case.off)) }
                                        td class={ "state " (state(case.conforms)) } { (case.verdict) }
                                    }
                                }
                            }
                        }
                    }
                    h2 { "Known errors of drivers" }
                    div.scroll tabindex="0" {
                        table {
                            thead { tr { th { "error" } th { "here" } } }
                            tbody {
                                @for (error, cases) in &self.errors {
                                    tr {
                                        td { (error) }
                                        td class={ "state " (state(cases.is_empty())) } {
                                            @if cases.is_empty() { "no" } @else { (cases.join(", ")) }
                                        }
                                    }
                                }
                            }
                        }
                    }
                    h2 { "Torques" }
                    p.soft { "Means over 0.2 s, without the torque that makes the wheel swing; positive is to the right." }
                    @for drawing in &drawings { (drawing.markup()) }
                }
            },
        )
    }
}

fn state(good: bool) -> &'static str {
    if good { "stable" } else { "unstable" }
}

fn drawing(case: &ConformanceCase) -> Drawing {
    let values = || case.acted.iter().chain(&case.meant);
    let end = values().map(|(time, _)| *time).fold(0.0, f64::max);
    let mut panel = Panel::new(
        "",
        Axis::from_to("time", "s", 0.0, end),
        Axis::around("torque", "%", values().map(|(_, torque)| *torque)),
    );
    panel.curve("meant", Style::Predicted, case.meant.clone());
    panel.curve("given", Style::Signal(0), case.acted.clone());
    let figure = Figure {
        title: format!("{}: {}", case.name, case.verdict),
        alt: format!("{}: {}. {}; {} % off.", case.name, case.asks, case.verdict, number(case.off, 2)),
        panels: vec![panel],
        columns: 1,
    };
    Drawing::new(&case.name.replace(' ', "-"), |_| figure.clone())
}
