//! Regions: half-spaces of surfaces with intersections, unions and complements.

use super::surface::Surface;
use crate::import::Problem;
use crate::math::Aabb;
use std::collections::HashMap;

/// Parentheses within parentheses.
const DEEPEST: usize = 200;
/// How often the parts of an intersection narrow a box in turn.
const ROUNDS: usize = 8;

/// A set of points; complements have been carried to the surfaces.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Region {
    /// Within all of them; of none: everywhere.
    All(Vec<Self>),
    /// Within any of them.
    Any(Vec<Self>),
    /// One side of a surface, by its index; the positive one where `outside`.
    Side { surface: usize, outside: bool },
}

/// What a region is within a box.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Within {
    /// All of it.
    Whole,
    /// Nothing of it.
    Nothing,
    /// What this text tells, and it may reach beyond the box.
    Text(String),
}

/// The text of a box.
pub(super) fn block_text(block: &Aabb) -> String {
    let (center, size) = (block.center(), (block.max - block.min).to_array());
    let cube = format!("cube(size = {size:?}, center = true);");
    crate::import::written::placed(&contactd_proto::Pose::at(center), &cube)
}

/// Reads a region. Blanks are intersections, which bind closer than `|`; `~` is the complement of what stands behind it.
pub(super) fn read(text: &str, surfaces: &HashMap<i64, usize>) -> Result<Region, Problem> {
    let mut reader = Reader { rest: text, surfaces, depth: 0 };
    reader.skip();
    if reader.rest.is_empty() {
        return Ok(Region::All(Vec::new()));
    }
    let region = reader.any(false)?;
    if reader.rest.is_empty() { Ok(region) } else { Err(reader.expected("a surface, |, ~ or (")) }
}

struct Reader<'a> {
    rest: &'a str,
    surfaces: &'a HashMap<i64, usize>,
    depth: usize,
}

impl Reader<'_> {
    fn skip(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, c: char) -> bool {
        let rest = self.rest.strip_prefix(c);
        let is_there = rest.is_some();
        self.rest = rest.unwrap_or(self.rest);
        self.skip();
        is_there
    }

    fn expected(&self, what: &str) -> Problem {
        let found = match self.rest.char_indices().nth(20) {
            _ if self.rest.is_empty() => "the region's end".to_owned(),
            None => format!("{:?}", self.rest),
            Some((end, _)) => format!("{:?} …", &self.rest[..end]),
        };
        Problem::syntax(format!("{what} in the region"), found)
    }

    /// Operands of a kind of operation; `is_not`: of the complement, so of the other kind.
    fn join(is_union: bool, is_not: bool, mut operands: Vec<Region>) -> Region {
        if operands.len() == 1 {
            return operands.remove(0);
        }
        if is_union == is_not { Region::All(operands) } else { Region::Any(operands) }
    }

    fn any(&mut self, is_not: bool) -> Result<Region, Problem> {
        let mut operands = vec![self.all(is_not)?];
        while self.take('|') {
            operands.push(self.all(is_not)?);
        }
        Ok(Self::join(true, is_not, operands))
    }

    fn all(&mut self, is_not: bool) -> Result<Region, Problem> {
        let mut operands = vec![self.one(is_not)?];
        while !self.rest.is_empty() && !self.rest.starts_with(['|', ')']) {
            operands.push(self.one(is_not)?);
        }
        Ok(Self::join(false, is_not, operands))
    }

    fn one(&mut self, mut is_not: bool) -> Result<Region, Problem> {
        while self.take('~') {
            is_not = !is_not;
        }
        if self.take('(') {
            self.depth += 1;
            if self.depth > DEEPEST {
                return Err(Problem::Limit { what: "parentheses within parentheses of a region", limit: DEEPEST });
            }
            let region = self.any(is_not)?;
            self.depth -= 1;
            return if self.take(')') { Ok(region) } else { Err(self.expected(")")) };
        }
        let text = self.rest;
        let sign = text.strip_prefix(['+', '-']).unwrap_or(text);
        let digits = sign.bytes().take_while(u8::is_ascii_digit).count();
        let number = sign.get(..digits).and_then(|word| word.parse::<i64>().ok());
        let Some(number) = number else { return Err(self.expected("a surface, ~ or (")) };
        let Some(surface) = self.surfaces.get(&number).copied() else {
            return Err(Problem::syntax("the id of a surface in the region", number.to_string()));
        };
        self.rest = &sign[digits..];
        self.skip();
        Ok(Region::Side { surface, outside: text.starts_with('-') == is_not })
    }
}

impl Region {
    /// A box that holds what of it is within another one, which may have no end.
    pub(super) fn narrow(&self, surfaces: &[Surface], block: &Aabb) -> Aabb {
        match self {
            Self::Side { surface, outside } => surfaces[*surface].narrow(*outside, block),
            Self::Any(parts) => parts.iter().fold(Aabb::EMPTY, |b, part| b.union(&part.narrow(surfaces, block))),
            Self::All(parts) => {
                let mut left = *block;
                for _ in 0..ROUNDS {
                    let before = left;
                    left = parts.iter().fold(left, |b, part| part.narrow(surfaces, &b));
                    if left == before || left.is_empty() {
                        break;
                    }
                }
                left
            }
        }
    }

    /// What is not within it.
    pub(super) fn complement(&self) -> Self {
        let of = |parts: &[Self]| parts.iter().map(Self::complement).collect();
        match self {
            Self::Side { surface, outside } => Self::Side { surface: *surface, outside: !outside },
            Self::All(parts) => Self::Any(of(parts)),
            Self::Any(parts) => Self::All(of(parts)),
        }
    }

    /// The surfaces that it names, by their indices.
    pub(super) fn surfaces(&self, out: &mut Vec<usize>) {
        match self {
            Self::Side { surface, .. } => out.push(*surface),
            Self::All(parts) | Self::Any(parts) => parts.iter().for_each(|part| part.surfaces(out)),
        }
    }

    /// What it is within a box.
    pub(super) fn within(&self, surfaces: &[Surface], block: &Aabb) -> Within {
        match self {
            Self::Side { surface, outside } => {
                let of = &surfaces[*surface];
                match of.side(block) {
                    Some(negative) if negative != *outside => Within::Whole,
                    Some(_) => Within::Nothing,
                    None if *outside && !of.is_plane() => {
                        Within::Text(format!("difference() {{ {} {} }}", block_text(block), of.text(false, block)))
                    }
                    None => Within::Text(of.text(*outside, block)),
                }
            }
            Self::Any(parts) => {
                let mut texts = Vec::new();
                for part in parts {
                    match part.within(surfaces, block) {
                        Within::Whole => return Within::Whole,
                        Within::Nothing => {}
                        Within::Text(text) => texts.push(text),
                    }
                }
                match texts.len() {
                    0 => Within::Nothing,
                    1 => Within::Text(texts.remove(0)),
                    _ => Within::Text(format!("union() {{ {} }}", texts.join(" "))),
                }
            }
            Self::All(parts) => all(parts, surfaces, block),
        }
    }
}

/// An intersection: what is outside of round surfaces is taken away from the rest.
fn all(parts: &[Region], surfaces: &[Surface], block: &Aabb) -> Within {
    let (mut texts, mut away) = (Vec::new(), Vec::new());
    for part in parts {
        if let Region::Side { surface, outside: true } = part
            && !surfaces[*surface].is_plane()
        {
            let of = &surfaces[*surface];
            match of.side(block) {
                Some(true) => return Within::Nothing,
                Some(false) => {}
                None => away.push(of.text(false, block)),
            }
            continue;
        }
        match part.within(surfaces, block) {
            Within::Nothing => return Within::Nothing,
            Within::Whole => {}
            Within::Text(text) => texts.push(text),
        }
    }
    if texts.is_empty() && away.is_empty() {
        return Within::Whole;
    }
    if texts.is_empty() {
        texts.push(block_text(block));
    }
    let rest = if texts.len() == 1 { texts.remove(0) } else { format!("intersection() {{ {} }}", texts.join(" ")) };
    Within::Text(if away.is_empty() { rest } else { format!("difference() {{ {rest} {} }}", away.join(" ")) })
}
