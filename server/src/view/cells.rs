//! A solid as numbers that a page's shader marches through: an octree of cubes, each with what is left there of the tree.
//!
//! Idea: what is left of a tree in a small cube is a few faces (`Solid::prune_to_box`), and its sign in that cube is the tree's own.
//! So a ray walks from cube to cube, skips those that are empty, and in each other one goes on by f of its few faces, which is
//! 1-Lipschitz as the whole tree's is: the exact solid, at the price of a few faces a step, however large the tree is. A large mesh
//! below an operation is a few planes in a cube like everything else.
//!
//! # The numbers
//!
//! `words` holds nodes and lists of tokens. A node is one word:
//!
//! | last two bits | the rest |
//! |---|---|
//! | 0 | nothing is there |
//! | 1 | all of it is solid |
//! | 2 | where its eight children stand, the one of (x, y, z) halves at x + 2 y + 4 z |
//! | 3 | where its list stands: its length, then its tokens |
//!
//! Tokens are in postfix order for a machine with a stack of [`STACK`] values. A token that is a literal says what is done with its
//! value (bits 31 and 30): 0 it is pushed, 1 the top becomes the larger of both, 2 the smaller; 3 is no literal: the two topmost
//! values become the larger one (bit 0 clear) or the smaller one. Of a literal bit 29 says that −psi is meant, bits 28 to 26 are
//! its [form](Form), the rest is where its rows begin in `rows`: four numbers each, slope and at, the affine part first.

use crate::math::Aabb;
use crate::solid::local::{self, Expression, Token, Truth};
use crate::solid::surface::{Row, Terms};
use crate::solid::{Sense, Solid};
use glam::DVec3;
use std::collections::{HashMap, VecDeque};

/// Values that a list needs on its stack at most.
pub const STACK: usize = 16;
/// Levels of cubes at most.
const LEVELS: u32 = 8;
/// Literals that a large cube may keep without being halved.
const FEW: usize = 3;
/// Cubes of a model at most; what is left then is drawn as it is.
const MOST: usize = 100_000;
/// By how much of the whole a cube is larger than it is drawn, so that rounding to single precision opens no seam.
const OVERLAP: f64 = 1e-5;
/// The largest place in `rows` that a token can tell.
const ROWS: usize = 1 << 26;

/// How a literal's psi is computed from its rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Form {
    /// The affine part alone: a plane.
    Flat = 0,
    /// |P| of two rows and the affine part.
    Two = 1,
    /// |P| of three rows and the affine part.
    Three = 2,
    /// |P| − |N| of two rows each and the affine part.
    Difference = 3,
    /// Away from an axis (two rows), along it (one), then R and r: a torus.
    Circle = 4,
    /// The same, then h and r: a capsule.
    Segment = 5,
}

/// A solid's cubes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Nodes and lists of tokens.
    pub words: Vec<u32>,
    /// Rows of faces, four numbers each.
    pub rows: Vec<[f32; 4]>,
    /// Where the rows of a face begin, and its id in the solid; ascending.
    pub faces: Vec<(u32, u32)>,
    /// The root, a node.
    pub root: u32,
    /// Middle and half the side of the whole cube, model frame.
    pub cube: (DVec3, f64),
    /// Cubes that have a list.
    pub open: usize,
}

/// Why a solid has no cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unmarched {
    /// A face of a kind without terms.
    #[error("a face of it has no closed form for the page")]
    Form,
    /// Too much is left in too many cubes.
    #[error("it has too many faces close to each other for the page")]
    Crowded,
}

/// A cube that is still to be looked at.
struct Open {
    /// Its node's place in `words`.
    at: usize,
    middle: DVec3,
    half: f64,
    level: u32,
    left: Vec<Token>,
}

struct Builder<'a> {
    solid: &'a Solid,
    cells: Cells,
    known: HashMap<u32, (u32, Form)>,
    /// What single precision may move a point by, a length.
    slack: f64,
}

impl Cells {
    /// The cells of a solid within a finite box.
    ///
    /// # Errors
    /// What of it no cells can hold.
    pub fn new(solid: &Solid, around: &Aabb) -> Result<Self, Unmarched> {
        let half = around.half().max_element().max(1e-9) * (1.0 + 1e-3);
        let middle = around.center();
        let slack = OVERLAP * (half + middle.abs().max_element());
        let cells = Self { words: vec![0], cube: (middle, half), ..Self::default() };
        let mut builder = Builder { solid, cells, known: HashMap::new(), slack };
        let mut queue = VecDeque::new();
        if !solid.is_empty() {
            builder.look(0, (middle, half), 0, &solid.normal_form, &mut queue);
        }
        let mut made = 1;
        while let Some(cube) = queue.pop_front() {
            if made < MOST && builder.is_halved(&cube) {
                made += 8;
                builder.halve(&cube, &mut queue);
            } else {
                builder.keep(&cube)?;
            }
        }
        builder.cells.faces.sort_unstable();
        builder.cells.root = builder.cells.words[0];
        Ok(builder.cells)
    }
}

impl Builder<'_> {
    /// Writes a node that is settled; one that is not goes into the queue.
    fn look(&mut self, at: usize, (middle, half): (DVec3, f64), level: u32, from: &[Token], to: &mut VecDeque<Open>) {
        let region = Aabb::around(middle, DVec3::splat(half + self.slack));
        let mut left = Vec::new();
        match self.solid.prune_to_box(from, &region, (0.0, 0.1 * self.slack), &mut left) {
            Truth::False => self.cells.words[at] = 0,
            Truth::True => self.cells.words[at] = 1,
            Truth::Open => to.push_back(Open { at, middle, half, level, left }),
        }
    }

    fn is_halved(&self, cube: &Open) -> bool {
        // In small cubes more may be left: what is crooked everywhere, as a mesh, would else be halved to the end.
        let few = FEW.max(1 << cube.level.saturating_sub(3));
        let named = local::named(&cube.left).take(few + 1).count();
        // Parts of a mesh must be written out, however far that leads.
        named > few && cube.level < LEVELS || has_parts(&cube.left) && cube.level < LEVELS + 4
    }

    fn halve(&mut self, cube: &Open, queue: &mut VecDeque<Open>) {
        let first = self.cells.words.len();
        self.cells.words[cube.at] = (first as u32) << 2 | 2;
        self.cells.words.resize(first + 8, 0);
        for i in 0..8 {
            let half = 0.5 * cube.half;
            let side = |bit: usize| if i >> bit & 1 == 1 { half } else { -half };
            let middle = cube.middle + DVec3::new(side(0), side(1), side(2));
            self.look(first + i, (middle, half), cube.level + 1, &cube.left, queue);
        }
    }

    /// Writes a cube's list.
    fn keep(&mut self, cube: &Open) -> Result<(), Unmarched> {
        if has_parts(&cube.left) {
            return Err(Unmarched::Crowded);
        }
        let list = self.cells.words.len();
        self.cells.words.push(0);
        let expression = local::first(&cube.left).0;
        if depth(&expression) > STACK {
            return Err(Unmarched::Crowded);
        }
        self.write(&expression, PUSH)?;
        let length = self.cells.words.len() - list - 1;
        if list >= 1 << 30 {
            return Err(Unmarched::Crowded);
        }
        self.cells.words[list] = length as u32;
        self.cells.words[cube.at] = (list as u32) << 2 | 3;
        self.cells.open += 1;
        Ok(())
    }

    /// Writes an expression in postfix order; `join` is what becomes of its value.
    fn write(&mut self, expression: &Expression<'_>, join: u32) -> Result<(), Unmarched> {
        let (body, kind) = match expression {
            Expression::Literal(id) => {
                let (at, form) = self.face(id.face())?;
                let negated = if id.sense() == Sense::Negative { NEGATED } else { 0 };
                self.cells.words.push(join << 30 | negated | (form as u32) << 26 | at);
                return Ok(());
            }
            Expression::And(body) => (*body, LARGER),
            Expression::Or(body) => (*body, SMALLER),
            Expression::Part(_) => return Err(Unmarched::Crowded),
        };
        for (i, operand) in in_order(body).iter().enumerate() {
            self.write(operand, if i == 0 { PUSH } else { kind })?;
        }
        if join != PUSH {
            self.cells.words.push(JOINED << 30 | u32::from(join == SMALLER));
        }
        Ok(())
    }

    /// Where the rows of a face begin, and its form.
    fn face(&mut self, id: u32) -> Result<(u32, Form), Unmarched> {
        if let Some(known) = self.known.get(&id) {
            return Ok(*known);
        }
        let terms = self.solid.faces[id as usize].terms().ok_or(Unmarched::Form)?;
        let (form, rows) = rows_of(&terms).ok_or(Unmarched::Form)?;
        let at = self.cells.rows.len();
        if at + rows.len() > ROWS {
            return Err(Unmarched::Crowded);
        }
        self.cells.rows.extend(rows);
        self.cells.faces.push((at as u32, id));
        self.known.insert(id, (at as u32, form));
        Ok((at as u32, form))
    }
}

/// What becomes of a value.
const PUSH: u32 = 0;
const LARGER: u32 = 1;
const SMALLER: u32 = 2;
const JOINED: u32 = 3;
const NEGATED: u32 = 1 << 29;

fn has_parts(tokens: &[Token]) -> bool {
    local::named(tokens).count() != local::literals(tokens).count()
}

/// The values on the stack that an expression needs, operands in the order of `in_order`.
fn depth(expression: &Expression<'_>) -> usize {
    match expression {
        Expression::Literal(_) | Expression::Part(_) => 1,
        Expression::And(body) | Expression::Or(body) => {
            // A literal joins the top without a place of its own.
            let beside = |(i, o): (usize, &Expression<'_>)| depth(o) + usize::from(i > 0 && !is_literal(o));
            in_order(body).iter().enumerate().map(beside).max().unwrap_or(1)
        }
    }
}

fn is_literal(expression: &Expression<'_>) -> bool {
    matches!(expression, Expression::Literal(_))
}

/// The operands, those that need most values first: the fewest then wait on the stack (A. Ershov, 1958).
fn in_order<'a>(body: &'a [Token]) -> Vec<Expression<'a>> {
    let mut all: Vec<(usize, Expression<'a>)> = local::operands(body).map(|o| (depth(&o), o)).collect();
    all.sort_by_key(|(depth, o)| (is_literal(o), std::cmp::Reverse(*depth)));
    all.into_iter().map(|(_, o)| o).collect()
}

/// A face's form and rows; `None` where there are too many of them.
fn rows_of(terms: &Terms) -> Option<(Form, Vec<[f32; 4]>)> {
    let four = |row: &Row| [row.slope.x as f32, row.slope.y as f32, row.slope.z as f32, row.at as f32];
    let axial = |across: &[Row; 2], along: &Row, sizes: [f64; 2]| {
        vec![[sizes[0] as f32, sizes[1] as f32, 0.0, 0.0], four(&across[0]), four(&across[1]), four(along)]
    };
    Some(match terms {
        Terms::Lengths { plus, minus, rest } => {
            let form = match (plus.len(), minus.len()) {
                (0, 0) => Form::Flat,
                (1 | 2, 0) => Form::Two,
                (3, 0) => Form::Three,
                (1 | 2, 1 | 2) => Form::Difference,
                _ => return None,
            };
            let mut rows = vec![four(rest)];
            rows.extend(plus.iter().map(four));
            // Where a row is missing, zero stands for it.
            if plus.len() == 1 {
                rows.push([0.0; 4]);
            }
            rows.extend(minus.iter().map(four));
            if minus.len() == 1 {
                rows.push([0.0; 4]);
            }
            (form, rows)
        }
        Terms::Circle { across, along, radius, tube } => (Form::Circle, axial(across, along, [*radius, *tube])),
        Terms::Segment { across, along, half, tube } => (Form::Segment, axial(across, along, [*half, *tube])),
    })
}
