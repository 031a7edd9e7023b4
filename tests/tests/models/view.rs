//! The page of `contactd view`: the numbers that its shader marches through say what the solids are, its server answers whom it may.
//!
//! The numbers are read here as `server/src/view/cells.rs` tells them, in single precision, by code that shares nothing with what
//! wrote them. `CONTACTD_VIEW_SOLIDS=N` for another number of solids a kind than the short one:
//! `CONTACTD_VIEW_SOLIDS=200 cargo test --release -p contactd-tests --test models view:: -- --nocapture`

use contactd::http::Listening;
use contactd::import::Scene;
use contactd::math::Aabb;
use contactd::octree::Model;
use contactd::solid::{Solid, SolidBuilder};
use contactd::view::buffers::{Buffers, Piece, Shown};
use contactd::view::show::Show;
use contactd::{tessellation, view};
use contactd_tests::random_solids::{
    Random, shape, shape_or_capsule, shape_or_elliptic, shape_or_mesh, shape_or_torus, solid_of,
};
use contactd_tests::{meshes, quadrics, sweep};
use glam::{DVec3, Vec3};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;

/// A machine that reads the numbers.
struct Reader<'a> {
    buffers: &'a Buffers,
    piece: &'a Piece,
}

/// What stands at a point.
#[derive(Debug, PartialEq)]
enum Place {
    Empty,
    Full,
    /// f of the list there, the face that decides, and how far the cube's walls are.
    Open(f32, u32, f32),
}

impl Reader<'_> {
    fn row(&self, at: u32, x: Vec3) -> f32 {
        let [a, b, c, d] = self.buffers.rows[at as usize];
        a * x.x + b * x.y + c * x.z + d
    }

    fn psi(&self, token: u32, x: Vec3) -> f32 {
        let (form, at) = (token >> 26 & 7, token & 0x3ff_ffff);
        let row = |k: u32| self.row(at + k, x);
        let [first, second, ..] = self.buffers.rows[at as usize];
        let psi = match form {
            0 => row(0),
            1 => row(1).hypot(row(2)) + row(0),
            2 => Vec3::new(row(1), row(2), row(3)).length() + row(0),
            3 => row(1).hypot(row(2)) - row(3).hypot(row(4)) + row(0),
            4 => (row(1).hypot(row(2)) - first).hypot(row(3)) - second,
            5 => row(1).hypot(row(2)).hypot((row(3).abs() - first).max(0.0)) - second,
            other => panic!("no form {other}"),
        };
        if token >> 29 & 1 == 1 { -psi } else { psi }
    }

    fn at(&self, x: DVec3) -> Place {
        let x = x.as_vec3();
        let [a, b, c, half] = self.piece.cube;
        let (mut low, mut side, mut node) = (Vec3::new(a, b, c) - half, 2.0 * half, self.piece.root);
        while node & 3 == 2 {
            side *= 0.5;
            let upper = [0, 1, 2].map(|k| u32::from(x[k] >= low[k] + side));
            low += Vec3::from(upper.map(|u| u as f32)) * side;
            node = self.buffers.words[((node >> 2) + upper[0] + 2 * upper[1] + 4 * upper[2]) as usize];
        }
        match node & 3 {
            0 => Place::Empty,
            1 => Place::Full,
            _ => {
                let list = (node >> 2) as usize;
                let count = self.buffers.words[list] as usize;
                let mut stack: Vec<(f32, u32)> = Vec::new();
                for token in &self.buffers.words[list + 1..list + 1 + count] {
                    let one = if token >> 30 == 3 {
                        stack.pop().expect("two values")
                    } else {
                        (self.psi(*token, x), token & 0x3ff_ffff)
                    };
                    let smaller = if token >> 30 == 3 { token & 1 == 1 } else { token >> 30 == 2 };
                    if token >> 30 == 0 {
                        stack.push(one);
                        assert!(stack.len() <= 16, "the page's stack has 16 values");
                        continue;
                    }
                    let top = stack.last_mut().expect("a value");
                    let decides = if smaller { one.0 < top.0 } else { one.0 > top.0 };
                    if decides {
                        *top = one;
                    }
                }
                assert_eq!(stack.len(), 1, "one value is left");
                let walls = (x - low).min(low + side - x).min_element();
                Place::Open(stack[0].0, self.face(stack[0].1), walls)
            }
        }
    }

    /// The face whose rows begin there.
    fn face(&self, at: u32) -> u32 {
        let mut known = self.piece.faces.chunks(2);
        known.find(|pair| pair[0] == at).expect("the rows of a face")[1]
    }
}

fn shown(solid: Solid) -> Shown {
    Shown { name: "part".into(), file: "part.csg".into(), model: Arc::new(Model::new(solid)) }
}

/// What a sweep has seen.
#[derive(Debug, Default)]
struct Tally {
    solids: usize,
    points: usize,
    open: usize,
    inside: usize,
    marched: usize,
    on: usize,
}

/// The numbers of a solid have its sign everywhere, no step of theirs leads across its surface, and on it they name a face that is there.
fn hold(solid: Solid, r: &mut Random, tally: &mut Tally) {
    let around = solid.aabb();
    let shown = shown(solid);
    let buffers = Buffers::new(std::slice::from_ref(&shown), &[around]);
    let solid = &shown.model.solid;
    let piece = &buffers.pieces[0];
    assert_eq!(piece.note, "", "marched through");
    if piece.triangles[1] > 0 || solid.is_empty() {
        return;
    }
    tally.solids += 1;
    let reader = Reader { buffers: &buffers, piece };
    let size = around.half().max_element() + around.center().abs().max_element();
    let rounding = 3e-5 * size;
    for _ in 0..400 {
        let x = r.point_in(&around);
        let f = solid.value(x);
        tally.points += 1;
        tally.inside += usize::from(f < 0.0);
        match reader.at(x) {
            Place::Empty => assert!(f > -rounding, "empty at {x}, where f is {f}"),
            Place::Full => assert!(f < rounding, "full at {x}, where f is {f}"),
            Place::Open(g, ..) => {
                tally.open += 1;
                assert!(f.abs() < rounding || (f < 0.0) == (g < 0.0), "f is {f} at {x}, its numbers say {g}");
                // A step as the page takes it.
                let y = x + r.direction() * f64::from(g).abs() * r.within(0.0, 1.0);
                if leads_within(&reader, x, y) {
                    let over = solid.value(y);
                    let same = over.abs() < rounding || f.abs() < rounding || (over < 0.0) == (f < 0.0);
                    assert!(same, "a step of {g} from {x}, where f is {f}, leads to {y}, where it is {over}");
                    tally.marched += 1;
                }
            }
        }
    }
    on_surface(solid, &reader, r, rounding, tally);
}

/// True where both points are in one cube, so that its list speaks of all that lies between them.
fn leads_within(reader: &Reader<'_>, x: DVec3, y: DVec3) -> bool {
    matches!(reader.at(x), Place::Open(_, _, walls) if f64::from(walls) > (y - x).abs().max_element())
}

/// Where a line crosses the surface the numbers name a face that is there.
fn on_surface(solid: &Solid, reader: &Reader<'_>, r: &mut Random, rounding: f64, tally: &mut Tally) {
    let around = solid.aabb();
    for _ in 0..60 {
        let (mut a, mut b) = (r.point_in(&around), r.point_in(&around));
        if (solid.value(a) < 0.0) == (solid.value(b) < 0.0) {
            continue;
        }
        if solid.value(a) >= 0.0 {
            std::mem::swap(&mut a, &mut b);
        }
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if solid.value(middle) < 0.0 { a = middle } else { b = middle }
        }
        if let Place::Open(g, face, _) = reader.at(b) {
            let psi = solid.faces[face as usize].value(b);
            assert!(f64::from(g).abs() < rounding, "on the surface at {b} the numbers say {g}");
            assert!(psi.abs() < 2.0 * rounding, "face {face} decides at {b}, where its psi is {psi}");
            tally.on += 1;
        }
    }
}

#[test]
fn the_numbers_of_the_page_say_what_the_solids_are() {
    let count = sweep::sized("CONTACTD_VIEW_SOLIDS", 2_usize);
    let mut r = Random::new(29);
    let mut tally = Tally::default();
    for kind in [shape, shape_or_torus, shape_or_capsule, shape_or_elliptic, shape_or_mesh, quadrics::shape_or_quadric]
    {
        for _ in 0..count {
            hold(solid_of(&mut r, 3, kind), &mut r, &mut tally);
        }
    }
    println!("{tally:?}");
    assert!(tally.open * 20 > tally.points && tally.inside * 50 > tally.points, "{tally:?}");
    assert!(tally.marched * 50 > tally.open && tally.on > 3 * tally.solids, "{tally:?}");
}

/// A large mesh below an operation, which is never written out as a whole.
#[test]
fn a_large_mesh_that_something_is_cut_from_is_marched_through_too() {
    let mut r = Random::new(31);
    let mesh = meshes::divided(&meshes::torus((1.0, 0.4), 24, 12));
    let mut b = SolidBuilder::new();
    let place = |at| contactd_proto::Pose::at(at);
    let ring = b.primitive(mesh, place(DVec3::ZERO), Default::default());
    let ball = contactd::solid::primitive::Sphere { radius: 0.5 };
    let ball = b.primitive(ball, place(DVec3::X), Default::default());
    let root = b.operation(contactd::solid::Op::Difference, &[ring, ball]);
    let mut tally = Tally::default();
    hold(b.finish(root), &mut r, &mut tally);
    assert!(tally.solids == 1 && tally.open > 20 && tally.on > 5, "{tally:?}");
}

/// Triangles of any solid lie on it and are closed: what is drawn of a kind that the page cannot march through.
#[test]
fn triangles_of_a_solid_lie_on_it_and_are_closed() {
    let mut r = Random::new(37);
    for _ in 0..sweep::sized("CONTACTD_VIEW_SOLIDS", 1_usize) {
        let solid = solid_of(&mut r, 2, shape_or_torus);
        let made = tessellation::of_solid(&solid, &solid.aabb(), 6);
        assert!(made.indices.len() > 100 && made.indices.len() == made.faces.len());
        let mut ends = std::collections::BTreeMap::<[[u64; 3]; 2], i32>::new();
        let bits = |x: DVec3| x.to_array().map(f64::to_bits);
        let mut near = 0;
        for (corners, face) in made.corners().zip(&made.faces) {
            assert!((*face as usize) < solid.faces.len());
            for k in 0..3 {
                let (a, b) = (bits(corners[k]), bits(corners[(k + 1) % 3]));
                *ends.entry(if a < b { [a, b] } else { [b, a] }).or_default() += if a < b { 1 } else { -1 };
                let f = solid.value(corners[k]);
                assert!(f.abs() < 1.75 * made.off, "a corner is {f} off, in cells of {}", made.off);
                near += usize::from(f.abs() < 0.05 * made.off);
            }
        }
        assert!(ends.values().all(|n| *n == 0), "every edge is passed as often one way as the other");
        assert!(near * 10 > made.indices.len() * 3 * 8, "{near} of {} corners are near", made.indices.len() * 3);
    }
}

const SCENE: &str = r#"
unit = "mm"
[[model]]
name = "ball"
file = "ball.csg"
[[object]]
name = "one"
model = "ball"
motion = "static"
[[object]]
name = "other"
model = "ball"
start = { position = [0, 0, 20] }
end = { position = [0, 0, 5] }
rotation_vector = [1, 2, 3]
"#;

fn show() -> Show {
    let scene = Scene::parse("two.toml", SCENE, Path::new("")).expect("a scene");
    let mut b = SolidBuilder::new();
    let root = b.primitive(
        contactd::solid::primitive::Sphere { radius: 5.0 },
        contactd_proto::Pose::IDENTITY,
        contactd::solid::Label { name: "sphere".into(), line: 1, column: 1, mirrored: false },
    );
    let model = Arc::new(Model::new(b.finish(root)));
    Show::of_scene("two.toml".into(), scene, &[model]).expect("a show")
}

/// The status and the body of a request.
fn asked(address: std::net::SocketAddr, request: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).expect("a connection");
    stream.write_all(request.as_bytes()).expect("sent");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("an answer");
    let text = String::from_utf8_lossy(&answer).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").expect("a head");
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
    assert!(head.contains("Content-Security-Policy: default-src 'self'"), "{head}");
    (status, body.to_owned())
}

#[test]
fn the_server_of_the_page_answers_its_own_address_alone_and_each_route() {
    let listening = Listening::on(0).expect("a port");
    let address = listening.address();
    assert!(address.ip().is_loopback());
    let show = show();
    let answers: Arc<contactd::http::Answers> = Arc::new(move |path: &str| view::answer(&show, path));
    std::thread::spawn(move || listening.answer(&answers));
    let get = |path: &str| asked(address, &format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n"));
    for path in
        ["/", "/view.css", "/view.js", "/draw.js", "/shaders.js", "/marks.js", "/panel.js", "/scene.js", "/math.js"]
    {
        let (status, body) = get(path);
        assert!(status == 200 && body.len() > 500, "{path}: {status}");
        // Nothing is fetched from elsewhere.
        let urls: Vec<&str> = body.match_indices("http").map(|(i, _)| &body[i..(i + 40).min(body.len())]).collect();
        assert!(urls.iter().all(|u| u.starts_with("http://www.w3.org/2000/svg")), "{path}: {urls:?}");
    }
    let (status, told) = get("/step/0/0");
    let told: serde_json::Value = serde_json::from_str(&told).expect("JSON");
    // Two balls of radius 5, 20 apart, 15 nearer at the end: they touch at t = 2/3.
    let time = told["pairs"][0]["time"].as_f64().expect("a time");
    assert!(status == 200 && (time - 2.0 / 3.0).abs() < 1e-9, "{told}");
    assert!(
        told["pairs"][0]["sentence"].as_str().is_some_and(|s| s.starts_with("one first meets other at t = 0.6666"))
    );
    let (_, poses) = get("/poses/0/0?t=0.5");
    let poses: Vec<[f64; 7]> = serde_json::from_str(&poses).expect("poses");
    assert!((poses[1][2] - 12.5).abs() < 1e-12, "{poses:?}");
    assert_eq!(serde_json::from_str::<serde_json::Value>(&get("/face/0/0").1).expect("JSON")["line"], 1);
    assert_eq!(get("/marks/0").0, 200);
    assert_eq!(get("/words.bin").0, 200);
    for (path, status, word) in [
        ("/nothing", 404, "begin at /"),
        ("/step/0/1", 404, "there is nothing"),
        ("/step/0/-1", 404, "there is nothing"),
        ("/step/9/0", 404, "there is nothing"),
        ("/face/0/7", 404, "there is nothing"),
        ("/face/0/99999999999", 404, "there is nothing"),
        ("/poses/0/0?t=nan", 400, "expected a time"),
        ("/poses/0/0", 400, "expected a time"),
        ("/../Cargo.toml", 404, "there is nothing"),
    ] {
        let (found, body) = get(path);
        assert!(found == status && body.contains(word) && body.lines().count() == 1, "{path}: {found} {body}");
    }
    for (request, status) in [
        ("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_owned(), 403),
        (format!("POST / HTTP/1.1\r\nHost: {address}\r\n\r\n"), 405),
        ("hello\r\n\r\n".to_owned(), 400),
        (format!("GET / HTTP/1.1\r\nHost: {address}\r\nx: {}\r\n\r\n", "y".repeat(17 << 10)), 431),
    ] {
        let (found, body) = asked(address, &request);
        assert!(found == status && body.lines().count() == 1, "{found} {body}");
    }
}

#[test]
fn the_program_refuses_what_it_cannot_show_in_one_sentence() {
    let taken = Listening::on(0).expect("a port");
    let again = Listening::on(taken.address().port()).expect_err("the port is taken");
    assert!(again.contains("choose another port") && again.lines().count() == 1, "{again}");
    let none = Show::new("nothing".into(), Vec::new(), Vec::new()).expect_err("nothing to show");
    assert!(none.contains("nothing") && none.lines().count() == 1, "{none}");
    let text = "[[model]]\nname = \"a\"\nfile = \"a.csg\"\n[[object]]\nname = \"a\"\nmodel = \"a\"\nmax_speed = 1\n";
    assert!(Scene::parse("a.toml", text, Path::new("")).is_err(), "a speed without a duration");
}

#[test]
fn what_is_endless_is_cut_off_around_the_scene() {
    let mut b = SolidBuilder::new();
    let ground = contactd::solid::primitive::HalfSpace;
    let root = b.primitive(ground, contactd_proto::Pose::IDENTITY, Default::default());
    let shown = shown(b.finish(root));
    let extent = Aabb::around(DVec3::ZERO, DVec3::splat(50.0));
    let buffers = Buffers::new(&[shown], &[extent]);
    assert!(buffers.pieces[0].endless && buffers.pieces[0].note.is_empty());
    let reader = Reader { buffers: &buffers, piece: &buffers.pieces[0] };
    assert!(matches!(reader.at(DVec3::new(1.0, 2.0, -30.0)), Place::Full | Place::Open(-40.0..-20.0, ..)));
    assert!(matches!(reader.at(DVec3::new(1.0, 2.0, 30.0)), Place::Empty | Place::Open(20.0..40.0, ..)));
}
