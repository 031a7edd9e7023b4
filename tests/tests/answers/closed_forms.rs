//! The general search against the closed forms of whole primitives, on random pairs of every combination.
//!
//! The two share no bound, no clause and no root finder: the closed forms know supports, common normals and clearances, the
//! search knows faces and cells. Figure: |Δtime| × closing speed in units of the pair's size. Three groups of 16 ordered
//! combinations each: two positive primitives (p), a body in a cavity of a block (n), a hollow body in a cavity (nn: two
//! subtracted surfaces, which must neither add a contact nor hide one). `CONTACTD_PAIRS=10000 cargo test --release -p
//! contactd-tests --test answers closed_forms:: -- --nocapture` sets the number of
//! pairs per combination (30 and 15 by default).

use contactd::contact::{Outcome, Status, default_resolution};
use contactd::motion::{Placed, Relative};
use contactd::octree::Model;
use contactd::solid::Primitive;
use contactd_proto::{Motion, Pose};
use contactd_tests::closed::{Meeting, time_of_contact, time_of_leaving};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::{SEARCH_ALONE, ask_models, ask_with, differences};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::DVec3;

const SPHERE: usize = 0;
const CYLINDER: usize = 1;
const CONE: usize = 2;
const POLYHEDRON: usize = 3;

fn shape(r: &mut Random, kind: usize) -> Recipe {
    let (d, h) = (r.within(0.2, 1.0), r.within(0.2, 1.0));
    match kind {
        SPHERE => Recipe::sphere(d),
        CYLINDER => Recipe::cylinder(d, h),
        CONE if r.chance(0.5) => Recipe::cone(d, 0.0, h),
        CONE => Recipe::cone(d * r.within(0.1, 0.8), d, h),
        _ if r.chance(0.4) => Recipe::cuboid(d, h, r.within(0.2, 1.0)),
        _ => Recipe::platonic([4, 8, 12, 20][r.below(4)], d),
    }
}

/// A body that starts `from` and heads roughly for the origin, turning.
fn motion(r: &mut Random, from: DVec3) -> Motion {
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.5) };
    Motion::turning(Pose::new(from, r.rotation()), r.vector(1.6), spin)
}

/// Two solids, and the primitives of each that the closed form is asked about.
struct Scene {
    a: (Model, Placed),
    b: (Model, Placed),
    of_a: usize,
    of_b: usize,
}

type ClosedForm = fn(&Primitive, &Primitive, &Relative) -> Option<Meeting>;

/// What became of one combination's pairs.
#[derive(Default)]
struct Tally {
    gaps: Vec<f64>,
    clear: usize,
    overlaps: usize,
    open: usize,
    undecided: usize,
    unanswered: Vec<usize>,
    answered: usize,
    flagged: Vec<usize>,
    differ: Vec<String>,
    refuted: Vec<String>,
    far_off: Vec<String>,
}

impl Tally {
    fn take(&mut self, i: usize, scene: &Scene, form: ClosedForm) {
        let (a, b) = (&scene.a.0, &scene.b.0);
        let size = default_resolution(a, b) / 1e-9;
        let relative = Relative::new(scene.a.1, scene.b.1);
        let closed = form(&a.solid.primitives[scene.of_a], &b.solid.primitives[scene.of_b], &relative);
        let closed = closed.expect("convex primitives");
        let o: Outcome = ask_with((a, scene.a.1), (b, scene.b.1), None, SEARCH_ALONE);
        assert_eq!(o.counters.closed_forms, 0, "the search must stand on its own");
        assert!(o.counters.cells > 0 || o.status() == Status::Clear, "an answer without a cell: {o:?}");
        // The same forms in front of the search must say the same.
        let fronted = ask_models((a, scene.a.1), (b, scene.b.1), None);
        self.answered += usize::from(fronted.counters.cells == 0);
        if o.status() == Status::Undecided {
            self.unanswered.push(i);
            return;
        }
        if !o.not_continued() {
            self.differ.extend(differences(&o, &fronted, size).into_iter().map(|d| format!("{i}: {d}")));
        }
        match closed {
            // The search says that it could not follow the contact back from depth delta to the touch.
            Meeting::Contact(c) if o.status() == Status::Contact && o.not_continued() => {
                self.flagged.push(i);
                let late = (o.time() - c.time) * c.speed;
                assert!((0.0..=4.0 * o.resolution).contains(&late), "{i}: {late:e} late at depth {:e}", o.resolution);
            }
            Meeting::Contact(c) if o.status() == Status::Contact => {
                self.open += usize::from(c.upper.is_infinite());
                let speed = c.speed.abs().max(o.at().normal_speed.abs());
                let gap = (c.time - o.time()).abs() * speed / size;
                self.gaps.push(gap);
                if gap > 1e-12 {
                    self.far_off.push(format!("{i}: {gap:.1e} at speed {speed:.1e} ({:?})", o.at().kind));
                }
                // Brackets that exclude each other cannot both be right.
                if c.lower > o.time_upper() + 1e-12 || c.upper < o.time_lower() - 1e-12 {
                    self.refuted.push(format!(
                        "{i}: {c:?} against [{} {} {}]",
                        o.time_lower(),
                        o.time(),
                        o.time_upper()
                    ));
                }
            }
            Meeting::Clear if o.status() == Status::Clear => self.clear += 1,
            Meeting::Overlap(_) if o.status() == Status::Overlap => self.overlaps += 1,
            Meeting::Undecided(_) => self.undecided += 1,
            _ => self.refuted.push(format!("{i}: {closed:?} against {:?} at {}", o.status(), o.time())),
        }
    }

    /// Prints the row and demands what it promises; more than `share` of the pairs meet, and as many don't.
    fn judge(mut self, name: &str, count: usize, share: f64) {
        self.gaps.sort_by(f64::total_cmp);
        let gaps = &self.gaps;
        let at = |f: f64| gaps.get(((gaps.len() as f64 * f) as usize).min(gaps.len().saturating_sub(1))).copied();
        println!(
            "{name}: {count} pairs: {} contacts, {} clear, {} undecided here, {:?} by the search, {:?} not continued; gap median {:.1e} 99 % \
             {:.1e} worst {:.1e}; over 1e-12: {}; upper end open: {}; without a cell: {}",
            gaps.len(),
            self.clear,
            self.undecided,
            self.unanswered,
            self.flagged,
            at(0.5).unwrap_or(0.0),
            at(0.99).unwrap_or(0.0),
            at(1.0).unwrap_or(0.0),
            self.far_off.len(),
            self.open,
            self.answered
        );
        assert!(self.differ.is_empty(), "{name}: {} differences\n{}", self.differ.len(), self.differ.join("\n"));
        assert!(self.refuted.is_empty(), "{name}: {} refuted:\n{}", self.refuted.len(), self.refuted.join("\n"));
        let least = (count as f64 * share) as usize;
        assert!(gaps.len() > least && self.clear > least, "{name}: {} contacts, {} clear", gaps.len(), self.clear);
        assert_eq!(self.undecided, 0, "{name}");
        // The search may run out of cells where edges are nearly parallel; the closed form answers these.
        assert!(self.unanswered.len() * 100 <= count, "{name}: the search left {:?} open", self.unanswered);
        assert!(self.flagged.len() * 1000 <= count, "{name}: not continued {:?}", self.flagged);
        assert!(self.far_off.is_empty(), "{name}: over 1e-12:\n{}", self.far_off.join("\n"));
        assert!(self.open * 100 <= gaps.len(), "{name}: {} contacts without a common point", self.open);
    }
}

const NAMES: [&str; 4] = ["sphere", "cylinder", "cone", "polyhedron"];

fn pairs(default: usize) -> usize {
    sized("CONTACTD_PAIRS", default)
}

fn at_rest(model: Recipe) -> (Model, Placed) {
    let motion = Motion::resting(Pose::IDENTITY);
    (Model::new(model.build()), Placed { place: Pose::IDENTITY, motion })
}

/// Two positive primitives.
fn family(a: usize, b: usize) {
    let count = pairs(30);
    let mut r = Random::new(1000 + 10 * a as u64 + b as u64);
    let mut tally = Tally::default();
    for i in 0..count {
        let (ma, mb) = (shape(&mut r, a), shape(&mut r, b));
        let (mut sa, mut sb) = (at_rest(ma), at_rest(mb));
        let from = r.direction() * 2.2;
        sa.1.motion = motion(&mut r, from);
        sb.1.motion = Motion::resting(Pose::new(r.vector(0.2), r.rotation()));
        tally.take(i, &Scene { a: sa, b: sb, of_a: 0, of_b: 0 }, time_of_contact);
    }
    tally.judge(&format!("{} against {}", NAMES[a], NAMES[b]), count, 0.05);
}

/// A body in a cavity of a block; hollow, if `hole` is a kind.
fn in_cavity(kind: usize, cavity: usize, hole: Option<usize>) {
    let count = pairs(15);
    let seed = 2000 + 100 * hole.map_or(0, |h| h as u64 + 1) + 10 * kind as u64 + cavity as u64;
    let mut r = Random::new(seed);
    let mut tally = Tally::default();
    let mut i = 0;
    while i < count {
        let body = shape(&mut r, kind).scaled(r.within(0.1, 0.5));
        let wall = shape(&mut r, cavity);
        // Half of the bodies stand with their axes along the cavity's.
        let along = r.chance(0.5);
        let body = match hole {
            None => body,
            // A tenth of the body's own size fits into it wherever it is thick.
            Some(h) => {
                let leaf = body.build();
                let inner = leaf.primitives[0].shape.geometry();
                let hole = shape(&mut r, h).scaled(0.08 * inner.smallest_dimension());
                let middle = inner.interior_point();
                body.minus(hole.at(middle.x, middle.y, middle.z))
            }
        };
        let block = Recipe::cuboid(4.0, 4.0, 4.0).minus(wall);
        let (mut sa, mut sb) = (at_rest(body), at_rest(block));
        let turned = r.rotation();
        sb.1.motion = Motion::resting(Pose::new(r.vector(0.2), turned));
        if r.chance(0.3) {
            sb.1.motion.spin = r.vector(0.5);
        }
        let from = sb.1.motion.start.position + r.vector(0.1);
        sa.1.motion = motion(&mut r, from);
        sa.1.motion.velocity = r.vector(0.6);
        if along {
            sa.1.motion.start.rotation = turned;
        }
        let scene = Scene { a: sa, b: sb, of_a: 0, of_b: 1 };
        let start = Relative::new(scene.a.1, scene.b.1);
        let (p, q) = (&scene.a.0.solid.primitives[0], &scene.b.0.solid.primitives[1]);
        if matches!(time_of_leaving(p, q, &start), Some(Meeting::Overlap(_))) {
            continue;
        }
        tally.take(i, &scene, time_of_leaving);
        i += 1;
    }
    let hollow = hole.map_or(String::new(), |h| format!(", hollowed by a {}", NAMES[h]));
    tally.judge(&format!("{} in the cavity of a {}{hollow}", NAMES[kind], NAMES[cavity]), count, 0.0);
}

#[test]
fn bodies_in_a_spherical_cavity() {
    (0..4).for_each(|kind| in_cavity(kind, SPHERE, None));
}

#[test]
fn bodies_in_a_cylindrical_hole() {
    (0..4).for_each(|kind| in_cavity(kind, CYLINDER, None));
}

#[test]
fn bodies_in_a_conical_seat() {
    (0..4).for_each(|kind| in_cavity(kind, CONE, None));
}

#[test]
fn bodies_in_a_polyhedral_pocket() {
    (0..4).for_each(|kind| in_cavity(kind, POLYHEDRON, None));
}

#[test]
fn hollow_bodies_in_cavities() {
    for hole in 0..4 {
        for cavity in 0..4 {
            in_cavity((hole + cavity) % 4, cavity, Some(hole));
        }
    }
}

#[test]
fn sphere_against_sphere() {
    family(SPHERE, SPHERE);
}

#[test]
fn sphere_against_cylinder() {
    family(SPHERE, CYLINDER);
    family(CYLINDER, SPHERE);
}

#[test]
fn sphere_against_cone() {
    family(SPHERE, CONE);
    family(CONE, SPHERE);
}

#[test]
fn sphere_against_polyhedron() {
    family(SPHERE, POLYHEDRON);
    family(POLYHEDRON, SPHERE);
}

#[test]
fn cylinder_against_cylinder() {
    family(CYLINDER, CYLINDER);
}

#[test]
fn cylinder_against_cone() {
    family(CYLINDER, CONE);
    family(CONE, CYLINDER);
}

#[test]
fn cone_against_cone() {
    family(CONE, CONE);
}

#[test]
fn cylinder_against_polyhedron() {
    family(CYLINDER, POLYHEDRON);
    family(POLYHEDRON, CYLINDER);
}

#[test]
fn cone_against_polyhedron() {
    family(CONE, POLYHEDRON);
    family(POLYHEDRON, CONE);
}

#[test]
fn polyhedron_against_polyhedron() {
    family(POLYHEDRON, POLYHEDRON);
}
