//! Where a page's blocks are run, and how.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};

use super::NOT_RUN;
use crate::{programs, tools};

/// Packages that `python` blocks import, and the environments that have them.
const PYTHON: [(&str, &str); 2] = [("hapt", "hapt"), ("fmpy", "fmi")];
/// The link that a page shows of `hapt live`, up to the port.
const LINK: &str = "http://127.0.0.1:";

/// Copies a folder with all that is in it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name()))?;
        if path.is_dir() {
            copy(&path, &to.join(name))?;
        } else {
            fs::copy(&path, to.join(name))?;
        }
    }
    Ok(())
}

/// A folder in which a page's commands are run.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(page: &Path) -> Result<Scratch> {
        let folder = std::env::current_dir()?.join("target/book").join(page.file_stem().context("no name")?);
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        for given in ["worlds", "networks", "docs/course"] {
            copy(Path::new(given), &folder.join(given))?;
        }
        Ok(Scratch(folder))
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Runs the lines of a block, joined where they end with a backslash; returns their output.
    pub fn run_all(&self, block: &str) -> Result<String> {
        let mut printed = String::new();
        for line in
            block.replace("\\\n", "").lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'))
        {
            let line = match line.strip_prefix("cargo run") {
                Some("") => "hapt".to_string(),
                Some(rest) if rest.starts_with(" -- ") => rest.replacen(" --", "hapt", 1),
                _ => line.to_string(),
            };
            // Settings of the environment come before the command.
            let command: String = line.split_inclusive(' ').skip_while(|word| word.contains('=')).collect();
            if !NOT_RUN.iter().any(|start| command.starts_with(start)) {
                let wanted = line.rsplit_once("# exit ").map_or(Ok(0), |(_, code)| code.trim().parse())?;
                printed += &self.run(&line, &[wanted])?;
            }
        }
        Ok(printed)
    }

    /// Runs one line, which has to end with one of `codes`.
    fn run(&self, line: &str, codes: &[i32]) -> Result<String> {
        let sh = self.shell(&format!("exec 2>&1\n{line}"))?.output()?;
        let printed = String::from_utf8(sh.stdout)?;
        let code = sh.status.code().context("ended by a signal")?;
        ensure!(codes.contains(&code), "{line}: ends with {code}, not {codes:?}\n{printed}");
        // Lines of progress depend on the machine.
        let progress =
            |line: &&str| (line.contains(" % of ") && line.ends_with(" s left")) || line.ends_with(" s so far");
        Ok(printed.lines().filter(|line| !progress(line)).map(|line| format!("{line}\n")).collect())
    }

    /// Writes a world file, checks it and runs its scenarios.
    pub fn world(&self, text: &str) -> Result<()> {
        let name = text.lines().next().and_then(|line| line.strip_prefix("# ")).filter(|name| name.ends_with(".toml"));
        let name = name.unwrap_or("wheel.toml");
        fs::write(self.0.join(name), text)?;
        self.run(&format!("hapt check {name}"), &[0, 1])?;
        if text.contains("[scenarios.") {
            self.run(&format!("hapt sim {name}"), &[0])?;
        }
        Ok(())
    }

    /// A line of shell with the tested programs on its path.
    fn shell(&self, line: &str) -> Result<Command> {
        let hapt = PathBuf::from(programs::binary(programs::PROFILE).get_program());
        let folders = [std::path::absolute(hapt)?.parent().context("no folder")?.to_path_buf()];
        let path = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(folders.into_iter().chain(std::env::split_paths(&path)))?;
        let mut sh = Command::new("sh");
        sh.args(["-c", line]).env("PATH", path).current_dir(&self.0).stdin(Stdio::null());
        Ok(sh)
    }

    /// Runs the commands of a `console` block that print a link.
    pub fn serve_all(&self, block: &str) -> Result<()> {
        let lines: Vec<&str> = block.lines().collect();
        for pair in lines.windows(2) {
            if let (Some(command), true) = (pair[0].strip_prefix("$ "), pair[1].starts_with(LINK)) {
                self.serve(command).with_context(|| command.to_string())?;
            }
        }
        Ok(())
    }

    /// Runs a server until its page has come. Another program may have the page's default port, so it takes any free one.
    fn serve(&self, command: &str) -> Result<()> {
        let mut sh = self.shell(&format!("exec {command} --port 0"))?;
        let mut server = Server(sh.stdout(Stdio::piped()).spawn()?);
        let mut link = String::new();
        BufReader::new(server.0.stdout.take().context("no output")?).read_line(&mut link)?;
        let port = link.trim().strip_prefix(LINK).and_then(|rest| rest.strip_suffix('/'));
        let port: u16 = port.with_context(|| format!("it prints {link:?}, not {LINK}PORT/"))?.parse()?;
        let mut page = TcpStream::connect(("127.0.0.1", port))?;
        write!(page, "GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n")?;
        let mut answer = String::new();
        page.read_to_string(&mut answer)?;
        ensure!(answer.starts_with("HTTP/1.1 200 ") && answer.contains("<title>"), "no page: {answer:.200}");
        let interrupted = Command::new("kill").args(["-INT", &server.0.id().to_string()]).status()?;
        ensure!(interrupted.success(), "kill");
        let code = server.0.wait()?.code();
        ensure!(code == Some(130), "Ctrl-C ends it with {code:?}, not 130");
        Ok(())
    }

    /// Runs a block of Python, where there is an environment with its package.
    pub fn python(&self, block: &str) -> Result<()> {
        let package = block.strip_prefix("import ").and_then(|rest| rest.split_whitespace().next());
        let package = package.context("its first line is no import")?;
        let known = PYTHON.iter().find(|(name, _)| *name == package);
        let (_, environment) = known.with_context(|| format!("no environment for {package}"))?;
        let Some(environment) = tools::environment(environment) else {
            ensure!(std::env::var_os("CI").is_none(), "there is no Python with {package}");
            println!("        (skipped: Python with {package}; CI=1 cargo xtask test installs it)");
            return Ok(());
        };
        let mut python = tools::python(&environment)?;
        let output = python.args(["-c", block]).current_dir(&self.0).stdin(Stdio::null()).output()?;
        ensure!(output.status.success(), "Python: {}", String::from_utf8_lossy(&output.stderr));
        Ok(())
    }
}

/// A program that ends with its test.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
