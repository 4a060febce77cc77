//! One world, or network of stations, as one page, without network or other external content.

use hapt_analysis::certificate::text::rates;
use hapt_analysis::{Check, Stability, SystemCheck, Verdict};
use hapt_model::{Parameter, System, World};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

use crate::diagram::diagram;
use crate::figure::Figure;
use crate::recorded::PlotScript;
use crate::run::Run;
use crate::stability::{self, Half};
use crate::style::STYLE;
use crate::svg::Width;
use crate::ticks::number;
use crate::units::{effort_name, say_effort, say_energy, say_time};

/// The style of the page; figures have [`STYLE`].
const PAGE_STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1b1e22;--soft:#565d66;--paper:#fff;--line:#d9dde2;--well:#f5f6f8;--link:#00588f;\
--good:#00704f;--even:#5a5f00;--bad:#a33c00}\
@media screen and (prefers-color-scheme:dark){:root{--ink:#e7e9ec;--soft:#a5adb6;--paper:#15181c;--line:#343a41;--well:#1d2126;\
--link:#6cc0f2;--good:#3ccfa3;--even:#e6d95a;--bad:#ff9257}}\
*{box-sizing:border-box}\
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif}\
main{max-width:860px;margin:0 auto;padding:24px 20px 60px}main.broad{max-width:1200px}\
h1{font-size:1.7em;line-height:1.2;margin:.2em 0 .3em;overflow-wrap:anywhere}\
h2{font-size:1.2em;margin:2em 0 .4em;border-top:1px solid var(--line);padding-top:1em;overflow-wrap:anywhere}\
p{margin:.4em 0}a{color:var(--link)}.soft{color:var(--soft)}\
.verdict{border-left:5px solid;padding:.5em .8em;background:var(--well);margin:1em 0}\
.verdict.stable{border-color:var(--good)}.verdict.marginal{border-color:var(--even)}.verdict.unstable{border-color:var(--bad)}\
.stable b,.state.stable{color:var(--good)}.marginal b,.state.marginal{color:var(--even)}.unstable b,.state.unstable{color:var(--bad)}\
figure{margin:1.2em 0}figure svg.hapt{display:block;width:100%;height:auto}\
figcaption{font-weight:600;margin-bottom:.2em}.narrow{display:none}.scroll{overflow-x:auto}\
.scroll svg.hapt{width:auto;max-width:100%}.scroll table{min-width:56em}.scroll td:last-child{min-width:15em}.scroll td{overflow-wrap:normal}\
table{border-collapse:collapse;width:100%;font-size:.9em}\
th,td{text-align:left;vertical-align:top;padding:.28em .9em .28em 0;border-bottom:1px solid var(--line)}\
th{font-weight:600}td{overflow-wrap:anywhere}td.key{font-family:ui-monospace,'DejaVu Sans Mono',monospace;font-size:.9em}\
td.number{overflow-wrap:normal}.state{overflow-wrap:normal;font-weight:600}tr.default td{color:var(--soft)}\
td .doc{display:block;color:var(--soft);font:.85em/1.35 system-ui,'DejaVu Sans',sans-serif}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:.15em 1em;margin:.6em 0}pre{background:var(--well);padding:.6em .8em;overflow-x:auto;font:.85em/1.45 ui-monospace,'DejaVu Sans Mono',monospace}dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}\
@media screen and (max-width:700px){body{font-size:15px}main{padding:14px 14px 40px}.wide{display:none}.narrow{display:block}\
td.key{font-size:.8em}th,td{padding-right:.5em}.parameters{table-layout:fixed}dl{grid-template-columns:1fr}dd{margin-bottom:.4em}}\
@media print{.scroll svg.hapt{min-width:0!important}.scroll table{min-width:0}main{max-width:none;padding:0}figure,tr,.verdict{break-inside:avoid}h2{break-after:avoid}body{font-size:11pt}}";

/// The approximate total size of a page's figures.
const BUDGET: usize = 620_000;
/// The approximate size of the data for its plots.
pub(crate) const PLOTS: usize = 250_000;

/// A figure in a page and in a separate file.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The name of its file, after the world's name.
    pub name: String,
    /// The file.
    pub file: String,
    caption: String,
    wide: String,
    /// The layout for narrow pages; `None` where one layout fits every width.
    narrow: Option<String>,
}

impl Drawing {
    /// The drawing of a figure for both widths.
    pub(crate) fn new(name: &str, figure: impl Fn(Width) -> Figure) -> Self {
        let wide = figure(Width::Wide);
        Drawing {
            name: name.into(),
            file: wide.svg(Width::Wide, true),
            wide: wide.svg(Width::Wide, false),
            narrow: Some(figure(Width::Narrow).svg(Width::Narrow, false)),
            caption: wide.title,
        }
    }

    /// A drawing that fits every width: `inline` in a page, and `file` as a separate file.
    pub(crate) fn one(name: &str, caption: &str, inline: String, file: String) -> Self {
        Drawing { name: name.into(), file, caption: caption.into(), wide: inline, narrow: None }
    }

    pub(crate) fn markup(&self) -> Markup {
        html! {
            figure {
                figcaption { (self.caption) }
                @match &self.narrow {
                    Some(narrow) => {
                        div.wide { (PreEscaped(&self.wide)) }
                        div.narrow { (PreEscaped(narrow)) }
                    }
                    None => div.scroll tabindex="0" { (PreEscaped(&self.wide)) },
                }
            }
        }
    }
}

/// A system with its certificate and its runs.
///
/// ```
/// use hapt_model::{Source, System, parameters};
/// use hapt_report::{Report, Run};
///
/// let file = r#"
/// title = "A spring"
/// loop.period = "1 ms"
/// device = { inertia = "6.4e-4 kg m^2", damping = "1e-3 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "0.5 N m/rad"
/// [scenarios.turn]
/// duration = "1 s"
/// hand = { kind = "sine", amplitude = "30 deg", frequency = "2 Hz" }
/// "#;
/// let source = Source::from_text("spring.toml", file);
/// let system = System::read(&source, &[])?;
/// let (check, parameters) = (hapt_analysis::check_system(&system, false)?, [parameters(&source, &[])?]);
/// let mut simulation = hapt_sim::Run::new(&system, "turn")?;
/// let mut run = Run::new(&system, "turn", &simulation, &check);
/// while let Some(row) = simulation.next() {
///     run.add(&row?);
/// }
/// let report = Report {
///     title: "A spring".into(),
///     stem: "spring".into(),
///     system: &system,
///     parameters: &parameters,
///     check: &check,
///     proposal: None,
///     runs: vec![run],
///     live: None,
///     plots: None,
/// };
/// let drawings = report.drawings();
/// assert!(drawings.iter().any(|drawing| drawing.name == "turn-motion"));
/// let page = report.page(&drawings, false);
/// assert!(page.contains("<h1>A spring</h1>") && page.contains("turn"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Report<'s> {
    /// Its title, or its file's name.
    pub title: String,
    /// The file's name without folder and ending, under which its files are written.
    pub stem: String,
    /// In SI.
    pub system: &'s System,
    /// The text of each station's world.
    pub parameters: &'s [Vec<Parameter>],
    /// Its certificate.
    pub check: &'s SystemCheck,
    /// Of a world, remedies or margins: a heading, and lines to paste into its file.
    pub proposal: Option<(&'s str, &'s [String])>,
    /// The runs of the scenarios.
    pub runs: Vec<Run<'s>>,
    /// The link to the page that runs it, where there is one.
    pub live: Option<String>,
    /// The script of interactive figures of the runs; `None`: static figures.
    pub plots: Option<PlotScript<'s>>,
}

impl Report<'_> {
    /// Every figure, in the order of the page.
    pub fn drawings(&self) -> Vec<Drawing> {
        let Some((world, check)) = self.world() else { return self.drawings_of_network() };
        let (inline, own) = (diagram(world, false), diagram(world, true));
        let mut list = vec![Drawing::one("world", "The world", inline.svg, own.svg)];
        for half in [Half::Held, Half::Free] {
            if let Some(figure) = stability::eigenvalues(half, check) {
                list.push(Drawing::new(&half.file("eigenvalues"), |_| figure.clone()));
            }
            if let Some(figure) = stability::periods(half, world, check) {
                list.push(Drawing::new(&half.file("periods"), |_| figure.clone()));
            }
        }
        let room = self.room(world);
        for run in &self.runs {
            list.push(Drawing::new(&format!("{}-motion", run.name), |width| run.motion(width, room)));
            list.push(Drawing::new(&format!("{}-energy", run.name), |width| run.energy(width, room)));
        }
        list
    }

    /// The number of intervals per curve, so that a page of many scenarios and bodies stays small.
    fn room(&self, world: &World) -> usize {
        let curves = self.runs.len().max(1) * (2 * (world.bodies.len() + 1) + 2 + 5);
        // Two points per interval of about seven bytes each, drawn wide and narrow.
        let each = BUDGET / curves / (2 * 7 + 2 * 7 * 2 / 5);
        each.clamp(12, Width::Wide.stretches())
    }

    /// The world and its certificate; `None` of a network.
    pub(crate) fn world(&self) -> Option<(&World, &Check)> {
        match self.check {
            SystemCheck::World(check) => Some((self.system.world()?, check)),
            SystemCheck::Network(_) => None,
        }
    }

    /// The page; `drawings` are [`Report::drawings`].
    pub fn page(&self, drawings: &[Drawing], index: bool) -> String {
        let of_world = self.world().map(|(world, check)| self.of_world(world, check, drawings));
        document(
            &self.title,
            self.plots.filter(|_| !self.runs.is_empty()),
            html! {
                main {
                    @if index { p.soft { a href="index.html" { "All worlds" } } }
                    h1 { (self.title) }
                    @if let Some(page) = of_world { (page) }
                    @if let SystemCheck::Network(check) = self.check { (self.of_network(check, drawings)) }
                }
            },
        )
    }

    /// A run's figures, with the data of the interactive ones.
    fn figures(&self, world: &World, run: &Run<'_>, drawings: &[Drawing]) -> Markup {
        let still = html! { @for drawing in drawings { (drawing.markup()) } };
        if self.plots.is_none() {
            return still;
        }
        let data = run.plots(world, &format!("{}-{}", self.stem, run.name), PLOTS / self.runs.len().max(1));
        run_data(&[data], &still)
    }

    /// The page of a world below its title.
    fn of_world(&self, world: &World, check: &Check, drawings: &[Drawing]) -> Markup {
        let (loop_figures, run_figures) = drawings.split_at(drawings.len() - 2 * self.runs.len());
        let (world_figure, loop_figures) = loop_figures.split_at(1);
        let (free_figures, held_figures): (Vec<&Drawing>, Vec<&Drawing>) =
            loop_figures.iter().partition(|drawing| drawing.name.starts_with(&Half::Free.file("")));
        html! {
            p.soft { (loop_line(world)) }
            @if let Some(live) = &self.live {
                p { a href=(live) { "Grab it" } ": this loop runs in your browser, with a hand for your mouse." }
            }
            (verdict(check))
            @if let Some((heading, lines)) = self.proposal {
                p { (if check.certified.holds() { "Margins: " } else { "Remedies: " }) (heading) "." }
                @if !lines.is_empty() { pre tabindex="0" { (lines.join("\n")) } }
            }
            @for note in &check.notes { p.soft { "Note: " (note) } }
            @for drawing in world_figure { (drawing.markup()) }
            h2 { "The world, the puck held still" }
            @if held_figures.is_empty() {
                p { "The world has no bodies: nothing of it moves while the puck is held, and there are no eigenvalues." }
            } @else {
                (numbers(&check.held))
            }
            @for drawing in held_figures { (drawing.markup()) }
            h2 { "The whole loop, hands-off" }
            (numbers(&check.free))
            @for drawing in free_figures { (drawing.markup()) }
            @for (run, drawings) in self.runs.iter().zip(run_figures.chunks(2)) {
                h2 { "Scenario " (run.name) }
                (scenario(world, check, run))
                (self.figures(world, run, drawings))
            }
            h2 { "Parameters" }
            @for list in self.parameters { (parameters(list)) }
        }
    }
}

/// "forward-euler at 1 ms a sample, torque from the start of the step"
pub(crate) fn loop_line(world: &World) -> String {
    let sampling = &world.sampling;
    format!(
        "{}, {} a sample{}, torque from the {} of the step",
        sampling.method.name(),
        say_time(sampling.period),
        rates(sampling),
        sampling.output.name()
    )
}

fn scenario(world: &World, check: &Check, run: &Run<'_>) -> Markup {
    let (summary, motion) = (&run.summary.stations[0], world.motion);
    let effort = |x| say_effort(x, motion);
    html! {
        @if let Some(failure) = &run.failure { p.verdict.unstable { b { "Ended early" } ": " (failure) } }
        dl {
            dt { "duration" } dd { (say_time(run.duration)) }
            dt { "peak " (effort_name(motion)) } dd { (effort(summary.peak_torque)) " at " (say_time(summary.peak_time)) }
            dt { "motor" }
            dd {
                @match (world.device.limit, summary.first_clipped) {
                    (None, _) => "no limit given",
                    (Some(limit), None) => { "never beyond its limit, " (effort(limit)) }
                    (Some(limit), Some((sample, time))) => {
                        "beyond its limit, " (effort(limit)) ", at " (summary.clipped) " of " (summary.rows)
                        " samples, first at sample " (sample) " (" (say_time(time)) ")"
                    }
                }
            }
            @if let Some(fitted) = summary.fitted_growth() {
                dt { "growth" }
                dd {
                    (rate(fitted)) " per second fitted to the run"
                    @if let Some(predicted) = check.held.growth_per_s { ", " (rate(predicted)) " predicted" }
                }
            }
            dt { "energy" }
            dd {
                "the hand gave " (say_energy(summary.ledger.hand)) ", the motor " (say_energy(summary.ledger.motor))
                @if !world.device.torque.is_none() { ", gravity and cogging " (say_energy(summary.ledger.field)) }
                "; damping took " (say_energy(summary.ledger.damping)) ", friction " (say_energy(summary.ledger.friction))
                @if world.device.stops.is_some() { ", the stops " (say_energy(summary.ledger.stops)) }
                @if world.device.handle.is_some() { ", the shaft " (say_energy(summary.ledger.shaft)) }
                "; the world stores " (say_energy(summary.final_energy()))
            }
        }
    }
}

/// The static figures of a run with the data of the interactive ones, one entry for each clock.
pub(crate) fn run_data(data: &[Value], still: &Markup) -> Markup {
    html! {
        div.run {
            (still)
            @for data in data {
                // Data, which no browser runs; the escape prevents its text from ending the element.
                script type="application/json" { (PreEscaped(data.to_string().replace('<', "\\u003c"))) }
            }
        }
    }
}

/// The numbers of a half of the certificate.
fn numbers(of: &Stability) -> Markup {
    html! {
        dl {
            @if let Some(growth) = of.growth_per_s {
                dt { "growth" } dd { (rate(growth)) " per second" }
            }
            dt { "largest |λ|" } dd { (number(of.spectral_radius, 10)) }
            dt { "critical period" }
            dd { (critical(of)) }
            @for mode in &of.modes {
                dt { "mode" }
                dd {
                    (number(mode.frequency_hz, 5)) " Hz, damping ratio " (number(mode.damping_ratio, 4))
                    @match (mode.discrete_frequency_hz, mode.discrete_damping_ratio) {
                        (Some(frequency), Some(ratio)) => {
                            "; in this loop " (number(frequency, 5)) " Hz, damping ratio "
                            (number(if ratio.abs() < 1e-12 { 0.0 } else { ratio }, 4))
                        }
                        _ => "; in this loop it does not swing",
                    }
                }
            }
        }
    }
}

/// A growth rate; below a billionth it is rounding.
pub(crate) fn rate(growth: f64) -> String {
    if growth.abs() < 1e-9 { "0".into() } else { number(growth, 6) }
}

pub(crate) fn critical(of: &Stability) -> String {
    match (of.critical_period_s, of.critical_period_reason) {
        (Some(period), _) => say_time(period),
        (None, Some("never")) => "none: unstable however short".into(),
        (None, Some("not searched")) => "not searched".into(),
        (None, _) => "none: never unstable".into(),
    }
}

pub(crate) fn verdict_name(of: &Stability) -> &'static str {
    match of.verdict {
        Verdict::Stable => "stable",
        Verdict::Marginal => "marginal",
        Verdict::Unstable => "unstable",
    }
}

/// The certificate: the verdict and its reasons.
fn verdict(check: &Check) -> Markup {
    let headline = check.headline();
    let (status, reason) = headline.split_once(": ").unwrap_or((&headline, ""));
    let colour = if check.certified.holds() { "stable" } else { "unstable" };
    html! {
        p class={ "verdict " (colour) } { b { (status) } ": " (reason) "." }
        dl {
            dt { "held" } dd { (check.sentence()) "." }
            dt { "free" } dd { (check.free_sentence()) "." }
            dt { "passive" } dd { (check.passivity_sentence()) "." }
            @for reason in &check.passivity.not_proved { dt { "not proved" } dd { (reason) "." } }
            @if let Some(uneven) = check.uneven_sentence() { dt { "uneven" } dd { (uneven) "." } }
            @if let Some(counts) = check.quantisation_sentence() { dt { "counts" } dd { (counts) "." } }
        }
    }
}

pub(crate) fn parameters(list: &[Parameter]) -> Markup {
    html! {
        table.parameters {
            thead { tr { th { "key" } th { "as written" } th { "in SI" } } }
            tbody {
                @for parameter in list {
                    tr class=[(!parameter.given).then_some("default")] {
                        td.key { (parameter.path) span.doc { (parameter.doc) } }
                        td {
                            (parameter.written)
                            @if parameter.tolerance > 0.0 { " ± " (number(100.0 * parameter.tolerance, 4)) " %" }
                            @if !parameter.given { " (default)" }
                        }
                        td.number { @if let Some(si) = parameter.si { (number(si, 6)) " " (parameter.unit.replace("^2", "²")) } }
                    }
                }
            }
        }
    }
}

/// A whole document around `body`.
pub(crate) fn document(title: &str, plots: Option<PlotScript<'_>>, body: Markup) -> String {
    // Even if a world's text escaped its element, the policy would prevent it from loading or running anything.
    let own = plots.map_or(String::new(), |plots| format!("; script-src 'sha256-{}'", plots.sum));
    let policy = format!("default-src 'none'; style-src 'unsafe-inline'{own}");
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="generator" content={ "hapt " (env!("CARGO_PKG_VERSION")) };
                title { (title) }
                style { (PreEscaped(PAGE_STYLE)) (PreEscaped(STYLE)) (PreEscaped(plots.map_or("", |plots| plots.style))) }
            }
            body {
                (body)
                @if let Some(plots) = plots { script { (PreEscaped(plots.script)) } }
            }
        }
    }
    .into_string()
}
