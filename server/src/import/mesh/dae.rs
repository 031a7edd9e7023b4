//! Collada files (.dae, 1.4 and 1.5): the meshes of the scene, each where its nodes' transforms put it, in metres and with +z up.
//!
//! Source: khronos.org/collada. Unlike other formats' its unit and its axes are applied: robots' files name such meshes and count in
//! metres. A geometry's primitives are one body: they differ in material, and are closed together. Materials, normals, lines,
//! animations and cameras are not read; skins and what is no mesh are left out, with a note.

use super::{Bodies, MeshFormat, Polygons, Result};
use crate::import::problem::Problem;
use crate::import::{Limits, xml};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use roxmltree::Node;
use std::collections::HashMap;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat = MeshFormat { name: "dae", endings: &["dae"], read };

/// Nodes within nodes.
const DEEPEST: usize = 256;
/// Visits of nodes.
const MOST_VISITS: usize = 100_000;

/// Reads a file.
///
/// # Errors
/// What is wrong with it, and where.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    let document = xml::parse(bytes)?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(xml::wrong(root, "an element COLLADA", Some(root.tag_name().name())));
    }
    let (frame, what) = frame_of(root)?;
    let ids: HashMap<&str, Node<'_, '_>> =
        root.descendants().filter_map(|n| n.attribute("id").map(|id| (id, n))).collect();
    let mut file = File { ids, limits, triangles: 0, visits: 0, bodies: Bodies::new(what) };
    match xml::inside(root, "scene").flat_map(|s| xml::inside(s, "instance_visual_scene")).next() {
        Some(instance) => {
            let scene = file.target(instance, "url", "visual_scene")?;
            for node in xml::inside(scene, "node") {
                file.node(node, frame, 0)?;
            }
        }
        None => {
            for library in xml::inside(root, "library_geometries") {
                for geometry in xml::inside(library, "geometry") {
                    file.geometry(geometry, &frame)?;
                }
            }
        }
    }
    if file.bodies.all.is_empty() {
        return Err(xml::wrong(root, "a mesh of triangles in the scene", None));
    }
    Ok(file.bodies)
}

/// From the file's unit and axes to metres with +z up; and a sentence about them.
fn frame_of(root: Node<'_, '_>) -> Result<(DAffine3, String)> {
    let asset = xml::inside(root, "asset").next();
    let unit = asset.and_then(|a| xml::inside(a, "unit").next());
    let metres = match unit {
        Some(unit) => xml::number(unit, "meter")?.unwrap_or(1.0),
        None => 1.0,
    };
    if metres <= 0.0 {
        return Err(xml::wrong(unit.unwrap_or(root), "a unit longer than 0", Some(&metres.to_string())));
    }
    let axis = asset.and_then(|a| xml::inside(a, "up_axis").next());
    let word = axis.and_then(|a| a.text()).map_or("Y_UP", str::trim);
    // The specification's right, up and towards the viewer become x, z and -y.
    let (name, turn) = match word {
        "X_UP" => ("x", DMat3::from_cols(DVec3::Z, -DVec3::X, -DVec3::Y)),
        "Y_UP" => ("y", DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y)),
        "Z_UP" => ("z", DMat3::IDENTITY),
        other => return Err(xml::wrong(axis.unwrap_or(root), "X_UP, Y_UP or Z_UP as the up_axis", Some(other))),
    };
    let what = format!("lengths in units of {metres} m, +{name} is up, as the file says: taken in metres, +z up");
    Ok((DAffine3::from_mat3(turn * metres), what))
}

struct File<'d, 'i, 'l> {
    ids: HashMap<&'d str, Node<'d, 'i>>,
    limits: &'l Limits,
    triangles: usize,
    visits: usize,
    bodies: Bodies,
}

/// Numbers that stand in an element.
fn numbers(node: Node<'_, '_>) -> Result<Vec<f64>> {
    let words = node.text().unwrap_or_default().split_ascii_whitespace();
    words.map(|word| xml::finite(node, word, "a number")).collect()
}

/// As many numbers as an element has to have.
fn some<const N: usize>(node: Node<'_, '_>) -> Result<[f64; N]> {
    let all = numbers(node)?;
    let expected = || format!("{N} numbers in {}", node.tag_name().name());
    all.as_slice().try_into().map_err(|_| xml::wrong(node, expected(), Some(&all.len().to_string())))
}

/// Whole numbers that stand in an element.
fn indices(node: Node<'_, '_>) -> Result<Vec<usize>> {
    let words = node.text().unwrap_or_default().split_ascii_whitespace();
    words.map(|word| word.parse().map_err(|_| xml::wrong(node, "a whole number", Some(word)))).collect()
}

impl<'d, 'i> File<'d, 'i, '_> {
    /// The element that an attribute leads to, which is called `kind`.
    fn target(&self, node: Node<'d, 'i>, attribute: &str, kind: &str) -> Result<Node<'d, 'i>> {
        let word = node.attribute(attribute);
        let found = word.and_then(|w| w.strip_prefix('#')).and_then(|id| self.ids.get(id));
        let found = found.filter(|n| n.tag_name().name() == kind);
        let name = node.tag_name().name();
        found.copied().ok_or_else(|| xml::wrong(node, format!("a {kind} of the file as {attribute} of {name}"), word))
    }

    fn node(&mut self, node: Node<'d, 'i>, outer: DAffine3, depth: usize) -> Result<()> {
        self.visits += 1;
        if depth > DEEPEST || self.visits > MOST_VISITS {
            let (what, limit) = match depth > DEEPEST {
                true => ("nodes within each other", DEEPEST),
                false => ("nodes of a scene", MOST_VISITS),
            };
            return Err((xml::place(node), Problem::Limit { what, limit }));
        }
        let mut place = outer;
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "matrix" => {
                    let m = DMat4::from_cols_array(&some::<16>(child)?).transpose();
                    place *= DAffine3::from_mat4(m);
                }
                "translate" => place *= DAffine3::from_translation(some::<3>(child)?.into()),
                "scale" => place *= DAffine3::from_scale(some::<3>(child)?.into()),
                "rotate" => {
                    let [x, y, z, degrees] = some::<4>(child)?;
                    // About no axis it is no turn.
                    if let Some(axis) = DVec3::new(x, y, z).try_normalize() {
                        place *= DAffine3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()));
                    }
                }
                other @ ("lookat" | "skew") => {
                    return Err(xml::wrong(child, "matrix, translate, rotate or scale as a transform", Some(other)));
                }
                _ => {}
            }
        }
        if !place.is_finite() {
            return Err(xml::wrong(node, "finite numbers as transforms", None));
        }
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "node" => self.node(child, place, depth + 1)?,
                "instance_node" => self.node(self.target(child, "url", "node")?, place, depth + 1)?,
                "instance_geometry" => self.geometry(self.target(child, "url", "geometry")?, &place)?,
                "instance_controller" => {
                    let name = child.attribute("url").unwrap_or_default();
                    self.bodies.leave(&format!("skin or morph {name:?}"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, geometry: Node<'d, 'i>, place: &DAffine3) -> Result<()> {
        let name = geometry.attribute("id").unwrap_or_default();
        let Some(mesh) = xml::inside(geometry, "mesh").next() else {
            self.bodies.leave(&format!("geometry {name:?}, which is no mesh"));
            return Ok(());
        };
        let mut body = Polygons::default();
        // Where the points of each list begin.
        let mut known: HashMap<&str, (usize, usize)> = HashMap::new();
        for primitive in mesh.children().filter(Node::is_element) {
            match primitive.tag_name().name() {
                "triangles" | "polylist" | "polygons" | "trifans" | "tristrips" => {
                    self.primitive(primitive, &mut body, &mut known)?;
                }
                kind @ ("lines" | "linestrips") => self.bodies.leave(&format!("{kind} of {name:?}")),
                _ => {}
            }
        }
        if !body.is_empty() {
            self.bodies.all.push(body.used().placed(place));
        }
        Ok(())
    }

    /// The points that a primitive's corners are of: where they begin in the body and how many there are.
    fn points(
        &self,
        input: Node<'d, 'i>,
        body: &mut Polygons,
        known: &mut HashMap<&'d str, (usize, usize)>,
    ) -> Result<(usize, usize)> {
        let vertices = self.target(input, "source", "vertices")?;
        let id = vertices.attribute("id").unwrap_or_default();
        if let Some(found) = known.get(id) {
            return Ok(*found);
        }
        let position = xml::inside(vertices, "input").find(|i| i.attribute("semantic") == Some("POSITION"));
        let position = position.ok_or_else(|| xml::wrong(vertices, "an input POSITION of the vertices", None))?;
        let source = self.target(position, "source", "source")?;
        let accessor = xml::inside(source, "technique_common").flat_map(|t| xml::inside(t, "accessor")).next();
        let accessor = accessor.ok_or_else(|| xml::wrong(source, "an accessor of the source", None))?;
        let whole = |key: &str, none: usize| match accessor.attribute(key) {
            None => Ok(none),
            Some(word) => {
                word.trim().parse().map_err(|_| xml::wrong(accessor, format!("a whole number as {key}"), Some(word)))
            }
        };
        let (count, stride, offset) = (whole("count", 0)?, whole("stride", 1)?, whole("offset", 0)?);
        let all = numbers(self.target(accessor, "source", "float_array")?)?;
        let end = count.checked_mul(stride).and_then(|n| n.checked_add(offset));
        if stride < 3 || end.is_none_or(|end| end > all.len()) {
            let expected = format!("an accessor of three coordinates a point within {} numbers", all.len());
            return Err(xml::wrong(accessor, expected, Some(&format!("{count} of {stride} from {offset}"))));
        }
        let found = (body.points.len(), count);
        body.points.extend(all[offset..].chunks_exact(stride).take(count).map(DVec3::from_slice));
        known.insert(id, found);
        Ok(found)
    }

    /// Faces of one material.
    fn primitive(
        &mut self,
        node: Node<'d, 'i>,
        body: &mut Polygons,
        known: &mut HashMap<&'d str, (usize, usize)>,
    ) -> Result<()> {
        let offset = |input: Node<'_, '_>| -> Result<usize> {
            let word = input.attribute("offset").unwrap_or("0");
            let number = word.trim().parse().ok().filter(|n| *n < 64);
            number.ok_or_else(|| xml::wrong(input, "an offset below 64", Some(word)))
        };
        let (mut stride, mut vertex) = (1, None);
        for input in xml::inside(node, "input") {
            let at = offset(input)?;
            stride = stride.max(at + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                vertex = Some((input, at));
            }
        }
        let Some((input, at)) = vertex else { return Err(xml::wrong(node, "an input VERTEX", None)) };
        let (first, count) = self.points(input, body, known)?;
        let corners = |list: Node<'_, '_>| -> Result<Vec<u32>> {
            let all = indices(list)?;
            let own = all.chunks_exact(stride).map(|c| c[at]);
            let corner = |i: usize| (i < count).then_some((first + i) as u32);
            own.map(|i| {
                corner(i)
                    .ok_or_else(|| xml::wrong(list, format!("a point's number below {count}"), Some(&i.to_string())))
            })
            .collect()
        };
        if xml::inside(node, "ph").next().is_some() {
            self.bodies.leave("polygons with holes");
        }
        let lists: Vec<Node<'_, '_>> = xml::inside(node, "p").collect();
        let mut faces: Vec<Vec<u32>> = Vec::new();
        for list in lists {
            let all = corners(list)?;
            match node.tag_name().name() {
                "triangles" => faces.extend(all.chunks_exact(3).map(<[u32]>::to_vec)),
                "polygons" => faces.push(all),
                "trifans" => {
                    faces.extend(all.get(1..).unwrap_or_default().windows(2).map(|w| vec![all[0], w[0], w[1]]))
                }
                // Every other triangle of a strip runs the other way round.
                "tristrips" => faces.extend(all.windows(3).enumerate().map(|(i, w)| match i % 2 {
                    0 => w.to_vec(),
                    _ => vec![w[1], w[0], w[2]],
                })),
                _ => faces.extend(split(node, &all)?),
            }
        }
        for face in faces.iter().filter(|f| f.len() >= 3) {
            body.add(face, || xml::place(node), &mut self.triangles, self.limits)?;
        }
        Ok(())
    }
}

/// The faces of a list of corners, as many of each as `vcount` says.
fn split(node: Node<'_, '_>, all: &[u32]) -> Result<Vec<Vec<u32>>> {
    let counts =
        xml::inside(node, "vcount").next().ok_or_else(|| xml::wrong(node, "a vcount of the polylist", None))?;
    let (mut faces, mut from) = (Vec::new(), 0usize);
    for count in indices(counts)? {
        let face = from.checked_add(count).and_then(|to| all.get(from..to));
        let face = face.ok_or_else(|| xml::wrong(counts, "corners for each face", Some(&all.len().to_string())))?;
        faces.push(face.to_vec());
        from += count;
    }
    Ok(faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use std::fmt::Write as _;

    /// A box as a file says it: its corners, and six faces that run counter-clockwise from outside.
    const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

    fn corner(half: DVec3, i: u32) -> DVec3 {
        half * DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1)).map(|c| 2.0 * c - 1.0)
    }

    /// The six faces as one of the five kinds of primitives.
    fn primitive(kind: usize) -> String {
        // Two numbers a corner: a normal's, which means nothing here, and the point's.
        let list = |face: &[u32]| face.iter().map(|i| format!("9 {i} ")).collect::<String>();
        let inputs = "<input semantic='NORMAL' source='#none' offset='0'/>\
                      <input semantic='VERTEX' source='#vertices' offset='1'/>";
        let each = |of: &dyn Fn(&[u32; 4]) -> String| FACES.iter().map(of).collect::<String>();
        let (name, content) = match kind {
            0 => {
                let both = |f: &[u32; 4]| list(&[f[0], f[1], f[2]]) + &list(&[f[0], f[2], f[3]]);
                ("triangles", format!("<p>{}</p>", each(&both)))
            }
            1 => ("polylist", format!("<vcount>4 4 4 4 4 4</vcount><p>{}</p>", each(&|f| list(f)))),
            2 => ("polygons", each(&|f| format!("<p>{}</p>", list(f)))),
            3 => ("trifans", each(&|f| format!("<p>{}</p>", list(f)))),
            _ => ("tristrips", each(&|f| format!("<p>{}</p>", list(&[f[0], f[1], f[3], f[2]])))),
        };
        format!("<{name} count='6'>{inputs}{content}</{name}>")
    }

    /// A random transform as elements, and where it puts a point.
    fn transform(r: &mut Random) -> (String, DAffine3) {
        let (mut text, mut all) = (String::new(), DAffine3::IDENTITY);
        for _ in 0..(r.unit() * 4.0) as u32 {
            let v = r.vector(2.0);
            let one = match (r.unit() * 4.0) as u32 {
                0 => {
                    write!(text, "<translate>{} {} {}</translate>", v.x, v.y, v.z).unwrap();
                    DAffine3::from_translation(v)
                }
                1 => {
                    let s = v.abs() + 0.3;
                    let s = if r.unit() < 0.5 { s } else { s * DVec3::new(1.0, -1.0, 1.0) };
                    write!(text, "<scale>{} {} {}</scale>", s.x, s.y, s.z).unwrap();
                    DAffine3::from_scale(s)
                }
                2 => {
                    let degrees = 200.0 * (r.unit() - 0.5);
                    write!(text, "<rotate>{} {} {} {degrees}</rotate>", v.x, v.y, v.z).unwrap();
                    DAffine3::from_axis_angle(v.normalize(), degrees.to_radians())
                }
                _ => {
                    let q = DQuat::from_rotation_y(v.x) * DQuat::from_rotation_x(v.y);
                    let a = DAffine3::from_rotation_translation(q, v);
                    let [x, y, z] = [a.matrix3.x_axis, a.matrix3.y_axis, a.matrix3.z_axis];
                    let row = |k: usize| format!("{} {} {} {} ", x[k], y[k], z[k], a.translation[k]);
                    write!(text, "<matrix>{}{}{}0 0 0 1</matrix>", row(0), row(1), row(2)).unwrap();
                    a
                }
            };
            all *= one;
        }
        (text, all)
    }

    /// The corners of random boxes under random nodes are where an own sum of the same transforms puts them, in metres with z up,
    /// and each box holds its volume with the faces running the right way round.
    #[test]
    fn boxes_stand_where_their_nodes_put_them() {
        let mut r = Random(11);
        for round in 0..400 {
            let half = r.vector(1.0).abs() + 0.1;
            let (outer, a) = transform(&mut r);
            let (inner, b) = transform(&mut r);
            let metres = [1.0, 0.01, 0.0254][round % 3];
            let up = round % 4;
            let axis = ["<up_axis>X_UP</up_axis>", "<up_axis>Y_UP</up_axis>", "<up_axis>Z_UP</up_axis>", ""][up];
            let points: String =
                (0..8).map(|i| corner(half, i)).map(|p| format!("0.5 {} {} {}\n", p.x, p.y, p.z)).collect();
            let text = format!(
                "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema'><asset><unit meter='{metres}'/>{axis}</asset>\
                 <library_geometries><geometry id='box'><mesh><source id='p'><float_array id='a'>{points}</float_array>\
                 <technique_common><accessor source='#a' count='8' stride='4' offset='1'/></technique_common></source>\
                 <vertices id='vertices'><input semantic='POSITION' source='#p'/></vertices>{}</mesh></geometry>\
                 </library_geometries><library_nodes><node id='n'>{inner}<instance_geometry url='#box'/></node></library_nodes>\
                 <library_visual_scenes><visual_scene id='s'><node>{outer}<instance_node url='#n'/></node></visual_scene>\
                 </library_visual_scenes><scene><instance_visual_scene url='#s'/></scene></COLLADA>",
                primitive(round % 5)
            );
            // The accessor's offset leaves the last point's fourth number out: one more stands at the end.
            let text = text.replace("</float_array>", "0</float_array>");
            let bodies = read(text.as_bytes(), &Limits::default()).unwrap_or_else(|e| panic!("{e:?}: {text}"));
            let [body] = bodies.all.as_slice() else { panic!("{} bodies", bodies.all.len()) };
            let stand = |i: u32| {
                let p = metres * (a * b).transform_point3(corner(half, i));
                match up {
                    0 => DVec3::new(-p.y, -p.z, p.x),
                    2 => p,
                    _ => DVec3::new(p.x, -p.z, p.y),
                }
            };
            for i in 0..8 {
                let near = body.points.iter().map(|p| p.distance(stand(i))).fold(f64::INFINITY, f64::min);
                assert!(near < 1e-9, "{near}: {text}");
            }
            let volume: f64 = body
                .faces()
                .flat_map(|f| (1..f.len() - 1).map(|k| [f[0], f[k], f[k + 1]]))
                .map(|[i, j, k]| {
                    let at = |i: u32| body.points[i as usize];
                    at(i).dot(at(j).cross(at(k))) / 6.0
                })
                .sum();
            let whole = 8.0 * half.element_product() * (a * b).matrix3.determinant().abs() * metres.powi(3);
            assert!((volume - whole).abs() < 1e-9 * whole.max(1.0), "{volume} {whole}: {text}");
        }
    }

    #[test]
    fn what_is_wrong_has_its_place() {
        let of = |text: &str| {
            let (at, problem) = read(text.as_bytes(), &Limits::default()).expect_err(text);
            format!("{at}: {problem}")
        };
        let geometry = |p: &str, vertices: &str| {
            format!(
                "<COLLADA>\n<library_geometries><geometry id='g'><mesh><source id='p'><float_array id='a'>0 0 0 1 0 0</float_array>\
                 <technique_common><accessor source='#a' count='2' stride='3'/></technique_common></source>{vertices}\
                 <triangles><input semantic='VERTEX' source='#v' offset='0'/>\n<p>{p}</p></triangles></mesh></geometry>\
                 </library_geometries></COLLADA>"
            )
        };
        let vertices = "<vertices id='v'><input semantic='POSITION' source='#p'/></vertices>";
        for (text, sentence) in [
            ("<robot/>".to_owned(), "1:1: expected an element COLLADA, found \"robot\""),
            ("<COLLADA/>".to_owned(), "1:1: expected a mesh of triangles in the scene, found none"),
            (geometry("0 1 2", vertices), "3:1: expected a point's number below 2, found \"2\""),
            (geometry("0 1 x", vertices), "3:1: expected a whole number, found \"x\""),
            (geometry("0 1 1", ""), "expected a vertices of the file as source of input, found \"#v\""),
            (
                "<COLLADA><asset><up_axis>W_UP</up_axis></asset></COLLADA>".to_owned(),
                "1:17: expected X_UP, Y_UP or Z_UP as the up_axis, found \"W_UP\"",
            ),
        ] {
            let told = of(&text);
            assert!(told.ends_with(sentence) && (sentence.starts_with('e') || told == sentence), "{told}");
        }
    }
}
