//! What the examples print: the same in Rust and through the C functions. The programs in C themselves are compared by
//! `bindings/capi/check`, which needs a C compiler.

#[allow(dead_code)]
#[path = "../../../server/examples/hello.rs"]
mod hello;
#[allow(dead_code)]
#[path = "../../../server/examples/manifold.rs"]
mod manifold;
#[allow(dead_code)]
#[path = "../../../server/examples/own_loop.rs"]
mod own_loop;
mod support;

use contactd::ipc::ServerConfig;
use contactd_capi::step::{contactd_get_options, contactd_set_advance, contactd_set_options};
use contactd_proto::contact_record::CONTACT;
use support::{Open, done, end, out, records};

#[test]
fn hello_prints_the_same_through_c() {
    let of_rust = hello::hello(contactd::embedded(&ServerConfig::default()).unwrap()).unwrap();
    let session = Open::embedded();
    let (_, ball) = session.scene();
    let reply = session.step(&[end(ball, [1.0, 0.0, 0.0])]);
    let mut lines = String::new();
    for c in records(&reply) {
        let (p, n) = (c.point, c.normal);
        lines += &format!("{}-{}: contact at t = {:.15}, ", c.a, c.b, c.time);
        lines += &format!("point {:.12} {:.12} {:.12}, ", p[0], p[1], p[2]);
        lines += &format!("normal {:.12} {:.12} {:.12}\n", n[0], n[1], n[2]);
    }
    assert_eq!(lines, of_rust);
    assert_eq!(lines.lines().count(), 1);
    assert!(lines.starts_with("1-2: contact at t = 0.67087121525220"), "{lines}");
}

/// The arithmetic of `loop.c`, line by line.
#[test]
fn a_loop_of_one_s_own_bounces_the_same_through_c() {
    let session = Open::embedded();
    // SAFETY: an open session and variables.
    let mut options = out(|o| unsafe { contactd_get_options(session.0, o) });
    options.first = 1;
    // SAFETY: an open session and a structure.
    done(unsafe { contactd_set_options(session.0, &options) });
    let text = std::ffi::CString::new(own_loop::ROOM).unwrap();
    let (room, ball) = (session.model("room.csg", &text), session.model("ball.csg", c"sphere(r = 1);"));
    let (mut x, mut v) = ([-3.0, -2.5, 1.0], [2.0, 1.25, 0.75]);
    session.object(c"room", room, |o| o.is_static = 1);
    let ball = session.object(c"ball", ball, |o| o.pose.position = x);
    let (mut time, mut taken, mut lines) = (0.0, 1.0, String::new());
    while time < 20.0 {
        // SAFETY: an open session.
        done(unsafe { contactd_set_advance(session.0, taken) });
        let reply = session.step(&[end(ball, [0, 1, 2].map(|k| x[k] + v[k] * own_loop::STEP))]);
        let hit = records(&reply).first().filter(|c| c.status == CONTACT);
        taken = hit.map_or(reply.header.safe_time, |c| c.time);
        time += taken * own_loop::STEP;
        (0..3).for_each(|k| x[k] += v[k] * (taken * own_loop::STEP));
        if let Some(c) = hit {
            let n = c.normal;
            let twice = 2.0 * (v[0] * n[0] + v[1] * n[1] + v[2] * n[2]);
            (0..3).for_each(|k| v[k] -= n[k] * twice);
            lines += &format!("t = {time:.12}: at {:.12} {:.12} {:.12}\n", x[0], x[1], x[2]);
        }
    }
    assert_eq!(lines, own_loop::bounces().unwrap());
    assert!(lines.lines().count() > 10, "{lines}");
    // Reflections keep the speed.
    assert!((v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 6.125).abs() < 1e-12, "{v:?}");
}

/// The corners of the cube under the same ids at both steps, half way between it and the floor. (Through the C functions: `calls`.)
#[test]
fn the_points_of_the_manifold_slide_with_the_cube() {
    let lines = manifold::points().unwrap();
    // Step, id, then position, normal and distance.
    let numbers =
        |line: &str| -> Vec<f64> { line.split([' ', ',', ':']).filter_map(|word| word.parse().ok()).collect() };
    let reported: Vec<Vec<f64>> = lines.lines().map(numbers).collect();
    assert_eq!(
        reported.iter().map(|n| (n[0], n[1])).collect::<Vec<_>>(),
        [0.0, 1.0].map(|step| [0.0, 1.0, 2.0, 3.0].map(|id| (step, id))).concat()
    );
    let mut corners = std::collections::BTreeSet::new();
    for (first, second) in reported[..4].iter().zip(&reported[4..]) {
        let [x, y, z] = [first[2], first[3] - 0.25, first[4]];
        assert!(x.abs() == 2.0 && y.abs() == 2.0 && z == 2.0005, "{lines}");
        corners.insert((x > 0.0, y > 0.0));
        assert_eq!(second[2..5], [x + 0.5, first[3], z], "{lines}");
        assert!([first, second].iter().all(|n| n[5..8] == [0.0, 0.0, 1.0] && (n[8] - 1e-3).abs() < 1e-9), "{lines}");
    }
    assert_eq!(corners.len(), 4, "{lines}");
}

/// `lines` without the blanks that all of them begin with.
fn flush_left(lines: &[&str]) -> Vec<String> {
    let indents = lines.iter().filter(|l| !l.trim().is_empty()).map(|l| l.len() - l.trim_start().len());
    let indent = indents.min().unwrap_or(0);
    lines.iter().map(|l| l.get(indent..).unwrap_or_default().trim_end().to_owned()).collect()
}

/// The blocks of code in a text, with the word that names their language.
fn blocks(text: &str) -> Vec<(&str, Vec<&str>)> {
    let mut found = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            found.push((language, lines.by_ref().take_while(|l| *l != "```").collect()));
        }
    }
    found
}

#[test]
fn the_loops_of_the_documentation_are_those_that_run() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
    let text = read("docs/coupling.md");
    let chapter = text.split("\n## ").find(|c| c.starts_with("A loop of one's own")).expect("the chapter of the loops");
    let quoted = blocks(chapter);
    let files = [
        ("rust", "server/examples/own_loop.rs"),
        ("c", "bindings/capi/examples/loop.c"),
        ("python", "bindings/python/examples/own_loop.py"),
    ];
    assert_eq!(quoted.iter().map(|q| q.0).collect::<Vec<_>>(), files.map(|f| f.0));
    for ((_, block), (_, path)) in quoted.iter().zip(files) {
        assert!(block.len() > 10 && block.iter().any(|l| l.starts_with("while")), "{path}: {block:?}");
        let (block, file) = (flush_left(block), read(path));
        let lines: Vec<&str> = file.lines().collect();
        let there = lines.windows(block.len()).any(|window| flush_left(window) == block);
        assert!(there, "docs/coupling.md quotes a loop that is not that of {path}:\n{}", block.join("\n"));
    }
}
