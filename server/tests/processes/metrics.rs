//! What is scraped from a server, read by a reader of its own: as `status` tells it, in the form that OpenMetrics 1.0 asks for.

use super::super::harness::runtime_folder;
use super::super::harness::scene::build;
use super::{play, printed};
use contactd_client::Session;
use contactd_client::proto::names::Address;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

/// What is answered to a request: status, kind, body.
fn get(address: &str, path: &str) -> (u16, String, String) {
    let mut stream = TcpStream::connect(address).expect("a connection");
    stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n").as_bytes()).expect("sent");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("an answer");
    let (head, body) = text.split_once("\r\n\r\n").expect("a head");
    let kind = head.lines().find_map(|line| line.strip_prefix("Content-Type: ")).expect("a kind");
    (head.split(' ').nth(1).unwrap().parse().unwrap(), kind.to_owned(), body.to_owned())
}

/// Samples by name and labels; each belongs to a family that was declared before it, once, and the text ends as it has to.
fn samples(text: &str) -> BTreeMap<String, f64> {
    assert!(text.ends_with("\n# EOF\n"), "{text}");
    let mut families: BTreeMap<String, String> = BTreeMap::new();
    let (mut done, mut last) = (BTreeSet::new(), String::new());
    let mut samples = BTreeMap::new();
    for line in text.lines().take_while(|line| *line != "# EOF") {
        if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').expect("a kind");
            assert!(families.insert(name.into(), kind.into()).is_none(), "{name} twice");
            continue;
        }
        if line.starts_with("# ") {
            assert!(line.starts_with("# HELP ") || line.starts_with("# UNIT "), "{line}");
            continue;
        }
        let (name, value) = line.rsplit_once(' ').expect("a value");
        let (own, labels) = name.split_once('{').expect("labels");
        assert!(labels.ends_with('}') && labels.contains("server=\"scraped\""), "{line}");
        let family = own.strip_suffix("_total").unwrap_or(own);
        let expected = if own.ends_with("_total") { "counter" } else { "gauge" };
        assert_eq!(families.get(family).map(String::as_str), Some(expected), "{line}");
        if family != last {
            assert!(done.insert(family.to_owned()), "{family} is in two places");
            last = family.to_owned();
        }
        assert!(samples.insert(name.to_owned(), value.parse().expect("a number")).is_none(), "{line} twice");
    }
    samples
}

#[test]
fn metrics_are_what_status_tells() {
    let runtime = runtime_folder();
    let serve = ["serve", "--name", "scraped", "--metrics", "0", "--quiet"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
    command.args(serve).env("XDG_RUNTIME_DIR", runtime.path()).stdout(Stdio::piped());
    let mut server = Running(command.spawn().expect("a server"));
    let mut lines = BufReader::new(server.0.stdout.take().expect("a pipe")).lines().map_while(Result::ok);
    let url = lines.find_map(|l| Some(l.split_once("metrics at http://")?.1.to_owned())).expect("where they are");
    let address = url.strip_suffix("/metrics").expect("a path").to_owned();
    let (code, kind, empty) = get(&address, "/metrics");
    assert_eq!((code, kind.as_str()), (200, "application/openmetrics-text; version=1.0.0; charset=utf-8"));
    assert_eq!(samples(&empty)["contactd_sessions{server=\"scraped\"}"], 0.0);
    let place = Address::under(&runtime.path().join("contactd"), "scraped").expect("an address");
    let mut session = Session::connect_to(place).unwrap();
    let ids = build(&mut session, 3);
    let undecided = play(&mut session, &ids, 30, 20);
    let told = samples(&get(&address, "/metrics?name=x").2);
    let text = printed(runtime.path(), &["status", "--json", "--name", "scraped"]);
    let status: Value = serde_json::from_str(&text).expect("JSON");
    let status = &status["servers"][0];
    let of = |name: &str| told[&format!("contactd_{name}{{server=\"scraped\"}}")];
    for (name, key) in [("sessions", ""), ("objects", "objects"), ("models", "models")] {
        let expected = if key.is_empty() { 1.0 } else { status[key].as_f64().expect("a number") };
        assert_eq!(of(name), expected, "{name}");
    }
    assert_eq!((of("steps_total"), of("undecided_steps_total")), (30.0, undecided as f64));
    let resident = of("resident_memory_bytes") / status["memory_bytes"].as_f64().expect("bytes");
    assert!((0.5..2.0).contains(&resident), "{resident}");
    assert!(of("uptime_seconds") > 0.0 && of("uptime_seconds") <= status["uptime_s"].as_f64().expect("seconds"));
    let quantile = |q: &str| {
        let labels = ["quantile=\"", q, "\""].concat();
        let found = told
            .iter()
            .find(|(name, _)| name.starts_with("contactd_last_minute_step_seconds") && name.contains(&labels));
        *found.unwrap_or_else(|| panic!("{q} in {told:?}")).1
    };
    for (q, key) in [("0.5", "p50_ms"), ("0.99", "p99_ms"), ("0.999", "p999_ms"), ("1", "largest_ms")] {
        let expected = status["last_minute"][key].as_f64().expect("a time") / 1e3;
        assert!((quantile(q) - expected).abs() <= 1e-12 + 1e-9 * expected, "{q}: {} {expected}", quantile(q));
    }
    let id = format!("session=\"{}\"", session.opened().session);
    let of_session = |name: &str| {
        let found =
            told.iter().find(|(sample, _)| sample.starts_with(&format!("contactd_{name}{{")) && sample.contains(&id));
        *found.unwrap_or_else(|| panic!("{name} in {told:?}")).1
    };
    assert_eq!((of_session("session_steps_total"), of_session("session_objects")), (30.0, 4.0));
    assert_eq!(get(&address, "/").0, 404);
    // Whoever comes later is told why there are none.
    let taken = address.rsplit_once(':').expect("a port").1;
    let other = Command::new(env!("CARGO_BIN_EXE_contactd"))
        .args(["serve", "--name", "other", "--metrics", taken])
        .env("XDG_RUNTIME_DIR", runtime.path())
        .output()
        .expect("the program");
    let sentence = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(other.status.code() == Some(2) && sentence.contains(&format!("127.0.0.1:{taken}")), "{sentence}");
    assert!(!place_of_other(runtime.path()).exists(), "nothing of it stays");
    drop(session);
}

/// A server that ends with the test, however that does.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn place_of_other(runtime: &std::path::Path) -> std::path::PathBuf {
    Address::under(&runtime.join("contactd"), "other").expect("an address").folder()
}
