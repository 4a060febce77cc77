//! A world as a drawing: puck, bodies, ground, and the couplings between them, in the form of the notes' figures 2 and 4.
//!
//! The bodies are in a row, each as near to the puck as its couplings allow; couplings of neighbours are between them, those to ground
//! below, and those that pass a body above.

use std::fmt::Write as _;

use hapt_model::{Coupling, Damping, Drive, End, Law, Motion, World};

use crate::figure::Style;
use crate::svg::{Width, class, escaped, open, text, text_width};
use crate::ticks::number;
use crate::units::{DEGREES, say_effort};

const NODE: f64 = 92.0;
const TALL: f64 = 50.0;
const GAP: f64 = 138.0;
/// The distance between parallel couplings.
const LANE: f64 = 44.0;
const DOWN: f64 = 118.0;

/// The drawing, and its description.
#[derive(Clone, Debug)]
pub struct Diagram {
    /// SVG.
    pub svg: String,
    /// The alternative text.
    pub alt: String,
}

/// Draws a world, as a separate file with its styles, or for a page that includes them.
pub fn diagram(world: &World, own_file: bool) -> Diagram {
    let order = order(world);
    let place = |end: End| match end {
        End::Puck => Some(0),
        End::Body(body) => order.iter().position(|&b| b == body).map(|i| i + 1),
        End::Ground => None,
    };
    let mut between: Vec<Vec<&Coupling>> = vec![Vec::new(); order.len()];
    let mut below: Vec<Vec<&Coupling>> = vec![Vec::new(); order.len() + 1];
    let mut above: Vec<(usize, usize, &Coupling)> = Vec::new();
    for coupling in &world.couplings {
        let ends = (place(coupling.first), place(coupling.second));
        match ends {
            (Some(a), Some(b)) if a.abs_diff(b) == 1 => push(&mut between, a.min(b), coupling),
            (Some(a), Some(b)) => above.push((a.min(b), a.max(b), coupling)),
            (Some(a), None) | (None, Some(a)) => push(&mut below, a, coupling),
            (None, None) => {}
        }
    }
    // Each node is as wide as the couplings below it need, and as tall as those at its sides need.
    let widths: Vec<f64> = below.iter().map(|list| NODE.max(DOWN * list.len() as f64)).collect();
    let most = between.iter().map(Vec::len).max().unwrap_or(0);
    let tall = TALL.max(LANE * most as f64 + 6.0);
    let top = 14.0 + LANE * above.len() as f64 + if own_file { 22.0 } else { 0.0 };
    let left = 66.0;
    let mut centres = Vec::new();
    let mut x = left;
    for (i, width) in widths.iter().enumerate() {
        centres.push(x + 0.5 * width);
        // A neighbour needs its gap only where the gap contains something.
        x += width
            + if between.get(i).is_some_and(|list| !list.is_empty()) {
                GAP - 0.5 * (width - NODE).min(60.0)
            } else {
                34.0
            };
    }
    let mut right = centres.last().copied().unwrap_or(left) + 0.5 * widths.last().copied().unwrap_or(NODE) + 14.0;
    let grounded = below.iter().any(|list| !list.is_empty());
    let floor = top + tall + if grounded { 92.0 } else { 34.0 };

    let mut body = String::new();
    let edge = |i: usize, side: f64| centres[i] + side * 0.5 * NODE;
    for (i, list) in between.iter().enumerate() {
        for (lane, coupling) in list.iter().enumerate() {
            let y = top + 0.5 * tall + LANE * (lane as f64 - 0.5 * (list.len() as f64 - 1.0)) - 6.0;
            let (a, b) = (edge(i, 1.0), edge(i + 1, -1.0));
            element(&mut body, &coupling.law, (a, y), (b, y));
            label(&mut body, 0.5 * (a + b), y + 22.0, "middle", world, coupling);
        }
    }
    for (i, list) in below.iter().enumerate() {
        for (lane, coupling) in list.iter().enumerate() {
            let at = centres[i] + DOWN * (lane as f64 - 0.5 * (list.len() as f64 - 1.0))
                - if list.len() > 1 { 30.0 } else { 0.0 };
            // A coupling beyond the node's edge is connected by an arm.
            if (at - centres[i]).abs() > 0.5 * NODE {
                let _ = write!(body, "<path class=\"ink\" d=\"M{:.1} {:.1}H{at:.1}\"/>", centres[i], top + tall - 8.0);
                let _ = write!(body, "<path class=\"ink\" d=\"M{at:.1} {:.1}V{:.1}\"/>", top + tall - 8.0, top + tall);
            }
            element(&mut body, &coupling.law, (at, top + tall), (at, floor));
            let wide = label(&mut body, at + 16.0, top + tall + 40.0, "start", world, coupling);
            right = right.max(at + 16.0 + wide + 4.0);
        }
    }
    for (lane, &(a, b, coupling)) in above.iter().enumerate() {
        let y = 20.0 + LANE * lane as f64 + if own_file { 22.0 } else { 0.0 };
        let shift = 8.0 + 5.0 * (lane % 6) as f64;
        let (from, to) = (centres[a] + shift, centres[b] - shift);
        let _ = write!(body, "<path class=\"ink\" d=\"M{from:.1} {top:.1}V{y:.1}M{to:.1} {top:.1}V{y:.1}\"/>");
        element(&mut body, &coupling.law, (from, y), (to, y));
        label(&mut body, 0.5 * (from + to), y + 22.0, "middle", world, coupling);
    }
    let names = std::iter::once("puck").chain(order.iter().filter_map(|&i| world.names.get(i)).map(String::as_str));
    let inertias = std::iter::once(world.device.inertia)
        .chain(order.iter().filter_map(|&i| world.bodies.get(i)).map(|b| b.inertia));
    for (i, (name, inertia)) in names.zip(inertias).enumerate() {
        node(&mut body, centres[i], top, tall, name, &inertia_text(inertia, world.motion), i == 0);
    }
    hand(&mut body, world, edge(0, -1.0), top + 0.5 * tall);
    if grounded {
        ground(&mut body, left - 20.0, right, floor);
    }

    let alt = alt(world);
    let title = "The world";
    let height = if grounded { floor + 16.0 } else { top + tall + 12.0 };
    let mut svg = open(Width::Wide, right.max(300.0), height, title, &alt, own_file);
    if own_file {
        text(&mut svg, 2.0, 18.0, "start", "bold", title);
    }
    svg += &body;
    svg += "</svg>";
    Diagram { svg, alt }
}

fn push<'a>(lists: &mut [Vec<&'a Coupling>], at: usize, coupling: &'a Coupling) {
    if let Some(list) = lists.get_mut(at) {
        list.push(coupling);
    }
}

/// The bodies by their distance from the puck in couplings; uncoupled ones come last.
fn order(world: &World) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::new();
    let mut ends = vec![End::Puck];
    let mut next = 0;
    while let Some(&end) = ends.get(next) {
        next += 1;
        for coupling in &world.couplings {
            let other = match (coupling.first == end, coupling.second == end) {
                (true, _) => coupling.second,
                (_, true) => coupling.first,
                _ => continue,
            };
            if let End::Body(body) = other
                && !order.contains(&body)
            {
                order.push(body);
                ends.push(other);
            }
        }
    }
    order.extend((0..world.bodies.len()).filter(|body| !order.contains(body)).collect::<Vec<_>>());
    order
}

/// A coupling's symbol on the line from `a` to `b`, which is level or upright.
fn element(svg: &mut String, law: &Law, a: (f64, f64), b: (f64, f64)) {
    let length = (b.0 - a.0).hypot(b.1 - a.1).max(1.0);
    let along = ((b.0 - a.0) / length, (b.1 - a.1) / length);
    let at = |s: f64, t: f64| (a.0 + along.0 * s - along.1 * t, a.1 + along.1 * s + along.0 * t);
    let middle = 0.5 * length;
    let half = 24.0f64.min(0.35 * length);
    let (from, to) = (middle - half, middle + half);
    let mut d = String::new();
    let mut go = |command: char, s: f64, t: f64| {
        let (x, y) = at(s, t);
        let _ = write!(d, "{command}{x:.1} {y:.1}");
    };
    go('M', 0.0, 0.0);
    go('L', from, 0.0);
    match law {
        Law::Spring { .. } => {
            for i in 0..8 {
                let s = from + (2.0 * half) * (f64::from(i) + 0.5) / 8.0;
                go('L', s, if i % 2 == 0 { -8.0 } else { 8.0 });
            }
            go('L', to, 0.0);
        }
        Law::Damper { .. } => {
            go('M', to - 12.0, -8.0);
            go('L', from, -8.0);
            go('L', from, 8.0);
            go('L', to - 12.0, 8.0);
            go('M', middle, -6.0);
            go('L', middle, 6.0);
            go('M', middle, 0.0);
            go('L', to, 0.0);
        }
        Law::Wall { .. } => {
            go('L', middle - 6.0, 0.0);
            go('M', middle + 4.0, -11.0);
            go('L', middle + 4.0, 11.0);
            for t in [-11.0, -4.0, 3.0] {
                go('M', middle + 4.0, t + 7.0);
                go('L', middle + 11.0, t);
            }
            go('M', middle + 4.0, 0.0);
            go('L', to, 0.0);
        }
        Law::Detent { .. } => {
            for i in 0..=24 {
                let s = f64::from(i) / 24.0;
                go('L', from + 2.0 * half * s, -8.0 * (3.0 * std::f64::consts::TAU * s).sin());
            }
        }
        Law::DeadBand { .. } => {
            // A spring with a slack interval.
            for i in 0..5 {
                let s = from + half * (f64::from(i) + 0.5) / 5.0;
                go('L', s, if i % 2 == 0 { -8.0 } else { 8.0 });
            }
            go('L', middle, 0.0);
            go('M', middle, -8.0);
            go('L', middle, 8.0);
            go('M', to - 8.0, -8.0);
            go('L', to - 8.0, 8.0);
            go('M', to - 8.0, 0.0);
            go('L', to, 0.0);
        }
        Law::Magnet { .. } => {
            // The torque against the distance: a pull on either side that fades.
            for i in 0..=24 {
                let s = f64::from(i) / 24.0;
                let x = 8.0 * s - 4.0;
                go('L', from + 2.0 * half * s, 8.0 * x * (0.5 * (1.0 - x * x)).exp());
            }
        }
        Law::Texture { waveform, .. } => {
            // Two periods of its torque.
            let angle = |s: f64| 2.0 * std::f64::consts::TAU * s;
            let steps = || (0..=64).map(|i| f64::from(i) / 64.0);
            let most = steps().map(|s| waveform.at(angle(s)).abs()).fold(f64::MIN_POSITIVE, f64::max);
            steps().for_each(|s| go('L', from + 2.0 * half * s, 8.0 * waveform.at(angle(s)) / most));
            go('L', to, 0.0);
        }
        Law::Coulomb { .. } | Law::Lugre { .. } => {
            // Two brushes in contact.
            go('L', to - 6.0, 0.0);
            for i in 0..4 {
                let s = from + (to - from) * (f64::from(i) + 0.5) / 4.5;
                go('M', s, 0.0);
                go('L', s + 4.0, 7.0);
            }
            go('M', from + 4.0, 9.0);
            go('L', to, 9.0);
            go('L', to, 0.0);
        }
        Law::Assist { .. } => {
            // A triangle, as block diagrams have a gain.
            go('L', middle - 8.0, 0.0);
            go('L', middle - 8.0, -9.0);
            go('L', middle + 8.0, 0.0);
            go('L', middle - 8.0, 9.0);
            go('L', middle - 8.0, 0.0);
            go('M', middle + 8.0, 0.0);
            go('L', to, 0.0);
        }
        Law::Acceleration { .. } => {
            // A box with a mass.
            go('L', middle - 9.0, 0.0);
            go('L', middle - 9.0, -9.0);
            go('L', middle + 9.0, -9.0);
            go('L', middle + 9.0, 9.0);
            go('L', middle - 9.0, 9.0);
            go('L', middle - 9.0, 0.0);
            go('M', middle - 4.0, -4.0);
            go('L', middle + 4.0, -4.0);
            go('L', middle + 4.0, 4.0);
            go('L', middle - 4.0, 4.0);
            go('L', middle - 4.0, -4.0);
            go('M', middle + 9.0, 0.0);
            go('L', to, 0.0);
        }
        Law::Integral { .. } => {
            // A box with a ramp, as in block diagrams.
            go('L', middle - 9.0, 0.0);
            go('L', middle - 9.0, -9.0);
            go('L', middle + 9.0, -9.0);
            go('L', middle + 9.0, 9.0);
            go('L', middle - 9.0, 9.0);
            go('L', middle - 9.0, -9.0);
            go('L', middle + 9.0, 9.0);
            go('M', middle + 9.0, 0.0);
            go('L', to, 0.0);
        }
        Law::Constant { .. } => {
            go('L', to, 0.0);
            go('M', to - 9.0, -6.0);
            go('L', to, 0.0);
            go('L', to - 9.0, 6.0);
        }
    }
    go('M', to, 0.0);
    go('L', length, 0.0);
    let _ = write!(svg, "<path class=\"ink\" d=\"{d}\"/>");
}

/// A coupling's numbers in display units.
fn words(coupling: &Coupling, motion: Motion) -> (&'static str, String) {
    let rotary = motion == Motion::Rotary;
    let stiffness = |k: f64| match rotary {
        true => format!("{} N·mm/°", number(1e3 * k / DEGREES, 4)),
        false => format!("{} N/m", number(k, 4)),
    };
    let damping = |b: f64| format!("{} {}", number(b, 4), if rotary { "N·m·s/rad" } else { "N·s/m" });
    let position = |x: f64| match rotary {
        true => format!("{}°", number(x * DEGREES, 4)),
        false => format!("{} mm", number(1e3 * x, 4)),
    };
    let (kind, value) = match coupling.law {
        Law::Spring { stiffness: k, .. } => ("spring", stiffness(k)),
        Law::Damper { damping: Damping::Fixed(b) } => ("damper", damping(b)),
        Law::Damper { damping: Damping::Compensating } => ("damper", "b = T·k".into()),
        Law::Wall { at, stiffness: k, .. } => ("wall", format!("{}, {}", position(at), stiffness(k))),
        Law::Detent { torque, pitch, .. } => {
            ("detents", format!("{} each {}", say_effort(torque, motion), position(pitch)))
        }
        Law::Texture { torque, pitch, .. } => {
            ("texture", format!("{} each {}", say_effort(torque, motion), position(pitch)))
        }
        Law::DeadBand { stiffness: k, width, .. } => ("dead band", format!("±{}, {}", position(width), stiffness(k))),
        Law::Magnet { torque, width, .. } => ("magnet", format!("{}, {}", say_effort(torque, motion), position(width))),
        Law::Coulomb { torque } => ("friction", say_effort(torque, motion)),
        Law::Assist { torque, .. } => ("assist", say_effort(torque, motion)),
        Law::Acceleration { inertia, cutoff } => {
            ("acceleration", format!("{}, {} Hz", inertia_text(inertia, motion), number(cutoff, 4)))
        }
        Law::Integral { stiffness: k, time, .. } => ("integral", format!("{}, in {} s", stiffness(k), number(time, 4))),
        Law::Lugre { coulomb, .. } => ("LuGre friction", say_effort(coulomb, motion)),
        Law::Constant { torque } => {
            (if rotary { "constant torque" } else { "constant force" }, say_effort(torque, motion))
        }
    };
    match coupling.limit {
        Some(limit) => (kind, format!("{value}, at most {}", say_effort(limit, motion))),
        None => (kind, value),
    }
}

/// Value, and for an upright coupling its kind above it. Returns how wide it is.
fn label(svg: &mut String, x: f64, y: f64, anchor: &str, world: &World, coupling: &Coupling) -> f64 {
    let (kind, value) = words(coupling, world.motion);
    let mut wide = text_width(kind);
    if anchor == "start" {
        text(svg, x, y, anchor, "", kind);
        // A wall's two numbers take a line each.
        for (i, part) in value.split(", ").flat_map(|part| part.split(" each ")).enumerate() {
            text(svg, x, y + 15.0 * (i + 1) as f64, anchor, "soft", part);
            wide = wide.max(text_width(part));
        }
    } else {
        text(svg, x, y, anchor, "soft", &value);
    }
    wide
}

fn node(svg: &mut String, x: f64, top: f64, tall: f64, name: &str, inertia: &str, real: bool) {
    let (left, middle) = (x - 0.5 * NODE, top + 0.5 * tall);
    // The real part has a heavy edge, virtual ones a light one.
    let edge = if real { 2.6 } else { 1.2 };
    let _ = write!(
        svg,
        "<rect class=\"node\" stroke-width=\"{edge}\" rx=\"6\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{NODE}\" height=\"{tall:.1}\"/>"
    );
    let name = match name.char_indices().nth(10) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.into(),
    };
    text(svg, x, middle - 3.0, "middle", "bold", &name);
    text(svg, x, middle + 14.0, "middle", "soft", inertia);
}

fn inertia_text(inertia: f64, motion: Motion) -> String {
    match motion {
        Motion::Rotary if inertia < 1e-2 => format!("{} g·cm²", number(1e7 * inertia, 3)),
        Motion::Rotary => format!("{} kg·m²", number(inertia, 3)),
        Motion::Linear if inertia < 1.0 => format!("{} g", number(1e3 * inertia, 3)),
        Motion::Linear => format!("{} kg", number(inertia, 3)),
    }
}

/// An arrow into the puck, with the name of the hand above it.
fn hand(svg: &mut String, world: &World, x: f64, y: f64) {
    let grips = world.scenarios.iter().any(|scenario| matches!(scenario.hand.drive, Drive::Grip { .. }));
    let _ = write!(
        svg,
        "<path class=\"mark {}\" d=\"M{:.1} {y:.1}H{:.1}m-8 -5l8 5l-8 5\"/>",
        class(Style::Signal(1)),
        x - 56.0,
        x - 4.0
    );
    text(svg, x - 32.0, y - 9.0, "middle", "", if grips { "grip" } else { "hand" });
}

fn ground(svg: &mut String, from: f64, to: f64, y: f64) {
    let mut d = format!("M{from:.1} {y:.1}H{to:.1}");
    let mut x = from + 10.0;
    while x <= to {
        let _ = write!(d, "M{x:.1} {y:.1}l-9 9");
        x += 12.0;
    }
    let _ = write!(svg, "<path class=\"ink\" d=\"{}\"/>", escaped(&d));
}

fn alt(world: &World) -> String {
    let end = |end: End| match end {
        End::Puck => "puck",
        End::Ground => "ground",
        End::Body(i) => world.names.get(i).map_or("body", String::as_str),
    };
    let list = world.couplings.iter().map(|coupling| {
        let (kind, value) = words(coupling, world.motion);
        format!("{kind} ({value}) between {} and {}", end(coupling.first), end(coupling.second))
    });
    let couplings: Vec<String> = list.collect();
    let bodies = match world.names.as_slice() {
        [] => "no bodies".to_string(),
        names => format!("bodies {}", names.join(", ")),
    };
    let couplings = if couplings.is_empty() { "no couplings".into() } else { couplings.join("; ") };
    format!("Diagram of the world: the puck, {bodies}; {couplings}.")
}
