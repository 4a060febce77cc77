//! Names and texts that are valid in C.

use crate::Error;

/// The beginning of all names of a file, such as `wheel` of `wheel_step`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prefix(String);

/// Words that begin names of C, C++ and their libraries, or are words of C.
const TAKEN: [&str; 98] = [
    "alignas",
    "alignof",
    "and",
    "asm",
    "atomic",
    "auto",
    "bit",
    "bool",
    "break",
    "case",
    "catch",
    "cc",
    "char",
    "class",
    "clock",
    "cnd",
    "compl",
    "complex",
    "const",
    "continue",
    "dbl",
    "decltype",
    "default",
    "delete",
    "do",
    "double",
    "else",
    "enum",
    "errno",
    "except",
    "explicit",
    "export",
    "extern",
    "false",
    "fe",
    "flt",
    "float",
    "for",
    "fp",
    "friend",
    "goto",
    "if",
    "imaginary",
    "inline",
    "int",
    "int8",
    "int16",
    "int32",
    "int64",
    "intmax",
    "intptr",
    "is",
    "lc",
    "ldbl",
    "long",
    "m",
    "math",
    "mb",
    "mem",
    "memory",
    "mtx",
    "mutable",
    "namespace",
    "new",
    "noreturn",
    "not",
    "operator",
    "or",
    "posix",
    "pri",
    "private",
    "protected",
    "pthread",
    "public",
    "register",
    "restrict",
    "return",
    "seek",
    "short",
    "sig",
    "signed",
    "size",
    "sizeof",
    "static",
    "stdc",
    "str",
    "struct",
    "switch",
    "template",
    "this",
    "thrd",
    "to",
    "tss",
    "typedef",
    "uint",
    "union",
    "unsigned",
    "void",
];

/// C99 distinguishes names by their first 31 characters: enough for the longest name after a prefix.
const MAX_NAME_CHARS: usize = 24;

impl Prefix {
    /// A prefix; it is converted to lower case, and hyphens and dots become underscores.
    ///
    /// # Errors
    /// [`Error::Prefix`] where it is none in C.
    pub fn new(given: &str) -> Result<Self, Error> {
        let refuse = |wanted| Err(Error::Prefix { given: given.to_owned(), wanted });
        let name: String =
            given.chars().map(|c| if matches!(c, '-' | '.' | ' ') { '_' } else { c.to_ascii_lowercase() }).collect();
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_') {
            return refuse("it takes letters from a to z, digits and underscores; name the file so");
        }
        if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
            return refuse("it begins with a letter");
        }
        if name.contains("__") || name.ends_with('_') {
            return refuse("C++ keeps names with two underscores in a row; name the file without them");
        }
        if name.len() > MAX_NAME_CHARS {
            return refuse("it has 24 characters at most");
        }
        if TAKEN.contains(&name.as_str()) {
            return refuse("C, C++ or their libraries use it; name the file otherwise, such as knob.c");
        }
        Ok(Prefix(name))
    }

    /// A text with its names, which begin with `hapt_`, named so.
    pub(crate) fn rename(&self, text: &str) -> String {
        text.replace("HAPT_", &format!("{}_", self.0.to_uppercase())).replace("hapt_", &format!("{}_", self.0))
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A text within a comment: on one line, and without what ends a comment or a line of C.
pub(crate) fn comment(text: &str) -> String {
    let plain = |c: char| match c {
        // Characters that turn the direction of text would show other code than the real one.
        '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{2028}' | '\u{2029}' => ' ',
        c if c.is_control() => ' ',
        '\\' => '/',
        c => c,
    };
    let text: String = text.chars().map(plain).collect();
    text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("//", "/ /")
}
