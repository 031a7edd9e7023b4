//! Lines and columns: what is too long is cut in its middle, lists are broken where a line is full.

use super::paint::{Paint, Role};

/// Columns of a line.
pub const WIDTH: usize = 80;

/// What stands in place of what was cut out.
const ELLIPSIS: char = '…';

/// A part of a line, with its role where it has one.
pub type Piece = (Option<Role>, String);

/// Columns that a text takes.
pub fn width(text: &str) -> usize {
    text.chars().count()
}

/// `text` in at most `columns` (one at least): an ellipsis stands for its middle where it is longer.
pub fn cut(text: &str, columns: usize) -> String {
    let all = width(text);
    if all <= columns {
        return text.to_owned();
    }
    let left = columns.saturating_sub(1);
    let (head, tail) = (left - left / 2, left / 2);
    let end = text.chars().skip(all - tail);
    text.chars().take(head).chain([ELLIPSIS]).chain(end).collect()
}

/// A name as it can stand in a line: characters that would break the line, colour it or turn its direction are replaced.
pub fn clean(name: &str) -> String {
    let is_harmful = |c: char| {
        c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    name.chars().map(|c| if is_harmful(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// The pieces behind `first`, with `separator` between two of them, in lines that end with a line break; where one is full the
/// next one begins, as far in as `first` is wide. A piece that fits into no line is cut.
pub fn fold(first: &str, separator: &str, pieces: &[Piece], paint: Paint) -> String {
    let indent = width(first);
    let room = WIDTH.saturating_sub(indent + width(separator.trim_end())).max(1);
    let (mut out, mut used) = (String::from(first), indent);
    for (k, (role, text)) in pieces.iter().enumerate() {
        let text = cut(text, room);
        let is_last = k + 1 == pieces.len();
        let needed = width(&text) + if is_last { 0 } else { width(separator.trim_end()) };
        if k > 0 {
            if used + width(separator) + needed > WIDTH {
                out.push_str(separator.trim_end());
                out.push('\n');
                out.push_str(&" ".repeat(indent));
                used = indent;
            } else {
                out.push_str(separator);
                used += width(separator);
            }
        }
        used += width(&text);
        match role {
            Some(role) => out.push_str(&paint.mark(*role, &text)),
            None => out.push_str(&text),
        }
    }
    out.push('\n');
    out
}

/// Words behind `first`, in lines that end with a line break and are broken between words; those behind the first line stand two
/// columns farther in than it. A word that fits into no line stays whole: it may be a path.
pub fn sentence(first: &str, text: &str) -> String {
    let indent = " ".repeat(width(first) - width(first.trim_start()) + 2);
    let (mut out, mut used) = (String::from(first), width(first));
    for (k, word) in text.split(' ').enumerate() {
        if k > 0 && used + 1 + width(word) > WIDTH {
            out = out.trim_end().to_owned() + "\n" + &indent;
            used = width(&indent);
        } else if k > 0 {
            out.push(' ');
            used += 1;
        }
        out.push_str(word);
        used += width(word);
    }
    out.push('\n');
    out
}

/// Columns as wide as their widest entry.
pub fn aligned<const N: usize>(rows: &[[String; N]]) -> String {
    let widest = |k: usize| rows.iter().map(|r| width(&r[k])).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(widest);
    let mut out = String::new();
    for row in rows {
        let cells = row.iter().zip(widths).map(|(c, w)| format!("{c:<w$}"));
        out.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_middle_is_cut_out_by_characters() {
        assert_eq!(cut("flange", 6), "flange");
        assert_eq!(cut("left flange", 6), "lef…ge");
        assert_eq!(cut("größer als größer", 7), "grö…ßer");
        assert_eq!(cut("ab", 1), "…");
        assert_eq!(clean("a\nb\u{1b}[31m\u{202e}c"), "a\u{fffd}b\u{fffd}[31m\u{fffd}c");
    }

    #[test]
    fn a_full_line_is_broken_and_the_next_one_indented() {
        let pieces: Vec<Piece> = (0..4).map(|_| (None, "x".repeat(30))).collect();
        let text = fold("    ", ", ", &pieces, Paint::default());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert!(lines[0].ends_with("x,") && lines[1].starts_with("    x") && lines[1].ends_with('x'), "{text}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_line_is_too_long_and_no_piece_that_fits_is_lost(
            words in proptest::collection::vec("[a-zé世]{1,100}", 0..12),
            indent in 0..20usize,
        ) {
            let pieces: Vec<Piece> = words.iter().map(|w| (None, w.clone())).collect();
            let text = fold(&" ".repeat(indent), ", ", &pieces, Paint::default());
            for line in text.lines() {
                prop_assert!(width(line) <= WIDTH, "{line}");
            }
            for word in words.iter().filter(|w| width(w) < WIDTH - indent) {
                prop_assert!(text.contains(word.as_str()), "{word}");
            }
        }

        #[test]
        fn what_is_cut_has_the_columns_that_it_may_have(text in "\\PC{0,200}", columns in 1..90usize) {
            let short = cut(&text, columns);
            prop_assert_eq!(width(&short), width(&text).min(columns));
        }
    }
}
