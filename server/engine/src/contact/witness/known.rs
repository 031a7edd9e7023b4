//! Which faces a contact may be solved for.

use super::newton::Constraint;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use std::collections::HashSet;

/// The primitives that the first two stages have handed over so far.
#[derive(Debug, Default)]
pub struct Handed {
    /// Of A and of B.
    pub primitives: [HashSet<u32>; 2],
    /// Pairs of them.
    pub candidates: HashSet<(u32, u32)>,
}

/// Whose faces a contact may be solved for.
#[derive(Clone, Copy, Debug)]
pub enum Known<'h> {
    /// All: the whole trees name what decides.
    All,
    /// Those of the primitives that were handed over: the search has no other source.
    Handed(&'h Handed),
}

impl Known<'_> {
    /// True when the faces of the constraint's primitive may be asked.
    pub fn holds(self, task: &Task, c: &Constraint) -> bool {
        let Known::Handed(handed) = self else { return true };
        let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
        let solid = if side == Side::A { task.a } else { task.b };
        handed.primitives[side as usize].contains(&solid.face_owner[id.face() as usize])
    }
}
