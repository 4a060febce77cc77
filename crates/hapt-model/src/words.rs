//! The small words of error messages: quoting, lists, the nearest name.

/// `text` in double quotes, control characters escaped, cut after 60 characters.
pub(crate) fn quoted(text: &str) -> String {
    match text.char_indices().nth(60) {
        None => format!("{text:?}"),
        Some((end, _)) => format!("\"{}…\"", text[..end].escape_debug()),
    }
}

/// `"a", "b" or "c"`
pub(crate) fn alternatives<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    list(names, "or")
}

/// `"a", "b" and "c"`
pub(crate) fn all_of<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    list(names, "and")
}

fn list<'a>(names: impl IntoIterator<Item = &'a str>, conjunction: &str) -> String {
    let names: Vec<String> = names.into_iter().map(quoted).collect();
    match names.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} {conjunction} {last}", others.join(", ")),
    }
}

/// The candidate that takes the fewest edits to reach; between equals the one with the same first letter, then the same
/// case. `None` without candidates.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A word of a megabyte is no typing error, and the distance is quadratic.
    let word: String = word.chars().take(64).collect();
    let lower = word.to_ascii_lowercase();
    candidates.into_iter().min_by_key(|candidate| {
        let (edits, exact) =
            (strsim::osa_distance(&lower, &candidate.to_ascii_lowercase()), strsim::osa_distance(&word, candidate));
        (edits, candidate.chars().next() != word.chars().next(), exact)
    })
}

/// `; did you mean "period"?` when a candidate is near enough to have been meant, else nothing.
pub fn did_you_mean<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    let length = word.chars().take(64).count();
    let edits = |name: &str| strsim::osa_distance(&word.to_ascii_lowercase(), &name.to_ascii_lowercase());
    match nearest(word, candidates) {
        Some(name) if length < 64 && edits(name) <= (length / 3).clamp(1, 4) => {
            format!("; did you mean {}?", quoted(name))
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swapped_pair_of_letters_is_one_edit() {
        assert_eq!(did_you_mean("preiod", ["method", "period"]), "; did you mean \"period\"?");
    }

    #[test]
    fn a_word_that_resembles_nothing_gets_no_suggestion() {
        assert_eq!(did_you_mean("colour", ["period", "method"]), "");
    }

    #[test]
    fn long_texts_are_cut_and_control_characters_escaped() {
        assert_eq!(quoted("a\u{7}\"b"), "\"a\\u{7}\\\"b\"");
        assert_eq!(quoted(&"µ".repeat(100)).chars().count(), 63);
    }

    #[test]
    fn alternatives_read_as_a_sentence() {
        assert_eq!(alternatives(["a"]), "\"a\"");
        assert_eq!(alternatives(["a", "b", "c"]), "\"a\", \"b\" or \"c\"");
        assert_eq!(all_of(["a", "b"]), "\"a\" and \"b\"");
    }
}
