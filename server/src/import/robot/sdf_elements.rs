//! Elements of SDFormat that name no others: poses, geometries, flags.

use super::super::xml;
use super::reader::Reader;
use super::shape::Shape;
use super::urdf::{Result, not_negative, numbers_of, roll_pitch_yaw, vector_of};
use contactd_proto::Pose;
use contactd_proto::pose_record::unit_quaternion;
use glam::{DQuat, DVec2, DVec3};
use roxmltree::Node;

/// Major and minor: 1.10 comes after 1.9.
pub(super) fn version_of(root: Node<'_, '_>) -> Option<[u32; 2]> {
    let (major, minor) = root.attribute("version")?.split_once('.')?;
    Some([major.trim().parse().ok()?, minor.trim().parse().ok()?])
}

/// The text of an element, behind remarks if it begins with some.
pub(super) fn content<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    // White space in front of a remark is none of it.
    let texts = || node.children().take_while(|n| !n.is_element()).filter(Node::is_text).filter_map(|n| n.text());
    texts().find(|text| !text.trim().is_empty()).or_else(|| texts().next())
}

/// The text of an element inside.
pub(super) fn text<'a>(node: Node<'a, '_>, name: &'static str) -> Option<&'a str> {
    xml::inside(node, name).next().and_then(content)
}

/// A flag that an element inside says is set.
pub(super) fn is_true(node: Node<'_, '_>, name: &'static str) -> Result<bool> {
    xml::inside(node, name).next().map_or(Ok(false), |n| flag(n, content(n), name))
}

/// A flag that an attribute says is set.
pub(super) fn is_set(node: Node<'_, '_>, name: &str) -> Result<bool> {
    flag(node, node.attribute(name), name)
}

/// What a text says as a flag, in capital letters or small ones as libsdformat has it; what says nothing is false, the default of all
/// flags that are read.
fn flag(node: Node<'_, '_>, text: Option<&str>, what: &str) -> Result<bool> {
    let word = text.unwrap_or_default().trim();
    match word.to_ascii_lowercase().as_str() {
        "true" | "1" => Ok(true),
        "false" | "0" | "" => Ok(false),
        _ => Err(xml::wrong(node, format!("true or false as {what}"), Some(word))),
    }
}

/// The pose of an element, and the frame that it says it is relative to. Files before 1.7 call it `frame`.
pub(super) fn placed(node: Node<'_, '_>) -> Result<(Pose, Option<String>)> {
    let Some(pose) = xml::inside(node, "pose").next() else { return Ok((Pose::IDENTITY, None)) };
    let of = pose.attribute("relative_to").or_else(|| pose.attribute("frame")).map(str::trim);
    Ok((pose_of(pose)?, of.filter(|of| !of.is_empty()).map(str::to_owned)))
}

/// A pose: a position, and roll, pitch, yaw or a quaternion.
fn pose_of(node: Node<'_, '_>) -> Result<Pose> {
    let words = content(node).unwrap_or_default();
    let numbers = numbers_of(node, words, "pose")?;
    let is_degrees = is_set(node, "degrees")?;
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
pub(super) fn geometry_of(node: Node<'_, '_>, reader: &Reader<'_>) -> Result<Option<(Shape, DQuat)>> {
    let kinds = "one of box, sphere, cylinder, capsule, cone, ellipsoid, plane, polyline, mesh as the geometry";
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
        "polyline" => {
            let lines = xml::inside(node, "polyline").map(line_of).collect::<Result<Vec<_>>>()?;
            Shape::Extrusion(lines, length("height", 1.0)?)
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

/// The points of a polyline.
fn line_of(node: Node<'_, '_>) -> Result<Vec<DVec2>> {
    let point = |point: Node<'_, '_>| {
        let words = content(point).unwrap_or_default();
        let two = <[f64; 2]>::try_from(numbers_of(point, words, "point")?).ok().map(DVec2::from_array);
        two.ok_or_else(|| xml::wrong(point, "two numbers as a point", Some(words)))
    };
    let points = xml::inside(node, "point").map(point).collect::<Result<Vec<_>>>()?;
    if points.len() < 3 {
        return Err(xml::wrong(node, "three points or more of the polyline", Some(&points.len().to_string())));
    }
    Ok(points)
}
