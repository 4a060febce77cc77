//! `hapt run` on a board: the loop runs there; here it is armed, kept, watched and disarmed.

#[cfg(unix)]
pub use here::run;
#[cfg(not(unix))]
pub use nowhere::{run, unreachable};

#[cfg(not(unix))]
mod nowhere {
    use std::path::Path;
    use std::process::ExitCode;

    use crate::args::RunArgs;
    use crate::device::Port;
    use crate::failure::Failure;
    use crate::world::Loaded;

    pub fn run(_: &RunArgs, _: Loaded, port: &Port, _: f64) -> Result<ExitCode, Failure> {
        Err(unreachable(&port.path))
    }

    /// Serial ports are Unix's here.
    pub fn unreachable(path: &Path) -> Failure {
        Failure::input(format!("hapt:{}: boards can be reached from Linux and macOS only", path.display()))
    }
}

#[cfg(unix)]
mod here {
    use std::io::{Write, stdout};
    use std::process::ExitCode;
    use std::time::{Duration, Instant};

    use hapt_core::{Phase, Reason};
    use hapt_link::{Link, Telemetry};
    use hapt_live::Shown;
    use hapt_log::Header;
    use hapt_rt::Record;

    use crate::args::RunArgs;
    use crate::board::{self, Fit};
    use crate::device::Port;
    use crate::failure::Failure;
    use crate::log::Recording;
    use crate::run::finish;
    use crate::world::Loaded;
    use crate::{output, people, sim};

    /// How often telemetry comes, in s; with a log, as often as the line carries it.
    const SHOWN: f64 = 0.02;
    /// The link is kept at least so often.
    const KEPT: Duration = Duration::from_millis(50);
    /// A board that shows no sample for so long has stopped.
    const SILENT: Duration = Duration::from_secs(1);

    /// `duration` in s at full torque.
    pub fn run(args: &RunArgs, loaded: Loaded, port: &Port, duration: f64) -> Result<ExitCode, Failure> {
        let fit = Fit::new(loaded, &args.world.sets, args.uncertified)?;
        let recording = Recording::start(args.log.as_deref(), &fit.loaded.world, || header(args, &fit))?;
        output::end_in_order();
        let mut link = board::open_with_motor(port)?;
        let hash = board::send(&mut link, &fit)?;
        if link.board().phase == Some(Phase::Faulted) {
            let why = link.board().reason.map_or("It does not say why.", Reason::sentence);
            people::say(format_args!("the board was faulted, and is cleared: {why}"));
            link.clear()?;
        }
        let period = fit.loaded.world.sampling.period;
        link.show(period, if args.log.is_some() { 0.0 } else { SHOWN })?;
        let before = if recording.is_some() { latest(&mut link)? } else { None };
        let recorder = recording.map(Recording::begin).transpose()?;
        let mut run =
            Run { link, before, period, link_allows: link_allows(&fit), duration, seen: Measurement::default() };
        let how = run.until_it_ends(hash, &mut |record| {
            // What finds no room is counted by it.
            recorder.as_ref().map(|recorder| recorder.send(record));
        });
        if how.is_err() {
            // Before anything waits for a disk or for a reader.
            let _ = run.link.stop();
        }
        let logged = recorder.map(finish).transpose();
        let mut out = stdout().lock();
        let logged_line = logged.as_ref().ok().and_then(Option::as_deref).unwrap_or_default();
        let text = run.summary(&fit, &how) + logged_line;
        let printed = out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout);
        if let Ok(How::Signal(code)) = how {
            // The terminal may be gone, and with it whoever reads.
            return Ok(ExitCode::from(code));
        }
        printed?;
        logged?;
        if let Some(missed) = run.missed() {
            people::say(format_args!("warning: {missed}"));
        }
        match how? {
            How::Done => Ok(ExitCode::SUCCESS),
            How::Signal(code) => Ok(ExitCode::from(code)),
            How::Fault(reason) => {
                Err(Failure::System(format!("the torque was taken away. {} {}", reason.sentence(), reason.remedy())))
            }
        }
    }

    /// The latest telemetry; waits for one where none is there.
    fn latest(link: &mut Link) -> Result<Option<Telemetry>, Failure> {
        let mut latest = link.telemetry(Instant::now() + SILENT)?;
        while let Some(telemetry) = link.telemetry(Instant::now())? {
            latest = Some(telemetry);
        }
        Ok(latest)
    }

    /// How often the board is to hear of us.
    fn link_allows(fit: &Fit) -> Duration {
        let silence = fit.loaded.world.limits(fit.profile).silence(fit.loaded.world.sampling.period);
        if silence.is_finite() { Duration::from_secs_f64(silence.max(0.0) / 4.0).min(KEPT) } else { KEPT }
    }

    /// What goes into the log beside the samples.
    fn header(args: &RunArgs, fit: &Fit) -> Header {
        let header = sim::header(&fit.loaded, &fit.sets, true);
        Header { device: args.device.clone(), profile: fit.profile, ..header }
    }

    /// How a run has ended.
    enum How {
        Done,
        Signal(u8),
        Fault(Reason),
    }

    /// What telemetry has said.
    #[derive(Default)]
    struct Measurement {
        first: Option<Telemetry>,
        last: Option<Telemetry>,
        shown: u64,
        /// From which sample to which the torque was all there.
        running: Option<(u64, u64)>,
        /// The largest |output|, in N·m (linear: N).
        peak: f64,
        phase: Option<Phase>,
        reason: u8,
    }

    struct Run {
        link: Link,
        /// What was shown last before it is armed: a replay wants to see that.
        before: Option<Telemetry>,
        /// T in s.
        period: f64,
        link_allows: Duration,
        /// In s, counted from when the torque is all there.
        duration: f64,
        seen: Measurement,
    }

    impl Run {
        /// Arms, keeps the link, disarms; looks at every telemetry, and gives it to `recorder`.
        fn until_it_ends(&mut self, world: u32, recorder: &mut impl FnMut(&Record)) -> Result<How, Failure> {
            if let Some(signal) = output::signalled() {
                return Ok(How::Signal(signal));
            }
            let before = self.link.arm(world)?.or(self.before);
            let (mut kept, mut heard) = (Instant::now(), Instant::now());
            let mut shown = Shown::new(0, self.period);
            shown.follows(before);
            let (mut is_over, mut begun) = (false, false);
            loop {
                if let Some(signal) = output::signalled() {
                    self.link.stop()?;
                    return Ok(How::Signal(signal));
                }
                if kept.elapsed() >= self.link_allows {
                    kept = Instant::now();
                    self.link.keep()?;
                }
                if let Some(telemetry) = self.link.telemetry(Instant::now() + self.link_allows / 4)? {
                    heard = Instant::now();
                    self.seen.add(&telemetry);
                    recorder(&shown.record(&telemetry));
                }
                if heard.elapsed() > SILENT {
                    let message =
                        "the board shows no samples any more; what it does to the motor is its watchdog's to say";
                    return Err(Failure::System(message.into()));
                }
                match self.seen.phase {
                    Some(Phase::Faulted) => return Ok(self.seen.reason()?.map_or(How::Done, How::Fault)),
                    Some(Phase::Disarmed) => {
                        return Ok(self.seen.reason()?.filter(|_| !is_over).map_or(How::Done, How::Fault));
                    }
                    _ => {}
                }
                let Some((from, to)) = self.seen.running else { continue };
                if !std::mem::replace(&mut begun, true) {
                    people::say("at full torque; Ctrl-C takes it off");
                }
                if !is_over && (to - from) as f64 * self.period >= self.duration {
                    is_over = true;
                    self.link.disarm()?;
                }
            }
        }

        /// That samples were missed, where some were.
        fn missed(&self) -> Option<String> {
            let missed = self.seen.missed();
            (missed > 0).then(|| format!("the board missed {} samples; see the summary", people::count(missed.into())))
        }

        fn summary(&self, fit: &Fit, how: &Result<How, Failure>) -> String {
            let Measurement { first, last, shown, running, peak, .. } = &self.seen;
            let ran = match running {
                Some((from, to)) => format!("for {} at full torque", people::time((to - from) as f64 * self.period)),
                None => "the torque was never all there".into(),
            };
            let end = match how {
                Ok(How::Done) => "ended in order".into(),
                Ok(How::Signal(_)) => "interrupted, the torque off at once".into(),
                Ok(How::Fault(reason)) => format!("faulted. {}", reason.sentence()),
                Err(_) => "broken off".into(),
            };
            let samples = match (first, last) {
                (Some(first), Some(last)) => last.sample - first.sample + 1,
                _ => 0,
            };
            let missed = match self.seen.missed() {
                0 => "none".into(),
                missed => people::count(missed.into()),
            };
            let board = self.link.board();
            format!(
                "{} on the board {}, {} a sample\nran          {ran}; {end}\nmotor        asked for {} at most, of what was shown\nsamples      {}, {missed} missed; {} shown\n",
                fit.loaded.title(),
                board.name,
                people::time(self.period),
                people::effort(*peak, fit.loaded.world.motion),
                people::count(samples),
                people::count(*shown),
            )
        }
    }

    fn phase(telemetry: &Telemetry) -> Option<Phase> {
        Phase::ALL.get(usize::from(telemetry.phase)).copied()
    }

    impl Measurement {
        /// Samples that the board has missed while it was watched.
        fn missed(&self) -> u32 {
            self.first.zip(self.last).map_or(0, |(first, last)| last.missed.wrapping_sub(first.missed))
        }

        /// Why the board has faulted, if it has.
        fn reason(&self) -> Result<Option<Reason>, Failure> {
            let unknown = || {
                let code = self.reason;
                Failure::System(format!(
                    "the board has faulted for a reason (code {code}) that this hapt does not know; a hapt as new as its firmware does"
                ))
            };
            match self.reason {
                0 if self.phase != Some(Phase::Faulted) => Ok(None),
                code => Reason::from_code(code).map(Some).ok_or_else(unknown),
            }
        }

        fn add(&mut self, telemetry: &Telemetry) {
            self.first.get_or_insert(*telemetry);
            self.last = Some(*telemetry);
            self.shown += 1;
            self.peak = self.peak.max(f64::from(telemetry.output).abs());
            self.phase = phase(telemetry);
            self.reason = telemetry.reason;
            if self.phase == Some(Phase::Running) {
                self.running.get_or_insert((telemetry.sample, telemetry.sample)).1 = telemetry.sample;
            }
        }
    }
}
