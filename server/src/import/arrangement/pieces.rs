//! Triangles cut into convex polygons where others meet them.
//!
//! Each polygon is its plane and a plane through each of its sides, every one of them a plane of the mesh's triangles or one through
//! a side of these, so that a corner is never made of corners that were made (G. Bernstein, D. Fussell, "Fast, exact, linear
//! booleans", 2009).

use super::exact::{Plane, Point};
use super::facets::{Facets, Meeting};
use crate::math::halt;
use crate::math::mix::Mixed;
use std::cmp::Ordering;

/// Pairs of triangles that meet and polygons that they are cut into, beyond which a mesh is left as it is: seconds of work.
const MOST: usize = 200_000;

/// A plane by its triangle and which of the triangle's four it is.
type Side = (u32, u8);

/// A convex part of a triangle.
#[derive(Clone)]
pub struct Piece {
    /// The triangle.
    pub facet: u32,
    /// Its corners, running round as the triangle's do; no three of them in a line.
    pub corners: Vec<u32>,
    /// The planes through its sides, the first from the first corner to the second.
    sides: Vec<Side>,
}

/// All triangles, cut.
pub struct Pieces {
    /// The points: first those of the mesh.
    pub points: Vec<Point>,
    /// The parts, those of a triangle one after another.
    pub all: Vec<Piece>,
    /// Of each triangle whether another one covers a part of it in its plane.
    pub covered: Vec<bool>,
    /// How many pairs of triangles meet.
    pub pairs: usize,
    /// How many triangles were cut.
    pub cut: usize,
}

/// Which triangles meet each.
struct Meetings {
    of: Vec<Vec<(u32, Meeting)>>,
    pairs: usize,
}

impl Meetings {
    /// Those of a mesh; `None` of too many.
    fn of(facets: &Facets) -> Option<Self> {
        let mut of: Vec<Vec<(u32, Meeting)>> = vec![Vec::new(); facets.all.len()];
        let (mut pairs, mut near) = (0, Vec::new());
        for i in 0..facets.all.len() as u32 {
            if i % 1024 == 0 {
                halt::point();
            }
            let around = &facets.boxes[i as usize];
            near.clear();
            facets.tree.visit(|b| b.meets(around), |j| near.push(j));
            near.retain(|j| *j > i && facets.boxes[*j as usize].meets(around));
            near.sort_unstable();
            for &j in &near {
                let meeting = facets.meeting(i, j);
                if meeting != Meeting::None {
                    of[i as usize].push((j, meeting));
                    of[j as usize].push((i, meeting));
                    pairs += 1;
                }
            }
            if pairs > MOST {
                return None;
            }
        }
        Some(Self { of, pairs })
    }
}

/// What cuts.
struct Cutter<'f> {
    facets: &'f Facets,
    points: Vec<Point>,
    /// The planes of triangles that meet others.
    planes: Mixed<u32, [Plane; 4]>,
}

impl Pieces {
    /// The triangles of a mesh, each cut where others meet it. `None` where too many do, and of too many that none does.
    pub fn of(facets: &Facets) -> Option<Self> {
        let meetings = Meetings::of(facets)?;
        if meetings.pairs == 0 && facets.all.len() > MOST {
            return None;
        }
        let mut cutter = Cutter {
            facets,
            points: facets.points.iter().map(|p| Point::whole(*p)).collect(),
            planes: Mixed::default(),
        };
        for (i, met) in meetings.of.iter().enumerate() {
            if !met.is_empty() {
                cutter.planes.insert(i as u32, facets.planes(i as u32));
            }
        }
        let (mut all, mut cut) = (Vec::with_capacity(facets.all.len()), 0);
        for (i, met) in meetings.of.iter().enumerate() {
            let i = i as u32;
            let sides = vec![(i, 1), (i, 2), (i, 3)];
            let mut pieces = vec![Piece { facet: i, corners: facets.all[i as usize].corners.to_vec(), sides }];
            for (other, meeting) in met {
                halt::point();
                match meeting {
                    Meeting::Across => cutter.cut(&mut pieces, (*other, 0)),
                    Meeting::Coplanar => (1..4).for_each(|m| cutter.cut(&mut pieces, (*other, m))),
                    Meeting::None => {}
                }
                if all.len() + pieces.len() > MOST + facets.all.len() {
                    return None;
                }
            }
            cut += usize::from(pieces.len() > 1);
            all.append(&mut pieces);
        }
        let covered = meetings.of.iter().map(|met| met.iter().any(|m| m.1 == Meeting::Coplanar)).collect();
        Some(Self { points: cutter.points, all, covered, pairs: meetings.pairs, cut })
    }
}

impl Cutter<'_> {
    fn plane(&self, (facet, k): Side) -> &Plane {
        &self.planes[&facet][k as usize]
    }

    /// Cuts those of some pieces that a triangle, or a side of one in their plane, runs through, along the plane of it.
    fn cut(&mut self, pieces: &mut Vec<Piece>, by: Side) {
        for i in 0..pieces.len() {
            if let Some([front, back]) = self.halves(&pieces[i], by) {
                pieces[i] = front;
                pieces.push(back);
            }
        }
    }

    /// The parts of a piece on both sides of a plane, if the triangle that it is of has more than a point of it between them.
    fn halves(&mut self, piece: &Piece, by: Side) -> Option<[Piece; 2]> {
        let around = self.facets.boxes[by.0 as usize].grown(1.0);
        let corners = || piece.corners.iter().map(|c| self.points[*c as usize].near);
        // The box of the piece is inside that of its corners, each within a half of where it is told.
        if (0..3).any(|k| corners().all(|p| p[k] < around.min[k]) || corners().all(|p| p[k] > around.max[k])) {
            return None;
        }
        let sides: Vec<Ordering> =
            piece.corners.iter().map(|c| self.plane(by).side(&self.points[*c as usize])).collect();
        if !(sides.contains(&Ordering::Greater) && sides.contains(&Ordering::Less)) {
            return None;
        }
        let count = sides.len();
        // Where it enters and leaves: the side behind the place, and the point if it is not a corner.
        let mut ends: Vec<(usize, Result<u32, Point>)> = Vec::with_capacity(2);
        for i in 0..count {
            let (here, next) = (sides[i], sides[(i + 1) % count]);
            if here == Ordering::Equal {
                ends.push((i, Ok(piece.corners[i])));
            } else if next == here.reverse() {
                let planes = [self.plane((piece.facet, 0)), self.plane(piece.sides[i]), self.plane(by)];
                ends.push((i, Err(Point::of_planes(planes)?)));
            }
        }
        let [one, other] = <[_; 2]>::try_from(ends).ok()?;
        if !self.is_between([&one.1, &other.1], by) {
            return None;
        }
        Some(self.split(piece, [one, other], by))
    }

    /// True where a triangle may have more than a point of a segment in its plane, which lies in one of its four planes.
    fn is_between(&self, ends: [&Result<u32, Point>; 2], (facet, of): Side) -> bool {
        let ends = ends.map(|e| e.as_ref().map_or_else(|made| made, |c| &self.points[*c as usize]));
        (1..4).filter(|k| *k != of).all(|k| {
            let sides = ends.map(|p| self.plane((facet, k)).side(p));
            sides == [Ordering::Equal; 2] || sides.contains(&Ordering::Less)
        })
    }

    fn split(&mut self, piece: &Piece, ends: [(usize, Result<u32, Point>); 2], by: Side) -> [Piece; 2] {
        let count = piece.corners.len();
        let [(p, one), (q, other)] = ends;
        let starts = [one.is_ok(), other.is_ok()];
        let mut id = |end: Result<u32, Point>| {
            end.unwrap_or_else(|made| {
                self.points.push(made);
                self.points.len() as u32 - 1
            })
        };
        let (a, b) = (id(one), id(other));
        // From one end along the sides to the other, and back by the cut.
        let part = |(from, i): (u32, usize), (to, j): (u32, usize), is_corner: bool| {
            let (mut corners, mut sides) = (vec![from], vec![piece.sides[i]]);
            let mut k = (i + 1) % count;
            let last = if is_corner { j } else { (j + 1) % count };
            while k != last {
                corners.push(piece.corners[k]);
                sides.push(piece.sides[k]);
                k = (k + 1) % count;
            }
            corners.push(to);
            sides.push(by);
            Piece { facet: piece.facet, corners, sides }
        };
        [part((a, p), (b, q), starts[1]), part((b, q), (a, p), starts[0])]
    }
}
