//! A peer of the step service: the same numbers through a Unix socket, packed by bincode.

use crate::raw::Waiting;
use bincode::config::{Configuration, standard};
use bincode::{Decode, Encode};
use contactd_proto::PoseRecord;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::Timespec;
use std::io::{Error, ErrorKind, Read as _, Result, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

#[derive(Debug, Encode, Decode)]
struct WirePose {
    object: u32,
    flags: u32,
    position: [f64; 3],
    rotation: [f64; 4],
}

#[derive(Debug, Encode, Decode)]
struct Request {
    step: u64,
    advance: f64,
    dt: f64,
    poses: Vec<WirePose>,
}

/// What the reply's header tells, without records: nothing meets in this benchmark.
#[derive(Debug, Encode, Decode)]
struct Reply {
    step: u64,
    poses: u32,
    safe_time: f64,
    counters: [u64; 10],
}

const FORMAT: Configuration = standard();

/// One end of a connection: messages with their length before them.
pub struct Connection {
    stream: UnixStream,
    waiting: Waiting,
    bytes: Vec<u8>,
    step: u64,
}

impl Connection {
    fn new(stream: UnixStream, waiting: Waiting) -> Result<Self> {
        stream.set_nonblocking(true)?;
        Ok(Self { stream, waiting, bytes: Vec::new(), step: 0 })
    }

    /// Connects to the server at `path`.
    ///
    /// # Errors
    /// Nobody listens.
    pub fn to(path: &Path, waiting: Waiting) -> Result<Self> {
        Self::new(UnixStream::connect(path)?, waiting)
    }

    /// Does what `io` does until it has done so for all of `length` bytes.
    fn all(&mut self, length: usize, out: bool, mut io: impl FnMut(&mut Self, usize) -> Result<usize>) -> Result<()> {
        let (mut done, mut from) = (0, Instant::now());
        while done < length {
            match io(self, done) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(n) => {
                    done += n;
                    from = Instant::now();
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => {
                    let blocking = Waiting { polled: false, ..self.waiting };
                    blocking.turn(from, |most| {
                        let flags = if out { PollFlags::OUT } else { PollFlags::IN };
                        let time = Timespec { tv_sec: 0, tv_nsec: most.as_nanos() as i64 };
                        let _ = poll(&mut [PollFd::new(&self.stream, flags)], Some(&time));
                    });
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }

    fn send(&mut self, message: &impl Encode) -> Result<()> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        bytes.extend([0; 4]);
        bincode::encode_into_std_write(message, &mut bytes, FORMAT).map_err(Error::other)?;
        let length = (bytes.len() - 4) as u32;
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        self.all(bytes.len(), true, |c, done| c.stream.write(&bytes[done..]))?;
        self.bytes = bytes;
        Ok(())
    }

    fn receive<M: Decode<()>>(&mut self) -> Result<M> {
        let mut length = [0; 4];
        self.all(4, false, |c, done| c.stream.read(&mut length[done..]))?;
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.resize(u32::from_le_bytes(length) as usize, 0);
        self.all(bytes.len(), false, |c, done| c.stream.read(&mut bytes[done..]))?;
        let message = bincode::decode_from_slice(&bytes, FORMAT).map_err(Error::other)?.0;
        self.bytes = bytes;
        Ok(message)
    }

    /// Sends the records and waits for the reply.
    ///
    /// # Errors
    /// The connection is gone.
    pub fn step(&mut self, poses: &[PoseRecord]) -> Result<()> {
        self.step += 1;
        let pack =
            |p: &PoseRecord| WirePose { object: p.object, flags: p.flags, position: p.position, rotation: p.rotation };
        let poses = poses.iter().map(pack).collect();
        self.send(&Request { step: self.step, advance: 1.0, dt: 0.0, poses })?;
        let reply: Reply = self.receive()?;
        if reply.step == self.step { Ok(()) } else { Err(Error::other("a reply to another request")) }
    }
}

/// Answers everybody who connects at `path`, each on a thread of its own, for as long as the process lives.
///
/// # Errors
/// The path cannot be bound.
pub fn serve(path: &Path, waiting: Waiting) -> Result<()> {
    let listener = UnixListener::bind(path)?;
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            std::thread::spawn(move || -> Result<()> {
                let mut connection = Connection::new(stream, waiting)?;
                loop {
                    let request: Request = connection.receive()?;
                    let poses = request.poses.len() as u32;
                    connection.send(&Reply { step: request.step, poses, safe_time: 1.0, counters: [0; 10] })?;
                }
            });
        }
    });
    Ok(())
}

/// The longest that a polled side spins after its last work.
pub const POLL: Duration = Duration::from_millis(5);
