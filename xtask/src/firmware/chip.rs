//! The firmware's use of a chip, from its disassembly: sizes, the deepest stack, and that it cannot panic.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

/// The stack that the processor uses at an interrupt: 8 registers, 16 and the status of the FPU, and their alignment.
const EXCEPTION: u32 = 26 * 4 + 4;

/// The sample's, and above it the timer's.
const INTERRUPTS: [&str; 2] = ["PendSV", "SysTick"];

/// Sizes and stack of a program, as a row of the table.
pub fn row(name: &str, program: &Path, flash: u32, memory: u32) -> Result<String> {
    let printed = output("arm-none-eabi-size", &[], program)?;
    let numbers = printed.lines().nth(1).context("no sizes")?.split_whitespace();
    let numbers: Vec<u32> = numbers.take(3).map(str::parse).collect::<Result<_, _>>()?;
    let [text, data, bss] = numbers[..] else { bail!("no sizes: {printed}") };
    let code = Code::read(program)?;
    let main = code.stack("main")?;
    let mut interrupt = 0;
    for name in INTERRUPTS {
        interrupt += code.stack(name)? + EXCEPTION;
    }
    let (used, all) = (text + data, data + copied(program)? + bss + main + interrupt);
    ensure!(used <= flash * 1024, "{name}: {used} bytes of {flash} KiB flash");
    ensure!(all <= memory * 1024, "{name}: {all} bytes of {memory} KiB memory");
    let mut row = String::new();
    let kib = |bytes: u32| f64::from(bytes) / 1024.0;
    write!(
        row,
        "| {name} | {text} | {data} | {bss} | {main} | {interrupt} | {:.1} of {flash} KiB | {:.1} of {memory} KiB |",
        kib(used),
        kib(all)
    )?;
    Ok(row)
}

/// Bytes of code and constants that run in RAM: see `code-in-ram.x`.
fn copied(program: &Path) -> Result<u32> {
    let sections = output("arm-none-eabi-size", &["-A"], program)?;
    let fast = sections.lines().filter(|line| line.starts_with(".fast"));
    fast.map(|line| Ok(line.split_whitespace().nth(1).context("no size")?.parse::<u32>()?)).sum()
}

/// No panic routine is in the program, nor the handler that all of them end in. `control` can panic, by the same compiler: there they must
/// be found.
pub fn cannot_panic(program: &Path, control: &Path) -> Result<()> {
    ensure!(!Code::read(control)?.panics().is_empty(), "the control shows no panic: the look is blind");
    let code = Code::read(program)?;
    ensure!(code.functions.len() > 50, "{}: hardly a function: the look is blind", program.display());
    let panics = code.panics();
    ensure!(panics.is_empty(), "{} can panic: {panics:?}", program.display());
    Ok(())
}

/// The same for the functions that an interrupt calls, in a program whose main loop may panic.
pub fn interrupts_cannot_panic(program: &Path, control: &Path) -> Result<()> {
    ensure!(Code::read(control)?.reaches_a_panic("main")?, "the control shows no panic: the look is blind");
    let code = Code::read(program)?;
    for name in INTERRUPTS {
        ensure!(!code.reaches_a_panic(name)?, "{}: {name} can panic", program.display());
    }
    Ok(())
}

struct Function {
    name: String,
    stack: u32,
    calls: Vec<u32>,
    /// It calls through a register.
    blind: bool,
}

impl Function {
    fn is_panic(&self) -> bool {
        self.name.contains("panicking") || self.name.contains("begin_unwind")
    }
}

/// A program's functions by their addresses.
struct Code {
    functions: BTreeMap<u32, Function>,
}

impl Code {
    fn read(program: &Path) -> Result<Code> {
        let text = output("arm-none-eabi-objdump", &["-d", "--no-show-raw-insn"], program)?;
        let mut functions = BTreeMap::new();
        let mut at = None;
        for line in text.lines() {
            if let Some((address, name)) = line.strip_suffix(">:").and_then(|head| head.split_once(" <")) {
                let address = u32::from_str_radix(address, 16)?;
                functions
                    .insert(address, Function { name: name.to_string(), stack: 0, calls: Vec::new(), blind: false });
                at = Some(address);
            } else if let (Some((_, instruction)), Some(at)) = (line.split_once(":\t"), at) {
                let function = functions.get_mut(&at).context("a function")?;
                let (name, rest) = instruction.split_once('\t').unwrap_or((instruction, ""));
                function.stack += pushed(name, rest).with_context(|| format!("{}: {instruction}", function.name))?;
                let target = rest.split_whitespace().next().and_then(|target| u32::from_str_radix(target, 16).ok());
                match target {
                    Some(target) if name.starts_with('b') => function.calls.push(target),
                    _ => function.blind |= name.starts_with("blx") || (name == "bx" && rest.trim() != "lr"),
                }
            }
        }
        // A target that is not the beginning of a function is a jump within one.
        let all: Vec<u32> = functions.keys().copied().collect();
        for (own, function) in &mut functions {
            function.calls.retain(|call| call != own && all.binary_search(call).is_ok());
            function.calls.sort_unstable();
            function.calls.dedup();
        }
        Ok(Code { functions })
    }

    /// The panic routines, each with its callers.
    fn panics(&self) -> Vec<(&str, Vec<&str>)> {
        let routines = self.functions.iter().filter(|(_, function)| function.is_panic());
        let calls = |at: &u32| {
            let callers = self.functions.values().filter(|caller| caller.calls.contains(at));
            callers.map(|caller| caller.name.as_str()).collect()
        };
        routines.map(|(at, routine)| (routine.name.as_str(), calls(at))).collect()
    }

    fn address(&self, name: &str) -> Result<u32> {
        let found = self.functions.iter().find(|(_, function)| function.name == name);
        Ok(*found.with_context(|| format!("no {name}"))?.0)
    }

    /// The most stack from the function of this name on.
    fn stack(&self, name: &str) -> Result<u32> {
        self.depth(self.address(name)?, &mut Vec::new(), &mut BTreeMap::new())
    }

    /// Whether the function of this name calls a panic routine, directly or through others.
    fn reaches_a_panic(&self, name: &str) -> Result<bool> {
        let (mut waiting, mut seen) = (vec![self.address(name)?], BTreeSet::new());
        while let Some(at) = waiting.pop() {
            let function = &self.functions[&at];
            ensure!(!function.blind, "{} calls what cannot be read from the program", function.name);
            if function.is_panic() {
                return Ok(true);
            }
            waiting.extend(function.calls.iter().filter(|call| seen.insert(**call)));
        }
        Ok(false)
    }

    fn depth(&self, at: u32, above: &mut Vec<u32>, known: &mut BTreeMap<u32, u32>) -> Result<u32> {
        if let Some(depth) = known.get(&at) {
            return Ok(*depth);
        }
        let function = &self.functions[&at];
        ensure!(!above.contains(&at), "{} calls itself", function.name);
        ensure!(!function.blind, "{} calls what cannot be read from the program", function.name);
        above.push(at);
        let mut deepest = 0;
        for call in &function.calls {
            deepest = deepest.max(self.depth(*call, above, known)?);
        }
        above.pop();
        known.insert(at, function.stack + deepest);
        Ok(function.stack + deepest)
    }
}

/// Bytes of stack that an instruction uses.
fn pushed(name: &str, rest: &str) -> Result<u32> {
    let is = |instruction: &str| name.split('.').next() == Some(instruction);
    let list =
        || rest.split_once('{').and_then(|(_, list)| list.split_once('}')).map(|(list, _)| list).context("no list");
    let number = || {
        let (_, number) = rest.rsplit_once('#').context("no number")?;
        let number = number.split(|c: char| !c.is_ascii_digit() && c != '-').next().context("no number")?;
        Ok::<i64, anyhow::Error>(number.parse()?)
    };
    if is("push") || (is("stmdb") && rest.starts_with("sp!")) {
        return Ok(4 * registers(list()?)?);
    }
    if is("vpush") {
        let list = list()?;
        return Ok(if list.starts_with('d') { 8 } else { 4 } * registers(list)?);
    }
    if (is("sub") || is("subw")) && rest.starts_with("sp") {
        return Ok(number()?.try_into()?);
    }
    if (is("str") || is("strd")) && rest.contains("[sp, #-") && rest.ends_with("]!") {
        return Ok((-number()?).try_into()?);
    }
    Ok(0)
}

/// The number of registers in a list such as "r4, r5, lr" or "d8-d15".
fn registers(list: &str) -> Result<u32> {
    let mut count = 0;
    for part in list.split(", ") {
        count += match part.split_once('-') {
            None => 1,
            Some((from, to)) => to[1..].parse::<u32>()? - from[1..].parse::<u32>()? + 1,
        };
    }
    Ok(count)
}

fn output(tool: &str, options: &[&str], program: &Path) -> Result<String> {
    let printed = Command::new(tool).args(options).arg(program).output()?;
    ensure!(printed.status.success(), "{tool}: {}", String::from_utf8_lossy(&printed.stderr));
    Ok(String::from_utf8(printed.stdout)?)
}
