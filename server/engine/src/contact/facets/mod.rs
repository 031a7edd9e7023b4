//! In front of the search: a mesh against a convex primitive or another mesh, answered by a proven advance over boxes and facets.
//!
//! Idea: two bodies of which neither is within the other at the start stay apart as long as their surfaces do. The surface of a
//! mesh is its facets, each convex; that of a convex body is told by the body. So two bodies are apart until T where every pair
//! of a facet and the convex body, or of two facets, is kept apart until T by a direction, or both lie in boxes that are (`advance`).
//! What a direction proves is what it proves of two convex bodies (`convex`). So:
//!
//! 1. pairs of boxes wait in a queue, by the time until which they are proven apart, each with the direction that proves it. The
//!    earliest is taken: its larger box is replaced by what is in it, and what the direction that stands does not keep apart to the end
//!    of the step is asked along a few others;
//! 2. a pair of facets is advanced along the line of its nearest points, as two convex bodies are;
//! 3. where these come near, the faces that pass there are solved for a contact (`touch`), and both trees confirm it or it is none.
//!    From then on everything is proven up to the contact alone;
//! 4. when nothing in the queue is earlier, that is the answer.
//!
//! What is met costs what is near it, whatever lies elsewhere, and nothing of the mesh is written as a formula but what the trees are
//! asked at the contact.
//!
//! Where bodies start nearer than a few resolutions, or overlap, nothing is told but that they stay clear. What does not settle is left
//! to the search from the time on until which it is proven free (`Front::Free`).
//!
//! Source: bounding volume hierarchies under motion (S. Redon, A. Kheddar, S. Coquillart, Eurographics 2002); conservative
//! advancement (B. Mirtich, PhD thesis, Berkeley 1996; X. Zhang, M. Lee, Y. J. Kim, The Visual Computer 22, 2006). The proof of a facet
//! against an eroded body stands in `advance`.

mod advance;
mod body;
mod touch;

use crate::contact::query::task::Task;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use advance::Advance;
use body::Body;

/// What is told in front of the search.
// One a question, on the stack.
#[allow(clippy::large_enum_variant)]
pub(super) enum Front {
    /// The answer.
    Ended(Ending),
    /// No point is as deep in both bodies as is asked for before this time, which is after the start.
    Free(f64),
    /// Nothing.
    Open,
}

/// The answer for two solids of which one is a mesh and the other a mesh or a convex primitive.
pub(super) fn answer(contacts: &mut Contacts) -> Front {
    let task = contacts.task;
    if task.delta <= 0.0 || task.ignored_depth > 0.0 || !body::are_asked(&task) {
        return Front::Open;
    }
    answer_of(&task, contacts).unwrap_or(Front::Open)
}

fn answer_of(task: &Task, contacts: &mut Contacts) -> Option<Front> {
    let bodies = Body::both(task)?;
    Some(Advance::new(task, &bodies)?.run(contacts))
}
