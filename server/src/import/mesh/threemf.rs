//! 3MF packages (3D Manufacturing Format, core specification 1.3, and the paths of its production extension): the objects that the
//! build names, each where its transforms and those of its components put it.
//!
//! Materials, slices, beams and pictures change no body here. Lengths are the numbers that stand there, in the unit that the file names.

use super::{Bodies, MeshFormat, Place, Polygons, Result};
use crate::import::Limits;
use crate::import::problem::Problem;
use crate::import::xml;
use crate::import::zip::Archive;
use glam::{DAffine3, DVec3};
use roxmltree::Node;
use std::collections::HashMap;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat = MeshFormat { name: "3mf", endings: &["3mf"], read };

/// Components within components.
const DEEPEST: usize = 32;
/// Visits of objects, those without triangles included.
const MOST_VISITS: usize = 100_000;
/// Parts of a package that hold models.
const MOST_PARTS: usize = 1_000;

/// Reads a package.
///
/// # Errors
/// What is wrong with the archive or with a part of it.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    let broken = |found: String| (Place::START, Problem::syntax("a 3MF package", found));
    let archive = Archive::new(bytes).map_err(broken)?;
    let root = root(&archive, limits).map_err(broken)?;
    let mut left = limits.bytes;
    let mut parts: Vec<(String, Vec<u8>)> = Vec::new();
    let mut wanted = vec![root];
    // All parts first, for documents borrow from them.
    while let Some(name) = wanted.pop() {
        if parts.iter().any(|(n, _)| *n == name) {
            continue;
        }
        if parts.len() == MOST_PARTS {
            return Err((Place::START, Problem::Limit { what: "parts of a package", limit: MOST_PARTS }));
        }
        let content = archive.read(&name, left).map_err(broken)?;
        left -= content.len();
        let document = xml::parse(&content).map_err(|e| in_part(&name, e))?;
        let named = document.descendants().filter(|n| ["component", "item"].contains(&n.tag_name().name()));
        wanted.extend(named.filter_map(path_of));
        drop(document);
        parts.push((name, content));
    }
    let mut documents = HashMap::new();
    for (name, content) in &parts {
        documents.insert(name.as_str(), xml::parse(content).map_err(|e| in_part(name, e))?);
    }
    let Some((name, _)) = parts.first() else { return Err(broken("no model".into())) };
    let mut objects = HashMap::new();
    for (part, document) in &documents {
        for resources in xml::inside(document.root_element(), "resources") {
            for object in xml::inside(resources, "object") {
                objects.insert((*part, object.attribute("id").unwrap_or_default()), object);
            }
        }
    }
    let model = documents[name.as_str()].root_element();
    let unit = model.attribute("unit").unwrap_or("millimeter");
    let mut bodies = Bodies::new(format!("lengths in the file's unit, {unit}, +z is up, as 3MF says"));
    let mut package = Package { objects, limits, triangles: 0, visits: 0 };
    for item in xml::inside(model, "build").flat_map(|b| xml::inside(b, "item")) {
        package.place(name, item, DAffine3::IDENTITY, 0, &mut bodies).map_err(|e| match &e.1 {
            Problem::Named { .. } => e,
            _ => in_part(name, e),
        })?;
    }
    if bodies.all.is_empty() {
        return Err(broken("nothing to build in it".into()));
    }
    Ok(bodies)
}

/// The part that is the package's model: its relationships name it.
fn root(archive: &Archive<'_>, limits: &Limits) -> std::result::Result<String, String> {
    let relations = archive.read("_rels/.rels", limits.bytes)?;
    let document = xml::parse(&relations).map_err(|(at, problem)| format!("_rels/.rels:{at}: {problem}"))?;
    let mut all = document.descendants().filter(|n| n.tag_name().name() == "Relationship");
    let of_model = |n: &Node<'_, '_>| n.attribute("Type").is_some_and(|t| t.ends_with("/3dmodel"));
    let target = all.find(of_model).and_then(|n| n.attribute("Target"));
    let target = target.or_else(|| archive.names().find(|n| n.ends_with(".model")));
    target.map(|t| t.trim_start_matches('/').to_owned()).ok_or_else(|| "no model in the archive".into())
}

/// Something wrong in a part of the package.
fn in_part(name: &str, (at, problem): (Place, Problem)) -> (Place, Problem) {
    (Place::START, Problem::Named { file: name.to_owned(), at, problem: problem.into() })
}

/// The part that the production extension says an object is in.
fn path_of(node: Node<'_, '_>) -> Option<String> {
    let path = node.attributes().find(|a| a.name() == "path" && a.namespace().is_some())?;
    Some(path.value().trim_start_matches('/').to_owned())
}

struct Package<'d, 'i, 'l> {
    /// By part and id.
    objects: HashMap<(&'d str, &'d str), Node<'d, 'i>>,
    limits: &'l Limits,
    triangles: usize,
    visits: usize,
}

impl Package<'_, '_, '_> {
    /// Adds the bodies of the object that an item or a component of `part` names.
    fn place(
        &mut self,
        part: &str,
        node: Node<'_, '_>,
        outer: DAffine3,
        depth: usize,
        bodies: &mut Bodies,
    ) -> Result<()> {
        self.visits += 1;
        if depth > DEEPEST || self.visits > MOST_VISITS {
            let (what, limit) = match depth > DEEPEST {
                true => ("levels of components", DEEPEST),
                false => ("objects of a package", MOST_VISITS),
            };
            return Err((xml::place(node), Problem::Limit { what, limit }));
        }
        let of = path_of(node);
        let inside = of.as_deref().unwrap_or(part);
        let id = node.attribute("objectid").unwrap_or_default();
        let Some(&object) = self.objects.get(&(inside, id)) else {
            return Err(xml::wrong(node, "the id of an object", Some(id)));
        };
        if matches!(object.attribute("type"), Some("other" | "support")) && depth == 0 {
            bodies.leave(&format!("object of type {}", object.attribute("type").unwrap_or_default()));
            return Ok(());
        }
        let outer = outer * transform(node)?;
        for mesh in xml::inside(object, "mesh") {
            let body = self.mesh(mesh, outer).map_err(|e| if of.is_some() { in_part(inside, e) } else { e })?;
            bodies.all.extend(body);
        }
        for component in xml::inside(object, "components").flat_map(|c| xml::inside(c, "component")) {
            self.place(inside, component, outer, depth + 1, bodies).map_err(|e| match (&of, &e.1) {
                (None, _) | (Some(_), Problem::Named { .. }) => e,
                (Some(_), _) => in_part(inside, e),
            })?;
        }
        Ok(())
    }

    fn mesh(&mut self, mesh: Node<'_, '_>, outer: DAffine3) -> Result<Option<Polygons>> {
        let mut polygons = Polygons::default();
        for vertex in xml::inside(mesh, "vertices").flat_map(|v| xml::inside(v, "vertex")) {
            let coordinate = |name: &str| {
                xml::number(vertex, name)?.ok_or_else(|| xml::wrong(vertex, format!("{name} of a vertex"), None))
            };
            polygons.points.push(DVec3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?));
        }
        let count = polygons.points.len();
        for triangle in xml::inside(mesh, "triangles").flat_map(|t| xml::inside(t, "triangle")) {
            let mut face = Vec::with_capacity(3);
            for name in ["v1", "v2", "v3"] {
                let word = triangle.attribute(name);
                match word.and_then(|w| w.trim().parse::<u32>().ok()).filter(|i| (*i as usize) < count) {
                    Some(i) => face.push(i),
                    None => {
                        return Err(xml::wrong(triangle, format!("a vertex's number below {count} as {name}"), word));
                    }
                }
            }
            polygons.add(&face, || xml::place(triangle), &mut self.triangles, self.limits)?;
        }
        Ok((!polygons.is_empty()).then(|| polygons.placed(&outer)))
    }
}

/// The transform of an item or a component: the rows of a matrix that a row of coordinates is multiplied with.
fn transform(node: Node<'_, '_>) -> Result<DAffine3> {
    let Some(text) = node.attribute("transform") else { return Ok(DAffine3::IDENTITY) };
    let mut numbers = [0.0; 12];
    let mut words = text.split_whitespace();
    for n in &mut numbers {
        *n = xml::finite(node, words.next().unwrap_or_default(), "transform")?;
    }
    match words.next() {
        None => Ok(DAffine3::from_cols_array(&numbers)),
        Some(_) => Err(xml::wrong(node, "twelve numbers as transform", Some(text))),
    }
}
