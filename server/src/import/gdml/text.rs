//! The pieces of OpenSCAD's text that solids are written with; lengths in millimetres, angles in radians.

use super::super::written::placed;
use contactd_proto::Pose;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A whole turn, but for the rounding of angles that are written in degrees.
pub fn is_whole(turn: f64) -> bool {
    turn >= TAU - 1e-9
}

/// A cylinder about z, its middle at the origin.
pub fn cylinder(r: f64, h: f64) -> String {
    cone(r, r, h)
}

/// A cone about z, cut at both radii, its middle at the origin.
pub fn cone(below: f64, above: f64, h: f64) -> String {
    format!("cylinder($fn = 0, h = {h:?}, r1 = {below:?}, r2 = {above:?}, center = true);")
}

/// The first without the second.
pub fn minus(a: &str, b: &str) -> String {
    format!("difference() {{ {a} {b} }}")
}

/// What is in both.
pub fn both(a: &str, b: &str) -> String {
    format!("intersection() {{ {a} {b} }}")
}

/// A text scaled along the axes.
pub fn scaled(by: DVec3, text: &str) -> String {
    format!(
        "multmatrix([[{:?}, 0, 0, 0], [0, {:?}, 0, 0], [0, 0, {:?}, 0], [0, 0, 0, 1]]) {{ {text} }}",
        by.x, by.y, by.z
    )
}

/// An outline of (r, z) turned about z from an angle on.
pub fn turned(outline: &[DVec2], from: f64, turn: f64) -> String {
    let mut points: Vec<DVec2> = Vec::new();
    for p in outline {
        if points.last() != Some(p) {
            points.push(*p);
        }
    }
    if points.len() > 1 && points.first() == points.last() {
        points.pop();
    }
    let list: Vec<String> = points.iter().map(|p| format!("[{:?}, {:?}]", p.x, p.y)).collect();
    sweep(&format!("polygon(points = [{}]);", list.join(", ")), from, turn)
}

/// A flat shape turned about z.
pub fn sweep(flat: &str, from: f64, turn: f64) -> String {
    let angle = if is_whole(turn) { 360.0 } else { turn.to_degrees() };
    let text = format!("rotate_extrude(angle = {angle:?}, $fn = 0) {{ {flat} }}");
    if is_whole(turn) {
        return text;
    }
    placed(&Pose::new(DVec3::ZERO, glam::DQuat::from_rotation_z(from)), &text)
}

/// Points and faces, these counter-clockwise from outside as the three of a tetrahedron are.
pub fn polyhedron(points: &[DVec3], faces: &[Vec<usize>]) -> String {
    let points: Vec<String> = points.iter().map(|p| format!("{:?}", p.to_array())).collect();
    // OpenSCAD's faces are clockwise.
    let faces: Vec<String> = faces.iter().map(|f| format!("{:?}", f.iter().rev().collect::<Vec<_>>())).collect();
    format!("polyhedron(points = [{}], faces = [{}]);", points.join(", "), faces.join(", "))
}

/// A polyhedron of which corners may fall together: faces without an area are left out.
pub fn clean(points: &[DVec3], faces: &[Vec<usize>]) -> String {
    let mut used: Vec<DVec3> = Vec::new();
    let index: Vec<usize> = points
        .iter()
        .map(|p| {
            used.iter().position(|u| u == p).unwrap_or_else(|| {
                used.push(*p);
                used.len() - 1
            })
        })
        .collect();
    let mut kept = Vec::new();
    for face in faces {
        let mut corners: Vec<usize> = face.iter().map(|i| index[*i]).collect();
        corners.dedup();
        while corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() >= 3 {
            kept.push(corners);
        }
    }
    polyhedron(&used, &kept)
}
