//! Corners that are nearly the same, or nearly on a side, made so: what is exact on paper would cross itself in doubles there.
//!
//! A face stays closed with its neighbours: the same corners go into a side whichever face runs along it, and what a face runs to
//! and back cancels.

use super::boxes::Boxes;
use crate::math::Aabb;
use crate::math::mix::Mixed;
use glam::DVec3;

/// The faces with corners within `reach` of each other as one, the one of the lowest number, and those within it of a side put there.
pub fn snapped(points: &[DVec3], faces: &[Vec<u32>], reach: f64) -> Vec<Vec<u32>> {
    let mut used: Vec<u32> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let stands_for = stands_for(points, &used, reach);
    used.retain(|c| stands_for[c] == *c);
    let boxes: Vec<Aabb> = used.iter().map(|c| Aabb::of_points([points[*c as usize]])).collect();
    let tree = Boxes::of(&boxes);
    let between = |[a, b]: [u32; 2]| {
        let [from, to] = [a, b].map(|c| points[c as usize]);
        let (way, around) = (to - from, Aabb::of_points([from, to]).grown(reach));
        let squared = way.length_squared();
        let mut found = Vec::new();
        let along = |c: u32| (points[c as usize] - from).dot(way);
        tree.visit(
            |b| b.meets(&around),
            |i| {
                let c = used[i as usize];
                let aside = way.cross(points[c as usize] - from).length_squared();
                if aside <= reach * reach * squared && along(c) > 0.0 && along(c) < squared && c != a && c != b {
                    found.push(c);
                }
            },
        );
        found.sort_by(|c, d| along(*c).total_cmp(&along(*d)).then(c.cmp(d)));
        found
    };
    let mut known: Mixed<[u32; 2], Vec<u32>> = Mixed::default();
    let mut out = Vec::with_capacity(faces.len());
    for face in faces {
        let corners = || face.iter().map(|c| stands_for[c]);
        let mut around: Vec<u32> = Vec::with_capacity(face.len());
        for (a, b) in corners().zip(corners().cycle().skip(1)).filter(|(a, b)| a != b) {
            around.push(a);
            let side = [a.min(b), a.max(b)];
            let found = known.entry(side).or_insert_with(|| between(side));
            if a < b {
                around.extend(&*found);
            } else {
                around.extend(found.iter().rev());
            }
        }
        let around = without_spikes(around);
        if around.len() >= 3 {
            out.push(around);
        }
    }
    out
}

/// Of each corner the first one within `reach` that stands for itself.
fn stands_for(points: &[DVec3], used: &[u32], reach: f64) -> Mixed<u32, u32> {
    let boxes: Vec<Aabb> = used.iter().map(|c| Aabb::of_points([points[*c as usize]])).collect();
    let tree = Boxes::of(&boxes);
    let mut out: Mixed<u32, u32> = Mixed::default();
    for c in used {
        let p = points[*c as usize];
        let around = Aabb::of_points([p]).grown(reach);
        let mut first = *c;
        tree.visit(
            |b| b.meets(&around),
            |i| {
                let d = used[i as usize];
                if d < first && out[&d] == d && points[d as usize].distance(p) <= reach {
                    first = d;
                }
            },
        );
        out.insert(*c, first);
    }
    out
}

/// A ring without what it runs along and back at once.
fn without_spikes(around: Vec<u32>) -> Vec<u32> {
    let mut out: Vec<u32> = Vec::with_capacity(around.len());
    for c in around {
        if out.last() == Some(&c) {
            continue;
        }
        if out.len() >= 2 && out[out.len() - 2] == c {
            out.pop();
            continue;
        }
        out.push(c);
    }
    // Where it begins, too.
    let (mut from, mut to) = (0, out.len());
    while to - from >= 3 {
        if out[from] == out[to - 1] {
            to -= 1;
        } else if out[from + 1] == out[to - 1] {
            from += 1;
        } else if out[from] == out[to - 2] {
            to -= 1;
        } else {
            break;
        }
    }
    out[from..to].to_vec()
}
