//! The project's models: each `.csg` is what its `.scad` says, and the flattener that holds them together writes what
//! OpenSCAD writes.

use contactd_tests::openscad::flatten;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// `.scad` files of a folder, in order.
fn sources(name: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder(name)).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "scad"));
    files.sort();
    assert!(!files.is_empty());
    files
}

#[test]
fn the_flattener_reproduces_what_openscad_wrote() {
    let mut compared = 0;
    for scad in sources("openscad") {
        let source = read(&scad);
        let stem = scad.file_stem().unwrap().to_str().unwrap();
        for (part, name) in [(0.0, format!("{stem}.csg")), (1.0, format!("{stem}_b.csg"))] {
            let dump = scad.with_file_name(name);
            if dump.exists() {
                assert_eq!(
                    flatten(&source, &[("part", part)]).unwrap(),
                    read(&dump).trim_end_matches('\n').to_owned() + "\n",
                    "{dump:?}"
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 8);
}

#[test]
fn every_model_is_the_flattened_form_of_its_source() {
    for scad in sources("../server/models") {
        let flat = flatten(&read(&scad), &[]).unwrap_or_else(|e| panic!("{}: {e}", scad.display()));
        let csg = scad.with_extension("csg");
        assert!(read(&csg) == flat, "{} is not what its .scad says: run the flatten tool on it", csg.display());
    }
}

#[test]
fn what_the_flattener_does_not_know_is_named_with_its_line() {
    for (source, sentence) in [
        ("cube(1);\nminkowski() { }", "line 2: minkowski is not supported"),
        ("cube(1;", "line 1: expected a value"),
        ("sphere(r = foo(1));", "line 1: function foo is not supported"),
        ("a = 3;\ncube([1, 2]);", "line 2: expected a number, found Vector([Number(1.0), Number(2.0)])"),
    ] {
        assert_eq!(flatten(source, &[]).unwrap_err(), sentence);
    }
}

/// The solid of one of the project's models, through the importer.
fn solid(name: &str) -> contactd::solid::Solid {
    use contactd::import::{Facets, Limits, read_model};
    let path = folder("../server/models").join(name).with_extension("csg");
    read_model(&path, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}")).solid
}

#[test]
fn the_main_parts_have_forty_primitives_or_more() {
    for (name, count) in
        [("flange", 49), ("plate", 86), ("cover", 60), ("cage", 40), ("base", 38), ("gear", 38), ("bolt", 36)]
    {
        assert_eq!(solid(name).primitives.len(), count, "{name}");
    }
}

/// Membership of the imported model against a formula of the part, written without the tree, at points of its box; the
/// tolerance is what six printed digits of a rotation leave.
fn agrees_with(name: &str, inside: impl Fn(glam::DVec3) -> bool) {
    let solid = solid(name);
    let b = solid.aabb();
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let (mut full, mut near) = (0, 0);
    for _ in 0..40_000 {
        let x = b.min + (b.max - b.min) * glam::DVec3::new(next(), next(), next());
        let f = solid.value(x);
        if f.abs() < 1e-4 {
            near += 1;
            continue;
        }
        full += (f < 0.0) as usize;
        assert_eq!(f < 0.0, inside(x), "{name} at {x}, f = {f}");
    }
    assert!(full > 4_000 && near < 100, "{name}: {full} inside, {near} near the surface");
}

#[test]
fn the_flange_is_what_its_drawing_says() {
    agrees_with("flange", |p| {
        let (r, angle) = (p.x.hypot(p.y), p.y.atan2(p.x).to_degrees().rem_euclid(360.0));
        // In the frame of the nearest of eight spokes, the first at `offset` degrees.
        let spoke = |offset: f64| {
            let a = (angle - offset - 45.0 * ((angle - offset) / 45.0).round()).to_radians();
            (r * a.cos(), r * a.sin())
        };
        let z = p.z;
        let disc = (0.0..14.0).contains(&z) && r < 65.0;
        let face = (-2.0..1.0).contains(&z) && r < 40.0;
        let hub = (14.0..25.0).contains(&z) && r < 40.0 - 9.0 / 11.0 * (z - 14.0);
        let neck = (0.0..42.0).contains(&z) && r < 31.0 || (42.0..46.0).contains(&z) && r < 31.0 - 0.75 * (z - 42.0);
        let (u, v) = spoke(22.5);
        let h = z - 13.0;
        let below_slope = |x0: f64, y0: f64, x1: f64, y1: f64| h - y0 < (y1 - y0) / (x1 - x0) * (u - x0);
        let rib = v.abs() < 2.0 && h > 0.0 && h < 24.0 && u > 29.0 && u < 60.0 && below_slope(31.0, 24.0, 60.0, 3.0);
        let bore = r < 25.0 || z < 0.0 && r < 27.01 - (z + 2.01);
        let groove = z < 0.0 && r > 32.0 && r < 36.0;
        let (u, v) = spoke(0.0);
        let d = (u - 52.0).hypot(v);
        let hole = d < 4.5 && z < 15.0
            || (9.0..15.0).contains(&z) && d < 7.5
            || (13.0..14.01).contains(&z) && d < 7.5 + z - 13.0;
        let (u, v) = spoke(11.25);
        let dimple = (u - 62.0).powi(2) + v * v + (z - 15.0).powi(2) < 4.0;
        (disc || face || hub || neck || rib) && !(bore || groove || hole || dimple)
    });
}

#[test]
fn the_outer_ring_is_what_its_drawing_says() {
    agrees_with("outer_ring", |p| {
        let (r, z) = (p.x.hypot(p.y), p.z.abs());
        let slope = 35f64.to_radians();
        let race = r < 23.0 + 4.7825 / slope.cos() - z * slope.tan();
        let chamfer = r < 26.6 + (z - 7.2) && z > 7.2;
        let snap = (4.5..6.0).contains(&p.z) && r > 29.6;
        let oil = (0..6).any(|i| {
            let a = (60.0 * i as f64 + 20.0).to_radians();
            let (u, v) = (p.x * a.cos() + p.y * a.sin(), p.y * a.cos() - p.x * a.sin());
            u > 25.0 && v.hypot(p.z) < 0.9
        });
        r < 31.0 && z < 8.0 && r > 26.6 && !race && !chamfer && !snap && !oil
    });
}
