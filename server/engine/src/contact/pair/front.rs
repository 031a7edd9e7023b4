//! In front of the queue: the kernels, one after another, each with a proof of its own for the pairs that it knows.

use crate::contact::ball;
use crate::contact::cavity;
use crate::contact::convex;
use crate::contact::facets::{self, Front};
use crate::contact::queue::clock::Stage;
use crate::contact::queue::scratch::Scratch;
use crate::contact::witness::contacts::Contacts;
use glam::DVec3;

/// What the kernels tell; `along` separates two whole primitives at the start, where that is known (world axes).
pub(super) fn kernels(contacts: &mut Contacts, along: Option<DVec3>, scratch: &mut Scratch) -> Front {
    let task = contacts.task;
    // What has no volume meets nothing.
    if task.a.is_empty() || task.b.is_empty() {
        return Front::Ended(contacts.end());
    }
    let strategies = &task.strategies;
    if strategies.convex
        && let Some(ending) = convex::answer(contacts, along)
    {
        return Front::Ended(ending);
    }
    // Before cavities: it answers in a tenth of their time, or knows soon that it does not.
    if strategies.balls
        && let Some(ending) = ball::answer(contacts)
    {
        return Front::Ended(ending);
    }
    if strategies.cavities
        && let Some(ending) = cavity::answer(contacts)
    {
        return Front::Ended(ending);
    }
    if strategies.facets {
        let front = facets::answer(contacts);
        if !matches!(front, Front::Open) {
            return front;
        }
    }
    // What stage 1 leaves nothing of needs no queue.
    if strategies.region {
        scratch.enter(Stage::Region);
        let region = contacts.region(0.0, 1.0);
        scratch.enter(Stage::Front);
        if region.is_none() {
            return Front::Ended(contacts.end());
        }
    }
    Front::Open
}
