//! Is a process still alive? By its pidfd, which the kernel signals at its death and never gives to another process.
//!
//! A process id alone may have been given to a successor, or mean another process in another pid namespace: the time at
//! which the process started must agree, before and after the pidfd is opened. Where it doesn't, there is no watch.

use contactd_proto::names::start_of_process;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use rustix::time::Timespec;

/// A watched process.
#[derive(Debug)]
pub struct ProcessWatch {
    fd: OwnedFd,
}

impl ProcessWatch {
    /// Watches process `pid` that started at `start` (clock ticks since boot); `None` when there is none.
    pub fn of(pid: u32, start: u64) -> Option<Self> {
        let fd = pidfd_open(Pid::from_raw(pid as i32)?, PidfdFlags::empty()).ok()?;
        (start_of_process(pid) == Some(start)).then_some(Self { fd })
    }

    /// True once the process has ended.
    pub fn is_dead(&self) -> bool {
        let mut fds = [PollFd::new(&self.fd, PollFlags::IN)];
        // An interrupted poll says nothing: the next one will.
        matches!(poll(&mut fds, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })), Ok(n) if n > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    #[test]
    fn a_death_is_seen_and_a_wrong_start_is_refused() {
        let mut child = Command::new("cat").stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let start = start_of_process(child.id()).unwrap();
        let watch = ProcessWatch::of(child.id(), start).unwrap();
        assert!(!watch.is_dead());
        assert!(ProcessWatch::of(child.id(), start + 1).is_none());
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(watch.is_dead());
        assert!(ProcessWatch::of(child.id(), start).is_none());
    }
}
