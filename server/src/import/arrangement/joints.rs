//! Corners that are the same point made one, and put into every side that they lie on: then sides meet from end to end.

use super::boxes::Boxes;
use super::exact::{Point, are_in_line};
use super::pieces::Piece;
use crate::math::Aabb;
use crate::math::halt;
use crate::math::mix::Mixed;
use glam::DVec3;
use std::cmp::Ordering;

/// How far beside a side a point of it may seem to be, in steps of the grid.
const REACH: f64 = 64.0;

/// Makes equal points one: of each the first that it is equal to.
pub fn unified(points: &[Point]) -> Vec<u32> {
    let mut first: Mixed<[u64; 3], Vec<u32>> = Mixed::default();
    let of = |(i, p): (usize, &Point)| {
        // Equal points have equal nearest doubles. Adding 0 turns -0 into 0.
        let there = first.entry((p.near + DVec3::ZERO).to_array().map(f64::to_bits)).or_default();
        there.iter().copied().find(|j| points[*j as usize].is(p)).unwrap_or_else(|| {
            there.push(i as u32);
            i as u32
        })
    };
    points.iter().enumerate().map(of).collect()
}

/// The corners of each piece, with all others that lie on its sides.
pub fn joined(points: &[Point], pieces: &[Piece], same: &[u32]) -> Vec<Vec<u32>> {
    let mut used = vec![false; points.len()];
    pieces.iter().flat_map(|p| &p.corners).for_each(|c| used[same[*c as usize] as usize] = true);
    let corners: Vec<u32> = (0..points.len() as u32).filter(|c| used[*c as usize]).collect();
    let boxes: Vec<Aabb> = corners.iter().map(|c| Aabb::of_points([points[*c as usize].near])).collect();
    let joints = Joints { points, corners, tree: Boxes::of(&boxes) };
    let mut known: Mixed<[u32; 2], Vec<u32>> = Mixed::default();
    let with_joints = |piece: &Piece| {
        let corners = || piece.corners.iter().map(|c| same[*c as usize]);
        let mut out = Vec::with_capacity(piece.corners.len());
        for (a, b) in corners().zip(corners().cycle().skip(1)) {
            out.push(a);
            let between = known.entry([a.min(b), a.max(b)]).or_insert_with(|| joints.between([a.min(b), a.max(b)]));
            if a < b {
                out.extend(&*between);
            } else {
                out.extend(between.iter().rev());
            }
        }
        out
    };
    pieces.iter().map(with_joints).collect()
}

/// All corners, by where they are.
struct Joints<'p> {
    points: &'p [Point],
    corners: Vec<u32>,
    tree: Boxes,
}

impl Joints<'_> {
    /// The corners strictly between the ends of a side, in order from the first to the second.
    fn between(&self, side: [u32; 2]) -> Vec<u32> {
        halt::point();
        let [a, b] = side.map(|c| &self.points[c as usize]);
        let (from, way) = (a.near, b.near - a.near);
        // Of coordinates below 2^53 each rounding is a half at most, and what follows takes a few of them.
        let (around, reach) = (Aabb::of_points([a.near, b.near]).grown(REACH), REACH);
        let squared = way.length_squared();
        let misses = |b: &Aabb| {
            // A box that the side's line does not come near.
            let (center, half) = (b.center() - from, b.half() + DVec3::splat(reach));
            let aside = way.cross(center).abs();
            let most = DVec3::new(
                way.y.abs() * half.z + way.z.abs() * half.y,
                way.z.abs() * half.x + way.x.abs() * half.z,
                way.x.abs() * half.y + way.y.abs() * half.x,
            );
            aside.cmpgt(most * (1.0 + 1e-9) + DVec3::splat(1e-9 * squared)).any()
        };
        let mut found = Vec::new();
        self.tree.visit(
            |b| b.meets(&around) && !misses(b),
            |i| {
                let c = self.corners[i as usize];
                let p = self.points[c as usize].near;
                let aside = way.cross(p - from).length_squared();
                if around.contains(p) && aside <= squared * reach * reach && !side.contains(&c) {
                    found.push(c);
                }
            },
        );
        let longest = (0..3).fold(0, |most, k| if way[k].abs() > way[most].abs() { k } else { most });
        // Ends that round to one point differ along some axis all the same.
        let differs = |k: &usize| a.compare(b, *k) != Ordering::Equal;
        let axis = [longest, 0, 1, 2].into_iter().find(differs).unwrap_or(longest);
        let order = |c: u32, d: u32| self.points[c as usize].compare(&self.points[d as usize], axis);
        let way = order(side[0], side[1]);
        found.retain(|c| {
            order(side[0], *c) == way && order(*c, side[1]) == way && are_in_line([a, &self.points[*c as usize], b])
        });
        found.sort_by(|c, d| if way == Ordering::Less { order(*c, *d) } else { order(*d, *c) });
        found
    }
}
