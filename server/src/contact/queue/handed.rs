//! What the first two stages have handed over: the primitives whose faces a contact may be solved for.

use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::newton::Constraint;
use std::collections::HashSet;

/// What the first two stages have handed over so far.
#[derive(Debug, Default)]
pub struct Handed {
    pub(super) primitives: [HashSet<u32>; 2],
    /// Everything is known: a whole-primitive shortcut is at work.
    pub(super) all: bool,
    pub(super) candidates: HashSet<(u32, u32)>,
}

impl Handed {
    /// True when the constraint's primitive was handed to stage 3.
    pub fn knows(&self, task: &Task, c: &Constraint) -> bool {
        let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
        let solid = if side == Side::A { task.a } else { task.b };
        self.all || self.primitives[side as usize].contains(&solid.face_owner[id.face() as usize])
    }
}
