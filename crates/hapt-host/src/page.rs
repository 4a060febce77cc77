//! A session with the messages of its pages: requests become calls, and events become messages.

mod describe;

use std::time::Duration;

use hapt_core::{Phase, Reason, Request};
use hapt_rt::Epoch;

use crate::frames::Frames;
use crate::machine::{StationView, WheelView};
use crate::messages::{ClientMessage, Command, Realtime, RecordingInfo, ServerMessage, Status, TimingInfo};
use crate::session::{Event, NotTaken, Session};
use crate::worker::Task;

pub use describe::describe;

/// The time between two status messages without a change.
const STATUS_PERIOD: Duration = Duration::from_millis(200);

/// The refusal of a change of the world while the device is a game wheel.
const FIXED: &str =
    "the world cannot change while a game uses the wheel; end hapt wheel, and start it with --set KEY=VALUE";

/// The refusal of another world at a station.
#[cfg(not(target_family = "wasm"))]
const STAYS: &str = "a station of a network keeps its world: its links count from that world's 0";

/// A session with the messages for its pages. The caller decides which client may send what.
pub struct PageSession {
    /// The session.
    pub session: Session,
    frames: Frames,
    /// The instant of the next status, and the state in the last.
    status: Option<Duration>,
    state: (Phase, Option<Reason>),
}

impl PageSession {
    /// Starts. A simulated device is armed, so that it can be used at once; a motor stays disarmed until a page arms it.
    pub fn new(mut session: Session) -> Self {
        if session.is_simulated() {
            let _ = session.request(Request::Arm, session.handle().epoch());
        }
        PageSession { state: session.state(), session, frames: Frames::default(), status: None }
    }

    /// Handles a request of a client, made in this epoch; the answer to that client, where the request is refused.
    ///
    /// Messages about connection, control and certificates are not the session's; they do nothing.
    pub fn handle(&mut self, client: u64, message: ClientMessage, epoch: Epoch) -> Option<ServerMessage> {
        let refused = |key: &str, message: String| ServerMessage::Refused { key: key.into(), message };
        if self.session.wheel().is_some() {
            // The effects use the damping that this world leaves unused.
            if let ClientMessage::Set { key, .. } = &message {
                return Some(refused(key, FIXED.into()));
            }
            #[cfg(not(target_family = "wasm"))]
            if matches!(message, ClientMessage::Enter { .. }) {
                return Some(refused("", FIXED.into()));
            }
            if matches!(message, ClientMessage::Sets { .. } | ClientMessage::Reset) {
                return Some(refused("", FIXED.into()));
            }
        }
        match message {
            ClientMessage::Command { command } => {
                let request = match command {
                    Command::Arm => Request::Arm,
                    Command::Disarm => Request::Disarm,
                    Command::Clear => Request::Clear,
                    Command::Stop => Request::Stop,
                };
                let why = self.session.request(request, epoch).err()?;
                let sentence = match why {
                    NotTaken::Outdated => {
                        "stop was pressed, or control changed, before this arrived; send it again".into()
                    }
                    NotTaken::Busy => why.to_string(),
                };
                return Some(ServerMessage::Error { message: sentence });
            }
            ClientMessage::Hand { grip, position } => self.session.move_hand(grip.then_some(position)),
            ClientMessage::Set { key, value } => {
                return self.submit(client, Task::Sets { key: key.clone(), sets: vec![(key, value)], only: false });
            }
            ClientMessage::Sets { sets, only } => {
                return self.submit(client, Task::Sets { key: String::new(), sets, only });
            }
            ClientMessage::File => return self.submit(client, Task::File),
            ClientMessage::Reset => return self.submit(client, Task::Reset),
            #[cfg(not(target_family = "wasm"))]
            ClientMessage::Enter { .. } if self.session.network().is_some() => return Some(refused("", STAYS.into())),
            #[cfg(not(target_family = "wasm"))]
            ClientMessage::Enter { world } => return self.submit(client, Task::Enter { world }),
            ClientMessage::Restart => return self.session.restart(epoch).err().map(|why| refused("", why)),
            ClientMessage::Scenario { name: None } => self.session.release(),
            ClientMessage::Scenario { name: Some(name) } => {
                return self.session.play(&name).err().map(|why| refused("scenario", why));
            }
            ClientMessage::Record { on: true } => return self.submit(client, Task::Record),
            ClientMessage::Record { on: false } => self.session.end_recording(),
            ClientMessage::Network(change) => self.session.network()?.change(&change),
            #[cfg(not(target_family = "wasm"))]
            ClientMessage::Controls(controls) => {
                let is_simulated = self.session.is_simulated();
                match self.session.wheel() {
                    Some(wheel) if is_simulated => wheel.press(controls),
                    Some(_) => return Some(refused("", "a real wheel's pedals and buttons are its own".into())),
                    None => {}
                }
            }
            ClientMessage::Hello { .. }
            | ClientMessage::Take
            | ClientMessage::Give
            | ClientMessage::Focus { .. }
            | ClientMessage::Alive => {}
        }
        None
    }

    fn submit(&mut self, client: u64, task: Task) -> Option<ServerMessage> {
        let key = task.key().to_string();
        self.session.submit(client, task).err().map(|message| ServerMessage::Refused { key, message })
    }

    /// Advances the session ([`Session::poll`]), and gives each message with its client, or with `None` where it is for every page.
    pub fn poll(
        &mut self,
        now: Duration,
        mut tell: impl FnMut(Option<u64>, ServerMessage),
    ) -> Option<Result<(), crate::Error>> {
        let ended = self.session.poll(now, |sample| self.frames.add(&sample));
        while let Some(event) = self.session.event() {
            match event {
                Event::Changed => tell(None, self.world()),
                Event::Refused { client, key, message } => tell(Some(client), ServerMessage::Refused { key, message }),
                Event::File { client, name, text } => tell(Some(client), ServerMessage::File { name, text }),
                Event::Error(error) => tell(None, ServerMessage::Error { message: error.to_string() }),
                Event::Rejected(error) => {
                    tell(None, ServerMessage::Refused { key: String::new(), message: error.to_string() });
                }
            }
        }
        ended
    }

    /// The columns since the last frame ([`Frames::columns`]).
    pub fn columns(&self) -> &[[f64; 3]] {
        self.frames.columns()
    }

    /// The telemetry since the last frame, in the form of [`crate::frames`]; `None` where there was no sample.
    pub fn frame(&mut self) -> Option<Vec<u8>> {
        self.frames.take()
    }

    /// The description of the world.
    pub fn world(&self) -> ServerMessage {
        let mut world = describe(self.session.config());
        if self.session.wheel().is_some() {
            world.keys.iter_mut().for_each(|key| key.fixed = true);
        }
        ServerMessage::World(Box::new(world))
    }

    /// The status for this number of pages, where it has changed or its period has passed.
    pub fn status_due(&mut self, now: Duration, clients: usize) -> Option<ServerMessage> {
        let state = self.session.state();
        if state == self.state && self.status.is_some_and(|next| now < next) {
            return None;
        }
        (self.state, self.status) = (state, Some(now + STATUS_PERIOD));
        Some(self.status(clients))
    }

    /// The state of the loop, for this number of pages.
    pub fn status(&self, clients: usize) -> ServerMessage {
        let session = &self.session;
        let mut status = Status {
            phase: "",
            code: None,
            reason: None,
            sentence: None,
            clear: None,
            warnings: self.warnings(),
            scenario: session.scenario().map(Into::into),
            recording: session.recording().map(RecordingInfo::from),
            timing: session.realtime().map(|_| TimingInfo::of(session.timing(), &session.config().world.sampling)),
            realtime: session.realtime().map(Realtime::of),
            network: session.network().map(StationView::info),
            wheel: session.wheel().map(WheelView::info),
            clients,
        };
        let (phase, reason) = session.state();
        status.explain(phase, reason);
        ServerMessage::Status(Box::new(status))
    }

    /// The warnings: conditions that are no fault.
    fn warnings(&self) -> Vec<String> {
        let session = &self.session;
        let warning = |reason: Reason| match session.is_simulated() {
            true => format!("On a real device it would have faulted. {}", reason.sentence()),
            false => reason.sentence().to_string(),
        };
        // A local loop's missed samples are in the timing.
        let missed = Some(session.timing().missed()).filter(|missed| *missed > 0 && session.realtime().is_none());
        let missed = missed.map(|missed| format!("The board has missed {missed} samples."));
        session.warning().map(warning).into_iter().chain(missed).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Machine, WorldConfig};
    use hapt_model::{Source, World};

    fn page() -> PageSession {
        let source = Source::from_text("wheel.toml", crate::testing::WHEEL);
        let config = WorldConfig::new(source, Vec::new()).unwrap();
        let machine = Machine::stepped(&config.world);
        PageSession::new(Session::start(config, machine).unwrap())
    }

    fn set(page: &mut PageSession, client: u64, key: &str, value: &str) -> Option<ServerMessage> {
        let message = ClientMessage::Set { key: key.into(), value: value.into() };
        page.handle(client, message, page.session.handle().epoch())
    }

    fn save(page: &mut PageSession, client: u64) -> Option<ServerMessage> {
        page.handle(client, ClientMessage::File, page.session.handle().epoch())
    }

    /// The files that its clients receive.
    fn files(page: &mut PageSession) -> Vec<(u64, String)> {
        let mut files = Vec::new();
        for step in 0..2 * 64 {
            page.poll(Duration::from_millis(step), |to, message| {
                if let ServerMessage::File { text, .. } = message {
                    files.push((to.unwrap(), text));
                }
            });
        }
        files
    }

    #[test]
    fn each_client_waits_for_one_file_that_of_its_last_request() {
        let mut page = page();
        for period in ["2 ms", "3 ms", "4 ms"] {
            assert!(set(&mut page, 1, "loop.period", period).is_none());
            assert!((1..=3).all(|client| save(&mut page, client).is_none()));
        }
        let files = files(&mut page);
        assert_eq!(files.iter().map(|(client, _)| *client).collect::<Vec<_>>(), [1, 2, 3]);
        let period = |text: &str| World::read(&Source::from_text("w.toml", text), &[]).unwrap().sampling.period;
        assert!(files.iter().all(|(_, text)| period(text) == 4e-3), "{files:?}");
    }

    #[test]
    fn a_refusal_of_a_file_says_so() {
        let mut page = page();
        let keys = ["loop.period", "loop.delay"];
        let first = (0..100).find_map(|i| set(&mut page, 1, keys[i % 2], "3 ms")).unwrap();
        let second = save(&mut page, 1).unwrap();
        let text = |message| match message {
            ServerMessage::Refused { message, .. } => message,
            other => panic!("{other:?}"),
        };
        assert_eq!(text(first), "32 requests are waiting to be computed; set it again when they are done");
        assert_eq!(text(second), "32 requests are waiting to be computed; save it again when they are done");
        assert!(files(&mut page).is_empty());
        assert!(save(&mut page, 1).is_none());
        assert_eq!(files(&mut page).len(), 1);
    }
}
