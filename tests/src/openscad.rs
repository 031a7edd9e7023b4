//! A flattener for a small part of the OpenSCAD language: turns a `.scad` into the tree that `openscad -o model.csg`
//! writes, so that the project's own models can be kept as one source and checked without OpenSCAD.
//!
//! Source: the language as OpenSCAD's user manual describes it, and the dumps in `tests/openscad/`, which OpenSCAD itself
//! wrote and this flattener reproduces byte for byte. Supported: assignments (hoisted within their scope), modules with
//! defaults, `for`, `if`, the three set operations, translate, rotate, the solids, linear_extrude of square, circle and
//! polygon, numbers, vectors, ranges, the usual operators and functions. Anything else is an error with its line.
//! Not promised: user functions, strings, children(), files.

use std::collections::HashMap;
use std::fmt::Write;

/// A value of the language.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Undef,
    Bool(bool),
    Number(f64),
    Vector(Vec<Value>),
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Word(String),
    Symbol(&'static str),
}

/// Two characters first, so that `<=` is not read as `<`.
const SYMBOLS: [&str; 27] = [
    "<=", ">=", "==", "!=", "&&", "||", "(", ")", "[", "]", "{", "}", ",", ";", ":", "?", "=", "<", ">", "+", "-", "*",
    "/", "%", "!", "#", ".",
];

#[derive(Clone, Debug)]
enum Expr {
    Value(Value),
    Name(String),
    Vector(Vec<Expr>),
    Range(Vec<Expr>),
    Call(String, Vec<Argument>),
    Index(Box<Expr>, Box<Expr>),
    Binary(&'static str, Box<Expr>, Box<Expr>),
    Not(Box<Expr>),
    Choice(Box<[Expr; 3]>),
}

type Argument = (Option<String>, Expr);

#[derive(Clone, Debug)]
enum Statement {
    Assign(String, Expr),
    Module(String, Vec<(String, Option<Expr>)>, Vec<Statement>),
    If(Expr, Vec<Statement>, Vec<Statement>),
    Call { name: String, arguments: Vec<Argument>, body: Vec<Statement>, line: usize },
}

/// Flattens `source`; `overrides` are what `-D name=value` sets. The text is what OpenSCAD writes with `-o x.csg`.
pub fn flatten(source: &str, overrides: &[(&str, f64)]) -> Result<String, String> {
    let mut parser = Parser { tokens: tokens(source)?, at: 0 };
    let mut program = Vec::new();
    while parser.at < parser.tokens.len() {
        parser.statement(&mut program)?;
    }
    for (name, value) in overrides {
        program.push(Statement::Assign(name.to_string(), Expr::Value(Value::Number(*value))));
    }
    let mut scope = Scope::default();
    for (name, value) in [("$fn", 0.0), ("$fa", 12.0), ("$fs", 2.0)] {
        scope.values.insert(name.into(), Value::Number(value));
    }
    let mut out = String::new();
    scope.run(&program, &mut out, 0)?;
    Ok(out)
}

fn tokens(source: &str) -> Result<Vec<(Token, usize)>, String> {
    let mut found = Vec::new();
    for (number, line) in source.lines().enumerate() {
        let mut rest = line.split("//").next().unwrap_or("").trim_start();
        while let Some(first) = rest.chars().next() {
            let length = |ok: fn(char) -> bool| rest.find(|c| !ok(c)).unwrap_or(rest.len());
            let (token, used) = if first.is_ascii_digit() {
                let n = length(|c| c.is_ascii_digit() || c == '.' || c == 'e');
                (
                    Token::Number(
                        rest[..n].parse().map_err(|_| format!("line {}: bad number {}", number + 1, &rest[..n]))?,
                    ),
                    n,
                )
            } else if first.is_alphabetic() || first == '_' || first == '$' {
                let n = length(|c| c.is_alphanumeric() || c == '_' || c == '$');
                (Token::Word(rest[..n].into()), n)
            } else {
                let symbol = SYMBOLS.iter().find(|s| rest.starts_with(**s));
                let symbol = symbol.ok_or_else(|| format!("line {}: unexpected {first:?}", number + 1))?;
                (Token::Symbol(symbol), symbol.len())
            };
            found.push((token, number + 1));
            rest = rest[used..].trim_start();
        }
    }
    Ok(found)
}

struct Parser {
    tokens: Vec<(Token, usize)>,
    at: usize,
}

impl Parser {
    fn line(&self) -> usize {
        self.tokens.get(self.at.min(self.tokens.len().saturating_sub(1))).map_or(0, |t| t.1)
    }

    fn peek(&self, symbol: &str) -> bool {
        matches!(self.tokens.get(self.at), Some((Token::Symbol(s), _)) if *s == symbol)
    }

    fn take(&mut self, symbol: &str) -> bool {
        let found = self.peek(symbol);
        self.at += found as usize;
        found
    }

    fn expect(&mut self, symbol: &str) -> Result<(), String> {
        if self.take(symbol) { Ok(()) } else { Err(format!("line {}: expected {symbol:?}", self.line())) }
    }

    fn word(&mut self) -> Result<String, String> {
        match self.tokens.get(self.at) {
            Some((Token::Word(w), _)) => {
                self.at += 1;
                Ok(w.clone())
            }
            _ => Err(format!("line {}: expected a name", self.line())),
        }
    }

    fn statement(&mut self, into: &mut Vec<Statement>) -> Result<(), String> {
        if self.take(";") {
            return Ok(());
        }
        if self.peek("{") {
            into.extend(self.block()?);
            return Ok(());
        }
        let line = self.line();
        let name = self.word()?;
        if name == "module" {
            let name = self.word()?;
            let mut parameters = Vec::new();
            self.expect("(")?;
            while !self.take(")") {
                let parameter = self.word()?;
                let default = if self.take("=") { Some(self.expression()?) } else { None };
                parameters.push((parameter, default));
                self.take(",");
            }
            let body = self.block()?;
            into.push(Statement::Module(name, parameters, body));
        } else if name == "if" {
            self.expect("(")?;
            let condition = self.expression()?;
            self.expect(")")?;
            let yes = self.block()?;
            let otherwise = matches!(self.tokens.get(self.at), Some((Token::Word(w), _)) if w == "else");
            self.at += otherwise as usize;
            let no = if otherwise { self.block()? } else { vec![] };
            into.push(Statement::If(condition, yes, no));
        } else if self.take("=") {
            let value = self.expression()?;
            self.expect(";")?;
            into.push(Statement::Assign(name, value));
        } else {
            let arguments = self.arguments()?;
            let body = if self.take(";") { vec![] } else { self.block()? };
            into.push(Statement::Call { name, arguments, body, line });
        }
        Ok(())
    }

    /// `{ … }`, or one statement.
    fn block(&mut self) -> Result<Vec<Statement>, String> {
        let mut body = Vec::new();
        if !self.take("{") {
            self.statement(&mut body)?;
            return Ok(body);
        }
        while !self.take("}") {
            self.statement(&mut body)?;
        }
        Ok(body)
    }

    fn arguments(&mut self) -> Result<Vec<Argument>, String> {
        let mut list = Vec::new();
        self.expect("(")?;
        while !self.take(")") {
            let named = matches!(
                (self.tokens.get(self.at), self.tokens.get(self.at + 1)),
                (Some((Token::Word(_), _)), Some((Token::Symbol("="), _)))
            );
            let name = if named { Some(self.word()?) } else { None };
            self.at += named as usize;
            list.push((name, self.expression()?));
            self.take(",");
        }
        Ok(list)
    }

    fn expression(&mut self) -> Result<Expr, String> {
        let condition = self.binary(0)?;
        if !self.take("?") {
            return Ok(condition);
        }
        let yes = self.expression()?;
        self.expect(":")?;
        Ok(Expr::Choice(Box::new([condition, yes, self.expression()?])))
    }

    fn binary(&mut self, level: usize) -> Result<Expr, String> {
        const LEVELS: [&[&str]; 5] =
            [&["||"], &["&&"], &["<=", ">=", "==", "!=", "<", ">"], &["+", "-"], &["*", "/", "%"]];
        if level == LEVELS.len() {
            return self.unary();
        }
        let mut left = self.binary(level + 1)?;
        while let Some(op) = LEVELS[level].iter().find(|s| self.peek(s)) {
            self.at += 1;
            left = Expr::Binary(op, Box::new(left), Box::new(self.binary(level + 1)?));
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Expr, String> {
        if self.take("-") {
            return Ok(Expr::Binary("-", Box::new(Expr::Value(Value::Number(0.0))), Box::new(self.unary()?)));
        }
        if self.take("!") {
            return Ok(Expr::Not(Box::new(self.unary()?)));
        }
        let mut value = self.atom()?;
        while self.take("[") {
            value = Expr::Index(Box::new(value), Box::new(self.expression()?));
            self.expect("]")?;
        }
        Ok(value)
    }

    fn atom(&mut self) -> Result<Expr, String> {
        if self.take("(") {
            let inner = self.expression()?;
            self.expect(")")?;
            return Ok(inner);
        }
        if self.take("[") {
            let mut items = Vec::new();
            let mut range = false;
            while !self.take("]") {
                items.push(self.expression()?);
                range |= self.take(":");
                self.take(",");
            }
            return Ok(if range { Expr::Range(items) } else { Expr::Vector(items) });
        }
        let line = self.line();
        let token = self.tokens.get(self.at).map(|t| t.0.clone());
        self.at += 1;
        Ok(match token {
            Some(Token::Number(n)) => Expr::Value(Value::Number(n)),
            Some(Token::Word(w)) => match w.as_str() {
                "true" | "false" => Expr::Value(Value::Bool(w == "true")),
                "undef" => Expr::Value(Value::Undef),
                _ if self.peek("(") => Expr::Call(w, self.arguments()?),
                _ => Expr::Name(w),
            },
            _ => return Err(format!("line {line}: expected a value")),
        })
    }
}

impl Value {
    fn number(&self) -> Result<f64, String> {
        match self {
            Value::Number(n) => Ok(*n),
            other => Err(format!("expected a number, found {other:?}")),
        }
    }

    fn truth(&self) -> bool {
        match self {
            Value::Undef => false,
            Value::Bool(b) => *b,
            Value::Number(n) => *n != 0.0,
            Value::Vector(v) => !v.is_empty(),
        }
    }

    /// Three numbers: a vector, or one number for all.
    fn triple(&self) -> Result<[f64; 3], String> {
        match self {
            Value::Vector(v) if v.len() == 3 => Ok([v[0].number()?, v[1].number()?, v[2].number()?]),
            other => Ok([other.number()?; 3]),
        }
    }

    /// The way OpenSCAD prints it.
    fn text(&self) -> String {
        match self {
            Value::Undef => "undef".into(),
            Value::Bool(b) => b.to_string(),
            Value::Number(n) => number_text(*n),
            Value::Vector(v) => format!("[{}]", v.iter().map(Value::text).collect::<Vec<_>>().join(", ")),
        }
    }
}

/// Six significant digits without trailing zeros, as C's `%g`.
fn number_text(n: f64) -> String {
    if n == 0.0 {
        return "0".into();
    }
    let scientific = format!("{n:.5e}");
    let (mantissa, exponent) = scientific.split_once('e').expect("the format has an exponent");
    let exponent: i32 = exponent.parse().expect("an integer");
    let trim =
        |s: &str| if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_string() } else { s.into() };
    if (-5..6).contains(&exponent) {
        trim(&format!("{n:.*}", (5 - exponent) as usize))
    } else {
        format!("{}e{}{:02}", trim(mantissa), if exponent < 0 { '-' } else { '+' }, exponent.abs())
    }
}

/// Sine of an angle in degrees, exact where the value is 0, ±1/2 or ±1.
fn sin_degrees(angle: f64) -> f64 {
    let a = angle.rem_euclid(360.0);
    let (sign, a) = if a >= 180.0 { (-1.0, a - 180.0) } else { (1.0, a) };
    let a = if a > 90.0 { 180.0 - a } else { a };
    let s = match a {
        0.0 => 0.0,
        30.0 => 0.5,
        90.0 => 1.0,
        _ => a.to_radians().sin(),
    };
    sign * s
}

fn cos_degrees(angle: f64) -> f64 {
    sin_degrees(angle + 90.0)
}

#[derive(Clone, Default)]
struct Scope {
    values: HashMap<String, Value>,
    modules: HashMap<String, (Vec<(String, Option<Expr>)>, Vec<Statement>)>,
}

impl Scope {
    fn eval(&self, e: &Expr) -> Result<Value, String> {
        Ok(match e {
            Expr::Value(v) => v.clone(),
            Expr::Name(n) => self.values.get(n).cloned().unwrap_or(Value::Undef),
            Expr::Vector(items) => Value::Vector(items.iter().map(|i| self.eval(i)).collect::<Result<_, _>>()?),
            Expr::Range(items) => {
                let n: Vec<f64> = items.iter().map(|i| self.eval(i)?.number()).collect::<Result<_, _>>()?;
                let (from, step, to) = if n.len() == 3 { (n[0], n[1], n[2]) } else { (n[0], 1.0, n[1]) };
                let count = ((to - from) / step * (1.0 + 1e-12)).floor();
                Value::Vector((0..=count as i64).map(|i| Value::Number(from + i as f64 * step)).collect())
            }
            Expr::Index(v, i) => match (self.eval(v)?, self.eval(i)?.number()?) {
                (Value::Vector(v), i) => v.get(i as usize).cloned().unwrap_or(Value::Undef),
                _ => Value::Undef,
            },
            Expr::Not(v) => Value::Bool(!self.eval(v)?.truth()),
            Expr::Choice(c) => self.eval(if self.eval(&c[0])?.truth() { &c[1] } else { &c[2] })?,
            Expr::Binary(op, a, b) => self.operate(op, self.eval(a)?, b)?,
            Expr::Call(name, arguments) => {
                let v: Vec<Value> = arguments.iter().map(|(_, e)| self.eval(e)).collect::<Result<_, _>>()?;
                if name == "is_undef" {
                    return Ok(Value::Bool(v == [Value::Undef]));
                }
                let n: Vec<f64> = v.iter().map(Value::number).collect::<Result<_, _>>()?;
                Value::Number(match (name.as_str(), n.as_slice()) {
                    ("sin", [a]) => sin_degrees(*a),
                    ("cos", [a]) => cos_degrees(*a),
                    ("tan", [a]) => sin_degrees(*a) / cos_degrees(*a),
                    ("sqrt", [a]) => a.sqrt(),
                    ("abs", [a]) => a.abs(),
                    ("min", n) => n.iter().copied().fold(f64::INFINITY, f64::min),
                    ("max", n) => n.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                    _ => return Err(format!("function {name} is not supported")),
                })
            }
        })
    }

    fn operate(&self, op: &str, a: Value, b: &Expr) -> Result<Value, String> {
        if op == "&&" || op == "||" {
            let a = a.truth();
            return Ok(Value::Bool(if a == (op == "||") { a } else { self.eval(b)?.truth() }));
        }
        let b = self.eval(b)?;
        if op == "==" || op == "!=" {
            return Ok(Value::Bool((a == b) == (op == "==")));
        }
        let (a, b) = (a.number()?, b.number()?);
        Ok(match op {
            "<" => Value::Bool(a < b),
            ">" => Value::Bool(a > b),
            "<=" => Value::Bool(a <= b),
            ">=" => Value::Bool(a >= b),
            "+" => Value::Number(a + b),
            "-" => Value::Number(a - b),
            "*" => Value::Number(a * b),
            "/" => Value::Number(a / b),
            _ => Value::Number(a % b),
        })
    }

    /// Runs the statements of one scope: its assignments and modules first, as the language has it.
    fn run(&mut self, statements: &[Statement], out: &mut String, depth: usize) -> Result<(), String> {
        for s in statements {
            if let Statement::Module(name, parameters, body) = s {
                self.modules.insert(name.clone(), (parameters.clone(), body.clone()));
            }
        }
        for s in statements {
            if let Statement::Assign(name, e) = s {
                let value = self.eval(e)?;
                self.values.insert(name.clone(), value);
            }
        }
        for s in statements {
            match s {
                Statement::Assign(..) | Statement::Module(..) => {}
                Statement::If(condition, yes, no) => {
                    let chosen = if self.eval(condition)?.truth() { yes } else { no };
                    node(out, depth, "group()", |out| self.clone().run(chosen, out, depth + 1))?;
                }
                Statement::Call { name, arguments, body, line } => {
                    self.call(name, arguments, body, out, depth).map_err(|e| place(e, *line))?;
                }
            }
        }
        Ok(())
    }

    fn call(
        &self,
        name: &str,
        arguments: &[Argument],
        body: &[Statement],
        out: &mut String,
        depth: usize,
    ) -> Result<(), String> {
        if let Some((parameters, module)) = self.modules.get(name) {
            let mut inner = self.clone();
            for (i, (parameter, default)) in parameters.iter().enumerate() {
                let value = match argument(arguments, parameter, i) {
                    Some(e) => self.eval(e)?,
                    None => default.as_ref().map_or(Ok(Value::Undef), |d| self.eval(d))?,
                };
                inner.values.insert(parameter.clone(), value);
            }
            return node(out, depth, "group()", |out| inner.run(module, out, depth + 1));
        }
        if name == "for" {
            return node(out, depth, "group()", |out| self.iterate(arguments, body, out, depth + 1));
        }
        let get = |parameter: &str, i: usize| argument(arguments, parameter, i).map(|e| self.eval(e)).transpose();
        let named = |parameter: &str| get(parameter, usize::MAX);
        let special = |parameter: &str| match named(parameter)? {
            Some(v) => Ok::<_, String>(v.text()),
            None => Ok(self.values[parameter].text()),
        };
        let facets = || {
            Ok::<_, String>(format!("$fn = {}, $fa = {}, $fs = {}", special("$fn")?, special("$fa")?, special("$fs")?))
        };
        let center = || Ok::<_, String>(named("center")?.is_some_and(|v| v.truth()));
        // A radius by r or by d, or `other`.
        let radius = |r: &str, d: &str, i: usize| match (get(r, i)?, named(d)?) {
            (Some(v), _) => v.number().map(Some),
            (None, Some(v)) => v.number().map(|d| Some(d / 2.0)),
            _ => Ok::<_, String>(None),
        };
        let leaf = |out: &mut String, text: String| {
            out.extend(std::iter::repeat_n('\t', depth));
            out.push_str(&text);
            out.push_str(";\n");
            Ok(())
        };
        let head = match name {
            "union" | "difference" | "intersection" | "group" => format!("{name}()"),
            "translate" => {
                let v = get("v", 0)?.ok_or("translate needs a vector")?.triple()?;
                matrix_text([[1., 0., 0., v[0]], [0., 1., 0., v[1]], [0., 0., 1., v[2]]])
            }
            "rotate" => {
                let angles = match get("a", 0)?.ok_or("rotate needs angles")? {
                    Value::Number(z) => [0.0, 0.0, z],
                    v => v.triple()?,
                };
                matrix_text(rotation(angles))
            }
            "linear_extrude" => {
                let height = get("height", 0)?.ok_or("linear_extrude needs a height")?.text();
                let center = if center()? { "center = true, " } else { "" };
                format!("linear_extrude(height = {height}, {center}{})", facets()?)
            }
            "cube" => {
                let size = get("size", 0)?.unwrap_or(Value::Number(1.0)).triple()?.map(number_text).join(", ");
                return leaf(out, format!("cube(size = [{size}], center = {})", center()?));
            }
            "sphere" => {
                let r = radius("r", "d", 0)?.unwrap_or(1.0);
                return leaf(out, format!("sphere({}, r = {})", facets()?, number_text(r)));
            }
            "cylinder" => {
                let h = get("h", 0)?.map_or(Ok(1.0), |v| v.number())?;
                let both = radius("r", "d", usize::MAX)?;
                let r1 = radius("r1", "d1", 1)?.or(both).unwrap_or(1.0);
                let r2 = radius("r2", "d2", 2)?.or(both).unwrap_or(1.0);
                let sizes = [h, r1, r2].map(number_text);
                let [h, r1, r2] = sizes;
                return leaf(
                    out,
                    format!("cylinder({}, h = {h}, r1 = {r1}, r2 = {r2}, center = {})", facets()?, center()?),
                );
            }
            "circle" => {
                let r = radius("r", "d", 0)?.unwrap_or(1.0);
                return leaf(out, format!("circle({}, r = {})", facets()?, number_text(r)));
            }
            "polygon" => {
                let points = get("points", 0)?.ok_or("polygon needs points")?.text();
                return leaf(out, format!("polygon(points = {points}, paths = undef, convexity = 1)"));
            }
            "polyhedron" => {
                let points = get("points", 0)?.ok_or("polyhedron needs points")?.text();
                let faces = get("faces", 1)?.ok_or("polyhedron needs faces")?.text();
                return leaf(out, format!("polyhedron(points = {points}, faces = {faces}, convexity = 1)"));
            }
            other => return Err(format!("{other} is not supported")),
        };
        node(out, depth, &head, |out| self.clone().run(body, out, depth + 1))
    }

    /// The loops of one `for`, the last variable fastest.
    fn iterate(
        &self,
        variables: &[Argument],
        body: &[Statement],
        out: &mut String,
        depth: usize,
    ) -> Result<(), String> {
        let Some(((name, range), rest)) = variables.split_first() else { return self.clone().run(body, out, depth) };
        let name = name.clone().ok_or("for needs a variable")?;
        let values = match self.eval(range)? {
            Value::Vector(v) => v,
            one => vec![one],
        };
        for value in values {
            let mut inner = self.clone();
            inner.values.insert(name.clone(), value);
            inner.iterate(rest, body, out, depth)?;
        }
        Ok(())
    }
}

fn place(message: String, line: usize) -> String {
    if message.starts_with("line ") { message } else { format!("line {line}: {message}") }
}

/// The argument called `name`, else the `i`-th of those without a name.
fn argument<'a>(arguments: &'a [Argument], name: &str, i: usize) -> Option<&'a Expr> {
    let named = arguments.iter().find(|(n, _)| n.as_deref() == Some(name));
    named.or_else(|| arguments.iter().filter(|(n, _)| n.is_none()).nth(i)).map(|(_, e)| e)
}

fn node(
    out: &mut String,
    depth: usize,
    head: &str,
    inside: impl FnOnce(&mut String) -> Result<(), String>,
) -> Result<(), String> {
    let mut children = String::new();
    inside(&mut children)?;
    let indent = "\t".repeat(depth);
    if children.is_empty() {
        let _ = writeln!(out, "{indent}{head};");
    } else {
        let _ = write!(out, "{indent}{head} {{\n{children}{indent}}}\n");
    }
    Ok(())
}

/// Rows of Rz·Ry·Rx.
fn rotation(angles: [f64; 3]) -> [[f64; 4]; 3] {
    let [(sx, cx), (sy, cy), (sz, cz)] = angles.map(|a| (sin_degrees(a), cos_degrees(a)));
    [
        [cy * cz, cz * sx * sy - cx * sz, cx * cz * sy + sx * sz, 0.0],
        [cy * sz, cx * cz + sx * sy * sz, cx * sy * sz - cz * sx, 0.0],
        [-sy, cy * sx, cx * cy, 0.0],
    ]
}

fn matrix_text(rows: [[f64; 4]; 3]) -> String {
    let row = |r: [f64; 4]| format!("[{}]", r.map(number_text).join(", "));
    format!("multmatrix([{}, [0, 0, 0, 1]])", rows.map(row).join(", "))
}
