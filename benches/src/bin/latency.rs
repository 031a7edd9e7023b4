//! `latency`: a step through shared memory and back, between two processes, against the bare transport and a socket.
//!
//! The server process holds contactd, an iceoryx2 request-response service of the same records and headers without an
//! engine, and a Unix socket with bincode. One mode of waiting after the other, each with a server process of its own;
//! within it blocks of the three alternate, and the ratio is the median of those of neighbouring blocks' medians. Between
//! blocks all is quiet until the last server has gone to sleep, so that one contestant never spins on another's core. The
//! objects are spheres far apart: what is measured is the step's way, not its geometry.
//!
//! polled: both sides poll; spin: 30 µs of polling, then block; blocked: they block at once. contactd's server gives up
//! polling while itself and the sessions that have asked lately have no core each, so with four clients it blocks. Times are what the
//! client sees, writing the records included.
//!
//! The second table: a client alone, and beside one that has sent a step and reads neither its reply nor anything else; blocks of the
//! two in turn. The third: a client alone, and beside one whose every pair is hard and which asks for one step after the other.

use clap::{Parser, ValueEnum};
use contactd::ipc::{Server, ServerConfig};
use contactd_benches::options::Options;
use contactd_benches::race::{median, quantile};
use contactd_benches::raw::{CLIENTS, RawClient, RawServer, Waiting};
use contactd_benches::row;
use contactd_benches::socket::{self, Connection, POLL};
use contactd_benches::table::Table;
use contactd_client::{Object, Session, SharedMemory};
use contactd_proto::names::Address;
use contactd_proto::{Pose, PoseRecord, Rule};
use glam::DVec3;
use hdrhistogram::Histogram;
use std::error::Error;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Barrier};
use std::time::{Duration, Instant};

type Failure = Box<dyn Error + Send + Sync>;

#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    common: Options,
    /// The server process of a run: started by the benchmark itself.
    #[arg(long, hide = true, num_args = 2, value_names = ["DIR", "MODE"])]
    serve: Option<Vec<String>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Mode {
    Polled,
    Spin,
    Blocked,
}

impl Mode {
    fn waiting(self) -> Waiting {
        let spin = match self {
            Mode::Polled => POLL,
            Mode::Spin => Duration::from_micros(30),
            Mode::Blocked => Duration::ZERO,
        };
        Waiting { spin, polled: self == Mode::Polled }
    }

    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

fn addresses(dir: &Path) -> Result<[Address; 2], Failure> {
    Ok([Address::under(dir, "own")?, Address::under(dir, "raw")?])
}

/// The server process: everything runs until its standard input ends.
fn serve(dir: &Path, mode: Mode) -> Result<(), Failure> {
    let waiting = mode.waiting();
    let [own, raw] = addresses(dir)?;
    let stop = Arc::new(AtomicBool::new(false));
    let config = ServerConfig { spin_us: waiting.spin.as_micros() as u64, ..ServerConfig::default() };
    let mut server = Server::start(&own, config)?;
    socket::serve(&dir.join("socket"), waiting)?;
    let (ready, created) = std::sync::mpsc::channel();
    let raw_stop = stop.clone();
    let raw = std::thread::spawn(move || match RawServer::new(&raw) {
        Ok(server) => {
            let _ = ready.send(Ok(()));
            server.run(waiting, &raw_stop);
        }
        Err(e) => drop(ready.send(Err(e))),
    });
    created.recv()??;
    let end = stop.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        end.store(true, Ordering::Relaxed);
    });
    println!("ready");
    std::io::stdout().flush()?;
    server.run(&stop);
    raw.join().map_err(|_| "the raw server panicked".into())
}

/// The server process, ended when dropped; its folder goes with it.
struct Process {
    child: Child,
    dir: PathBuf,
}

impl Process {
    fn start(mode: Mode) -> Result<Self, Failure> {
        let dir = std::env::temp_dir().join(format!("ctdb-{}-{}", std::process::id(), mode.name()));
        std::fs::create_dir_all(&dir)?;
        std::fs::set_permissions(&dir, std::os::unix::fs::PermissionsExt::from_mode(0o700))?;
        let child = Command::new(std::env::current_exe()?)
            .arg("--serve")
            .args([dir.as_os_str(), mode.name().as_ref()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut process = Self { child, dir };
        let mut line = String::new();
        if let Some(out) = process.child.stdout.take() {
            BufReader::new(out).read_line(&mut line)?;
        }
        if line.trim() == "ready" { Ok(process) } else { Err("the server process did not become ready".into()) }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let until = Instant::now() + Duration::from_secs(10);
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

/// One client's three ways to its servers, and the batches that it sends in turn.
struct Client {
    session: Session<SharedMemory>,
    raw: RawClient,
    socket: Connection,
    batches: [Vec<PoseRecord>; 2],
    step: usize,
}

impl Client {
    fn new(dir: &Path, number: usize, waiting: Waiting, poses: usize) -> Result<Self, Failure> {
        let [own, raw] = addresses(dir)?;
        let mut session = Session::connect_to(own)?;
        session.options.polling = waiting.polled;
        let ball = session.load_model("ball.csg", "sphere(r = 0.5);")?.id;
        let side = (poses as f64).cbrt().ceil().max(1.0) as usize;
        let place = |i: usize, k: usize| {
            let cell = DVec3::new((i % side) as f64, (i / side % side) as f64, (i / side / side) as f64);
            Pose::at(10.0 * cell + DVec3::X * 0.1 * k as f64)
        };
        let mut ids = Vec::with_capacity(poses);
        for i in 0..poses {
            ids.push(session.add_object(Object::new("ball", ball).at(place(i, 0)))?);
        }
        let batch = |k| ids.iter().enumerate().map(|(i, id)| PoseRecord::end(*id, &place(i, k))).collect();
        let batches = [batch(1), batch(0)];
        let raw = RawClient::new(&raw, number, waiting)?;
        let socket = Connection::to(&dir.join("socket"), waiting)?;
        Ok(Self { session, raw, socket, batches, step: 0 })
    }

    /// One step by contestant 0 (contactd), 1 (raw) or 2 (socket).
    fn step(&mut self, way: usize) -> Result<(), Failure> {
        let batch = &self.batches[self.step % 2];
        match way {
            0 => {
                self.session.begin_step(batch.len())?.copy_from_slice(batch);
                let reply = self.session.finish(Duration::from_secs(60))?;
                assert!(reply.records().is_empty(), "the objects are far apart");
                self.step += 1;
            }
            1 => self.raw.step(batch)?,
            _ => self.socket.step(batch)?,
        }
        Ok(())
    }

    /// Nanoseconds of each of `count` steps of a contestant; the first tenth wakes everybody and does not count.
    fn block(&mut self, way: usize, count: usize) -> Result<Vec<u64>, Failure> {
        let mut times = Vec::with_capacity(count);
        for k in 0..count + count.div_ceil(10) {
            let from = Instant::now();
            self.step(way)?;
            if k >= count.div_ceil(10) {
                times.push(from.elapsed().as_nanos() as u64);
            }
        }
        Ok(times)
    }
}

/// Times of each of the three, block by block.
type Blocks = [Vec<Vec<u64>>; 3];

fn measure(
    dir: &Path,
    mode: Mode,
    clients: usize,
    poses: usize,
    blocks: usize,
    count: usize,
) -> Result<Blocks, Failure> {
    let waiting = mode.waiting();
    let barrier = Barrier::new(clients);
    let client = |number: usize| -> Result<Blocks, Failure> {
        let client = Client::new(dir, number, waiting, poses);
        // Everybody or nobody: a client that failed would leave the others waiting.
        barrier.wait();
        let mut client = client?;
        let mut found = Blocks::default();
        for block in 0..blocks {
            for turn in 0..3 {
                let way = (block + turn) % 3;
                std::thread::sleep(waiting.spin * 2 + Duration::from_millis(1));
                found[way].push(client.block(way, count)?);
            }
        }
        client.session.close()?;
        Ok(found)
    };
    std::thread::scope(|scope| {
        let client = &client;
        let threads: Vec<_> = (0..clients).map(|k| scope.spawn(move || client(k))).collect();
        let mut all = Blocks::default();
        for thread in threads {
            let found = thread.join().map_err(|_| "a client panicked")??;
            for (to, from) in all.iter_mut().zip(found) {
                if to.is_empty() {
                    *to = from;
                } else {
                    to.iter_mut().zip(from).for_each(|(to, from)| to.extend(from));
                }
            }
        }
        Ok(all)
    })
}

/// Objects of a client beside one that stopped reading.
const BESIDE: usize = 16;

/// Times of a client's steps alone, and beside a client that stopped reading, block by block.
fn beside_one_that_stopped(dir: &Path, mode: Mode, blocks: usize, count: usize) -> Result<[Vec<Vec<u64>>; 2], Failure> {
    let mut client = Client::new(dir, 0, mode.waiting(), BESIDE)?;
    let mut found = [Vec::new(), Vec::new()];
    // Until the server knows who asks no more; the same before either block.
    let settle = || std::thread::sleep(Duration::from_millis(300));
    for _ in 0..blocks {
        settle();
        found[0].push(client.block(0, count)?);
        let mut other = Client::new(dir, 1, mode.waiting(), BESIDE)?;
        other.session.begin_step(BESIDE)?.copy_from_slice(&other.batches[0]);
        other.session.send()?;
        settle();
        found[1].push(client.block(0, count)?);
        other.session.finish(Duration::from_secs(10))?;
        other.session.close()?;
    }
    client.session.close()?;
    Ok(found)
}

/// A body whose overlaps are searched for their deepest points by thousands of cells each.
const LUMP: &str = "union() {
    cube(size = [4, 3, 2], center = true);
    multmatrix([[1, 0, 0, 1.3], [0, 0.8, -0.6, 0.7], [0, 0.6, 0.8, 0.2], [0, 0, 0, 1]]) {
        cylinder($fn = 0, h = 5, r1 = 1.4, r2 = 0.3, center = true);
    }
    difference() { sphere($fn = 0, r = 2.2); cylinder($fn = 0, h = 9, r1 = 0.9, r2 = 0.9, center = true); }
}";
/// How many of them stand in each other.
const LUMPS: usize = 16;

/// A client that asks for hard steps until it is told to stop; `begun` is set once the first one is under way for a while.
fn hard_client(dir: &Path, begun: &AtomicBool, stop: &AtomicBool) -> Result<usize, Failure> {
    let mut session = Session::connect_to(addresses(dir)?[0].clone())?;
    let lump = session.load_model("lump.csg", LUMP)?.id;
    let mut ids = Vec::new();
    for _ in 0..LUMPS {
        ids.push(session.add_object(Object::new("lump", lump).group("lumps"))?);
    }
    session.set_rules(&[Rule { penetration: true, ..Rule::new(["lumps".into(), "lumps".into()]) }])?;
    let mut steps = 0;
    while !stop.load(Ordering::Relaxed) {
        for (i, record) in session.begin_step(LUMPS)?.iter_mut().enumerate() {
            // Never the same question twice: nothing is remembered of it.
            let at = DVec3::new(0.1 * i as f64, 0.07 * (i * i % 7) as f64, 1e-3 * (steps % 100) as f64);
            *record = PoseRecord::start(ids[i], &Pose::at(at));
        }
        session.send()?;
        begun.store(true, Ordering::Relaxed);
        session.finish(Duration::from_secs(600))?;
        steps += 1;
    }
    session.close()?;
    Ok(steps)
}

/// Times of a client's steps alone, and beside a client whose every pair is hard, block by block; and the steps of that one.
fn beside_a_hard_one(
    dir: &Path,
    mode: Mode,
    blocks: usize,
    count: usize,
) -> Result<([Vec<Vec<u64>>; 2], usize), Failure> {
    let mut client = Client::new(dir, 0, mode.waiting(), BESIDE)?;
    let (mut found, mut steps) = ([Vec::new(), Vec::new()], 0);
    let settle = || std::thread::sleep(Duration::from_millis(300));
    for _ in 0..blocks {
        settle();
        found[0].push(client.block(0, count)?);
        let (begun, stop) = (AtomicBool::new(false), AtomicBool::new(false));
        steps += std::thread::scope(|scope| {
            let hard = scope.spawn(|| hard_client(dir, &begun, &stop));
            while !begun.load(Ordering::Relaxed) && !hard.is_finished() {
                std::thread::sleep(Duration::from_millis(1));
            }
            settle();
            let times = client.block(0, count);
            stop.store(true, Ordering::Relaxed);
            let steps = hard.join().map_err(|_| "the hard client panicked")??;
            found[1].push(times?);
            Ok::<usize, Failure>(steps)
        })?;
    }
    client.session.close()?;
    Ok((found, steps))
}

fn run(options: &Options) -> Result<(), Failure> {
    let header = [
        "mode",
        "poses",
        "steps",
        "alone_p50_us",
        "alone_p99",
        "beside_p50_us",
        "beside_p99",
        "ratio_p50",
        "ratio_p99",
    ];
    let (mut stopped, mut hard) = (Table::new(&header), Table::new(&header));
    let mut hard_steps = 0;
    let mut table = Table::new(&[
        "mode",
        "clients",
        "poses",
        "steps",
        "own_p50_us",
        "own_p99",
        "own_p999",
        "own_max",
        "raw_p50_us",
        "raw_p99",
        "raw_p999",
        "raw_max",
        "socket_p50_us",
        "socket_p99",
        "socket_p999",
        "socket_max",
        "ratio_raw",
        "ratio_socket",
    ]);
    let sizes: &[usize] = options.pick(&[0, 1, 16, 256, 4_096, 65_536], &[0, 16, 256]);
    let shared: &[usize] = options.pick(&[1, 16, 256, 4_096], &[16]);
    let blocks = options.pick(21, 3);
    for mode in [Mode::Polled, Mode::Spin, Mode::Blocked] {
        let process = Process::start(mode)?;
        let rows = sizes.iter().map(|n| (1, *n)).chain(shared.iter().map(|n| (CLIENTS, *n)));
        for (clients, poses) in rows {
            let count = (options.pick(200_000, 20_000) / (poses + 100)).clamp(5, options.pick(1_000, 100));
            let times = measure(&process.dir, mode, clients, poses, blocks, count)?;
            let mut cells = row![mode.name(), clients, poses, blocks * count * clients];
            for way in &times {
                // Up to ten minutes, three digits.
                let mut histogram = Histogram::<u64>::new_with_max(600_000_000_000, 3)?;
                way.iter().flatten().for_each(|t| histogram.saturating_record(*t));
                let micros = |ns: u64| ns as f64 / 1e3;
                cells.extend([0.5, 0.99, 0.999].map(|q| micros(histogram.value_at_quantile(q)).into()));
                cells.push(micros(histogram.max()).into());
            }
            let middle = |block: &Vec<u64>| median(block.iter().map(|t| *t as f64));
            for other in [1, 2] {
                let ratios = times[0].iter().zip(&times[other]).map(|(own, peer)| middle(own) / middle(peer));
                cells.push(median(ratios).into());
            }
            table.push(cells);
        }
        let count = options.pick(5_000, 250);
        let of = |block: &Vec<u64>, q: f64| quantile(block.iter().map(|t| *t as f64), q);
        let compared = |times: [Vec<Vec<u64>>; 2]| {
            let micros = |which: usize, q: f64| median(times[which].iter().map(|block| 1e-3 * of(block, q)));
            let ratio =
                |q: f64| median(times[0].iter().zip(&times[1]).map(|(alone, beside)| of(beside, q) / of(alone, q)));
            row![
                mode.name(),
                BESIDE,
                blocks * count,
                micros(0, 0.5),
                micros(0, 0.99),
                micros(1, 0.5),
                micros(1, 0.99),
                ratio(0.5),
                ratio(0.99),
            ]
        };
        stopped.push(compared(beside_one_that_stopped(&process.dir, mode, blocks, count)?));
        let (times, steps) = beside_a_hard_one(&process.dir, mode, blocks, count)?;
        hard.push(compared(times));
        hard_steps += steps;
    }
    println!(
        "latency: a step as the client sees it, contactd / raw iceoryx2 request-response / Unix socket with bincode"
    );
    println!("ratio: contactd's over the other's, median over {blocks} blocks of the ratio of the blocks' medians");
    table.publish("latency", &options.folder())?;
    println!("a client's steps beside one that stopped reading / alone: medians over {blocks} blocks of either");
    stopped.publish("latency_stopped", &options.folder())?;
    println!(
        "a client's steps beside one whose every pair is hard ({hard_steps} steps of {LUMPS} bodies in each other) / alone"
    );
    hard.publish("latency_hard", &options.folder())?;
    Ok(())
}

fn main() -> Result<(), Failure> {
    let arguments = Arguments::parse();
    match arguments.serve.as_deref() {
        Some([dir, mode]) => serve(Path::new(dir), Mode::from_str(mode, true)?),
        _ => run(&arguments.common),
    }
}
