//! `contactd view`: a scene in a browser, its exact solids marched through on the page, with its contacts and its time line.
//!
//! One page, embedded in the program, is served on this machine alone ([`crate::http`]). It gets the solids as numbers ([`cells`]; meshes as
//! triangles), the objects, their motions and the answers as JSON ([`show`]), and draws them by WebGL 2 (`page/`). Nothing is
//! tessellated that has a closed form, and what is drawn otherwise is told so.
//!
//! Floor 11: imports `check` and everything below.

pub mod buffers;
pub mod cells;
pub mod gltf;
pub mod live;
pub mod show;

use crate::http::{Answer, Answers, Listening};
use show::Show;
use std::sync::Arc;

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const JSON: &str = "application/json";
const BYTES: &str = "application/octet-stream";

/// The files of the page.
const PAGE: &[(&str, &str, &str)] = &[
    ("/", HTML, include_str!("page/index.html")),
    ("/icon.svg", "image/svg+xml", include_str!("page/icon.svg")),
    ("/view.css", STYLE, include_str!("page/view.css")),
    ("/view.js", SCRIPT, include_str!("page/view.js")),
    ("/scene.js", SCRIPT, include_str!("page/scene.js")),
    ("/math.js", SCRIPT, include_str!("page/math.js")),
    ("/draw.js", SCRIPT, include_str!("page/draw.js")),
    ("/shaders.js", SCRIPT, include_str!("page/shaders.js")),
    ("/marks.js", SCRIPT, include_str!("page/marks.js")),
    ("/panel.js", SCRIPT, include_str!("page/panel.js")),
];

/// Serves a show on a port of 127.0.0.1 (0: any free one) until the process ends; `ready` hears the page's address.
///
/// # Errors
/// One sentence why it cannot listen.
pub fn serve(show: Show, port: u16, ready: impl FnOnce(&str)) -> Result<(), String> {
    let listening = Listening::on(port)?;
    ready(&format!("http://{}/", listening.address()));
    let answers: Arc<Answers> = Arc::new(move |path: &str| answer(&show, path));
    listening.answer(&answers).map_err(|e| format!("expected to take requests, found {e}"))
}

/// What a path is answered with.
pub fn answer(show: &Show, path: &str) -> Answer {
    let (route, query) = path.split_once('?').unwrap_or((path, ""));
    if let Some((_, content, text)) = PAGE.iter().find(|(name, ..)| *name == route) {
        return Answer::of(content, *text);
    }
    let buffers = &show.buffers;
    match route {
        "/show.json" => return told(Some(show.told()), path),
        "/words.bin" => return Answer::of(BYTES, buffers.words_bytes()),
        "/rows.bin" => return Answer::of(BYTES, buffers.rows_bytes()),
        "/triangles.bin" => return Answer::of(BYTES, buffers.triangles_bytes()),
        _ => {}
    }
    let mut words = route.split('/').skip(1);
    let name = words.next().unwrap_or_default();
    let numbers: Option<Vec<usize>> = words.map(|w| w.parse().ok()).collect();
    let Some(numbers) = numbers else { return nothing(path) };
    match (name, numbers.as_slice()) {
        ("step", [act, step]) => told(show.step(*act, *step), path),
        ("marks", [act]) => told(show.marks(*act), path),
        ("face", [model, face]) => match u32::try_from(*face) {
            Ok(face) => told(show.face(*model, face), path),
            Err(_) => nothing(path),
        },
        ("poses", [act, step]) => {
            let t = query.strip_prefix("t=").and_then(|t| t.parse::<f64>().ok()).filter(|t| (0.0..=1.0).contains(t));
            match t {
                Some(t) => told(show.poses(*act, *step, t), path),
                None => Answer::refused(400, format!("expected a time t from 0 to 1, as in ?t=0.5, found {query:?}")),
            }
        }
        _ => nothing(path),
    }
}

fn told(told: Option<Result<String, String>>, path: &str) -> Answer {
    match told {
        Some(Ok(json)) => Answer::of(JSON, json),
        Some(Err(sentence)) => Answer::refused(500, sentence),
        None => nothing(path),
    }
}

fn nothing(path: &str) -> Answer {
    Answer::refused(404, format!("there is nothing at {path:?}: begin at /"))
}
