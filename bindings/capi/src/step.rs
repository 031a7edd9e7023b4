//! Steps: poses in, records out, both in place.

use crate::abi::{Options, Reply};
use crate::error::Failure;
use crate::handle::{Session, State, on};
use crate::raw::{flag, given, place, reserved, seconds};
use contactd_client::{StepOptions, Transport as _};
use contactd_proto::{ClearanceSlot, ContactRecord, DetailSlot, PatchSlot, PoseRecord, RegionSlot};

/// What is asked of the steps to come, as it is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_options(session: *mut Session, options: *mut Options) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(options, "options")? };
        let o = &state.session.options;
        place.write(Options {
            advance: o.advance,
            dt: o.dt,
            first: o.first.into(),
            details: o.details.into(),
            clear: o.clear.into(),
            polling: o.polling.into(),
            max_records: o.max_records,
            cell_limit: o.cell_limit,
            batch_limit: o.batch_limit,
            reserved: 0,
        });
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Sets what is asked of the steps to come: get it, change it, set it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_set_options(session: *mut Session, options: *const Options) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's structure (1).
        let o = unsafe { given(options, "options")? };
        reserved(o.reserved, "options.reserved")?;
        let dt = o.dt;
        if !(dt.is_finite() && dt >= 0.0) {
            return Err(Failure::argument(format!("expected options.dt of 0 seconds or more, found {dt}")));
        }
        state.session.options = StepOptions {
            advance: fraction(o.advance, "options.advance")?,
            dt,
            first: flag(o.first, "options.first")?,
            details: flag(o.details, "options.details")?,
            clear: flag(o.clear, "options.clear")?,
            polling: flag(o.polling, "options.polling")?,
            max_records: o.max_records,
            cell_limit: o.cell_limit,
            batch_limit: o.batch_limit,
        };
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A fraction of a step.
fn fraction(value: f64, what: &str) -> Result<f64, Failure> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(Failure::argument(format!("expected {what} of 0 to 1, found {value}")))
}

/// Sets the option `advance` alone: the fraction 0..1 of its previous step at which every object stands before the next one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_set_advance(session: *mut Session, advance: f64) -> i32 {
    let call = |state: &mut State| {
        state.session.options.advance = fraction(advance, "advance")?;
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// `*poses` are slots for `count` poses, all zero, to be filled in place; objects that are not named rest. A batch that was begun
/// and not sent is dropped, and so are the records of the last reply.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_begin_step(session: *mut Session, count: usize, poses: *mut *mut PoseRecord) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let poses = unsafe { place(poses, "poses")? };
        let slots = state.session.begin_step(count)?;
        state.records = None;
        poses.write(slots.as_mut_ptr());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Sends the batch without waiting; contactd_finish does it too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_send(session: *mut Session) -> i32 {
    let call = |state: &mut State| Ok(state.session.send()?);
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Sends the batch if it was not yet, and waits up to `timeout` seconds for its answer. A batch that is refused has changed
/// nothing; contactd_error_index names its offending record. After CONTACTD_ERROR_TIMEOUT the step stays in flight: call again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_finish(session: *mut Session, timeout: f64, reply: *mut Reply) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(reply, "reply")? };
        let reply = state.session.finish(seconds(timeout, "a timeout")?)?;
        state.records = Some(reply.records().len());
        place.write(Reply::of(&reply));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// After contactd_reconnect: the batch that was in flight when the server was lost, begun again with the same poses. It can be
/// had until a batch is accepted.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_resend(session: *mut Session, poses: *mut *mut PoseRecord, count: *mut usize) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variables (1).
        let (poses, count) = unsafe { (place(poses, "poses")?, place(count, "count")?) };
        let slots = state.session.resend()?;
        state.records = None;
        count.write(slots.len());
        poses.write(slots.as_mut_ptr());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The detail slot of record number `record` of the last reply, in place; `*slot` is NULL when details were not asked for.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_detail(
    session: *mut Session,
    record: usize,
    slot: *mut *const DetailSlot,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(slot, "slot")? };
        let detail = state.further(record)?.iter().find_map(ContactRecord::as_detail);
        place.write(detail.map_or(std::ptr::null(), |slot| slot));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The least distance over the step of the pair of record number `record` of the last reply, in place; `*slot` is NULL where its rule
/// does not ask for its clearance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_clearance(
    session: *mut Session,
    record: usize,
    slot: *mut *const ClearanceSlot,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(slot, "slot")? };
        let clearance = state.further(record)?.iter().find_map(ContactRecord::as_clearance);
        place.write(clearance.map_or(std::ptr::null(), |slot| slot));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Number of contact regions of record number `record` of the last reply: told when its rule reports patches or has a margin.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_count_regions(session: *mut Session, record: usize, count: *mut u32) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(count, "count")? };
        place.write(state.further(record)?.iter().filter_map(ContactRecord::as_region).count() as u32);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A contact region of record number `record` of the last reply, by its number from 0, and the `*patch_count` slots with the
/// points that bound it, in place.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_region(
    session: *mut Session,
    record: usize,
    region: u32,
    slot: *mut *const RegionSlot,
    patches: *mut *const PatchSlot,
    patch_count: *mut usize,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variables (1).
        let (slot, patches) = unsafe { (place(slot, "slot")?, place(patches, "patches")?) };
        // SAFETY: the caller's variable (1).
        let patch_count = unsafe { place(patch_count, "patch_count")? };
        let further = state.further(record)?;
        let regions = further.iter().enumerate().filter_map(|(i, slot)| Some((i, slot.as_region()?)));
        let Some((at, found)) = regions.clone().nth(region as usize) else {
            let n = regions.count();
            return Err(Failure::argument(format!("region {region} of record {record}: there are {n}")));
        };
        // A region's points follow it.
        let behind = &further[at + 1..];
        let n = behind.iter().take_while(|slot| slot.as_patch().is_some()).count();
        let points: &[PatchSlot] = bytemuck::cast_slice(&behind[..n]);
        slot.write(found);
        patches.write(points.as_ptr());
        patch_count.write(points.len());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

impl State {
    /// The further slots of a record of the last reply.
    fn further(&mut self, record: usize) -> Result<&[ContactRecord], Failure> {
        let gone = || Failure::misuse("there is no reply whose records could be read: finish a step first");
        let n = self.records.ok_or_else(gone)?;
        let (_, slots) = self.session.transport_mut().reply().ok_or_else(gone)?;
        let Some(found) = slots.get(record).filter(|_| record < n) else {
            return Err(Failure::argument(format!("record {record}: there are {n}")));
        };
        // Shared memory: what lies there bounds nothing.
        let rest = slots.get(found.slot as usize..).unwrap_or_default();
        Ok(&rest[..(found.slots as usize).min(rest.len())])
    }
}
