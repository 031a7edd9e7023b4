//! A body that several cavities of one solid hold together, as the steps of a bore do, or the two cones of a groove.
//!
//! Cavities end at floors. All floors across one direction cut space into layers; a body that lies in the union of the cavities is cut
//! by the same planes, and each of its pieces lies in one cavity that goes on through its layer. Of those that do the widest one is
//! taken, and neighbours in the same cavity are one piece. A layer that no cavity goes through is solid: the piece before it is not cut
//! there and keeps its floor as a wall.
//!
//! Why nothing is missed: a common point of depth δ lies on one side of each plane of a cut, so in some piece. There it is beyond
//! some face of the piece's cavity by δ; no floor of it that was left out can be that face, since the piece does not reach
//! beyond it by more than a part of δ (`SLACK`). The planes of the cut lie δ farther out for what the proof takes off at planes.

use super::body::Plane;
use super::pierced::CavityPair;
use crate::math::Aabb;
use crate::solid::Sense;
use crate::solid::local::LiteralId;
use glam::DVec3;
use smallvec::SmallVec;

/// Cavities beyond which a body is left to the search, and pieces of it.
pub(super) const MOST_CAVITIES: usize = 16;
const MOST_LAYERS: usize = 12;
/// Part of the depth by which floors in one plane may differ, and twice the part that their leaning may take.
const SLACK: f64 = 0.125;
/// Part of a radius by which two sections in one plane may differ that are taken for equal.
const ALIKE: f64 = 1e-9;

/// The pieces of a body.
pub(super) type Pieces<'a> = SmallVec<[CavityPair<'a>; 4]>;

/// A body in several cavities, and one direction across which they end.
struct Layers<'p, 'a> {
    /// The body with each of the cavities.
    pairs: &'p [CavityPair<'a>],
    axis: DVec3,
    /// Where each cavity ends along the axis; infinite where it does not.
    spans: SmallVec<[[f64; 2]; 8]>,
    /// A point of the body, by which cavities are chosen.
    middle: DVec3,
}

/// A layer, its ends along the axis, and the index of the cavity that a piece is in.
#[derive(Clone, Copy, Debug)]
struct Layer {
    ends: [f64; 2],
    cavity: usize,
}

/// The pieces of a body in cavities by layers across `axis`, `pairs` the body with each of them. `reached` is a box around all that
/// the body reaches of the solid, `center` a point in it at the start, `middle` one of the body when a wall seems to be met. `None` where
/// the first is in no layer that a cavity goes through.
pub(super) fn layers<'a>(
    pairs: &[CavityPair<'a>],
    axis: DVec3,
    reached: &Aabb,
    center: DVec3,
    middle: DVec3,
) -> Option<Pieces<'a>> {
    let delta = pairs.first()?.delta;
    let spans = pairs.iter().map(|pair| pair.span(axis)).collect();
    let this = Layers { pairs, axis, spans, middle };
    let (along, half) = (reached.center().dot(axis), reached.half().dot(axis.abs()));
    let [from, to] = [along - half, along + half];
    let mut cuts: SmallVec<[f64; 16]> = this.spans.iter().flatten().copied().filter(|c| *c > from && *c < to).collect();
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.dedup_by(|next, kept| *next - *kept <= SLACK * delta);
    if cuts.len() >= MOST_LAYERS {
        return None;
    }
    let ends = |i: usize| [if i == 0 { from } else { cuts[i - 1] }, cuts.get(i).copied().unwrap_or(to)];
    let first = cuts.partition_point(|c| *c <= center.dot(axis));
    let mut found: SmallVec<[Layer; 8]> = SmallVec::new();
    found.push(this.layer(ends(first))?);
    for i in (0..first).rev() {
        let Some(layer) = this.layer(ends(i)) else { break };
        found.insert(0, layer);
    }
    for i in first + 1..=cuts.len() {
        let Some(layer) = this.layer(ends(i)) else { break };
        found.push(layer);
    }
    found.dedup_by(|next, kept| {
        let is_same = next.cavity == kept.cavity;
        if is_same {
            kept.ends[1] = next.ends[1];
        }
        is_same
    });
    let piece = |i: usize| {
        let [lower, upper] = [(i > 0).then(|| i - 1), (i + 1 < found.len()).then_some(i + 1)];
        let Layer { ends: [from, to], cavity } = found[i];
        let at = |other: Option<usize>, cut: f64| other.map(|o| (cut, this.edge(cavity, found[o].cavity, cut)));
        pairs[cavity].cut(axis, [at(lower, from), at(upper, to)])
    };
    Some((0..found.len()).map(piece).collect())
}

impl Layers<'_, '_> {
    /// The cavity that goes on between two ends in which the body has most room.
    fn layer(&self, ends: [f64; 2]) -> Option<Layer> {
        let slack = SLACK * self.pairs[0].delta;
        let goes_on = |span: &[f64; 2]| span[0] <= ends[0] + slack && span[1] >= ends[1] - slack;
        let mut through = (0..self.pairs.len()).filter(|k| goes_on(&self.spans[*k]));
        let first = through.next()?;
        let mut best = (first, f64::NAN);
        for k in through {
            if best.1.is_nan() {
                best.1 = self.room(first, ends);
            }
            let room = self.room(k, ends);
            if room > best.1 {
                best = (k, room);
            }
        }
        Some(Layer { ends, cavity: best.0 })
    }

    /// How far the walls of a cavity are from the body's middle, moved along the axis to half way between two ends.
    fn room(&self, cavity: usize, ends: [f64; 2]) -> f64 {
        let half_way = 0.5 * (ends[0] + ends[1]);
        self.pairs[cavity].room(self.axis, self.middle + self.axis * (half_way - self.middle.dot(self.axis)))
    }

    /// What a piece in `own` meets where its wall ends in a cut and the cavity `other` goes on: the wall of that, or beside a narrower
    /// one its floor.
    fn edge(&self, own: usize, other: usize, cut: f64) -> LiteralId {
        let (own, other) = (&self.pairs[own], &self.pairs[other]);
        let wall = other.round.map(|round| round.literal);
        let floor = other.flats.iter().find(|flat| {
            let along = flat.normal.dot(self.axis);
            (cut * along - flat.offset).abs() <= ALIKE * other.scale && along.abs() > 1.0 - ALIKE
        });
        let are_alike = match (own.section(self.axis, cut), other.section(self.axis, cut)) {
            (Some(r), Some(s)) => (r - s).abs() <= ALIKE * other.scale,
            _ => false,
        };
        let floor = floor.map(|flat| flat.literal);
        let listed = if are_alike { wall.or(floor) } else { floor.or(wall) };
        // A cavity that the solid does not reach has no walls, and is met nowhere.
        listed.or(other.flats.first().map(|flat| flat.literal)).unwrap_or(LiteralId::new(0, Sense::Negative))
    }
}

impl CavityPair<'_> {
    /// Where its cavity ends along an axis, by its floors across that; infinite where it does not.
    fn span(&self, axis: DVec3) -> [f64; 2] {
        let mut span = [f64::NEG_INFINITY, f64::INFINITY];
        for flat in &self.flats {
            if self.is_across(flat, axis) {
                span[1] = span[1].min(flat.offset);
            } else if self.is_across(flat, -axis) {
                span[0] = span[0].max(-flat.offset);
            }
        }
        span
    }

    /// True where a flat wall has the axis for its normal, as near as no point of the pierced body tells a part of the depth.
    fn is_across(&self, flat: &Plane, axis: DVec3) -> bool {
        let lean = (flat.normal - axis).length();
        lean == 0.0 || lean * self.extent <= 0.5 * SLACK * self.delta
    }

    /// The radius of its round wall in a plane across it; `None` where it has no such section.
    fn section(&self, axis: DVec3, cut: f64) -> Option<f64> {
        let round = self.round.as_ref()?;
        let along = round.axis.dot(axis);
        let s = (cut - axis.dot(round.origin)) / along;
        (along.abs() > 1.0 - ALIKE).then(|| round.radius - round.lean.dot(round.axis) * s)
    }

    /// How far its cavity's walls are from a point, its floors across an axis left out.
    fn room(&self, axis: DVec3, x: DVec3) -> f64 {
        let round = self.round.iter().map(|round| {
            let from = x - round.origin;
            let along = from.dot(round.axis);
            round.radius - round.lean.dot(round.axis) * along - (from - round.axis * along).length()
        });
        let walls = self.flats.iter().filter(|flat| flat.normal.dot(axis).abs() < 1.0 - ALIKE);
        let flat = walls.map(|flat| flat.offset - flat.normal.dot(x));
        round.chain(flat).fold(f64::INFINITY, f64::min)
    }

    /// The piece of the body between two planes across an axis, each with the face that its cavity's wall has an edge with there. The
    /// floors beyond are no walls of it.
    fn cut(&self, axis: DVec3, [lower, upper]: [Option<(f64, LiteralId)>; 2]) -> Self {
        let mut piece = self.clone();
        for (normal, at) in [(-axis, lower.map(|(c, edge)| (-c, edge))), (axis, upper)] {
            let Some((offset, literal)) = at else { continue };
            piece.flats.retain(|flat| !self.is_across(flat, normal));
            piece.planes.push(Plane { normal, offset: offset + self.delta, literal });
        }
        piece
    }
}
