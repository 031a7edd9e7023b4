//! MJCF: MuJoCo's bodies, joints and geoms, with its defaults, its compiler's angles, its masks and its filters.
//!
//! Source: mujoco.readthedocs.io/en/stable/XMLreference.html. Geoms collide where contype and conaffinity say so; never those of bodies
//! that are welded to each other, nor of a body and its parent unless that is the world. Meshes are their convex hulls. Geoms of which
//! both masks are 0 are seen and do not collide: they are not read.

use super::super::problem::Problem;
use super::super::xml;
use super::kinematics::{Dof, DofKind, Link, Part, Robot};
use super::reader::Reader;
use super::shape::{Shape, union};
use super::urdf::{Result, needed, not_negative, numbers_of, vector_of};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DMat3, DQuat, DVec3};
use roxmltree::{Document, Node};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Bodies within bodies.
const DEEPEST: usize = 200;

pub(super) fn read(root: Node<'_, '_>, reader: &Reader<'_>) -> Result<Robot> {
    // Other files are put in first: defaults and meshes may stand in any of them.
    let mut texts: Vec<(PathBuf, String)> = Vec::new();
    included(root, reader.folder(), &mut texts, 0)?;
    let documents: Vec<Document<'_>> = texts
        .iter()
        .map(|(path, text)| {
            xml::parse(text.as_bytes()).map_err(|(at, e)| {
                let file = path.display().to_string();
                (xml::place(root), Problem::Named { file, at, problem: Box::new(e) })
            })
        })
        .collect::<Result<_>>()?;
    let files: HashMap<&Path, Node<'_, '_>> =
        texts.iter().zip(&documents).map(|((path, _), document)| (path.as_path(), document.root_element())).collect();
    let roots: Vec<Node<'_, '_>> = std::iter::once(root).chain(documents.iter().map(Document::root_element)).collect();
    let mut model = Model::new(&roots, reader)?;
    model.files = files;
    model.robot.name = root.attribute("model").unwrap_or_default().to_owned();
    let world = Link {
        name: "world".into(),
        at: xml::place(root),
        parent: None,
        origin: Pose::IDENTITY,
        dofs: vec![],
        parts: vec![],
        is_free: false,
        is_static: true,
    };
    model.robot.links.push(world);
    let top: Vec<Node<'_, '_>> = sections(&roots, "worldbody").collect();
    for worldbody in top {
        let folder = reader.folder().to_owned();
        model.content(worldbody, &At { link: 0, frame: Pose::IDENTITY, class: None, folder, depth: 0 })?;
    }
    model.finish(&roots)
}

/// The sections of a name, in all files.
fn sections<'a, 'i>(roots: &'a [Node<'a, 'i>], name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    roots.iter().flat_map(move |root| xml::inside(*root, name))
}

/// The texts that are included, each once. Names are relative to the main file's folder.
fn included(node: Node<'_, '_>, folder: &Path, texts: &mut Vec<(PathBuf, String)>, depth: usize) -> Result<()> {
    for include in node.descendants().filter(|n| n.is_element() && n.tag_name().name() == "include") {
        let path = folder.join(needed(include, "file")?);
        let wrong = |e: String| xml::wrong(include, format!("the included file {}", path.display()), Some(&e));
        if texts.iter().any(|(known, _)| *known == path) {
            return Err(wrong("a file that is included twice".into()));
        }
        let within = include.parent().map(|p| p.tag_name().name().to_owned()).unwrap_or_default();
        if !["mujoco", "mujocoinclude", "worldbody", "body", "frame"].contains(&within.as_str()) {
            return Err((xml::place(include), Problem::unsupported(format!("<include> within <{within}>"))));
        }
        if depth > 16 {
            return Err(wrong("files that include each other".into()));
        }
        let bytes = super::super::read_bytes(&path, &super::super::Limits::default());
        let bytes = bytes.map_err(|e| wrong(e.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|_| wrong("text that is not UTF-8".into()))?;
        let at = texts.len();
        texts.push((path.clone(), text));
        let text = texts[at].1.clone();
        let document = xml::parse(text.as_bytes()).map_err(|(at, e)| wrong(format!("{at}: {e}")))?;
        included(document.root_element(), folder, texts, depth + 1)?;
    }
    Ok(())
}

/// Where something stands.
#[derive(Clone)]
struct At {
    link: usize,
    /// A frame within the link.
    frame: Pose,
    class: Option<String>,
    folder: PathBuf,
    depth: usize,
}

/// Attributes by name.
type Attributes = HashMap<String, String>;

struct Model<'a, 'i> {
    robot: Robot,
    reader: &'a Reader<'a>,
    files: HashMap<&'a Path, Node<'a, 'i>>,
    /// Attributes of elements by class and name of the element.
    defaults: HashMap<(String, String), Attributes>,
    classes: HashSet<String>,
    /// Meshes: attributes, and the element.
    meshes: HashMap<String, (Attributes, Node<'a, 'i>)>,
    is_radian: bool,
    autolimits: bool,
    euler: Vec<char>,
    meshdir: PathBuf,
    names: usize,
}

impl<'a, 'i> Model<'a, 'i> {
    fn new(roots: &[Node<'a, 'i>], reader: &'a Reader<'a>) -> Result<Self> {
        let mut this = Self {
            robot: Robot::default(),
            reader,
            files: HashMap::new(),
            defaults: HashMap::new(),
            classes: HashSet::new(),
            meshes: HashMap::new(),
            is_radian: false,
            autolimits: true,
            euler: "xyz".chars().collect(),
            meshdir: PathBuf::new(),
            names: 0,
        };
        for compiler in roots.iter().flat_map(|r| xml::inside(*r, "compiler")) {
            if let Some(angle) = compiler.attribute("angle") {
                this.is_radian = match angle {
                    "radian" => true,
                    "degree" => false,
                    other => return Err(xml::wrong(compiler, "radian or degree as the angle", Some(other))),
                };
            }
            if compiler.attribute("coordinate") == Some("global") {
                return Err(xml::wrong(compiler, "local coordinates", Some("global")));
            }
            if let Some(word) = compiler.attribute("eulerseq") {
                let is_sequence = word.chars().count() == 3 && word.chars().all(|c| "xyzXYZ".contains(c));
                if !is_sequence {
                    return Err(xml::wrong(compiler, "three of x, y, z, X, Y, Z as eulerseq", Some(word)));
                }
                this.euler = word.chars().collect();
            }
            this.autolimits = compiler.attribute("autolimits").map_or(this.autolimits, |w| w == "true");
            let folder = compiler.attribute("meshdir").or_else(|| compiler.attribute("assetdir"));
            this.meshdir = folder.map_or(this.meshdir, PathBuf::from);
        }
        for default in roots.iter().flat_map(|r| xml::inside(*r, "default")) {
            this.class(default, None, 0)?;
        }
        for asset in roots.iter().flat_map(|r| xml::inside(*r, "asset")) {
            for mesh in xml::inside(asset, "mesh") {
                let attributes = this.merged(mesh, None)?;
                let stem = |file: &String| Path::new(file).file_stem().map(|s| s.to_string_lossy().into_owned());
                let name = attributes.get("name").cloned().or_else(|| attributes.get("file").and_then(stem));
                let Some(name) = name else { return Err(xml::wrong(mesh, "a name or a file of the mesh", None)) };
                this.meshes.insert(name, (attributes, mesh));
            }
        }
        Ok(this)
    }

    /// A class of defaults, which begins with those of its parent.
    fn class(&mut self, node: Node<'_, '_>, parent: Option<&str>, depth: usize) -> Result<()> {
        let name = node.attribute("class").unwrap_or("main").to_owned();
        if depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "classes within classes", limit: DEEPEST }));
        }
        self.classes.insert(name.clone());
        if let Some(parent) = parent {
            let inherited: Vec<(String, Attributes)> = self
                .defaults
                .iter()
                .filter(|((class, _), _)| class == parent)
                .map(|((_, element), all)| (element.clone(), all.clone()))
                .collect();
            for (element, all) in inherited {
                self.defaults.insert((name.clone(), element), all);
            }
        }
        for element in node.children().filter(|n| n.is_element() && n.tag_name().name() != "default") {
            let all = self.defaults.entry((name.clone(), element.tag_name().name().to_owned())).or_default();
            all.extend(element.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())));
        }
        for inner in xml::inside(node, "default") {
            needed(inner, "class")?;
            self.class(inner, Some(&name), depth + 1)?;
        }
        Ok(())
    }

    /// An element's attributes over those of its class.
    fn merged(&self, node: Node<'_, '_>, childclass: Option<&str>) -> Result<Attributes> {
        let class = node.attribute("class").or(childclass).unwrap_or("main");
        let element = node.tag_name().name();
        let mut all = self.defaults.get(&(class.to_owned(), element.to_owned())).cloned().unwrap_or_default();
        if class != "main" && !self.classes.contains(class) {
            return Err(xml::wrong(node, "the name of a default class", Some(class)));
        }
        // An element that is turned in a way of its own is not turned as its class, too.
        const TURNS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];
        if TURNS.iter().any(|turn| node.has_attribute(*turn)) {
            TURNS.iter().for_each(|turn| _ = all.remove(*turn));
        }
        all.extend(node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())));
        Ok(all)
    }

    fn angle(&self, value: f64) -> f64 {
        if self.is_radian { value } else { value.to_radians() }
    }

    /// What stands in a body, a frame or the world.
    fn content(&mut self, node: Node<'_, '_>, at: &At) -> Result<()> {
        if at.depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "bodies within bodies", limit: DEEPEST }));
        }
        let mut geoms: Vec<([u32; 2], String)> = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let inner = || At { depth: at.depth + 1, ..at.clone() };
            match child.tag_name().name() {
                "body" => self.body(child, &inner())?,
                "joint" => self.joint(child, at)?,
                "freejoint" => self.robot.links[at.link].is_free = true,
                "geom" => self.geom(child, at, &mut geoms)?,
                "frame" => {
                    let pose = at.frame.compose(&self.pose(child, &self.own(child))?);
                    let class = child.attribute("childclass").map(str::to_owned).or_else(|| at.class.clone());
                    self.content(child, &At { frame: pose, class, ..inner() })?;
                }
                "include" => {
                    let path = at.folder.join(needed(child, "file")?);
                    if let Some(root) = self.files.get(path.as_path()).copied() {
                        self.content(root, &inner())?;
                    }
                }
                name @ ("replicate" | "composite" | "flexcomp" | "attach") => {
                    return Err((xml::place(child), Problem::unsupported(format!("<{name}>"))));
                }
                _ => {}
            }
        }
        // Geoms that collide alike are one part.
        let mut masks: Vec<[u32; 2]> = geoms.iter().map(|g| g.0).collect();
        masks.dedup();
        for mask in masks {
            let texts: Vec<String> = geoms.iter().filter(|g| g.0 == mask).map(|g| g.1.clone()).collect();
            let parts = &mut self.robot.links[at.link].parts;
            if parts.iter().any(|p| p.masks == mask && p.text == union(&texts)) {
                continue;
            }
            let name = if parts.is_empty() { String::new() } else { format!("part {}", parts.len() + 1) };
            parts.push(Part { name, text: union(&texts), masks: mask });
        }
        Ok(())
    }

    fn own(&self, node: Node<'_, '_>) -> Attributes {
        node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect()
    }

    fn body(&mut self, node: Node<'_, '_>, at: &At) -> Result<()> {
        self.names += 1;
        let name = node.attribute("name").map_or_else(|| format!("body {}", self.names), str::to_owned);
        let origin = at.frame.compose(&self.pose(node, &self.own(node))?);
        let class = node.attribute("childclass").map(str::to_owned).or_else(|| at.class.clone());
        let is_free = node.attribute("mocap") == Some("true");
        self.robot.links.push(Link {
            name,
            at: xml::place(node),
            parent: Some(at.link),
            origin,
            dofs: vec![],
            parts: vec![],
            is_free,
            is_static: false,
        });
        let link = self.robot.links.len() - 1;
        self.content(node, &At { link, frame: Pose::IDENTITY, class, ..at.clone() })
    }

    fn joint(&mut self, node: Node<'_, '_>, at: &At) -> Result<()> {
        let all = self.merged(node, at.class.as_deref())?;
        let of = |key: &str| all.get(key).map(String::as_str);
        self.names += 1;
        let name = of("name").map_or_else(|| format!("joint {}", self.names), str::to_owned);
        let axis = of("axis").map_or(Ok(DVec3::Z), |text| vector_of(node, text, "axis"))?;
        let axis = axis.try_normalize().ok_or_else(|| xml::wrong(node, "an axis that is not 0", of("axis")))?;
        let pos = of("pos").map_or(Ok(DVec3::ZERO), |text| vector_of(node, text, "pos"))?;
        let (anchor, axis) = (at.frame.point(pos), at.frame.vector(axis));
        let is_hinge = match of("type").unwrap_or("hinge") {
            "hinge" => true,
            "slide" => false,
            "free" | "ball" => {
                if of("type") == Some("ball") {
                    self.robot.note(xml::place(node), format!("the ball joint {name} is taken as it stands"));
                }
                self.robot.links[at.link].is_free = true;
                return Ok(());
            }
            other => return Err(xml::wrong(node, "one of free, ball, slide, hinge as the joint's type", Some(other))),
        };
        let unit = |x: f64| if is_hinge { self.angle(x) } else { x };
        let range = match of("range") {
            Some(text) => Some(numbers_of(node, text, "range")?),
            None => None,
        };
        let is_limited = match of("limited").unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.autolimits && range.is_some(),
        };
        let range = match range.as_deref() {
            Some([low, high]) if is_limited && (low != high || of("limited") == Some("true")) => {
                [unit(*low), unit(*high)]
            }
            Some([_, _]) | None => [f64::NEG_INFINITY, f64::INFINITY],
            Some(_) => return Err(xml::wrong(node, "two numbers as range of the joint", of("range"))),
        };
        if range[0] > range[1] {
            return Err(xml::wrong(node, "a lower limit below the upper one", of("range")));
        }
        let zero = unit(of("ref").map_or(Ok(0.0), |word| xml::finite(node, word, "ref"))?);
        let kind = if is_hinge { DofKind::Hinge { anchor, axis } } else { DofKind::Slide { axis } };
        let start = zero.clamp(range[0], range[1]);
        self.robot.links[at.link].dofs.push(Dof { name, kind, range, start, zero, mimic: None });
        Ok(())
    }

    fn geom(&mut self, node: Node<'_, '_>, at: &At, geoms: &mut Vec<([u32; 2], String)>) -> Result<()> {
        let all = self.merged(node, at.class.as_deref())?;
        let of = |key: &str| all.get(key).map(String::as_str);
        let mask = |key: &str| match of(key) {
            None => Ok(1),
            Some(word) => word
                .trim()
                .parse::<i64>()
                .map(|m| m as u32)
                .map_err(|_| xml::wrong(node, format!("a whole number as {key}"), Some(word))),
        };
        let masks = [mask("contype")?, mask("conaffinity")?];
        if masks == [0, 0] {
            return Ok(());
        }
        let sizes = of("size").map_or(Ok(vec![]), |text| numbers_of(node, text, "size"))?;
        let size = |k: usize| {
            sizes.get(k).copied().ok_or_else(|| xml::wrong(node, format!("{} sizes of the geom", k + 1), of("size")))
        };
        let mut pose = self.pose(node, &all)?;
        let mut half = None;
        if let Some(text) = of("fromto") {
            let n = numbers_of(node, text, "fromto")?;
            let [a, b, c, d, e, f] = n[..] else { return Err(xml::wrong(node, "six numbers as fromto", Some(text))) };
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let along = (from - to).try_normalize();
            let along = along.ok_or_else(|| xml::wrong(node, "two ends that differ as fromto", Some(text)))?;
            pose = Pose::new(0.5 * (from + to), turned_to(along));
            half = Some(0.5 * (to - from).length());
        }
        let long = |k: usize| half.map_or_else(|| size(k), Ok);
        let kind = of("type").unwrap_or("sphere");
        if kind != "mesh" && of("mesh").is_some() {
            return Err((xml::place(node), Problem::unsupported(format!("a {kind} fitted to a mesh"))));
        }
        let shape = match kind {
            "plane" => Shape::Plane,
            "sphere" => Shape::Sphere(size(0)?),
            "capsule" => Shape::Capsule(size(0)?, 2.0 * long(1)?),
            "cylinder" => Shape::Cylinder(size(0)?, 2.0 * long(1)?),
            "ellipsoid" if half.is_some() => Shape::Ellipsoid(DVec3::new(size(0)?, size(0)?, long(2)?)),
            "ellipsoid" => Shape::Ellipsoid(DVec3::new(size(0)?, size(1)?, size(2)?)),
            "box" if half.is_some() => Shape::Box(2.0 * DVec3::new(size(0)?, size(0)?, long(2)?)),
            "box" => Shape::Box(2.0 * DVec3::new(size(0)?, size(1)?, size(2)?)),
            "mesh" => self.mesh(node, of("mesh"))?,
            other => return Err((xml::place(node), Problem::unsupported(format!("a geom of type {other}")))),
        };
        let shape = not_negative(node, shape)?;
        if shape.is_nothing() {
            self.robot.note(xml::place(node), "a geom has no inside and is left out");
            return Ok(());
        }
        let text = shape.at(&at.frame.compose(&pose));
        if shape == Shape::Plane {
            self.names += 1;
            let name = of("name").map_or_else(|| format!("plane {}", self.names), str::to_owned);
            self.robot.links[at.link].parts.push(Part { name, text: union(&[text]), masks });
        } else {
            geoms.push((masks, text));
        }
        Ok(())
    }

    fn mesh(&self, node: Node<'_, '_>, name: Option<&str>) -> Result<Shape> {
        let Some(name) = name else { return Err(xml::wrong(node, "the mesh of the geom", None)) };
        let Some((all, asset)) = self.meshes.get(name) else {
            return Err(xml::wrong(node, "the name of a mesh among the assets", Some(name)));
        };
        let Some(file) = all.get("file") else {
            return Err((xml::place(*asset), Problem::unsupported(format!("the mesh {name} without a file"))));
        };
        if all.contains_key("refpos") || all.contains_key("refquat") {
            return Err((xml::place(*asset), Problem::unsupported(format!("refpos and refquat of the mesh {name}"))));
        }
        let scale = all.get("scale").map_or(Ok(DVec3::ONE), |text| vector_of(*asset, text, "scale"))?;
        let path = self.meshdir.join(file);
        Ok(Shape::Mesh(self.reader.file(&path.display().to_string()), scale, true))
    }

    /// Where an element stands: `pos`, and one of five ways to turn it.
    fn pose(&self, node: Node<'_, '_>, all: &Attributes) -> Result<Pose> {
        let some = |key: &str, count: usize| -> Result<Option<Vec<f64>>> {
            let Some(text) = all.get(key) else { return Ok(None) };
            let numbers = numbers_of(node, text, key)?;
            if numbers.len() != count {
                return Err(xml::wrong(node, format!("{count} numbers as {key}"), Some(text)));
            }
            Ok(Some(numbers))
        };
        let position = some("pos", 3)?.map_or(DVec3::ZERO, |n| DVec3::from_slice(&n));
        let zero = |key: &str| xml::wrong(node, format!("{key} that is not 0"), all.get(key).map(String::as_str));
        let rotation = if let Some(n) = some("quat", 4)? {
            let q = DQuat::from_xyzw(n[1], n[2], n[3], n[0]);
            if q.length() > 0.0 { q.normalize() } else { return Err(zero("quat")) }
        } else if let Some(n) = some("axisangle", 4)? {
            let axis = DVec3::from_slice(&n[..3]).try_normalize().ok_or_else(|| zero("axisangle"))?;
            quat_of_rotation_vector(axis * self.angle(n[3]))
        } else if let Some(n) = some("euler", 3)? {
            self.of_euler(&n)
        } else if let Some(n) = some("xyaxes", 6)? {
            let x = DVec3::from_slice(&n[..3]).try_normalize().ok_or_else(|| zero("xyaxes"))?;
            let y = DVec3::from_slice(&n[3..]);
            let y = (y - x * x.dot(y)).try_normalize().ok_or_else(|| zero("xyaxes"))?;
            DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize()
        } else if let Some(n) = some("zaxis", 3)? {
            turned_to(DVec3::from_slice(&n).try_normalize().ok_or_else(|| zero("zaxis"))?)
        } else {
            DQuat::IDENTITY
        };
        Ok(Pose::new(position, rotation))
    }

    /// Small letters turn about axes that turn along, capital ones about fixed ones.
    fn of_euler(&self, angles: &[f64]) -> DQuat {
        let mut q = DQuat::IDENTITY;
        for (letter, angle) in self.euler.iter().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => DVec3::X,
                'y' => DVec3::Y,
                _ => DVec3::Z,
            };
            let turn = quat_of_rotation_vector(axis * self.angle(*angle));
            q = if letter.is_ascii_lowercase() { q * turn } else { turn * q };
        }
        q.normalize()
    }

    /// Which pairs are not tested.
    fn finish(mut self, roots: &[Node<'_, '_>]) -> Result<Robot> {
        let robot = &mut self.robot;
        for i in 0..robot.links.len() {
            robot.links[i].is_static = robot.welded_to(i).is_none();
        }
        let welded: Vec<Option<usize>> = (0..robot.links.len()).map(|i| robot.welded_to(i)).collect();
        let above = |i: usize| welded[i].and_then(|w| robot.links[w].parent).and_then(|p| welded[p]);
        let mut excepted = Vec::new();
        for i in 0..welded.len() {
            for j in i + 1..welded.len() {
                let of = |i: usize, j: usize| above(i).is_some() && above(i) == welded[j];
                if of(i, j) || of(j, i) {
                    excepted.push([i, j]);
                }
            }
        }
        let flags = sections(roots, "option").flat_map(|o| xml::inside(o, "flag"));
        if !flags.into_iter().any(|flag| flag.attribute("filterparent") == Some("disable")) {
            robot.excepted.extend(excepted);
        }
        for node in sections(roots, "contact").flat_map(|c| xml::inside(c, "exclude")) {
            let mut pair = [0; 2];
            for (k, key) in ["body1", "body2"].into_iter().enumerate() {
                let name = needed(node, key)?;
                let found = robot.links.iter().position(|l| l.name == name);
                pair[k] = found.ok_or_else(|| xml::wrong(node, "the name of a body", Some(name)))?;
            }
            pair.sort_unstable();
            robot.excepted.insert(pair);
        }
        if let Some(node) = sections(roots, "contact").flat_map(|c| xml::inside(c, "pair")).next() {
            return Err((xml::place(node), Problem::unsupported("a <pair> of geoms")));
        }
        for (section, what) in [
            ("equality", "constraints are not kept: what they couple moves freely"),
            ("keyframe", "keyframes are not read"),
        ] {
            if let Some(node) = sections(roots, section).find(|s| s.has_children()) {
                robot.note(xml::place(node), what);
            }
        }
        Ok(self.robot)
    }
}

/// The least rotation that takes z to a unit vector; about x where that is −z, as MuJoCo has it.
fn turned_to(v: DVec3) -> DQuat {
    if v.z < 0.0 && v.truncate().length() < 1e-10 {
        return DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    }
    DQuat::from_rotation_arc(DVec3::Z, v)
}
