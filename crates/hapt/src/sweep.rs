//! `hapt sweep`: a grid of a world's numbers, measured, as a table and a picture.
//!
//! The rows go to `FILE.HASH.partial` as CSV, flushed as they come; at the end it becomes the CSV, or the Parquet file is made
//! from it. Each shard of a table is a table of its own, with the CSV's header in the first. An interrupted sweep leaves it there, and
//! `--resume` continues after its last complete line. The hash is of everything that the rows depend on, so that rows of another sweep are
//! never used.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::hash::Hasher;
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write, stdout};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use hapt_model::{Motion, did_you_mean};
use hapt_sweep::table::{self, Column};
use hapt_sweep::{Measure, Shard, Sweep, Ticks};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::args::SweepArgs;
use crate::columnar;
use crate::failure::Failure;
use crate::finished;
use crate::format;
use crate::messages;
use crate::output::{self, Draft};
use crate::picture::FigureFile;
use crate::progress::Progress;
use crate::signals;
use crate::world::{inputs, read_system, source};

/// The largest number of threads.
const MOST_THREADS: usize = 1024;
/// The most cells of a map: each is a number in memory until it is drawn.
const MOST_DRAWN: u64 = 10_000_000;
/// The longest time of a block of cells before its rows are written.
const STRETCH: Duration = Duration::from_millis(250);
/// The most cells of a stretch, whose rows are in memory together.
const MOST_AT_ONCE: u64 = 1 << 16;

/// The output of the table.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Parquet,
}

pub fn run(args: &SweepArgs) -> Result<ExitCode, Failure> {
    let ending = args.out.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let format = match ending.as_deref() {
        Some("csv") => Format::Csv,
        Some("parquet") => Format::Parquet,
        _ => return Err(Failure::input(format!("--out {}: expected FILE.csv or FILE.parquet", args.out.display()))),
    };
    output::built("--out", &args.out)?;
    output::regular("--out", &args.out)?;
    let figure = FigureFile::of("--plot", args.plot.as_deref(), &args.figure)?;
    let measures = args.measures.iter().map(|name| measure(name)).collect::<Result<Vec<_>, _>>()?;
    let source = source(&args.world.path)?;
    let sweep = Sweep::new(&source, &args.world.sets, &args.axes, &measures, args.scenario.as_deref())?;
    let system = read_system(&source, &args.world.sets)?;
    let outputs = [Some(("--out", args.out.as_path())), args.plot.as_deref().map(|plot| ("--plot", plot))];
    let outputs: Vec<_> = outputs.into_iter().flatten().collect();
    output::apart(&outputs, &inputs(&args.world.path, &sweep.system))?;
    if args.plot.is_some() && sweep.grid.axes.len() > 2 {
        let given = sweep.grid.axes.len();
        return Err(Failure::input(format!(
            "--plot draws a curve over one axis or a map over two, and {given} are varied"
        )));
    }
    if args.plot.is_some() && sweep.grid.axes.len() == 2 && sweep.cells() > MOST_DRAWN {
        return Err(Failure::input(format!(
            "--plot draws a map of up to {} cells, and the grid has {}: fewer values, or no --plot",
            format::count(MOST_DRAWN),
            format::count(sweep.cells())
        )));
    }
    let threads = match args.threads {
        Some(threads) if threads == 0 || threads > MOST_THREADS => {
            return Err(Failure::input(format!("--threads {threads}: expected 1 to {MOST_THREADS}")));
        }
        // 0: rayon's own choice, a thread a core.
        threads => threads.unwrap_or(0),
    };
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Failure::System(format!("cannot start threads: {error}")))?;

    let columns = table::columns(&sweep);
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    let cells = shard.cells(sweep.cells());
    let rows = cells.end - cells.start;
    // The shards of a CSV can be put together by `cat`.
    let has_header = format == Format::Parquet || shard.is_first();
    let header = if has_header { table::header(&columns) } else { String::new() };
    if args.resume {
        finished::check(&args.out, &sweep, args.shard, &cells, &columns)?;
    }
    let mut partial = Partial::open(&args.out, &sweep, cells.clone(), header, &columns, args.resume)?;
    let missing = compute(&sweep, cells, &pool, &mut partial)?;
    if let Some(plot) = &args.plot {
        let own: Vec<_> = sweep.grid.axes.iter().map(|axis| system.number(&axis.key)).collect();
        crate::sweep_plot::draw(&sweep, &args.axes, &own, partial.rows()?, plot, figure)?;
    }
    partial.finish(format, &columns)?;

    messages::say(format_args!("wrote {}, {} rows", args.out.display(), format::count(rows)));
    for (measure, count) in measures.iter().zip(missing).filter(|(_, count)| *count > 0) {
        messages::say(format_args!("{} has no value in {} of them", measure.name(), format::count(count)));
    }
    Ok(ExitCode::SUCCESS)
}

fn measure(name: &str) -> Result<Measure, Failure> {
    Measure::from_name(name.trim()).ok_or_else(|| {
        let hint = match did_you_mean(name.trim(), Measure::ALL.map(Measure::name)) {
            hint if hint.is_empty() => format!("; there are {}", Measure::ALL.map(Measure::name).join(", ")),
            hint => hint,
        };
        Failure::input(format!("--measure: there is no {name:?}{hint} (--measure help lists them)"))
    })
}

/// `hapt sweep --measure help`: handled before the required arguments of a sweep.
pub fn asks_for_measures(arguments: impl Iterator<Item = std::ffi::OsString>) -> bool {
    let arguments: Vec<_> = arguments.skip(1).collect();
    let is_help = |pair: &[std::ffi::OsString]| pair[0] == "--measure" && pair[1] == "help";
    arguments.first().is_some_and(|command| command == "sweep")
        && (arguments.windows(2).any(is_help) || arguments.iter().any(|argument| argument == "--measure=help"))
}

/// Each measure with its unit and meaning.
pub fn list_measures() -> Result<ExitCode, Failure> {
    let mut text = String::new();
    for measure in Measure::ALL {
        let units = [Motion::Rotary, Motion::Linear].map(|motion| measure.unit(motion));
        let unit = match units {
            ["", _] => String::new(),
            [rotary, linear] if rotary == linear => format!(" ({rotary})"),
            [rotary, linear] => format!(" ({rotary}; linear: {linear})"),
        };
        text += &format!("{:<18} {}{unit}\n", measure.name(), measure.meaning());
    }
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

/// Computes the missing cells; returns the number of cells without a value for each measure, over all cells. One stretch is written while the
/// next is computed.
fn compute(sweep: &Sweep, cells: Range<u64>, pool: &ThreadPool, partial: &mut Partial) -> Result<Vec<u64>, Failure> {
    let rows = cells.end - cells.start;
    let mut missing = partial.missing.clone();
    let mut progress = Progress::new("sweep", "cells", rows, partial.done);
    let ticks = Ticks::new(&sweep.grid);
    // Few at first, because a cell may be a run of an hour.
    let mut stretch = pool.current_num_threads() as u64;
    let mut computed = partial.done;
    let mut ready: Vec<String> = Vec::new();
    while partial.done < rows {
        let started = Instant::now();
        let end = (computed + stretch).min(rows);
        let (mut next, mut written) = (None, Ok(()));
        pool.in_place_scope(|scope| {
            if computed < end {
                let cells = cells.start + computed..cells.start + end;
                scope.spawn(|_| next = Some(sweep.lines(&ticks, cells)));
            }
            written = ready.iter().try_for_each(|text| partial.write(text));
        });
        written?;
        partial.done = computed;
        progress.reached(computed);
        computed = end;
        ready.clear();
        if let Some(lines) = next {
            missing.iter_mut().zip(lines.missing).for_each(|(sum, count)| *sum += count);
            ready = lines.text;
        }
        stretch = match started.elapsed() {
            short if short < STRETCH / 2 => (2 * stretch).min(MOST_AT_ONCE),
            long if long > STRETCH => (stretch / 2).max(pool.current_num_threads() as u64),
            _ => stretch,
        };
    }
    Ok(missing)
}

/// The partial file of rows.
struct Partial {
    file: File,
    path: PathBuf,
    target: PathBuf,
    /// The first line; empty: none.
    header: String,
    /// Rows that are there.
    done: u64,
    /// The number of rows without a value, for each measure.
    missing: Vec<u64>,
}

impl Partial {
    /// Starts `FILE.HASH.partial`, or continues after its last complete row.
    fn open(
        target: &Path,
        sweep: &Sweep,
        cells: Range<u64>,
        header: String,
        columns: &[Column],
        resume: bool,
    ) -> Result<Self, Failure> {
        let target = output::followed(target).map_err(|error| Failure::write(target.display(), error))?;
        let mut name = target.file_name().map_or_else(OsString::new, OsString::from);
        name.push(format!(".{:016x}.partial", fingerprint(sweep, &cells)));
        let path = target.with_file_name(name);
        let failed = |error| Failure::write(path.display(), error);
        let rows = cells.end - cells.start;
        let there = resume && path.exists();
        if resume && !there {
            messages::say(format_args!("there is no {} to continue from", path.display()));
        }
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(!there).open(&path).map_err(failed)?;
        let mut partial = Partial {
            file: file.try_clone().map_err(failed)?,
            path: path.clone(),
            target,
            header,
            done: 0,
            missing: vec![0; sweep.measures.len()],
        };
        let length = if there { partial.count(&mut file, rows, sweep, columns).map_err(failed)? } else { 0 };
        if length == 0 {
            partial.file.set_len(0).and_then(|()| partial.file.rewind()).map_err(failed)?;
            partial.write(&partial.header.clone())?;
        } else {
            partial.file.set_len(length).map_err(failed)?;
            partial.file.seek(SeekFrom::Start(length)).map_err(failed)?;
            messages::say(format_args!(
                "going on behind {} of {} cells",
                format::count(partial.done),
                format::count(rows)
            ));
        }
        let words = format!("the rows so far are in {}; the same command with --resume continues", path.display());
        signals::when_interrupted(Some(words));
        Ok(partial)
    }

    /// Counts the complete rows of an interrupted sweep; returns the bytes of them and the header, 0 where that is not its header.
    fn count(&mut self, file: &mut File, rows: u64, sweep: &Sweep, columns: &[Column]) -> io::Result<u64> {
        let mut reader = BufReader::new(file);
        let mut line = String::new();
        if !self.header.is_empty() && (reader.read_line(&mut line)? != self.header.len() || line != self.header) {
            return Ok(0);
        }
        let mut length = self.header.len() as u64;
        while self.done < rows {
            line.clear();
            let read = reader.read_line(&mut line)?;
            let Some(row) = line.strip_suffix('\n').and_then(|line| table::read(line, columns.len())) else { break };
            for (count, _) in
                self.missing.iter_mut().zip(row.iter().skip(sweep.grid.axes.len())).filter(|(_, value)| value.is_none())
            {
                *count += 1;
            }
            self.done += 1;
            length += read as u64;
        }
        Ok(length)
    }

    fn write(&mut self, text: &str) -> Result<(), Failure> {
        self.file.write_all(text.as_bytes()).map_err(|error| {
            Failure::write(
                self.path.display(),
                format!("{error}; the rows that fit are written, and --resume continues after them"),
            )
        })
    }

    /// The lines after the header, from the beginning.
    fn rows(&self) -> Result<BufReader<File>, Failure> {
        let failed = |error| Failure::System(format!("cannot read {}: {error}", self.path.display()));
        let mut reader = BufReader::with_capacity(1 << 16, File::open(&self.path).map_err(failed)?);
        if !self.header.is_empty() {
            reader.read_line(&mut String::new()).map_err(failed)?;
        }
        Ok(reader)
    }

    /// Makes the table of the rows.
    fn finish(self, format: Format, columns: &[Column]) -> Result<(), Failure> {
        let failed = |error| Failure::write(self.target.display(), error);
        match format {
            Format::Csv => {
                if let Some(there) = output::protected(&self.target).map_err(failed)? {
                    // As for a draft: the new file has the permissions of the old one.
                    let _ = self.file.set_permissions(there);
                }
                fs::rename(&self.path, &self.target).map_err(failed)?;
            }
            Format::Parquet => {
                let draft = Draft::new(self.target.clone()).map_err(failed)?;
                columnar::write(columns, self.rows()?, draft).and_then(Draft::finish).map_err(failed)?;
                fs::remove_file(&self.path).map_err(|error| Failure::write(self.path.display(), error))?;
            }
        }
        signals::when_interrupted(None);
        Ok(())
    }
}

/// Of everything that the rows depend on.
fn fingerprint(sweep: &Sweep, cells: &Range<u64>) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    hash.write(format!("{} {sweep:?} {cells:?}", env!("CARGO_PKG_VERSION")).as_bytes());
    hash.finish()
}

/// Fowler, Noll and Vo's hash, 1a: stable between versions, which the standard library does not promise for its own hash.
struct Fnv(u64);

impl Hasher for Fnv {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
