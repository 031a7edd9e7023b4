//! All models of a show as the numbers that the page puts into textures and buffers: cells for those that it marches through,
//! triangles for the others.

use super::cells::{Cells, Unmarched};
use crate::math::Aabb;
use crate::octree::Model;
use crate::tessellation::{self, Triangles};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// Of a solid that is drawn as triangles: 2 to this power cells along each side.
const LEVELS: u32 = 6;

/// A model of a show.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Its name in the scene.
    pub name: String,
    /// What sentences call the text that its lines are counted in.
    pub file: String,
    /// What it is.
    pub model: Arc<Model>,
}

/// The numbers of all models.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    /// Nodes and tokens ([`super::cells`]), all indices counted from the front.
    pub words: Vec<u32>,
    /// Rows of faces.
    pub rows: Vec<[f32; 4]>,
    /// Three corners a triangle: position, model frame, and the id of its face (`u32::MAX`: none).
    pub triangles: Vec<([f32; 3], u32)>,
    /// One for each model, in their order.
    pub pieces: Vec<Piece>,
}

/// Where a model stands among these numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Piece {
    /// Its root, a node.
    pub root: u32,
    /// Middle of the whole cube, then half its side.
    pub cube: [f32; 4],
    /// Its box: both corners, model frame.
    pub low: [f64; 3],
    /// The upper one.
    pub high: [f64; 3],
    /// Its first triangle and how many it has; none of what is marched through.
    pub triangles: [usize; 2],
    /// Where the rows of each face begin and the face's id, ascending: two numbers each, one after the other.
    pub faces: Vec<u32>,
    /// How it is drawn, where that is not exact, as a sentence; else empty.
    pub note: String,
    /// It is endless, and cut off around the scene.
    pub endless: bool,
}

/// What becomes of one model.
enum Made {
    Cells(Box<Cells>),
    Triangles(Triangles, String),
}

impl Buffers {
    /// The numbers of `models`; what is endless is cut off at its box of `extents`, model frame.
    pub fn new(models: &[Shown], extents: &[Aabb]) -> Self {
        let first = |i: usize| models[..i].iter().position(|m| Arc::ptr_eq(&m.model, &models[i].model)).unwrap_or(i);
        let own: Vec<usize> = (0..models.len()).map(first).collect();
        let made: Vec<Option<(Made, Aabb, bool)>> =
            (0..models.len()).into_par_iter().map(|i| (own[i] == i).then(|| make(&models[i], &extents[i]))).collect();
        // Rows begin at 1: a page's 0 is no face.
        let mut all = Self { rows: vec![[0.0; 4]], ..Self::default() };
        for (i, made) in made.into_iter().enumerate() {
            let piece = match made {
                Some((Made::Cells(cells), around, endless)) => Piece { endless, ..all.add_cells(*cells, &around) },
                Some((Made::Triangles(t, note), around, endless)) => {
                    Piece { endless, note, ..all.add_triangles(&t, &around) }
                }
                None => all.pieces[own[i]].clone(),
            };
            all.pieces.push(piece);
        }
        all
    }

    /// How models are drawn where that is not exact, a sentence each.
    pub fn notes(&self) -> impl Iterator<Item = &str> {
        self.pieces.iter().map(|p| p.note.as_str()).filter(|note| !note.is_empty())
    }

    fn add_cells(&mut self, cells: Cells, around: &Aabb) -> Piece {
        let (words, rows) = (self.words.len() as u32, self.rows.len() as u32);
        let root = moved(cells.root, words);
        let mut i = 0;
        // The first word is the root's own; blocks of children and lists follow each other.
        let mut nodes = vec![false; cells.words.len()];
        let mut stack = vec![cells.root];
        while let Some(node) = stack.pop() {
            if node & 3 == 2 {
                let first = (node >> 2) as usize;
                nodes[first..first + 8].fill(true);
                stack.extend(&cells.words[first..first + 8]);
            }
        }
        while i < cells.words.len() {
            let word = cells.words[i];
            if i == 0 || nodes[i] {
                self.words.push(moved(word, words));
                i += 1;
                continue;
            }
            self.words.push(word);
            let list = &cells.words[i + 1..i + 1 + word as usize];
            self.words.extend(list.iter().map(|t| if t >> 30 == 3 { *t } else { t + rows }));
            i += 1 + word as usize;
        }
        self.rows.extend(&cells.rows);
        let (c, half) = cells.cube;
        Piece {
            root,
            cube: [c.x as f32, c.y as f32, c.z as f32, half as f32],
            low: around.min.to_array(),
            high: around.max.to_array(),
            faces: cells.faces.iter().flat_map(|(at, face)| [at + rows, *face]).collect(),
            ..Piece::default()
        }
    }

    fn add_triangles(&mut self, triangles: &Triangles, around: &Aabb) -> Piece {
        let first = self.triangles.len() / 3;
        for (corners, face) in triangles.corners().zip(&triangles.faces) {
            self.triangles.extend(corners.iter().map(|x| (x.as_vec3().to_array(), *face)));
        }
        Piece {
            low: around.min.to_array(),
            high: around.max.to_array(),
            triangles: [first, triangles.indices.len()],
            ..Piece::default()
        }
    }

    /// All words, little-endian.
    pub fn words_bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    /// All rows, little-endian.
    pub fn rows_bytes(&self) -> Vec<u8> {
        self.rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
    }

    /// All corners, little-endian, 16 bytes each.
    pub fn triangles_bytes(&self) -> Vec<u8> {
        let corner = |(x, face): &([f32; 3], u32)| {
            let mut all = [0; 16];
            for (to, from) in all.chunks_exact_mut(4).zip(x.map(f32::to_le_bytes).iter().chain([&face.to_le_bytes()])) {
                to.copy_from_slice(from);
            }
            all
        };
        self.triangles.iter().flat_map(corner).collect()
    }
}

/// A node that tells a place, with that place moved by `by`.
fn moved(node: u32, by: u32) -> u32 {
    if node & 2 == 2 { node + (by << 2) } else { node }
}

fn make(shown: &Shown, extent: &Aabb) -> (Made, Aabb, bool) {
    let solid = &shown.model.solid;
    let own = solid.aabb();
    let endless = !own.is_finite() && !own.is_empty();
    let around = if endless { own.intersection(extent) } else { own };
    if solid.is_empty() || around.is_empty() {
        return (
            Made::Triangles(Triangles::default(), String::new()),
            Aabb::around(glam::DVec3::ZERO, glam::DVec3::ZERO),
            false,
        );
    }
    if let Some(triangles) = tessellation::of_mesh(solid) {
        return (Made::Triangles(triangles, String::new()), around, endless);
    }
    match Cells::new(solid, &around) {
        Ok(cells) => (Made::Cells(Box::new(cells)), around, endless),
        Err(why) => {
            let made = tessellation::of_solid(solid, &around, LEVELS);
            let note = sentence(&shown.file, why, &made);
            (Made::Triangles(made, note), around, endless)
        }
    }
}

fn sentence(file: &str, why: Unmarched, made: &Triangles) -> String {
    let count = made.indices.len();
    let off = crate::terminal::number(made.off, 0.0, 2);
    format!("{file} is drawn as {count} triangles with corners on it, in cells of {off}: {why}.")
}
