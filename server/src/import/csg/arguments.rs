//! Typed access to a call's arguments.
//!
//! Flattened files name every argument; unnamed ones are taken in OpenSCAD's order. A name that the call does not have
//! is refused rather than dropped, for a dropped name would silently change the shape. What OpenSCAD itself may write and what
//! changes no shape is allowed everywhere: `HARMLESS`.

use super::syntax::{Call, Value, ValueKind};
use super::{Place, Problem};
use glam::{DVec2, DVec3};

/// Arguments that any call may have, whatever their values: a hint for the preview, and into how many pieces curves are
/// cut, which says something of curved primitives alone (they read it). Any other `$`-variable is refused.
pub const HARMLESS: [&str; 5] = ["convexity", "$fn", "$fa", "$fs", "$fe"];

/// The arguments of one call, matched with its parameters.
pub struct Arguments<'a> {
    call: &'a Call,
    named: Vec<(&'a str, &'a Value)>,
}

type Result<T> = std::result::Result<T, (Place, Problem)>;

impl<'a> Arguments<'a> {
    /// Matches the arguments of `call` with `parameters`, OpenSCAD's order first.
    pub fn new(call: &'a Call, parameters: &[&'static str]) -> Result<Self> {
        let mut named: Vec<(&'a str, &'a Value)> = Vec::with_capacity(call.arguments.len());
        let mut unnamed = parameters.iter();
        for a in &call.arguments {
            let name = match &a.name {
                // Written for no file at all.
                Some(n)
                    if n == "file" && a.value.kind == ValueKind::Text(String::new()) && !call.children.is_empty() =>
                {
                    continue;
                }
                Some(n) if HARMLESS.contains(&n.as_str()) || parameters.contains(&n.as_str()) => n.as_str(),
                Some(n) if n == "file" => {
                    let construct = format!("{} of another file", call.name);
                    return Err((a.at, Problem::Unsupported { construct, hint: OTHER_FILES }));
                }
                Some(n) => {
                    let problem = Problem::syntax(expected_names(&call.name, parameters), format!("\"{n}\""));
                    return Err((a.at, problem));
                }
                None => match unnamed.next() {
                    Some(n) => n,
                    None => {
                        let expected = format!("at most {} unnamed arguments of {}", parameters.len(), call.name);
                        return Err((a.at, Problem::syntax(expected, "another")));
                    }
                },
            };
            if named.iter().any(|(n, _)| *n == name) {
                return Err((
                    a.at,
                    Problem::syntax(format!("each argument of {} once", call.name), format!("a second {name}")),
                ));
            }
            named.push((name, &a.value));
        }
        Ok(Self { call, named })
    }

    /// The value of `name`, unless it is missing or `undef`.
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        let value = self.named.iter().find(|(n, _)| *n == name)?.1;
        (value.kind != ValueKind::Undef).then_some(value)
    }

    /// The value of `name`, which must be there.
    pub fn required(&self, name: &str, what: &str) -> Result<&'a Value> {
        self.get(name).ok_or_else(|| {
            let expected = format!("{what} as {name} of {}", self.call.name);
            let found = if self.named.iter().any(|(n, _)| *n == name) { "undef" } else { "none" };
            (self.call.at, Problem::syntax(expected, found))
        })
    }

    /// A number (possibly infinite), or `default`.
    pub fn number_or(&self, name: &str, default: f64) -> Result<f64> {
        match self.get(name) {
            None => Ok(default),
            Some(v) => self.number_of(name, v),
        }
    }

    /// A size: a number greater than zero, infinite included; `None` for any other, of which OpenSCAD makes nothing: it writes
    /// `nan` where a division by zero told the size.
    pub fn size(&self, name: &str) -> Result<Option<f64>> {
        self.size_of(name, self.required(name, "a positive number")?)
    }

    /// What says how finely curves are cut, `$fn` and its like, or `default`; possibly no finite number.
    pub fn setting(&self, name: &str, default: f64) -> Result<f64> {
        match self.get(name).map(|v| (v, &v.kind)) {
            None => Ok(default),
            Some((_, ValueKind::Number(n))) => Ok(*n),
            Some((v, _)) => Err(self.wrong(v, "a number", name)),
        }
    }

    /// A size that is finite.
    pub fn finite_size(&self, name: &str) -> Result<Option<f64>> {
        let v = self.required(name, "a positive number")?;
        match self.size_of(name, v)? {
            Some(n) if !n.is_finite() => Err(self.wrong(v, "a finite number", name)),
            size => Ok(size),
        }
    }

    /// A number that is zero or more, infinite included; `None` for less, and for `nan`.
    pub fn not_negative(&self, name: &str) -> Result<Option<f64>> {
        let v = self.required(name, "a number")?;
        match v.kind {
            ValueKind::Number(n) => Ok((n >= 0.0).then_some(n)),
            _ => Err(self.wrong(v, "a number", name)),
        }
    }

    /// `true` or `false`, or `default`.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool> {
        match self.get(name) {
            None => Ok(default),
            Some(v) => match v.kind {
                ValueKind::Bool(b) => Ok(b),
                _ => Err(self.wrong(v, "true or false", name)),
            },
        }
    }

    /// Three sizes (infinite included), or one that stands for all three; `None` where one is zero or less.
    pub fn sizes(&self, name: &str) -> Result<Option<DVec3>> {
        let v = self.required(name, "three positive numbers")?;
        match &v.kind {
            ValueKind::List(l) => match l.as_slice() {
                [x, y, z] => {
                    let [x, y, z] = [self.size_of(name, x)?, self.size_of(name, y)?, self.size_of(name, z)?];
                    Ok(x.zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z)))
                }
                _ => Err(self.wrong(v, "three positive numbers", name)),
            },
            _ => Ok(self.size_of(name, v)?.map(DVec3::splat)),
        }
    }

    /// Two sizes (infinite included), or one that stands for both; `None` where one is zero or less.
    pub fn sizes_2d(&self, name: &str) -> Result<Option<DVec2>> {
        let v = self.required(name, "two positive numbers")?;
        let size = |v: &Value| self.size_of(name, v);
        match &v.kind {
            ValueKind::List(l) => match l.as_slice() {
                [x, y] => {
                    let [x, y] = [size(x)?, size(y)?];
                    Ok(x.zip(y).map(|(x, y)| DVec2::new(x, y)))
                }
                _ => Err(self.wrong(v, "two positive numbers", name)),
            },
            _ => Ok(size(v)?.map(DVec2::splat)),
        }
    }

    /// Two finite numbers, one that stands for both, or `default`.
    pub fn pair_or(&self, name: &str, default: DVec2) -> Result<DVec2> {
        let Some(v) = self.get(name) else { return Ok(default) };
        match &v.kind {
            ValueKind::List(l) if l.len() == 2 => Ok(DVec2::new(finite(&l[0])?, finite(&l[1])?)),
            ValueKind::List(_) => Err(self.wrong(v, "one or two numbers", name)),
            _ => Ok(DVec2::splat(finite(v)?)),
        }
    }

    /// The points of a list, of which OpenSCAD writes whatever it was given: `least` to `N` coordinates each, those that are
    /// missing 0. What is none is told as an error would call it.
    pub fn points<const N: usize>(
        &self,
        name: &str,
        least: usize,
    ) -> Result<Vec<std::result::Result<[f64; N], String>>> {
        let what = format!("a list of points with {N} coordinates");
        let v = self.required(name, &what)?;
        let ValueKind::List(items) = &v.kind else { return Err(self.wrong(v, &what, name)) };
        let point = |item: &Value| {
            let ValueKind::List(of) = &item.kind else { return Err(item.found()) };
            if !(least..=N).contains(&of.len()) {
                return Err(item.found());
            }
            let mut point = [0.0; N];
            for (p, v) in point.iter_mut().zip(of) {
                *p = finite(v).map_err(|_| format!("a list that holds {}", v.found()))?;
            }
            Ok(point)
        };
        Ok(items.iter().map(point).collect())
    }

    /// A list of lists of indices of `count` things, read as OpenSCAD reads them; none where it is missing.
    pub fn index_lists(&self, name: &str, count: usize) -> Result<IndexLists> {
        let mut read = IndexLists::default();
        let Some(v) = self.get(name) else { return Ok(read) };
        let ValueKind::List(items) = &v.kind else { return Err(self.wrong(v, "a list of lists of indices", name)) };
        for item in items {
            let mut list = Vec::new();
            // What is no list names nothing.
            let indices = if let ValueKind::List(indices) = &item.kind { indices.as_slice() } else { &[] };
            for i in indices {
                let n = if let ValueKind::Number(n) = i.kind { n } else { 0.0 };
                let whole = n.trunc();
                if !(whole >= 0.0 && whole < count as f64) {
                    read.beyond += 1;
                    continue;
                }
                read.rough += usize::from(!matches!(i.kind, ValueKind::Number(n) if n == whole));
                list.push(whole as u32);
            }
            read.lists.push(list);
        }
        Ok(read)
    }

    /// Where the call stands.
    pub fn at(&self) -> Place {
        self.call.at
    }

    /// The call's name.
    pub fn name(&self) -> &'a str {
        &self.call.name
    }

    fn number_of(&self, name: &str, v: &Value) -> Result<f64> {
        match v.kind {
            ValueKind::Number(n) if !n.is_nan() => Ok(n),
            _ => Err(self.wrong(v, "a number", name)),
        }
    }

    fn size_of(&self, name: &str, v: &Value) -> Result<Option<f64>> {
        match v.kind {
            ValueKind::Number(n) => Ok((n > 0.0).then_some(n)),
            _ => Err(self.wrong(v, "a positive number", name)),
        }
    }

    fn wrong(&self, v: &Value, what: &str, name: &str) -> (Place, Problem) {
        (v.at, Problem::syntax(format!("{what} as {name} of {}", self.call.name), v.found()))
    }
}

/// Lists of indices, and what was not one.
#[derive(Default)]
pub struct IndexLists {
    /// Those that name something.
    pub lists: Vec<Vec<u32>>,
    /// How many name nothing: they are left out.
    pub beyond: usize,
    /// How many are no whole numbers: their fractions are cut off, and what is no number is 0.
    pub rough: usize,
}

/// What to do about a call that takes its shape from another file.
pub const OTHER_FILES: &str = " (other files are not read: write the shape out in primitives)";

/// A finite number.
pub fn finite(v: &Value) -> Result<f64> {
    match v.kind {
        ValueKind::Number(n) if n.is_finite() => Ok(n),
        _ => Err((v.at, Problem::syntax("a finite number", v.found()))),
    }
}

/// Three finite numbers in a list, `expected` in words.
pub fn vector(v: &Value, expected: &str) -> Result<DVec3> {
    match &v.kind {
        ValueKind::List(of) if of.len() == 3 => Ok(DVec3::new(finite(&of[0])?, finite(&of[1])?, finite(&of[2])?)),
        _ => Err((v.at, Problem::syntax(expected, v.found()))),
    }
}

fn expected_names(call: &str, parameters: &[&str]) -> String {
    match parameters {
        [] => format!("no argument of {call}"),
        [one] => format!("the argument {one} of {call}"),
        [first @ .., last] => format!("the arguments {} or {last} of {call}", first.join(", ")),
    }
}
