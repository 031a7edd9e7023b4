//! The answer to a step: records and their further slots, in place.

use contactd_proto::StepReply;
use contactd_proto::contact_record::{ClearanceSlot, ContactRecord, DetailSlot, PatchSlot, RegionSlot};

/// The answer to a step, in place: valid until the session's next call.
#[derive(Clone, Copy, Debug)]
pub struct Reply<'s> {
    header: StepReply,
    slots: &'s [ContactRecord],
}

impl<'s> Reply<'s> {
    /// A reply of slots and their header that were kept, or came by another way than [`Session::finish`](crate::Session::finish).
    pub fn of(header: StepReply, slots: &'s [ContactRecord]) -> Self {
        Self { header, slots }
    }

    /// The header: status, safe time, effects, work.
    pub fn header(&self) -> &StepReply {
        &self.header
    }

    /// Smallest time_lower over all pairs: safe to advance to.
    pub fn safe_time(&self) -> f64 {
        self.header.safe_time
    }

    /// True when `max_records` left records out.
    pub fn truncated(&self) -> bool {
        self.header.truncated != 0
    }

    /// The contact records in the order (time, a, b).
    pub fn records(&self) -> &'s [ContactRecord] {
        &self.slots[..(self.header.records as usize).min(self.slots.len())]
    }

    /// All slots as they lie in memory: the records, then their further slots.
    pub fn slots(&self) -> &'s [ContactRecord] {
        let n = (self.header.records as usize).saturating_add(self.header.slots as usize);
        &self.slots[..n.min(self.slots.len())]
    }

    /// The detail slot of a record, when details were asked for.
    pub fn detail(&self, record: &ContactRecord) -> Option<&'s DetailSlot> {
        self.further(record).find_map(ContactRecord::as_detail)
    }

    /// The least distance of a record's pair over the step, when its rule asks for its clearance.
    pub fn clearance(&self, record: &ContactRecord) -> Option<&'s ClearanceSlot> {
        self.further(record).find_map(ContactRecord::as_clearance)
    }

    /// The patch slots of a record, when its rule reports patches.
    pub fn patches(&self, record: &ContactRecord) -> impl Iterator<Item = &'s PatchSlot> + use<'s> {
        self.further(record).filter_map(ContactRecord::as_patch)
    }

    /// The contact regions of a record in order, each with the slots of the points that bound it, when its rule reports
    /// patches or has a margin.
    pub fn regions(
        &self,
        record: &ContactRecord,
    ) -> impl Iterator<Item = (&'s RegionSlot, impl Iterator<Item = &'s PatchSlot> + use<'s>)> + use<'s> {
        let reply = *self;
        let record = *record;
        self.further(&record).filter_map(ContactRecord::as_region).map(move |region| {
            let number = region.region;
            (region, reply.patches(&record).filter(move |slot| slot.region[0] == number))
        })
    }

    fn further(&self, record: &ContactRecord) -> impl Iterator<Item = &'s ContactRecord> + use<'s> {
        self.slots.iter().skip(record.slot as usize).take(record.slots as usize)
    }
}
