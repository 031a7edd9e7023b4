//! Real models load, with the counts that their sources have.

use contactd::import::{Facets, Limits, read_model};
use contactd::solid::{Sense, Shape};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}

/// `.csg` files of a folder, in order.
fn models(folder: &str) -> Vec<PathBuf> {
    let read = std::fs::read_dir(root().join(folder)).expect("a folder");
    let mut files: Vec<PathBuf> = read.map(|f| f.expect("an entry").path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "csg"));
    files.sort();
    files
}

#[test]
fn every_model_of_the_project_loads_in_every_way() {
    let files: Vec<PathBuf> =
        ["models", "openscad", "../server/models", "../server/models/pictures"].into_iter().flat_map(models).collect();
    assert!(files.len() >= 20, "{files:?}");
    for file in files {
        for facets in [Facets::Exact, Facets::Auto, Facets::AsWritten] {
            let import = read_model(&file, facets, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
            let solid = &import.solid;
            assert!(!solid.is_empty() && solid.aabb().is_finite(), "{}", file.display());
            let flat = |s: &Shape| match s {
                Shape::Cuboid(_) | Shape::Polyhedron(_) | Shape::TriangleMesh(_) | Shape::HalfSpace(_) => true,
                Shape::Sphere(_) | Shape::Cylinder(_) | Shape::Cone(_) | Shape::Torus(_) | Shape::Capsule(_) => false,
                Shape::Ellipsoid(_) | Shape::EllipticFrustum(_) | Shape::Superellipsoid(_) | Shape::Quadric(_) => false,
            };
            let curved = solid.primitives.iter().any(|p| !flat(&p.shape));
            assert!(!(curved && facets == Facets::AsWritten), "{}: a curved primitive is left", file.display());
        }
    }
}

#[test]
fn models_have_the_primitives_that_their_sources_have() {
    // File, primitives, subtracted, notes.
    let table = [
        ("models/comb_100.csg", 101, 0, 0),
        ("models/plate_100.csg", 101, 100, 0),
        ("models/part_40_40.csg", 80, 40, 0),
        ("models/pin_grid.csg", 226, 225, 0),
        ("openscad/dovetail.csg", 4, 3, 1),
        // Bolt holes at 45°, printed with six digits.
        ("openscad/flange.csg", 21, 18, 4),
        ("openscad/peg_in_hole.csg", 3, 2, 0),
    ];
    for (name, primitives, subtracted, notes) in table {
        let import = read_model(&root().join(name), Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        let negative = import.solid.senses.iter().filter(|s| **s == Sense::Negative).count();
        let found = (import.solid.primitives.len(), negative, import.notes.len());
        assert_eq!(found, (primitives, subtracted, notes), "{name}: {:?}", import.notes.first());
    }
}

#[test]
fn a_polyhedron_given_inside_out_is_flipped_and_reported() {
    let import =
        read_model(&root().join("openscad/dovetail_b.csg"), Facets::Auto, &Limits::default()).expect("readable");
    assert_eq!(import.notes.len(), 1);
    assert!(import.notes[0].text.contains("flipped"), "{}", import.notes[0]);
    assert!(import.solid.value(import.solid.aabb().center()) < 0.0, "its middle is inside");
}
