//! The loop that a game closes over the wheel, in numbers and sentences.

use hapt_core::wheel::game_loop::{GameLaw, GameReport, Oddity};

use super::view::number;
use crate::messages::GameInfo;

/// The loop that a game closes, as estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GameStatus {
    /// The last estimate.
    pub last: GameReport<f64>,
    /// The largest missing damping, N·m·s/rad.
    pub lacking: f64,
    /// The largest added damping, N·m·s/rad.
    pub damping: f64,
    /// The largest part of the level that was held back, 0 to 1.
    pub held_back: f64,
}

impl GameStatus {
    /// From a first report.
    pub fn new(last: GameReport<f64>) -> Self {
        GameStatus { last, lacking: 0.0, damping: 0.0, held_back: 0.0 }
    }

    /// Another sample's report.
    pub fn add(&mut self, report: &GameReport<f64>) {
        let law = report.law.or(self.last.law);
        self.last = GameReport { law, ..*report };
        self.lacking = self.lacking.max(report.lacking);
        self.damping = self.damping.max(report.damping);
        self.held_back = self.held_back.max(report.held_back);
    }
}

/// The law in a sentence: its stiffness, its lateness and its rate.
pub fn game_law(law: &GameLaw<f64>) -> String {
    let ([soft, stiff], [early, late]) = (law.stiffness_range, law.lateness_range);
    format!(
        "{} N m/rad ({} to {}), {} ms late ({} to {}), {} levels a second; {:.0} % of what its levels do is that",
        number(law.stiffness),
        number(soft),
        number(stiff),
        number(1e3 * law.lateness),
        number(1e3 * early),
        number(1e3 * late),
        number(1.0 / law.hold.max(1e-6)),
        100.0 * law.explained
    )
}

/// The counter-measure, in a sentence.
pub fn game_remedy(game: &GameStatus, acts: bool) -> String {
    let lacks = number(game.lacking);
    if game.lacking <= 0.0 {
        "hands off, the device's own damping keeps it quiet".into()
    } else if !acts {
        format!("hands off it lacks {lacks} N m s/rad of damping; it was only measured")
    } else if game.held_back > 0.0 {
        format!(
            "hands off it lacked up to {lacks} N m s/rad of damping: {} were added, the most that this device renders, and up to {:.0} % of its level held back",
            number(game.damping),
            100.0 * game.held_back
        )
    } else {
        format!("hands off it lacked up to {lacks} N m s/rad of damping: up to {} were added", number(game.damping))
    }
}

/// A peculiarity of a game's levels, in a sentence.
pub fn oddity(peculiar: Oddity) -> &'static str {
    match peculiar {
        Oddity::Outward => {
            "the game's torque pushes away from where the wheel was: no damping keeps such a wheel in the middle; is its direction inverted in the \
             game?"
        }
        Oddity::Late => "the game's torque may be later than the longest lateness that is estimated, which counts",
        Oddity::Uneven => "the game's levels come at uneven times; the longest of its usual intervals counts",
        Oddity::Swings => {
            "the free wheel's swings gain more than this law explains, as where a car answers the steering: the damping is what they show"
        }
        Oddity::Loose => "less than half of what the game's levels do follows the wheel",
    }
}

/// For a page.
pub(super) fn info(game: &GameStatus) -> Option<GameInfo> {
    let (law, report) = (game.last.law?, &game.last);
    Some(GameInfo {
        stiffness: law.stiffness,
        stiffness_range: law.stiffness_range,
        lateness: law.lateness,
        lateness_range: law.lateness_range,
        hold: law.hold,
        lacking: report.lacking,
        damping: report.damping,
        held_back: report.held_back,
        hands_off: report.hands_off,
        law: game_law(&law),
        oddity: report.oddity.map(oddity),
    })
}
