//! Every kind of contact, with the regions in which two bodies touch: their extent, kind, normal, faces and the points
//! that bound them, against what elementary geometry says.

use super::tight::prism;
use contactd::contact::distance::{DEFAULT_LIMIT, DistanceQuery, at_instant};
use contactd::contact::margin::touching;
use contactd::contact::region::{Region, Regions, complete, regions, threshold};
use contactd::contact::within::Within;
use contactd::contact::{
    DEFAULT_CELL_LIMIT, Extent, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies,
    default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::Polyhedron;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{Recipe, primitive, tree};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2, TAU};

/// Two bodies at rest.
struct Rest {
    a: Model,
    b: Model,
    pose_a: Pose,
    pose_b: Pose,
}

impl Rest {
    fn new(a: Recipe, pose_a: Pose, b: Recipe, pose_b: Pose) -> Self {
        Self { a: Model::new(a.build()), b: Model::new(b.build()), pose_a, pose_b }
    }

    fn query(&self) -> PairQuery<'_> {
        self.moving(DVec3::ZERO)
    }

    /// b moves, a rests.
    fn moving(&self, velocity: DVec3) -> PairQuery<'_> {
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        PairQuery {
            a: PlacedModel { model: &self.a, placed: placed(Motion::resting(self.pose_a)) },
            b: PlacedModel {
                model: &self.b,
                placed: placed(Motion { start: self.pose_b, velocity, spin: DVec3::ZERO }),
            },
            resolution: default_resolution(&self.a, &self.b),
            cell_limit: 100_000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        }
    }

    fn regions(&self, margin: f64) -> Regions {
        let query = self.query();
        let found = regions(&query, 0.0, threshold(query.resolution, margin));
        assert!(found.complete, "{} boxes: {found:?}", found.cells);
        found
    }

    fn answer(&self, velocity: DVec3, margin: f64) -> (Outcome, Regions) {
        let query = self.moving(velocity);
        let mut o = earliest_contact(&query, &mut Scratch::default());
        let threshold = threshold(query.resolution, margin);
        o.touching |= touching(&query, threshold, &mut Scratch::default()).0 != Within::Apart;
        let found = complete(&query, &mut o, threshold);
        (o, found)
    }
}

/// a at the origin, b over it.
fn rest(a: Recipe, b: Recipe, pose_b: Pose) -> Rest {
    Rest::new(a, Pose::IDENTITY, b, pose_b)
}

fn turned(axis: DVec3, angle: f64) -> DQuat {
    quat_of_rotation_vector(axis.normalize() * angle)
}

fn cube() -> Recipe {
    Recipe::cuboid(0.5, 0.5, 0.5)
}

/// A plate whose upper face is z = 0.
fn floor() -> Recipe {
    Recipe::cuboid(4.0, 4.0, 1.0).at(0.0, 0.0, -1.0)
}

/// Holds the one region of a list against its kind, extent, normal and set of points.
#[track_caller]
fn is(r: &Region, kind: &str, extent: Extent, normal: DVec3, points: &[DVec3]) {
    assert_eq!((r.kind.name(), r.extent), (kind, extent), "{r:?}");
    assert!(r.normal.distance(normal) < 1e-7, "normal {}, expected {normal}", r.normal);
    assert_eq!(r.points.len(), points.len(), "{r:#?}");
    for p in points {
        let off = r.points.iter().map(|q| q.point.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(off < 3e-9, "no point at {p}, the nearest is {off} away: {r:#?}");
    }
    assert!(r.faces_a[0] != u32::MAX && r.faces_b[0] != u32::MAX, "{r:?}");
}

#[track_caller]
fn only(found: &Regions) -> &Region {
    assert_eq!(found.regions.len(), 1, "{found:#?}");
    &found.regions[0]
}

fn square(half: f64, x: f64, y: f64) -> Vec<DVec3> {
    [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(s, t)| dvec3(x + s * half, y + t * half, 0.0)).to_vec()
}

/// Eight points of a circle about z.
fn ring(radius: f64, x: f64, y: f64, z: f64) -> Vec<DVec3> {
    (0..8)
        .map(|k| {
            let angle = f64::from(k) * FRAC_PI_4;
            dvec3(x + radius * angle.cos(), y + radius * angle.sin(), z)
        })
        .collect()
}

#[test]
fn a_box_on_a_floor_is_a_patch_with_its_four_corners() {
    let s = rest(floor(), cube(), Pose::at(dvec3(0.3, -0.2, 0.5)));
    is(only(&s.regions(0.0)), "face-face", Extent::Patch, DVec3::Z, &square(0.5, 0.3, -0.2));
    assert_eq!(only(&s.regions(0.0)).faces_b[0], 5);
    // Turned about the normal, and hanging over the edge: clipped by the floor.
    let s = rest(floor(), cube(), Pose::new(dvec3(4.0, 0.0, 0.5), turned(DVec3::Z, FRAC_PI_4)));
    let d = 0.5 * SQRT_2;
    let points = [dvec3(4.0, d, 0.0), dvec3(4.0, -d, 0.0), dvec3(4.0 - d, 0.0, 0.0)];
    is(only(&s.regions(0.0)), "face-face", Extent::Patch, DVec3::Z, &points);
}

#[test]
fn patches_have_the_corners_that_set_operations_make() {
    // A block with a groove stands on two feet: one face, two patches.
    let block = Recipe::cuboid(1.0, 0.5, 0.5).minus(Recipe::cuboid(0.4, 1.0, 0.4).at(0.0, 0.0, -0.5));
    let s = rest(floor(), block, Pose::at(DVec3::Z * 0.5));
    let found = s.regions(0.0);
    assert_eq!(found.regions.len(), 2, "{found:#?}");
    let mut feet: Vec<f64> = found.regions.iter().map(|r| r.points.iter().map(|p| p.point.x).sum::<f64>()).collect();
    feet.sort_by(f64::total_cmp);
    assert!((feet[0] + 2.8).abs() < 1e-9 && (feet[1] - 2.8).abs() < 1e-9, "{found:#?}");
    // Two abutting operands of a union are one face: no corner on their seam.
    let two = cube().at(-0.5, 0.0, 0.0).union(cube().at(0.5, 0.0, 0.0));
    let s = rest(floor(), two, Pose::at(DVec3::Z * 0.5));
    let points = [(1.0, 0.5), (1.0, -0.5), (-1.0, 0.5), (-1.0, -0.5)].map(|(x, y)| dvec3(x, y, 0.0));
    is(only(&s.regions(0.0)), "face-face", Extent::Patch, DVec3::Z, &points);
    // A hole in the block: its rim bounds the patch from within.
    let drilled = cube().minus(Recipe::cylinder(0.25, 1.0));
    let s = rest(floor(), drilled, Pose::at(DVec3::Z * 0.5));
    let points = [square(0.5, 0.0, 0.0), ring(0.25, 0.0, 0.0, 0.0)].concat();
    is(only(&s.regions(0.0)), "face-face", Extent::Patch, DVec3::Z, &points);
}

#[test]
fn a_standing_cylinder_is_a_disc_and_a_lying_one_a_line() {
    let s = rest(floor(), Recipe::cylinder(0.5, 1.0), Pose::at(dvec3(0.2, 0.1, 1.0)));
    is(only(&s.regions(0.0)), "face-face", Extent::Patch, DVec3::Z, &ring(0.5, 0.2, 0.1, 0.0));
    let lying = Pose::new(dvec3(0.2, 0.1, 0.5), turned(DVec3::Y, FRAC_PI_2));
    let s = rest(floor(), Recipe::cylinder(0.5, 1.0), lying);
    let ends = [dvec3(1.2, 0.1, 0.0), dvec3(-0.8, 0.1, 0.0)];
    is(only(&s.regions(0.0)), "face-face", Extent::Line, DVec3::Z, &ends);
    // Over the floor's edge: the line ends there.
    let lying = Pose::new(dvec3(3.5, 0.1, 0.5), turned(DVec3::Y, FRAC_PI_2));
    let s = rest(floor(), Recipe::cylinder(0.5, 1.0), lying);
    is(only(&s.regions(0.0)), "face-face", Extent::Line, DVec3::Z, &[dvec3(4.0, 0.1, 0.0), dvec3(2.5, 0.1, 0.0)]);
    // A cone on its side, its apex an end.
    let half = (0.5f64 / 2.0).atan();
    let cone = Recipe::cone(0.5, 0.0, 1.0).at(0.0, 0.0, -1.0);
    // Its axis from the apex points down; laid so that the ruling is horizontal.
    let lay = Pose::new(DVec3::ZERO, turned(DVec3::Y, FRAC_PI_2 + half));
    let s = rest(floor(), cone, lay);
    let slant = 2.0f64.hypot(0.5);
    let found = s.regions(0.0);
    let r = only(&found);
    assert_eq!((r.kind.name(), r.extent), ("face-face", Extent::Line), "{r:?}");
    let far = r.points.iter().map(|p| p.point.length()).fold(0.0, f64::max);
    assert!((far - slant).abs() < 1e-9 && r.points.iter().any(|p| p.point.length() < 1e-9), "{r:?}");
}

#[test]
fn round_faces_touch_at_points() {
    let s = rest(floor(), Recipe::sphere(0.5), Pose::at(dvec3(0.3, 0.2, 0.5)));
    is(only(&s.regions(0.0)), "face-face", Extent::Point, DVec3::Z, &[dvec3(0.3, 0.2, 0.0)]);
    let s = rest(Recipe::sphere(0.5), Recipe::sphere(0.25), Pose::at(DVec3::X * 0.75));
    is(only(&s.regions(0.0)), "face-face", Extent::Point, DVec3::X, &[DVec3::X * 0.5]);
    // Crossed cylinders.
    let crossed = Pose::new(DVec3::Y * 1.0, turned(DVec3::Y, FRAC_PI_2));
    let s = rest(Recipe::cylinder(0.5, 1.0), Recipe::cylinder(0.5, 1.0), crossed);
    is(only(&s.regions(0.0)), "face-face", Extent::Point, DVec3::Y, &[DVec3::Y * 0.5]);
    // A ball between two walls of a groove touches both.
    let groove = Recipe::cuboid(2.0, 2.0, 1.0).minus(Recipe::cuboid(0.5, 3.0, 0.8).at(0.0, 0.0, 1.0));
    let s = rest(groove, Recipe::sphere(0.5), Pose::at(dvec3(0.0, 0.0, 0.8)));
    let found = s.regions(0.0);
    assert_eq!(found.regions.len(), 2, "{found:#?}");
    for r in &found.regions {
        let side = r.points[0].point.x.signum();
        is(r, "face-face", Extent::Point, DVec3::X * -side, &[dvec3(0.5 * side, 0.0, 0.8)]);
    }
}

#[test]
fn edges_and_vertices_on_faces() {
    // An edge down: a line.
    let on_edge = Pose::new(DVec3::Z * (0.5 * SQRT_2), turned(DVec3::X, FRAC_PI_4));
    let s = rest(floor(), cube(), on_edge);
    is(only(&s.regions(0.0)), "edge-face", Extent::Line, DVec3::Z, &[DVec3::X * 0.5, DVec3::X * -0.5]);
    // A vertex down: a point.
    let diagonal = DQuat::from_rotation_arc(dvec3(-1.0, -1.0, -1.0).normalize(), DVec3::NEG_Z);
    let s = rest(floor(), cube(), Pose::new(DVec3::Z * (0.5 * 3f64.sqrt()), diagonal));
    is(only(&s.regions(0.0)), "vertex-face", Extent::Point, DVec3::Z, &[DVec3::ZERO]);
    // A tilted cylinder touches with its rim.
    let tilt = Pose::new(DVec3::ZERO, turned(DVec3::Y, 0.3));
    let low = tilt.vector(dvec3(0.5, 0.0, -1.0));
    let s = rest(floor(), Recipe::cylinder(0.5, 1.0), Pose::new(DVec3::Z * -low.z, tilt.rotation));
    is(only(&s.regions(0.0)), "edge-face", Extent::Point, DVec3::Z, &[dvec3(low.x, 0.0, 0.0)]);
    // A cone's apex is a vertex.
    let cone = Recipe::cone(0.5, 0.0, 0.5).at(0.0, 0.0, -0.5);
    let s = rest(floor(), cone, Pose::new(DVec3::ZERO, turned(DVec3::X, 2.8)));
    is(only(&s.regions(0.0)), "vertex-face", Extent::Point, DVec3::Z, &[DVec3::ZERO]);
}

#[test]
fn edges_and_vertices_on_edges_and_vertices() {
    let ridge = || cube().moved(&Pose::new(DVec3::Z * (-0.5 * SQRT_2), turned(DVec3::X, FRAC_PI_4)));
    let keel = |turn: DQuat| Pose::new(DVec3::Z * (0.5 * SQRT_2), turn * turned(DVec3::X, FRAC_PI_4));
    // Crossing edges.
    let s = rest(ridge(), cube(), keel(turned(DVec3::Z, FRAC_PI_2)));
    is(only(&s.regions(0.0)), "edge-edge", Extent::Point, DVec3::Z, &[DVec3::ZERO]);
    // Edges along each other, one shifted.
    let along = keel(DQuat::IDENTITY);
    let s = rest(ridge(), cube(), Pose::new(along.position + DVec3::X * 0.3, along.rotation));
    is(only(&s.regions(0.0)), "edge-edge", Extent::Line, DVec3::Z, &[DVec3::X * 0.5, DVec3::X * -0.2]);
    // A vertex on an edge, and on a vertex.
    let diagonal = DQuat::from_rotation_arc(dvec3(-1.0, -1.0, -1.0).normalize(), DVec3::NEG_Z);
    let point = Pose::new(DVec3::Z * (0.5 * 3f64.sqrt()), diagonal);
    let s = rest(ridge(), cube(), point);
    let found = s.regions(0.0);
    assert_eq!(only(&found).kind.name(), "vertex-edge", "{found:?}");
    let up = cube().moved(&Pose::new(DVec3::Z * (-0.5 * 3f64.sqrt()), diagonal));
    let s = rest(up, cube(), point);
    is(only(&s.regions(0.0)), "vertex-vertex", Extent::Point, DVec3::Z, &[DVec3::ZERO]);
    // Apex on apex.
    let cone = || Recipe::cone(0.5, 0.0, 0.5).at(0.0, 0.0, -0.5);
    let s = rest(cone(), cone(), Pose::new(DVec3::ZERO, turned(DVec3::X, TAU / 2.0)));
    is(only(&s.regions(0.0)), "vertex-vertex", Extent::Point, DVec3::Z, &[DVec3::ZERO]);
}

#[test]
fn pegs_balls_and_cones_in_their_holes() {
    let plate = |r: f64| Recipe::cuboid(1.0, 1.0, 0.2).minus(Recipe::cylinder(r, 0.5));
    // A thinner peg against the wall: a line as long as the plate is thick.
    let s = rest(plate(0.25), Recipe::cylinder(0.24, 0.5), Pose::at(DVec3::X * 0.01));
    let ends = [dvec3(0.25, 0.0, 0.2), dvec3(0.25, 0.0, -0.2)];
    is(only(&s.regions(0.0)), "face-face", Extent::Line, DVec3::NEG_X, &ends);
    // A peg of its own size: all of the wall.
    let s = rest(plate(0.25), Recipe::cylinder(0.25, 0.5), Pose::at(DVec3::Z * 0.1));
    let found = s.regions(0.0);
    let r = only(&found);
    let rims = [ring(0.25, 0.0, 0.0, 0.2), ring(0.25, 0.0, 0.0, -0.2)].concat();
    is(r, "face-face", Extent::Patch, r.normal, &rims);
    // A ball in a cylinder of its size: a circle.
    let s = rest(plate(0.25), Recipe::sphere(0.25), Pose::IDENTITY);
    let found = s.regions(0.0);
    let r = only(&found);
    is(r, "face-face", Extent::Line, r.normal, &ring(0.25, 0.0, 0.0, 0.0));
    // A ball in its socket: the rim bounds the patch.
    let socket = Recipe::cuboid(1.0, 1.0, 0.4).at(0.0, 0.0, -0.4).minus(Recipe::sphere(0.5).at(0.0, 0.0, 0.3));
    let s = rest(socket, Recipe::sphere(0.5), Pose::at(DVec3::Z * 0.3));
    let found = s.regions(0.0);
    is(only(&found), "face-face", Extent::Patch, DVec3::Z, &ring(0.4, 0.0, 0.0, 0.0));
    // A larger ball rests on the rim that the hole makes: a circle, edge against face.
    let s = rest(plate(0.3), Recipe::sphere(0.5), Pose::at(DVec3::Z * 0.6));
    let found = s.regions(0.0);
    let r = only(&found);
    assert!(r.kind.name() == "edge-face", "{r:?}");
    is(r, "edge-face", Extent::Line, r.normal, &ring(0.3, 0.0, 0.0, 0.2));
    // A cone in a cone of its angle, deeper than it is high: its lateral surface.
    let hole = Recipe::cone(0.0, 1.0, 0.5).at(0.0, 0.0, 0.5);
    let block = Recipe::cuboid(2.0, 2.0, 0.9).at(0.0, 0.0, -0.1).minus(hole);
    let s = rest(block, Recipe::cone(0.0, 0.5, 0.25).at(0.0, 0.0, 0.25), Pose::IDENTITY);
    let found = s.regions(0.0);
    let r = &found.regions[0];
    assert_eq!((r.extent, r.kind.name()), (Extent::Patch, "face-face"), "{found:#?}");
    for p in ring(0.5, 0.0, 0.0, 0.5) {
        assert!(r.points.iter().any(|q| q.point.distance(p) < 1e-8), "{p}: {found:#?}");
    }
}

#[test]
fn a_tilted_peg_touches_the_rim_of_its_hole_on_both_sides() {
    let plate = Recipe::cuboid(1.0, 1.0, 0.2).minus(Recipe::cylinder(0.25, 0.5));
    let turn = turned(DVec3::Y, 0.1);
    let s = rest(plate, Recipe::cylinder(0.25, 0.5), Pose::new(DVec3::Z * 1.2, turn));
    let (o, found) = s.answer(dvec3(0.0, 0.0, -1.0), 0.0);
    assert_eq!(o.status(), Status::Contact);
    assert!(found.complete, "{found:#?}");
    // The contact is among the regions, and every region is mirrored in the plane of the tilt.
    let points: Vec<DVec3> = found.regions.iter().flat_map(|r| r.points.iter().map(|p| p.point)).collect();
    assert!(points.iter().any(|p| p.distance(o.at().point) < 1e-7), "{o:?}: {found:#?}");
    for p in &points {
        let mirrored = dvec3(p.x, -p.y, p.z);
        assert!(points.iter().any(|q| q.distance(mirrored) < 1e-6), "{p} has no mirror image: {found:#?}");
    }
}

#[test]
fn touching_is_decided_by_the_margin() {
    let s = |gap: f64| rest(floor(), cube(), Pose::at(DVec3::Z * (0.5 + gap)));
    for (gap, margin, expected) in
        [(0.0, 0.0, true), (1e-3, 0.0, false), (1e-3, 0.9e-3, false), (1e-3, 1.1e-3, true), (1e-12, 0.0, true)]
    {
        let (o, found) = s(gap).answer(DVec3::ZERO, margin);
        assert_eq!((o.status(), o.touching), (Status::Clear, expected), "gap {gap}, margin {margin}");
        assert_eq!(found.regions.len(), usize::from(expected), "gap {gap}, margin {margin}: {found:#?}");
        if expected {
            assert!((o.at().separation - gap).abs() < 1e-12, "{o:?}");
            assert!(found.regions[0].points.iter().all(|p| (p.separation - gap).abs() < 1e-12), "{found:#?}");
            assert!(o.at().normal.distance(DVec3::Z) < 1e-12 && o.at().normal_speed == 0.0);
        }
    }
    // Sliding and receding pairs are clear and touch; their speeds along the normal tell which is which.
    let (o, _) = s(0.0).answer(dvec3(0.3, 0.0, 0.0), 0.0);
    assert_eq!((o.status(), o.touching, o.at().normal_speed), (Status::Clear, true, 0.0));
    let (o, found) = s(0.0).answer(dvec3(0.0, 0.0, 0.5), 0.0);
    assert_eq!((o.status(), o.touching, o.at().normal_speed), (Status::Clear, true, -0.5));
    assert_eq!(found.regions[0].points.len(), 4);
    // Beside contact too: a body pressed on.
    let (o, found) = s(0.0).answer(dvec3(0.0, 0.0, -0.5), 0.0);
    assert_eq!((o.status(), o.touching), (Status::Contact, true));
    assert!(o.time() < 1e-15, "{o:?}");
    assert_eq!(found.regions[0].points.len(), 4);
    // A ball in a hole, by its wall, and one over the plate: no cell is asked.
    let plate = Recipe::cuboid(1.0, 1.0, 0.25).minus(Recipe::cylinder(0.5, 1.0));
    for place in [dvec3(0.19, 0.0, 0.1), dvec3(0.8, 0.8, 0.56)] {
        let ball = rest(plate.clone(), Recipe::sphere(0.3), Pose::at(place));
        for (margin, is_near) in [(1e-3, false), (0.6e-2, false), (0.999e-2, false), (1.001e-2, true), (0.1, true)] {
            let (within, cells) = touching(&ball.query(), margin, &mut Scratch::default());
            assert_eq!(
                (matches!(within, Within::Witness(_)), within == Within::Apart),
                (is_near, !is_near),
                "{margin}"
            );
            assert_eq!(cells, 0, "{place}, {margin}");
        }
    }
    // A curved pair that comes near only at one point is proven apart just above the threshold.
    let ball = rest(floor(), Recipe::sphere(0.5), Pose::at(dvec3(0.1, 0.2, 0.501)));
    assert_eq!(touching(&ball.query(), 0.999e-3, &mut Scratch::default()).0, Within::Apart);
    assert!(matches!(touching(&ball.query(), 1.001e-3, &mut Scratch::default()).0, Within::Witness(_)));
}

/// A body of about 20 mm that moves by 0.2 µm keeps its regions, and no point of them goes further than that.
#[test]
fn a_body_that_moves_by_a_fifth_of_a_micrometre_keeps_its_points() {
    let (size, step, margin) = (20.0, 2e-4, 1e-3);
    let floor = || Recipe::cuboid(100.0, 100.0, 10.0).at(0.0, 0.0, -10.0);
    let upright = Pose::at(DVec3::Z * (size / 2.0));
    let lying = Pose::new(DVec3::Z * (size / 2.0), turned(DVec3::Y, FRAC_PI_2));
    let bodies = [
        ("box", Recipe::cuboid(size / 2.0, size / 2.0, size / 2.0), upright),
        ("standing cylinder", Recipe::cylinder(size / 2.0, size / 2.0), upright),
        ("lying cylinder", Recipe::cylinder(size / 2.0, size), lying),
        ("tube", Recipe::cylinder(10.0, 10.0).minus(Recipe::cylinder(6.0, 20.0)), upright),
    ];
    for (name, body, pose) in bodies {
        let base = rest(floor(), body.clone(), pose).regions(margin);
        assert_eq!(base.regions.len(), 1, "{name}: {base:#?}");
        for k in 0..24u32 {
            // Up to a step along each axis, and as much at the rim by turning about each.
            let r = |salt: u32| f64::from((k * 7919 + salt * 104_729) % 1009) / 504.5 - 1.0;
            let shift = dvec3(r(1), r(2), 0.5 + 0.5 * r(3)) * step;
            let lean = dvec3(r(4), r(5), r(6)) * (step / size);
            let moved = Pose::new(pose.position + shift, turned(lean, lean.length()) * pose.rotation);
            let now = rest(floor(), body.clone(), moved).regions(margin);
            assert_eq!(now.regions.len(), 1, "{name}, {k}: {now:#?}");
            let (p, q) = (&base.regions[0], &now.regions[0]);
            assert_eq!((p.kind, p.extent, p.faces_a, p.faces_b), (q.kind, q.extent, q.faces_a, q.faces_b), "{name}");
            assert_eq!(p.points.len(), q.points.len(), "{name}, {k}: {p:#?} {q:#?}");
            for (x, y) in p.points.iter().zip(&q.points) {
                let way = x.point.distance(y.point);
                assert!(way <= 6.0 * step, "{name}, {k}: a point went {way}: {p:#?} {q:#?}");
            }
        }
    }
}

#[test]
fn swapping_the_pair_negates_the_normals_and_swaps_the_faces() {
    let pose = Pose::new(dvec3(0.4, 0.3, 0.5), turned(DVec3::Z, 0.3));
    let s = rest(floor(), cube(), pose);
    let t = Rest::new(cube(), pose, floor(), Pose::IDENTITY);
    let (p, q) = (s.regions(0.0), t.regions(0.0));
    assert_eq!(p.regions.len(), q.regions.len());
    for (r, s) in p.regions.iter().zip(&q.regions) {
        assert_eq!((r.normal, r.faces_a, r.faces_b), (-s.normal, s.faces_b, s.faces_a));
        assert_eq!(r.points, s.points);
    }
}

/// A gap of a fifth of a body's size, in a margin that is larger yet: the same regions as where the body touches.
#[test]
fn a_gap_within_a_large_margin_has_the_regions_of_the_contact() {
    let on_edge = turned(DVec3::X, FRAC_PI_4);
    let diagonal = DQuat::from_rotation_arc(dvec3(-1.0, -1.0, -1.0).normalize(), DVec3::NEG_Z);
    let lying = turned(DVec3::Y, FRAC_PI_2);
    for (body, turn, height) in [
        (cube(), DQuat::IDENTITY, 0.5),
        (cube(), on_edge, 0.5 * SQRT_2),
        (cube(), diagonal, 0.5 * 3f64.sqrt()),
        (cube().minus(Recipe::cylinder(0.25, 1.0)), DQuat::IDENTITY, 0.5),
        (Recipe::sphere(0.5), DQuat::IDENTITY, 0.5),
        (Recipe::cylinder(0.5, 0.5), DQuat::IDENTITY, 0.5),
        (Recipe::cylinder(0.5, 0.5), lying, 0.5),
    ] {
        let at = |gap: f64| rest(floor(), body.clone(), Pose::new(dvec3(0.3, -0.2, height + gap), turn)).regions(0.1);
        let touching = at(0.0);
        for gap in [1e-3, 0.01, 0.04, 0.09] {
            let apart = at(gap);
            let kinds = |r: &Regions| r.regions.iter().map(|r| (r.kind, r.extent, r.points.len())).collect::<Vec<_>>();
            assert_eq!(kinds(&touching), kinds(&apart), "gap {gap}: {touching:#?} {apart:#?}");
            for (r, s) in touching.regions.iter().zip(&apart.regions) {
                assert!((s.separation() - r.separation() - gap).abs() < 1e-9, "gap {gap}: {r:?} {s:?}");
                let lifted = |p: DVec3| p + DVec3::Z * (0.5 * gap);
                for (p, q) in r.points.iter().zip(&s.points) {
                    assert!(lifted(p.point).distance(q.point) < 1e-9, "gap {gap}: {r:#?} {s:#?}");
                }
            }
        }
    }
}

/// Margins from a hundredth of the bodies to 1e12 times their size: bounded work, and a pair that touches has a region.
#[test]
fn any_margin_has_its_answer_within_bounded_work() {
    let plate = || Recipe::cuboid(1.0, 1.0, 0.25).minus(Recipe::cylinder(0.5, 1.0));
    let slot = |i: i32| Recipe::cuboid(0.1, 1.0, 0.3).at(f64::from(i) * 0.5 - 1.75, 0.0, 0.3);
    let comb = || (0..8).fold(Recipe::cuboid(2.0, 0.4, 0.3), |bar, i| bar.minus(slot(i)));
    let tilted = |z: f64| Pose::new(dvec3(0.3, 0.2, z), turned(dvec3(1.0, 2.0, 0.3), 0.7));
    // The ball hangs over the hole, nearest to its rim.
    let to_rim = dvec3(0.5, 0.0, 0.75).length() - 0.5;
    for (name, s, nearest, incomplete) in [
        ("ball over plate", rest(plate(), Recipe::sphere(0.5), Pose::at(DVec3::Z)), Some(to_rim), 0),
        ("box over plate", rest(plate(), cube(), Pose::at(DVec3::Z)), Some(0.25), 0),
        ("tilted box over plate", rest(plate(), cube(), tilted(1.2)), None, 0),
        ("plate over plate", rest(plate(), plate(), tilted(2.0)), None, 0),
        ("peg in hole", rest(plate(), Recipe::cylinder(0.4, 1.0), Pose::at(DVec3::X * 0.05)), Some(0.05), 0),
        // Its slots are narrower than the margin: more faces are near each other than there is work for.
        ("comb over comb", rest(comb(), comb(), Pose::at(dvec3(0.1, 0.0, 0.8))), None, 6),
    ] {
        let mut missing = 0;
        for margin in [1e-3, 0.01, 0.06, 0.1, 0.21, 0.5, 1.0, 10.0, 1e3, 1e12] {
            let mut query = s.query();
            for limit in [DEFAULT_CELL_LIMIT, 60] {
                query.cell_limit = limit;
                let (within, cells) = touching(&query, margin, &mut Scratch::default());
                let found = regions(&query, 0.0, margin);
                let says = format!("{name}, margin {margin}: {within:?} for {cells} cells, {found:?}");
                // The last step of it may go beyond.
                assert!(cells.max(found.cells) <= limit.min(20_000) + 256, "{says}");
                if limit == DEFAULT_CELL_LIMIT {
                    missing += usize::from(!found.complete);
                    assert_eq!(!found.regions.is_empty(), matches!(within, Within::Witness(_)), "{says}");
                    let reported = found.regions.iter().map(Region::separation).fold(f64::INFINITY, f64::min);
                    let fits = |gap: f64| reported == f64::INFINITY || (reported - gap).abs() < 1e-9;
                    assert!(nearest.is_none_or(fits), "{says}");
                }
            }
        }
        assert!(missing <= incomplete, "{name}: {missing} times incomplete");
    }
}

/// Boxes lean over a floor by so little that edges leave the margin within their length: every point that is told is as far from the
/// floor as it says, and the corner that is nearest to it is among them.
#[test]
fn what_is_told_of_a_box_that_leans_is_as_far_as_it_says() {
    let mut r = Random::new(4_711);
    let (mut told, mut left) = (0, 0);
    for k in 0..sized("CONTACTD_LEANING", 300) {
        let half = dvec3(r.within(0.1, 0.6), r.within(0.1, 0.6), r.within(0.1, 0.6));
        let margin = 10f64.powf(r.within(-3.5, -2.0));
        let lean = r.vector(1.0) * dvec3(1.0, 1.0, 2.0) * margin * 10f64.powf(r.within(-0.5, 1.0));
        let rotation = quat_of_rotation_vector(lean);
        let corners: Vec<DVec3> = (0..8)
            .map(|i| rotation * (half * DVec3::from_array([0, 1, 2].map(|j| f64::from(i >> j & 1) * 2.0 - 1.0))))
            .collect();
        let lowest = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min);
        let gap = margin * r.within(0.0, 0.9);
        let at = dvec3(r.within(-1.0, 1.0), r.within(-1.0, 1.0), gap - lowest);
        let whole = Recipe::cuboid(half.x, half.y, half.z);
        // What is drilled is not convex: its regions are looked for in boxes.
        let drill = Recipe::cylinder(0.2 * half.x.min(half.y), 1.0);
        let body = if k % 4 == 3 { whole.minus(drill) } else { whole };
        let pair = rest(floor(), body, Pose::new(at, rotation));
        let found = pair.regions(margin);
        assert!(!found.regions.is_empty(), "{k}: nothing within {margin} of {gap}");
        let mut nearest = f64::INFINITY;
        for p in found.regions.iter().flat_map(|region| &region.points) {
            // The middle of both feet; that on the floor is straight below.
            assert!(
                (p.point.z - 0.5 * p.separation).abs() < 1e-9 + p.separation * lean.length_squared(),
                "{k}: {p:?} in {found:#?}"
            );
            let own = (rotation.conjugate() * (p.point + DVec3::Z * 0.5 * p.separation - at)).abs() - half;
            // Along the normal of a face that leans the foot is aside by that.
            assert!(own.max_element().abs() < 1e-9 + p.separation * lean.length(), "{k}: {p:?} off by {own}");
            assert!(p.separation <= margin * (1.0 + 1e-9), "{k}: {p:?} beyond {margin}");
            nearest = nearest.min(p.separation);
            told += 1;
        }
        assert!((nearest - gap).abs() < 1e-9, "{k}: the nearest is told at {nearest}, and is {gap} away: {found:#?}");
        left += usize::from(corners.iter().filter(|c| c.z + at.z < margin).count() < 4);
    }
    println!("{told} points, {left} boxes of which not all of a side is within the margin");
    assert!(left > 50);
}

/// Prisms lean over a floor by so little that their lower side lies on it within the margin, or a part of it: each corner that is
/// within the margin is told, be it of a patch or of a line.
#[test]
fn every_corner_of_a_prism_that_is_near_a_floor_is_told() {
    let mut r = Random::new(1_237);
    let (mut near, mut far) = (0, 0);
    for k in 0..sized("CONTACTD_LEANING", 300) {
        let (sides, radius, half) = (3 + r.below(6), r.within(0.2, 0.6), r.within(0.1, 0.4));
        let margin = 10f64.powf(r.within(-3.5, -1.2));
        let lean = r.vector(1.0) * dvec3(1.0, 1.0, 2.0) * margin * 10f64.powf(r.within(-2.0, 0.6));
        let size = 2.0 * radius.hypot(half);
        // Sides that lean more than that touch along an edge.
        if lean.truncate().length() * size > 3.9 * margin.min(0.01 * size) {
            continue;
        }
        let rotation = quat_of_rotation_vector(lean);
        let corner = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / sides as f64).sin_cos();
            rotation * dvec3(radius * cos, radius * sin, -half)
        };
        let corners: Vec<DVec3> = (0..sides).map(corner).collect();
        let lowest = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min);
        let at = dvec3(r.within(-1.0, 1.0), r.within(-1.0, 1.0), margin * r.within(0.0, 0.9) - lowest);
        let found = rest(floor(), prism(sides, radius, half), Pose::new(at, rotation)).regions(margin);
        for c in corners.iter().map(|c| *c + at) {
            if c.z > margin * (1.0 - 1e-6) {
                far += 1;
                continue;
            }
            near += 1;
            // The middle of the feet: a face that leans has its foot aside by that.
            let middle = c - DVec3::Z * (0.5 * c.z);
            let points = found.regions.iter().flat_map(|region| &region.points);
            let off = points.map(|p| p.point.distance(middle)).fold(f64::INFINITY, f64::min);
            assert!(
                off < 1e-9 + c.z * lean.length(),
                "{k}: {c} is within {margin}, {off} from what is told: {found:#?}"
            );
        }
    }
    println!("{near} corners within the margin, {far} beyond it");
    assert!(near > 400 && far > 100, "{near} corners within the margin, {far} beyond it");
}

/// The least height of a box's lower side over the rectangle |x|, |y| <= `most` at z = 0, worked out where their edges cross.
fn least_over(most: [f64; 2], half: DVec3, at: DVec3, rotation: DQuat) -> f64 {
    let side = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let mut polygon: Vec<DVec3> = side.iter().map(|(x, y)| at + rotation * (half * dvec3(*x, *y, -1.0))).collect();
    for (k, limit) in most.iter().enumerate() {
        for sign in [-1.0, 1.0] {
            let within = |p: &DVec3| limit - sign * p[k];
            let mut left = Vec::new();
            for (i, p) in polygon.iter().enumerate() {
                let q = &polygon[(i + 1) % polygon.len()];
                if within(p) >= 0.0 {
                    left.push(*p);
                }
                if (within(p) < 0.0) != (within(q) < 0.0) {
                    left.push(*p + (*q - *p) * (within(p) / (within(p) - within(q))));
                }
            }
            polygon = left;
        }
    }
    polygon.iter().map(|p| p.z).fold(f64::INFINITY, f64::min)
}

/// Boxes lean over another of about the same sides, nearly flush with it: nothing is told nearer than it is, nor farther than the
/// margin, and the nearest place is told.
#[test]
fn what_is_told_of_a_box_that_leans_on_its_like_is_as_far_as_it_says() {
    let mut r = Random::new(815);
    let mut told = 0;
    for k in 0..sized("CONTACTD_LEANING", 300) {
        let half = dvec3(r.within(0.2, 0.6), r.within(0.2, 0.6), r.within(0.1, 0.3));
        let margin = 10f64.powf(r.within(-3.5, -2.0));
        let lean = r.vector(1.0) * margin * 10f64.powf(r.within(-3.0, 0.8));
        let rotation = quat_of_rotation_vector(lean);
        let off = r.vector(1.0) * margin * 10f64.powf(r.within(-3.0, 0.5));
        let at = dvec3(off.x, off.y, half.z);
        let gap = margin * r.within(0.0, 0.9);
        let at = at + DVec3::Z * (gap - least_over([half.x, half.y], half, at, rotation));
        let below = Recipe::cuboid(half.x, half.y, 0.4).at(0.0, 0.0, -0.4);
        let found = rest(below, Recipe::cuboid(half.x, half.y, half.z), Pose::new(at, rotation)).regions(margin);
        let points: Vec<_> = found.regions.iter().flat_map(|region| &region.points).collect();
        let nearest = points.iter().map(|p| p.separation).fold(f64::INFINITY, f64::min);
        // What hangs over by `off` is nearer by as much as it leans there.
        let room = 1e-9 + gap * lean.length_squared() + lean.length() * (off.length() + lean.length());
        assert!((nearest - gap).abs() < room, "{k}: told {nearest} of {gap}: {found:#?}");
        for p in points {
            let own = rotation.conjugate() * (p.point - at);
            let height = (own.z + half.z).abs() + p.point.z.abs();
            let aside = p.separation * lean.length() + (off.length() + lean.length() * half.z) * 2.0;
            assert!((height - p.separation).abs() < 1e-9 + aside, "{k}: {p:?}, {height} in {found:#?}");
            assert!(p.separation <= margin * (1.0 + 1e-9), "{k}: {p:?} beyond {margin}");
            told += 1;
        }
    }
    println!("{told} points");
}

/// A capsule beside a block's face or edge, a cylinder or another capsule, less than a margin off: the line ends where either of them
/// does, however far within the margin the ball at an end of the capsule stays.
#[test]
fn the_line_along_a_capsule_ends_with_its_side() {
    let mut r = Random::new(0x0063_6170_7375_6c65);
    let (mut lines, mut short) = ([0; 4], 0);
    for i in 0..sized("CONTACTD_REGIONS", 300) {
        let (radius, half) = (r.within(0.1, 1.0), r.within(0.2, 2.0));
        let margin = radius * 10f64.powf(r.within(-4.0, -0.5));
        let gap = margin * [0.0, r.within(0.0, 0.9)][i % 2];
        let (other, other_half, off) = (r.within(0.1, 1.0), r.within(0.2, 2.0), r.within(-2.0, 2.0));
        let (partner, distance) = match i / 2 % 4 {
            0 => (Recipe::cuboid(other, 3.0, other_half), other),
            1 => (Recipe::cylinder(other, other_half), other),
            2 => (Recipe::capsule(other_half, other), other),
            _ => {
                let edge = Pose::new(DVec3::ZERO, DQuat::from_rotation_z(FRAC_PI_4));
                (Recipe::cuboid(other / SQRT_2, other / SQRT_2, other_half).moved(&edge), other)
            }
        };
        let ends = [(-half).max(off - other_half), half.min(off + other_half)];
        if ends[1] - ends[0] < 0.1 {
            continue;
        }
        let frame = Pose::new(r.vector(3.0), r.rotation());
        let at = frame.compose(&Pose::at(dvec3(radius + distance + gap, 0.0, off)));
        let s = Rest::new(Recipe::capsule(half, radius), frame, partner, at);
        let found = s.regions(margin);
        let place =
            format!("{i}: radius {radius}, half {half}, {other}, {other_half}, off {off}, gap {gap}, margin {margin}");
        assert!(found.regions.len() == 1, "{place}: {found:?}");
        let region = &found.regions[0];
        assert!(region.extent == Extent::Line && region.points.len() == 2, "{place}: {region:?}");
        let mut told = [0, 1].map(|k| frame.inverse().point(region.points[k].point));
        told.sort_by(|p, q| p.z.total_cmp(&q.z));
        for (x, z) in told.into_iter().zip(ends) {
            assert!((x - dvec3(radius + 0.5 * gap, 0.0, z)).length() < 1e-8, "{place}: {x} of {z}");
        }
        lines[i / 2 % 4] += 1;
        short += usize::from(ends[0] == -half || ends[1] == half);
    }
    assert!(lines.iter().all(|n| *n > 10) && short > 30, "{lines:?}, {short} end with the capsule");
}

/// A box that is rounded all round, of parts that lie in each other, and a hull of a few points that comes down on it anywhere: where a
/// part's face ends inside of the others no face passes, and what is told there ends with the face. Each point is as far from both
/// bodies as is told, at most: the box has a closed form.
#[test]
fn points_on_a_body_of_parts_in_each_other_are_on_its_surface() {
    let mut r = Random::new(0x0072_6f75_6e64);
    let (mut told, mut lines) = (0, 0);
    let few = std::env::var_os("CONTACTD_REGIONS").is_none();
    for i in 0..sized("CONTACTD_REGIONS", 90) {
        let (half, radius) = (dvec3(r.within(0.2, 0.6), r.within(0.2, 0.6), r.within(0.2, 0.6)), r.within(0.05, 0.3));
        let mut rounded = Recipe::cuboid(half.x + radius, half.y, half.z);
        rounded = rounded.union(Recipe::cuboid(half.x, half.y + radius, half.z));
        rounded = rounded.union(Recipe::cuboid(half.x, half.y, half.z + radius));
        for (axis, turn) in
            [(0, DQuat::from_rotation_y(FRAC_PI_2)), (1, DQuat::from_rotation_x(FRAC_PI_2)), (2, DQuat::IDENTITY)]
        {
            for k in 0..4 {
                let sign = |bit: usize| if k & bit == 0 { -1.0 } else { 1.0 };
                let mut at = dvec3(half.x * sign(1), half.y * sign(if axis == 0 { 1 } else { 2 }), half.z * sign(2));
                at[axis] = 0.0;
                rounded = rounded.union(Recipe::capsule(half[axis], radius).moved(&Pose::new(at, turn)));
            }
        }
        let corners: Vec<DVec3> = (0..4 + r.below(4)).map(|_| r.direction() * r.within(0.4, 1.0)).collect();
        let Some(hull) = Polyhedron::hull(corners) else { continue };
        let planes = hull.planes.clone();
        let from = r.direction() * 4.0;
        let pose_a = Pose::new(DVec3::ZERO, r.rotation());
        let (turn_b, velocity, margin) = (r.rotation(), r.vector(0.3) - from, r.within(0.02, 0.2));
        // In the command every third of them.
        if few && i % 3 != 2 {
            continue;
        }
        let s = Rest::new(Recipe::of(hull), pose_a, rounded, Pose::new(from, turn_b));
        let (o, found) = s.answer(velocity, margin);
        if o.status() != Status::Contact {
            continue;
        }
        let at_contact = Pose { position: from + velocity * o.time(), ..s.pose_b };
        for region in &found.regions {
            lines += usize::from(region.extent == Extent::Line);
            for p in &region.points {
                let y = at_contact.inverse().point(p.point).abs() - half;
                let to_box = y.max(DVec3::ZERO).length() - radius;
                let x = pose_a.inverse().point(p.point);
                let to_hull = planes.iter().map(|(n, d)| n.dot(x) - d).fold(f64::NEG_INFINITY, f64::max);
                let most = 0.5 * p.separation.abs() + 1e-7;
                assert!(to_box <= most && to_hull <= most, "{i}: {to_box} {to_hull} of {p:?} in {region:#?}");
                told += 1;
            }
        }
    }
    println!("{told} points, {lines} lines");
    assert!(told > 40 && lines > 3, "{told} points, {lines} lines");
}

/// A hull whose bottom is nearly flat in many facets, on a face within a margin: whatever the work allows, where they touch is told.
#[test]
fn hulls_of_many_nearly_coplanar_facets_have_a_region() {
    let mut r = Random::new(0x0063_6f70_6c61_6e61);
    let mut cut = 0;
    for i in 0..sized("CONTACTD_REGIONS", 6) {
        let bow = 10f64.powf(r.within(-9.0, -4.0));
        let count = [40, 120, 300][i % 3];
        let mut points = vec![dvec3(0.0, 0.0, 1.5)];
        for _ in 0..count {
            let (rho, phi) = (r.within(0.0, 1.0).sqrt(), r.within(0.0, TAU));
            points.push(dvec3(rho * phi.cos(), rho * phi.sin(), bow * rho * rho));
        }
        let hull = Polyhedron::hull(points).expect("a hull");
        let lowest = hull.vertices.iter().map(|v| v.z).fold(f64::INFINITY, f64::min);
        let gap = r.within(0.0, 1e-4);
        let turned = Pose::new(dvec3(0.1, 0.2, gap - lowest), DQuat::from_rotation_z(r.within(0.0, TAU)));
        // Alone they are told by their corners; with something beside it one of them is looked for in boxes.
        let alone = i % 2 == 1;
        let hull = Recipe::of(hull);
        let hull = if alone { hull } else { hull.union(Recipe::cuboid(0.1, 0.1, 0.1).at(0.0, 0.0, 2.0)) };
        let s = Rest::new(Recipe::cuboid(2.0, 2.0, 0.5).at(0.0, 0.0, -0.5), Pose::IDENTITY, hull, turned);
        let query = s.query();
        let found = regions(&query, 0.0, threshold(query.resolution, 2e-4));
        let place = format!("{i}: {count} points, bow {bow:e}, gap {gap:e}");
        let few = alone && s.a.solid.faces.len() + s.b.solid.faces.len() > 64;
        assert!(found.cells <= if few { 1_000 } else { 21_000 }, "{place}: {} cells", found.cells);
        // The lowest corner is over the face: how far they are apart is how far it is above.
        let least = found.regions.iter().map(Region::separation).fold(f64::INFINITY, f64::min);
        assert!((least - gap).abs() <= 1e-9, "{place}: {} regions, {least:e} apart", found.regions.len());
        cut += usize::from(!found.complete);
    }
    assert!(cut > 0, "no search was cut");
}

/// A disc whose rim is rounded, as a union of cylinders and tori: none of the edges where these end is one of the whole.
#[test]
fn a_ball_beside_a_rounded_disc_is_as_far_as_its_centre_says() {
    let (radius, half, round, ball) = (0.63, 0.385, 0.17, 0.42);
    let rim = || Recipe::torus(radius, round);
    let disc = || {
        let flat = Recipe::cylinder(radius, half + round).union(Recipe::cylinder(radius + round, half));
        flat.union(rim().at(0.0, 0.0, half)).union(rim().at(0.0, 0.0, -half))
    };
    let mut r = Random::new(37);
    for k in 0..sized("CONTACTD_ROUNDED", 50) {
        let gap = 10f64.powf(r.within(-4.0, -2.0));
        // About the seam between flat and round as well as anywhere.
        let angle = if r.chance(0.5) { r.within(0.0, FRAC_PI_2) } else { r.within(0.0, 0.05) };
        let (s, c) = angle.sin_cos();
        let far = round + ball + gap;
        let at = DQuat::from_rotation_z(r.within(0.0, TAU)) * dvec3(radius + far * s, 0.0, half + far * c);
        let turn = Pose::new(r.vector(1.0), r.rotation());
        let beside = Rest::new(disc(), turn, Recipe::sphere(ball), turn.compose(&Pose::at(at)));
        let found = beside.regions(0.02);
        let nearest = found.regions.iter().min_by(|p, q| p.separation().total_cmp(&q.separation())).expect("a region");
        assert!((nearest.separation() - gap).abs() < 1e-9, "{k}: gap {gap} at {angle}: {found:#?}");
        let center = dvec3(radius, 0.0, half);
        let normal = turn.rotation
            * DQuat::from_rotation_z(at.y.atan2(at.x))
            * (dvec3(radius + far * s, 0.0, half + far * c) - center).normalize();
        assert!(nearest.normal.dot(normal) > 1.0 - 1e-10, "{k}: {normal} {nearest:?}");
    }
}

/// What is told of the nearest region is the least distance, which is found and proven by other means.
#[test]
fn the_nearest_region_within_a_margin_is_as_far_as_the_least_distance() {
    let mut r = Random::new(91);
    let (mut asked, mut off) = (0, 0);
    for k in 0..sized("CONTACTD_NEAREST", 30) {
        let body = |r: &mut Random| match r.below(4) {
            0 => tree(r, 2 + k % 3),
            1 => Recipe::torus(r.within(0.5, 1.0), r.within(0.1, 0.4)),
            _ => primitive(r, 1.0),
        };
        let (a, b) = (body(&mut r), body(&mut r));
        let way = r.direction();
        let mut beside = Rest::new(a, Pose::new(DVec3::ZERO, r.rotation()), b, Pose::new(way * 5.0, r.rotation()));
        let met = earliest_contact(&beside.moving(way * -5.0), &mut Scratch::default());
        if met.status() != Status::Contact {
            continue;
        }
        beside.pose_b.position = way * (5.0 - 5.0 * met.time() + 10f64.powf(r.within(-3.5, -1.5)));
        let query = beside.query();
        let PairQuery { a, b, .. } = query;
        let least = at_instant(&DistanceQuery { a, b, tolerance: 1e-10, limit: DEFAULT_LIMIT }, 0.0);
        let found = regions(&query, 0.0, threshold(query.resolution, 1.3 * least.upper));
        let nearest = found.regions.iter().map(Region::separation).fold(f64::INFINITY, f64::min);
        asked += 1;
        let by = (nearest - least.upper).max(least.lower - nearest);
        // A few of long forms end beside another local minimum.
        if by.is_nan() || by >= 1e-8 {
            off += 1;
            println!(
                "{k}: told {nearest}, proven {} to {}: {:?}",
                least.lower,
                least.upper,
                found.regions.first().map(|r| (r.extent, r.kind, r.faces_a, r.faces_b))
            );
        }
    }
    println!("{off} of {asked}");
    assert!(asked > 20 && off * 500 <= asked, "{off} of {asked}");
}
