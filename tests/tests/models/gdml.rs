//! GDML geometries: solids against Geant4's, overlaps of known depth that are planted among volumes that touch.
//!
//! `CONTACTD_GEOMETRIES=500 cargo test --release -p contactd-tests --test models gdml:: -- --nocapture` sets the number of random
//! geometries (6 by default). `benches/geant4/points.py` writes what `points_are_where_geant4_has_them` reads.

use contactd::import::gdml::{Volumes, read_gdml};
use contactd::import::{Facets, Limits, Scene};
use contactd::octree::Model;
use contactd::overlaps::{Found, Verdict, around, of_volumes, scene_of, spread};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

fn models(scene: &Scene) -> Vec<Arc<Model>> {
    let imports = scene.load_models(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
    imports.into_iter().map(|import| Arc::new(Model::new(import.solid))).collect()
}

pub(super) fn read(path: &Path) -> (Volumes, Vec<Arc<Model>>) {
    let mut volumes = read_gdml(path).unwrap_or_else(|e| panic!("{e}"));
    let scene = scene_of(path, &volumes);
    let imports = scene.load_models(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
    volumes.deviate(imports.iter().map(|import| import.notes.as_slice()));
    let models: Vec<_> = imports.into_iter().map(|import| Arc::new(Model::new(import.solid))).collect();
    let models = spread(&volumes, &models);
    (volumes, models)
}

/// Without the two files this is told as skipped; `gdml_contacts::points_of_solids_are_where_their_definitions_have_them` needs none.
#[test]
fn points_are_where_geant4_has_them() {
    let (Ok(geometry), Ok(points)) = (std::env::var("CONTACTD_GDML"), std::env::var("CONTACTD_GDML_POINTS")) else {
        println!("skipped: CONTACTD_GDML and CONTACTD_GDML_POINTS name no files; definitions judge in gdml_contacts");
        return;
    };
    let (volumes, models) = read(Path::new(&geometry));
    let world = volumes.volumes.last().expect("a world");
    let points: serde_json::Value = serde_json::from_slice(&std::fs::read(points).expect("points")).expect("JSON");
    let (mut wrong, mut seen) = (std::collections::BTreeMap::<String, usize>::new(), 0);
    for row in points.as_array().expect("rows") {
        let name = row[0].as_str().expect("a name");
        let d = world.daughters.iter().find(|d| d.name == name || d.name.starts_with(&format!("{name} "))).expect("it");
        let x = DVec3::from_array([0, 1, 2].map(|k| row[1][k].as_f64().expect("a number")));
        let f = models[d.volume].solid.value(d.pose.inverse().point(x));
        let (inside, off) = (row[2].as_bool().expect("a flag"), row[3].as_f64().expect("a distance"));
        seen += 1;
        if (f < 0.0) != inside && off > 1e-6 && f.abs() > 1e-6 {
            *wrong.entry(name.to_owned()).or_default() += 1;
        }
    }
    println!("{seen} points, of which {wrong:?} are elsewhere");
    assert!(wrong.is_empty() && seen > 1000, "{wrong:?} of {seen}");
}

/// A geometry of blocks that fill a mother to its walls, each with its neighbours' faces on its own; some hold a peg that fits its bore.
/// Some were moved into a neighbour or the wall by a known depth.
struct Packed {
    text: String,
    /// Pairs that overlap, by name (the second one none: it sticks out), and by how much.
    planted: Vec<(String, Option<String>, f64)>,
    volumes: usize,
}

impl Packed {
    fn random(r: &mut Random, n: [usize; 3]) -> Self {
        let edges: Vec<Vec<f64>> = n
            .iter()
            .map(|n| {
                let mut at = vec![r.within(-1.0, 0.0)];
                (0..*n).for_each(|_| at.push(at[at.len() - 1] + r.within(5.0, 15.0)));
                at
            })
            .collect();
        let (mut solids, mut volumes, mut placed) = (String::new(), String::new(), String::new());
        let mut planted = Vec::new();
        let mut count = 0;
        for cell in 0..n[0] * n[1] * n[2] {
            let at = [cell % n[0], cell / n[0] % n[1], cell / (n[0] * n[1])];
            let low = DVec3::from_array([0, 1, 2].map(|k| edges[k][at[k]]));
            let high = DVec3::from_array([0, 1, 2].map(|k| edges[k][at[k] + 1]));
            let (size, mut center) = (high - low, 0.5 * (low + high));
            // Every other one along x may be moved, so that each overlap has one cause.
            let name = format!("V{cell}");
            if at[0] % 2 == 1 && r.chance(0.5) {
                let depth = 10.0 * 10f64.powf(r.within(-9.0, -1.0));
                center.x += depth;
                let other = (at[0] + 1 < n[0]).then(|| format!("PV{}", cell + 1));
                planted.push((format!("P{name}"), other, depth));
            }
            let is_bored = r.chance(0.3);
            let radius = 0.3 * size.x.min(size.y);
            solids += &format!("<box name=\"B{cell}\" x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>\n", size.x, size.y, size.z);
            let mut solid = format!("B{cell}");
            let mut daughters = String::new();
            match (is_bored, r.chance(0.5)) {
                // A peg beside its bore, as wide.
                (true, true) => {
                    solids += &format!(
                        "<tube name=\"T{cell}\" rmax=\"{radius:?}\" z=\"{:?}\" deltaphi=\"360\" aunit=\"deg\"/>\n",
                        size.z
                    );
                    solids += &format!(
                        "<tube name=\"H{cell}\" rmax=\"{radius:?}\" z=\"{:?}\" deltaphi=\"360\" aunit=\"deg\"/>\n",
                        2.0 * size.z
                    );
                    solids += &format!(
                        "<subtraction name=\"S{cell}\"><first ref=\"B{cell}\"/><second ref=\"H{cell}\"/></subtraction>\n"
                    );
                    solid = format!("S{cell}");
                    volumes += &format!("<volume name=\"peg{cell}\"><solidref ref=\"T{cell}\"/></volume>\n");
                    placed += &physvol(&format!("Ppeg{cell}"), &format!("peg{cell}"), center);
                    count += 1;
                }
                // A ball within, that touches its mother's walls.
                (true, false) => {
                    let r = 0.5 * size.min_element();
                    solids += &format!("<orb name=\"O{cell}\" r=\"{r:?}\"/>\n");
                    volumes += &format!("<volume name=\"ball{cell}\"><solidref ref=\"O{cell}\"/></volume>\n");
                    daughters = physvol(&format!("Pball{cell}"), &format!("ball{cell}"), DVec3::ZERO);
                    count += 1;
                }
                _ => {}
            }
            volumes += &format!("<volume name=\"{name}\"><solidref ref=\"{solid}\"/>{daughters}</volume>\n");
            placed += &physvol(&format!("P{name}"), &name, center);
            count += 1;
        }
        let low = DVec3::from_array([0, 1, 2].map(|k| edges[k][0]));
        let high = DVec3::from_array([0, 1, 2].map(|k| edges[k][n[k]]));
        let (size, center) = (high - low, 0.5 * (low + high));
        // The mother is a box about its own origin: everything is moved into it.
        let text = format!(
            "<gdml><define/><materials/><solids>{solids}<box name=\"W\" x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/></solids><structure>{volumes}\
             <assembly name=\"all\">{placed}</assembly><volume name=\"World\"><solidref ref=\"W\"/>{}</volume></structure></gdml>",
            size.x,
            size.y,
            size.z,
            physvol("A", "all", -center)
        );
        Self { text, planted, volumes: count }
    }
}

fn physvol(name: &str, volume: &str, at: DVec3) -> String {
    format!(
        "<physvol name=\"{name}\"><volumeref ref=\"{volume}\"/><position x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/></physvol>\n",
        at.x, at.y, at.z
    )
}

pub(super) fn overlaps_of(path: &Path, tolerance: f64) -> Found {
    let (volumes, of_volume) = read(path);
    let (outside, of) = around(path, &volumes, &of_volume);
    of_volumes(&volumes, &of_volume, (&models(&outside), &of), Some(tolerance))
}

#[test]
fn what_was_planted_is_found_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("packed.gdml");
    let mut r = Random::new(3);
    let (mut all, mut volumes, mut least) = (0, 0, f64::INFINITY);
    for k in 0..sized("CONTACTD_GEOMETRIES", 6usize) {
        let n = [2 + r.below(4), 1 + r.below(3), 1 + r.below(3)];
        let packed = Packed::random(&mut r, n);
        std::fs::write(&path, &packed.text).expect("written");
        let found = overlaps_of(&path, 1e-9);
        let mut expected = packed.planted.clone();
        for pair in &found.pairs {
            let Verdict::Overlap(_, depth) = pair.verdict else { panic!("{k}: {pair:?}") };
            let bare = |name: &str| name.rsplit('/').next().expect("a name").to_owned();
            let [a, b] = [bare(&pair.a), pair.b.name().map(bare).unwrap_or_default()];
            let is_it = |(p, q, _): &(String, Option<String>, f64)| {
                let q = q.clone().unwrap_or_default();
                (*p == a && q == b) || (*p == b && q == a)
            };
            // A peg moves with its block, and into what the block moves into where the bore ends there.
            let of_peg = a.contains("peg") || b.contains("peg");
            let Some(at) = expected.iter().position(is_it) else {
                assert!(of_peg, "{k}: {pair:?} was not planted\n{:?}", packed.planted);
                continue;
            };
            let planted = expected.remove(at).2;
            // In a slab of that thickness a ball of half of it fits.
            assert!(depth <= 0.5 * planted + 1e-12 && depth > 1e-9, "{k}: {depth} of {planted}");
            least = least.min(planted);
            all += 1;
        }
        assert!(expected.is_empty(), "{k}: {expected:?} were not found");
        volumes += packed.volumes;
    }
    println!("{all} overlaps of {volumes} volumes, the least {least:.1e}, found, and no other");
    assert!(all > 3, "{all}");
}

/// A plane that rounding has put below the one before makes no cut that nothing can be proven beside.
#[test]
fn a_step_back_by_rounding_hides_no_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("g.gdml");
    for (kind, more) in [("polycone", ""), ("polyhedra", "numsides=\"5\"")] {
        for z in ["-32.8", "-32.80000000000001", "-32.79999999999999"] {
            let text = format!(
                "<gdml><define/><materials/><solids><{kind} name=\"s\" startphi=\"93\" deltaphi=\"100\" aunit=\"deg\" {more}>\
                 <zplane rmin=\"58.76\" rmax=\"85.9\" z=\"-63.9\"/><zplane rmin=\"22.2\" rmax=\"42.2\" z=\"-32.8\"/>\
                 <zplane rmin=\"50\" rmax=\"59.97\" z=\"{z}\"/><zplane rmin=\"40.1\" rmax=\"56.6\" z=\"98.2\"/></{kind}>\
                 <box name=\"w\" x=\"5000\" y=\"5000\" z=\"5000\"/></solids><structure>\
                 <volume name=\"A\"><solidref ref=\"s\"/></volume><volume name=\"W\"><solidref ref=\"w\"/><physvol name=\"pA\">\
                 <volumeref ref=\"A\"/><rotation name=\"r\" x=\"30\" y=\"20\" z=\"10\" unit=\"deg\"/></physvol></volume></structure></gdml>"
            );
            std::fs::write(&path, text).expect("written");
            let found = overlaps_of(&path, 1e-6);
            assert!(found.pairs.is_empty() && found.separate[1] == 1, "{kind}, {z}: {found:?}");
        }
    }
}

/// A torus that is scaled unevenly is asked of in facets. Balls of radius 1 outside of it, or in its bore, by a gap to its surface in
/// closed form: no verdict says otherwise, whatever the facets say, and no depth is more than that of the surface.
#[test]
fn what_is_proven_of_facets_is_proven_of_the_surface() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("g.gdml");
    let mut r = Random::new(7);
    let (mut proven, mut open, mut wide) = (0, 0, 0);
    for k in 0..sized("CONTACTD_TORI", 24usize) {
        let scale = DVec3::new(r.within(0.5, 1.6), r.within(0.5, 1.6), r.within(0.5, 1.6));
        let bore = r.chance(0.5);
        let (u, v) = (r.within(0.0, std::f64::consts::TAU), r.within(0.0, std::f64::consts::TAU));
        let minor = if bore { 15.0 } else { 20.0 };
        let rho = 100.0 + minor * v.cos();
        let p = DVec3::new(rho * u.cos(), rho * u.sin(), minor * v.sin()) * scale;
        let n = (DVec3::new(v.cos() * u.cos(), v.cos() * u.sin(), v.sin()) / scale).normalize();
        let gap = 10f64.powf(r.within(-3.5, -0.5)) * if r.chance(0.5) { 1.0 } else { -1.0 };
        // The ball meets the surface nowhere else: the bore's least radius of curvature is 15 · 0.5² / 1.6.
        let at = p + n * if bore { -(1.0 + gap) } else { 1.0 + gap };
        let text = format!(
            "<gdml><define/><materials/><solids><torus name=\"t\" rmin=\"{}\" rmax=\"20\" rtor=\"100\" deltaphi=\"360\" aunit=\"deg\"/>\
             <scaledSolid name=\"s\"><solidref ref=\"t\"/><scale name=\"q\" x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/></scaledSolid>\
             <orb name=\"b\" r=\"1\"/><box name=\"w\" x=\"5000\" y=\"5000\" z=\"5000\"/></solids><structure>\
             <volume name=\"A\"><solidref ref=\"s\"/></volume><volume name=\"B\"><solidref ref=\"b\"/></volume>\
             <volume name=\"W\"><solidref ref=\"w\"/>{}{}</volume></structure></gdml>",
            if bore { 15 } else { 0 },
            scale.x,
            scale.y,
            scale.z,
            physvol("pA", "A", DVec3::ZERO),
            physvol("pB", "B", at)
        );
        std::fs::write(&path, text).expect("written");
        let found = overlaps_of(&path, 1e-6);
        match found.pairs.first().map(|pair| pair.verdict) {
            None => assert!(gap > 0.0, "{k}: separate, gap {gap}"),
            // The deepest ball in both is half as wide as the overlap.
            Some(Verdict::Overlap(_, depth)) => {
                assert!(gap < 0.0 && depth <= -0.5 * gap * (1.0 + 1e-6), "{k}: {depth} deep, gap {gap}");
            }
            Some(_) => {
                open += 1;
                wide += usize::from(gap.abs() > 0.05);
                continue;
            }
        }
        proven += 1;
    }
    println!("{proven} proven, {open} open");
    assert!(4 * proven > open && wide == 0, "{proven} proven, {open} open, {wide} of them wide");
}

#[test]
fn what_is_wrong_is_one_sentence_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("g.gdml");
    let of = |define: &str, solids: &str, structure: &str| {
        let text = format!(
            "<gdml><define>{define}</define>\n<solids>{solids}</solids>\n<structure>{structure}</structure></gdml>"
        );
        std::fs::write(&path, text).expect("written");
        let sentence = read_gdml(&path)
            .and_then(|v| scene_of(&path, &v).load_models(Facets::Auto, &Limits::default()).map(|_| ()));
        sentence.map_or_else(|e| e.to_string(), |()| String::new())
    };
    let volume = "<volume name=\"v\"><solidref ref=\"s\"/></volume>";
    for (define, solids, structure, words) in [
        ("", "<box name=\"s\" x=\"1\" y=\"1\"/>", volume, "g.gdml:2:9: expected z of the box, found none"),
        ("", "<twistedbox name=\"s\"/>", volume, "the solid twistedbox, which is not supported"),
        ("", "", volume, "g.gdml:3:29: expected the name of a solid, found \"s\""),
        (
            "<constant name=\"a\" value=\"1+\"/>",
            "",
            "",
            "g.gdml:1:15: expected a number, a name or a parenthesis, found its end",
        ),
        (
            "<quantity name=\"a\" value=\"1\" unit=\"furlong\"/>",
            "",
            "",
            "expected a unit of length or angle, found \"furlong\"",
        ),
        ("", "<orb name=\"s\" r=\"x\"/>", volume, "expected a name that is defined before it is used, found \"x\""),
        ("", "<orb name=\"s\" r=\"-1\"/>", volume, "expected r of the orb that is positive, found \"-1\""),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            "<volume name=\"v\"><solidref ref=\"s\"/><physvol><volumeref ref=\"w\"/></physvol></volume>",
            "defined before it is placed, found \"w\"",
        ),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            "<volume name=\"v\"><solidref ref=\"s\"/></volume><volume name=\"w\"><solidref ref=\"s\"/><paramvol><volumeref ref=\"v\"/></paramvol></volume>",
            "<paramvol>, which is not supported",
        ),
        (
            "",
            "<tube name=\"s\" rmax=\"1\" z=\"1\" deltaphi=\"0\"/>",
            volume,
            "expected deltaphi of the tube that is positive",
        ),
        (
            "",
            "<tube name=\"s\" rmin=\"2\" rmax=\"1\" z=\"1\"/>",
            volume,
            "expected rmin of the tube below 1, found \"2\"",
        ),
        (
            "<expresion name=\"e\">1</expresion>",
            "",
            "",
            "g.gdml:1:15: expected one of constant, quantity, variable, expression",
        ),
        ("<expression name=\"e\">1+</expression>", "", "", "g.gdml:1:15: expected a number"),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            "<volum name=\"v\"/>",
            "g.gdml:3:12: expected volumes and assemblies in the structure, found \"volum\"",
        ),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            "<volume name=\"v\"><solidref ref=\"s\"/><phyvol/></volume>",
            "g.gdml:3:48: expected placements and the solid of a volume, found \"phyvol\"",
        ),
        (
            "",
            "<orb name=\"s\" r=\"1\"><hole/></orb>",
            volume,
            "g.gdml:2:29: expected nothing in the orb, found \"hole\"",
        ),
        ("", "<orb r=\"1\"/>", volume, "g.gdml:2:9: expected name of the orb, found none"),
        (
            "",
            "<orb name=\"s\" r=\"1\"/><orb name=\"s\" r=\"2\"/>",
            volume,
            "expected a name that no other solid has, found \"s\"",
        ),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            &(volume.to_owned() + "</structure><setup name=\"Default\"><world ref=\"w\"/></setup><structure>"),
            "expected the name of a volume, found \"w\"",
        ),
        (
            "",
            "<orb name=\"s\" r=\"1\"/>",
            &(volume.to_owned() + "</structure><display/><structure>"),
            "expected one of define, materials, solids, structure, setup, userinfo in the gdml, found \"display\"",
        ),
        ("<constant name=\"cm\" value=\"1\"/>", "", "", "a name that is no unit or number of its own, found \"cm\""),
        (
            "",
            "<subtraction name=\"s\"><first ref=\"s\"/><second ref=\"s\"/></subtraction>",
            volume,
            "solids within solids",
        ),
        (
            "",
            "<trap name=\"s\" z=\"10\" theta=\"0\" phi=\"0\" y1=\"6\" x1=\"4\" x2=\"9\" alpha1=\"0\" y2=\"8\" x3=\"5\" x4=\"6\" alpha2=\"0\"/>",
            volume,
            "a twisted trap",
        ),
    ] {
        let sentence = of(define, solids, structure);
        assert!(sentence.contains(words) && sentence.lines().count() == 1, "{solids}: {sentence}");
    }
    std::fs::write(&path, "<geometry/>").expect("written");
    assert!(read_gdml(&path).expect_err("refused").to_string().contains("expected gdml as the root element"));
}
