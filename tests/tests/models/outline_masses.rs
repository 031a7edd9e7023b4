//! Masses of extrusions of very many corners: a closed form that holds against quadrature of the outlines and against boxes.
//! `CONTACTD_OUTLINES` sets the number of random extrusions, each of up to 50,000 corners then:
//! `CONTACTD_OUTLINES=30 cargo test -p contactd-tests --test models outline_masses::`.

use contactd::cache::{decode, encode};
use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd_proto::{MassOptions, MassProperties};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::TAU;

/// A ring about a point, of waves and some jitter.
fn coast(r: &mut Random, n: usize, size: f64, about: DVec2) -> Vec<DVec2> {
    let waves: Vec<[f64; 3]> =
        (2..40).map(|k| [f64::from(k), r.within(-0.2, 0.2) / f64::from(k), r.within(0.0, TAU)]).collect();
    let jitter = r.within(0.0, 0.002);
    let corner = |i: usize, r: &mut Random| {
        let u = TAU * i as f64 / n as f64;
        let far = 1.0 + waves.iter().map(|[k, a, at]| a * (k * u + at).cos()).sum::<f64>();
        about + size * (far + r.within(-jitter, jitter)) * DVec2::new(u.cos(), u.sin())
    };
    (0..n).map(|i| corner(i, r)).collect()
}

/// An outline with holes and a second island, all rings of it.
fn outline(r: &mut Random, corners: usize) -> Vec<Vec<DVec2>> {
    let about = DVec2::new(r.within(-5.0, 5.0), r.within(-5.0, 5.0));
    let mut rings = vec![coast(r, corners, 3.0, about)];
    if r.chance(0.6) {
        let counts = [12 + r.below(corners / 2), 3 + r.below(40)];
        rings.push(coast(r, counts[0], 0.5, about + DVec2::new(-0.6, 0.0)));
        rings.push(coast(r, counts[1], 0.3, about + DVec2::new(0.9, 0.2)));
    }
    if r.chance(0.5) {
        let count = 20 + r.below(corners / 2);
        rings.push(coast(r, count, 1.0, about + DVec2::new(0.0, 8.0)));
    }
    rings
}

struct Extruded {
    rings: Vec<Vec<DVec2>>,
    height: f64,
    scale: f64,
    place: DAffine3,
}

impl Extruded {
    fn random(r: &mut Random, corners: usize) -> Self {
        let mut turn = DMat3::from_quat(r.rotation()) * r.within(0.3, 3.0);
        if r.chance(0.4) {
            turn.x_axis = -turn.x_axis;
        }
        if r.chance(0.3) {
            turn.y_axis += turn.z_axis * r.within(-0.5, 0.5);
        }
        let place = DAffine3 { matrix3: turn, translation: r.vector(30.0) };
        let scale = if r.chance(0.5) { 1.0 } else { r.within(0.3, 2.0) };
        Self { rings: outline(r, corners), height: r.within(0.2, 6.0), scale, place }
    }

    fn text(&self) -> String {
        let corners: Vec<[f64; 2]> = self.rings.iter().flatten().map(|p| p.to_array()).collect();
        let mut from = 0;
        let paths: Vec<Vec<usize>> = self
            .rings
            .iter()
            .map(|ring| {
                from += ring.len();
                (from - ring.len()..from).collect()
            })
            .collect();
        let (m, t) = (self.place.matrix3.transpose(), self.place.translation);
        let row = |v: DVec3, t: f64| format!("[{:?}, {:?}, {:?}, {t:?}]", v.x, v.y, v.z);
        let rows = [row(m.x_axis, t.x), row(m.y_axis, t.y), row(m.z_axis, t.z), "[0, 0, 0, 1]".into()].join(", ");
        format!(
            "multmatrix([{rows}]) {{ linear_extrude(height = {:?}, scale = {:?}) {{ polygon(points = {corners:?}, paths = {paths:?}); }} }}",
            self.height, self.scale
        )
    }

    /// ∫ 1, x, y, z, xx, yy, zz, xy, xz, yz about a point: levels by Gauss' rule of three places, each a fan of signed triangles from
    /// the plane's origin by the middles of their sides. Both are exact for what is integrated.
    fn integrals(&self, about: DVec3) -> [f64; 10] {
        let far = 0.6f64.sqrt() / 2.0;
        let mut sums = [0.0; 10];
        for (t, weight) in [(0.5 - far, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + far, 5.0 / 18.0)] {
            let grown = 1.0 + (self.scale - 1.0) * t;
            // Holes are drawn as rings of the same turn.
            for (k, ring) in self.rings.iter().enumerate() {
                let sign = if self.is_hole(k) { -1.0 } else { 1.0 };
                for i in 0..ring.len() {
                    let [p, q] = [ring[i], ring[(i + 1) % ring.len()]].map(|p| p * grown);
                    let area = 0.5 * p.perp_dot(q) * sign;
                    for middle in [p * 0.5, q * 0.5, (p + q) * 0.5] {
                        let x = self.place.transform_point3(middle.extend(self.height * t)) - about;
                        let all =
                            [1.0, x.x, x.y, x.z, x.x * x.x, x.y * x.y, x.z * x.z, x.x * x.y, x.x * x.z, x.y * x.z];
                        sums.iter_mut().zip(all).for_each(|(sum, f)| *sum += f * area / 3.0 * weight);
                    }
                }
            }
        }
        sums.map(|x| x * self.height * self.place.matrix3.determinant().abs())
    }

    fn is_hole(&self, ring: usize) -> bool {
        let middle = self.rings[ring].iter().copied().sum::<DVec2>() / self.rings[ring].len() as f64;
        let outer = self.rings[0].iter().copied().sum::<DVec2>() / self.rings[0].len() as f64;
        ring > 0 && middle.distance(outer) < 2.0
    }
}

fn model(text: &str) -> Model {
    let import = import_csg("m.csg", text, Facets::Auto, &Limits::default()).expect("an extrusion");
    assert!(import.notes.iter().all(|n| !n.text.contains("taken as a mesh")), "{:?}", import.notes);
    Model::new(import.solid)
}

fn mass(model: &Model, tolerance: f64, boxes: u64) -> MassProperties {
    mass_properties(model, &MassOptions { tolerance, boxes }).expect("a bounded solid")
}

fn holds(m: &MassProperties, exact: &Extruded, what: &str) {
    let s = exact.integrals(m.center);
    let slack = 1e-11 * m.volume;
    assert!((m.volume - s[0]).abs() <= m.volume_error + slack, "{what}: {m:?}, {s:?}");
    let size = 20.0;
    for k in 0..3 {
        assert!((s[1 + k] / s[0]).abs() <= m.center_error[k] + 1e-11 * size, "{what}: {m:?}, {s:?}");
    }
    let inertia = [s[5] + s[6], s[4] + s[6], s[4] + s[5], -s[7], -s[8], -s[9]];
    for k in 0..6 {
        let off = (m.inertia[k] - inertia[k]).abs();
        assert!(off <= m.inertia_error[k] + slack * size * size, "{what}, {k}: {off}, {m:?}, {inertia:?}");
    }
}

#[test]
fn extrusions_of_very_many_corners_have_the_masses_of_their_outlines() {
    let long = std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok());
    let mut r = Random::new(0x0a55);
    for i in 0..long.unwrap_or(5) {
        let corners = 1001 + r.below(if long.is_some() { 49_000 } else { 2_000 });
        let exact = Extruded::random(&mut r, corners);
        let model = model(&exact.text());
        let m = mass(&model, 1e-6, 1_000_000);
        let what = format!("{i}, {corners} corners");
        assert_eq!(m.boxes, 0, "{what}");
        assert!(m.volume_error <= 1e-6 * m.volume, "{what}: {m:?}");
        holds(&m, &exact, &what);
        if long.is_some() {
            println!("{what}: {:.1e} of the volume", m.volume_error / m.volume);
        }
        // What is kept on disk tells the same, to the bit.
        let (kept, _) = decode(&encode(&model, &[]).expect("a tree of few levels")).expect("its bytes");
        assert_eq!(mass(&kept, 1e-6, 1_000_000), m, "{what}");
    }
}

#[test]
fn what_is_cut_from_them_is_told_by_boxes_that_agree() {
    let mut r = Random::new(0x0a56);
    for i in 0..sized("CONTACTD_OUTLINES", 1) {
        let corners = 1001 + r.below(100);
        let exact = Extruded::random(&mut r, corners);
        let text = exact.text();
        let whole = mass(&model(&text), 1e-6, 1_000_000);
        // Cut by a box around it: no closed form, the same solid.
        let cut = mass(&model(&format!("intersection() {{ {text} cube(size = 900, center = true); }}")), 0.2, 200_000);
        assert!(cut.boxes > 0);
        let off = (cut.volume - whole.volume).abs();
        assert!(off <= cut.volume_error + whole.volume_error, "{i}: {whole:?}, {cut:?}");
        assert!(cut.volume_error < 0.5 * whole.volume, "{i}: {cut:?}");
        // Beside another body it has its closed form, with the sum.
        let far =
            "multmatrix([[1, 0, 0, 400], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { cube(size = 2, center = true); }";
        let both = mass(&model(&format!("union() {{ {text} {far} }}")), 1e-6, 1_000_000);
        assert_eq!(both.boxes, 0, "{i}");
        assert!((both.volume - whole.volume - 8.0).abs() <= both.volume_error + whole.volume_error, "{i}: {both:?}");
    }
}
