//! PLY, in text and in bytes of either order: the corners x, y, z of its element `vertex`, the lists of numbers of its element `face`.
//! Whatever else stands there (colours, normals, edges, elements of its own) is passed over.

use super::{Bodies, Line, MeshFormat, Place, Polygons, Result};
use crate::import::Limits;
use crate::import::problem::Problem;
use glam::DVec3;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat = MeshFormat { name: "ply", endings: &["ply"], read };

/// Bytes of a head.
const LONGEST_HEAD: usize = 64 << 10;

#[derive(Clone, Copy, PartialEq)]
enum Order {
    Text,
    LeastFirst,
    MostFirst,
}

/// A number's kind.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Whole { bytes: usize, signed: bool },
    Float { bytes: usize },
}

impl Kind {
    fn of(word: &str) -> Option<Self> {
        let whole = |bytes, signed| Some(Self::Whole { bytes, signed });
        match word {
            "char" | "int8" => whole(1, true),
            "uchar" | "uint8" => whole(1, false),
            "short" | "int16" => whole(2, true),
            "ushort" | "uint16" => whole(2, false),
            "int" | "int32" => whole(4, true),
            "uint" | "uint32" => whole(4, false),
            "float" | "float32" => Some(Self::Float { bytes: 4 }),
            "double" | "float64" => Some(Self::Float { bytes: 8 }),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Whole { bytes, .. } | Self::Float { bytes } => bytes,
        }
    }
}

struct Property {
    name: String,
    kind: Kind,
    /// Of a list: the kind of its length.
    length: Option<Kind>,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// Reads a mesh.
///
/// # Errors
/// What is wrong, with its place; of a binary file it is the number of the element.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    let (order, elements, body, lines) = head(bytes)?;
    let mut mesh = Polygons::default();
    let mut triangles = 0;
    let mut values = match order {
        Order::Text => Values::of_text(super::text(body)?, lines),
        Order::LeastFirst | Order::MostFirst => Values::of_bytes(body, order),
    };
    let points = elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
    for element in &elements {
        let most = match element.name.as_str() {
            "face" => limits.mesh_facets,
            _ => limits.mesh_facets.saturating_mul(3),
        };
        if element.count > most {
            return Err((Place::START, Problem::Limit { what: "elements of a mesh", limit: most }));
        }
        let of = |names: &[&str]| element.properties.iter().position(|p| names.contains(&p.name.as_str()));
        let corner = [of(&["x"]), of(&["y"]), of(&["z"])];
        let list = of(&["vertex_indices", "vertex_index"]);
        match element.name.as_str() {
            "vertex" if corner.contains(&None) => {
                return Err((Place::START, Problem::syntax("properties x, y and z of vertex", "not all of them")));
            }
            "face" if list.is_none_or(|l| element.properties[l].length.is_none()) => {
                let expected = "a property list … vertex_indices of face";
                return Err((Place::START, Problem::syntax(expected, "none")));
            }
            "tristrips" => {
                return Err((Place::START, Problem::syntax("faces", "strips of triangles (tristrips)")));
            }
            _ => {}
        }
        for i in 0..element.count {
            values.begin(&element.name, i);
            let mut point = DVec3::ZERO;
            for (k, property) in element.properties.iter().enumerate() {
                let Some(length) = property.length else {
                    let value = values.next(property.kind)?;
                    if let ("vertex", Some(axis)) = (element.name.as_str(), corner.iter().position(|c| *c == Some(k))) {
                        if !value.is_finite() {
                            return Err(values.wrong("a finite number", &value.to_string()));
                        }
                        point[axis] = value;
                    }
                    continue;
                };
                let count = values.next(length)?;
                let count =
                    if count.fract() == 0.0 && (0.0..4e9).contains(&count) { count as usize } else { usize::MAX };
                let is_face = element.name == "face" && list == Some(k);
                if count > values.left() || is_face && count < 3 {
                    return Err(values.wrong("a list's length from 3 that the file has room for", &count.to_string()));
                }
                let mut face = Vec::new();
                for _ in 0..count {
                    let value = values.next(property.kind)?;
                    if is_face {
                        if !(value.fract() == 0.0 && (0.0..points as f64).contains(&value)) {
                            return Err(values.wrong(&format!("a point's number below {points}"), &value.to_string()));
                        }
                        face.push(value as u32);
                    }
                }
                if is_face {
                    let at = values.place();
                    mesh.add(&face, || at, &mut triangles, limits)?;
                }
            }
            if element.name == "vertex" {
                mesh.points.push(point);
            }
        }
    }
    values.end()?;
    if mesh.points.len() < points {
        return Err((Place::START, Problem::syntax("points before faces", "faces alone")));
    }
    Ok(Bodies::of(mesh, "PLY"))
}

/// The order of bytes, the elements, what follows, and how many lines the head has.
fn head(bytes: &[u8]) -> Result<(Order, Vec<Element>, &[u8], u32)> {
    let (mut at, mut number) = (0, 0);
    let mut order = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let rest = &bytes[at..];
        let Some(end) = rest.iter().take(LONGEST_HEAD).position(|b| *b == b'\n') else {
            let place = Place { line: number + 1, column: 1 };
            return Err((place, Problem::syntax("a line of a PLY file's head", format!("{} bytes", rest.len()))));
        };
        number += 1;
        at += end + 1;
        let text = String::from_utf8_lossy(&rest[..end]);
        let line = Line { number, text: text.trim_end() };
        let words: Vec<&str> = line.words().collect();
        match (number, words.as_slice()) {
            (1, ["ply"]) => {}
            (1, words) => return line.wrong("ply", words.first().copied()),
            (_, ["format", kind, _]) => {
                order = Some(match *kind {
                    "ascii" => Order::Text,
                    "binary_little_endian" => Order::LeastFirst,
                    "binary_big_endian" => Order::MostFirst,
                    _ => return line.wrong("ascii, binary_little_endian or binary_big_endian", Some(kind)),
                });
            }
            (_, ["comment" | "obj_info", ..] | []) => {}
            (_, ["element", name, count]) => {
                let Ok(parsed) = count.parse::<usize>() else { return line.wrong("a number of elements", Some(count)) };
                elements.push(Element { name: (*name).to_owned(), count: parsed, properties: Vec::new() });
            }
            (_, ["property", kinds @ .., name]) => {
                let Some(element) = elements.last_mut() else {
                    return line.wrong("an element", words.first().copied());
                };
                let kind = |word: &str| Kind::of(word).map_or_else(|| line.wrong("a kind of number", Some(word)), Ok);
                let (length, kind) = match kinds {
                    ["list", length, of] => (Some(kind(length)?), kind(of)?),
                    [of] => (None, kind(of)?),
                    _ => {
                        return line
                            .wrong("property KIND NAME or property list KIND KIND NAME", words.first().copied());
                    }
                };
                element.properties.push(Property { name: (*name).to_owned(), kind, length });
            }
            (_, ["end_header"]) => break,
            (_, words) => {
                let expected = "format, element, property, comment or end_header";
                return line.wrong(expected, words.first().copied());
            }
        }
    }
    match order {
        Some(order) => Ok((order, elements, &bytes[at..], number)),
        None => Err((Place { line: number, column: 1 }, Problem::syntax("a format before end_header", "none"))),
    }
}

/// The values after a head, one after another.
struct Values<'b> {
    order: Order,
    bytes: &'b [u8],
    /// Of a text: its lines, with the words that are left of the one being read.
    lines: Box<dyn Iterator<Item = Line<'b>> + 'b>,
    line: Option<Line<'b>>,
    words: std::str::SplitWhitespace<'b>,
    /// What is being read.
    element: String,
}

impl<'b> Values<'b> {
    fn of_text(text: &'b str, before: u32) -> Self {
        let lines = text.lines().enumerate().map(move |(i, text)| Line { number: before + 1 + i as u32, text });
        let lines = Box::new(lines.filter(|l| !l.text.trim().is_empty()));
        let words = "".split_whitespace();
        Self { order: Order::Text, bytes: text.as_bytes(), lines, line: None, words, element: String::new() }
    }

    fn of_bytes(bytes: &'b [u8], order: Order) -> Self {
        let (lines, words) = (Box::new(std::iter::empty()), "".split_whitespace());
        Self { order, bytes, lines, line: None, words, element: String::new() }
    }

    /// Another element: of a text another line.
    fn begin(&mut self, element: &str, index: usize) {
        if self.order == Order::Text {
            self.line = self.lines.next();
            self.words = self.line.as_ref().map_or("", |l| l.text).split_whitespace();
        }
        self.element = format!("{element} {index}");
    }

    /// Where it is.
    fn place(&self) -> Place {
        self.line.as_ref().map_or(Place::START, |l| Place { line: l.number, column: 1 })
    }

    fn wrong(&self, expected: &str, found: &str) -> (Place, Problem) {
        (self.place(), Problem::syntax(expected, format!("{found} in {}", self.element)))
    }

    /// More values than these cannot follow.
    fn left(&self) -> usize {
        self.bytes.len()
    }

    fn next(&mut self, kind: Kind) -> Result<f64> {
        if self.order == Order::Text {
            let word = self.words.next();
            return match (word.and_then(|w| w.parse::<f64>().ok()), &self.line) {
                (Some(value), _) => Ok(value),
                (None, Some(line)) => line.wrong("a number", word),
                (None, None) => Err(self.wrong("a line", "the end of the file")),
            };
        }
        let Some((field, rest)) = self.bytes.split_at_checked(kind.bytes()) else {
            return Err(self.wrong("more bytes", "the end of the file"));
        };
        self.bytes = rest;
        let mut wide = [0; 8];
        wide[..field.len()].copy_from_slice(field);
        if self.order == Order::MostFirst {
            wide[..field.len()].reverse();
        }
        let bits = u64::from_le_bytes(wide);
        Ok(match kind {
            Kind::Float { bytes: 4 } => f64::from(f32::from_bits(bits as u32)),
            Kind::Float { .. } => f64::from_bits(bits),
            Kind::Whole { signed: false, .. } => bits as f64,
            Kind::Whole { bytes, signed: true } => {
                let unused = 64 - 8 * bytes as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        })
    }

    /// Nothing may follow but, of a binary file, a line's end.
    fn end(&mut self) -> Result<()> {
        match self.order {
            Order::Text => match self.lines.next() {
                Some(line) => line.wrong("the end of the file", line.words().next()),
                None => Ok(()),
            },
            _ if self.bytes.trim_ascii().is_empty() => Ok(()),
            _ => {
                Err((Place::START, Problem::syntax("the end of the file", format!("{} bytes more", self.bytes.len()))))
            }
        }
    }
}
