//! The wheel that games see during a run, or with a page.

use hapt_core::wheel::Shortfall;
use hapt_core::wheel::game_loop::Oddity;
use hapt_host::WheelView;
use hapt_host::game_wheel::{GameWheel, Room, WheelError, WheelStatus, game_law, game_remedy, oddity, reason};
use hapt_model::World;
use hapt_rt::EffectsPort;

use crate::args::Steering;
use crate::failure::Failure;
use crate::format;
use crate::messages;

/// The wheel during a run.
pub struct Wheel {
    wheel: GameWheel,
    room: Room,
    /// Which reasons have been printed.
    reported: [bool; 3],
    /// Whether the game's law has been printed, and its last oddity.
    reported_game: bool,
    reported_oddity: Option<Oddity>,
}

/// Why less torque is given than requested, in the order of [`WheelStatus::less`].
const REASONS: [Shortfall; 3] = [Shortfall::Drives, Shortfall::Stiffness, Shortfall::Limit];

impl Wheel {
    /// The properties of this world's device as a wheel.
    pub fn room(world: &World, steering: Steering) -> Result<Room, Failure> {
        let room = Room::of(world, steering.range).map_err(failure)?;
        Ok(if steering.dry { room.measuring() } else { room })
    }

    /// Attaches the wheel. The second value is the loop's end.
    pub fn attach(room: Room) -> Result<(Self, EffectsPort), Failure> {
        let (wheel, port) = GameWheel::attach(&room).map_err(failure)?;
        if let Some(why) = room.not_proved().first() {
            messages::say(format_args!("the world of this wheel is certified as far as its linear loop goes: {why}"));
        }
        messages::say(format_args!(
            "the wheel is attached; games have {} of springs and dampers to share",
            stiffness(&room)
        ));
        Ok((Wheel { wheel, room, reported: [false; 3], reported_game: false, reported_oddity: None }, port))
    }

    /// For the pages of its loop.
    pub fn view(&self) -> Box<dyn WheelView> {
        Box::new(self.wheel.view())
    }

    /// Whether the host has it.
    pub fn is_attached(&self) -> bool {
        self.wheel.status().is_attached
    }

    /// Prints changes.
    pub fn say(&mut self) {
        let status = self.wheel.status();
        for ((reported, samples), why) in self.reported.iter_mut().zip(status.less).zip(REASONS) {
            if samples > 0 && !*reported {
                *reported = true;
                messages::say(format_args!("less is given than a game asks for: {}", reason(why)));
            }
        }
        let Some(game) = status.game else { return };
        // Only once the estimate is settled and damping is lacking.
        if let (false, Some(law), true) = (self.reported_game, game.last.law, game.lacking > 0.0) {
            self.reported_game = true;
            messages::say(format_args!("the game's torque follows the wheel: {}", game_law(&law)));
        }
        if let Some(peculiar) = game.last.oddity.filter(|peculiar| self.reported_oddity != Some(*peculiar)) {
            self.reported_oddity = Some(peculiar);
            messages::say(format_args!("{}", oddity(peculiar)));
        }
    }

    /// Detaches it, and gives the lines of the summary.
    pub fn end(&mut self) -> String {
        let WheelStatus { taken, refused, samples, played, peak, less, scale, game, .. } = self.wheel.end();
        let [taken, samples, played] = [taken, samples, played].map(format::count);
        let refused = if refused > 0 { format!(", {} refused", format::count(refused)) } else { String::new() };
        let room = &self.room;
        let mut text = format!(
            "wheel        the effects share {} N m s/rad of damping: {} at most\n\
             effects      {taken} reports taken{refused}; effects played in {played} of {samples} samples, the motor gave {peak:.3} N m at most\n",
            format::number(room.damping()),
            stiffness(room),
        );
        for (samples, why) in less.iter().zip(REASONS).filter(|(samples, _)| **samples > 0) {
            text += &format!("             less than asked in {} samples: {}\n", format::count(*samples), reason(why));
        }
        if scale < 1.0 {
            text += &format!("             springs were scaled to {:.1} % at least\n", 100.0 * scale);
        }
        if let Some((game, law)) = game.and_then(|game| Some((game, game.last.law?))) {
            text += &format!("game         {}\n             {}\n", game_law(&law), game_remedy(&game, room.acts()));
            if let Some(peculiar) = game.last.oddity {
                text += &format!("             {}\n", oddity(peculiar));
            }
        }
        text
    }
}

fn stiffness(room: &Room) -> String {
    format!("{} N m/rad", format::number(room.stiffness()))
}

fn failure(error: WheelError) -> Failure {
    match error {
        WheelError::Device(_) | WheelError::Range { .. } | WheelError::World(_) | WheelError::Check(_) => {
            Failure::input(error)
        }
        WheelError::NoController | WheelError::Permission | WheelError::NoPort | WheelError::Attach(_) => {
            Failure::System(error.to_string())
        }
    }
}
