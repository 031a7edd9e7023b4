//! SDFormat: worlds and models with their links, joints and frames.
//!
//! Source: sdformat.org/spec. A pose is relative to the frame that it names, else to its parent element's; a joint's to its child.
//! Links of a model are tested against each other where `self_collide` says so; static models against all others. What is in a model
//! is called `MODEL::NAME`, joints too; those of a file that has one model are called by their own names.

use super::super::names::Names;
use super::super::problem::Problem;
use super::super::{Place, xml};
use super::frames::{Attached, Frames, Lost};
use super::kinematics::{Dof, DofKind, Link, Robot};
use super::reader::Reader;
use super::sdf_elements::{content, geometry_of, is_set, is_true, placed, text, version_of};
use super::shape::Collisions;
use super::urdf::{Result, needed, vector_of};
use contactd_proto::Pose;
use glam::DVec3;
use roxmltree::{Document, Node};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Models within models.
const DEEPEST: usize = 32;

pub(super) fn read(root: Node<'_, '_>, reader: &Reader<'_>) -> Result<Robot> {
    let file = File { reader, version: version_of(root).unwrap_or([1, 7]) };
    let mut all = World { robot: Robot::default(), links: Vec::new(), short: HashMap::new(), depth: 0, count: 0 };
    let worlds: Vec<Node<'_, '_>> = xml::inside(root, "world").collect();
    for node in if worlds.is_empty() { vec![root] } else { worlds } {
        all.scope(node, &file, &Scope::WORLD)?;
    }
    let World { mut robot, links, short, .. } = all;
    let is_one_model = links.iter().all(|l| l.scope.model == Some(1));
    order(&mut robot, links);
    let own = |name: &str| short.get(name).cloned().filter(|_| is_one_model).unwrap_or_else(|| name.to_owned());
    for dof in robot.links.iter_mut().flat_map(|l| &mut l.dofs) {
        dof.name = own(&dof.name);
        dof.mimic.iter_mut().for_each(|(leader, ..)| *leader = own(leader));
    }
    robot.follow()?;
    misspelled(root, reader, &mut robot);
    Ok(robot)
}

/// Tells what of a file has no name of the format.
fn misspelled(root: Node<'_, '_>, reader: &Reader<'_>, robot: &mut Robot) {
    for (node, text) in Names::of_sdf().unknown(root) {
        reader.note(robot, node, text);
        // A file that is included again has the same ones.
        if let Some((last, before)) = robot.notes.split_last()
            && before.iter().any(|note| note.text == last.text)
        {
            robot.notes.pop();
        }
    }
}

/// A file, and how it is to be read.
struct File<'a> {
    reader: &'a Reader<'a>,
    version: [u32; 2],
}

/// What is known where something stands.
#[derive(Clone, Debug)]
struct Scope {
    /// What its links are called before their own names.
    prefix: String,
    is_static: bool,
    /// The outermost model's number; links of one that does not collide with itself are not tested against each other.
    model: Option<usize>,
    collides_with_itself: bool,
}

impl Scope {
    const WORLD: Self = Self { prefix: String::new(), is_static: false, model: None, collides_with_itself: false };

    fn whole(&self, name: &str) -> String {
        if self.prefix.is_empty() { name.to_owned() } else { format!("{}::{name}", self.prefix) }
    }
}

/// A link before its parents are known to come first.
struct Found {
    link: Link,
    /// The link above, by its index among those found.
    parent: Option<usize>,
    /// In the scope that is being read, in the end in the world.
    pose: Pose,
    scope: Scope,
}

/// A model within: what its frame is called, where it stands, and its links.
struct Inner {
    at: Place,
    frame: String,
    links: Range<usize>,
}

struct World {
    robot: Robot,
    links: Vec<Found>,
    /// Own names of joints that stand in the first model itself, by their whole ones.
    short: HashMap<String, String>,
    depth: usize,
    /// Models so far.
    count: usize,
}

impl World {
    /// What is in a world or a model, with its frames. Its links stand in its frame then.
    fn scope(&mut self, node: Node<'_, '_>, file: &File<'_>, scope: &Scope) -> Result<Frames> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "models within models", limit: DEEPEST }));
        }
        let is_model = scope.model.is_some();
        let mut frames =
            if is_model { Frames::new("__model__", Attached::Nothing) } else { Frames::new("world", Attached::World) };
        let mut links = Vec::new();
        for link in xml::inside(node, "link").filter(|_| is_model) {
            let name = needed(link, "name")?;
            let index = self.links.len();
            links.push((link, name, index));
            self.links.push(Found::new(name, link, file, scope)?);
            add(&mut frames, link, name, placed(link)?, Attached::Link(index), file)?;
        }
        let mut inner = Vec::new();
        for model in xml::inside(node, "model") {
            let name = model.attribute("name").unwrap_or("model");
            inner.push(self.model(model, file, &Placement::of(model, name, file)?, (scope, &mut frames))?);
        }
        for include in xml::inside(node, "include") {
            inner.extend(self.include(include, file, scope, &mut frames)?);
        }
        if is_model {
            let first = links.first().map(|l| l.1.to_owned()).or_else(|| inner.first().map(|i| i.frame.clone()));
            let chosen = node.attribute("canonical_link").filter(|name| !name.is_empty()).map(str::to_owned);
            frames.set_root(chosen.or(first).map_or(Attached::Nothing, Attached::Frame));
        }
        self.named(node, file, &mut frames)?;
        for Inner { at: asker, frame, links } in &inner {
            let at = frames.pose(frame, frames.root()).map_err(|e| (*asker, lost(&e)))?;
            self.links[links.clone()].iter_mut().for_each(|l| l.pose = at.compose(&l.pose));
        }
        for (node, name, index) in &links {
            self.links[*index].pose = frames.pose(name, frames.root()).map_err(|e| (xml::place(*node), lost(&e)))?;
            self.link(*node, file, &frames, (name, *index))?;
        }
        let first = links.first().map(|l| l.2).into_iter().chain(inner.first().map(|i| i.links.start)).min();
        for joint in xml::inside(node, "joint") {
            self.joint(joint, file, &frames, scope)?;
        }
        self.leaders(node, scope, first.unwrap_or(self.links.len()))?;
        for kind in ["actor", "road", "population", "heightmap"] {
            if let Some(left) = xml::inside(node, kind).next() {
                file.reader.note(&mut self.robot, left, format!("{kind} is left out: it is not read"));
            }
        }
        self.depth -= 1;
        Ok(frames)
    }

    /// Adds the frames that have names of their own, and those of joints.
    fn named(&self, node: Node<'_, '_>, file: &File<'_>, frames: &mut Frames) -> Result<()> {
        for frame in xml::inside(node, "frame") {
            let to = frame.attribute("attached_to").map(str::trim).filter(|to| !to.is_empty());
            let to = to.unwrap_or(frames.root()).to_owned();
            let (pose, of) = placed(frame)?;
            let of = of.unwrap_or_else(|| to.clone());
            add(frames, frame, needed(frame, "name")?, (pose, Some(of)), Attached::Frame(to), file)?;
        }
        for joint in xml::inside(node, "joint") {
            let child = text(joint, "child").unwrap_or_default().trim().to_owned();
            let (pose, of) = placed(joint)?;
            let of = of.unwrap_or_else(|| child.clone());
            add(frames, joint, needed(joint, "name")?, (pose, Some(of)), Attached::Frame(child), file)?;
        }
        Ok(())
    }

    /// A model of another file; none where that has a light or an actor instead.
    fn include(
        &mut self,
        node: Node<'_, '_>,
        file: &File<'_>,
        scope: &Scope,
        frames: &mut Frames,
    ) -> Result<Option<Inner>> {
        let uri = text(node, "uri").ok_or_else(|| xml::wrong(node, "the uri of what is included", None))?.trim();
        let named = file.reader.file(uri);
        let path = file.reader.main_folder().join(&named);
        // A model's folder, or the file itself.
        let (path, base) = if path.is_dir() {
            (model_file(&path), PathBuf::from(&named))
        } else {
            (path, Path::new(&named).parent().map(Path::to_owned).unwrap_or_default())
        };
        let found = |e: String| {
            let sentence = Problem::syntax(format!("the model {uri}, as {}", path.display()), e);
            (xml::place(node), sentence)
        };
        if !path.exists() {
            return Err((xml::place(node), absent(uri)));
        }
        let bytes =
            super::super::read_bytes(&path, &super::super::Limits::default()).map_err(|e| found(e.to_string()))?;
        let told = |(at, problem): (Place, Problem)| {
            let named = Problem::Named { file: path.display().to_string(), at, problem: Box::new(problem) };
            (xml::place(node), named)
        };
        let bytes = xml::mended(bytes);
        let document: Document<'_> = xml::parse(&bytes).map_err(told)?;
        let root = document.root_element();
        let within = Some(file.reader.place(node));
        let reader = Reader { path: &path, base, within, ..*file.reader };
        misspelled(root, &reader, &mut self.robot);
        let inner = File { reader: &reader, version: version_of(root).unwrap_or(file.version) };
        let Some(model) = xml::inside(root, "model").next() else {
            // A file may hold a light or an actor in a model's place (sdformat.org/spec, include): `model://sun` of nearly every
            // world is a light, which has no geometry.
            if xml::inside(root, "actor").next().is_some() {
                file.reader.note(&mut self.robot, node, format!("the actor {uri} is left out: it is not read"));
            } else if xml::inside(root, "light").next().is_none() {
                return Err(found("no model in it".into()));
            }
            return Ok(None);
        };
        let name = text(node, "name").map(str::trim).unwrap_or(model.attribute("name").unwrap_or("model"));
        let mut place = Placement::of(model, name, file).map_err(told)?;
        let frame = text(node, "placement_frame").map(|frame| frame.trim().to_owned());
        if xml::inside(node, "pose").next().is_some() {
            (place.pose, place.of) = placed(node)?;
        } else if frame.is_some() {
            return Err(xml::wrong(node, "a pose beside the placement_frame", None));
        }
        place.frame = frame.or(place.frame);
        place.is_merged = is_set(node, "merge")?;
        if place.is_merged && scope.model.is_none() {
            return Err(xml::wrong(node, "an include that is merged within a model", Some("one within a world")));
        }
        let scope = &Scope { is_static: is_true(node, "static")? || scope.is_static, ..scope.clone() };
        place.asker = Some(file.reader.place(node));
        let placed = self.model(model, &inner, &place, (scope, frames)).map_err(|(at, e)| match place.asker {
            // What is wrong with the name or the place of the include itself.
            Some(asker) if asker == at && matches!(e, Problem::Syntax { .. }) => (at, e),
            _ => told((at, e)),
        })?;
        Ok(Some(placed))
    }

    /// A model, whose frames are added to those around it.
    fn model(
        &mut self,
        node: Node<'_, '_>,
        file: &File<'_>,
        place: &Placement,
        (outer, around): (&Scope, &mut Frames),
    ) -> Result<Inner> {
        let at = place.asker.unwrap_or(xml::place(node));
        self.count += 1;
        let name = self.own_name(place, around, at)?;
        let scope = Scope {
            prefix: if place.is_merged { outer.prefix.clone() } else { outer.whole(&name) },
            is_static: is_true(node, "static")? || outer.is_static,
            model: outer.model.or(Some(self.count)),
            collides_with_itself: is_true(node, "self_collide")? || outer.collides_with_itself,
        };
        let first = self.links.len();
        let frames = self.scope(node, file, &scope)?;
        if self.links.len() == first + 1 && outer.prefix.is_empty() {
            // A model that is one link is called as the model is.
            self.links[first].link.name = scope.prefix;
        }
        let back = match place.frame.as_deref() {
            None => Pose::IDENTITY,
            Some(frame) => frames.pose("__model__", frame).map_err(|e| (at, lost(&e)))?,
        };
        let frame = if place.is_merged { format!("_merged__{name}__model__") } else { name };
        let pose = if place.frame.is_none() { place.pose } else { place.pose.compose(&back) };
        let of = place.of.clone().unwrap_or_else(|| around.root().to_owned());
        let with = match frames.root_frame() {
            Some(link) if place.is_merged => Attached::Frame(link.to_owned()),
            Some(link) => Attached::Frame(format!("{frame}::{link}")),
            None => Attached::Nothing,
        };
        if !(around.add(&frame, pose, &of, with) && around.adopt(frames, &frame, place.is_merged)) {
            let found = Problem::syntax("names that nothing else in the model has", format!("those of {frame:?}"));
            return Err((at, found));
        }
        Ok(Inner { at, frame, links: first..self.links.len() })
    }

    /// The name of a model: another one where the name is taken, as files before 1.7 may have it.
    fn own_name(&mut self, place: &Placement, around: &Frames, at: Place) -> Result<String> {
        let mut name = place.name.clone();
        for k in 1.. {
            if !around.has(&name) {
                break;
            }
            if place.version >= [1, 7] {
                let problem = Problem::syntax("a name that nothing else beside it has", format!("a second {name:?}"));
                return Err((at, problem));
            }
            name = format!("{}_{k}", place.name);
        }
        if name != place.name {
            self.robot.note(at, format!("a second {:?} is called {name}", place.name));
        }
        Ok(name)
    }

    fn link(&mut self, node: Node<'_, '_>, file: &File<'_>, frames: &Frames, (name, at): (&str, usize)) -> Result<()> {
        let mut collisions = Collisions::default();
        for collision in xml::inside(node, "collision") {
            let Some(geometry) = xml::inside(collision, "geometry").next() else {
                return Err(xml::wrong(collision, "a geometry of the collision", None));
            };
            let Some((shape, turn)) = geometry_of(geometry, file.reader)? else { continue };
            if shape.is_nothing() {
                let sentence = format!("a collision of {name} has no inside and is left out");
                file.reader.note(&mut self.robot, geometry, sentence);
                continue;
            }
            let (own, of) = placed(collision)?;
            let own = match of.filter(|of| of != name) {
                None => own,
                Some(of) => frames.pose(&of, name).map_err(|e| (xml::place(collision), lost(&e)))?.compose(&own),
            };
            let at = own.compose(&Pose::new(DVec3::ZERO, turn));
            collisions.add(&shape, &at, collision.attribute("name"));
        }
        self.links[at].link.parts = collisions.parts();
        Ok(())
    }

    fn joint(&mut self, node: Node<'_, '_>, file: &File<'_>, frames: &Frames, scope: &Scope) -> Result<()> {
        let name = needed(node, "name")?;
        let end = |tag: &'static str| {
            let word = text(node, tag).ok_or_else(|| xml::wrong(node, format!("a {tag} of the joint"), None))?.trim();
            if word == "world" {
                return Ok(None);
            }
            let sentence = |(found, what): Lost| {
                let expected = format!("the name of a link or of a frame that goes with one as {tag}");
                (xml::place(node), Problem::syntax(expected, format!("{found:?}, {what}")))
            };
            frames.link(word).map_err(sentence)
        };
        let (parent, child) = (end("parent")?.map(|p| p.0), end("child")?);
        let Some((child, child_frame)) = child else { return Err(xml::wrong(node, "a link as child", Some("world"))) };
        let circle = self.circle(parent, child);
        if self.links[child].parent.is_some() || !self.links[child].link.dofs.is_empty() || circle {
            file.reader.note(&mut self.robot, node, format!("the joint {name} closes a loop and is left out"));
            return Ok(());
        }
        let (pose, of) = placed(node)?;
        let of = of.unwrap_or_else(|| text(node, "child").unwrap_or_default().trim().to_owned());
        // In the child link's frame.
        let own = frames.pose(&of, child_frame).map_err(|e| (xml::place(node), lost(&e)))?.compose(&pose);
        let kind = needed(node, "type")?;
        let axes: &[&'static str] = match kind {
            "fixed" => &[],
            "revolute" | "continuous" | "prismatic" => &["axis"],
            "revolute2" | "universal" => &["axis", "axis2"],
            other => {
                file.reader.note(&mut self.robot, node, format!("the joint {name} ({other}) is taken as it stands"));
                self.links[child].parent = parent;
                self.links[child].link.is_free = true;
                return Ok(());
            }
        };
        let mut dofs = Vec::new();
        for tag in axes {
            let asked = Axis { node, tag, is_slide: kind == "prismatic", of_model: file.version < [1, 5] };
            let name = if *tag == "axis" { name.to_owned() } else { format!("{name}/2") };
            let mut dof = asked.dof(frames, child_frame, &own)?;
            dof.name = scope.whole(&name);
            dof.mimic.iter_mut().for_each(|(leader, ..)| *leader = scope.whole(leader));
            let is_own = scope.model == Some(1) && !scope.prefix.contains("::");
            if is_own {
                self.short.insert(dof.name.clone(), name);
            }
            dofs.push(dof);
        }
        if self.links[child].scope.is_static && !dofs.is_empty() {
            file.reader.note(&mut self.robot, node, format!("the joint {name} is of a static model and does not move"));
            dofs.clear();
        }
        let found = &mut self.links[child];
        (found.parent, found.link.dofs, found.link.is_free) = (parent, dofs, false);
        if parent.is_none() && found.link.dofs.is_empty() {
            found.link.is_static = true;
        }
        Ok(())
    }

    /// Joints that others follow are there.
    fn leaders(&self, node: Node<'_, '_>, scope: &Scope, first: usize) -> Result<()> {
        let dofs = || self.links[first..].iter().flat_map(|l| &l.link.dofs);
        for joint in xml::inside(node, "joint") {
            for mimic in
                ["axis", "axis2"].iter().flat_map(|a| xml::inside(joint, a)).flat_map(|a| xml::inside(a, "mimic"))
            {
                let leader = leader(mimic)?;
                if !dofs().any(|d| d.name == scope.whole(&leader)) {
                    return Err(xml::wrong(mimic, "a joint that moves and can be followed", Some(&leader)));
                }
            }
        }
        Ok(())
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

impl Found {
    fn new(name: &str, node: Node<'_, '_>, file: &File<'_>, scope: &Scope) -> Result<Self> {
        let mut scope = scope.clone();
        scope.collides_with_itself |= is_true(node, "self_collide")?;
        let link = Link {
            name: scope.whole(name),
            at: file.reader.place(node),
            parent: None,
            origin: Pose::IDENTITY,
            dofs: Vec::new(),
            parts: Vec::new(),
            is_free: !scope.is_static,
            is_static: scope.is_static,
        };
        Ok(Self { link, parent: None, pose: Pose::IDENTITY, scope })
    }
}

/// Where a model is put.
struct Placement {
    name: String,
    pose: Pose,
    of: Option<String>,
    /// The frame of the model that the pose is of.
    frame: Option<String>,
    is_merged: bool,
    /// The include that asks for it.
    asker: Option<Place>,
    /// Of the file that has it.
    version: [u32; 2],
}

impl Placement {
    fn of(model: Node<'_, '_>, name: &str, file: &File<'_>) -> Result<Self> {
        let (pose, of) = placed(model)?;
        let frame = model.attribute("placement_frame").filter(|frame| !frame.is_empty()).map(str::to_owned);
        let version = file.version;
        Ok(Self { name: name.to_owned(), pose, of, frame, is_merged: false, asker: None, version })
    }
}

/// An axis of a joint.
struct Axis<'a, 'i> {
    node: Node<'a, 'i>,
    tag: &'static str,
    is_slide: bool,
    /// Its direction is of the model's frame, as old files have it.
    of_model: bool,
}

impl Axis<'_, '_> {
    /// What it lets move, in the child link's frame; `own` is the joint's frame there. It has its own name yet.
    fn dof(&self, frames: &Frames, child: &str, own: &Pose) -> Result<Dof> {
        let node = self.node;
        let axis = xml::inside(node, self.tag).next();
        let xyz = axis.and_then(|a| xml::inside(a, "xyz").next());
        let way = match xyz {
            None => DVec3::Z,
            Some(xyz) => vector_of(xyz, content(xyz).unwrap_or_default(), "axis")?,
        };
        let way = way.try_normalize().ok_or_else(|| xml::wrong(node, "an axis that is not 0", Some("0 0 0")))?;
        let is_asked = axis.map_or(Ok(false), |a| is_true(a, "use_parent_model_frame"))?;
        let of_model = is_asked || self.of_model;
        let of = xyz.and_then(|x| x.attribute("expressed_in")).filter(|of| !of.is_empty());
        let way = match of.or(of_model.then_some(frames.root())) {
            None => own.rotation * way,
            Some(of) => frames.pose(of, child).map_err(|e| (xml::place(node), lost(&e)))?.rotation * way,
        };
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
        let anchor = own.position;
        let kind = if self.is_slide { DofKind::Slide { axis: way } } else { DofKind::Hinge { anchor, axis: way } };
        let mimic = axis.and_then(|a| xml::inside(a, "mimic").next()).map(mimic).transpose()?;
        Ok(Dof { name: String::new(), kind, range, start: 0f64.clamp(range[0], range[1]), zero: 0.0, mimic })
    }
}

/// Which joint is followed, in its own scope.
fn leader(mimic: Node<'_, '_>) -> Result<String> {
    let joint = needed(mimic, "joint")?;
    match mimic.attribute("axis").unwrap_or("axis") {
        "axis" => Ok(joint.to_owned()),
        "axis2" => Ok(format!("{joint}/2")),
        other => Err(xml::wrong(mimic, "axis or axis2 as the axis that is followed", Some(other))),
    }
}

/// How a joint follows another one: factor (that one − reference) + offset.
fn mimic(node: Node<'_, '_>) -> Result<(String, f64, f64)> {
    let number = |key: &'static str| text(node, key).map(|word| xml::finite(node, word, key)).transpose();
    let factor = number("multiplier")?.ok_or_else(|| xml::wrong(node, "a multiplier of the mimic", None))?;
    let (offset, reference) = (number("offset")?.unwrap_or(0.0), number("reference")?.unwrap_or(0.0));
    Ok((leader(node)?, factor, offset - factor * reference))
}

/// The sentence for a model that is in no folder: what may be done depends on whether it is one of this machine at all.
fn absent(uri: &str) -> Problem {
    if uri.contains("://") && !["model://", "package://", "file://"].iter().any(|way| uri.starts_with(way)) {
        let expected = "a model of this machine (download it, and say model://NAME with its folder among the packages)";
        return Problem::syntax(expected, uri);
    }
    Problem::syntax(
        format!("the model {uri} beside the file, in the folders above it or in one of packages (--packages DIR)"),
        "none",
    )
}

/// The file of a model's folder: what `model.config` says for the newest version, else `model.sdf`.
fn model_file(folder: &Path) -> PathBuf {
    let limits = super::super::Limits::default();
    let stated = super::super::read_bytes(&folder.join("model.config"), &limits).ok().and_then(|bytes| {
        let bytes = xml::mended(bytes);
        let document = xml::parse(&bytes).ok()?;
        let files = xml::inside(document.root_element(), "sdf");
        let newest = files.filter(|n| content(*n).is_some()).max_by_key(|n| version_of(*n))?;
        content(newest).map(|name| folder.join(name.trim()))
    });
    stated.filter(|path| path.starts_with(folder)).unwrap_or_else(|| folder.join("model.sdf"))
}

/// Adds a frame. Of names that several have, which files before 1.7 may, the first one counts: of a link and a joint the link's.
fn add(
    frames: &mut Frames,
    node: Node<'_, '_>,
    name: &str,
    (pose, of): (Pose, Option<String>),
    attached: Attached,
    file: &File<'_>,
) -> Result<()> {
    let of = of.unwrap_or_else(|| frames.root().to_owned());
    if !frames.add(name, pose, &of, attached) && file.version >= [1, 7] {
        return Err(xml::wrong(node, "a name that nothing else beside it has", Some(name)));
    }
    Ok(())
}

/// A frame that is not found.
fn lost((name, what): &Lost) -> Problem {
    Problem::syntax("frames that are there and lead to the scope's own", format!("{name:?}, {what}"))
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
                robot.excepted.insert([a, b]);
            }
        }
    }
}
