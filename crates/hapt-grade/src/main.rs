//! `hapt-grade`: compares the answers to a pack of questions, such as a lesson of the course, with the results of hapt.

mod failure;
mod mark;
mod pack;
mod value;

use std::collections::BTreeMap;
use std::io::{Write, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use hapt_model::did_you_mean;
use serde_json::{Value, json};

use failure::Failure;
use mark::{Marked, Marker};
use pack::Pack;

/// Grade the answers to a pack of questions, such as a lesson of the course.
#[derive(Debug, Parser)]
#[command(
    name = "hapt-grade",
    version,
    max_term_width = 100,
    after_help = "\
Examples:
  hapt-grade wall                                    the pack's questions
  hapt-grade wall --student ada                      with ada's numbers
  hapt-grade wall --template > answer.toml           a line a question, to fill in
  hapt-grade wall answer.toml                        exit code 1 if one is wrong
  hapt-grade wall answer.toml --key --json           with what was expected"
)]
struct Args {
    /// The folder of the pack, with pack.toml and its starter world.
    #[arg(value_name = "PACK")]
    pack: PathBuf,
    /// The answers, a TOML file with one `id = "value unit"` a line; default: print the questions.
    #[arg(value_name = "ANSWER.toml")]
    answer: Option<PathBuf>,
    /// The name or number of a student, which chooses the starter's numbers.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    student: Option<String>,
    /// Print a file for the answers: a line a question.
    #[arg(long, conflicts_with_all = ["answer", "json"])]
    template: bool,
    /// Show the expected answers.
    #[arg(long, requires = "answer")]
    key: bool,
    /// Print the table as JSON.
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    run(&Args::parse()).unwrap_or_else(Failure::report)
}

fn run(args: &Args) -> Result<ExitCode, Failure> {
    let (pack, starter) = Pack::open(&args.pack)?;
    let sets = pack.of_student(args.student.as_deref());
    let Some(path) = &args.answer else {
        let text = if args.template { template(&pack, &sets) } else { questions(&pack, &sets, args.json)? };
        print(&text)?;
        return Ok(ExitCode::SUCCESS);
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let answers = answers(&pack, &pack::open(folder, name)?)?;
    let marker = Marker { starter: &starter, sets: &sets, folder };
    let marked = pack.questions.iter().map(|question| marker.mark(question, answers.get(&question.id)));
    let marked = marked.collect::<Result<Vec<Marked>, Failure>>()?;
    let text = if args.json { pretty(&as_json(&pack, &marked, args))? } else { table(&pack, &marked, args.key) };
    print(&text)?;
    Ok(if marked.iter().all(|marked| marked.right) { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The answers by their questions' ids.
fn answers(pack: &Pack, source: &hapt_model::Source) -> Result<BTreeMap<String, Value>, Failure> {
    let Value::Object(table) = pack::tree(source)? else { return Ok(BTreeMap::new()) };
    let ids = || pack.questions.iter().map(|question| question.id.as_str());
    if let Some(id) = table.keys().find(|id| !ids().any(|known| known == id.as_str())) {
        let (hint, list) = (did_you_mean(id, ids()), ids().collect::<Vec<_>>().join(", "));
        return Err(Failure::input(format!("{}: no question {id:?}{hint}; the questions are {list}", source.name)));
    }
    Ok(table.into_iter().collect())
}

/// The questions, and the numbers of a student's starter.
fn questions(pack: &Pack, sets: &[String], as_json: bool) -> Result<String, Failure> {
    if as_json {
        let list =
            pack.questions.iter().map(|q| json!({"id": q.id, "text": q.text, "unit": q.unit, "points": q.points}));
        return pretty(&json!({"title": pack.title, "set": sets, "questions": list.collect::<Vec<_>>()}));
    }
    let mut text = format!("{}\n", pack.title);
    for set in sets {
        text += &format!("  --set '{set}'\n");
    }
    for question in &pack.questions {
        let unit = if question.unit.is_empty() { String::new() } else { format!(", in {}", question.unit) };
        text += &format!("\n{} ({} points{unit})\n  {}\n", question.id, question.points, question.text.trim());
    }
    Ok(text)
}

/// A file for the answers, with each question as a comment above its line.
fn template(pack: &Pack, sets: &[String]) -> String {
    let comment = |text: &str| text.trim().lines().map(|line| format!("# {}\n", line.trim())).collect::<String>();
    let mut text = comment(&pack.title);
    for set in sets {
        text += &format!("#   --set '{set}'\n");
    }
    for question in &pack.questions {
        let (id, unit) = (&question.id, &question.unit);
        let answer = match (&question.from, unit.as_str()) {
            (None, _) => "\"my-world.toml\"".to_string(),
            (Some(_), "") => "\"\"".to_string(),
            (Some(_), unit) => format!("\" {unit}\""),
        };
        text += &format!("\n{}# {id} = {answer}\n", comment(&question.text));
    }
    text
}

fn table(pack: &Pack, marked: &[Marked], key: bool) -> String {
    let width = |cell: fn(&Marked) -> &str| marked.iter().map(|marked| cell(marked).chars().count()).max().unwrap_or(0);
    let (ids, given) = (width(|marked| &marked.id), width(|marked| &marked.given));
    let mut text = format!("{}\n\n", pack.title);
    for marked in marked {
        let verdict = if marked.right { "right" } else { "wrong" };
        let (earned, of) = (marked.earned(), marked.points);
        let mut line = format!("  {:ids$}  {:given$}  {verdict}  {earned}/{of}", marked.id, marked.given);
        if key {
            line += &format!("  expected {}", marked.expected);
        }
        if !marked.why.is_empty() {
            line += &format!("  {}", marked.why);
        }
        text += &line;
        text.push('\n');
    }
    let (earned, of) = sum(marked);
    text + &format!("\n{earned} of {of} points\n")
}

fn as_json(pack: &Pack, marked: &[Marked], args: &Args) -> Value {
    let row = |marked: &Marked| {
        let mut row = json!({
            "id": marked.id, "given": marked.given, "right": marked.right, "points": marked.earned(), "of": marked.points,
            "why": (!marked.why.is_empty()).then_some(&marked.why),
        });
        if let (true, Some(row)) = (args.key, row.as_object_mut()) {
            row.insert("expected".into(), Value::String(marked.expected.clone()));
        }
        row
    };
    let (points, of) = sum(marked);
    let rows: Vec<Value> = marked.iter().map(row).collect();
    json!({"title": pack.title, "student": args.student, "questions": rows, "points": points, "of": of})
}

/// The points earned, and all points.
fn sum(marked: &[Marked]) -> (u64, u64) {
    marked
        .iter()
        .fold((0, 0), |(points, of), marked| (points + u64::from(marked.earned()), of + u64::from(marked.points)))
}

fn pretty(value: &Value) -> Result<String, Failure> {
    serde_json::to_string_pretty(value).map(|text| text + "\n").map_err(|error| Failure::System(error.to_string()))
}

fn print(text: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)
}
