//! A loop's device as a force-feedback wheel of this computer (Linux): a thread between the loop's rings and the kernel's USB.
//!
//! The loop never waits for it. The host's requests are a pool of effects ([`hapt_wire::pid`]); the loop renders it in addition to its world, with
//! the damping that the world does not need ([`hapt_core::wheel`]).

mod bus;
mod game;
mod vhci;
mod view;

use std::io::{self, Read, Write};
use std::ops::RangeInclusive;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::wheel::game_loop::{GameLoop, Rotor};
use hapt_core::wheel::{Device, Refused, Shortfall, Timing, Wheel};
use hapt_model::World;
use hapt_rt::{EffectsPort, EffectsWire, effects};
use hapt_wire::pid::{Input, Scale};
use hapt_wire::usb::WheelClass;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::UsbDeviceState;

use crate::conform::evdev;
use bus::{Bus, HEADER, Malformed, data_length};
pub use game::{GameStatus, game_law, game_remedy, oddity};
use view::PlayedEffects;
pub use view::{View, reason};

/// The permitted steering ranges from end to end, rad: 1° to 100 turns. Outside of them the reports' numbers of an angle are not meaningful.
pub const STEERING: RangeInclusive<f64> = std::f64::consts::TAU / 360.0..=100.0 * std::f64::consts::TAU;

/// The longest wait of the thread for the host before it reads the loop's samples again.
const POLL_PERIOD: Timespec = Timespec { tv_sec: 0, tv_nsec: 1_000_000 };
/// The kernel's device of the wheel appears within this.
const APPEARS: Duration = Duration::from_secs(20);
/// The kernel's name of it: manufacturer and product.
const NAME: &str = "hapt hapt wheel";
/// A host that does not read its answers within this time counts as disconnected.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);
/// The largest number of packets that the device handles before the thread reads the loop's samples again.
const PACKETS_AT_ONCE: usize = 1000;

/// The reason that there is no wheel.
#[derive(Debug, thiserror::Error)]
pub enum WheelError {
    /// The kernel's module is not loaded.
    #[error("the kernel shows no virtual USB controller; load it with `modprobe vhci-hcd`")]
    NoController,
    /// Only root attaches devices.
    #[error("attaching a USB device needs root; start hapt with sudo")]
    Permission,
    /// Every port is taken.
    #[error("the virtual USB controller has no free port; end another program that has attached a device")]
    NoPort,
    /// The kernel refuses the device.
    #[error("the kernel does not attach the wheel: {0}")]
    Attach(io::Error),
    /// The device cannot be a wheel.
    #[error("{0}")]
    Device(#[from] Refused),
    /// The steering range is outside of [`STEERING`].
    #[error("the steering turns by {degrees:.3e}°; expected 1° to 36000°, such as 900°")]
    Range {
        /// From one end to the other.
        degrees: f64,
    },
    /// The world is not suitable for a wheel.
    #[error("{0}")]
    World(String),
    /// The certificate cannot be computed.
    #[error("{0}")]
    Check(String),
}

/// The numbers of a world's device as a game wheel.
#[derive(Clone, Debug)]
pub struct Room {
    device: Device,
    rotor: Rotor,
    /// Whether the loop that a game closes is damped, or only measured.
    acts: bool,
    /// Half of the steering range, rad.
    half: f64,
    /// The reasons that the world's passivity is proved only for its linear loop.
    not_proved: Vec<String>,
}

impl Room {
    /// The room of this world for effects, on a wheel that turns by `range` rad from one end to the other. The world is the wheel's behaviour
    /// without a game: its end stops and its base feel; the effects get the damping of the device that the world does not need.
    ///
    /// # Errors
    /// The range is outside of [`STEERING`]; the world is linear, or has no limit, or is not certified.
    pub fn of(world: &World, range: f64) -> Result<Self, WheelError> {
        if !STEERING.contains(&range) {
            return Err(WheelError::Range { degrees: range.to_degrees() });
        }
        if world.motion != hapt_model::Motion::Rotary {
            return Err(WheelError::World("the world is linear, and a wheel turns; leave `motion` out".into()));
        }
        if world.sampling.recentre.is_some() {
            return Err(WheelError::World(
                "the world has loop.recentre, and a game's effects count from an origin that stays; leave it out"
                    .into(),
            ));
        }
        let Some(limit) = world.device.limit else {
            return Err(WheelError::World("device.limit: a wheel needs the largest torque of its motor".into()));
        };
        let uneven = hapt_analysis::uneven(world).map_err(|error| WheelError::Check(error.to_string()))?;
        let [least, _] = world.device.damping_range();
        let Some(demand) = uneven.proved_damping() else {
            return Err(WheelError::World(
                "the world by itself is not known to be passive, whatever the damping of its device, and leaves nothing for effects; hapt check \
                 says why"
                    .into(),
            ));
        };
        if demand > least {
            return Err(WheelError::World(format!(
                "the world by itself needs {demand:.4} N m s/rad of device.damping, which is {least:.4} at least: it is not known to be passive, \
                 and leaves nothing for effects; hapt check says what would be"
            )));
        }
        let sampling = &world.sampling;
        let timing = Timing {
            period: sampling.period,
            shortest: sampling.interval_min_s(),
            longest: sampling.interval_max_s(),
            delay: sampling.delay_max_s(),
            lag: world.device.lag_range()[1],
        };
        let damping = least - demand;
        // The world's own torques within friction, counts and levels use damping and friction first.
        let own = hapt_analysis::quantisation(world).map_err(|error| WheelError::Check(error.to_string()))?;
        let count = world.count().unwrap_or(0.0);
        let within = world.device.least_friction() - own.friction;
        let ([friction, _], of_world) =
            (world.device.friction_range(), within + own.least_friction + 0.5 * own.stiffness * count);
        let device = Device { timing, damping, friction: (friction - of_world).max(0.0), count, limit };
        let [inertia, _] = world.device.inertia_range();
        let rotor = Rotor { inertia, damping: world.device.damping, friction: world.device.least_friction() };
        Ok(Room { device, rotor, acts: true, half: 0.5 * range, not_proved: uneven.not_proved })
    }

    /// The same for a wheel that only measures the loop which a game closes.
    #[must_use]
    pub fn measuring(self) -> Self {
        Room { acts: false, ..self }
    }

    /// Whether the loop that a game closes is damped, or only measured.
    pub fn acts(&self) -> bool {
        self.acts
    }

    /// The loop that a game closes over this wheel.
    ///
    /// # Errors
    /// Names the number that is out of range.
    pub fn game_loop(&self) -> Result<GameLoop<f64>, Refused> {
        GameLoop::new(&self.device, &self.rotor, self.acts)
    }

    /// The device with the remaining damping and friction.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Half of the steering range, rad.
    pub fn half(&self) -> f64 {
        self.half
    }

    /// The reasons that the world's passivity is proved only for its linear loop, one sentence each; empty where it is proved without that
    /// restriction. The same restriction applies to the claims about effects.
    pub fn not_proved(&self) -> &[String] {
        &self.not_proved
    }

    /// The damping that the effects can use, N·m·s/rad.
    pub fn damping(&self) -> f64 {
        self.device.damping
    }

    /// The largest stiffness of springs that this damping permits, N·m/rad.
    pub fn stiffness(&self) -> f64 {
        self.device.stiffness()
    }

    /// The full scale of the host's numbers.
    pub fn scale(&self) -> Scale {
        Scale::of_wheel(self.device.limit, self.half)
    }
}

/// The host's requests so far, and the given torques.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelStatus {
    /// Whether the host has the device.
    pub is_attached: bool,
    /// Reports of the host that were taken.
    pub taken: u64,
    /// Malformed ones, and those of effects that do not exist.
    pub refused: u64,
    /// Samples of the loop.
    pub samples: u64,
    /// Samples in which an effect played.
    pub played: u64,
    /// Effects that play now.
    pub playing: usize,
    /// The largest torque of the motor while effects played, the world's part in it, N·m.
    pub peak: f64,
    /// Samples in which less torque was given than requested, for each reason: the host requested a driving torque, more stiffness than is
    /// passive, more torque than the limit.
    pub less: [u64; 3],
    /// The smallest factor on springs.
    pub scale: f64,
    /// The last estimate of the loop that the game closes, and the largest added damping and held-back part.
    pub game: Option<GameStatus>,
}

/// The data that the thread shares with the pages and the owner of the wheel. Every lock is held for microseconds.
pub(crate) struct Shared {
    status: Mutex<WheelStatus>,
    shown: Mutex<PlayedEffects>,
    /// Pedals and buttons.
    pressed: Mutex<Input>,
}

/// The wheel of this computer. Dropped, it is detached.
pub struct GameWheel {
    stop: Arc<AtomicBool>,
    shared: Arc<Shared>,
    limit: f64,
    thread: Option<JoinHandle<()>>,
}

fn locked<T>(part: &Mutex<T>) -> MutexGuard<'_, T> {
    part.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sets the status to detached when the thread ends, also by a panic.
struct Detached<'a>(&'a Shared);

impl Drop for Detached<'_> {
    fn drop(&mut self) {
        locked(&self.0.status).is_attached = false;
    }
}

impl GameWheel {
    /// Attaches a wheel to the kernel's virtual USB controller. The second is the loop's end.
    ///
    /// # Errors
    /// See [`WheelError`].
    pub fn attach(room: &Room) -> Result<(Self, EffectsPort), WheelError> {
        // Checked before the kernel has a device that would have to be removed again.
        Wheel::<f32>::new(&room.device)?;
        let wheel = GameWheel::on(vhci::attach()?, room)?;
        let stop = Arc::clone(&wheel.0.stop);
        // Not the wheel's own thread: the kernel asks it before it opens the device.
        std::thread::Builder::new()
            .name("axis".into())
            .spawn(move || clear_smoothing(&stop))
            .map_err(WheelError::Attach)?;
        Ok(wheel)
    }

    /// The same with a USB/IP host at the other end of this stream.
    ///
    /// # Errors
    /// See [`WheelError`].
    pub fn on(host: UnixStream, room: &Room) -> Result<(Self, EffectsPort), WheelError> {
        let (port, wire) = effects(Wheel::new(&room.device)?, room.scale());
        let port = port.watching(room.game_loop()?);
        host.set_write_timeout(Some(ANSWER_TIMEOUT)).map_err(WheelError::Attach)?;
        let stop = Arc::new(AtomicBool::new(false));
        let status = WheelStatus { is_attached: true, scale: 1.0, ..WheelStatus::default() };
        let shared =
            Arc::new(Shared { status: Mutex::new(status), shown: Mutex::default(), pressed: Mutex::default() });
        let (stops, sees, half, scale) = (Arc::clone(&stop), Arc::clone(&shared), room.half, room.scale());
        let limit = room.device.limit;
        let work = move || {
            let _detached = Detached(&sees);
            // The worker owns the rings' ends: however it ends, the host's effects end with it.
            Worker { host, wire, half, limit, scale, shared: &sees, unsent: false }.run(&stops);
        };
        let thread = std::thread::Builder::new().name("wheel".into()).spawn(work).map_err(WheelError::Attach)?;
        Ok((GameWheel { stop, shared, limit, thread: Some(thread) }, port))
    }

    /// The status so far.
    pub fn status(&self) -> WheelStatus {
        *locked(&self.shared.status)
    }

    /// For the pages of its loop.
    pub fn view(&self) -> View {
        View::new(Arc::clone(&self.shared), self.limit)
    }

    /// Detaches the wheel, and returns its status.
    pub fn end(&mut self) -> WheelStatus {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.status()
    }
}

impl Drop for GameWheel {
    fn drop(&mut self) {
        self.end();
    }
}

/// Games get the unfiltered steering, once the kernel has created the device.
fn clear_smoothing(stop: &AtomicBool) {
    let begin = Instant::now();
    while begin.elapsed() < APPEARS && !stop.load(Ordering::Relaxed) {
        if matches!(evdev::clear_smoothing(NAME), Ok(1..)) {
            return;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The thread between the loop and the host.
struct Worker<'a> {
    host: UnixStream,
    wire: EffectsWire,
    half: f64,
    /// Of the motor, N·m.
    limit: f64,
    scale: Scale,
    shared: &'a Shared,
    /// Whether the pool has changed and was not sent yet, because the ring was full.
    unsent: bool,
}

impl Worker<'_> {
    fn run(mut self, stop: &AtomicBool) {
        let bus = UsbBusAllocator::new(Bus::default());
        let mut class = WheelClass::new(&bus);
        let Ok(mut device) = WheelClass::device(&bus) else { return };
        let mut come = Vec::new();
        let mut now = 0;
        while !stop.load(Ordering::Relaxed) {
            let goes_on = self.receive(&mut come);
            let position = self.take_samples(&mut now);
            // The loop's samples are the clock of the effects.
            class.at(now / 1000);
            let taken = feed(device.bus(), &mut come);
            let mut has_host = true;
            for _ in 0..PACKETS_AT_ONCE {
                let was_configured = device.state() == UsbDeviceState::Configured;
                let goes_on = device.poll(&mut [&mut class]);
                has_host &= !was_configured || device.state() == UsbDeviceState::Configured;
                if !goes_on {
                    break;
                }
            }
            if let Some(position) = position {
                has_host &= class.show(&self.input(position));
                locked(&self.shared.shown).plays(class.pool(), now / 1000, &self.scale);
            }
            self.pass_on(&mut class);
            let answers = device.bus().answers();
            // The last answers are sent too: the kernel may wait for them.
            let is_gone = self.host.write_all(&answers).is_err();
            if taken.is_err() || !goes_on || is_gone || !has_host {
                break;
            }
        }
    }

    /// Waits for the host and appends the bytes received; false where the host has closed the stream.
    fn receive(&mut self, come: &mut Vec<u8>) -> bool {
        // A socket's own timeout is counted in ticks of the kernel, 4 ms each on many systems: the game would read the steering as late.
        let mut waiting = [PollFd::new(&self.host, PollFlags::IN)];
        match poll(&mut waiting, Some(&POLL_PERIOD)) {
            Ok(0) | Err(Errno::INTR) => return true,
            Ok(_) => {}
            Err(_) => return false,
        }
        let mut bytes = [0; 4096];
        match self.host.read(&mut bytes) {
            Ok(0) => false,
            Ok(length) => {
                come.extend_from_slice(&bytes[..length]);
                true
            }
            Err(error) => error.kind() == io::ErrorKind::Interrupted,
        }
    }

    /// Updates the status by the loop's samples; returns the newest position, where there is one.
    fn take_samples(&mut self, now: &mut u64) -> Option<f64> {
        let mut newest = None;
        let (mut status, mut shown) = (locked(&self.shared.status), locked(&self.shared.shown));
        while let Ok(sample) = self.wire.samples.pop() {
            *now = sample.sampled;
            newest = Some(sample.position);
            status.samples += 1;
            status.played += u64::from(sample.playing > 0);
            status.playing = sample.playing;
            if sample.playing > 0 {
                let motor = (sample.world + f64::from(sample.given.torque)).clamp(-self.limit, self.limit);
                status.peak = status.peak.max(motor.abs());
            }
            status.scale = status.scale.min(f64::from(sample.given.scale));
            if sample.game.law.is_some() || status.game.is_some() {
                status.game.get_or_insert(GameStatus::new(sample.game)).add(&sample.game);
            }
            shown.add(&sample, self.limit);
            if let Some(reason) = sample.given.shortfall {
                status.less[reason_index(reason)] += 1;
            }
        }
        newest
    }

    fn input(&self, position: f64) -> Input {
        Input { steering: Input::at(position, self.half).steering, ..*locked(&self.shared.pressed) }
    }

    /// Sends the pool to the loop where it has changed.
    fn pass_on(&mut self, class: &mut WheelClass<'_, Bus>) {
        {
            let mut status = locked(&self.shared.status);
            (status.taken, status.refused) = class.counts();
        }
        self.unsent |= class.has_changed();
        if self.unsent && !self.wire.pools.is_full() {
            self.unsent = self.wire.pools.push(*class.pool()).is_err();
        }
    }
}

/// The place of a reason in [`WheelStatus::less`].
fn reason_index(reason: Shortfall) -> usize {
    match reason {
        Shortfall::Drives => 0,
        Shortfall::Stiffness => 1,
        Shortfall::Limit => 2,
    }
}

/// Passes complete messages to the bus, and keeps the rest.
fn feed(bus: &Bus, come: &mut Vec<u8>) -> Result<(), Malformed> {
    let mut at = 0;
    while let Some(header) = come[at..].first_chunk::<HEADER>() {
        let length = data_length(header)?;
        let Some(data) = come.get(at + HEADER..at + HEADER + length) else { break };
        bus.receive(header, data)?;
        at += HEADER + length;
    }
    come.drain(..at);
    Ok(())
}
