//! MJCF: MuJoCo's bodies, joints and geoms, with its defaults, its compiler's angles, its masks and its filters.
//!
//! Source: mujoco.readthedocs.io/en/stable/XMLreference.html. Geoms collide where contype and conaffinity say so; never those of bodies
//! that are welded to each other, nor of a body and its parent unless that is the world. Meshes are their convex hulls. Geoms of which
//! both masks are 0 are seen and do not collide: they are not read.

use super::super::names::Names;
use super::super::problem::Problem;
use super::super::{Place, xml};
use super::kinematics::{Dof, DofKind, Link, Part, Robot};
use super::mjcf_couplings::{Slot, begin_at, equalities, filters, paired};
use super::mjcf_files::{FLAG, Files, flag, included};
use super::reader::Reader;
use super::shape::{Shape, union};
use super::urdf::{Result, needed, not_negative, numbers_of, vector_of};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DMat3, DQuat, DVec2, DVec3};
use roxmltree::{Document, Node};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Bodies within bodies.
const DEEPEST: usize = 200;
/// Copies of one element.
const MOST_COPIES: f64 = 10_000.0;

pub(super) fn read(root: Node<'_, '_>, reader: &Reader<'_>) -> Result<Robot> {
    // Other files are put in first: defaults and meshes may stand in any of them.
    let texts = included(root, reader.folder())?;
    let documents: Vec<Document<'_>> = texts.iter().map(|t| xml::parse(t.text.as_bytes())).collect::<Result<_>>()?;
    let files = Files::new(root, reader.folder(), &texts, &documents);
    let mut model = Model::new(&files, reader)?;
    model.robot.name = root.attribute("model").unwrap_or_default().to_owned();
    model.add("world".into(), None, (xml::place(root), Pose::IDENTITY));
    model.robot.links[0].is_static = true;
    for worldbody in files.sections("worldbody") {
        let at = At { link: 0, frame: Pose::IDENTITY, class: None, suffix: String::new(), depth: 0 };
        model.body_content(worldbody, &at)?;
    }
    let is_active = model.defaults.get(&("main".to_owned(), "equality".to_owned()));
    let is_active = is_active.and_then(|all| all.get("active")).is_none_or(|word| word == "true");
    let Model { mut robot, mocap, slots, places, .. } = model;
    filters(&mut robot, &files, &mocap, &places)?;
    if let Some(key) = &reader.ask.key {
        begin_at(&mut robot, &files, &slots, key)?;
    }
    // What is held or follows stands where that has it, whatever the keyframe says.
    equalities(&mut robot, &files, is_active)?;
    let names = Names::of_mjcf();
    for root in files.roots() {
        for (node, text) in names.unknown(root) {
            files.note(&mut robot, node, &text);
        }
    }
    Ok(robot)
}

/// Where something stands.
#[derive(Clone)]
struct At {
    link: usize,
    /// A frame within the link.
    frame: Pose,
    class: Option<String>,
    /// What copies have behind their names.
    suffix: String,
    depth: usize,
}

/// Attributes by name.
type Attributes = HashMap<String, String>;

struct Model<'a, 'i> {
    robot: Robot,
    reader: &'a Reader<'a>,
    files: &'a Files<'a, 'i>,
    /// Attributes of elements by class and name of the element.
    defaults: HashMap<(String, String), Attributes>,
    classes: HashSet<String>,
    /// Meshes: attributes, and the element.
    meshes: HashMap<String, (Attributes, Node<'a, 'i>)>,
    is_radian: bool,
    autolimits: bool,
    euler: Vec<char>,
    meshdir: PathBuf,
    /// Names of files lose their folders.
    strips: bool,
    names: usize,
    /// Bodies that are moved by hand.
    mocap: HashSet<usize>,
    /// The joints of each body, as keyframes have them.
    slots: Vec<Vec<Slot>>,
    /// Names of geoms that a `<pair>` names, each a part of its own.
    paired: HashSet<String>,
    /// Those that are there: link and part; `None` for one that has no inside.
    places: HashMap<String, Option<(usize, usize)>>,
    /// Height fields: their attributes and elements.
    fields: HashMap<String, (Attributes, Node<'a, 'i>)>,
}

impl<'a, 'i> Model<'a, 'i> {
    fn new(files: &'a Files<'a, 'i>, reader: &'a Reader<'a>) -> Result<Self> {
        let mut this = Self {
            robot: Robot::default(),
            reader,
            files,
            defaults: HashMap::new(),
            classes: HashSet::new(),
            meshes: HashMap::new(),
            is_radian: false,
            autolimits: true,
            euler: "xyz".chars().collect(),
            meshdir: PathBuf::new(),
            strips: false,
            names: 0,
            mocap: HashSet::new(),
            slots: Vec::new(),
            paired: paired(files),
            places: HashMap::new(),
            fields: HashMap::new(),
        };
        for compiler in files.sections("compiler") {
            this.compiler(compiler).map_err(|e| files.told(compiler, e))?;
        }
        for default in files.sections("default") {
            this.class(default, None, 0).map_err(|e| files.told(default, e))?;
        }
        for asset in files.within("asset") {
            this.asset(asset).map_err(|e| files.told(asset, e))?;
        }
        Ok(this)
    }

    /// Takes a mesh or a height field.
    fn asset(&mut self, asset: Node<'a, 'i>) -> Result<()> {
        let kind = asset.tag_name().name();
        if !["mesh", "hfield"].contains(&kind) {
            return Ok(());
        }
        let attributes = self.merged(asset, None)?;
        let stem = |file: &String| Path::new(file).file_stem().map(|s| s.to_string_lossy().into_owned());
        let name = attributes.get("name").cloned().or_else(|| attributes.get("file").and_then(stem));
        let Some(name) = name else { return Err(xml::wrong(asset, format!("a name or a file of the {kind}"), None)) };
        let all = if kind == "mesh" { &mut self.meshes } else { &mut self.fields };
        match all.entry(name) {
            Entry::Vacant(free) => _ = free.insert((attributes, asset)),
            Entry::Occupied(taken) => {
                return Err(xml::wrong(asset, format!("a name that no other {kind} has"), Some(taken.key())));
            }
        }
        Ok(())
    }

    fn compiler(&mut self, compiler: Node<'_, '_>) -> Result<()> {
        if let Some(angle) = compiler.attribute("angle") {
            self.is_radian = match angle {
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
            self.euler = word.chars().collect();
        }
        self.autolimits = flag(compiler, "autolimits")?.unwrap_or(self.autolimits);
        let folder = compiler.attribute("meshdir").or_else(|| compiler.attribute("assetdir"));
        self.meshdir = folder.map_or_else(|| std::mem::take(&mut self.meshdir), PathBuf::from);
        self.strips = flag(compiler, "strippath")?.unwrap_or(self.strips);
        Ok(())
    }

    /// A class of defaults, which begins with those of its parent.
    fn class(&mut self, node: Node<'a, 'i>, parent: Option<&str>, depth: usize) -> Result<()> {
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
        let (inner, elements): (Vec<_>, Vec<_>) =
            self.files.children(node).into_iter().partition(|n| n.tag_name().name() == "default");
        for element in elements {
            let kind = element.tag_name().name();
            if kind == "equality" {
                flag(element, "active").map_err(|e| self.files.told(element, e))?;
            }
            overlay(self.defaults.entry((name.clone(), kind.to_owned())).or_default(), element);
        }
        for inner in inner {
            let told = |e| self.files.told(inner, e);
            needed(inner, "class").map_err(told)?;
            self.class(inner, Some(&name), depth + 1).map_err(|e| self.files.told(inner, e))?;
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
        overlay(&mut all, node);
        Ok(all)
    }

    fn angle(&self, value: f64) -> f64 {
        if self.is_radian { value } else { value.to_radians() }
    }

    /// What stands in a body or the world: geoms that collide alike are one part.
    fn body_content(&mut self, node: Node<'a, 'i>, at: &At) -> Result<()> {
        let mut geoms: Vec<([u32; 2], String)> = Vec::new();
        self.content(node, at, &mut geoms)?;
        let mut masks: Vec<[u32; 2]> = Vec::new();
        for (mask, _) in &geoms {
            if !masks.contains(mask) {
                masks.push(*mask);
            }
        }
        for mask in masks {
            let texts: Vec<String> = geoms.iter().filter(|g| g.0 == mask).map(|g| g.1.clone()).collect();
            let parts = &mut self.robot.links[at.link].parts;
            let name = if parts.is_empty() { String::new() } else { format!("part {}", parts.len() + 1) };
            parts.push(Part { name, text: union(&texts), masks: mask });
        }
        Ok(())
    }

    /// What stands in a body, a frame or the world.
    fn content(&mut self, node: Node<'a, 'i>, at: &At, geoms: &mut Vec<([u32; 2], String)>) -> Result<()> {
        if at.depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "bodies within bodies", limit: DEEPEST }));
        }
        for child in self.files.children(node) {
            self.element(child, at, geoms).map_err(|e| self.files.told(child, e))?;
        }
        Ok(())
    }

    fn element(&mut self, child: Node<'a, 'i>, at: &At, geoms: &mut Vec<([u32; 2], String)>) -> Result<()> {
        let inner = || At { depth: at.depth + 1, ..at.clone() };
        match child.tag_name().name() {
            "body" => self.body(child, &inner()),
            "joint" => self.joint(child, at),
            "freejoint" => {
                self.robot.links[at.link].is_free = true;
                self.slots[at.link].push(Slot::Free);
                Ok(())
            }
            "geom" => self.geom(child, at, geoms),
            "frame" => {
                let pose = at.frame.compose(&self.pose(child, &self.own(child))?);
                let class = child.attribute("childclass").map(str::to_owned).or_else(|| at.class.clone());
                self.content(child, &At { frame: pose, class, ..inner() }, geoms)
            }
            "replicate" => self.replicate(child, &inner(), geoms),
            name @ ("composite" | "flexcomp" | "attach") => {
                Err((xml::place(child), Problem::unsupported(format!("<{name}>"))))
            }
            _ => Ok(()),
        }
    }

    /// Copies, each moved against the one before; their names end with their numbers.
    fn replicate(&mut self, node: Node<'a, 'i>, at: &At, geoms: &mut Vec<([u32; 2], String)>) -> Result<()> {
        let count = xml::number(node, "count")?.ok_or_else(|| xml::wrong(node, "a count of the replicate", None))?;
        if !(1.0..=MOST_COPIES).contains(&count) || count.fract() != 0.0 {
            return Err(xml::wrong(
                node,
                format!("a whole number of copies up to {MOST_COPIES}"),
                node.attribute("count"),
            ));
        }
        let numbers = |key: &str| match node.attribute(key) {
            None => Ok(DVec3::ZERO),
            Some(text) => vector_of(node, text, key),
        };
        let (offset, angles) = (numbers("offset")?, numbers("euler")?);
        let digits = (count as usize).to_string().len();
        let sep = node.attribute("sep").unwrap_or_default();
        let mut position = DVec3::ZERO;
        for k in 0..count as usize {
            let suffix = format!("{sep}{k:0digits$}{}", at.suffix);
            // The angles are those of the first copy, times its number; the offset goes along what was turned so far.
            let turn = self.of_euler(&(angles * k as f64).to_array());
            let frame = at.frame.compose(&Pose::new(position, turn));
            self.content(node, &At { frame, suffix, ..at.clone() }, geoms)?;
            position += turn * offset;
        }
        Ok(())
    }

    /// A name that is told, or one of its own.
    fn name(&mut self, told: Option<&str>, kind: &str, at: &At) -> String {
        self.names += 1;
        told.map_or_else(|| format!("{kind} {}", self.names), |name| format!("{name}{}", at.suffix))
    }

    /// Adds a link; its number.
    fn add(&mut self, name: String, parent: Option<usize>, (at, origin): (Place, Pose)) -> usize {
        let (dofs, parts) = (vec![], vec![]);
        self.robot.links.push(Link { name, at, parent, origin, dofs, parts, is_free: false, is_static: false });
        self.slots.push(Vec::new());
        self.robot.links.len() - 1
    }

    fn own(&self, node: Node<'_, '_>) -> Attributes {
        node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect()
    }

    fn body(&mut self, node: Node<'a, 'i>, at: &At) -> Result<()> {
        let name = self.name(node.attribute("name"), "body", at);
        let origin = at.frame.compose(&self.pose(node, &self.own(node))?);
        let class = node.attribute("childclass").map(str::to_owned).or_else(|| at.class.clone());
        let link = self.add(name, Some(at.link), (self.files.place(node), origin));
        if flag(node, "mocap")? == Some(true) {
            self.robot.links[link].is_free = true;
            self.mocap.insert(link);
        }
        self.body_content(node, &At { link, frame: Pose::IDENTITY, class, ..at.clone() })
    }

    fn joint(&mut self, node: Node<'_, '_>, at: &At) -> Result<()> {
        let all = self.merged(node, at.class.as_deref())?;
        let of = |key: &str| all.get(key).map(String::as_str);
        let name = self.name(of("name"), "joint", at);
        let axis = of("axis").map_or(Ok(DVec3::Z), |text| vector_of(node, text, "axis"))?;
        let axis = axis.try_normalize().ok_or_else(|| xml::wrong(node, "an axis that is not 0", of("axis")))?;
        let pos = of("pos").map_or(Ok(DVec3::ZERO), |text| vector_of(node, text, "pos"))?;
        let (anchor, axis) = (at.frame.point(pos), at.frame.vector(axis));
        let is_hinge = match of("type").unwrap_or("hinge") {
            "hinge" => true,
            "slide" => false,
            "free" | "ball" => {
                let is_ball = of("type") == Some("ball");
                if is_ball {
                    self.files.note(&mut self.robot, node, &format!("the ball joint {name} is taken as it stands"));
                }
                self.robot.links[at.link].is_free = true;
                self.slots[at.link].push(if is_ball { Slot::Ball } else { Slot::Free });
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
            "auto" => self.autolimits && range.is_some(),
            word => xml::either(node, word, "limited", FLAG)?,
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
        let own = self.robot.links[at.link].dofs.len();
        self.slots[at.link].push(Slot::Dof(own));
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
        let own = of("name").map(|name| format!("{name}{}", at.suffix)).filter(|name| self.paired.contains(name));
        if masks == [0, 0] && own.is_none() {
            return Ok(());
        }
        let sizes = of("size").map_or(Ok(vec![]), |text| numbers_of(node, text, "size"))?;
        if sizes.len() > 3 {
            return Err(xml::wrong(node, "three sizes of the geom at most", of("size")));
        }
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
            "hfield" => self.field(node, of("hfield"))?,
            other => return Err((xml::place(node), Problem::unsupported(format!("a geom of type {other}")))),
        };
        let shape = not_negative(node, shape)?;
        if shape.is_nothing() {
            self.files.note(&mut self.robot, node, "a geom has no inside and is left out");
            self.places.extend(own.map(|name| (name, None)));
            return Ok(());
        }
        let text = shape.at(&at.frame.compose(&pose));
        if own.is_some() || shape == Shape::Plane {
            let name = self.name(of("name"), "plane", at);
            let parts = &mut self.robot.links[at.link].parts;
            self.places.extend(own.map(|name| (name, Some((at.link, parts.len())))));
            parts.push(Part { name, text: union(&[text]), masks });
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
        let own = Path::new(file).file_name().filter(|_| self.strips);
        let path = self.meshdir.join(own.map_or_else(|| Path::new(file), Path::new));
        Ok(Shape::Mesh(self.reader.file(&path.display().to_string()), scale, true))
    }

    /// The solid under a height field: `elevation` from 0 to 1 of the height that `size` tells, or flat where only a program fills it.
    fn field(&self, node: Node<'_, '_>, name: Option<&str>) -> Result<Shape> {
        /// Heights of one field.
        const MOST: f64 = 1e6;
        let found = name.and_then(|name| self.fields.get(name));
        let Some((all, asset)) = found else {
            return Err(xml::wrong(node, "the name of a height field among the assets", name));
        };
        if let Some(file) = all.get("file") {
            return Err((xml::place(*asset), Problem::unsupported(format!("a height field of a file, {file:?}"))));
        }
        let of = |key: &str| all.get(key).map(String::as_str);
        let numbers = |key: &str| numbers_of(*asset, of(key).unwrap_or_default(), key);
        let [x, y, top, base] = numbers("size")?[..] else {
            return Err(xml::wrong(*asset, "four numbers as size of the hfield", of("size")));
        };
        let (rows, columns) = match (numbers("nrow")?.as_slice(), numbers("ncol")?.as_slice()) {
            ([r], [c]) if r.min(*c) >= 2.0 && r * c <= MOST && r.fract() + c.fract() == 0.0 => {
                (*r as usize, *c as usize)
            }
            _ => {
                return Err(xml::wrong(
                    *asset,
                    format!("nrow and ncol of 2 or more, {MOST} heights in all"),
                    of("nrow"),
                ));
            }
        };
        let mut heights = numbers("elevation")?;
        if heights.is_empty() {
            heights = vec![0.0; rows * columns];
        }
        if heights.len() != rows * columns || [x, y, top, base].iter().any(|l| *l <= 0.0) {
            let expected = format!("lengths above 0 and {} numbers as elevation of the hfield", rows * columns);
            return Err(xml::wrong(*asset, expected, Some(&heights.len().to_string())));
        }
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        heights.iter_mut().for_each(|z| *z -= low);
        let high = heights.iter().copied().fold(0.0, f64::max);
        let scale = if high > 0.0 { top / high } else { 0.0 };
        // The file's rows begin at the far side, where y is greatest.
        let rows = heights.chunks(columns).rev().map(|row| row.iter().map(|z| z * scale).collect()).collect();
        Ok(Shape::Heights(rows, DVec2::new(2.0 * x, 2.0 * y), -base))
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
}

/// An element's attributes over others. Of sizes the first ones may be told, and the others stay.
fn overlay(all: &mut Attributes, node: Node<'_, '_>) {
    // What is turned in a way of its own, an element or a class, is not turned as the class around it, too.
    const TURNS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];
    if TURNS.iter().any(|turn| node.has_attribute(*turn)) {
        TURNS.iter().for_each(|turn| _ = all.remove(*turn));
    }
    for attribute in node.attributes() {
        let (name, mut value) = (attribute.name().to_owned(), attribute.value().to_owned());
        if let Some(old) = all.get(&name).filter(|_| name == "size") {
            let rest = old.split_whitespace().skip(value.split_whitespace().count());
            rest.for_each(|word| value = format!("{value} {word}"));
        }
        all.insert(name, value);
    }
}

/// The least rotation that takes z to a unit vector; about x where that is −z, as MuJoCo has it.
fn turned_to(v: DVec3) -> DQuat {
    if v.z < 0.0 && v.truncate().length() < 1e-10 {
        return DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    }
    DQuat::from_rotation_arc(DVec3::Z, v)
}
