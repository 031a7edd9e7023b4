//! URDF: links and joints by name, collision geometry, limits, mimics; SRDF's disabled pairs.
//!
//! Source: wiki.ros.org/urdf/XML. Fixed axes roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll). Links that a joint connects are
//! not tested against each other.

use super::super::names::Names;
use super::super::problem::Problem;
use super::super::{Place, xml};
use super::kinematics::{Dof, DofKind, Link, Robot};
use super::reader::Reader;
use super::shape::{Collisions, Shape};
use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use roxmltree::Node;
use std::collections::HashMap;

pub(super) type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A joint as it is written.
struct Joint<'a, 'i> {
    node: Node<'a, 'i>,
    parent: usize,
    child: usize,
}

pub(super) fn read(root: Node<'_, '_>, reader: &Reader<'_>) -> Result<Robot> {
    let mut robot = Robot { name: root.attribute("name").unwrap_or_default().to_owned(), ..Robot::default() };
    let mut index = HashMap::new();
    let mut written = Vec::new();
    for node in xml::inside(root, "link") {
        let name = needed(node, "name")?;
        if index.insert(name, written.len()).is_some() {
            return Err(xml::wrong(node, "a name that no other link has", Some(name)));
        }
        written.push(node);
    }
    // Values that macros would have are no geometry; what a macro stands for may be.
    let is_macro = |n: &Node<'_, '_>| {
        let is_xacro = n.tag_name().namespace().is_some_and(|space| space.contains("xacro"));
        n.is_element() && is_xacro && !["arg", "property"].contains(&n.tag_name().name())
    };
    let macros = root.descendants().find(is_macro);
    if let Some(node) = macros {
        return Err(xml::wrong(node, "URDF without macros: run xacro first", Some(node.tag_name().name())));
    }
    if written.is_empty() {
        return Err(xml::wrong(root, "links of the robot", None));
    }
    let mut joints: Vec<Option<Joint<'_, '_>>> = written.iter().map(|_| None).collect();
    for node in xml::inside(root, "joint") {
        let end = |tag: &'static str| {
            let at =
                xml::inside(node, tag).next().ok_or_else(|| xml::wrong(node, format!("a {tag} of the joint"), None))?;
            let name = needed(at, "link")?;
            index.get(name).copied().ok_or_else(|| xml::wrong(at, "the name of a link", Some(name)))
        };
        let (parent, child) = (end("parent")?, end("child")?);
        if joints[child].is_some() {
            return Err(xml::wrong(node, "one joint above each link", Some("a second one")));
        }
        joints[child] = Some(Joint { node, parent, child });
    }
    // Parents first: a link comes when its parent has come.
    let mut place: Vec<Option<usize>> = vec![None; written.len()];
    for _ in 0..written.len() {
        let before = robot.links.len();
        for (i, node) in written.iter().enumerate() {
            let parent = joints[i].as_ref().map(|j| place[j.parent]);
            if place[i].is_some() || parent == Some(None) {
                continue;
            }
            place[i] = Some(robot.links.len());
            let link = link(*node, joints[i].as_ref(), parent.flatten(), reader, &mut robot)?;
            robot.links.push(link);
        }
        if robot.links.len() == before {
            break;
        }
    }
    if let Some(joint) = joints.iter().flatten().find(|j| place[j.child].is_none()) {
        return Err(xml::wrong(joint.node, "a tree of links", Some("joints in a circle")));
    }
    if let Some(second) = robot.links.iter().filter(|l| l.parent.is_none()).nth(1) {
        return Err((second.at, Problem::syntax("one root of the tree", format!("a second one, {:?}", second.name))));
    }
    mimics(&robot, root)?;
    robot.except_neighbours();
    for (node, text) in Names::of_urdf().unknown(root) {
        reader.note(&mut robot, node, text);
    }
    Ok(robot)
}

/// Joints that others follow are there.
fn mimics(robot: &Robot, root: Node<'_, '_>) -> Result<()> {
    for node in xml::inside(root, "joint").flat_map(|j| xml::inside(j, "mimic")) {
        let leader = needed(node, "joint")?;
        let known = robot.free().any(|d| d.name == leader);
        if !known {
            return Err(xml::wrong(node, "a joint that moves by itself and can be followed", Some(leader)));
        }
    }
    Ok(())
}

fn link(
    node: Node<'_, '_>,
    joint: Option<&Joint<'_, '_>>,
    parent: Option<usize>,
    reader: &Reader<'_>,
    robot: &mut Robot,
) -> Result<Link> {
    let name = needed(node, "name")?.to_owned();
    let mut collisions = Collisions::default();
    for collision in xml::inside(node, "collision") {
        let Some(geometry) = xml::inside(collision, "geometry").next() else {
            return Err(xml::wrong(collision, "a geometry of the collision", None));
        };
        let shape = geometry_of(geometry, reader)?;
        for other in geometry.children().filter(|n| n.is_element()).skip(1) {
            // As other readers take it.
            let kind = other.tag_name().name();
            robot.note(xml::place(other), format!("a collision of {name} has a shape already: its {kind} is left out"));
        }
        if shape.is_nothing() {
            robot.note(xml::place(geometry), format!("a collision of {name} has no inside and is left out"));
            continue;
        }
        collisions.add(&shape, &origin(collision)?, collision.attribute("name"));
    }
    let parts = collisions.parts();
    let (origin, dofs) = match joint {
        None => (Pose::IDENTITY, vec![]),
        Some(joint) => (origin(joint.node)?, dofs_of(joint.node, robot)?),
    };
    let is_free = joint
        .is_some_and(|j| ["floating", "planar", "spherical"].contains(&j.node.attribute("type").unwrap_or_default()));
    Ok(Link { name, at: xml::place(node), parent, origin, dofs, parts, is_free, is_static: false })
}

/// The degrees of freedom of a joint.
fn dofs_of(node: Node<'_, '_>, robot: &mut Robot) -> Result<Vec<Dof>> {
    let name = needed(node, "name")?.to_owned();
    let axis = match xml::inside(node, "axis").next() {
        None => DVec3::X,
        Some(axis) => vector(axis, "xyz", DVec3::X)?,
    };
    let limit = xml::inside(node, "limit").next();
    let endless = [f64::NEG_INFINITY, f64::INFINITY];
    let limits = || match limit {
        None => Ok(endless),
        Some(limit) => Ok([xml::number(limit, "lower")?.unwrap_or(0.0), xml::number(limit, "upper")?.unwrap_or(0.0)]),
    };
    if limit.is_none() && matches!(node.attribute("type"), Some("revolute" | "prismatic")) {
        // wiki.ros.org/urdf/XML wants one; MuJoCo, Drake and pybullet take such a joint as one without limits.
        robot.note(xml::place(node), format!("the joint {name} has no limit: it is taken without limits"));
    }
    let anchor = DVec3::ZERO;
    let along = || {
        axis.try_normalize()
            .ok_or_else(|| xml::wrong(node, format!("an axis of {name} that is not 0"), Some(&axis.to_string())))
    };
    let (kind, mut range) = match needed(node, "type")? {
        "fixed" => return Ok(vec![]),
        "revolute" => (DofKind::Hinge { anchor, axis: along()? }, limits()?),
        "continuous" => (DofKind::Hinge { anchor, axis: along()? }, endless),
        "prismatic" => (DofKind::Slide { axis: along()? }, limits()?),
        // The last one is pybullet's.
        "floating" | "planar" | "spherical" => {
            robot.note(xml::place(node), format!("the joint {name} is taken as fixed where it stands"));
            return Ok(vec![]);
        }
        other => {
            let kinds = "one of fixed, revolute, continuous, prismatic, floating, planar as the joint's type";
            return Err(xml::wrong(node, kinds, Some(other)));
        }
    };
    if range[0] > range[1] {
        // As pybullet has it, which writes them so where there are none.
        robot
            .note(xml::place(node), format!("the limits of {name}, {} and {}, are none: left out", range[0], range[1]));
        range = endless;
    }
    let mimic = match xml::inside(node, "mimic").next() {
        None => None,
        Some(m) => {
            let factor = xml::number(m, "multiplier")?.unwrap_or(1.0);
            Some((needed(m, "joint")?.to_owned(), factor, xml::number(m, "offset")?.unwrap_or(0.0)))
        }
    };
    Ok(vec![Dof { name, kind, start: 0f64.clamp(range[0], range[1]), zero: 0.0, range, mimic }])
}

fn geometry_of(node: Node<'_, '_>, reader: &Reader<'_>) -> Result<Shape> {
    let kinds = "one of box, cylinder, sphere, capsule, plane, mesh as the geometry";
    let Some(shape) = node.children().find(|n| n.is_element()) else { return Err(xml::wrong(node, kinds, None)) };
    let length = |key: &str| {
        xml::number(shape, key)?
            .ok_or_else(|| xml::wrong(shape, format!("{key} of the {}", shape.tag_name().name()), None))
    };
    let made = match shape.tag_name().name() {
        "box" => Shape::Box(vector(shape, "size", DVec3::NAN)?),
        "sphere" => Shape::Sphere(length("radius")?),
        "cylinder" => Shape::Cylinder(length("radius")?, length("length")?),
        "capsule" => Shape::Capsule(length("radius")?, length("length")?),
        // pybullet's, which has a normal, too.
        "plane" => {
            let normal = vector(shape, "normal", DVec3::Z)?;
            if normal.try_normalize() != Some(DVec3::Z) {
                return Err(xml::wrong(
                    shape,
                    "0 0 1 as the normal of a plane: turn it by its origin",
                    shape.attribute("normal"),
                ));
            }
            Shape::Plane
        }
        "mesh" => {
            let file = reader.file(needed(shape, "filename")?);
            Shape::Mesh(file, vector(shape, "scale", DVec3::ONE)?, reader.ask.hulls)
        }
        other => return Err(xml::wrong(shape, kinds, Some(other))),
    };
    not_negative(shape, made)
}

/// A shape whose lengths can be some.
pub(super) fn not_negative(node: Node<'_, '_>, shape: Shape) -> Result<Shape> {
    match shape.negative() {
        None => Ok(shape),
        Some(length) => {
            let expected = format!("lengths of the {} that are not negative", node.tag_name().name());
            Err(xml::wrong(node, expected, Some(&length.to_string())))
        }
    }
}

/// The pose of an element's `origin`.
fn origin(node: Node<'_, '_>) -> Result<Pose> {
    let Some(origin) = xml::inside(node, "origin").next() else { return Ok(Pose::IDENTITY) };
    if origin.has_attribute("quat_xyzw") {
        return Err((xml::place(origin), Problem::unsupported("quat_xyzw of an origin")));
    }
    Ok(Pose::new(vector(origin, "xyz", DVec3::ZERO)?, roll_pitch_yaw(vector(origin, "rpy", DVec3::ZERO)?)))
}

/// Rz(yaw) Ry(pitch) Rx(roll).
pub(super) fn roll_pitch_yaw(v: DVec3) -> DQuat {
    (DQuat::from_rotation_z(v.z) * DQuat::from_rotation_y(v.y) * DQuat::from_rotation_x(v.x)).normalize()
}

/// Three numbers that an attribute gives; `default` where there is none, which is refused if it is NaN.
fn vector(node: Node<'_, '_>, attribute: &str, default: DVec3) -> Result<DVec3> {
    match node.attribute(attribute) {
        Some(text) => vector_of(node, text, attribute),
        None if default.is_nan() => {
            Err(xml::wrong(node, format!("{attribute} of the {}", node.tag_name().name()), None))
        }
        None => Ok(default),
    }
}

/// The three numbers of a text.
pub(super) fn vector_of(node: Node<'_, '_>, text: &str, what: &str) -> Result<DVec3> {
    let numbers = numbers_of(node, text, what)?;
    let three = <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array);
    three.ok_or_else(|| xml::wrong(node, format!("three numbers as {what} of {}", node.tag_name().name()), Some(text)))
}

/// The numbers of a text.
pub(super) fn numbers_of(node: Node<'_, '_>, text: &str, what: &str) -> Result<Vec<f64>> {
    text.split_whitespace().map(|word| xml::finite(node, word, what)).collect()
}

/// An attribute that has to be there.
pub(super) fn needed<'a>(node: Node<'a, '_>, attribute: &str) -> Result<&'a str> {
    node.attribute(attribute)
        .ok_or_else(|| xml::wrong(node, format!("{attribute} of the {}", node.tag_name().name()), None))
}

/// The pairs of an SRDF text that are not to be tested: those of links that are tested against none by default, but for pairs that are
/// enabled, which are tested although a joint connects them; then those that are disabled.
pub(super) fn disabled(root: Node<'_, '_>, robot: &mut Robot) -> Result<()> {
    let kind = root.tag_name().name();
    if kind != "robot" {
        return Err(xml::wrong(root, "a robot (SRDF) as the root element", Some(kind)));
    }
    if let Some(node) = root.children().find(|n| ["link", "joint", "material"].contains(&n.tag_name().name())) {
        return Err(xml::wrong(node, "SRDF, which names links and joints of a URDF", Some(node.tag_name().name())));
    }
    for node in xml::inside(root, "disable_default_collisions") {
        let name = needed(node, "link")?;
        let found = robot.links.iter().position(|l| l.name == name);
        let link = found.ok_or_else(|| xml::wrong(node, "the name of a link", Some(name)))?;
        robot.excepted.extend((0..robot.links.len()).map(|other| [link.min(other), link.max(other)]));
    }
    for pair in pairs(root, "enable_collisions", robot)? {
        robot.excepted.remove(&pair);
    }
    let disabled = pairs(root, "disable_collisions", robot)?;
    robot.excepted.extend(disabled);
    Ok(())
}

/// Pairs of links by the elements of a name.
fn pairs(root: Node<'_, '_>, element: &'static str, robot: &Robot) -> Result<Vec<[usize; 2]>> {
    let mut all = Vec::new();
    for node in xml::inside(root, element) {
        let mut pair = [0; 2];
        for (k, key) in ["link1", "link2"].into_iter().enumerate() {
            let name = needed(node, key)?;
            let found = robot.links.iter().position(|l| l.name == name);
            pair[k] = found.ok_or_else(|| xml::wrong(node, "the name of a link", Some(name)))?;
        }
        pair.sort_unstable();
        all.push(pair);
    }
    Ok(all)
}
