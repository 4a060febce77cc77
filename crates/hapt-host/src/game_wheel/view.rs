//! The page's view of the wheel, with pedals and buttons.

use std::sync::Arc;

use hapt_core::wheel::{Effect, Given, Shortfall, Sides};
use hapt_rt::EffectsSample;
use hapt_wire::pid::{EFFECTS, Input, Pool, Scale};

use super::game::info;
use super::{Shared, locked};
use crate::machine::WheelView;
use crate::messages::{Controls, EffectInfo, WheelInfo};

/// The reason that less torque is given than requested, in a sentence.
pub fn reason(why: Shortfall) -> &'static str {
    match why {
        Shortfall::Drives => "a negative coefficient would drive the wheel by itself, and counts as 0",
        Shortfall::Stiffness => {
            "the springs together are stiffer than what the device's damping makes passive, and are scaled to that"
        }
        Shortfall::Limit => "the effects together ask for more than the motor's limit",
    }
}

/// The same for a host that has stopped sending.
const PAUSES: &str =
    "the game has said nothing for 10 s, and all that can do work on the wheel pauses up to its next report";

/// The effects that play, and their torques since the last status.
#[derive(Default)]
pub(super) struct PlayedEffects {
    effects: Vec<Effect<f32>>,
    /// Smallest, last and largest of the requested and of the given torque, N·m: the change of the motor's torque over that of the world without effects.
    torques: Option<[[f64; 3]; 2]>,
    /// The last of each.
    held: [f64; 2],
    last: Option<Given<f32>>,
    why: Option<Shortfall>,
    pauses: bool,
}

impl PlayedEffects {
    /// A sample, on a motor with this limit.
    pub(super) fn add(&mut self, sample: &EffectsSample, limit: f64) {
        let EffectsSample { given, world, .. } = sample;
        let motor = |torque: f64| torque.clamp(-limit, limit);
        let now = [given.requested, given.torque].map(|torque| motor(world + f64::from(torque)) - motor(*world));
        self.held = now;
        let before = self.torques.unwrap_or(now.map(|torque| [torque; 3]));
        self.torques = Some([0, 1].map(|i| [before[i][0].min(now[i]), now[i], before[i][2].max(now[i])]));
        self.why = given.shortfall.or(self.why);
        self.last = Some(*given);
    }

    /// Sets the effects that play at `now`, in µs of the pool's clock.
    pub(super) fn plays(&mut self, pool: &Pool, now: u64, scale: &Scale) {
        // On a copy: `effects` removes those that have ended.
        let mut pool = *pool;
        let (all, playing): ([Effect<f32>; EFFECTS], usize) = pool.effects(now, scale);
        self.pauses = pool.pauses();
        self.effects.clear();
        self.effects.extend(all.into_iter().take(playing));
    }
}

/// The pages' handle on the wheel.
pub struct View {
    shared: Arc<Shared>,
    limit: f64,
}

impl View {
    pub(super) fn new(shared: Arc<Shared>, limit: f64) -> Self {
        View { shared, limit }
    }
}

impl WheelView for View {
    fn info(&self) -> WheelInfo {
        let status = *locked(&self.shared.status);
        let mut shown = locked(&self.shared.shown);
        let last = shown.last.unwrap_or(Given::NOTHING);
        let [asked, given] = shown.torques.take().unwrap_or(shown.held.map(|torque| [torque; 3]));
        WheelInfo {
            attached: status.is_attached,
            effects: shown.effects.iter().map(|effect| describe(effect, f64::from(last.scale))).collect(),
            asked,
            given,
            limit: self.limit,
            used: f64::from(last.used),
            reason: shown.why.take().map(reason).or(shown.pauses.then_some(PAUSES)),
            game: status.game.as_ref().and_then(info),
            taken: status.taken,
            refused: status.refused,
        }
    }

    fn press(&self, controls: Controls) {
        let pedals = controls.pedals.map(|pedal| (f64::from(i16::MAX) * pedal.clamp(0.0, 1.0)).round() as u16);
        *locked(&self.shared.pressed) = Input { pedals, buttons: controls.buttons, ..Input::default() };
    }
}

fn describe(effect: &Effect<f32>, scale: f64) -> EffectInfo {
    let of = |sides: &Sides<f32>, unit: &str, scale: f64| {
        let coefficients = [sides.below, sides.above].map(|x| number(f64::from(x.max(0.0)) * scale));
        let [below, above] = &coefficients;
        if below == above { format!("{above} {unit}") } else { format!("{below} left, {above} right {unit}") }
    };
    let asks = |sides: &Sides<f32>, unit: &str| {
        let plain = Sides { above: sides.above.abs(), below: sides.below.abs(), ..*sides };
        let sign = if sides.above < 0.0 || sides.below < 0.0 { "driving " } else { "" };
        let most = sides.most_above.max(sides.most_below);
        let mut text = format!("{sign}{}, at most {} N m", of(&plain, unit, 1.0), number(f64::from(most)));
        if sides.offset != 0.0 {
            text += &format!(", about {}", number(f64::from(sides.offset)));
        }
        text
    };
    let plain = |kind, asked| EffectInfo { kind, asked, given: None };
    match effect {
        Effect::Spring(sides) => {
            let given = (scale < 1.0).then(|| of(sides, "N m/rad", scale));
            EffectInfo { kind: "spring", asked: asks(sides, "N m/rad"), given }
        }
        Effect::Damper(sides) => plain("damper", asks(sides, "N m s/rad")),
        Effect::Friction(sides) => plain("friction", of(sides, "N m", 1.0)),
        Effect::Inertia(sides) => plain("inertia", asks(sides, "kg m²")),
        Effect::Torque(torque) => plain("torque", format!("{} N m", number(f64::from(*torque)))),
    }
}

/// Three digits.
pub(super) fn number(x: f64) -> String {
    let digits = if x == 0.0 { 0 } else { (2.0 - x.abs().log10().floor()).clamp(0.0, 6.0) as usize };
    format!("{x:.digits$}")
}
