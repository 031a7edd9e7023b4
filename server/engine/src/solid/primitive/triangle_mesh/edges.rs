//! Edges of a mesh and what meets in them.

use super::MeshFault;
use crate::math::mix::Mixed;
use glam::DVec3;

/// In place of a neighbour that is not there.
pub const NONE: u32 = u32::MAX;

/// The sides of all triangles by their edges: those whose lower corner has a number stand together, in order of the higher one, then
/// of the triangle.
pub struct Edges {
    /// Where the sides of each lower corner begin, and where the last ones end.
    from: Vec<u32>,
    /// The higher corner, and the triangle.
    sides: Vec<(u32, u32)>,
}

/// Corners of an edge, the smaller number first.
type Edge = [u32; 2];

/// Edges of more than two triangles.
pub type Crowded = Mixed<Edge, ()>;

fn edge(a: u32, b: u32) -> Edge {
    [a.min(b), a.max(b)]
}

impl Edges {
    /// Those of some triangles of so many corners. What is said of each lower corner is counted, then put in order: of few sides.
    pub fn of(triangles: &[[u32; 3]], corners: usize) -> Self {
        let sides = |t: &[u32; 3]| [edge(t[0], t[1]), edge(t[1], t[2]), edge(t[2], t[0])];
        let mut from = vec![0u32; corners + 1];
        triangles.iter().flat_map(sides).for_each(|[low, _]| from[low as usize + 1] += 1);
        (0..corners).for_each(|v| from[v + 1] += from[v]);
        let mut all = vec![(NONE, NONE); 3 * triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            for [low, high] in sides(t) {
                let next = &mut from[low as usize];
                all[*next as usize] = (high, i as u32);
                *next += 1;
            }
        }
        // Each has gone on to where the next one began.
        from.copy_within(..corners, 1);
        from[0] = 0;
        let mut rest = all.as_mut_slice();
        for ends in from.windows(2) {
            let (own, behind) = rest.split_at_mut((ends[1] - ends[0]) as usize);
            own.sort_unstable();
            rest = behind;
        }
        Self { from, sides: all }
    }

    /// Each edge with its sides, in order.
    fn groups(&self) -> impl Iterator<Item = (Edge, &[(u32, u32)])> {
        let of_corner = |(low, ends): (usize, &[u32])| {
            let all = &self.sides[ends[0] as usize..ends[1] as usize];
            all.chunk_by(|p, q| p.0 == q.0).map(move |group| ([low as u32, group[0].0], group))
        };
        self.from.windows(2).enumerate().flat_map(of_corner)
    }

    /// Every edge is run along as often in one direction as in the other.
    ///
    /// # Errors
    /// The edge of the first triangle that has one of another kind.
    pub fn are_closed(&self, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), MeshFault> {
        let balance = |(edge, group): &(Edge, &[(u32, u32)])| {
            group.iter().map(|(_, i)| if runs_up(triangles[*i as usize], *edge) { 1 } else { -1 }).sum::<i32>()
        };
        let wrong = self.groups().filter(|group| balance(group) != 0);
        let Some((edge, first)) = wrong.min_by_key(|(edge, group)| (group[0].1, *edge)) else { return Ok(()) };
        let [a, b] = edge.map(|v| vertices[v as usize]);
        Err(if first.len() == 1 { MeshFault::Open(a, b) } else { MeshFault::Mixed(a, b) })
    }

    /// Those at which more than two triangles meet.
    pub fn crowded(&self) -> Crowded {
        self.groups().filter(|(_, group)| group.len() > 2).map(|(edge, _)| (edge, ())).collect()
    }

    /// Of each triangle the one beyond each of its sides: of several the last that runs along it the other way.
    pub fn opposite(&self, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let mut out = vec![[NONE; 3]; triangles.len()];
        for (at, group) in self.groups() {
            let last = |up: bool| group.iter().rev().find(|(_, i)| runs_up(triangles[*i as usize], at) == up);
            let last = [false, true].map(|up| last(up).map_or(NONE, |l| l.1));
            for (_, i) in group {
                let t = triangles[*i as usize];
                let k = (0..3).find(|k| edge(t[*k], t[(k + 1) % 3]) == at).unwrap_or(0);
                out[*i as usize][k] = last[usize::from(!runs_up(t, at))];
            }
        }
        out
    }
}

/// Of each triangle the first one of the part of the surface that it is in, by the neighbours of each along its sides. Edges of more
/// than two triangles connect none: what is in front of one of these need not be in front of the others.
pub fn leaders(opposite: &[[u32; 3]], triangles: &[[u32; 3]], crowded: &Crowded) -> Vec<u32> {
    let mut leader: Vec<u32> = (0..opposite.len() as u32).collect();
    fn find(leader: &mut [u32], mut i: u32) -> u32 {
        while leader[i as usize] != i {
            leader[i as usize] = leader[leader[i as usize] as usize];
            i = leader[i as usize];
        }
        i
    }
    let connects = |i: usize, k: usize| {
        let t = triangles[i];
        crowded.is_empty() || !crowded.contains_key(&edge(t[k], t[(k + 1) % 3]))
    };
    for (i, others) in opposite.iter().enumerate() {
        for (_, j) in others.iter().enumerate().filter(|(k, j)| **j != NONE && connects(i, *k)) {
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
fn runs_up(t: [u32; 3], [a, b]: Edge) -> bool {
    (0..3).any(|k| (t[k], t[(k + 1) % 3]) == (a, b))
}
