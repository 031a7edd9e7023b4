//! Edges of a mesh and what meets in them.

use super::MeshFault;
use glam::DVec3;
use rayon::prelude::*;

/// In place of a neighbour that is not there.
pub const NONE: u32 = u32::MAX;

/// The sides of all triangles, those of one edge next to each other: the edge's corners, the smaller number first, and the triangle.
pub struct Edges(Vec<(u64, u32)>);

fn name(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

impl Edges {
    /// Those of some triangles.
    pub fn of(triangles: &[[u32; 3]]) -> Self {
        let mut all: Vec<(u64, u32)> = Vec::with_capacity(3 * triangles.len());
        for (i, t) in triangles.iter().enumerate() {
            all.extend((0..3).map(|k| (name(t[k], t[(k + 1) % 3]), i as u32)));
        }
        all.par_sort_unstable();
        Self(all)
    }

    /// Every edge is run along as often in one direction as in the other.
    ///
    /// # Errors
    /// The edge of the first triangle that has one of another kind.
    pub fn are_closed(&self, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), MeshFault> {
        let balance = |group: &[(u64, u32)]| {
            group.iter().map(|(edge, i)| if runs_up(triangles[*i as usize], *edge) { 1 } else { -1 }).sum::<i32>()
        };
        let wrong = self.0.chunk_by(|p, q| p.0 == q.0).filter(|group| balance(group) != 0);
        let Some(first) = wrong.min_by_key(|group| (group[0].1, group[0].0)) else { return Ok(()) };
        let [a, b] = [first[0].0 >> 32, first[0].0 & 0xffff_ffff].map(|v| vertices[v as usize]);
        Err(if first.len() == 1 { MeshFault::Open(a, b) } else { MeshFault::Mixed(a, b) })
    }

    /// Of each triangle the one beyond each of its sides: of several the last that runs along it the other way.
    pub fn opposite(&self, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let mut out = vec![[NONE; 3]; triangles.len()];
        for group in self.0.chunk_by(|p, q| p.0 == q.0) {
            let edge = group[0].0;
            let last = |up: bool| group.iter().rev().find(|(_, i)| runs_up(triangles[*i as usize], edge) == up);
            let last = [false, true].map(|up| last(up).map_or(NONE, |l| l.1));
            for (_, i) in group {
                let t = triangles[*i as usize];
                let k = (0..3).find(|k| name(t[*k], t[(k + 1) % 3]) == edge).unwrap_or(0);
                out[*i as usize][k] = last[usize::from(!runs_up(t, edge))];
            }
        }
        out
    }
}

/// Of each triangle the first one of the part of the surface that it is in, by the neighbours of each along its sides.
pub fn leaders(opposite: &[[u32; 3]]) -> Vec<u32> {
    let mut leader: Vec<u32> = (0..opposite.len() as u32).collect();
    fn find(leader: &mut [u32], mut i: u32) -> u32 {
        while leader[i as usize] != i {
            leader[i as usize] = leader[leader[i as usize] as usize];
            i = leader[i as usize];
        }
        i
    }
    for (i, others) in opposite.iter().enumerate() {
        for j in others.iter().filter(|j| **j != NONE) {
            let (p, q) = (find(&mut leader, i as u32), find(&mut leader, *j));
            leader[p.max(q) as usize] = p.min(q);
        }
    }
    for i in 0..leader.len() as u32 {
        let first = find(&mut leader, i);
        leader[i as usize] = first;
    }
    leader
}

/// True where a triangle runs along an edge from its smaller corner to the larger.
fn runs_up(t: [u32; 3], edge: u64) -> bool {
    let (a, b) = ((edge >> 32) as u32, edge as u32);
    (0..3).any(|k| (t[k], t[(k + 1) % 3]) == (a, b))
}
