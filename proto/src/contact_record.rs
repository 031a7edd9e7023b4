//! The 128-byte slots of a reply: contact records, and the further slots that they point to.
//!
//! A reply is one slice of slots: first the contact records in the order (time, a, b), then the further slots that were
//! asked for. A contact record names the first of its further slots by its index in the slice. A further slot is the
//! same 128 bytes seen as [`DetailSlot`], [`RegionSlot`], [`PatchSlot`] or [`ClearanceSlot`]; its first word says which.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// `status`: the surfaces meet within the step.
pub const CONTACT: u8 = 1;
/// `status`: they don't.
pub const CLEAR: u8 = 2;
/// `status`: deeper than twice the resolution at the start already.
pub const OVERLAP: u8 = 3;
/// `status`: the work limit ran out; `time_lower` is proven.
pub const UNDECIDED: u8 = 4;

/// The contract's words for `status`, by number.
pub const STATUS_NAMES: [&str; 5] = ["", "contact", "clear", "overlap", "undecided"];
/// The contract's words for `kind`, by number; 0 is "not asked for, or without meaning".
pub const KIND_NAMES: [&str; 7] =
    ["", "face-face", "edge-face", "vertex-face", "edge-edge", "vertex-edge", "vertex-vertex"];
/// The contract's words for `extent`, by number.
pub const EXTENT_NAMES: [&str; 4] = ["", "point", "line", "patch"];

/// `flags`: separation at the start within the touching threshold.
pub const TOUCHING: u8 = 1;
/// `flags`: the time could not be continued back from its witness and equals the upper end of its bracket.
pub const NOT_CONTINUED: u8 = 2;
/// `flags`: a vertex met a vertex, the normal is an average.
pub const AVERAGED_NORMAL: u8 = 4;
/// `flags`: a sensor pair, which never stops a search for the scene's first contact.
pub const SENSOR: u8 = 8;
/// `flags`: the work limit cut the search for contact regions: there may be more, and [`TOUCHING`] may be a mere caution.
pub const REGIONS_INCOMPLETE: u8 = 16;

/// `flags`: clear, but within its margin at the start or during the step; the detail slot says until when it is proven not to. With
/// [`REGIONS_INCOMPLETE`]: it may do so.
pub const WITHIN_MARGIN: u8 = 32;
/// `flags`: the answer speaks of a resolution coarser than the pair's own: rounding or the length of its search left nothing
/// to prove at that. Which one is in the detail slot.
pub const COARSER_RESOLUTION: u8 = 64;

/// `valid`: time and time_lower.
pub const VALID_TIME: u32 = 1;
/// `valid`: point.
pub const VALID_POINT: u32 = 2;
/// `valid`: normal.
pub const VALID_NORMAL: u32 = 4;
/// `valid`: separation.
pub const VALID_SEPARATION: u32 = 8;
/// `valid`: normal_speed.
pub const VALID_NORMAL_SPEED: u32 = 16;
/// `valid`: kind and extent.
pub const VALID_KIND: u32 = 32;
/// `valid`: faces_a and faces_b.
pub const VALID_FACES: u32 = 64;

/// "No face" in `faces_a` and `faces_b`.
pub const NO_FACE: u32 = u32::MAX;

/// The answer for a pair. World frame; times are fractions of the step; the normal points from `a` to `b`; a field
/// whose `valid` bit is clear is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct ContactRecord {
    /// The object with the smaller id.
    pub a: u32,
    /// The other one.
    pub b: u32,
    /// [`CONTACT`], [`CLEAR`], [`OVERLAP`] or [`UNDECIDED`].
    pub status: u8,
    /// Index into [`KIND_NAMES`].
    pub kind: u8,
    /// Index into [`EXTENT_NAMES`].
    pub extent: u8,
    /// [`TOUCHING`], [`NOT_CONTINUED`], [`AVERAGED_NORMAL`], [`SENSOR`], [`REGIONS_INCOMPLETE`], [`WITHIN_MARGIN`],
    /// [`COARSER_RESOLUTION`].
    pub flags: u8,
    /// A bit per field that has meaning.
    pub valid: u32,
    /// Where the surfaces meet.
    pub time: f64,
    /// Proven: nothing deeper than the resolution before it.
    pub time_lower: f64,
    /// Contact point, or a point that proves an overlap: deeper than twice the resolution in both bodies. The deepest one is
    /// in the detail slot, where penetration is asked for.
    pub point: [f64; 3],
    /// Unit normal from a to b.
    pub normal: [f64; 3],
    /// Positive apart, negative = penetration; length. Of an overlap what its point proves of the depth.
    pub separation: f64,
    /// Approach speed along the normal, length per step, positive = approaching.
    pub normal_speed: f64,
    /// Active faces of a, by id within its model; [`NO_FACE`] fills.
    pub faces_a: [u32; 3],
    /// Active faces of b.
    pub faces_b: [u32; 3],
    /// Index of its first further slot within the reply.
    pub slot: u32,
    /// Number of its further slots.
    pub slots: u32,
}

/// First word of a [`DetailSlot`].
pub const DETAIL_SLOT: u32 = 1;
/// First word of a [`PatchSlot`].
pub const PATCH_SLOT: u32 = 2;

/// First word of a [`RegionSlot`].
pub const REGION_SLOT: u32 = 3;

/// First word of a [`ClearanceSlot`].
pub const CLEARANCE_SLOT: u32 = 4;

/// `flags` of a [`ClearanceSlot`]: the bounds are as near to each other as was asked, or as rounding lets them be.
pub const CLEARANCE_SETTLED: u32 = 1;
/// `flags` of a [`ClearanceSlot`]: points were found; without it they are zero.
pub const CLEARANCE_POINTS: u32 = 2;

/// A further slot: the least distance of a pair over the step, where its rule asks for it; the last of its record.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct ClearanceSlot {
    /// [`CLEARANCE_SLOT`].
    pub tag: u32,
    /// [`CLEARANCE_SETTLED`], [`CLEARANCE_POINTS`].
    pub flags: u32,
    /// Proven: at no time of the step are two points of the bodies nearer to each other. A length; infinite where a body is empty.
    pub lower: f64,
    /// Proven: two points of them come as near; 0 where the bodies share a point, infinite where no points were found.
    pub upper: f64,
    /// When they do, fraction of the step.
    pub time: f64,
    /// The point of a and that of b, world frame, at that time.
    pub points: [[f64; 3]; 2],
    /// Faces of a at its point, by id within its model; [`NO_FACE`] fills.
    pub faces_a: [u32; 3],
    /// Faces of b.
    pub faces_b: [u32; 3],
    /// The tolerance that was asked for, a length.
    pub tolerance: f64,
    /// Pairs of parts that were looked at.
    pub cells: u64,
    /// Zero.
    pub spare: u64,
}

/// A further slot: a contact region; the [`PatchSlot`]s with its points follow it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct RegionSlot {
    /// [`REGION_SLOT`].
    pub tag: u32,
    /// Which region of the pair it is, from 0.
    pub region: u32,
    /// Index into [`KIND_NAMES`].
    pub kind: u8,
    /// Index into [`EXTENT_NAMES`].
    pub extent: u8,
    /// Zero.
    pub reserved: [u8; 2],
    /// Number of points that bound it.
    pub points: u32,
    /// Unit normal from a to b, world frame; the mean one of a curved patch.
    pub normal: [f64; 3],
    /// Faces of a that meet there, by id within its model; [`NO_FACE`] fills.
    pub faces_a: [u32; 3],
    /// Faces of b.
    pub faces_b: [u32; 3],
    /// Smallest separation of its points, length.
    pub separation: f64,
    /// Zero.
    pub spare: [u64; 7],
}

/// A further slot: what few callers need of every pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct DetailSlot {
    /// [`DETAIL_SLOT`].
    pub tag: u32,
    /// Zero.
    pub reserved: u32,
    /// A verified witness of the resolution's depth exists then.
    pub time_upper: f64,
    /// The resolution that the answer speaks of, a length; larger than the pair's own with [`COARSER_RESOLUTION`].
    pub resolution: f64,
    /// The contact point in a's object frame; of an overlap whose penetration is asked for the deepest point.
    pub point_a: [f64; 3],
    /// Lower bound of the depth at the start of an overlap; 0 otherwise.
    pub penetration: f64,
    /// Unit direction from a to b along which it was measured.
    pub direction: [f64; 3],
    /// Cells that the pair's search refined.
    pub cells: u64,
    /// Of a pair with a margin: proven farther apart than that until then, if it is clear; 1: for the whole step. 0 without a
    /// margin.
    pub margin_time: f64,
    /// Zero.
    pub spare: [u64; 4],
}

/// A further slot: up to four points of a contact region.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct PatchSlot {
    /// [`PATCH_SLOT`].
    pub tag: u32,
    /// Number of points that are set.
    pub count: u32,
    /// The points, world frame.
    pub points: [[f64; 3]; 4],
    /// Separation at each point.
    pub separations: [f32; 4],
    /// Which region of the pair the points belong to, and a zero.
    pub region: [u32; 2],
}

const _: () = {
    assert!(size_of::<ContactRecord>() == 128 && size_of::<DetailSlot>() == 128 && size_of::<PatchSlot>() == 128);
    assert!(size_of::<ClearanceSlot>() == 128 && std::mem::offset_of!(ClearanceSlot, points) == 32);
    assert!(size_of::<RegionSlot>() == 128 && std::mem::offset_of!(RegionSlot, normal) == 16);
    assert!(std::mem::offset_of!(ContactRecord, status) == 8);
    assert!(std::mem::offset_of!(ContactRecord, valid) == 12);
    assert!(std::mem::offset_of!(ContactRecord, time) == 16);
    assert!(std::mem::offset_of!(ContactRecord, point) == 32);
    assert!(std::mem::offset_of!(ContactRecord, normal) == 56);
    assert!(std::mem::offset_of!(ContactRecord, separation) == 80);
    assert!(std::mem::offset_of!(ContactRecord, faces_a) == 96);
    assert!(std::mem::offset_of!(ContactRecord, faces_b) == 108);
    assert!(std::mem::offset_of!(ContactRecord, slot) == 120);
};

impl ContactRecord {
    /// This slot as a detail slot, if it is one.
    pub fn as_detail(&self) -> Option<&DetailSlot> {
        let slot: &DetailSlot = bytemuck::cast_ref(self);
        (slot.tag == DETAIL_SLOT).then_some(slot)
    }

    /// This slot as a clearance slot, if it is one.
    pub fn as_clearance(&self) -> Option<&ClearanceSlot> {
        let slot: &ClearanceSlot = bytemuck::cast_ref(self);
        (slot.tag == CLEARANCE_SLOT).then_some(slot)
    }

    /// This slot as a region slot, if it is one.
    pub fn as_region(&self) -> Option<&RegionSlot> {
        let slot: &RegionSlot = bytemuck::cast_ref(self);
        (slot.tag == REGION_SLOT).then_some(slot)
    }

    /// This slot as a patch slot, if it is one.
    pub fn as_patch(&self) -> Option<&PatchSlot> {
        let slot: &PatchSlot = bytemuck::cast_ref(self);
        (slot.tag == PATCH_SLOT).then_some(slot)
    }
}

impl From<DetailSlot> for ContactRecord {
    fn from(slot: DetailSlot) -> Self {
        bytemuck::cast(slot)
    }
}

impl From<ClearanceSlot> for ContactRecord {
    fn from(slot: ClearanceSlot) -> Self {
        bytemuck::cast(slot)
    }
}

impl From<RegionSlot> for ContactRecord {
    fn from(slot: RegionSlot) -> Self {
        bytemuck::cast(slot)
    }
}

impl From<PatchSlot> for ContactRecord {
    fn from(slot: PatchSlot) -> Self {
        bytemuck::cast(slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_further_slot_keeps_its_bits_in_a_record() {
        let detail = DetailSlot { tag: DETAIL_SLOT, time_upper: 0.25, cells: 7, ..Default::default() };
        let slot = ContactRecord::from(detail);
        assert_eq!(slot.as_detail(), Some(&detail));
        assert_eq!(slot.as_patch(), None);
        let patch = PatchSlot { tag: PATCH_SLOT, count: 4, points: [[1.0, 2.0, 3.0]; 4], ..Default::default() };
        assert_eq!(ContactRecord::from(patch).as_patch(), Some(&patch));
    }
}
