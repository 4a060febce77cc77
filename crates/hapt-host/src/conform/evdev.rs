//! A wheel of Linux's evdev: /dev/input/event*, with any driver of force feedback.
//!
//! The kernel removes the effects of a program that has ended, however it ended.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use input_linux::sys::{self, ff_effect, ff_effect_union};
use input_linux::{AbsoluteAxis, AbsoluteInfo, EvdevHandle, ForceFeedbackKind};

use rustix::ioctl::{Opcode, Setter, ioctl, opcode};

use super::effect::{Condition, Envelope, Form, HostEffect, Law, Wave};
use super::run::{ConformError, Wheel};

/// The folder of the kernel's input devices.
const FOLDER: &str = "/dev/input";
/// The polling period of events.
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// Full scale of signed numbers, and of those without a sign.
const FULL: f64 = 32_767.0;
const WHOLE: f64 = 65_535.0;
/// Events that are read at once.
const EVENTS: usize = 64;

/// A device that may be a wheel.
#[derive(Clone, Debug)]
pub struct WheelDevice {
    /// /dev/input/event5
    pub path: PathBuf,
    /// Its own name.
    pub name: String,
}

/// The devices with force feedback and a steering axis that can be opened, and the number of devices that cannot.
///
/// # Errors
/// The system shows no input devices.
pub fn wheels() -> io::Result<(Vec<WheelDevice>, usize)> {
    let (mut found, mut closed) = (Vec::new(), 0);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(FOLDER)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    for path in paths
        .into_iter()
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("event")))
    {
        match open(&path) {
            Ok(handle) if is_wheel(&handle) => found.push(WheelDevice { name: name(&handle), path }),
            Ok(_) => {}
            Err(_) => closed += 1,
        }
    }
    Ok((found, closed))
}

fn open(path: &Path) -> io::Result<EvdevHandle<File>> {
    let flags = rustix::fs::OFlags::NONBLOCK.bits().cast_signed();
    Ok(EvdevHandle::new(OpenOptions::new().read(true).write(true).custom_flags(flags).open(path)?))
}

fn is_wheel(handle: &EvdevHandle<File>) -> bool {
    let has_axis = handle.absolute_bits().is_ok_and(|bits| bits.get(AbsoluteAxis::X));
    has_axis && handle.force_feedback_bits().is_ok_and(|bits| bits.get(ForceFeedbackKind::Constant))
}

/// Shows the steering of every wheel of this name as it is, without the filter and the dead zone that the kernel gives a joystick's axis before
/// Linux 6.15: an axis is held back there by up to 1/512 of its range. Returns how many wheels there are.
pub(crate) fn clear_smoothing(named: &str) -> io::Result<usize> {
    let (all, _) = wheels()?;
    let mut count = 0;
    for wheel in all.iter().filter(|wheel| wheel.name == named) {
        let handle = open(&wheel.path)?;
        let axis = handle.absolute_info(AbsoluteAxis::X)?;
        set_axis(&handle, &AbsoluteInfo { fuzz: 0, flat: 0, ..axis })?;
        count += 1;
    }
    Ok(count)
}

/// EVIOCSABS of the steering. The crate's own call reads the axis in place of setting it (input-linux-sys 0.9.0).
#[allow(unsafe_code)]
fn set_axis(handle: &EvdevHandle<File>, axis: &AbsoluteInfo) -> io::Result<()> {
    const OPCODE: Opcode = opcode::write::<sys::input_absinfo>(b'E', 0xC0 + sys::ABS_X as u8);
    let info: &sys::input_absinfo = axis.into();
    // SAFETY: the kernel's opcode for the axis X, which reads one `input_absinfo`, plain integers.
    let set = unsafe { Setter::<OPCODE, sys::input_absinfo>::new(*info) };
    // SAFETY: as above.
    Ok(unsafe { ioctl(handle, set) }?)
}

fn name(handle: &EvdevHandle<File>) -> String {
    let bytes = handle.device_name().unwrap_or_default();
    String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_string()
}

/// An open wheel. Dropping it ends its effects.
pub struct Evdev {
    handle: EvdevHandle<File>,
    name: String,
    axis: AbsoluteInfo,
    begin: SystemTime,
    /// The driver's number of the effect in each place.
    numbers: Vec<Option<i16>>,
    at: f64,
    /// Whether the user has requested the end.
    is_over: Box<dyn Fn() -> bool>,
}

impl Evdev {
    /// Opens a wheel. Its axis is shown without a filter until it is dropped.
    ///
    /// # Errors
    /// There is none, or it cannot be used.
    pub fn open(path: &Path, is_over: impl Fn() -> bool + 'static) -> Result<Self, ConformError> {
        let failed = |error: io::Error| ConformError::Device(format!("{}: {error}", path.display()));
        let handle = open(path).map_err(failed)?;
        if !is_wheel(&handle) {
            let text = format!("{}: has no steering axis with force feedback", path.display());
            return Err(ConformError::Device(text));
        }
        let axis = handle.absolute_info(AbsoluteAxis::X).map_err(failed)?;
        if axis.maximum <= axis.minimum {
            return Err(ConformError::Device(format!("{}: its axis has no range", path.display())));
        }
        set_axis(&handle, &AbsoluteInfo { fuzz: 0, ..axis }).map_err(failed)?;
        let name = name(&handle);
        let begin = SystemTime::now();
        let mut wheel = Evdev { handle, name, axis, begin, numbers: Vec::new(), at: 0.0, is_over: Box::new(is_over) };
        wheel.at = wheel.share(axis.value);
        if wheel.handle.force_feedback_bits().is_ok_and(|bits| bits.get(ForceFeedbackKind::Autocenter)) {
            wheel.say(sys::FF_AUTOCENTER, 0)?;
        }
        Ok(wheel)
    }

    /// Its own name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Of half the range.
    fn share(&self, value: i32) -> f64 {
        let (low, high) = (f64::from(self.axis.minimum), f64::from(self.axis.maximum));
        (2.0 * f64::from(value) - low - high) / (high - low)
    }

    fn say(&self, code: u16, value: i32) -> Result<(), ConformError> {
        let time = sys::timeval { tv_sec: 0, tv_usec: 0 };
        let event = sys::input_event { time, type_: sys::EV_FF as u16, code, value };
        self.handle.write(&[event]).map(drop).map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &io::Error) -> ConformError {
        ConformError::Device(format!("{}: {error}", self.name))
    }

    fn number(&self, place: usize) -> Result<u16, ConformError> {
        let number = self.numbers.get(place).copied().flatten().and_then(|number| u16::try_from(number).ok());
        number.ok_or_else(|| ConformError::Device(format!("{}: there is no effect {place}", self.name)))
    }

    /// Reads the events so far: positions with the kernel's times.
    fn read(&mut self, trace: &mut Vec<(f64, f64)>) -> Result<(), ConformError> {
        let time = sys::timeval { tv_sec: 0, tv_usec: 0 };
        let mut events = [sys::input_event { time, type_: 0, code: 0, value: 0 }; EVENTS];
        loop {
            let count = match self.handle.read(&mut events) {
                Ok(0) => return Ok(()),
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(self.failed(&error)),
            };
            for event in events.iter().take(count) {
                if event.type_ == sys::EV_ABS as u16 && event.code == sys::ABS_X as u16 {
                    let since = Duration::new(event.time.tv_sec.max(0) as u64, 1000 * event.time.tv_usec.max(0) as u32);
                    let time = self.since(SystemTime::UNIX_EPOCH + since);
                    self.at = self.share(event.value);
                    let after = trace.last().is_none_or(|(last, _)| *last < time);
                    if after {
                        trace.push((time, self.at));
                    }
                }
            }
        }
    }

    fn since(&self, time: SystemTime) -> f64 {
        match time.duration_since(self.begin) {
            Ok(after) => after.as_secs_f64(),
            Err(before) => -before.duration().as_secs_f64(),
        }
    }
}

impl Drop for Evdev {
    fn drop(&mut self) {
        let _ = self.clear();
        let _ = set_axis(&self.handle, &self.axis);
    }
}

impl Wheel for Evdev {
    fn now(&mut self) -> f64 {
        self.since(SystemTime::now())
    }

    fn put(&mut self, place: usize, requested: &HostEffect) -> Result<(), ConformError> {
        if self.numbers.len() <= place {
            self.numbers.resize(place + 1, None);
        }
        let mut effect = effect(requested, self.numbers[place].unwrap_or(-1));
        self.handle.send_force_feedback(&mut effect).map_err(|error| self.failed(&error))?;
        self.numbers[place] = Some(effect.id);
        Ok(())
    }

    fn start(&mut self, place: usize, count: u32) -> Result<(), ConformError> {
        self.say(self.number(place)?, i32::try_from(count).unwrap_or(i32::MAX))
    }

    fn stop(&mut self, place: usize) -> Result<(), ConformError> {
        self.say(self.number(place)?, 0)
    }

    fn clear(&mut self) -> Result<(), ConformError> {
        let mut outcome = Ok(());
        for number in std::mem::take(&mut self.numbers).into_iter().flatten() {
            // All of them, also where erasing one fails.
            let erased = self.handle.erase_force_feedback(number).map(drop).map_err(|error| self.failed(&error));
            outcome = outcome.and(erased);
        }
        outcome
    }

    fn gain(&mut self, share: f64) -> Result<(), ConformError> {
        self.say(sys::FF_GAIN, (WHOLE * share).round() as i32)
    }

    fn watch(&mut self, until: f64, trace: &mut Vec<(f64, f64)>) -> Result<(), ConformError> {
        if trace.is_empty() {
            // Earlier events belong to no trace.
            self.read(&mut Vec::new())?;
            let now = self.now();
            trace.push((now, self.at));
        }
        loop {
            self.read(trace)?;
            if (self.is_over)() {
                return Err(ConformError::Interrupted);
            }
            let left = until - self.now();
            if left <= 0.0 {
                return Ok(());
            }
            std::thread::sleep(POLL_PERIOD.min(Duration::from_secs_f64(left)));
        }
    }
}

fn signed(share: f64) -> i16 {
    (FULL * share.clamp(-1.0, 1.0)).round() as i16
}

fn whole(share: f64) -> u16 {
    (WHOLE * share.clamp(0.0, 1.0)).round() as u16
}

fn ms(seconds: f64) -> u16 {
    (1e3 * seconds).round().clamp(0.0, FULL) as u16
}

fn envelope(of: &Envelope) -> sys::ff_envelope {
    sys::ff_envelope {
        attack_length: ms(of.attack),
        attack_level: signed(of.attack_level).unsigned_abs(),
        fade_length: ms(of.fade),
        fade_level: signed(of.fade_level).unsigned_abs(),
    }
}

fn numbers(of: &Condition) -> sys::ff_condition_effect {
    sys::ff_condition_effect {
        right_saturation: whole(of.right_most),
        left_saturation: whole(of.left_most),
        right_coeff: signed(of.right),
        left_coeff: signed(of.left),
        deadband: whole(of.dead_band),
        center: signed(of.center),
    }
}

/// The effect in the driver's form.
fn effect(requested: &HostEffect, id: i16) -> ff_effect {
    let kind = match requested.form {
        Form::Constant { .. } => sys::FF_CONSTANT,
        Form::Ramp { .. } => sys::FF_RAMP,
        Form::Periodic { .. } => sys::FF_PERIODIC,
        Form::Condition { law: Law::Spring, .. } => sys::FF_SPRING,
        Form::Condition { law: Law::Damper, .. } => sys::FF_DAMPER,
        Form::Condition { law: Law::Friction, .. } => sys::FF_FRICTION,
        Form::Condition { law: Law::Inertia, .. } => sys::FF_INERTIA,
    };
    let mut effect = ff_effect {
        type_: kind,
        id,
        direction: (65_536.0 * requested.direction).round() as u16,
        trigger: sys::ff_trigger { button: 0, interval: 0 },
        replay: sys::ff_replay { length: requested.length.map_or(0, ms), delay: ms(requested.delay) },
        u: [0; 4],
    };
    let part: &mut ff_effect_union = (&mut effect).into();
    match &requested.form {
        Form::Constant { level, envelope: of } => {
            *part.constant_mut() = sys::ff_constant_effect { level: signed(*level), envelope: envelope(of) };
        }
        Form::Ramp { from, to } => {
            let flat = envelope(&Envelope::default());
            *part.ramp_mut() =
                sys::ff_ramp_effect { start_level: signed(*from), end_level: signed(*to), envelope: flat };
        }
        Form::Periodic { wave, magnitude, offset, phase, period } => {
            let part = part.periodic_mut();
            part.waveform = match wave {
                Wave::Square => sys::FF_SQUARE,
                Wave::Triangle => sys::FF_TRIANGLE,
                Wave::Sine => sys::FF_SINE,
                Wave::SawUp => sys::FF_SAW_UP,
                Wave::SawDown => sys::FF_SAW_DOWN,
            };
            (part.period, part.magnitude, part.offset) = (ms(*period), signed(*magnitude), signed(*offset));
            part.phase = (65_536.0 * phase.rem_euclid(1.0)).round() as u16;
        }
        Form::Condition { axes, .. } => *part.condition_mut() = axes.each_ref().map(numbers),
    }
    effect
}
