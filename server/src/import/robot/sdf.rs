//! SDFormat: worlds and models with their links, joints and frames.
//!
//! Source: sdformat.org/spec. A pose is relative to the frame that it names, else to its parent element's; a joint's to its child.
//! Links of a model are tested against each other where `self_collide` says so; static models against all others.

use super::super::problem::Problem;
use super::super::xml;
use super::kinematics::{Dof, DofKind, Link, Part, Robot};
use super::reader::Reader;
use super::shape::{Shape, union};
use super::urdf::{Result, needed, not_negative, numbers_of, roll_pitch_yaw, vector_of};
use contactd_proto::Pose;
use contactd_proto::pose_record::unit_quaternion;
use glam::{DQuat, DVec3};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// Models within models.
const DEEPEST: usize = 32;

pub(super) fn read(root: Node<'_, '_>, reader: &Reader<'_>) -> Result<Robot> {
    let mut robot = Robot::default();
    let version = version_of(root).unwrap_or([1, 7]);
    let mut all = World { robot: &mut robot, reader, version, links: Vec::new(), depth: 0, count: 0 };
    let worlds: Vec<Node<'_, '_>> = xml::inside(root, "world").collect();
    for node in if worlds.is_empty() { vec![root] } else { worlds } {
        all.models(node, &Scope::WORLD)?;
    }
    let links = std::mem::take(&mut all.links);
    order(&mut robot, links);
    Ok(robot)
}

/// Major and minor: 1.10 comes after 1.9.
fn version_of(root: Node<'_, '_>) -> Option<[u32; 2]> {
    let (major, minor) = root.attribute("version")?.split_once('.')?;
    Some([major.trim().parse().ok()?, minor.trim().parse().ok()?])
}

/// What is known where something stands.
#[derive(Clone, Debug)]
struct Scope {
    /// Its frame in the world.
    pose: Pose,
    /// What its links are called before their own names.
    prefix: String,
    is_static: bool,
    /// The outermost model's number; links of one that does not collide with itself are not tested against each other.
    model: Option<usize>,
    collides_with_itself: bool,
}

impl Scope {
    const WORLD: Self = Self {
        pose: Pose::IDENTITY,
        prefix: String::new(),
        is_static: false,
        model: None,
        collides_with_itself: false,
    };
}

/// A link before its parents are known to come first.
struct Found {
    link: Link,
    /// The link above, by its index among those found.
    parent: Option<usize>,
    pose: Pose,
    scope: Scope,
}

struct World<'a> {
    robot: &'a mut Robot,
    reader: &'a Reader<'a>,
    version: [u32; 2],
    links: Vec<Found>,
    depth: usize,
    /// Models so far.
    count: usize,
}

impl World<'_> {
    /// The models in a node, and those that it includes.
    fn models(&mut self, node: Node<'_, '_>, scope: &Scope) -> Result<()> {
        for model in xml::inside(node, "model") {
            self.model(model, model.attribute("name").unwrap_or("model"), None, scope)?;
        }
        for include in xml::inside(node, "include") {
            self.include(include, scope)?;
        }
        if node.tag_name().name() == "world"
            && let Some(joint) = xml::inside(node, "joint").next()
        {
            return Err((xml::place(joint), Problem::unsupported("a joint of a world")));
        }
        for kind in ["actor", "road", "population", "heightmap"] {
            if let Some(left) = xml::inside(node, kind).next() {
                self.robot.note(xml::place(left), format!("{kind} is left out: it is not read"));
            }
        }
        Ok(())
    }

    /// A model of another file.
    fn include(&mut self, node: Node<'_, '_>, scope: &Scope) -> Result<()> {
        let uri = text(node, "uri").ok_or_else(|| xml::wrong(node, "the uri of what is included", None))?;
        let file = self.reader.file(uri.trim());
        let folder = self.reader.folder().join(&file);
        // A model's folder, whose file is model.sdf; or the file itself.
        let path = if folder.is_dir() { folder.join("model.sdf") } else { folder };
        let found = |e: String| xml::wrong(node, format!("the model {uri}, as {}", path.display()), Some(&e));
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "models within models", limit: DEEPEST }));
        }
        let bytes =
            super::super::read_bytes(&path, &super::super::Limits::default()).map_err(|e| found(e.to_string()))?;
        let document: Document<'_> = xml::parse(&bytes).map_err(|(at, e)| found(format!("{at}: {e}")))?;
        let inner = Reader { path: &path, ask: self.reader.ask, root: self.reader.root };
        let root = document.root_element();
        let version = version_of(root).unwrap_or(self.version);
        let (links, count) = (Vec::new(), self.count);
        let mut all = World { robot: self.robot, reader: &inner, version, links, depth: self.depth, count };
        let model = xml::inside(root, "model").next();
        let model = model.ok_or_else(|| found("no model in it".into()))?;
        let own = model.attribute("name").unwrap_or("model");
        let name = text(node, "name").unwrap_or(own).to_owned();
        if let Some(frame) = xml::inside(node, "placement_frame").next() {
            return Err((xml::place(frame), Problem::unsupported("<placement_frame>")));
        }
        let pose = match xml::inside(node, "pose").next() {
            None => None,
            Some(_) => Some(own_pose(node, &[])?),
        };
        let scope = &Scope { is_static: scope.is_static || is_true(node, "static"), ..scope.clone() };
        all.model(model, &name, pose, scope).map_err(|(at, e)| found(format!("{at}: {e}")))?;
        let (base, count, mut links) = (self.links.len(), all.count, all.links);
        self.count = count;
        links.iter_mut().for_each(|l| l.parent = l.parent.map(|p| p + base));
        self.links.append(&mut links);
        self.depth -= 1;
        Ok(())
    }

    fn model(&mut self, node: Node<'_, '_>, name: &str, placed: Option<Pose>, outer: &Scope) -> Result<()> {
        self.count += 1;
        if node.attribute("placement_frame").is_some() {
            return Err((xml::place(node), Problem::unsupported("placement_frame of a model")));
        }
        let own = own_pose(node, &[])?;
        let scope = Scope {
            pose: outer.pose.compose(&placed.unwrap_or(own)),
            prefix: if outer.prefix.is_empty() { name.to_owned() } else { format!("{}::{name}", outer.prefix) },
            is_static: outer.is_static || is_true(node, "static"),
            model: outer.model.or(Some(self.count)),
            collides_with_itself: outer.collides_with_itself || is_true(node, "self_collide"),
        };
        let first = self.links.len();
        let frames = Frames::of(node, scope.pose);
        let mut index = HashMap::new();
        for link in xml::inside(node, "link") {
            let name = needed(link, "name")?;
            index.insert(name.to_owned(), self.links.len());
            let found = self.link(link, name, frames.pose(name, link)?, &scope)?;
            self.links.push(found);
        }
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "models within models", limit: DEEPEST }));
        }
        let before = self.links.len();
        self.models(node, &scope)?;
        self.depth -= 1;
        // Links of models within are called by the names of both.
        for i in before..self.links.len() {
            let inner = self.links[i].link.name.strip_prefix(&format!("{}::", scope.prefix)).map(str::to_owned);
            index.extend(inner.map(|name| (name, i)));
        }
        let lone = self.links.len() == first + 1;
        if lone && outer.prefix.is_empty() {
            // A model that is one link is called as the model is.
            self.links[first].link.name = scope.prefix.clone();
        }
        for joint in xml::inside(node, "joint") {
            self.joint(joint, &index, &scope)?;
        }
        Ok(())
    }

    fn link(&mut self, node: Node<'_, '_>, name: &str, pose: Pose, scope: &Scope) -> Result<Found> {
        let (mut texts, mut parts) = (Vec::new(), Vec::new());
        for collision in xml::inside(node, "collision") {
            let Some(geometry) = xml::inside(collision, "geometry").next() else {
                return Err(xml::wrong(collision, "a geometry of the collision", None));
            };
            let Some((shape, turn)) = geometry_of(geometry, self.reader)? else { continue };
            if shape.is_nothing() {
                self.robot.note(xml::place(geometry), format!("a collision of {name} has no inside and is left out"));
                continue;
            }
            let own = own_pose(collision, &[name])?;
            let text = shape.at(&own.compose(&Pose::new(DVec3::ZERO, turn)));
            if shape == Shape::Plane {
                let name = collision.attribute("name").unwrap_or("plane").to_owned();
                parts.push(Part { name, text, masks: [1, 1] });
            } else {
                texts.push(text);
            }
        }
        if !texts.is_empty() {
            parts.insert(0, Part { name: String::new(), text: union(&texts), masks: [1, 1] });
        }
        let mut scope = scope.clone();
        scope.collides_with_itself |= is_true(node, "self_collide");
        let link = Link {
            name: format!("{}::{name}", scope.prefix),
            at: xml::place(node),
            parent: None,
            origin: pose,
            dofs: Vec::new(),
            parts,
            is_free: !scope.is_static,
            is_static: scope.is_static,
        };
        Ok(Found { link, parent: None, pose, scope })
    }

    fn joint(&mut self, node: Node<'_, '_>, index: &HashMap<String, usize>, scope: &Scope) -> Result<()> {
        let name = needed(node, "name")?;
        let end = |tag: &'static str| {
            let word = text(node, tag).ok_or_else(|| xml::wrong(node, format!("a {tag} of the joint"), None))?.trim();
            match index.get(word) {
                Some(i) => Ok(Some(*i)),
                None if word == "world" => Ok(None),
                None => Err(xml::wrong(node, format!("the name of a link as {tag}"), Some(word))),
            }
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let Some(child) = child else { return Err(xml::wrong(node, "a link as child", Some("world"))) };
        let circle = self.circle(parent, child);
        if self.links[child].parent.is_some() || !self.links[child].link.dofs.is_empty() || circle {
            self.robot.note(xml::place(node), format!("the joint {name} closes a loop and is left out"));
            return Ok(());
        }
        let own = own_pose(node, &[text(node, "child").unwrap_or_default().trim()])?;
        let at = self.links[child].pose;
        let is_of_model = self.version < [1, 5];
        let mut dofs = Vec::new();
        let axes: &[&'static str] = match needed(node, "type")? {
            "fixed" => &[],
            "revolute" | "continuous" | "prismatic" => &["axis"],
            "revolute2" | "universal" => &["axis", "axis2"],
            other => {
                let sentence = format!("the joint {name} ({other}) is taken as it stands");
                self.robot.note(xml::place(node), sentence);
                self.links[child].parent = parent;
                self.links[child].link.is_free = true;
                return Ok(());
            }
        };
        for tag in axes {
            let axis = xml::inside(node, tag).next();
            let xyz = axis.and_then(|a| xml::inside(a, "xyz").next());
            let way = match xyz {
                None => DVec3::Z,
                Some(xyz) => vector_of(xyz, xyz.text().unwrap_or_default(), "axis")?,
            };
            let way = way.try_normalize().ok_or_else(|| xml::wrong(node, "an axis that is not 0", Some("0 0 0")))?;
            let of_model = is_of_model
                || axis.is_some_and(|a| is_true(a, "use_parent_model_frame"))
                || xyz.is_some_and(|x| x.attribute("expressed_in") == Some("__model__"));
            if let Some(frame) = xyz.and_then(|x| x.attribute("expressed_in")).filter(|f| *f != "__model__") {
                return Err(xml::wrong(node, "an axis in the joint's frame or the model's", Some(frame)));
            }
            // In the child's frame.
            let way = if of_model { at.rotation.conjugate() * (scope.pose.rotation * way) } else { own.rotation * way };
            if let Some(mimic) = axis.and_then(|a| xml::inside(a, "mimic").next()) {
                return Err((xml::place(mimic), Problem::unsupported("<mimic> of a joint of SDFormat")));
            }
            let limit = axis.and_then(|a| xml::inside(a, "limit").next());
            let bound = |key, none| match limit.and_then(|l| text(l, key)) {
                None => Ok(none),
                // Some write an endless limit as inf, or as a number that stands for it.
                Some(word) => match word.trim().parse::<f64>() {
                    Ok(x) if x.abs() >= 1e16 || x.is_infinite() => Ok(f64::INFINITY.copysign(x)),
                    _ => xml::finite(node, word, key),
                },
            };
            let range = [bound("lower", f64::NEG_INFINITY)?, bound("upper", f64::INFINITY)?];
            if range[0] > range[1] {
                let found = format!("{} and {}", range[0], range[1]);
                return Err(xml::wrong(node, "a lower limit below the upper one", Some(&found)));
            }
            let is_slide = needed(node, "type")? == "prismatic";
            let anchor = own.position;
            let kind = if is_slide { DofKind::Slide { axis: way } } else { DofKind::Hinge { anchor, axis: way } };
            let name = if *tag == "axis" { name.to_owned() } else { format!("{name}/2") };
            let whole = format!("{}::{name}", scope.prefix);
            dofs.push(Dof {
                name: if self.is_one_model(scope) { name } else { whole },
                kind,
                range,
                start: 0f64.clamp(range[0], range[1]),
                zero: 0.0,
                mimic: None,
            });
        }
        if self.links[child].scope.is_static && !dofs.is_empty() {
            self.robot.note(xml::place(node), format!("the joint {name} is of a static model and does not move"));
            dofs.clear();
        }
        let found = &mut self.links[child];
        (found.parent, found.link.dofs, found.link.is_free) = (parent, dofs, false);
        if parent.is_none() && found.link.dofs.is_empty() {
            found.link.is_static = true;
        }
        Ok(())
    }

    /// A file of one model has joints by their own names.
    fn is_one_model(&self, scope: &Scope) -> bool {
        self.links.iter().all(|l| l.scope.model == scope.model) && !scope.prefix.contains("::")
    }

    /// True where a link hangs on itself.
    fn circle(&self, parent: Option<usize>, child: usize) -> bool {
        let mut at = parent;
        while let Some(i) = at {
            if i == child {
                return true;
            }
            at = self.links[i].parent;
        }
        false
    }
}

/// Frames of a model by name, and what they are relative to.
struct Frames<'a, 'i> {
    model: Pose,
    nodes: HashMap<&'a str, Node<'a, 'i>>,
}

impl<'a, 'i> Frames<'a, 'i> {
    fn of(model: Node<'a, 'i>, pose: Pose) -> Self {
        let named = |n: Node<'a, 'i>| {
            let is_frame = ["link", "frame", "joint"].contains(&n.tag_name().name());
            n.attribute("name").filter(|_| is_frame).map(|name| (name, n))
        };
        // Of a link and a joint of one name, which old files have, the link is meant.
        let mut all: Vec<(&'a str, Node<'a, 'i>)> = model.children().filter_map(named).collect();
        all.sort_by_key(|(_, n)| n.tag_name().name() == "link");
        Self { model: pose, nodes: all.into_iter().collect() }
    }

    /// The pose in the world of a frame.
    fn pose(&self, name: &str, asker: Node<'_, '_>) -> Result<Pose> {
        self.within(name, asker, self.nodes.len() + 2)
    }

    fn within(&self, name: &str, asker: Node<'_, '_>, left: usize) -> Result<Pose> {
        if name == "__model__" || name == "world" {
            return Ok(self.model);
        }
        let Some(node) = self.nodes.get(name).filter(|_| left > 0) else {
            return Err(xml::wrong(asker, "frames that are there and lead to the model's", Some(name)));
        };
        let pose = xml::inside(*node, "pose").next();
        let own = pose.map(pose_of).transpose()?.unwrap_or(Pose::IDENTITY);
        let of = pose.and_then(|p| p.attribute("relative_to")).filter(|of| !of.is_empty());
        let of = of.or_else(|| node.attribute("attached_to")).map(str::to_owned);
        let of = of
            .or_else(|| (node.tag_name().name() == "joint").then(|| text(*node, "child")).flatten().map(str::to_owned));
        let base = match of {
            None => self.model,
            Some(of) => self.within(of.trim(), asker, left - 1)?,
        };
        Ok(base.compose(&own))
    }
}

/// Puts links into the robot, parents first, and says which pairs are not tested.
fn order(robot: &mut Robot, mut found: Vec<Found>) {
    let depth = |mut i: usize, found: &[Found]| {
        let mut depth = 0;
        while let Some(parent) = found[i].parent {
            (i, depth) = (parent, depth + 1);
        }
        depth
    };
    let depths: Vec<usize> = (0..found.len()).map(|i| depth(i, &found)).collect();
    let mut sorted: Vec<usize> = (0..found.len()).collect();
    sorted.sort_by_key(|i| (depths[*i], *i));
    let mut place = vec![0; found.len()];
    sorted.iter().enumerate().for_each(|(to, from)| place[*from] = to);
    let poses: Vec<Pose> = found.iter().map(|f| f.pose).collect();
    for i in &sorted {
        let parent = found[*i].parent;
        let link = &mut found[*i].link;
        link.origin = parent.map_or(poses[*i], |p| poses[p].inverse().compose(&poses[*i]));
        link.parent = parent.map(|p| place[p]);
        robot.links.push(link.clone());
    }
    for (a, i) in sorted.iter().enumerate() {
        for (b, j) in sorted.iter().enumerate().skip(a + 1) {
            let (p, q) = (&found[*i], &found[*j]);
            let are_one = p.scope.model == q.scope.model;
            let collide = p.scope.collides_with_itself && q.scope.collides_with_itself;
            let are_joined = p.parent == Some(*j) || q.parent == Some(*i);
            let never_move = p.scope.is_static && q.scope.is_static;
            if (are_one && !collide) || are_joined || never_move {
                robot.excepted.push([a, b]);
            }
        }
    }
}

/// The text of an element inside.
fn text<'a>(node: Node<'a, '_>, name: &'static str) -> Option<&'a str> {
    xml::inside(node, name).next().and_then(|n| n.text())
}

fn is_true(node: Node<'_, '_>, name: &'static str) -> bool {
    text(node, name).is_some_and(|word| ["1", "true"].contains(&word.trim()))
}

/// The pose of what stands in its parent element's frame, which may be called by one of some names.
fn own_pose(node: Node<'_, '_>, names: &[&str]) -> Result<Pose> {
    let Some(pose) = xml::inside(node, "pose").next() else { return Ok(Pose::IDENTITY) };
    match pose.attribute("relative_to") {
        Some(frame) if !frame.is_empty() && !names.contains(&frame) => {
            let what = format!("a pose of a {} relative to {frame:?}", node.tag_name().name());
            Err((xml::place(pose), Problem::unsupported(what)))
        }
        _ => pose_of(pose),
    }
}

/// A pose: a position, and roll, pitch, yaw or a quaternion.
fn pose_of(node: Node<'_, '_>) -> Result<Pose> {
    let words = node.text().unwrap_or_default();
    let numbers = numbers_of(node, words, "pose")?;
    let is_degrees = node.attribute("degrees").is_some_and(|d| ["1", "true"].contains(&d));
    let position = |n: &[f64]| DVec3::from_slice(n);
    match (numbers.as_slice(), node.attribute("rotation_format").unwrap_or("euler_rpy")) {
        ([], _) => Ok(Pose::IDENTITY),
        (all, "quat_xyzw") if all.len() == 7 => {
            let q = [all[3], all[4], all[5], all[6]];
            let q = unit_quaternion(q).or_else(|_| {
                DQuat::from_array(q).length().recip().is_finite().then(|| DQuat::from_array(q).normalize()).ok_or(())
            });
            let q = q.map_err(|()| xml::wrong(node, "a quaternion that is not 0", Some(words)))?;
            Ok(Pose::new(position(all), q))
        }
        (all, "euler_rpy") if all.len() == 6 => {
            let angles = DVec3::new(all[3], all[4], all[5]);
            let angles = if is_degrees { angles * (std::f64::consts::PI / 180.0) } else { angles };
            Ok(Pose::new(position(all), roll_pitch_yaw(angles)))
        }
        _ => Err(xml::wrong(node, "x y z roll pitch yaw as the pose", Some(words))),
    }
}

/// A geometry, with how it is turned; `None` for one that is empty on purpose.
fn geometry_of(node: Node<'_, '_>, reader: &Reader<'_>) -> Result<Option<(Shape, DQuat)>> {
    let kinds = "one of box, sphere, cylinder, capsule, cone, ellipsoid, plane, mesh as the geometry";
    let Some(shape) = node.children().find(|n| n.is_element()) else { return Ok(None) };
    let length = |key: &'static str, none: f64| match text(shape, key) {
        None => Ok(none),
        Some(word) => xml::finite(shape, word, key),
    };
    let vector = |key: &'static str, none: DVec3| match text(shape, key) {
        None => Ok(none),
        Some(word) => vector_of(shape, word, key),
    };
    let mut turn = DQuat::IDENTITY;
    // What is left out has the specification's default.
    let made = match shape.tag_name().name() {
        "empty" => return Ok(None),
        "box" => Shape::Box(vector("size", DVec3::ONE)?),
        "sphere" => Shape::Sphere(length("radius", 1.0)?),
        "cylinder" => Shape::Cylinder(length("radius", 1.0)?, length("length", 1.0)?),
        "capsule" => Shape::Capsule(length("radius", 0.5)?, length("length", 1.0)?),
        "cone" => Shape::Cone(length("radius", 0.5)?, length("length", 1.0)?),
        "ellipsoid" => Shape::Ellipsoid(vector("radii", DVec3::ONE)?),
        "plane" => {
            let normal = vector("normal", DVec3::Z)?;
            let unit =
                normal.try_normalize().ok_or_else(|| xml::wrong(shape, "a normal that is not 0", Some("0 0 0")))?;
            turn = DQuat::from_rotation_arc(DVec3::Z, unit);
            Shape::Plane
        }
        "mesh" => {
            if let Some(part) = xml::inside(shape, "submesh").next() {
                return Err(xml::wrong(part, "a whole mesh: parts of a file are not read", Some("submesh")));
            }
            let uri = text(shape, "uri").ok_or_else(|| xml::wrong(shape, "the uri of the mesh", None))?;
            Shape::Mesh(reader.file(uri.trim()), vector("scale", DVec3::ONE)?, reader.ask.hulls)
        }
        other => return Err(xml::wrong(shape, kinds, Some(other))),
    };
    Ok(Some((not_negative(shape, made)?, turn)))
}
