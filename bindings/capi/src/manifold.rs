//! Contact manifolds: `contactd_client::manifold` for C. At most four points for each direction of contact, with ids that stay.

use crate::abi::{Pose, Reply};
use crate::error::Failure;
use crate::handle::free;
use crate::raw::{given, place, row};
use contactd_client::manifold::{Manifold as Told, Manifolds as Kept, Point};
use contactd_client::{Error, Reply as Answer};
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

/// A contact point of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ManifoldPoint {
    /// Names the point within its pair, for as long as it lasts.
    pub id: u32,
    /// Which of the pair's groups of one normal it belongs to, from 0.
    pub group: u32,
    /// Half way between the surfaces, world frame.
    pub position: [f64; 3],
    /// Unit normal from a to b, world frame.
    pub normal: [f64; 3],
    /// Distance of the surfaces along the normal: positive apart, negative in penetration.
    pub separation: f64,
    /// The point on a's surface, in a's object frame.
    pub on_a: [f64; 3],
    /// The point on b's surface, in b's object frame.
    pub on_b: [f64; 3],
}

impl From<&Point> for ManifoldPoint {
    fn from(p: &Point) -> Self {
        let [position, normal, on_a, on_b] = [p.position, p.normal, p.on_a, p.on_b].map(|v| v.to_array());
        Self { id: p.id, group: p.group, position, normal, separation: p.separation, on_a, on_b }
    }
}

/// The points of a pair, valid until the next call of contactd_manifolds_update or contactd_manifolds_free.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Manifold {
    /// The object with the smaller id.
    pub a: u32,
    /// The other one.
    pub b: u32,
    /// The record's status: contact, clear or overlap.
    pub status: u32,
    /// 0: the work limit cut the search for regions, there may be more points.
    pub is_complete: u32,
    /// Groups in the order in which they were told, the points of each by id.
    pub points: *const ManifoldPoint,
    /// Number of them.
    pub point_count: usize,
}

/// The points of all pairs, from step to step.
#[derive(Default)]
pub struct Manifolds {
    kept: Kept,
    points: Vec<ManifoldPoint>,
    /// First point of each pair.
    first: Vec<usize>,
    /// Two of each record, checked.
    poses: Vec<contactd_proto::Pose>,
}

impl Manifolds {
    fn update(&mut self, reply: &Answer) {
        self.kept.start();
        for (record, pair) in reply.records().iter().zip(self.poses.chunks_exact(2)) {
            self.kept.add(reply, record, &pair[0], &pair[1]);
        }
        self.kept.finish();
        self.points.clear();
        self.first.clear();
        for pair in self.kept.pairs() {
            self.first.push(self.points.len());
            self.points.extend(pair.points.iter().map(ManifoldPoint::from));
        }
    }

    fn reported(&self, pair: &Told, first: usize) -> Manifold {
        let points = &self.points[first..first + pair.points.len()];
        Manifold {
            a: pair.a,
            b: pair.b,
            status: pair.status.into(),
            is_complete: pair.is_complete.into(),
            points: points.as_ptr(),
            point_count: points.len(),
        }
    }
}

/// A handle.
///
/// # Safety
/// Point 5 of the contract: NULL, or manifolds that were not freed, in no other call.
unsafe fn live<'a>(manifolds: *mut Manifolds) -> Result<&'a mut Manifolds, Failure> {
    // SAFETY: NULL or a live handle, of this call alone.
    unsafe { manifolds.as_mut() }.ok_or_else(|| Failure::null("the manifolds (freed, or never made)"))
}

/// Makes manifolds, without points. Not bound to a session or thread, but used by one thread at a time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_new(manifolds: *mut *mut Manifolds) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        unsafe { place(manifolds, "manifolds")? }.write(Box::into_raw(Box::default()));
        Ok(())
    })
}

/// Frees manifolds and sets `*manifolds` to NULL; one that is NULL already is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_free(manifolds: *mut *mut Manifolds) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        let variable = unsafe { place(manifolds, "manifolds")? };
        // SAFETY: it was set by contactd_manifolds_new, or to NULL.
        let handle = std::mem::replace(variable, MaybeUninit::new(null_mut()));
        // SAFETY: as above.
        let handle = unsafe { handle.assume_init() };
        if !handle.is_null() {
            // SAFETY: it came out of a box in contactd_manifolds_new and was not freed since (5).
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    })
}

/// Takes the answer to a step, once after each step. `poses` are two for each of the reply's records in their order, `count` in all: where
/// a and b stood at the moment that the record tells of: at its time for contact and overlap, at the start of the step for pairs
/// that are clear. (For pairs of detect = "discrete", which are told at their end: there.) Points of the step before keep their ids
/// where they are told again; pairs that are not told are forgotten. The rules need report = patch. When anything is wrong nothing has
/// changed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_update(
    manifolds: *mut Manifolds,
    reply: *const Reply,
    poses: *const Pose,
    count: usize,
) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (5).
        let manifolds = unsafe { live(manifolds)? };
        // SAFETY: the caller's structure (1).
        let reply = unsafe { given(reply, "reply")? };
        // SAFETY: the slots of a reply that is still to be read (1, 4).
        let answer = Answer::of(reply.header, unsafe { row(reply.slots, reply.slot_count, "reply.slots")? });
        // SAFETY: the caller's structures (1).
        let poses = unsafe { row(poses, count, "poses")? };
        let n = answer.records().len();
        if count != 2 * n {
            return Err(Failure::argument(format!(
                "expected {} poses, two for each of {n} records, found {count}",
                2 * n
            )));
        }
        manifolds.poses.clear();
        for (i, pose) in poses.iter().enumerate() {
            let checked = pose.checked().map_err(|code| Failure::from(Error::refused(code)).at(i))?;
            manifolds.poses.push(checked);
        }
        manifolds.update(&answer);
        Ok(())
    })
}

/// Number of pairs that have points.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_count(manifolds: *mut Manifolds, count: *mut usize) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (5).
        let manifolds = unsafe { live(manifolds)? };
        // SAFETY: the caller's variable (1).
        unsafe { place(count, "count")? }.write(manifolds.first.len());
        Ok(())
    })
}

/// A pair by its number from 0, in the order (a, b).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_get(manifolds: *mut Manifolds, index: usize, out: *mut Manifold) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (5).
        let manifolds = unsafe { live(manifolds)? };
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        let Some((pair, first)) = manifolds.kept.pairs().zip(&manifolds.first).nth(index) else {
            return Err(Failure::argument(format!("pair {index}: there are {}", manifolds.first.len())));
        };
        out.write(manifolds.reported(&pair, *first));
        Ok(())
    })
}

/// The pair of objects `a` < `b`; with no points (NULL, 0) when they have none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_manifolds_find(manifolds: *mut Manifolds, a: u32, b: u32, out: *mut Manifold) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (5).
        let manifolds = unsafe { live(manifolds)? };
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        let found = manifolds.kept.pairs().zip(&manifolds.first).find(|(pair, _)| (pair.a, pair.b) == (a, b));
        out.write(match found {
            Some((pair, first)) => manifolds.reported(&pair, *first),
            None => Manifold { a, b, status: 0, is_complete: 1, points: null(), point_count: 0 },
        });
        Ok(())
    })
}
