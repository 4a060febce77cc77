//! The TOML parser's errors, with corrections.

use std::ops::Range;

use crate::keys;

/// The message for the parser's `found` at `span` of `text`.
pub(crate) fn message(found: &str, text: &str, span: Option<&Range<usize>>) -> String {
    let at = span.and_then(|span| text.get(span.start..)).and_then(|rest| rest.chars().next());
    let right = match (found, at) {
        (found, _) if found.starts_with("carriage return") => "a line ends in LF or CRLF".to_string(),
        (_, Some(c)) if c.is_control() && !matches!(c, '\t' | '\n' | '\r') => {
            return format!("not TOML: the control character U+{:04X} stands here", u32::from(c));
        }
        ("duplicate key", _) => "a key or a table is given once".to_string(),
        ("recursion limit" | "cannot recurse further; max recursion depth met", _) => {
            return format!(
                "not TOML that a world needs: nested too deep; no key has more than {} names",
                keys::deepest()
            );
        }
        (found, _) if found.starts_with("string values must be quoted") => {
            return "not TOML: text and quantities stand in straight quotes, such as \"1 ms\"".to_string();
        }
        (found, Some(',')) if found.starts_with("unexpected key or value") => {
            "a decimal point is a point, and a line has one KEY = VALUE".to_string()
        }
        (found, _)
            if ["unexpected key or value", "key with no value", "invalid key-value pair"]
                .iter()
                .any(|start| found.starts_with(start)) =>
        {
            "a line is KEY = VALUE, such as period = \"1 ms\", or a [TABLE]".to_string()
        }
        _ => return format!("not TOML: {found}"),
    };
    format!("not TOML: {found}; {right}")
}

#[cfg(test)]
mod tests {
    use crate::{Source, World};

    /// The first line of the message about a file.
    fn message(text: &str) -> String {
        let error = World::read(&Source::from_text("w.toml", text), &[]).unwrap_err();
        error.message
    }

    #[test]
    fn what_is_not_toml_is_met_with_what_would_be() {
        assert_eq!(
            message("loop:\n"),
            "not TOML: key with no value, expected `=`; a line is KEY = VALUE, such as period = \"1 ms\", or a [TABLE]"
        );
        assert!(message("{\"loop\": 1}").ends_with("; a line is KEY = VALUE, such as period = \"1 ms\", or a [TABLE]"));
        assert!(message("a = 1,5").ends_with("; a decimal point is a point, and a line has one KEY = VALUE"));
        assert!(message("a = 1\rb = 1").ends_with("; a line ends in LF or CRLF"));
        assert_eq!(message("a = \"\0\""), "not TOML: the control character U+0000 stands here");
        assert_eq!(message("a = 1 ms"), "not TOML: text and quantities stand in straight quotes, such as \"1 ms\"");
        for deep in ["[".repeat(1000), "{a=".repeat(1000), format!("1\n{}b = 1", "b.".repeat(1000))] {
            assert_eq!(
                message(&format!("a = {deep}")),
                "not TOML that a world needs: nested too deep; no key has more than 5 names"
            );
        }
    }
}
