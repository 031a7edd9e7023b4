//! What the tests of one kind of solid have in common: how many pairs, scenes with a closed form, and the values and volumes of trees.
//!
//! Where the gap of two bodies at their poses has a formula, their first contact is the first root of one function of time, which is
//! followed here by its Lipschitz constant and shares nothing with the search.

use contactd::contact::region::{Region, regions, threshold};
use contactd::contact::{QueryOptions, Scratch, Status, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::engine::{ReportedPoint as _, question};
use contactd_tests::random_solids::{Random, solid_of};
use contactd_tests::rays::integrals;
use contactd_tests::record_judge;
use contactd_tests::reference::Moving;
use contactd_tests::reference::field::Field;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::DVec3;

/// How many pairs: `default`, or what the environment says.
pub fn pairs(default: usize) -> usize {
    sized("CONTACTD_PAIRS", default)
}

/// The model of one primitive.
pub fn alone(shape: impl Into<Shape>) -> Model {
    Model::new(Recipe::of(shape).build())
}

/// In the frame of its model.
pub fn placed(motion: Motion) -> Placed {
    Placed { place: Pose::IDENTITY, motion }
}

/// A motion from a place next to the origin past it.
pub fn past(r: &mut Random, from: f64) -> Motion {
    let start = r.direction() * from;
    let aim = r.vector(0.7);
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.5) };
    Motion { start: Pose::new(start, r.rotation()), velocity: (aim - start) * r.within(0.8, 1.6), spin }
}

/// A motion about the origin.
pub fn turning(r: &mut Random) -> Motion {
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.0) };
    Motion { start: Pose::new(DVec3::ZERO, r.rotation()), velocity: r.vector(0.3), spin }
}

/// How fast points within `reach` of two centres move against each other at most.
pub fn speed(motions: &[Motion; 2], reach: f64) -> f64 {
    let [a, b] = motions;
    (a.velocity - b.velocity).length() + (a.spin.length() + b.spin.length()) * reach
}

/// Two bodies, how far they are from touching at a pose of each, and how fast that may change.
pub struct Scene {
    pub a: Recipe,
    pub b: Recipe,
    pub motions: [Motion; 2],
    pub gap: Box<dyn Fn(&Pose, &Pose) -> f64>,
    pub speed: f64,
}

impl Scene {
    /// The gap at a time.
    pub fn at(&self, t: f64) -> f64 {
        (self.gap)(&self.motions[0].at(t), &self.motions[1].at(t))
    }

    /// The same with the first body on the other side of the plane through the second one's centre, if it begins below it.
    pub fn above_plane(self) -> Self {
        if self.at(0.0) > 0.0 {
            return self;
        }
        let [mut a, b] = self.motions;
        let n = b.start.rotation * DVec3::Z;
        let mirrored = |v: DVec3| v - n * (2.0 * n.dot(v));
        a.start.position = mirrored(a.start.position - b.start.position) + b.start.position;
        a.velocity = mirrored(a.velocity);
        Self { motions: [a, b], ..self }
    }

    /// The first time at which the gap is closed; how fast it closes then.
    fn first(&self) -> Option<(f64, f64)> {
        let mut t = 0.0;
        loop {
            let gap = self.at(t);
            if gap <= 1e-15 {
                let h = 1e-6;
                return Some((t, (self.at(t - h) - self.at(t + h)) / (2.0 * h)));
            }
            // A gap of rounding's size may be less than the next number's distance.
            t = (t + gap / self.speed).max(t.next_up());
            if t > 1.0 {
                return None;
            }
        }
    }
}

/// Asks about scenes and compares with the closed form, to 1e-12 of the size; the records are judged. What begins nearer than `near`
/// resolutions may be told as touching. Returns how far off the worst contact is, in sizes, and the cells of pairs that
/// begin apart.
pub fn compare(name: &str, counted: (usize, u64, f64), make: impl Fn(&mut Random) -> Scene) -> (f64, u64) {
    compare_told(name, counted, Told::Judged, make)
}

/// By what a record is held to be right.
#[derive(Clone, Copy, PartialEq)]
pub enum Told {
    /// By the judge, which looks at every face.
    Judged,
    /// The second body is a half-space: whatever meets it, the contact's normal is its own. For meshes, of whose corners the
    /// judge does not see every face by itself.
    Plane,
}

/// The same, with records held to be right by what is said.
pub fn compare_told(
    name: &str,
    (count, seed, near): (usize, u64, f64),
    told: Told,
    make: impl Fn(&mut Random) -> Scene,
) -> (f64, u64) {
    let mut r = Random::new(seed);
    let (mut contacts, mut clear, mut overlap, mut undecided, mut worst, mut cells) = (0, 0, 0, 0, 0.0f64, 0);
    let (mut flagged, mut lies, mut apart, mut dearest) = (0, 0, 0, (0, 0));
    for i in 0..count {
        let s = make(&mut r);
        let (a, b) = (Model::new(s.a.build()), Model::new(s.b.build()));
        let query = question((&a, placed(s.motions[0])), (&b, placed(s.motions[1])), QueryOptions::DEPTH);
        let o = earliest_contact(&query, &mut Scratch::default());
        let size = query.resolution / 1e-9;
        cells += o.counters.cells;
        let moving = [(&a, 0), (&b, 1)].map(|(m, k): (&Model, usize)| Moving {
            solid: &m.solid,
            place: Pose::IDENTITY,
            motion: s.motions[k],
        });
        lies += usize::from(
            told == Told::Judged && !record_judge::holds(&format!("{name} {i}"), &moving[0], &moving[1], &o),
        );
        if s.at(0.0) <= near * query.resolution {
            assert!(s.at(0.0) > 0.0 || o.status() != Status::Clear, "{name} {i}: {o:?}");
            overlap += 1;
            continue;
        }
        apart += o.counters.cells;
        dearest = dearest.max((o.counters.cells, i));
        match (s.first(), o.status()) {
            (_, Status::Undecided) => undecided += 1,
            (None, Status::Clear) => clear += 1,
            (Some((t, speed)), Status::Contact) => {
                contacts += 1;
                assert!(
                    o.time_lower() <= t + 1e-12 * size / speed.max(1e-9),
                    "{name} {i}: {t} before {}",
                    o.time_lower()
                );
                if o.not_continued() {
                    flagged += 1;
                    continue;
                }
                let off = (t - o.time()).abs() * speed.abs().max(o.at().normal_speed.abs()) / size;
                worst = worst.max(off);
                assert!(off <= 1e-12, "{name} {i}: {off:e}: {t} at {speed}, not {o:?}");
                if told == Told::Plane {
                    let up = s.motions[1].at(o.time()).rotation * DVec3::Z;
                    assert!((o.at().normal + up).length() < 1e-12, "{name} {i}: {up} is up: {o:?}");
                }
            }
            // A graze within the depth at which contacts are decided is none.
            (Some((t, speed)), Status::Clear) => assert!(speed.abs() < 1e-3, "{name} {i}: missed at {t}, {speed}"),
            (found, _) => panic!("{name} {i}: {found:?}, not {o:?}"),
        }
    }
    println!(
        "{name}: {contacts} contacts, {clear} clear, {overlap} overlap, {undecided} undecided, {flagged} not continued; worst {worst:.1e}; \
         {} cells each, at most {} (pair {})",
        cells / count as u64,
        dearest.0,
        dearest.1
    );
    assert!(contacts * 5 > count && undecided * 100 <= count && flagged * 100 <= count && lies == 0, "{name}");
    (worst, apart)
}

/// Values of random trees, up to `deepest` levels of them, at so many points each are those of an independent evaluation and grow no
/// faster than the distance; their volumes are those along rays, of which a finer and a coarser grid tell how far they are off.
pub fn values_and_volumes(
    shape: fn(&mut Random, f64) -> Shape,
    (trees, deepest, points): (usize, usize, usize),
    [fine, coarse]: [usize; 2],
) {
    let mut r = Random::new(31);
    let (mut inside, mut volumes) = (0, 0);
    for i in 0..trees {
        let solid = solid_of(&mut r, 1 + i % deepest, shape);
        let (model, around) = (Model::new(solid.clone()), solid.aabb());
        let field = Field::new(&solid, &Pose::IDENTITY);
        for _ in 0..points {
            let x = r.point_in(&around);
            let (f, other) = (solid.value(x), field.value(x));
            assert!((f - other).abs() < 1e-13, "solid {i} at {x}: {f} {other}");
            let margin = model.margin();
            let within = model.value_within(x, margin).clamp(-margin, margin);
            assert!((within - f.clamp(-margin, margin)).abs() < 1e-13, "solid {i} at {x}: {within} {f}");
            // 1-Lipschitz.
            let y = x + r.vector(0.3);
            assert!((solid.value(y) - f).abs() <= x.distance(y) * (1.0 + 1e-12) + 1e-13);
            inside += usize::from(f < 0.0);
        }
        let (fine, coarse) = (integrals(&solid, &around, fine), integrals(&solid, &around, coarse));
        if fine[0] < 1e-2 {
            continue;
        }
        let m = mass_properties(&model, &MassOptions { tolerance: 0.03, boxes: 300_000 }).expect("bounded");
        let doubt = 4.0 * (fine[0] - coarse[0]).abs() + 2e-3 * fine[0];
        assert!((m.volume - fine[0]).abs() <= m.volume_error + doubt, "solid {i}: {m:?} {}", fine[0]);
        assert!(m.volume_error <= 0.03 * m.volume, "solid {i}: {m:?}");
        volumes += 1;
    }
    println!("{trees} trees, {volumes} volumes, {} points, {inside} inside", trees * points);
    assert!(inside * 20 > trees * points && 2 * volumes > trees, "{inside} inside, {volumes} of {trees}");
}

/// Where two bodies at rest touch, the second at a pose.
pub fn at_rest(a: Recipe, b: Recipe, pose: Pose) -> Vec<Region> {
    let (a, b) = (Model::new(a.build()), Model::new(b.build()));
    let resting = |pose| placed(Motion::resting(pose));
    let query = question((&a, resting(Pose::IDENTITY)), (&b, resting(pose)), QueryOptions::DEPTH);
    let found = regions(&query, 0.0, threshold(query.resolution, 0.0));
    assert!(found.complete, "{found:?}");
    found.regions
}
