//! Which bodies hang together through closed contacts, and whether such a group may sleep or must wake.
//!
//! A group sleeps when all its bodies have been still for long enough, and wakes as a whole when one has not: so a body
//! that arrives wakes the stack that it touches, in the same moment.

use super::body::Entry;
use super::effects::Sleep;

/// Memory of the groups.
#[derive(Debug, Default)]
pub struct Islands {
    parent: Vec<usize>,
    /// Fewest frames of stillness in the group of each root.
    still: Vec<u32>,
}

impl Islands {
    fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    /// Joins `links`, then puts groups to sleep and wakes others. True when a body woke.
    pub fn update(&mut self, entries: &mut [Entry], links: &[[usize; 2]], sleep: &Sleep) -> bool {
        self.parent.clear();
        self.parent.extend(0..entries.len());
        for [a, b] in links {
            let (a, b) = (self.root(*a), self.root(*b));
            self.parent[a.max(b)] = a.min(b);
        }
        self.still.clear();
        self.still.resize(entries.len(), u32::MAX);
        for (i, e) in entries.iter().enumerate() {
            let root = self.root(i);
            self.still[root] = self.still[root].min(e.still);
        }
        let mut woke = false;
        for i in 0..entries.len() {
            let root = self.root(i);
            let asleep = self.still[root] >= sleep.frames;
            let e = &mut entries[i];
            if e.kind == super::body::BodyKind::Free {
                woke |= e.asleep && !asleep;
                e.set_asleep(asleep);
            }
        }
        woke
    }
}
