//! What files of robots have that people publish: hulls of many faces, pairs of geoms, height fields, polylines, texts that are not quite
//! XML. Random ones, each against what the test knows of it by itself.
//!
//! `CONTACTD_REAL_FILES=2000 cargo test --release -p contactd-tests --test models real_files::` sets the number of each (28 by default).

use super::robots::models;
use contactd::check::Check;
use contactd::contact::Status;
use contactd::import::robot::{Ask, read_robot, scene_of};
use contactd::import::{Attachment, Facets, Limits, Scene, Source};
use contactd::solid::Solid;
use contactd::world::StepOptions;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DVec2, DVec3};
use std::collections::HashSet;
use std::path::Path;

fn rounds() -> usize {
    sized("CONTACTD_REAL_FILES", 28)
}

/// A file's scene.
fn scene(folder: &Path, name: &str, text: &str) -> Result<Scene, String> {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    let ask = Ask::default();
    read_robot(&path, &ask).and_then(|robot| scene_of(&path, &robot, &ask)).map_err(|e| e.to_string())
}

/// The solid of its only model.
fn solid(scene: &Scene) -> Solid {
    let [one] = scene.models.as_slice() else { panic!("{} models", scene.models.len()) };
    let text = one.text.as_ref().expect("a text");
    let import = Source::named("m.csg", text.as_bytes()).import(Facets::Auto, &Limits::default());
    import.unwrap_or_else(|e| panic!("{e}: {text}")).solid
}

/// Points of an ellipsoid and within it, as a mesh of open triangles that cross each other: only their hull means anything. What is a
/// mean of corners is in the hull; what lies beyond all corners along some direction is not.
#[test]
fn hulls_of_many_faces_hold_the_means_of_their_corners_and_end_with_them() {
    let mut r = Random::new(91);
    for round in 0..1 + rounds() / 20 {
        let axes = DVec3::new(r.within(0.2, 1.0), r.within(0.2, 1.0), r.within(0.2, 1.0));
        // Above and below the number of faces from which points alone are looked at.
        let count = [900, 2700, 5200][round % 3];
        let points: Vec<DVec3> = (0..count).map(|_| (axes * r.direction()).as_vec3().as_dvec3()).collect();
        let inner: Vec<DVec3> = (0..3 * count).map(|_| (axes * r.direction() * 0.9).as_vec3().as_dvec3()).collect();
        let mut off = format!("OFF {} {} 0\n", 4 * count, 3 * count);
        points.iter().chain(&inner).for_each(|p| off += &format!("{} {} {}\n", p.x, p.y, p.z));
        (0..3 * count).for_each(|i| off += &format!("3 {i} {} {}\n", i + count, (i * 7 + 1) % (4 * count)));
        let attached = [Attachment { name: "cloud.off".into(), bytes: Ok(off.into_bytes()) }];
        let text = b"hull() { import(file = \"cloud.off\"); }";
        let source = Source { attached: Some(&attached), ..Source::named("m.csg", text) };
        let import = source.import(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        let [one] = import.solid.primitives.as_slice() else { panic!("one primitive") };
        let faces = one.shape.geometry().face_count();
        assert!(faces > count && faces < 2 * count, "{faces} faces of {count} corners");
        for _ in 0..200 {
            let (mut mean, mut whole) = (DVec3::ZERO, 0.0);
            for _ in 0..1 + r.below(5) {
                let weight = r.within(0.0, 1.0);
                mean += weight * points[r.below(count)];
                whole += weight;
            }
            let f = import.solid.value(mean / whole);
            assert!(f < 1e-6, "{f} at a mean");
            let n = r.direction();
            let reach = points.iter().map(|p| n.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
            let beyond = n * (reach + 3e-6) + n.cross(r.vector(0.1));
            let f = import.solid.value(beyond);
            assert!(f > 0.0, "{f} beyond all corners");
        }
    }
}

/// Bodies of a few geoms with random masks, some of them welded to the world, pairs of geoms and excluded bodies: which objects meet is
/// told by a table.
#[test]
fn geoms_that_a_pair_names_are_tested_whatever_else_is_said_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(92);
    let (mut by_pair, mut by_masks, mut of_welded, mut within) = (0, 0, 0, 0);
    for _ in 0..rounds() {
        let bodies = 2 + r.below(3);
        // Each geom: its body, its masks.
        let mut geoms: Vec<(usize, [u32; 2])> = Vec::new();
        let mut text = "<mujoco><worldbody>".to_owned();
        let mut is_welded = Vec::new();
        for b in 0..bodies {
            is_welded.push(r.chance(0.4));
            text += &format!("<body name=\"b{b}\">{}", if is_welded[b] { "" } else { "<freejoint/>" });
            for _ in 0..1 + r.below(2) {
                let masks = [r.below(3) as u32, r.below(3) as u32];
                let g = geoms.len();
                text += &format!(
                    "<geom name=\"g{g}\" size=\"{}\" contype=\"{}\" conaffinity=\"{}\"/>",
                    1 + g,
                    masks[0],
                    masks[1]
                );
                geoms.push((b, masks));
            }
            text += "</body>";
        }
        text += "</worldbody><contact>";
        let (mut pairs, mut excluded) = (HashSet::new(), HashSet::new());
        for _ in 0..1 + r.below(3) {
            let (a, b) = (r.below(geoms.len()), r.below(geoms.len()));
            text += &format!("<pair geom1=\"g{a}\" geom2=\"g{b}\" condim=\"1\"/>");
            pairs.insert([a.min(b), a.max(b)]);
        }
        for _ in 0..r.below(2) {
            let (a, b) = (r.below(bodies), r.below(bodies));
            if a != b {
                text += &format!("<exclude body1=\"b{a}\" body2=\"b{b}\"/>");
                excluded.insert([a.min(b), a.max(b)]);
            }
        }
        text += "</contact></mujoco>";
        let scene = scene(folder.path(), "m.xml", &text).unwrap_or_else(|e| panic!("{e}: {text}"));
        // The object of a geom: the one whose text has its radius.
        let object = |g: usize| {
            let radius = format!("r = {}.0)", 1 + g);
            let of_model = |m: usize| scene.models[m].text.as_ref().is_some_and(|text| text.contains(&radius));
            scene.objects.iter().find(|o| of_model(o.model)).map(|o| o.name.clone())
        };
        let excepted = |a: &str, b: &str| {
            let except = &scene.rules[0].except;
            except.iter().any(|pair| *pair == [a.to_owned(), b.to_owned()] || *pair == [b.to_owned(), a.to_owned()])
        };
        for (a, (body, masks)) in geoms.iter().enumerate() {
            for (b, (other, others)) in geoms.iter().enumerate().skip(a + 1) {
                let named = pairs.contains(&[a, b]);
                let alike = masks[0] & others[1] != 0 || masks[1] & others[0] != 0;
                let free = !excluded.contains(&[*body.min(other), *body.max(other)]);
                let both = is_welded[*body] && is_welded[*other];
                let by_itself = body != other && alike && free && !both;
                let tested = named || by_itself;
                by_pair += usize::from(named && !by_itself);
                by_masks += usize::from(by_itself);
                of_welded += usize::from(named && both);
                within += usize::from(named && body == other);
                // Geoms of one body with the same masks are one object.
                let (Some(x), Some(y)) = (object(a), object(b)) else {
                    assert!(!tested, "g{a} g{b}: {text}");
                    continue;
                };
                let is_static = [&x, &y].map(|name| scene.objects.iter().any(|o| o.name == **name && o.is_static));
                // Two static objects are never tested.
                let told = x != y && !excepted(&x, &y) && is_static != [true; 2];
                assert_eq!(told, tested, "g{a} g{b}: {text}");
            }
        }
    }
    let counts = [by_pair, by_masks, of_welded, within];
    assert!(counts[..2].iter().all(|n| *n > rounds() / 4) && counts.iter().all(|n| *n > rounds() / 14), "{counts:?}");
    let wrong = scene(folder.path(), "m.xml", "<mujoco><contact>\n<pair geom1=\"g\" geom2=\"g\"/></contact></mujoco>");
    let wrong = wrong.expect_err("no geom");
    assert!(wrong.ends_with("m.xml:2:1: expected the name of a geom, found \"g\""), "{wrong}");
}

/// Balls of the world and of bodies that are welded to it, as pairs and not: those of pairs overlap where they do, and the others are
/// static still.
#[test]
fn a_pair_of_what_is_fixed_to_the_world_overlaps_where_it_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(94);
    let (mut overlaps, mut apart) = (0, 0);
    for _ in 0..rounds() {
        let balls: Vec<(DVec3, f64)> = (0..4).map(|_| (r.vector(1.0), r.within(0.2, 1.0))).collect();
        let geom = |g: usize| {
            let (at, radius) = balls[g];
            format!("<geom name=\"g{g}\" size=\"{radius:?}\" pos=\"{:?} {:?} {:?}\"/>", at.x, at.y, at.z)
        };
        let bodies = [format!("{}<body>{}</body>", geom(0), geom(1)), format!("<body>{}{}</body>", geom(2), geom(3))];
        let [a, b] = [[0, 1], [0, 2], [1, 2], [2, 3]][r.below(4)];
        let pair = format!("<contact><pair geom1=\"g{b}\" geom2=\"g{a}\"/></contact>");
        let text = format!("<mujoco><worldbody>{}</worldbody>{pair}</mujoco>", bodies.concat());
        let scene = scene(folder.path(), "m.xml", &text).unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(scene.objects.iter().filter(|o| !o.is_static).count(), 1, "{text}");
        let mut check = Check::new(&scene, &models(&scene), None).expect("a world");
        let outcome = check.step_with(&StepOptions::default()).expect("a step");
        let gap = balls[a].0.distance(balls[b].0) - balls[a].1 - balls[b].1;
        // Pairs that the boxes keep apart are not told of.
        let told: Vec<Status> = outcome.pairs.iter().map(|p| p.outcome.status()).collect();
        let is_met = gap < 0.0;
        *(if is_met { &mut overlaps } else { &mut apart }) += 1;
        assert!(told.len() <= 1 && (told == [Status::Overlap]) == is_met, "{told:?} {gap}: {text}");
    }
    assert!(overlaps > rounds() / 14 && apart > rounds() / 14, "{overlaps} {apart}");
}

/// Elevations of random grids: at each of its points the solid ends at the height that the file's table has there, rows from the far
/// side.
#[test]
fn height_fields_of_models_are_as_high_as_their_elevations() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(93);
    for _ in 0..rounds() {
        let (rows, columns) = (2 + r.below(4), 2 + r.below(4));
        let size = DVec2::new(r.within(1.0, 3.0), r.within(1.0, 3.0));
        let (top, base) = (r.within(0.5, 2.0), r.within(0.1, 0.5));
        let table: Vec<Vec<f64>> = (0..rows).map(|_| (0..columns).map(|_| r.within(-5.0, 9.0)).collect()).collect();
        let all: Vec<f64> = table.iter().flatten().copied().collect();
        let words: Vec<String> = all.iter().map(f64::to_string).collect();
        let text = format!(
            "<mujoco><asset><hfield name=\"h\" nrow=\"{rows}\" ncol=\"{columns}\" size=\"{} {} {top} {base}\"\n elevation=\"{}\"/></asset>\
             <worldbody><geom type=\"hfield\" hfield=\"h\"/></worldbody></mujoco>",
            size.x,
            size.y,
            words.join(" ")
        );
        let solid = solid(&scene(folder.path(), "m.xml", &text).unwrap_or_else(|e| panic!("{e}: {text}")));
        let (low, high) = (all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(-9e9, f64::max));
        for (i, row) in table.iter().enumerate() {
            for (k, height) in row.iter().enumerate() {
                // A little towards the middle, where the solid is.
                let along = |k: usize, n: usize| (2.0 * k as f64 / (n - 1) as f64 - 1.0) * (1.0 - 1e-9);
                let (x, y) = (size.x * along(k, columns), -size.y * along(i, rows));
                let z = top * (height - low) / (high - low);
                let value = |z: f64| solid.value(DVec3::new(x, y, z));
                assert!(value(z + 1e-6) > 0.0 && value(z - 1e-6) < 0.0, "row {i}, column {k}: {text}");
                assert!(value(1e-6 - base) < 0.0 && value(-1e-6 - base) > 0.0, "{text}");
            }
        }
        let short = text.replacen(&words[0], "", 1);
        let told = scene(folder.path(), "m.xml", &short).expect_err("too few");
        assert!(told.contains(&format!("{} numbers as elevation of the hfield, found", rows * columns)), "{told}");
    }
}

/// Stars with a hole: inside is where the angle and the distance say so.
#[test]
fn polylines_stand_over_what_they_go_around() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(94);
    for _ in 0..rounds() {
        let (height, hole) = (r.within(0.5, 2.0), r.chance(0.5));
        let n = 3 + r.below(8);
        let radii: Vec<f64> = (0..n).map(|_| r.within(1.0, 2.0)).collect();
        let corner = |i: usize| DVec2::from_angle(std::f64::consts::TAU * (i % n) as f64 / n as f64) * radii[i % n];
        let point = |p: DVec2| format!("<point>{} {}</point>", p.x, p.y);
        let outline: String = (0..n).map(|i| point(corner(i))).collect();
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|p| DVec2::from_array(p) * 0.15);
        let inner: String = square.map(point).concat();
        let polyline = |points: &str| format!("<polyline>{points}<height>{height}</height></polyline>");
        let inner = if hole { polyline(&inner) } else { String::new() };
        let text = format!(
            "<sdf version=\"1.9\"><model name=\"m\"><link name=\"l\"><collision name=\"c\"><geometry>{}{inner}</geometry></collision>\
             </link></model></sdf>",
            polyline(&outline)
        );
        let solid = solid(&scene(folder.path(), "m.sdf", &text).unwrap_or_else(|e| panic!("{e}: {text}")));
        let mut inside = 0;
        for _ in 0..100 {
            let x = r.vector(2.0);
            let flat = x.truncate();
            // Of the triangles about the origin the one that holds it.
            let holds = |i: usize| {
                let (a, b) = (corner(i), corner(i + 1));
                a.perp_dot(flat) >= 0.0 && flat.perp_dot(b) >= 0.0 && (b - a).perp_dot(flat - a) > 0.0
            };
            let in_hole = hole && flat.abs().max_element() < 0.15;
            let wanted = (0..n).any(holds) && !in_hole && x.z > 0.0 && x.z < height;
            let f = solid.value(x);
            assert!(f.abs() < 1e-9 || (f < 0.0) == wanted, "{f} at {x}: {text}");
            inside += usize::from(wanted);
        }
        assert!(inside > 0, "{text}");
    }
}

/// What pybullet's and Gazebo's own files have.
#[test]
fn texts_that_are_not_quite_xml_are_read_and_told_with_their_lines() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = |shape: &str| format!("<link name=\"a\"><collision><geometry>{shape}</geometry></collision></link>");
    let urdf = format!(
        "<!-- two -- dashes --->\n<?xml version=\"1.0\"?>\n<robot name=\"r\">{}<gz:more/></robot>\0",
        link("<sphere radius=\"1\"/>")
    );
    let ball = solid(&scene(folder.path(), "r.urdf", &urdf).expect("read"));
    assert!((ball.value(DVec3::new(3.0, 0.0, 0.0)) - 2.0).abs() < 1e-12);
    let bad = urdf.replace("radius=\"1\"", "radius=\"x\"");
    let told = scene(folder.path(), "r.urdf", &bad).expect_err("no number");
    assert!(told.contains("r.urdf:3:") && told.contains("a finite number as radius of sphere, found \"x\""), "{told}");
    let plane = solid(
        &scene(folder.path(), "r.urdf", &format!("<robot name=\"r\">{}</robot>", link("<plane normal=\"0 0 1\"/>")))
            .expect("read"),
    );
    assert!(plane.value(DVec3::new(5.0, 5.0, 2.0)) == 2.0 && plane.value(DVec3::new(5.0, 5.0, -2.0)) == -2.0);
}
