//! Which faces a contact may be solved for.

use super::newton::Constraint;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use std::collections::HashSet;
use std::hash::{BuildHasherDefault, Hasher};

/// A set of indices, or of pairs of them.
type Indices<T> = HashSet<T, BuildHasherDefault<IndexHasher>>;

/// The primitives that the first two stages have handed over so far.
#[derive(Debug, Default)]
pub struct Handed {
    /// Of A and of B.
    pub primitives: [Indices<u32>; 2],
    /// Pairs of them.
    pub candidates: Indices<(u32, u32)>,
}

/// Hashes indices by multiplication: each pair of primitives is looked up once for every cell that is handed over.
#[derive(Debug, Default)]
pub struct IndexHasher(u64);

impl Hasher for IndexHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u32((*b).into()));
    }

    fn write_u32(&mut self, index: u32) {
        /// 2^64 over the golden ratio: indices that follow each other are spread out (Knuth, The Art of Computer Programming 3, 6.4).
        const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;
        self.0 = (self.0.rotate_left(5) ^ u64::from(index)).wrapping_mul(SPREAD);
    }

    fn finish(&self) -> u64 {
        // The product's upper bits are the mixed ones; a table takes the lower ones.
        self.0.rotate_left(26)
    }
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
