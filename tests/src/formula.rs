//! What a primitive is of its faces, as a tree to look at: read here by code of its own.

use contactd::solid::Primitive;

/// An and/or-tree of a primitive's faces, by their places in its list; true: the other side of it.
#[derive(Clone, Debug)]
pub enum Formula {
    /// One face.
    One(u32, bool),
    /// All must hold.
    And(Vec<Formula>),
    /// One must hold.
    Or(Vec<Formula>),
}

/// The formula of a primitive: what its shape says, else all of its faces.
pub fn formula_of(p: &Primitive) -> Formula {
    let Some(formula) = p.shape.formula() else {
        return Formula::And((0..p.faces.len() as u32).map(|f| Formula::One(f, false)).collect());
    };
    read(&formula.tokens()).0
}

/// The first expression of some tokens, and how many it takes.
fn read(tokens: &[u32]) -> (Formula, usize) {
    let (kind, rest) = (tokens[0] >> 30, tokens[0] & 0x3fff_ffff);
    if kind == 0 {
        return (Formula::One(rest & 0x1fff_ffff, rest >> 29 == 1), 1);
    }
    let (mut all, mut at) = (Vec::new(), 1);
    while at < 1 + rest as usize {
        let (one, taken) = read(&tokens[at..]);
        all.push(one);
        at += taken;
    }
    (if kind == 1 { Formula::And(all) } else { Formula::Or(all) }, at)
}
