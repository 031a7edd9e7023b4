//! Overlaps and gaps of OpenMC's universes.
//!
//! Each universe is asked in the box that holds all of its uses: cells against cells, and the box against what of it is in no cell. What
//! is separate there is separate wherever it is seen; so are cells that the sides of their surfaces alone keep apart, without a search. What is not is asked again of each use that cuts something off.

use super::{Beside, Found, Pair, Standing, Verdict, ask, models_of, near};
use crate::contact::Scratch;
use crate::import::openmc::{Universe, Universes, Use};
use crate::import::{Place, Scene};
use crate::octree::Model;
use contactd_proto::Pose;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Solids that are cut off to the uses of suspects, at most; what would take more is told as not proven.
const MOST_CUT: usize = 20_000;

/// Two cells of a universe that are not proven separate in its box, or a gap in it.
#[derive(Clone, Debug)]
pub struct Suspect {
    universe: usize,
    /// Of the universe's models the one that is cut off to each use: a cell, or the box.
    a: usize,
    /// The other one: a cell, or what is in none.
    b: usize,
    verdict: Verdict,
}

/// A universe's models in order: its box, what is in no cell where that is asked, its cells.
fn texts(universe: &Universe) -> Vec<(String, String, Place)> {
    let name = |what: &str| format!("{}, {what}", universe.name);
    let mut texts = vec![(name("its box"), universe.whole.clone(), universe.at)];
    texts.extend(universe.rest.iter().map(|rest| (name("what is in no cell"), rest.clone(), universe.at)));
    texts.extend(universe.cells.iter().map(|cell| (cell.name.clone(), cell.text.clone(), cell.at)));
    texts
}

/// Place of the first cell among a universe's models.
fn first(universe: &Universe) -> usize {
    1 + usize::from(universe.rest.is_some())
}

/// All that is asked of a geometry as a scene of models without objects.
pub fn scene_of_cells(path: &Path, universes: &Universes) -> Scene {
    models_of(path, universes.universes.iter().flat_map(texts).collect())
}

/// What is proven of all universes in their boxes, from the models of `scene_of_cells`; and what is left to ask.
pub fn of_cells(universes: &Universes, models: &[Arc<Model>], tolerance: Option<f64>) -> (Found, Vec<Suspect>) {
    let (mut found, mut suspects) = (Found::default(), Vec::new());
    let mut from = 0;
    for (index, universe) in universes.universes.iter().enumerate() {
        let first = first(universe);
        let own = &models[from..from + first + universe.cells.len()];
        from += own.len();
        let standing: Vec<Standing<'_>> =
            own.iter().map(|model| Standing::new(String::new(), model, Pose::IDENTITY)).collect();
        let (mut pairs, by_boxes) = near(&standing[first..]);
        found.separate[0] += by_boxes;
        let before = pairs.len();
        pairs.retain(|[a, b]| !universe.are_apart(*a, *b));
        found.separate[2] += (before - pairs.len()) as u64;
        pairs.iter_mut().for_each(|pair| *pair = pair.map(|k| k + first));
        pairs.extend(universe.rest.iter().map(|_| [0, 1]));
        let verdicts: Vec<Verdict> = pairs
            .par_iter()
            .map_init(Scratch::default, |s, pair| ask(pair.map(|k| &standing[k]), tolerance, s))
            .collect();
        for ([a, b], verdict) in pairs.into_iter().zip(verdicts) {
            match verdict {
                Verdict::Separate(_) => found.separate[1] += 1,
                _ => suspects.push(Suspect { universe: index, a, b, verdict }),
            }
        }
    }
    (found, suspects)
}

/// The uses of a suspect's universe; `None` where one of them is the whole box, so that what is found there is seen.
fn cut<'a>(universes: &'a Universes, suspect: &Suspect) -> Option<Vec<&'a Use>> {
    let uses = &universes.universes[suspect.universe].uses;
    (!uses.iter().any(|u| u.text.is_empty())).then(|| uses.iter().collect())
}

/// The suspects' first models, cut off to each use, as a scene of models without objects.
pub fn scene_of_uses(path: &Path, universes: &Universes, suspects: &[Suspect]) -> Scene {
    let mut all = Vec::new();
    for suspect in suspects {
        let universe = &universes.universes[suspect.universe];
        let (name, text, at) = texts(universe).swap_remove(suspect.a);
        let Some(uses) = cut(universes, suspect).filter(|uses| all.len() + uses.len() <= MOST_CUT) else { continue };
        let of = |(k, u): (usize, &Use)| {
            (format!("{name}, place {}", k + 1), format!("intersection() {{ {text} {} }}", u.text), at)
        };
        all.extend(uses.into_iter().enumerate().map(of));
    }
    models_of(path, all)
}

/// What became of the suspects, with the models of both scenes.
pub fn decide(
    universes: &Universes,
    (models, cuts): (&[Arc<Model>], &[Arc<Model>]),
    (mut found, suspects): (Found, Vec<Suspect>),
    tolerance: Option<f64>,
) -> Found {
    let counts = universes.universes.iter().map(|u| first(u) + u.cells.len());
    let starts: Vec<usize> = counts
        .scan(0, |sum, count| {
            *sum += count;
            Some(*sum - count)
        })
        .collect();
    let mut next = 0;
    for suspect in suspects {
        let universe = &universes.universes[suspect.universe];
        let other = &models[starts[suspect.universe] + suspect.b];
        let verdict = match cut(universes, &suspect) {
            None => suspect.verdict,
            Some(uses) if next + uses.len() > MOST_CUT => Verdict::NotProven(None),
            Some(uses) => {
                let own = &cuts[next..next + uses.len()];
                next += uses.len();
                match seen(own, other, tolerance) {
                    Verdict::Separate(_) if universe.is_cut_short => Verdict::NotProven(None),
                    verdict => verdict,
                }
            }
        };
        let cell = |k: usize| universe.cells[k - first(universe)].name.clone();
        let (a, b) = match suspect.a {
            0 => (universe.name.clone(), Beside::Nothing),
            a => (cell(a), Beside::Other(cell(suspect.b))),
        };
        found.add(Pair { within: universe.name.clone(), a, b, verdict });
    }
    found.order();
    found
}

/// The worst of what is seen in some places.
fn seen(own: &[Arc<Model>], other: &Model, tolerance: Option<f64>) -> Verdict {
    let other = Standing::new(String::new(), other, Pose::IDENTITY);
    let all: Vec<Verdict> = own
        .par_iter()
        .map_init(Scratch::default, |s, model| {
            let own = Standing::new(String::new(), model, Pose::IDENTITY);
            if model.solid.is_empty() || own.around.intersection(&other.around).is_empty() {
                return Verdict::Separate(0.0);
            }
            ask([&own, &other], tolerance, s)
        })
        .collect();
    let rank = |v: &Verdict| match v {
        Verdict::Separate(depth) => (0, *depth),
        Verdict::NotProven(bound) => (1, bound.unwrap_or(f64::INFINITY)),
        Verdict::Overlap(_, depth) => (2, *depth),
    };
    let worst = all.into_iter().max_by(|p, q| rank(p).partial_cmp(&rank(q)).unwrap_or(std::cmp::Ordering::Equal));
    worst.unwrap_or(Verdict::Separate(0.0))
}
