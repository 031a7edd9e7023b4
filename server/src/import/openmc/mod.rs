//! OpenMC's geometries: cells that fill universes, universes that fill cells and tiles of lattices.
//!
//! Source: docs.openmc.org, "Geometry Specification -- geometry.xml" and the section on geometry of its theory; conventions that are
//! not told there (order of tiles, sense of rotations) are those of its reader, version 0.15. Lengths are centimetres.
//!
//! A cell becomes a flattened OpenSCAD text in its universe's frame, cut off by a box that holds all places in which that universe is
//! seen. Each such place, a use, is what is left of that box of the cells and tiles around it: two cells may overlap where nobody sees
//! it.

mod lattice;
mod logic;
mod region;
mod surface;
mod uses;

use super::problem::Problem;
use super::scene::SceneError;
use super::{Limits, Note, Place, read_bytes, xml};
use crate::math::Aabb;
use contactd_proto::Pose;
use glam::{DMat3, DQuat, DVec3};
use lattice::Lattice;
use region::Region;
use roxmltree::Node;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;
use surface::Surface;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A universe, or what is around a lattice without an outer one, of which nothing is told.
#[derive(Clone, Debug)]
pub struct Universe {
    /// What sentences call it.
    pub name: String,
    /// Where the file has it: its first cell, or the lattice.
    pub at: Place,
    /// Its cells that reach into its box.
    pub cells: Vec<Cell>,
    /// A box that holds all of its uses, in its frame.
    pub block: Aabb,
    /// The box, a text.
    pub whole: String,
    /// What of the box is in no cell, a text; `None` of the root, beyond whose boundaries nothing has to be, and where it follows from the
    /// sides of surfaces that there is nothing.
    pub rest: Option<String>,
    /// Where it is seen: texts that cut off what is not, in its frame. One that is empty: the box, as it is.
    pub uses: Vec<Use>,
    /// There are more than are told.
    pub is_cut_short: bool,
    surfaces: Arc<[Surface]>,
}

/// A cell, within its universe's box.
#[derive(Clone, Debug)]
pub struct Cell {
    /// What sentences call it.
    pub name: String,
    /// Where the file has it.
    pub at: Place,
    /// Its solid, a flattened OpenSCAD text.
    pub text: String,
    region: Region,
}

impl Universe {
    /// True where it follows from the sides of surfaces alone that two of its cells have nothing in common.
    pub fn are_apart(&self, a: usize, b: usize) -> bool {
        logic::have_nothing_in_common(&[&self.cells[a].region, &self.cells[b].region], &self.surfaces)
    }
}

/// A place in which a universe is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Use {
    /// The text of what is seen; empty: all of the universe's box.
    pub text: String,
    /// A box around it.
    pub around: Aabb,
}

/// All universes that are seen, and what of the file is not asked about.
#[derive(Clone, Debug, Default)]
pub struct Universes {
    /// The universes.
    pub universes: Vec<Universe>,
    /// What is told of the file.
    pub notes: Vec<Note>,
}

/// A cell as the file has it.
struct RawCell {
    name: String,
    at: Place,
    universe: i64,
    region: Region,
    fill: Option<i64>,
    /// The frame of what fills it, in its own.
    pose: Pose,
}

/// What the file tells.
struct Geometry {
    surfaces: Vec<Surface>,
    cells: Vec<RawCell>,
    /// Cells of a universe, by their indices.
    universes: BTreeMap<i64, Vec<usize>>,
    lattices: BTreeMap<i64, Lattice>,
}

/// True for bytes whose root element is an OpenMC geometry, or a model that has one.
pub fn is_openmc(bytes: &[u8]) -> bool {
    xml::parse(bytes).is_ok_and(|document| geometry_of(document.root_element()).is_some())
}

fn geometry_of<'a, 'i>(root: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    match root.tag_name().name() {
        "geometry" => Some(root),
        "model" => xml::inside(root, "geometry").next(),
        _ => None,
    }
}

/// Reads a geometry, `geometry.xml` or `model.xml`.
///
/// # Errors
/// One sentence with file, line and column.
pub fn read_openmc(path: &Path) -> std::result::Result<Universes, SceneError> {
    let file = path.display().to_string();
    let bytes = read_bytes(path, &Limits::default())?;
    read(&bytes).map_err(|(at, problem)| SceneError::of_problem(file, at, problem))
}

fn read(bytes: &[u8]) -> Result<Universes> {
    let document = xml::parse(bytes)?;
    let root = document.root_element();
    let node = geometry_of(root).ok_or_else(|| {
        xml::wrong(root, "geometry, or a model that has one, as the root element", Some(root.tag_name().name()))
    })?;
    let mut surfaces = Vec::new();
    let mut by_id = HashMap::new();
    for surface in xml::inside(node, "surface") {
        let own = id(surface, "id")?;
        if by_id.insert(own, surfaces.len()).is_some() {
            return Err(xml::wrong(surface, "an id that no other surface has", Some(&own.to_string())));
        }
        surfaces.push(Surface::read(surface)?);
    }
    let mut geometry = Geometry { surfaces, cells: Vec::new(), universes: BTreeMap::new(), lattices: BTreeMap::new() };
    let mut ids = HashMap::new();
    for child in node.children().filter(Node::is_element) {
        match child.tag_name().name() {
            "surface" => {}
            "cell" => {
                let own = id(child, "id")?;
                if ids.insert(own, ()).is_some() {
                    return Err(xml::wrong(child, "an id that no other cell has", Some(&own.to_string())));
                }
                let cell = cell(child, own, &by_id)?;
                geometry.universes.entry(cell.universe).or_default().push(geometry.cells.len());
                geometry.cells.push(cell);
            }
            "lattice" | "hex_lattice" => {
                let lattice = Lattice::read(child, &mut geometry.surfaces)?;
                if let Some(former) = geometry.lattices.insert(lattice.id, lattice) {
                    return Err(xml::wrong(child, "an id that no other lattice has", Some(&former.id.to_string())));
                }
            }
            other => return Err((xml::place(child), Problem::unsupported(format!("<{other}>")))),
        }
    }
    if geometry.cells.is_empty() {
        return Err(xml::wrong(node, "cells in the geometry", None));
    }
    let mut seen = geometry.seen()?;
    for (node, text) in super::names::Names::of(include_str!("openmc.names")).unknown(node) {
        seen.notes.push(Note { at: xml::place(node), text, amount: None });
    }
    Ok(seen)
}

fn cell(node: Node<'_, '_>, own: i64, surfaces: &HashMap<i64, usize>) -> Result<RawCell> {
    let name = match value(node, "name") {
        Some(name) if !name.is_empty() => format!("cell {own} {name:?}"),
        _ => format!("cell {own}"),
    };
    let universe = value(node, "universe").map_or(Ok(0), |_| id(node, "universe"))?;
    let fill = value(node, "fill").map(|_| id(node, "fill")).transpose()?;
    // OpenMC's own rule. `<material/>` without a value would be none either.
    if fill.is_some() == value(node, "material").is_some_and(|text| !text.trim().is_empty()) {
        let found = if fill.is_some() { "both" } else { "neither" };
        return Err(xml::wrong(node, format!("either a material or a fill of {name}"), Some(found)));
    }
    let region = value(node, "region").unwrap_or_default();
    let region = region::read(&region, surfaces).map_err(|problem| (xml::place(node), problem))?;
    let three = |key: &str| match value(node, key) {
        None => Ok(None),
        Some(_) => array(node, key).map(Some),
    };
    let position = match three("translation")?.as_deref() {
        None => DVec3::ZERO,
        Some(&[x, y, z]) => DVec3::new(x, y, z),
        Some(_) => {
            return Err(xml::wrong(node, "three numbers as the translation", value(node, "translation").as_deref()));
        }
    };
    // Takes the cell's axes to those of what fills it.
    let turn = match three("rotation")?.as_deref() {
        None => DQuat::IDENTITY,
        Some(&[x, y, z]) => {
            let of = |k: fn(f64) -> DQuat, degrees: f64| k(-degrees.to_radians());
            of(DQuat::from_rotation_z, z) * of(DQuat::from_rotation_y, y) * of(DQuat::from_rotation_x, x)
        }
        Some(&[a, b, c, d, e, f, g, h, i]) => {
            let rows = DMat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]).transpose();
            let is_turn = (rows * rows.transpose() - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-9);
            if !is_turn || rows.determinant() < 0.0 {
                return Err(xml::wrong(
                    node,
                    "a matrix that only turns as the rotation",
                    value(node, "rotation").as_deref(),
                ));
            }
            DQuat::from_mat3(&rows)
        }
        Some(_) => {
            return Err(xml::wrong(
                node,
                "three angles or nine numbers as the rotation",
                value(node, "rotation").as_deref(),
            ));
        }
    };
    let pose = Pose::new(position, turn.normalize().conjugate());
    if fill.is_none() && pose != Pose::IDENTITY {
        return Err(xml::wrong(node, "a fill of a cell with a translation or rotation", None));
    }
    Ok(RawCell { name, at: xml::place(node), universe, region, fill, pose })
}

/// What an attribute says, or an element inside, as OpenMC takes either.
fn value(node: Node<'_, '_>, key: &str) -> Option<String> {
    let inside = || node.children().find(|n| n.is_element() && n.tag_name().name() == key);
    let text = node.attribute(key).map(str::to_owned).or_else(|| Some(inside()?.text().unwrap_or_default().to_owned()));
    text.map(|text| text.trim().to_owned())
}

/// One that has to be there.
fn needed(node: Node<'_, '_>, key: &str) -> Result<String> {
    value(node, key).ok_or_else(|| xml::wrong(node, format!("{key} of the {}", node.tag_name().name()), None))
}

/// A whole number.
fn id(node: Node<'_, '_>, key: &str) -> Result<i64> {
    let text = needed(node, key)?;
    let expected = || format!("a whole number as {key} of the {}", node.tag_name().name());
    text.parse().map_err(|_| xml::wrong(node, expected(), Some(&text)))
}

/// Numbers.
fn array(node: Node<'_, '_>, key: &str) -> Result<Vec<f64>> {
    needed(node, key)?.split_whitespace().map(|word| xml::finite(node, word, key)).collect()
}
