//! The 18 families of `cases/primitive_pairs`: 200 steps each of two convex primitives whose first touch is known.

use crate::judge::folder;
use crate::scenes::{Recipe, Scene};
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec3};
use std::collections::HashMap;

/// The families, by file name without extension; they end in `_translating` or `_turning`.
pub const FAMILIES: [&str; 18] = [
    "box_box_translating",
    "box_box_turning",
    "box_cylinder_translating",
    "box_cylinder_turning",
    "cone_cone_translating",
    "cone_cone_turning",
    "cylinder_cone_translating",
    "cylinder_cone_turning",
    "cylinder_cylinder_parallel_translating",
    "cylinder_cylinder_parallel_turning",
    "cylinder_cylinder_skew_translating",
    "cylinder_cylinder_skew_turning",
    "sphere_cone_translating",
    "sphere_cone_turning",
    "sphere_cylinder_translating",
    "sphere_cylinder_turning",
    "sphere_sphere_translating",
    "sphere_sphere_turning",
];

/// Scene and known time of each row of a family; negative: they never touch.
pub fn rows(family: &str) -> Vec<(Scene, f64)> {
    let path = folder().join("primitive_pairs").join(family).with_extension("csv");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let row = |line: &str| {
        let cells: HashMap<&str, &str> = head.iter().copied().zip(line.split(',')).collect();
        let number = |key: String| -> f64 { cells[key.as_str()].parse().expect("a number") };
        let vector = |o: &str, k: &str| DVec3::from(["x", "y", "z"].map(|e| number(format!("{o}_{k}{e}"))));
        let body = |o: &str| {
            let [d0, d1, d2] = ["d0", "d1", "d2"].map(|d| number(format!("{o}_{d}")));
            let solid = match cells[format!("{o}_kind").as_str()] {
                "sphere" => Recipe::sphere(d0),
                "cylinder" => Recipe::cylinder(d0, d1),
                "cone" => Recipe::cone(d0, 0.0, d1),
                "box" => Recipe::cuboid(d0, d1, d2),
                kind => panic!("{kind}"),
            };
            let q = vector(o, "q");
            let rotation = DQuat::from_xyzw(q.x, q.y, q.z, number(format!("{o}_qw"))).normalize();
            let start = Pose::new(vector(o, ""), rotation);
            (solid, Motion::turning(start, start.position + vector(o, "v"), vector(o, "w")))
        };
        let ((a, motion_a), (b, motion_b)) = (body("a"), body("b"));
        (Scene::new("pair", a, motion_a, b, motion_b), number("time".into()))
    };
    lines.map(row).collect()
}
