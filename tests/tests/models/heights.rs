//! Height fields and half-spaces told in code: what is read of their text against what their heights say.

use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Solid;
use contactd_client::solid::{self, height_field};
use contactd_proto::MassOptions;
use contactd_tests::random_solids::Random;
use glam::{DVec2, DVec3};

/// A grid of heights over a rectangle about the origin.
struct Grid {
    rows: Vec<Vec<f64>>,
    size: DVec2,
    base: f64,
}

impl Grid {
    fn random(r: &mut Random, most: usize) -> Self {
        let (columns, rows) = (2 + r.below(most - 1), 2 + r.below(most - 1));
        let steep = r.within(0.0, 1.0);
        let rows = (0..rows).map(|_| (0..columns).map(|_| r.within(-steep, steep)).collect()).collect();
        Self { rows, size: DVec2::new(r.within(0.5, 3.0), r.within(0.5, 3.0)), base: -steep - r.within(0.01, 1.0) }
    }

    fn cells(&self) -> [usize; 2] {
        [self.rows[0].len() - 1, self.rows.len() - 1]
    }

    fn solid(&self) -> solid::Solid {
        height_field(&self.rows, self.size.x, self.size.y, self.base)
    }

    /// The height above a point of the rectangle: of the triangle of its cell that holds it.
    fn height(&self, x: f64, y: f64) -> f64 {
        let [columns, rows] = self.cells();
        let (u, v) = ((x / self.size.x + 0.5) * columns as f64, (y / self.size.y + 0.5) * rows as f64);
        let (i, j) = ((u.floor() as usize).min(columns - 1), (v.floor() as usize).min(rows - 1));
        let (p, q) = (u - i as f64, v - j as f64);
        let z = |di: usize, dj: usize| self.rows[j + dj][i + di];
        if p >= q {
            z(0, 0) + p * (z(1, 0) - z(0, 0)) + q * (z(1, 1) - z(1, 0))
        } else {
            z(0, 0) + q * (z(0, 1) - z(0, 0)) + p * (z(1, 1) - z(0, 1))
        }
    }

    /// The prisms below all triangles.
    fn volume(&self) -> f64 {
        let [columns, rows] = self.cells();
        let area = self.size.x * self.size.y / (columns * rows) as f64;
        let mut sum = 0.0;
        for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            let z = |di: usize, dj: usize| self.rows[j + dj][i + di];
            sum += (2.0 * (z(0, 0) + z(1, 1)) + z(1, 0) + z(0, 1)) / 6.0 - self.base;
        }
        sum * area
    }
}

fn read(text: &str) -> Solid {
    let import = import_csg("built.csg", text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(import.notes.iter().all(|n| !n.text.contains("repaired")), "{:?}", import.notes);
    import.solid
}

#[test]
fn height_fields_hold_what_is_below_their_heights() {
    let mut r = Random::new(41);
    let (mut inside_points, mut points) = (0, 0);
    // From two triangles to a division of tens of thousands.
    for most in [1, 1, 2, 3, 5, 9, 20, 33, 60, 140] {
        let grid = Grid::random(&mut r, most + 1);
        let text = grid.solid().text().expect("a text");
        let solid = read(&text);
        let reach = DVec3::new(0.6 * grid.size.x, 0.6 * grid.size.y, 1.2 * grid.base.abs());
        for _ in 0..1_000 {
            let x = DVec3::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0)) * reach;
            let f = solid.value(x);
            let within = x.x.abs() < 0.5 * grid.size.x && x.y.abs() < 0.5 * grid.size.y;
            let inside = within && x.z > grid.base && x.z < grid.height(x.x, x.y);
            if f.abs() < 1e-9 {
                continue;
            }
            assert_eq!(f < 0.0, inside, "{:?} at {x}: {f}", grid.cells());
            points += 1;
            inside_points += usize::from(inside);
        }
        let m = mass_properties(&Model::new(solid), &MassOptions { tolerance: 1e-9, boxes: 10 }).expect("bounded");
        let exact = grid.volume();
        assert!((m.volume - exact).abs() <= 1e-12 * exact && m.volume_error <= 1e-9 * exact, "{m:?}, not {exact}");
    }
    println!("{points} points, {inside_points} inside");
    assert!(inside_points * 5 > points && points > 9_000);
}

#[test]
fn what_is_no_height_field_or_half_space_is_told_with_its_place() {
    let told = |text: &str| match import_csg("m.csg", text, Facets::Auto, &Limits::default()) {
        Err(e) => e.to_string(),
        Ok(_) => panic!("{text} loads"),
    };
    for (text, sentence) in [
        ("height_field(heights = 3);", "m.csg:1:24: expected rows of heights, found 3"),
        ("height_field(heights = [[1, 2]]);", "m.csg:1:24: expected two rows of heights or more, found a list of 1"),
        ("height_field(heights = [[1], [2]]);", "m.csg:1:25: expected a row of two heights or more, found one of 1"),
        ("height_field(heights = [[1, 2], [2]]);", "m.csg:1:33: expected rows of one length, found one of 1"),
        (
            "height_field(heights = [[1, 2], [2, 3]], base = 1);",
            "m.csg:1:1: expected a base below the lowest height, 1, found base = 1",
        ),
        (
            "half_space(normal = [0, 0, 0]);",
            "m.csg:1:1: expected a normal that is not 0, found half_space along [0, 0, 0]",
        ),
        ("half_space(normal = 3);", "m.csg:1:21: expected a normal of 3 numbers, found 3"),
        ("half_space(offset = inf);", "m.csg:1:1: expected a finite offset, found half_space at inf"),
    ] {
        assert_eq!(told(text), sentence);
    }
}

#[test]
fn a_half_space_loads_as_it_was_built_and_has_no_mass() {
    let mut r = Random::new(42);
    for _ in 0..200 {
        let (n, offset) = (r.direction() * r.within(0.1, 4.0), r.within(-3.0, 3.0));
        let built = read(&solid::half_space(n, offset).text().expect("a text"));
        let written = read(&format!("half_space(normal = [{}, {}, {}], offset = {offset});", n.x, n.y, n.z));
        for _ in 0..20 {
            let x = r.vector(10.0);
            let exact = n.normalize().dot(x) - offset;
            assert!(
                (built.value(x) - exact).abs() < 4e-14 && (written.value(x) - exact).abs() < 4e-14,
                "{n}, {offset}"
            );
        }
        let model = Model::new(written);
        assert_eq!((model.radius, model.size()), (f64::INFINITY, 0.0));
        let e = mass_properties(&model, &MassOptions { tolerance: 0.1, boxes: 10 }).expect_err("without bounds");
        assert_eq!(e.to_string(), "expected a solid of finite size, found one that reaches to infinity");
    }
}
