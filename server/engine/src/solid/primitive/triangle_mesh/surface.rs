//! A closed surface of triangles with the planes of its facets.

use super::piece::{CUT, Corner, Piece};
use super::planes::NONE;
use super::tree::FacetTree;
use crate::math::Aabb;
use glam::DVec3;
use std::collections::HashMap;
use std::sync::OnceLock;

/// The closed surface of a solid.
#[derive(Debug)]
pub struct Surface {
    /// Its corners.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Planes n·x <= d of its faces.
    pub planes: Vec<(DVec3, f64)>,
    /// Of each triangle its face, or `NONE` of one that is too thin to have a plane.
    pub face_of: Vec<u32>,
    /// The box around it.
    pub around: Aabb,
    /// How near a plane a point is on it, a length.
    pub tolerance: f64,
    /// Boxes over its triangles, once somebody has asked for them.
    pub tree: OnceLock<Option<FacetTree>>,
}

impl Surface {
    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// Some facets as pieces, with their edges by numbers of their own. The three edges of a facet that is too thin to have a plane are
    /// one: its neighbours meet along them.
    pub fn pieces(&self, of: impl Iterator<Item = u32> + Clone) -> Vec<Piece> {
        let mut ids: HashMap<(u32, u32), u32> = HashMap::new();
        let mut id = |a: u32, b: u32| {
            let next = ids.len() as u32;
            *ids.entry((a.min(b), a.max(b))).or_insert(next)
        };
        let sides = |t: [u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
        let edges: Vec<[u32; 3]> =
            of.clone().map(|i| sides(self.triangles[i as usize]).map(|(a, b)| id(a, b))).collect();
        let mut same: Vec<u32> = (0..ids.len() as u32).collect();
        fn find(same: &[u32], mut e: u32) -> u32 {
            while same[e as usize] != e {
                e = same[e as usize];
            }
            e
        }
        for (e, _) in edges.iter().zip(of.clone()).filter(|(_, i)| self.face_of[*i as usize] == NONE) {
            let all = e.map(|e| find(&same, e));
            let least = all.into_iter().min().unwrap_or(CUT);
            all.iter().for_each(|e| same[*e as usize] = least);
        }
        let kept = of.zip(&edges).filter(|(i, _)| self.face_of[*i as usize] != NONE);
        kept.map(|(i, edges)| {
            let at = self.corners(i);
            let corner = |k: usize| Corner { at: at[k], edge: find(&same, edges[k]) };
            Piece { plane: self.face_of[i as usize], corners: [corner(0), corner(1), corner(2)].into_iter().collect() }
        })
        .collect()
    }
}
