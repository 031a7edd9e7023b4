//! The one record whose layout never changes: it tells a client of any version whom it talks to.

use crate::{EffectCounters, effects};
use iceoryx2::prelude::ZeroCopySend;

/// What `contactd/status` shows. Fields may be appended in `spare`, never moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct StatusRecord {
    /// Oldest protocol version that is spoken.
    pub version_min: u32,
    /// Newest protocol version that is spoken.
    pub version_max: u32,
    /// Version of iceoryx2: major, minor, patch; all peers need the same.
    pub iceoryx2: [u32; 3],
    /// The server's process id.
    pub pid: u32,
    /// Changes with every start of the server.
    pub epoch: u64,
    /// Sessions that are open.
    pub sessions: u64,
    /// Steps that were answered since the start.
    pub steps: u64,
    /// Largest model text, bytes.
    pub limit_text: u64,
    /// Most records in a batch.
    pub limit_batch: u64,
    /// Most objects in a session.
    pub limit_objects: u64,
    /// Most sessions.
    pub limit_sessions: u64,
    /// How often each effect was worked out since the start, over all sessions.
    pub effects: EffectCounters,
    /// Zero. A new effect's counter takes its place from here.
    pub spare: [u64; 22 - effects::ALL.len()],
}

const _: () = assert!(size_of::<StatusRecord>() == 256);
