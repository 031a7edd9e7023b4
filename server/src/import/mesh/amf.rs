//! AMF files (ISO/ASTM 52915), packed in an archive or not: the volumes of its objects, where its constellations put them.
//!
//! Colours, materials, textures, normals and curved triangles are not read. An object that no constellation names stands as it is.

use super::{Bodies, MeshFormat, Place, Polygons, Result};
use crate::import::problem::Problem;
use crate::import::zip::{Archive, is_archive};
use crate::import::{Limits, xml};
use glam::{DAffine3, DMat3, DVec3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat = MeshFormat { name: "amf", endings: &["amf"], read };

/// Constellations within constellations.
const DEEPEST: usize = 32;
/// Instances of objects.
const MOST_VISITS: usize = 100_000;

/// Reads a file.
///
/// # Errors
/// What is wrong, with its place; within an archive in the file that it holds.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    if !is_archive(bytes) {
        return of_text(bytes, limits);
    }
    let broken = |found: String| (Place::START, Problem::syntax("a packed AMF file", found));
    let archive = Archive::new(bytes).map_err(broken)?;
    let named = archive.names().find(|n| n.to_ascii_lowercase().ends_with(".amf"));
    let only = || archive.names().next().filter(|_| archive.names().count() == 1);
    let name = named.or_else(only).ok_or_else(|| broken("no .amf in it".into()))?.to_owned();
    let content = archive.read(&name, limits.bytes).map_err(broken)?;
    of_text(&content, limits)
        .map_err(|(at, problem)| (Place::START, Problem::Named { file: name, at, problem: problem.into() }))
}

fn of_text(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    let document = xml::parse(bytes)?;
    let root = document.root_element();
    if root.tag_name().name() != "amf" {
        return Err(xml::wrong(root, "an element amf", Some(root.tag_name().name())));
    }
    let unit = root.attribute("unit").unwrap_or("millimeter");
    let mut bodies = Bodies::new(format!("lengths in the file's unit, {unit}, +z is up, as AMF says"));
    let named = |name: &'static str| {
        let all = xml::inside(root, name);
        all.map(|n| (n.attribute("id").unwrap_or_default(), n)).collect::<HashMap<&str, Node<'_, '_>>>()
    };
    let (objects, groups) = (named("object"), named("constellation"));
    let instanced: HashSet<&str> = xml::inside(root, "constellation")
        .flat_map(|c| xml::inside(c, "instance"))
        .filter_map(|i| i.attribute("objectid"))
        .collect();
    let mut file = File { objects, groups, limits, triangles: 0, visits: 0 };
    for object in xml::inside(root, "object") {
        if !instanced.contains(object.attribute("id").unwrap_or_default()) {
            bodies.all.extend(file.object(object, &DAffine3::IDENTITY)?);
        }
    }
    for group in xml::inside(root, "constellation") {
        if !instanced.contains(group.attribute("id").unwrap_or_default()) {
            file.group(group, DAffine3::IDENTITY, 0, &mut bodies)?;
        }
    }
    if bodies.all.is_empty() {
        return Err(xml::wrong(root, "an object with a triangle", None));
    }
    Ok(bodies)
}

struct File<'d, 'i, 'l> {
    objects: HashMap<&'d str, Node<'d, 'i>>,
    groups: HashMap<&'d str, Node<'d, 'i>>,
    limits: &'l Limits,
    triangles: usize,
    visits: usize,
}

/// What stands in an element within another one.
fn text_of<'a>(node: Node<'a, '_>, name: &'static str) -> Option<&'a str> {
    xml::inside(node, name).next().map(|n| n.text().unwrap_or_default().trim())
}

impl File<'_, '_, '_> {
    fn group(&mut self, group: Node<'_, '_>, outer: DAffine3, depth: usize, bodies: &mut Bodies) -> Result<()> {
        for instance in xml::inside(group, "instance") {
            self.visits += 1;
            if depth > DEEPEST || self.visits > MOST_VISITS {
                let limit = Problem::Limit { what: "instances within instances", limit: MOST_VISITS };
                return Err((xml::place(instance), limit));
            }
            let number = |name: &'static str| match text_of(instance, name) {
                None => Ok(0.0),
                Some(word) => xml::finite(instance, word, name),
            };
            let [rx, ry, rz] = [number("rx")?, number("ry")?, number("rz")?].map(f64::to_radians);
            // About the axes one after another, x first.
            let turn = DMat3::from_rotation_z(rz) * DMat3::from_rotation_y(ry) * DMat3::from_rotation_x(rx);
            let shift = DVec3::new(number("deltax")?, number("deltay")?, number("deltaz")?);
            let inner = outer * DAffine3::from_mat3_translation(turn, shift);
            let id = instance.attribute("objectid").unwrap_or_default();
            if let Some(&object) = self.objects.get(id) {
                bodies.all.extend(self.object(object, &inner)?);
            } else if let Some(&inside) = self.groups.get(id) {
                self.group(inside, inner, depth + 1, bodies)?;
            } else {
                return Err(xml::wrong(instance, "the id of an object", Some(id)));
            }
        }
        Ok(())
    }

    /// The volumes of an object.
    fn object(&mut self, object: Node<'_, '_>, outer: &DAffine3) -> Result<Vec<Polygons>> {
        let mut all = Vec::new();
        for mesh in xml::inside(object, "mesh") {
            let mut points = Vec::new();
            for vertex in xml::inside(mesh, "vertices").flat_map(|v| xml::inside(v, "vertex")) {
                let missing = |what: &str| xml::wrong(vertex, format!("{what} of a vertex"), None);
                let at = xml::inside(vertex, "coordinates").next().ok_or_else(|| missing("coordinates"))?;
                let number =
                    |name: &'static str| xml::finite(at, text_of(at, name).ok_or_else(|| missing(name))?, name);
                points.push(DVec3::new(number("x")?, number("y")?, number("z")?));
            }
            for volume in xml::inside(mesh, "volume") {
                let mut polygons = Polygons { points: points.clone(), ..Polygons::default() };
                for triangle in xml::inside(volume, "triangle") {
                    let mut face = Vec::with_capacity(3);
                    for name in ["v1", "v2", "v3"] {
                        let word = text_of(triangle, name);
                        match word.and_then(|w| w.parse::<u32>().ok()).filter(|i| (*i as usize) < points.len()) {
                            Some(i) => face.push(i),
                            None => {
                                let expected = format!("a vertex's number below {} as {name}", points.len());
                                return Err(xml::wrong(triangle, expected, word));
                            }
                        }
                    }
                    polygons.add(&face, || xml::place(triangle), &mut self.triangles, self.limits)?;
                }
                if !polygons.is_empty() {
                    all.push(polygons.used().placed(outer));
                }
            }
        }
        Ok(all)
    }
}
