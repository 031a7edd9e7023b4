//! Moments in closed form: primitives, and trees in which primitives provably keep clear of each other.
//!
//! Of a primitive around the middle of its own frame (`Geometry::moments`), h its height, V its volume. All follow from discs
//! across the axis: one of radius ρ has ∫ 1 = πρ² and ∫ x² = ∫ y² = πρ⁴/4; the frustum's have ρ = a + (b − a) s, 0 <= s <= 1.
//!
//! | primitive | V | ∫ x², ∫ y² | ∫ z² | ∫ z |
//! |---|---|---|---|---|
//! | sphere | 4πr³/3 | Vr²/5 | Vr²/5 | 0 |
//! | cylinder | πr²h | Vr²/4 | Vh²/12 | 0 |
//! | cone, frustum | πh(a² + ab + b²)/3 | πh(a⁴ + a³b + a²b² + ab³ + b⁴)/20 | πh³(a² + 3ab + 6b²)/30 | πh²(a² + 2ab + 3b²)/12 |
//! | box | 8 e₁e₂e₃ | V eₖ²/3 | V e₃²/3 | 0 |
//! | polyhedron | signed tetrahedra (`cell`) | | | |
//! | mesh | signed tetrahedra of its triangles | | | |
//!
//! The frustum's last two are about its bottom disc, radius a. A frame turns ∫ xxᵀ into R ∫ xxᵀ Rᵀ and moves it by the
//! parallel-axis theorem.
//!
//! A union is the sum of its operands where their boxes are apart; a difference subtracts operands that are apart from each
//! other and whose boxes lie inside the first, a convex primitive, with all eight corners. An intersection has a closed form where
//! the solid's maker knows one (`Measured`): an extruded outline of very many corners is its surface's signed tetrahedra.

use super::voxel::Evaluator;
use crate::math::Aabb;
use crate::math::moments::{Moments, PAIRS};
use crate::math::tolerance::BOX_ROUNDING;
use crate::octree::span::{face_span, primitive_span, rounding};
use crate::solid::write_node;
use crate::solid::{Face, Node, NodeId, Op, Primitive, Sense, Solid};
use contactd_proto::Pose;
use glam::{DMat3, DVec3};

/// Rounding of a primitive's moments, as a fraction of its volume times its extents: some thirty products and sums in the
/// formulas, the rotation and the shift.
const FORMULA_ROUNDING: f64 = 128.0 * f64::EPSILON;

/// Operands beyond which nobody looks whether they are apart: the test is quadratic.
const MOST_OPERANDS: usize = 256;

/// Planes beyond which a polyhedron is not cut out of one box.
const MOST_PLANES: usize = 128;

/// Polyhedra are given to nine digits or more; the box that they are cut from is so much larger.
const LOOSE: f64 = 1e-6;

/// Moments about `origin` of what is below `node`, and the bound of the volume's error, which times the extents bounds
/// that of the others; `None` where no closed form is known to hold.
pub fn moments(solid: &Solid, node: NodeId, origin: DVec3) -> Option<(Moments, f64)> {
    if let Some(known) = solid.measured(node) {
        let doubt = known.doubt + FORMULA_ROUNDING * known.moments.volume().abs();
        return Some((known.moments.moved(known.about - origin), doubt));
    }
    match &solid.nodes[node as usize] {
        Node::Empty => Some((Moments::default(), 0.0)),
        Node::Primitive(p) => of_primitive(solid, node, &solid.primitives[*p as usize], origin),
        Node::Op(Op::Intersection, _) => None,
        Node::Op(op, children) => {
            let boxes: Vec<Aabb> = children.iter().map(|c| around(solid, *c)).collect::<Option<_>>()?;
            let from = usize::from(*op == Op::Difference);
            let inside = |b: &Aabb| match &solid.nodes[children[0] as usize] {
                Node::Primitive(p) => holds(&solid.primitives[*p as usize], b),
                _ => false,
            };
            if !apart(&boxes[from..]) || !boxes[1..].iter().all(|b| from == 0 || inside(b)) {
                return None;
            }
            let (mut sum, mut error) = (Moments::default(), 0.0);
            for (i, child) in children.iter().enumerate() {
                let (part, part_error) = moments(solid, *child, origin)?;
                let sign = if i < from || from == 0 { 1.0 } else { -1.0 };
                sum.add(&part.mean(&Moments::default(), sign));
                error += part_error + FORMULA_ROUNDING * part.volume();
            }
            Some((sum, error))
        }
    }
}

/// A box that holds a node, rounding included.
fn around(solid: &Solid, node: NodeId) -> Option<Aabb> {
    let found = match &solid.nodes[node as usize] {
        Node::Empty => Aabb::EMPTY,
        Node::Primitive(p) => solid.primitives[*p as usize].aabb,
        // What is measured is in the box of what of it has an end.
        Node::Op(Op::Intersection, children) => {
            let each = children.iter().filter_map(|c| around(solid, *c));
            each.fold(Aabb::ALL, |all, b| all.intersection(&b))
        }
        Node::Op(Op::Difference, children) => return around(solid, *children.first()?),
        Node::Op(Op::Union, children) => {
            let each = children.iter().map(|c| around(solid, *c));
            each.collect::<Option<Vec<_>>>()?.iter().fold(Aabb::EMPTY, |all, b| all.union(b))
        }
    };
    let size = if found.is_finite() { found.min.abs().max(found.max.abs()).max_element() } else { 0.0 };
    // A polyhedron's corners may lie a ROUNDING of its size off its planes: a thousandth of that margin would do.
    Some(found.grown(1e5 * BOX_ROUNDING * size))
}

fn apart(boxes: &[Aabb]) -> bool {
    boxes.len() <= MOST_OPERANDS
        && (0..boxes.len()).all(|i| boxes[i].is_empty() || boxes[..i].iter().all(|b| !b.meets(&boxes[i])))
}

/// True when a primitive holds a box: of a convex face its corners tell.
fn holds(p: &Primitive, b: &Aabb) -> bool {
    if p.shape.formula().is_some() {
        return b.is_empty() || b.is_finite() && primitive_span(p, b.center(), b.half()).1 < 0.0;
    }
    b.is_empty()
        || b.is_finite()
            && p.faces.listed().iter().all(|f| {
                if f.is_convex() {
                    b.corners().iter().all(|x| f.value(*x) < -rounding(f, *x, DVec3::ZERO))
                } else {
                    face_span(f, b.center(), b.half()).1 < 0.0
                }
            })
}

fn of_primitive(solid: &Solid, node: NodeId, p: &Primitive, origin: DVec3) -> Option<(Moments, f64)> {
    let Some(own) = p.shape.geometry().moments() else {
        let is_polyhedron = p.aabb.is_finite() && p.faces.listed().iter().all(Face::is_flat);
        return if is_polyhedron { of_polyhedron(solid, node, p, origin) } else { None };
    };
    let doubt = FORMULA_ROUNDING * own.volume() + p.shape.geometry().moments_doubt();
    Some((placed(&own, &p.frame, origin), doubt))
}

/// A body's moments about a point of the parent of `frame`. One shift: there and back again would cancel.
fn placed(own: &Moments, frame: &Pose, origin: DVec3) -> Moments {
    let turn = frame.matrix();
    let mut second = [[0.0; 3]; 3];
    for (k, (i, j)) in PAIRS.into_iter().enumerate() {
        (second[i][j], second[j][i]) = (own.0[4 + k], own.0[4 + k]);
    }
    let turned = (turn * DMat3::from_cols_array_2d(&second) * turn.transpose()).to_cols_array_2d();
    let first = turn * own.first();
    let mut out = Moments([own.volume(), first.x, first.y, first.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for (k, (i, j)) in PAIRS.into_iter().enumerate() {
        out.0[4 + k] = turned[i][j];
    }
    out.moved(frame.position - origin)
}

/// Its planes cut out of a box around it: they are what the polyhedron is, its corners follow from them. One of very many
/// faces is left to the subdivision, whose boxes have few of them each.
fn of_polyhedron(solid: &Solid, node: NodeId, p: &Primitive, origin: DVec3) -> Option<(Moments, f64)> {
    if p.faces.len() > MOST_PLANES {
        return None;
    }
    let region = p.aabb.grown(LOOSE * p.aabb.half().length());
    let mut tokens = vec![];
    write_node(solid, node, Sense::Positive, &|_| true, &mut tokens);
    let voxel = Evaluator::unlimited(solid).voxel(region, &tokens);
    Some((voxel.moments.moved(region.center() - origin), voxel.error))
}
