//! What a server counts, as OpenMetrics text that Prometheus and the like scrape.
//!
//! A scrape asks the server as `contactd status` does: its loop answers from what it has counted, between two steps. Names and
//! units are those of OpenMetrics 1.0 (openmetrics.io): base units, `_total` on counters.
//!
//! Floor 9: imports `http`.

use crate::http::{Answer, Answers, Listening};
use contactd_client::shm::operator;
use contactd_proto::control::ServerStatus;
use contactd_proto::names::{Address, start_of_process};
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric as _};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// How OpenMetrics are called where they are sent.
pub const CONTENT: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// How long a server may take to answer a scrape.
const PATIENCE: Duration = Duration::from_secs(5);

/// Tells metrics of the server at `address` in a thread of its own, for as long as the process lives.
pub fn tell(address: &Address, listening: Listening) {
    let address = address.clone();
    let answers: Arc<Answers> = Arc::new(move |path: &str| match path.split('?').next() {
        Some("/metrics") => match operator::status(&address, PATIENCE) {
            Ok(status) => Answer::of(CONTENT, text(address.name(), &status)),
            Err(e) => Answer::refused(503, format!("the server says nothing: {e}")),
        },
        _ => Answer::refused(404, "there is nothing here: metrics are at /metrics"),
    });
    std::thread::spawn(move || listening.answer(&answers));
}

/// Bytes in memory of a process, as the system says; `None` of one that is not visible.
pub fn memory(pid: u32) -> Option<u64> {
    start_of_process(pid)?;
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kb| kb << 10)
}

/// The metrics of a server of that name, whole: the text ends in `# EOF`.
pub fn text(name: &str, status: &ServerStatus) -> String {
    let labels = [("server".into(), name.to_owned().into())];
    let mut registry = Registry::with_prefix_and_labels("contactd", labels.into_iter());
    registry.register_collector(Box::new(Snapshot { status: status.clone(), memory: memory(status.pid) }));
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = prometheus_client::encoding::text::encode(&mut text, &registry);
    text
}

/// What was counted up to a moment.
#[derive(Debug)]
struct Snapshot {
    status: ServerStatus,
    memory: Option<u64>,
}

/// Labels of a metric.
type Labels<'a> = [(&'a str, String)];

impl Collector for Snapshot {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let s = &self.status;
        let objects = s.sessions.iter().map(|s| u64::from(s.objects)).sum::<u64>() as f64;
        let gauges: [(&str, &str, Option<&Unit>, f64); 4] = [
            ("uptime", "Time since the server's start", Some(&Unit::Seconds), s.uptime_ms as f64 / 1e3),
            ("sessions", "Sessions that are open", None, s.sessions.len() as f64),
            ("objects", "Objects of all sessions", None, objects),
            ("models", "Models in use, each counted once however many sessions have it", None, f64::from(s.models)),
        ];
        for (name, help, unit, value) in gauges {
            gauge(&mut encoder, (name, help), unit, &[(&[], value)])?;
        }
        if let Some(bytes) = self.memory {
            let help = "Pages of the server in memory, shared ones too";
            gauge(&mut encoder, ("resident_memory", help), Some(&Unit::Bytes), &[(&[], bytes as f64)])?;
        }
        counter(&mut encoder, ("steps", "Steps that were taken"), &[(&[], s.steps)])?;
        let undecided = "Steps that left a pair undecided";
        counter(&mut encoder, ("undecided_steps", undecided), &[(&[], s.undecided)])?;
        let latest = &s.latest;
        if latest.steps > 0 {
            let quantiles =
                [("0.5", latest.p50_ns), ("0.99", latest.p99_ns), ("0.999", latest.p999_ns), ("1", latest.largest_ns)];
            let rows = quantiles.map(|(q, ns)| ([("quantile", q.to_owned())], ns as f64 / 1e9));
            let rows: Vec<(&Labels<'_>, f64)> = rows.iter().map(|(labels, value)| (&labels[..], *value)).collect();
            let help = "Time from a request to its reply, over the last minute, to 1 %";
            gauge(&mut encoder, ("last_minute_step", help), Some(&Unit::Seconds), &rows)?;
        }
        self.sessions(&mut encoder)
    }
}

impl Snapshot {
    /// Each session by its id and its client's process.
    fn sessions(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let sessions = &self.status.sessions;
        if sessions.is_empty() {
            return Ok(());
        }
        let labels: Vec<[(&str, String); 2]> =
            sessions.iter().map(|s| [("session", s.id.to_string()), ("process", s.process.to_string())]).collect();
        let each = || labels.iter().map(|labels| &labels[..]).zip(sessions);
        let steps: Vec<(&Labels<'_>, u64)> = each().map(|(labels, s)| (labels, s.steps)).collect();
        counter(encoder, ("session_steps", "Steps that were taken of a session"), &steps)?;
        let undecided: Vec<(&Labels<'_>, u64)> = each().map(|(labels, s)| (labels, s.undecided)).collect();
        let help = "Steps of a session that left a pair undecided";
        counter(encoder, ("session_undecided_steps", help), &undecided)?;
        let objects: Vec<(&Labels<'_>, f64)> = each().map(|(labels, s)| (labels, f64::from(s.objects))).collect();
        gauge(encoder, ("session_objects", "Objects of a session"), None, &objects)?;
        let idle: Vec<(&Labels<'_>, f64)> = each().map(|(labels, s)| (labels, s.idle_ms as f64 / 1e3)).collect();
        gauge(
            encoder,
            ("session_idle", "Time since the client of a session asked something"),
            Some(&Unit::Seconds),
            &idle,
        )
    }
}

/// A gauge and its values.
fn gauge(
    encoder: &mut DescriptorEncoder<'_>,
    (name, help): (&str, &str),
    unit: Option<&Unit>,
    rows: &[(&Labels<'_>, f64)],
) -> fmt::Result {
    use prometheus_client::metrics::MetricType::Gauge;
    let mut metric = encoder.encode_descriptor(name, help, unit, Gauge)?;
    for (labels, value) in rows {
        ConstGauge::new(*value).encode(metric.encode_family(labels)?)?;
    }
    Ok(())
}

/// A counter and its values.
fn counter(
    encoder: &mut DescriptorEncoder<'_>,
    (name, help): (&str, &str),
    rows: &[(&Labels<'_>, u64)],
) -> fmt::Result {
    use prometheus_client::metrics::MetricType::Counter;
    let mut metric = encoder.encode_descriptor(name, help, None, Counter)?;
    for (labels, value) in rows {
        ConstCounter::new(*value).encode(metric.encode_family(labels)?)?;
    }
    Ok(())
}
