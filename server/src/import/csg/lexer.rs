//! Tokens of OpenSCAD's flattened files, with their places.
//!
//! Words, numbers (sign apart, `inf` and `nan` are words), quoted strings, punctuation; `//` and `/* */` comments are
//! skipped. Columns count characters, a tab is one. The lexer never looks further than it must: an error names the
//! first character that cannot be read.

use super::{Place, Problem};

/// One token.
#[derive(Clone, Debug, PartialEq)]
pub enum Token<'a> {
    /// A name, `$fn`, or a word such as `true`, `undef`, `inf`.
    Word(&'a str),
    /// A number without its sign.
    Number(f64),
    /// A quoted string, escapes resolved.
    Text(String),
    /// Any other character that the grammar knows.
    Mark(char),
    /// The end of the file.
    End,
}

impl Token<'_> {
    /// How an error calls it.
    pub fn found(&self) -> String {
        match self {
            Token::Word(w) => format!("\"{}\"", shortened(w)),
            Token::Number(n) => format!("the number {n}"),
            Token::Text(t) => format!("the string \"{}\"", shortened(t)),
            Token::Mark(c) => format!("\"{c}\""),
            Token::End => "the end of the file".into(),
        }
    }
}

/// The first 40 characters, so that an error stays one line.
fn shortened(text: &str) -> String {
    text.chars().take(40).flat_map(char::escape_debug).collect()
}

/// Reads tokens one by one.
#[derive(Clone)]
pub struct Lexer<'a> {
    rest: &'a str,
    at: Place,
}

impl<'a> Lexer<'a> {
    /// Starts at the first character of `text`; a byte order mark is skipped.
    pub fn new(text: &'a str) -> Self {
        Self { rest: text.strip_prefix('\u{feff}').unwrap_or(text), at: Place { line: 1, column: 1 } }
    }

    /// The next token and where it begins.
    pub fn next(&mut self) -> Result<(Token<'a>, Place), (Place, Problem)> {
        self.skip_blanks()?;
        let at = self.at;
        let Some(c) = self.rest.chars().next() else { return Ok((Token::End, at)) };
        let token = match c {
            'A'..='Z' | 'a'..='z' | '_' | '$' => {
                let end = self.rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '$'));
                Token::Word(self.take(end.unwrap_or(self.rest.len())))
            }
            '0'..='9' | '.' => self.number(at)?,
            '"' => self.text(at)?,
            '(' | ')' | '[' | ']' | '{' | '}' | ',' | ';' | '=' | '-' | '+' | '%' | '*' | '#' | '!' => {
                self.take(1);
                Token::Mark(c)
            }
            other => return Err((at, Problem::syntax("a statement of the flattened CSG language", quoted(other)))),
        };
        Ok((token, at))
    }

    fn number(&mut self, at: Place) -> Result<Token<'a>, (Place, Problem)> {
        let bytes = self.rest.as_bytes();
        let digits = |mut i: usize| {
            while bytes.get(i).is_some_and(u8::is_ascii_digit) {
                i += 1;
            }
            i
        };
        let mut end = digits(0);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let after = digits(end + 1 + sign);
            if after > end + 1 + sign {
                end = after;
            }
        }
        let written = self.take(end);
        match written.parse::<f64>() {
            Ok(n) if n.is_finite() => Ok(Token::Number(n)),
            _ => Err((at, Problem::syntax("a number that a double can hold", format!("\"{}\"", shortened(written))))),
        }
    }

    fn text(&mut self, at: Place) -> Result<Token<'a>, (Place, Problem)> {
        let mut text = String::new();
        let mut escaped = false;
        for (i, c) in self.rest.char_indices().skip(1) {
            match c {
                _ if escaped => {
                    let known = match c {
                        'n' => Some('\n'),
                        't' => Some('\t'),
                        'r' => Some('\r'),
                        '"' | '\\' => Some(c),
                        _ => None,
                    };
                    // OpenSCAD writes texts and names as they are: what is no escape has its backslash.
                    if known.is_none() {
                        text.push('\\');
                    }
                    text.push(known.unwrap_or(c));
                    escaped = false;
                }
                '\\' => escaped = true,
                '"' => {
                    self.take(i + 1);
                    return Ok(Token::Text(text));
                }
                other => text.push(other),
            }
        }
        Err((at, Problem::syntax("a closing quote", "the end of the file")))
    }

    /// A string that OpenSCAD wrote as it is, quotes and backslashes in it included: up to the first `end` behind it, which begins with
    /// its closing quote. `None` where none begins here or `end` does not follow.
    pub fn unescaped(&mut self, end: &str) -> Option<(Token<'a>, Place)> {
        self.skip_blanks().ok()?;
        let at = self.at;
        let length = self.rest.strip_prefix('"')?.find(end)?;
        let quoted = self.take(length + 2);
        Some((Token::Text(quoted[1..=length].to_owned()), at))
    }

    fn skip_blanks(&mut self) -> Result<(), (Place, Problem)> {
        loop {
            let blank = self.rest.find(|c: char| !c.is_whitespace()).unwrap_or(self.rest.len());
            self.take(blank);
            if self.rest.starts_with("//") {
                self.take(self.rest.find('\n').unwrap_or(self.rest.len()));
            } else if self.rest.starts_with("/*") {
                let at = self.at;
                let Some(end) = self.rest[2..].find("*/") else {
                    return Err((at, Problem::syntax("\"*/\" closing this comment", "the end of the file")));
                };
                self.take(end + 4);
            } else {
                return Ok(());
            }
        }
    }

    /// Consumes `bytes` bytes, which end on a character boundary.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        for c in taken.chars() {
            if c == '\n' {
                self.at = Place { line: self.at.line.saturating_add(1), column: 1 };
            } else {
                self.at.column = self.at.column.saturating_add(1);
            }
        }
        self.rest = rest;
        taken
    }
}

fn quoted(c: char) -> String {
    format!("\"{}\"", c.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(Token<'_>, u32, u32)> {
        let mut lexer = Lexer::new(text);
        let mut tokens = Vec::new();
        loop {
            let (token, at) = lexer.next().expect("readable");
            if token == Token::End {
                return tokens;
            }
            tokens.push((token, at.line, at.column));
        }
    }

    #[test]
    fn tokens_carry_their_places() {
        let tokens = all("/* a\n b */ cube( // c\n\t-1.5e-05, .5, \"a\\\"b\")");
        let expected = [
            (Token::Word("cube"), 2, 7),
            (Token::Mark('('), 2, 11),
            (Token::Mark('-'), 3, 2),
            (Token::Number(1.5e-5), 3, 3),
            (Token::Mark(','), 3, 10),
            (Token::Number(0.5), 3, 12),
            (Token::Mark(','), 3, 14),
            (Token::Text("a\"b".into()), 3, 16),
            (Token::Mark(')'), 3, 22),
        ];
        assert_eq!(tokens, expected);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (text, sentence) in [
            ("1e999", "expected a number that a double can hold, found \"1e999\""),
            ("\"abc", "expected a closing quote, found the end of the file"),
            ("/* abc", "expected \"*/\" closing this comment, found the end of the file"),
            ("@", "expected a statement of the flattened CSG language, found \"@\""),
            (".", "expected a number that a double can hold, found \".\""),
        ] {
            let (_, problem) = Lexer::new(text).next().expect_err(text);
            assert_eq!(problem.to_string(), sentence);
        }
    }
}
