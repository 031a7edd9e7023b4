//! The syntax tree of a flattened file, and its parser.
//!
//! A file is a list of calls `modifiers name(arguments) ;`, or `… { calls }`, or `… call` with one operand. Calls lie in one array in file order, so
//! a parent comes before its children, and the parser keeps its open braces on a stack of its own: depth costs no
//! machine stack and is limited by name. Brackets in values nest at most `VALUE_DEPTH` deep.

use super::lexer::{Lexer, Token};
use super::{Limits, Place, Problem};

/// Values of OpenSCAD's own files nest three deep (a list of polygons' paths); more than this is a mistake.
const VALUE_DEPTH: usize = 16;

/// Index of a call in `File::calls`.
pub type CallId = usize;

/// A parsed file.
#[derive(Debug, Default)]
pub struct File {
    /// All calls, parents before children, in file order.
    pub calls: Vec<Call>,
    /// The calls outside all braces.
    pub top: Vec<CallId>,
}

/// One call with what is inside its braces.
#[derive(Debug)]
pub struct Call {
    /// Its name, as written.
    pub name: String,
    /// Where the name stands.
    pub at: Place,
    /// `%`: shown, not part of the model.
    pub background: bool,
    /// `*`: not there at all.
    pub disabled: bool,
    /// `!`: the model is this call alone.
    pub root: bool,
    /// Arguments in order.
    pub arguments: Vec<Argument>,
    /// Calls between its braces.
    pub children: Vec<CallId>,
}

/// An argument, with or without a name.
#[derive(Debug)]
pub struct Argument {
    /// The name before `=`.
    pub name: Option<String>,
    /// Where the argument begins.
    pub at: Place,
    /// Its value.
    pub value: Value,
}

/// A value and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// Where it begins.
    pub at: Place,
    /// What it is.
    pub kind: ValueKind,
}

/// The values that flattened files hold.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueKind {
    /// A number, possibly infinite or not a number.
    Number(f64),
    /// `true` or `false`.
    Bool(bool),
    /// A string.
    Text(String),
    /// `undef`.
    Undef,
    /// `[a, b, …]`.
    List(Vec<Value>),
}

impl Call {
    /// Its name, short enough for a sentence.
    pub fn short(&self) -> String {
        self.name.chars().take(40).collect()
    }
}

impl Value {
    /// How an error calls it.
    pub fn found(&self) -> String {
        match &self.kind {
            ValueKind::Number(n) => format!("{n}").to_lowercase(),
            ValueKind::Bool(b) => format!("{b}"),
            ValueKind::Text(t) => Token::Text(t.clone()).found(),
            ValueKind::Undef => "undef".into(),
            ValueKind::List(l) => format!("a list of {}", l.len()),
        }
    }
}

/// Parses a whole file.
pub fn parse(text: &str, limits: &Limits) -> Result<File, (Place, Problem)> {
    if text.len() > limits.bytes {
        return Err((Place::START, Problem::Limit { what: "bytes of text", limit: limits.bytes }));
    }
    let mut parser = Parser { lexer: Lexer::new(text), seen: None, limits };
    let mut file = File::default();
    // Calls whose operands are being read, with their braces; without, where one operand follows.
    let mut open: Vec<(CallId, Option<Place>)> = Vec::new();
    loop {
        let (mut token, mut at) = parser.next()?;
        let (mut background, mut disabled, mut root, mut modified) = (false, false, false, false);
        while let Token::Mark(mark @ ('%' | '*' | '#' | '!')) = token {
            match mark {
                '%' => background = true,
                '*' => disabled = true,
                '!' => root = true,
                _ => {}
            }
            modified = true;
            (token, at) = parser.next()?;
        }
        let name = match token {
            Token::Word(name) if LANGUAGE.contains(&name) => {
                return Err((at, Problem::Unsupported { construct: name.to_owned(), hint: FLATTEN }));
            }
            Token::Word(name) => name.to_owned(),
            Token::Mark(';') if !modified => continue,
            Token::Mark('}') if !modified && !open.is_empty() => {
                open.pop();
                end_of_call(&mut open);
                continue;
            }
            Token::End if !modified => match open.last() {
                None => return Ok(file),
                Some((_, brace)) => {
                    let line = brace.map_or(at.line, |brace| brace.line);
                    return Err((at, Problem::syntax(format!("\"}}\" closing line {line}"), token.found())));
                }
            },
            other => return Err((at, Problem::syntax("a call such as union() or cube(…)", other.found()))),
        };
        if file.calls.len() >= limits.nodes {
            return Err((at, Problem::Limit { what: "nodes", limit: limits.nodes }));
        }
        let arguments = parser.arguments(&name)?;
        let id = file.calls.len();
        file.calls.push(Call { name, at, background, disabled, root, arguments, children: Vec::new() });
        match open.last() {
            Some((parent, _)) => file.calls[*parent].children.push(id),
            None => file.top.push(id),
        }
        let (next, after) = parser.next()?;
        let brace = match next {
            Token::Mark(';') => {
                end_of_call(&mut open);
                continue;
            }
            Token::Mark('{') => Some(after),
            Token::Word(_) | Token::Mark('%' | '*' | '#' | '!') => None,
            other => return Err((after, Problem::syntax("\";\", \"{\" or a call", other.found()))),
        };
        if open.len() >= limits.depth {
            return Err((after, Problem::Limit { what: "levels of nesting", limit: limits.depth }));
        }
        open.push((id, brace));
        if brace.is_none() {
            parser.seen = Some((next, after));
        }
    }
}

/// A call has ended: so have those whose one operand it is.
fn end_of_call(open: &mut Vec<(CallId, Option<Place>)>) {
    while open.pop_if(|(_, brace)| brace.is_none()).is_some() {}
}

/// Words that begin what only OpenSCAD itself can work out.
const LANGUAGE: [&str; 4] = ["module", "function", "use", "include"];

/// What to do about OpenSCAD's language.
pub const FLATTEN: &str =
    " (this is .scad: load the file by that ending, or flatten it first: openscad -o model.csg model.scad)";

struct Parser<'a> {
    lexer: Lexer<'a>,
    /// A token that was read to see what follows.
    seen: Option<(Token<'a>, Place)>,
    limits: &'a Limits,
}

impl<'a> Parser<'a> {
    fn next(&mut self) -> Result<(Token<'a>, Place), (Place, Problem)> {
        self.seen.take().map_or_else(|| self.lexer.next(), Ok)
    }

    /// `( name = value, … )`.
    fn arguments(&mut self, call: &str) -> Result<Vec<Argument>, (Place, Problem)> {
        match self.lexer.next()? {
            (Token::Mark('('), _) => {}
            (Token::Mark('='), at) => return Err((at, variable(call))),
            (other, at) => return Err((at, Problem::syntax("\"(\"", other.found()))),
        }
        let mut arguments = Vec::new();
        loop {
            let (token, at) = self.lexer.next()?;
            if token == Token::Mark(')') {
                return Ok(arguments);
            }
            let (name, value, next) = match token {
                Token::Word(word) if constant(word).is_none() => {
                    match self.lexer.next()? {
                        (Token::Mark('='), _) => {}
                        (Token::Mark(',' | ')' | '*' | '+' | '-'), _) => return Err((at, variable(word))),
                        (other, at) => return Err((at, Problem::syntax(format!("\"=\" after {word}"), other.found()))),
                    }
                    let before = self.lexer.clone();
                    let read = self.lexer.next().and_then(|first| self.value(first, 0));
                    let value = match self.unescaped(before, (call, word), read.is_ok()) {
                        Some(value) => value,
                        None => read?,
                    };
                    (Some(word.to_owned()), value, self.lexer.next()?)
                }
                token => (None, self.value((token, at), 0)?, self.lexer.next()?),
            };
            arguments.push(Argument { name, at, value });
            match next {
                (Token::Mark(','), _) => {}
                (Token::Mark(')'), _) => return Ok(arguments),
                (Token::Mark('*' | '+' | '-'), at) => return Err((at, expression())),
                (other, at) => return Err((at, Problem::syntax("\",\" or \")\"", other.found()))),
            }
        }
    }

    /// The text of a `text` that can be read in no other way: OpenSCAD writes it without escapes, and its size behind it. `before` it
    /// the lexer stood; whether it could be `read` with escapes, and then as the call goes on behind it.
    fn unescaped(&mut self, mut before: Lexer<'a>, what: (&str, &str), read: bool) -> Option<Value> {
        if what != ("text", "text") || read && goes_on(self.lexer.clone()) {
            return None;
        }
        let (Token::Text(text), at) = before.unescaped("\", size = ")? else { return None };
        self.lexer = before;
        Some(Value { at, kind: ValueKind::Text(text) })
    }

    /// The value that begins with `first`.
    fn value(&mut self, first: (Token<'_>, Place), depth: usize) -> Result<Value, (Place, Problem)> {
        let (token, at) = first;
        let kind = match token {
            Token::Number(n) => ValueKind::Number(n),
            Token::Text(t) => ValueKind::Text(t),
            Token::Word(w) => match constant(w) {
                Some(kind) => kind,
                None => return Err((at, variable(w))),
            },
            Token::Mark(sign @ ('-' | '+')) => {
                let flip = if sign == '-' { -1.0 } else { 1.0 };
                match self.lexer.next()? {
                    (Token::Number(n), _) => ValueKind::Number(flip * n),
                    (Token::Word("inf"), _) => ValueKind::Number(flip * f64::INFINITY),
                    (Token::Word("nan"), _) => ValueKind::Number(f64::NAN),
                    (other, at) => return Err((at, Problem::syntax("a number", other.found()))),
                }
            }
            Token::Mark('[') => {
                if depth >= VALUE_DEPTH {
                    return Err((at, Problem::Limit { what: "nested brackets", limit: VALUE_DEPTH }));
                }
                let mut items = Vec::new();
                loop {
                    let next = self.lexer.next()?;
                    if next.0 == Token::Mark(']') {
                        break;
                    }
                    items.push(self.value(next, depth + 1)?);
                    if items.len() > self.limits.values {
                        return Err((at, Problem::Limit { what: "values in a list", limit: self.limits.values }));
                    }
                    match self.lexer.next()? {
                        (Token::Mark(','), _) => {}
                        (Token::Mark(']'), _) => break,
                        (other, at) => return Err((at, Problem::syntax("\",\" or \"]\"", other.found()))),
                    }
                }
                ValueKind::List(items)
            }
            other => return Err((at, Problem::syntax("a value", other.found()))),
        };
        Ok(Value { at, kind })
    }
}

/// True where a call goes on behind a value: with another argument by name, or with its end.
fn goes_on(mut lexer: Lexer<'_>) -> bool {
    let mut next = || lexer.next().map(|(token, _)| token);
    match next() {
        Ok(Token::Mark(',')) => matches!((next(), next()), (Ok(Token::Word(_)), Ok(Token::Mark('=')))),
        Ok(Token::Mark(')')) => matches!(next(), Ok(Token::Mark(';'))),
        _ => false,
    }
}

/// A variable, which flattened files do not have.
fn variable(word: &str) -> Problem {
    let short: String = word.chars().take(40).collect();
    Problem::Unsupported { construct: format!("the variable {short}"), hint: FLATTEN }
}

/// Something to be worked out.
fn expression() -> Problem {
    Problem::Unsupported { construct: "an expression".into(), hint: FLATTEN }
}

/// The words that are values.
fn constant(word: &str) -> Option<ValueKind> {
    Some(match word {
        "true" => ValueKind::Bool(true),
        "false" => ValueKind::Bool(false),
        "undef" => ValueKind::Undef,
        "inf" => ValueKind::Number(f64::INFINITY),
        "nan" => ValueKind::Number(f64::NAN),
        _ => return None,
    })
}
