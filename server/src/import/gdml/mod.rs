//! GDML: detector geometries as volumes placed within volumes.
//!
//! Source: GDML User's Guide 2.8 and Geant4's reader. A solid becomes a flattened OpenSCAD text; a logical volume has a solid, and the
//! volumes that are placed in it. Lengths are millimetres. A rotation of a placement takes the mother's axes to the daughter's, as
//! Geant4 has it: what is placed is turned the other way; in solids that are made of others it is turned as told.

mod expression;
mod origins;
mod solids;
#[cfg(test)]
mod tests;
mod text;

use super::problem::Problem;
use super::scene::SceneError;
use super::{Limits, Note, Place, read_bytes, xml};
use contactd_proto::Pose;
use expression::Names;
use glam::{DMat3, DQuat, DVec3};
use origins::Marks;
pub use origins::Origins;
use roxmltree::Node;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Volumes that are placed in one at most.
const MOST_DAUGHTERS: usize = 1_000_000;

/// A logical volume.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Its name.
    pub name: String,
    /// Where the file has it.
    pub at: Place,
    /// Its solid, a flattened OpenSCAD text in its own frame; empty of an assembly.
    pub text: String,
    /// What is placed in it.
    pub daughters: Vec<Daughter>,
    /// It is placed somewhere.
    pub is_placed: bool,
    /// How far its surface may be off where a part of it is taken in facets, a length: what `Volumes::deviate` has been told.
    pub off: f64,
}

/// A volume that is placed in another one.
#[derive(Clone, Debug)]
pub struct Daughter {
    /// The placement's name, with its copy number where it has one.
    pub name: String,
    /// Where the file has it.
    pub at: Place,
    /// Which volume, by index.
    pub volume: usize,
    /// Its frame in the mother's.
    pub pose: Pose,
}

/// All volumes of the world, those that are placed before those that they are placed in.
#[derive(Clone, Debug, Default)]
pub struct Volumes {
    /// The volumes.
    pub volumes: Vec<Volume>,
    /// What of the file is not in the world that its setup names.
    pub notes: Vec<Note>,
}

/// What is defined, and the solids by name.
struct Geometry<'a, 'i> {
    names: Names,
    positions: HashMap<&'a str, DVec3>,
    rotations: HashMap<&'a str, DVec3>,
    scales: HashMap<&'a str, DVec3>,
    solids: HashMap<&'a str, Node<'a, 'i>>,
    /// Where it is asked which solid a part of a text stands for.
    origins: Option<RefCell<Marks>>,
}

/// Reads a GDML file.
///
/// # Errors
/// One sentence with file, line and column.
pub fn read_gdml(path: &Path) -> std::result::Result<Volumes, SceneError> {
    let file = path.display().to_string();
    let bytes = read_bytes(path, &Limits::default())?;
    read(&bytes).map_err(|(at, problem)| SceneError::of_problem(file, at, problem))
}

fn read(bytes: &[u8]) -> Result<Volumes> {
    Ok(read_with(bytes, None)?.0)
}

/// The volumes, their texts marked where that is asked for.
fn read_with(bytes: &[u8], marks: Option<Marks>) -> Result<(Volumes, Option<Marks>)> {
    let document = xml::parse(bytes)?;
    let root = document.root_element();
    if root.tag_name().name() != "gdml" {
        return Err(xml::wrong(root, "gdml as the root element", Some(root.tag_name().name())));
    }
    only(root, &["define", "materials", "solids", "structure", "setup", "userinfo"])?;
    // The names of the format; those that `Names` has are of the file.
    let unknown = super::names::Names::of(include_str!("gdml.names")).unknown(root);
    let mut geometry = Geometry {
        names: Names::new(),
        positions: HashMap::new(),
        rotations: HashMap::new(),
        scales: HashMap::new(),
        solids: HashMap::new(),
        origins: marks.map(RefCell::new),
    };
    for define in xml::inside(root, "define") {
        geometry.define(define)?;
    }
    for solids in xml::inside(root, "solids") {
        for solid in solids.children().filter(Node::is_element) {
            if solid.tag_name().name() == "loop" {
                return Err((xml::place(solid), Problem::unsupported("<loop>")));
            }
            // Surfaces of optics stand there, too.
            if solid.tag_name().name().ends_with("surface") {
                continue;
            }
            let name = needed(solid, "name")?;
            if geometry.solids.insert(name, solid).is_some() {
                return Err(xml::wrong(solid, "a name that no other solid has", Some(name)));
            }
        }
    }
    let mut out = Volumes::default();
    for (node, text) in unknown {
        out.note(xml::place(node), text);
    }
    let mut index: HashMap<&str, usize> = HashMap::new();
    for structure in xml::inside(root, "structure") {
        for node in structure.children().filter(Node::is_element) {
            let is_assembly = match node.tag_name().name() {
                "volume" => false,
                "assembly" => true,
                // Surfaces of optics.
                "skinsurface" | "bordersurface" => continue,
                "loop" => return Err((xml::place(node), Problem::unsupported("<loop>"))),
                other => return Err(xml::wrong(node, "volumes and assemblies in the structure", Some(other))),
            };
            let name = needed(node, "name")?;
            let volume = geometry.volume(node, is_assembly, &index, &mut out)?;
            if index.insert(name, out.volumes.len()).is_some() {
                return Err(xml::wrong(node, "a name that no other volume has", Some(name)));
            }
            out.volumes.push(volume);
        }
    }
    if out.volumes.is_empty() {
        return Err(xml::wrong(root, "volumes in a structure", None));
    }
    if let Some(setup) = setup(root, &mut out)? {
        let world = xml::inside(setup, "world").next();
        let world = world.ok_or_else(|| xml::wrong(setup, "a world of the setup", None))?;
        let name = needed(world, "ref")?;
        let found = index.get(name).copied();
        out.keep(found.ok_or_else(|| xml::wrong(world, "the name of a volume", Some(name)))?);
    }
    Ok((out, geometry.origins.map(RefCell::into_inner)))
}

/// The setup that counts: the one called Default, as Geant4 takes it, else the first one.
fn setup<'a, 'i>(root: Node<'a, 'i>, out: &mut Volumes) -> Result<Option<Node<'a, 'i>>> {
    let all: Vec<Node<'a, 'i>> = xml::inside(root, "setup").collect();
    let chosen = all.iter().find(|s| s.attribute("name") == Some("Default")).or(all.first()).copied();
    for other in all.iter().filter(|s| Some(**s) != chosen) {
        let name = needed(*other, "name")?;
        out.note(xml::place(*other), format!("the setup {name:?} is left out: another one is taken"));
    }
    Ok(chosen)
}

/// Elements of other names than these would be lost: they are refused.
fn only(node: Node<'_, '_>, known: &[&str]) -> Result<()> {
    match node.children().find(|n| n.is_element() && !known.contains(&n.tag_name().name())) {
        None => Ok(()),
        Some(other) => {
            let known = if known.is_empty() { "nothing".to_owned() } else { format!("one of {}", known.join(", ")) };
            let expected = format!("{known} in the {}", node.tag_name().name());
            Err(xml::wrong(other, expected, Some(other.tag_name().name())))
        }
    }
}

impl Volumes {
    /// Takes in what the imports of its texts have noted of facets, of all volumes that have a solid in order.
    pub fn deviate<'n>(&mut self, notes: impl Iterator<Item = &'n [Note]>) {
        let solid = self.volumes.iter_mut().filter(|v| !v.text.is_empty());
        for (volume, notes) in solid.zip(notes) {
            volume.off = notes.iter().filter_map(Note::facets).fold(0.0, |most, (_, off)| most.max(off));
        }
    }

    fn note(&mut self, at: Place, text: String) {
        self.notes.push(Note { at, text, amount: None });
    }

    /// Keeps a volume and what is placed in it, however deep. Of the others those that are placed nowhere are told.
    fn keep(&mut self, world: usize) {
        let mut is_kept = vec![false; self.volumes.len()];
        is_kept[world] = true;
        let mut open = vec![world];
        while let Some(i) = open.pop() {
            for d in &self.volumes[i].daughters {
                if !std::mem::replace(&mut is_kept[d.volume], true) {
                    open.push(d.volume);
                }
            }
        }
        let name = self.volumes[world].name.clone();
        let left: Vec<usize> = (0..is_kept.len()).filter(|i| !is_kept[*i] && !self.volumes[*i].is_placed).collect();
        for i in left {
            let volume = &self.volumes[i];
            let text = format!("{:?} is left out: it is not in the world {name:?}", volume.name);
            self.note(volume.at, text);
        }
        let mut place = vec![0; is_kept.len()];
        let kept: Vec<usize> = (0..is_kept.len()).filter(|i| is_kept[*i]).collect();
        kept.iter().enumerate().for_each(|(to, from)| place[*from] = to);
        let all = std::mem::take(&mut self.volumes);
        self.volumes = all.into_iter().zip(is_kept).filter(|(_, is_kept)| *is_kept).map(|(volume, _)| volume).collect();
        self.volumes.iter_mut().flat_map(|v| &mut v.daughters).for_each(|d| d.volume = place[d.volume]);
    }
}

impl<'a, 'i> Geometry<'a, 'i> {
    fn define(&mut self, define: Node<'a, 'i>) -> Result<()> {
        for node in define.children().filter(Node::is_element) {
            let kind = node.tag_name().name();
            match kind {
                // What is no length and no angle is a material's; whoever uses its name is told that it is none.
                "quantity" if node.attribute("unit").is_some_and(|unit| expression::unit(unit).is_none()) => {
                    let is_geometry = ["length", "angle", "coordinate", "area", "volume"]
                        .contains(&node.attribute("type").unwrap_or("length"));
                    if is_geometry {
                        return Err(xml::wrong(node, "a unit of length or angle", node.attribute("unit")));
                    }
                }
                "constant" | "variable" | "quantity" => {
                    let value = self.number(node, "value")?;
                    let value = value.ok_or_else(|| xml::wrong(node, format!("a value of the {kind}"), None))?;
                    let unit = node.attribute("unit").map_or(Ok(1.0), |unit| self.unit(node, unit))?;
                    let name = needed(node, "name")?;
                    if !self.names.set(name, value * unit) {
                        return Err(xml::wrong(node, "a name that is no unit or number of its own", Some(name)));
                    }
                }
                "matrix" => {
                    let columns = self.number(node, "coldim")?.unwrap_or(1.0);
                    let words = needed(node, "values")?.split_whitespace();
                    // Energies of optics, as a rule: whoever uses one that has other units is told that it is none.
                    let values: Result<Vec<f64>> = words.map(|word| self.value(node, word)).collect();
                    if let Ok(values) = values {
                        self.names.set_matrix(needed(node, "name")?, (columns as usize).max(1), values);
                    }
                }
                "position" => _ = self.positions.insert(needed(node, "name")?, self.three(node, "mm", 0.0)?),
                "rotation" => _ = self.rotations.insert(needed(node, "name")?, self.three(node, "rad", 0.0)?),
                "scale" => _ = self.scales.insert(needed(node, "name")?, self.three(node, "rad", 1.0)?),
                "loop" => return Err((xml::place(node), Problem::unsupported("<loop>"))),
                "expression" => {
                    let value = self.value(node, node.text().unwrap_or_default())?;
                    let name = needed(node, "name")?;
                    if !self.names.set(name, value) {
                        return Err(xml::wrong(node, "a name that is no unit or number of its own", Some(name)));
                    }
                }
                other => {
                    let known = "one of constant, quantity, variable, expression, matrix, position, rotation, scale in the define";
                    return Err(xml::wrong(node, known, Some(other)));
                }
            }
        }
        Ok(())
    }

    fn value(&self, node: Node<'_, '_>, text: &str) -> Result<f64> {
        self.names.value(text).map_err(|(expected, found)| (xml::place(node), Problem::Syntax { expected, found }))
    }

    /// The value of an attribute, if it is there.
    fn number(&self, node: Node<'_, '_>, key: &str) -> Result<Option<f64>> {
        node.attribute(key).map(|text| self.value(node, text)).transpose()
    }

    fn unit(&self, node: Node<'_, '_>, unit: &str) -> Result<f64> {
        expression::unit(unit).ok_or_else(|| xml::wrong(node, "a unit of length or angle", Some(unit)))
    }

    fn three(&self, node: Node<'_, '_>, unit: &str, none: f64) -> Result<DVec3> {
        let unit = self.unit(node, node.attribute("unit").unwrap_or(unit))?;
        let known = ["x", "y", "z", "unit", "name", "type"];
        if let Some(other) = node.attributes().find(|a| !known.contains(&a.name())) {
            return Err(xml::wrong(node, format!("one of {}", known.join(", ")), Some(other.name())));
        }
        let of = |key: &str| Ok(self.number(node, key)?.map_or(none, |x| x * unit));
        Ok(DVec3::new(of("x")?, of("y")?, of("z")?))
    }

    /// A defined position that an attribute names.
    fn position(&self, node: Node<'_, '_>, key: &str) -> Result<DVec3> {
        let name = needed(node, key)?;
        let known = self.positions.get(name).copied();
        known.ok_or_else(|| xml::wrong(node, "the name of a position", Some(name)))
    }

    /// A vector inside a node, or one that it refers to.
    fn vector(&self, node: Node<'_, '_>, key: &'static str, none: DVec3) -> Result<DVec3> {
        let unit = if key.ends_with("position") { "mm" } else { "rad" };
        if let Some(own) = xml::inside(node, key).next() {
            return self.three(own, unit, none.x);
        }
        let (reference, known) = match key {
            "position" => ("positionref", &self.positions),
            "rotation" => ("rotationref", &self.rotations),
            "firstposition" => ("firstpositionref", &self.positions),
            "firstrotation" => ("firstrotationref", &self.rotations),
            _ => ("scaleref", &self.scales),
        };
        let Some(reference) = xml::inside(node, reference).next() else { return Ok(none) };
        let name = needed(reference, "ref")?;
        match known.get(name) {
            Some(v) => Ok(*v),
            None if ["identity", "center"].contains(&name) => Ok(none),
            None => Err(xml::wrong(reference, "a name that is defined", Some(name))),
        }
    }

    /// Where something is placed; `is_frame`: the rotation is of the axes.
    fn pose(&self, node: Node<'_, '_>, keys: [&'static str; 2], is_frame: bool) -> Result<Pose> {
        let position = self.vector(node, keys[0], DVec3::ZERO)?;
        let angles = self.vector(node, keys[1], DVec3::ZERO)?;
        // About fixed axes, x first.
        let turn =
            DMat3::from_rotation_z(angles.z) * DMat3::from_rotation_y(angles.y) * DMat3::from_rotation_x(angles.x);
        let turn = DQuat::from_mat3(&turn).normalize();
        Ok(Pose::new(position, if is_frame { turn.conjugate() } else { turn }))
    }

    fn volume(
        &self,
        node: Node<'a, 'i>,
        is_assembly: bool,
        index: &HashMap<&str, usize>,
        out: &mut Volumes,
    ) -> Result<Volume> {
        let name = needed(node, "name")?.to_owned();
        let text = if is_assembly {
            String::new()
        } else {
            let solid = xml::inside(node, "solidref").next();
            let solid = solid.ok_or_else(|| xml::wrong(node, "a solidref of the volume", None))?;
            solids::text(self, needed(solid, "ref")?, solid, 0)?
        };
        let of = |node: Node<'_, '_>| {
            if let Some(file) = xml::inside(node, "file").next() {
                return Err((xml::place(file), Problem::unsupported("a volume of another file")));
            }
            let reference = xml::inside(node, "volumeref").next();
            let reference = reference.ok_or_else(|| xml::wrong(node, "a volumeref", None))?;
            let name = needed(reference, "ref")?;
            index.get(name).copied().ok_or_else(|| {
                xml::wrong(reference, "the name of a volume that is defined before it is placed", Some(name))
            })
        };
        let mut daughters = Vec::new();
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "physvol" => {
                    let known = [
                        "volumeref",
                        "file",
                        "position",
                        "positionref",
                        "rotation",
                        "rotationref",
                        "scale",
                        "scaleref",
                        "auxiliary",
                    ];
                    let others = child.children().filter(Node::is_element);
                    if let Some(other) = others.into_iter().find(|n| !known.contains(&n.tag_name().name())) {
                        let name = other.tag_name().name();
                        return Err(xml::wrong(
                            other,
                            format!("one of {} in a placement", known.join(", ")),
                            Some(name),
                        ));
                    }
                    let volume = of(child)?;
                    let own = child.attribute("name").map_or_else(|| out.volumes[volume].name.clone(), str::to_owned);
                    let name = child.attribute("copynumber").map_or(own.clone(), |copy| format!("{own} {copy}"));
                    let scale = self.vector(child, "scale", DVec3::ONE)?;
                    if scale != DVec3::ONE {
                        return Err((
                            xml::place(child),
                            Problem::unsupported("a placement that is scaled or mirrored"),
                        ));
                    }
                    let pose = self.pose(child, ["position", "rotation"], true)?;
                    place(out, &mut daughters, Daughter { name, at: xml::place(child), volume, pose })?;
                }
                "replicavol" => self.replicas(child, of(child)?, out, &mut daughters)?,
                kind @ ("divisionvol" | "paramvol" | "loop") => {
                    return Err((xml::place(child), Problem::unsupported(format!("<{kind}>"))));
                }
                "solidref" if !is_assembly => {}
                // What a volume is made of, and what is said to programs.
                "materialref" | "auxiliary" | "colorref" => {}
                other => return Err(xml::wrong(child, "placements and the solid of a volume", Some(other))),
            }
        }
        Ok(Volume { name, at: xml::place(node), text, daughters, is_placed: false, off: 0.0 })
    }

    /// Copies along an axis, side by side.
    fn replicas(
        &self,
        node: Node<'_, '_>,
        volume: usize,
        out: &mut Volumes,
        daughters: &mut Vec<Daughter>,
    ) -> Result<()> {
        let count = self.number(node, "number")?.unwrap_or(0.0);
        if !(1.0..=MOST_DAUGHTERS as f64).contains(&count) || count.fract() != 0.0 {
            return Err(xml::wrong(node, "a whole number of replicas", node.attribute("number")));
        }
        only(node, &["volumeref", "replicate_along_axis"])?;
        let along = xml::inside(node, "replicate_along_axis").next();
        let along = along.ok_or_else(|| xml::wrong(node, "replicate_along_axis", None))?;
        let part = |name: &'static str| xml::inside(along, name).next();
        let direction = part("direction").ok_or_else(|| xml::wrong(along, "a direction", None))?;
        if direction.attributes().any(|a| ["phi", "rho"].contains(&a.name())) {
            return Err((xml::place(direction), Problem::unsupported("replicas around or away from an axis")));
        }
        let axis = self.three(direction, "rad", 0.0)?;
        let length = |name: &'static str| match part(name) {
            None => Ok(0.0),
            Some(node) => {
                let unit = self.unit(node, node.attribute("unit").unwrap_or("mm"))?;
                Ok(self.number(node, "value")?.unwrap_or(0.0) * unit)
            }
        };
        let (width, offset) = (length("width")?, length("offset")?);
        if width <= 0.0 {
            return Err(xml::wrong(along, "a width of the replicas", Some(&width.to_string())));
        }
        if offset != 0.0 {
            // Geant4 takes none along x, y and z.
            return Err((xml::place(along), Problem::unsupported("an offset of replicas along an axis")));
        }
        for k in 0..count as usize {
            let at = (k as f64 - 0.5 * (count - 1.0)) * width;
            let name = format!("{} {k}", out.volumes[volume].name);
            let pose = Pose::at(axis * at);
            place(out, daughters, Daughter { name, at: xml::place(node), volume, pose })?;
        }
        Ok(())
    }
}

/// Places a volume; of an assembly what is in it.
fn place(out: &mut Volumes, daughters: &mut Vec<Daughter>, placed: Daughter) -> Result<()> {
    let volume = &mut out.volumes[placed.volume];
    volume.is_placed = true;
    let count = if volume.text.is_empty() { volume.daughters.len() } else { 1 };
    if daughters.len() + count > MOST_DAUGHTERS {
        return Err((placed.at, Problem::Limit { what: "volumes placed in one", limit: MOST_DAUGHTERS }));
    }
    if !volume.text.is_empty() {
        daughters.push(placed);
        return Ok(());
    }
    for inner in &volume.daughters {
        let name = format!("{}/{}", placed.name, inner.name);
        daughters.push(Daughter { name, at: inner.at, volume: inner.volume, pose: placed.pose.compose(&inner.pose) });
    }
    Ok(())
}

/// An attribute that has to be there.
fn needed<'a>(node: Node<'a, '_>, attribute: &str) -> Result<&'a str> {
    node.attribute(attribute)
        .ok_or_else(|| xml::wrong(node, format!("{attribute} of the {}", node.tag_name().name()), None))
}
