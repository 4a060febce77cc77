//! Running the program, and reading what it writes.

use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Longer than anything here takes on the slowest machine.
pub const TEST_TIMEOUT: Duration = Duration::from_secs(120);

/// The notes' wheel, as most tests take it.
pub const WHEEL: &str = r#"title = "wheel"

[loop]
period = "1 ms"

[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"

[bodies.wheel]
inertia = "0.02580123 kg m^2"

[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1.018592 N m/rad"

[scenarios.step]
duration = "0.5 s"
hand = { kind = "step", to = "45 deg" }
"#;

/// How a run of the program ended, and what it said.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// A simulated drive of this make in this folder, with these arguments, and its `--device` address.
#[cfg(target_os = "linux")]
pub fn drive(at: &Path, make: &str, more: &[&str]) -> (Running, String) {
    let args = ["simulate-drive", make, "--pty", "w.toml"];
    let mut drive = Running::start(program(at, args.iter().chain(more)));
    let mut path = String::new();
    drive.until("its port", |out, _| {
        path = out.lines().next().unwrap_or_default().into();
        out.ends_with('\n')
    });
    assert!(path.starts_with("/dev/"), "{path}");
    (drive, format!("{make}:{path}"))
}

/// The first of ten runs that no pause of the machine has ended: in a pause a drive goes silent, or removes its torque, and both are right.
/// A drive that never keeps up fails them all. Each waits longer than the one before, for the machine to have time.
#[cfg(target_os = "linux")]
pub fn steady(mut run: impl FnMut() -> Ended) -> Ended {
    let mut ended = run();
    for attempt in 1..10 {
        if ended.code != Some(3) {
            break;
        }
        thread::sleep(Duration::from_millis(200 * attempt));
        ended = run();
    }
    ended
}

/// The first of ten runs that reaches full torque, still running.
#[cfg(target_os = "linux")]
pub fn at_full_torque<A: AsRef<OsStr>>(folder: &Path, args: &[A]) -> Running {
    for _ in 0..10 {
        let mut run = Running::start(program(folder, args));
        if run.comes_to("full torque", |_, err| err.contains("at full torque")) {
            return run;
        }
        let ended = run.end();
        assert_eq!(ended.code, Some(3), "{ended:?}");
    }
    panic!("ten runs have ended before full torque");
}

/// The first of ten answers that has this word: during a pause of the machine a drive is silent for longer than the timeout.
#[cfg(target_os = "linux")]
pub fn answer(word: &str, run: impl Fn() -> Ended) -> Ended {
    let mut answers = std::iter::repeat_with(run).take(10);
    answers.find(|ended| ended.err.contains(word)).unwrap_or_else(|| panic!("ten answers without {word:?}"))
}

impl Ended {
    /// It succeeded.
    #[track_caller]
    pub fn done(self) -> Ended {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// The lines on standard error, without those of progress: on a slow machine any run may be a long one.
    pub fn messages(&self) -> Vec<&str> {
        self.err.lines().filter(|line| ![" samples", " left"].iter().any(|end| line.ends_with(end))).collect()
    }

    /// It ended with `code`, said nothing but one message, on standard error, and the message has every one of `words`.
    #[track_caller]
    pub fn refused(self, code: i32, words: &[&str]) -> Ended {
        assert_eq!((self.code, self.out.as_str()), (Some(code), ""), "{words:?}: {}", self.err);
        let head = |line: &str| line.starts_with("hapt: ") || line.starts_with("error: ");
        let messages = self.messages();
        assert!(messages.first().is_some_and(|line| head(line)), "no message first: {}", self.err);
        assert_eq!(messages.iter().filter(|line| head(line)).count(), 1, "one message: {}", self.err);
        for word in words {
            assert!(self.err.contains(word), "{word:?} is not in: {}", self.err);
        }
        self
    }
}

/// The program that is tested: this build's, or the one that HAPT_PROGRAM names, as `cargo xtask test` does with the released one.
pub fn binary() -> PathBuf {
    std::env::var_os("HAPT_PROGRAM").map_or_else(|| env!("CARGO_BIN_EXE_hapt").into(), PathBuf::from)
}

/// A line of shell in this folder, for which the program is `hapt`.
#[cfg(unix)]
pub fn shell(folder: &Path, line: &str) -> Command {
    let path = format!("{}:{}", binary().parent().unwrap().display(), std::env::var("PATH").unwrap_or_default());
    let mut shell = Command::new("sh");
    shell.args(["-c", line]).current_dir(folder).env("PATH", path);
    shell
}

/// The program, which reacts to a closed terminal even where the tests run under nohup.
fn heeding() -> Command {
    if !cfg!(target_os = "linux") {
        return Command::new(binary());
    }
    let mut command = Command::new("env");
    command.arg("--default-signal=HUP").arg(binary());
    command
}

/// The program, in this folder, its standard input empty.
pub fn program<A: AsRef<OsStr>>(folder: &Path, args: impl IntoIterator<Item = A>) -> Command {
    let mut command = heeding();
    command.current_dir(folder).args(args).stdin(Stdio::null());
    // The environment of the tests may set colours and narrow pages.
    command.env_remove("CLICOLOR_FORCE").env_remove("COLUMNS");
    command
}

/// Runs the program to its end.
pub fn hapt<A: AsRef<OsStr>>(folder: &Path, args: impl IntoIterator<Item = A>) -> Ended {
    Running::start(program(folder, args)).end()
}

/// The same with a text on standard input.
pub fn hapt_reads<A: AsRef<OsStr>>(folder: &Path, text: &str, args: impl IntoIterator<Item = A>) -> Ended {
    let mut command = program(folder, args);
    command.stdin(Stdio::piped());
    let mut running = Running::start(command);
    running.feed(text.as_bytes());
    running.end()
}

/// The running program; it does not outlive the test.
pub struct Running {
    child: Child,
    input: Option<ChildStdin>,
    out: Output,
    err: Output,
}

impl Running {
    /// Starts a command. Its output is collected, where the command has no other place for it.
    pub fn start(mut command: Command) -> Running {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Running::start_as_it_is(command)
    }

    /// Starts a command with the standard output and error that are set in it.
    pub fn start_as_it_is(mut command: Command) -> Running {
        let mut child = command.spawn().unwrap();
        let (out, err) = (Output::from(child.stdout.take()), Output::from(child.stderr.take()));
        Running { input: child.stdin.take(), child, out, err }
    }

    /// Gives it standard input to read; more may follow. A program need not read all of it.
    pub fn feed(&mut self, bytes: &[u8]) {
        let _ = self.input.as_mut().unwrap().write_all(bytes);
    }

    /// Waits until `seen` of what it has said on standard output and on standard error.
    #[track_caller]
    pub fn until(&mut self, what: &str, seen: impl FnMut(&str, &str) -> bool) {
        let comes = self.comes_to(what, seen);
        assert!(comes, "ended with {:?} before {what}: {}", self.child.try_wait().unwrap(), self.err.text());
    }

    /// The same; whether it came to that, or ended before.
    #[track_caller]
    pub fn comes_to(&mut self, what: &str, mut seen: impl FnMut(&str, &str) -> bool) -> bool {
        let start = Instant::now();
        while !seen(&self.out.text(), &self.err.text()) {
            if self.child.try_wait().unwrap().is_some() {
                return false;
            }
            assert!(start.elapsed() < TEST_TIMEOUT, "waited too long for {what}");
            thread::sleep(Duration::from_millis(5));
        }
        true
    }

    /// Whether it has not ended.
    #[cfg(unix)]
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Sends a signal, such as "INT".
    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }

    /// Waits for its end; standard input ends here.
    #[track_caller]
    pub fn end(mut self) -> Ended {
        drop(self.input.take());
        let status = self.wait();
        // Messages name paths as the system does.
        let err = if cfg!(windows) { self.err.all().replace('\\', "/") } else { self.err.all() };
        Ended { code: status.code(), out: self.out.all(), err }
    }

    /// The same, with standard input still open.
    #[cfg(unix)]
    #[track_caller]
    pub fn interrupted(mut self) -> Ended {
        let input = self.input.take();
        let ended = self.end();
        drop(input);
        ended
    }

    #[track_caller]
    fn wait(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(start.elapsed() < TEST_TIMEOUT, "it does not end");
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The output of a pipe up to now.
struct Output {
    bytes: Arc<Mutex<Vec<u8>>>,
    listener: Option<JoinHandle<()>>,
}

impl Output {
    fn from(pipe: Option<impl Read + Send + 'static>) -> Output {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let listener = pipe.map(|mut pipe| {
            let bytes = Arc::clone(&bytes);
            thread::spawn(move || {
                let mut part = [0; 1 << 16];
                while let Ok(length @ 1..) = pipe.read(&mut part) {
                    bytes.lock().unwrap().extend_from_slice(&part[..length]);
                }
            })
        });
        Output { bytes, listener }
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes.lock().unwrap()).into_owned()
    }

    fn all(&mut self) -> String {
        if let Some(listener) = self.listener.take() {
            listener.join().unwrap();
        }
        String::from_utf8(self.bytes.lock().unwrap().clone()).unwrap()
    }
}

/// The folder of the worlds that come with the source.
pub fn worlds() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds").canonicalize().unwrap()
}

/// One of them.
pub fn shipped(name: &str) -> String {
    worlds().join(name).to_str().unwrap().to_string()
}

/// All of them, by a walk of the folder.
pub fn every_world() -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![worlds()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(OsStr::to_str) {
                _ if path.is_dir() => folders.push(path),
                Some("toml") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    assert!(found.len() >= 12, "worlds are missing: {found:?}");
    found
}

/// A folder of the test's own, with these files in it.
pub fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// The list of `hapt sim` next to the files of runs: which world made each.
pub const RUNS: &str = ".hapt-runs.json";

/// The names in a folder, sorted, those with a leading point too.
pub fn names(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = std::fs::read_dir(folder).unwrap().map(name).filter(|name| name != RUNS).collect();
    names.sort();
    names
}

/// A CSV file of numbers.
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a file; every field is a finite number.
    #[track_caller]
    pub fn read(path: &Path) -> Table {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.ends_with('\n'), "the last line of {} is not whole", path.display());
        let mut lines = text.lines();
        let header: Vec<String> = lines.next().unwrap().split(',').map(String::from).collect();
        let number =
            |text: &str| text.parse::<f64>().ok().filter(|x| x.is_finite()).unwrap_or_else(|| panic!("{text:?}"));
        let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(number).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == header.len()), "a row of {} has another width", path.display());
        Table { header, rows }
    }

    /// A column by its name.
    #[track_caller]
    pub fn column(&self, name: &str) -> Vec<f64> {
        let place = self.header.iter().position(|column| column == name);
        let place = place.unwrap_or_else(|| panic!("no column {name} in {:?}", self.header));
        self.rows.iter().map(|row| row[place]).collect()
    }
}

/// Runs a world of one scenario `step` with these further arguments, and reads its CSV.
#[track_caller]
pub fn simulated(world: &str, args: &[&str]) -> Table {
    let at = folder(&[("w.toml", world)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "out"].iter().chain(args)).done();
    Table::read(&at.path().join("out/step.csv"))
}

/// That two numbers differ by no more than `relative` of the larger.
#[track_caller]
pub fn near(given: f64, wanted: f64, relative: f64) {
    let size = given.abs().max(wanted.abs());
    assert!((given - wanted).abs() <= relative * size, "{given:e} is not {wanted:e} to {relative:e}");
}
