//! Path files: CSV of time and position, or torque.

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, ErrorKind, Location};
use crate::keys::Measure;
use crate::kinds::Motion;
use crate::quantity::parse_in_unit;
use crate::source::{STDIN, Source, decoded};
use crate::unit::Unit;
use crate::words;

/// A path file larger than this is refused: 64 MiB.
const LARGEST_FILE: u64 = 64 << 20;
/// Points in a path.
const MOST_POINTS: usize = 1_000_000;
/// Points in all paths of a world together: 160 MB.
const MOST_POINTS_IN_ALL: usize = 10_000_000;

/// The quantity of a path over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Carries {
    /// rad or m, under the header `puck_UNIT`.
    Position,
    /// N·m or N, under the header `torque_UNIT` or `force_UNIT`.
    Torque,
}

/// Reads the path files of one world.
pub(crate) struct Reader<'a> {
    source: &'a Source,
    motion: Motion,
    points: usize,
}

impl<'a> Reader<'a> {
    /// For the files that come with `source`, and those in its folder.
    pub fn new(source: &'a Source, motion: Motion) -> Reader<'a> {
        Reader { source, motion, points: 0 }
    }

    /// The text of a file in the world file's folder or below, and its name for messages.
    pub fn text(&self, file: &str) -> Result<(String, String), Error> {
        if let Some(text) = self.source.files.get(file) {
            return Ok((file.to_string(), text.clone()));
        }
        let folder = &self.source.folder;
        let bytes = self.bytes(file)?;
        // With standard input or in the current folder, the plain name is the one that the user knows.
        let shown = if folder == Path::new(".") { PathBuf::from(file) } else { folder.join(file) };
        let shown = shown.display().to_string();
        let text = decoded(&shown, bytes)?;
        Ok((shown, text))
    }

    /// The points of `file`, in s and in rad, m, N·m or N. An error without a location is about the file's name.
    pub fn read(&mut self, file: &str, carries: Carries) -> Result<Vec<(f64, f64)>, Error> {
        let (shown, text) = self.text(file)?;
        let points = self.parse(&shown, &text, carries)?;
        self.points += points.len();
        if self.points > MOST_POINTS_IN_ALL {
            return Err(refused(format!(
                "the paths of this world have more than {MOST_POINTS_IN_ALL} points together"
            )));
        }
        Ok(points)
    }

    /// The bytes of a file in the world file's folder or below.
    fn bytes(&self, file: &str) -> Result<Vec<u8>, Error> {
        let quoted = words::quoted(file);
        let (place, where_looked) = match self.source.name.as_str() {
            STDIN => ("the current folder", "in the current folder"),
            _ => ("the world file's folder", "beside the world file"),
        };
        let outside = || {
            Err(refused(format!(
                "{quoted} leads out of {place}; a file that a world names must be in that folder or below it"
            )))
        };
        let unreadable = |error: std::io::Error| refused(format!("cannot read {quoted} {where_looked}: {error}"));
        let folder = self.source.folder.canonicalize().map_err(unreadable)?;
        // An absolute path may begin with the folder as written by the user, or by the system.
        let named = std::path::absolute(&self.source.folder).map_err(unreadable)?;
        let within = [&named, &folder].into_iter().find_map(|folder| Path::new(file).strip_prefix(folder).ok());
        let below = within.unwrap_or(Path::new(file));
        if leaves(below) {
            return outside();
        }
        // A symbolic link inside may still lead outside.
        let path = folder.join(below).canonicalize().map_err(unreadable)?;
        if !path.starts_with(&folder) {
            return outside();
        }
        // Opening anything but a file might wait forever.
        if !path.metadata().map_err(unreadable)?.is_file() {
            return Err(refused(format!("{quoted} is not a file")));
        }
        let mut bytes = Vec::new();
        File::open(&path).map_err(unreadable)?.take(LARGEST_FILE + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > LARGEST_FILE {
            return Err(refused(format!(
                "{quoted} is larger than 64 MiB, the most that a file named by a world may have"
            )));
        }
        Ok(bytes)
    }

    fn parse(&self, name: &str, text: &str, carries: Carries) -> Result<Vec<(f64, f64)>, Error> {
        let body = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut start = text.len() - body.len();
        let mut unit = None;
        let mut points: Vec<(f64, f64)> = Vec::new();
        for line in body.split_inclusive('\n') {
            let (at, content) = (start, line.trim_end());
            start += line.len();
            if content.trim().is_empty() || content.trim_start().starts_with('#') {
                continue;
            }
            // The part of the line from byte `from`, `length` long, blanks around it left out.
            let fail = |from: usize, part: &str, message: String| {
                let blank = part.len() - part.trim_start().len();
                let from = at + from + blank;
                let location = Location::new(name, text, from..from + part.trim().len());
                Err(Error { kind: ErrorKind::Syntax, key: String::new(), message, location: Some(Box::new(location)) })
            };
            let Some((first, second)) = content.split_once(',').filter(|(_, second)| !second.contains(',')) else {
                return fail(0, content, "a path has two columns, with a comma between them".to_string());
            };
            let column = first.len() + 1;
            let Some(unit) = unit else {
                match self.header(first, second, carries) {
                    Ok(found) => unit = Some(found),
                    Err(message) => return fail(0, content, message),
                }
                continue;
            };
            let Some(time) = parse_in_unit(unquoted(first), Unit::ONE) else {
                return fail(
                    0,
                    first,
                    format!("{} is not a finite number; expected a time in s", words::quoted(first.trim())),
                );
            };
            let Some(value) = parse_in_unit(unquoted(second), unit) else {
                return fail(
                    column,
                    second,
                    format!(
                        "{} is not a finite number; expected one in the header's unit",
                        words::quoted(second.trim())
                    ),
                );
            };
            if let Some((before, _)) = points.last().filter(|(before, _)| *before >= time) {
                return fail(0, first, format!("{time:?} s does not come after {before:?} s; times must increase"));
            }
            if points.len() == MOST_POINTS {
                return fail(0, content, format!("a path has at most {MOST_POINTS} points"));
            }
            points.push((time, value));
        }
        if points.is_empty() {
            let what = if unit.is_none() { self.wanted(carries) } else { "a path has at least one point".to_string() };
            let location = Location::new(name, text, text.len()..text.len());
            let message = format!("the file ends here; {what}");
            return Err(Error {
                kind: ErrorKind::Syntax,
                key: String::new(),
                message,
                location: Some(Box::new(location)),
            });
        }
        Ok(points)
    }

    /// The second column's unit.
    fn header(&self, first: &str, second: &str, carries: Carries) -> Result<Unit, String> {
        let prefixes: &[&str] = match carries {
            Carries::Position => &["puck_"],
            Carries::Torque => &["torque_", "force_"],
        };
        let unit = prefixes.iter().find_map(|prefix| unquoted(second).strip_prefix(prefix));
        let Some(unit) = unit.filter(|_| unquoted(first) == "time_s") else { return Err(self.wanted(carries)) };
        let dimension = self.dimension(carries);
        match Unit::parse(unit) {
            Ok(unit) if dimension.accepts(unit.dimension()) => Ok(unit),
            Ok(other) => Err(format!("{} is {}; expected {dimension}", words::quoted(unit), other.dimension())),
            Err(fault) => Err(format!("{} {fault}; expected {dimension}", words::quoted(unit))),
        }
    }

    fn dimension(&self, carries: Carries) -> crate::Dimension {
        let measure = if carries == Carries::Position { Measure::Position } else { Measure::Torque };
        measure.dimension(self.motion)
    }

    fn wanted(&self, carries: Carries) -> String {
        let column = match (carries, self.motion) {
            (Carries::Position, Motion::Rotary) => "puck_deg",
            (Carries::Position, Motion::Linear) => "puck_mm",
            (Carries::Torque, Motion::Rotary) => "torque_Nm",
            (Carries::Torque, Motion::Linear) => "force_N",
        };
        format!("a path begins with its header: time_s,{column}, or another unit")
    }
}

/// The content of a field of a CSV file, without blanks around it and the quotes that spreadsheets may set.
pub(crate) fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).map_or(field, str::trim)
}

/// Whether a relative path climbs above where it starts, or is not relative at all.
fn leaves(file: &Path) -> bool {
    let mut depth = 0i64;
    file.components().any(|component| {
        depth += match component {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::Prefix(_) | Component::RootDir => return true,
        };
        depth < 0
    })
}

fn refused(message: String) -> Error {
    Error { kind: ErrorKind::Unreadable, key: String::new(), message, location: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn parse(text: &str, carries: Carries, motion: Motion) -> Result<Vec<(f64, f64)>, String> {
        let source = Source::from_text("w.toml", "");
        let reader = Reader::new(&source, motion);
        reader.parse("p.csv", text, carries).map_err(|error| error.to_string())
    }

    fn positions(text: &str) -> Result<Vec<(f64, f64)>, String> {
        parse(text, Carries::Position, Motion::Rotary)
    }

    #[test]
    fn units_are_in_the_header() {
        let half = std::f64::consts::FRAC_PI_2;
        assert_eq!(positions("time_s,puck_deg\n0,0\n0.5,90\n"), Ok(vec![(0.0, 0.0), (0.5, half)]));
        assert_eq!(positions("time_s,puck_rad\n0,1.1"), Ok(vec![(0.0, 1.1)]));
        assert_eq!(parse("time_s,puck_mm\n0,1.1", Carries::Position, Motion::Linear), Ok(vec![(0.0, 0.0011)]));
        for (header, newtonmetres) in [("torque_Nm", 7.0), ("torque_mNm", 0.007), ("torque_N m", 7.0)] {
            let text = format!("time_s,{header}\n0,7");
            assert_eq!(parse(&text, Carries::Torque, Motion::Rotary), Ok(vec![(0.0, newtonmetres)]), "{header}");
        }
        for header in ["force_N", "torque_N"] {
            assert_eq!(parse(&format!("time_s,{header}\n0,7"), Carries::Torque, Motion::Linear), Ok(vec![(0.0, 7.0)]));
        }
    }

    #[test]
    fn blank_lines_comments_and_the_ways_of_other_programs_are_fine() {
        let text = "\u{feff}# recorded\r\n\r\ntime_s, puck_rad\r\n -1 , 2 \r\n# here\r\n1e-3,-2e0\r\n\r\n";
        assert_eq!(positions(text), Ok(vec![(-1.0, 2.0), (0.001, -2.0)]));
    }

    #[test]
    fn fields_in_quotes_read_as_those_without() {
        let text = "\"time_s\",\"puck_rad\"\r\n\"0\",\"1.5\"\r\n1,\"-2\"\r\n";
        assert_eq!(positions(text), Ok(vec![(0.0, 1.5), (1.0, -2.0)]));
        for wrong in ["\"time_s,\"puck_rad\"\n0,1", "time_s,puck_rad\n\"\",1", "time_s,puck_rad\n0,\"1"] {
            assert!(positions(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn mistakes_are_shown_where_they_stand() {
        let message = |text: &str| positions(text).unwrap_err();
        assert_eq!(
            message("time_s,puck_rad\n0,1\n1, x\n"),
            "\"x\" is not a finite number; expected one in the header's unit\n --> p.csv:3:4\n  |\n3 | 1, x\n  |    ^"
        );
        assert_eq!(
            message("time_s,puck_rad\n0.5,1\n0.5,2\n"),
            "0.5 s does not come after 0.5 s; times must increase\n --> p.csv:3:1\n  |\n3 | 0.5,2\n  | ^^^"
        );
        assert_eq!(
            message("time_s,puck_rad\n"),
            "the file ends here; a path has at least one point\n --> p.csv:2:1\n  |\n2 |\n  | ^"
        );
        let first_line = |text: &str| message(text).lines().next().unwrap_or_default().to_string();
        assert_eq!(
            first_line(""),
            "the file ends here; a path begins with its header: time_s,puck_deg, or another unit"
        );
        assert_eq!(first_line("0,1\n"), "a path begins with its header: time_s,puck_deg, or another unit");
        assert_eq!(first_line("time_ms,puck_rad\n"), "a path begins with its header: time_s,puck_deg, or another unit");
        assert_eq!(first_line("time_s,puck_mm\n"), "\"mm\" is a length (m); expected an angle (rad)");
        assert_eq!(
            first_line("time_s,puck_dge\n"),
            "\"dge\" has the unknown unit \"dge\"; the nearest known one is \"deg\"; expected an angle (rad)"
        );
        assert_eq!(first_line("time_s;puck_rad\n"), "a path has two columns, with a comma between them");
        assert_eq!(first_line("time_s,puck_rad,b\n"), "a path has two columns, with a comma between them");
        assert_eq!(first_line("time_s,puck_rad\nnan,1"), "\"nan\" is not a finite number; expected a time in s");
        assert_eq!(
            first_line("time_s,puck_rad\n0,1e400"),
            "\"1e400\" is not a finite number; expected one in the header's unit"
        );
        assert_eq!(
            first_line("time_s,puck_rad\n0,1 2"),
            "\"1 2\" is not a finite number; expected one in the header's unit"
        );
    }

    #[test]
    fn a_million_points_are_the_most() {
        let mut text = String::from("time_s,puck_rad\n");
        for index in 0..MOST_POINTS {
            text.push_str(&format!("{index},0\n"));
        }
        assert_eq!(positions(&text).map(|points| points.len()), Ok(MOST_POINTS));
        text.push_str("1e9,0\n");
        assert!(positions(&text).is_err_and(|message| message.starts_with("a path has at most 1000000 points")));
    }

    #[test]
    fn a_path_file_stays_in_the_world_files_folder() {
        let outside = tempfile::tempdir().unwrap();
        let folder = outside.path().join("worlds");
        std::fs::create_dir_all(folder.join("below")).unwrap();
        let csv = "time_s,puck_rad\n0,1\n";
        for file in ["secret.csv", "worlds/a.csv", "worlds/below/b.csv"] {
            std::fs::write(outside.path().join(file), csv).unwrap();
        }
        let source = Source { folder: folder.clone(), ..Source::from_text("w.toml", "") };
        let mut reader = Reader::new(&source, Motion::Rotary);
        let mut read = |file: &str| reader.read(file, Carries::Position).map_err(|error| error.message);
        let [absolute, back, above] =
            ["below/b.csv", "below/../a.csv", "../secret.csv"].map(|file| folder.join(file).display().to_string());
        for file in ["a.csv", "./a.csv", "below/b.csv", "below/../a.csv", &absolute, &back] {
            assert_eq!(read(file), Ok(vec![(0.0, 1.0)]), "{file}");
        }
        for file in ["../secret.csv", "below/../../secret.csv", "../worlds/a.csv", "/etc/passwd", &above] {
            assert!(
                read(file).is_err_and(|message| message.contains("leads out of the world file's folder")),
                "{file}"
            );
        }
        assert!(read("below").is_err_and(|message| message.contains("is not a file")));
        assert!(read("").is_err());
        assert!(read("a\0b").is_err());
        assert_eq!(
            read("b.csv").unwrap_err(),
            "cannot read \"b.csv\" beside the world file: No such file or directory (os error 2)"
        );
        let piped = Source::from_text(STDIN, "");
        let mut reader = Reader::new(&piped, Motion::Rotary);
        let mut refused = |file: &str| reader.read(file, Carries::Position).unwrap_err().message;
        assert!(refused("no-such.csv").starts_with("cannot read \"no-such.csv\" in the current folder: "));
        assert!(refused("../no-such.csv").contains("leads out of the current folder"));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outside.path().join("secret.csv"), folder.join("link.csv")).unwrap();
            assert!(read("link.csv").is_err_and(|message| message.contains("leads out")));
            std::os::unix::fs::symlink(folder.join("a.csv"), folder.join("inside.csv")).unwrap();
            assert!(read("inside.csv").is_ok());
        }
    }

    proptest! {
        #[test]
        fn no_file_panics(text in "(time_s,puck_rad\n)?([0-9.eE,# -]{0,8}(\r\n|\n|µ)){0,9}") {
            let _ = positions(&text);
        }
    }
}
