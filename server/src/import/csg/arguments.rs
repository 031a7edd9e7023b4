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

    /// A size: a number greater than zero, infinite included; `None` for zero or less, of which OpenSCAD makes nothing.
    pub fn size(&self, name: &str) -> Result<Option<f64>> {
        self.size_of(name, self.required(name, "a positive number")?)
    }

    /// A size that is finite.
    pub fn finite_size(&self, name: &str) -> Result<Option<f64>> {
        let v = self.required(name, "a positive number")?;
        match self.size_of(name, v)? {
            Some(n) if !n.is_finite() => Err(self.wrong(v, "a finite number", name)),
            size => Ok(size),
        }
    }

    /// A number that is zero or more, infinite included; `None` for less.
    pub fn not_negative(&self, name: &str) -> Result<Option<f64>> {
        let v = self.required(name, "a number")?;
        match self.number_of(name, v)? {
            n if n >= 0.0 => Ok(Some(n)),
            n if n.is_finite() => Ok(None),
            _ => Err(self.wrong(v, "a number that is not negative", name)),
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

    /// Two finite sizes, or one that stands for both; `None` where one is zero or less.
    pub fn sizes_2d(&self, name: &str) -> Result<Option<DVec2>> {
        let v = self.required(name, "two positive numbers")?;
        let finite = |v: &Value| match self.size_of(name, v)? {
            Some(n) if !n.is_finite() => Err(self.wrong(v, "a finite number", name)),
            size => Ok(size),
        };
        match &v.kind {
            ValueKind::List(l) => match l.as_slice() {
                [x, y] => {
                    let [x, y] = [finite(x)?, finite(y)?];
                    Ok(x.zip(y).map(|(x, y)| DVec2::new(x, y)))
                }
                _ => Err(self.wrong(v, "two positive numbers", name)),
            },
            _ => Ok(finite(v)?.map(DVec2::splat)),
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

    /// A list of points with `N` finite coordinates each.
    pub fn points<const N: usize>(&self, name: &str) -> Result<Vec<[f64; N]>> {
        let what = format!("a list of points with {N} coordinates");
        let v = self.required(name, &what)?;
        let ValueKind::List(items) = &v.kind else { return Err(self.wrong(v, &what, name)) };
        let mut points = Vec::with_capacity(items.len());
        for item in items {
            let ValueKind::List(c) = &item.kind else { return Err(self.wrong(item, "a point", name)) };
            if c.len() != N {
                return Err(self.wrong(item, &format!("a point with {N} coordinates"), name));
            }
            let mut point = [0.0; N];
            for (p, value) in point.iter_mut().zip(c) {
                *p = finite(value)?;
            }
            points.push(point);
        }
        Ok(points)
    }

    /// A list of lists of indices, without those from `count` on, and how many of these there are.
    pub fn index_lists(&self, name: &str, count: usize) -> Result<(Vec<Vec<u32>>, usize)> {
        let what = "a list of lists of indices";
        let v = self.required(name, what)?;
        let ValueKind::List(items) = &v.kind else { return Err(self.wrong(v, what, name)) };
        let (mut lists, mut beyond) = (Vec::with_capacity(items.len()), 0);
        for item in items {
            let ValueKind::List(indices) = &item.kind else { return Err(self.wrong(item, what, name)) };
            let mut list = Vec::with_capacity(indices.len());
            for i in indices {
                match i.kind {
                    ValueKind::Number(n) if n >= 0.0 && n.fract() == 0.0 && n < count as f64 => list.push(n as u32),
                    ValueKind::Number(n) if n >= 0.0 && n.fract() == 0.0 => beyond += 1,
                    _ => return Err(self.wrong(i, &format!("an index below {count}"), name)),
                }
            }
            lists.push(list);
        }
        Ok((lists, beyond))
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
            ValueKind::Number(n) if n > 0.0 => Ok(Some(n)),
            ValueKind::Number(n) if n.is_finite() => Ok(None),
            _ => Err(self.wrong(v, "a positive number", name)),
        }
    }

    fn wrong(&self, v: &Value, what: &str, name: &str) -> (Place, Problem) {
        (v.at, Problem::syntax(format!("{what} as {name} of {}", self.call.name), v.found()))
    }
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
