//! Overlaps of what stands still: volumes placed within volumes, or the objects of a scene; each pair proven apart, or with a point
//! that lies deep in both.
//!
//! A pair is asked at rest ([`crate::contact::earliest_contact`]) with half the tolerance as its resolution: that is clear where no
//! point lies deeper than the tolerance in both, and else an overlap. How deep a point lies is told by f, which is at most its distance
//! from the surface, and in a union of parts that touch at most that from the surface of a part. What touches is no overlap. A daughter
//! sticks out of its mother where it overlaps what is around the mother: a block less the mother's solid.
//!
//! Of OpenMC's universes (`cells`): cells of one universe against each other, and what is in none of them, where it is seen.
//!
//! Floor 10: imports `import`, `contact`, `cache`.

mod cells;

pub use cells::{Suspect, decide, of_cells, scene_of_cells, scene_of_uses};

use crate::contact::margin;
use crate::contact::within::Within;
use crate::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use crate::import::gdml::Volumes;
use crate::import::{ModelSource, Scene};
use crate::math::Aabb;
use crate::motion::Placed;
use crate::octree::Model;
use contactd_proto::{Motion, Pose};
use glam::DVec3;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Work for a pair: what needs more is told as not proven.
const CELL_LIMIT: u64 = 60_000;

/// What became of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// No point lies deeper than this in both.
    Separate(f64),
    /// This point, in the frame of what both are in, lies at least so deep in both.
    Overlap(DVec3, f64),
    /// Neither is proven; no point lies deeper than this in both, if that is known.
    NotProven(Option<f64>),
}

/// What a volume is asked against.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Beside {
    /// Another one.
    Other(String),
    /// What is around the volume that it is in: it sticks out.
    Around,
    /// What is in no cell of a universe: it has a gap.
    Nothing,
}

impl Beside {
    /// The other one's name.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Other(name) => Some(name),
            Self::Around | Self::Nothing => None,
        }
    }
}

/// Two volumes, or a volume and the one that it is in.
#[derive(Clone, Debug)]
pub struct Pair {
    /// What both are in; empty of a scene.
    pub within: String,
    /// The first one.
    pub a: String,
    /// The second one.
    pub b: Beside,
    /// What became of them.
    pub verdict: Verdict,
}

/// All pairs that were asked of.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Those that are not separate, deepest first.
    pub pairs: Vec<Pair>,
    /// How many are proven separate: by their boxes, by a search, and by what follows from the sides of
    /// surfaces alone.
    pub separate: [u64; 3],
    /// How many a scene's rules leave out: none of them is asked of.
    pub left_out: u64,
    /// What has facets in place of its surface.
    pub faceted: Vec<Faceted>,
}

/// A solid of which facets are asked in place of its surface; what is proven of its volume is proven of both.
#[derive(Clone, Debug, PartialEq)]
pub struct Faceted {
    /// The volume that has it.
    pub volume: String,
    /// Its kind.
    pub kind: String,
    /// Its name.
    pub solid: String,
    /// How many there are.
    pub facets: u64,
    /// How far they are off at most, a length.
    pub deviation: f64,
}

/// Something that stands.
struct Standing<'a> {
    name: String,
    model: &'a Model,
    pose: Pose,
    around: Aabb,
    /// How far its surface may be off that of what is meant, a length: it has facets.
    off: f64,
}

impl<'a> Standing<'a> {
    fn new(name: String, model: &'a Model, pose: Pose) -> Self {
        let own = model.solid.aabb();
        let around = if own.is_finite() {
            Aabb::of_points(own.corners().into_iter().map(|c| pose.point(c))).grown(1e-9 * own.half().length())
        } else {
            own
        };
        Self { name, model, pose, around, off: 0.0 }
    }

    /// The same where its surface may be off.
    fn within(self, off: f64) -> Self {
        Self { around: self.around.grown(off), off, ..self }
    }
}

/// The objects of a scene at its start, with the scene's models in order; not the pairs that no rule tests.
pub fn of_scene(scene: &Scene, models: &[Arc<Model>], tolerance: Option<f64>) -> Found {
    let standing: Vec<Standing<'_>> = scene
        .objects
        .iter()
        .map(|o| Standing::new(o.name.clone(), &models[o.model], o.motion.start.compose(&o.place)))
        .collect();
    let mut found = Found::default();
    siblings("", &standing, tolerance, |i, j| scene.is_tested(i, j), &mut found);
    found.order();
    found
}

/// The volumes of a GDML file as a scene of models without objects: one for each that has a solid, in order.
pub fn scene_of(path: &Path, volumes: &Volumes) -> Scene {
    let solid = volumes.volumes.iter().filter(|v| !v.text.is_empty());
    models_of(path, solid.map(|v| (v.name.clone(), v.text.clone(), v.at)).collect())
}

/// The models of all volumes, from those of `scene_of`'s scene; an assembly, which is in none of them, has any.
pub fn spread(volumes: &Volumes, models: &[Arc<Model>]) -> Vec<Arc<Model>> {
    let mut solid = models.iter();
    let Some(any) = models.first() else { return Vec::new() };
    let each = volumes.volumes.iter().map(|v| if v.text.is_empty() { None } else { solid.next() });
    each.map(|model| model.unwrap_or(any).clone()).collect()
}

/// What is around each volume in which others are, as a scene of models; and which volume each is around.
pub fn around(path: &Path, volumes: &Volumes, models: &[Arc<Model>]) -> (Scene, Vec<usize>) {
    let (mut texts, mut of) = (Vec::new(), Vec::new());
    for (i, volume) in volumes.volumes.iter().enumerate() {
        if volume.daughters.is_empty() || volume.text.is_empty() {
            continue;
        }
        let mut whole = models[i].solid.aabb();
        for d in &volume.daughters {
            whole = whole.union(&Standing::new(String::new(), &models[d.volume], d.pose).around);
        }
        if !whole.is_finite() {
            continue;
        }
        let (center, size) = (whole.center().to_array(), (3.0 * (whole.max - whole.min)).to_array());
        let block = format!(
            "multmatrix([[1, 0, 0, {:?}], [0, 1, 0, {:?}], [0, 0, 1, {:?}], [0, 0, 0, 1]]) {{ cube(size = {size:?}, center = true); }}",
            center[0], center[1], center[2]
        );
        texts.push((
            format!("around {}", volume.name),
            format!("difference() {{ {block} {} }}", volume.text),
            volume.at,
        ));
        of.push(i);
    }
    (models_of(path, texts), of)
}

fn models_of(path: &Path, texts: Vec<(String, String, crate::import::Place)>) -> Scene {
    let model = |(name, text, at)| ModelSource { name, path: path.to_owned(), at, text: Some(text) };
    let file = path.display().to_string();
    Scene { models: texts.into_iter().map(model).collect(), objects: Vec::new(), file, ..Scene::of_models(&[]) }
}

/// All placements of a GDML file: siblings against each other, daughters against what is around their mothers.
pub fn of_volumes(
    volumes: &Volumes,
    models: &[Arc<Model>],
    (outsides, of): (&[Arc<Model>], &[usize]),
    tolerance: Option<f64>,
) -> Found {
    let mut found = Found::default();
    // What is in an assembly is asked of where that is placed; in one that is nowhere, here.
    let is_asked = |v: &crate::import::gdml::Volume| !v.text.is_empty() || !v.is_placed;
    for (i, volume) in volumes.volumes.iter().enumerate().filter(|(_, v)| is_asked(v)) {
        let standing: Vec<Standing<'_>> = volume
            .daughters
            .iter()
            .map(|d| Standing::new(d.name.clone(), &models[d.volume], d.pose).within(volumes.volumes[d.volume].off))
            .collect();
        siblings(&volume.name, &standing, tolerance, |_, _| true, &mut found);
        let Some(outside) = of.iter().position(|o| *o == i) else { continue };
        let outside = Standing::new(String::new(), &outsides[outside], Pose::IDENTITY).within(volume.off);
        let verdicts: Vec<Verdict> =
            standing.par_iter().map_init(Scratch::default, |s, d| ask([d, &outside], tolerance, s)).collect();
        for (d, verdict) in standing.iter().zip(verdicts) {
            found.add(Pair { within: volume.name.clone(), a: d.name.clone(), b: Beside::Around, verdict });
        }
    }
    found.order();
    found
}

/// All pairs of what stands in the same place that are tested: those whose boxes meet are asked of.
fn siblings(
    within: &str,
    standing: &[Standing<'_>],
    tolerance: Option<f64>,
    is_tested: impl Fn(usize, usize) -> bool,
    found: &mut Found,
) {
    let (mut near, by_boxes) = near(standing);
    found.separate[0] += by_boxes;
    let all = near.len();
    near.retain(|[i, j]| is_tested(*i, *j));
    found.left_out += (all - near.len()) as u64;
    let verdicts: Vec<Verdict> = near
        .par_iter()
        .map_init(Scratch::default, |scratch, [i, j]| ask([&standing[*i], &standing[*j]], tolerance, scratch))
        .collect();
    for ([i, j], verdict) in near.iter().zip(verdicts) {
        let [a, b] = [i, j].map(|k| standing[*k].name.clone());
        found.add(Pair { within: within.to_owned(), a, b: Beside::Other(b), verdict });
    }
}

/// The pairs of what stands in the same place whose boxes meet, the first one first; and how many others there are.
fn near(standing: &[Standing<'_>]) -> (Vec<[usize; 2]>, u64) {
    let mut order: Vec<usize> = (0..standing.len()).filter(|i| !standing[*i].model.solid.is_empty()).collect();
    order.sort_by(|i, j| standing[*i].around.min.x.total_cmp(&standing[*j].around.min.x));
    let mut near = Vec::new();
    for (k, i) in order.iter().enumerate() {
        for j in &order[k + 1..] {
            let (a, b) = (&standing[*i].around, &standing[*j].around);
            if b.min.x > a.max.x {
                break;
            }
            if !a.intersection(b).is_empty() {
                near.push([*i.min(j), *i.max(j)]);
            }
        }
    }
    near.sort_unstable();
    let all = order.len() as u64 * (order.len() as u64).saturating_sub(1) / 2;
    let by_boxes = all - near.len() as u64;
    (near, by_boxes)
}

fn ask(pair: [&Standing<'_>; 2], tolerance: Option<f64>, scratch: &mut Scratch) -> Verdict {
    let [a, b] = pair.map(|s| PlacedModel {
        model: s.model,
        placed: Placed { place: Pose::IDENTITY, motion: Motion::resting(s.pose) },
    });
    let resolution = tolerance.map_or_else(|| default_resolution(a.model, b.model), |tolerance| 0.5 * tolerance);
    let query = PairQuery {
        a,
        b,
        resolution,
        cell_limit: CELL_LIMIT,
        strategies: Strategies::default(),
        query_options: QueryOptions::DEPTH,
    };
    let outcome = earliest_contact(&query, scratch);
    let off = pair[0].off.max(pair[1].off);
    // Beside what is far larger a body may be thinner than what rounding leaves untold: then nothing can be deep in both.
    let is_vanishing =
        tolerance.is_none() && a.model.solid.thinnest().min(b.model.solid.thinnest()) <= 4.0 * resolution;
    match verdict(pair, &outcome, 2.0 * resolution) {
        Verdict::Separate(bound) if is_vanishing => Verdict::NotProven(Some(bound + off)),
        found if off == 0.0 => found,
        // What is meant lies within {f <= off} of what is searched, f being at most the distance: where these are apart, so is that.
        Verdict::Separate(bound) => match margin::touching(&query, 2.0 * off, scratch).0 {
            Within::Apart => Verdict::Separate(0.0),
            Within::Witness(_) | Within::Open => Verdict::NotProven(Some(bound + off)),
        },
        Verdict::NotProven(bound) => Verdict::NotProven(bound.map(|bound| bound + off)),
        overlap @ Verdict::Overlap(..) => overlap,
    }
}

fn verdict(pair: [&Standing<'_>; 2], outcome: &Outcome, tolerance: f64) -> Verdict {
    // f is at most the distance from the surface: a ball of that radius around the point is in both.
    let deep = |x: DVec3| {
        pair.map(|s| -s.model.solid.value(s.pose.inverse().point(x)) - s.off).into_iter().fold(f64::INFINITY, f64::min)
    };
    let points = outcome.penetration().map(|p| p.point).into_iter().chain(outcome.point().map(|p| p.point));
    let deepest = points.map(|x| (x, deep(x))).max_by(|a, b| a.1.total_cmp(&b.1));
    match (outcome.status(), deepest) {
        (Status::Overlap | Status::Contact, Some((point, depth))) if depth > tolerance => {
            Verdict::Overlap(point, depth)
        }
        // A search that took too long may have gone on at a coarser resolution.
        (Status::Clear, _) if outcome.depth <= tolerance => Verdict::Separate(outcome.depth),
        (Status::Clear, _) => Verdict::NotProven(Some(outcome.depth)),
        _ => Verdict::NotProven(None),
    }
}

impl Found {
    fn add(&mut self, pair: Pair) {
        match pair.verdict {
            Verdict::Separate(_) => self.separate[1] += 1,
            Verdict::Overlap(..) | Verdict::NotProven(_) => self.pairs.push(pair),
        }
    }

    /// Deepest first; what is not proven comes last.
    fn order(&mut self) {
        let depth = |p: &Pair| if let Verdict::Overlap(_, depth) = p.verdict { depth } else { -1.0 };
        self.pairs.sort_by(|p, q| {
            depth(q).total_cmp(&depth(p)).then_with(|| (&p.within, &p.a, &p.b).cmp(&(&q.within, &q.a, &q.b)))
        });
    }

    /// How many overlap, and of how many neither is proven.
    pub fn counts(&self) -> [usize; 2] {
        let overlaps = self.pairs.iter().filter(|p| matches!(p.verdict, Verdict::Overlap(..))).count();
        [overlaps, self.pairs.len() - overlaps]
    }
}
