//! Known answers of the case folders, and whether an answer holds against them.

use crate::engine::ReportedPoint as _;
use contactd::contact::{ContactKind, Outcome, Status};
use contactd::import::{Facets, Limits, read_scene};
use contactd::motion::Placed;
use contactd::solid::Solid;
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What is known about a case.
#[derive(Clone, Debug)]
pub struct KnownAnswer {
    /// First touch; `None`: they never touch.
    pub time: Option<f64>,
    /// How exactly `time` is known: 1e-12, or the bracket of a closed form.
    pub margin: f64,
    /// Normal, point and active surfaces on a and b, where they are unique.
    pub features: Option<(DVec3, DVec3, (usize, usize))>,
}

/// A case: two placed solids and what is known.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of its folder.
    pub name: String,
    /// First object.
    pub a: (Solid, Placed),
    /// Second object.
    pub b: (Solid, Placed),
    /// The scene's resolution, if it states one.
    pub resolution: Option<f64>,
    /// The answer.
    pub known: KnownAnswer,
}

/// The folder of the cases.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../cases")
}

/// Every case, by name.
pub fn cases() -> Vec<Case> {
    let mut names: Vec<PathBuf> =
        std::fs::read_dir(folder()).expect("tests/cases").map(|e| e.unwrap().path()).collect();
    names.retain(|p| p.join("scene.toml").exists());
    names.sort();
    names.iter().map(|p| load(p)).collect()
}

fn load(case: &Path) -> Case {
    let scene = read_scene(&case.join("scene.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mut solids = scene.load_models(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}")).into_iter();
    let [a, b] = scene.objects.as_slice() else { panic!("{}: expected two objects", case.display()) };
    let mut body = |place, motion| (solids.next().expect("a model for each object").solid, Placed { place, motion });
    let text = std::fs::read_to_string(case.join("truth.json")).expect("truth.json");
    Case {
        name: case.file_name().unwrap().to_string_lossy().into_owned(),
        a: body(a.place, a.motion),
        b: body(b.place, b.motion),
        resolution: scene.resolution,
        known: KnownAnswer::parse(&serde_json::from_str(&text).expect("valid JSON")),
    }
}

impl KnownAnswer {
    fn parse(v: &Value) -> Self {
        let vector = |key: &str| {
            let c: Vec<f64> = v.get(key)?.as_array()?.iter().filter_map(Value::as_f64).collect();
            <[f64; 3]>::try_from(c).ok().map(DVec3::from)
        };
        let (lower, upper) = (v["lower"].as_f64(), v["upper"].as_f64());
        let closed_form = v.get("separation").is_some();
        let time = v.get("time").and_then(Value::as_f64).or_else(|| Some((lower? + upper?) / 2.0));
        let active = v.get("active").and_then(Value::as_array);
        let features = (|| {
            let count = |i: usize| active?.get(i)?.as_u64().map(|n| n as usize);
            Some((vector("normal")?, vector("point")?, (count(0)?, count(1)?)))
        })();
        let margin = if closed_form { upper.unwrap_or(0.0) - lower.unwrap_or(0.0) } else { 0.0 };
        Self { time, margin, features }
    }

    /// What is wrong with an answer, if anything. `tolerance` is a fraction of the step.
    pub fn judge(&self, o: &Outcome, tolerance: f64) -> Result<(), String> {
        let Some(time) = self.time else {
            return match o.status() {
                Status::Clear => Ok(()),
                s => Err(format!("expected clear, got {} at {}", s.name(), o.time())),
            };
        };
        let wrong = |what: String| Err(what);
        if o.status() != Status::Contact {
            return wrong(format!("expected contact at {time}, got {}", o.status().name()));
        }
        if !(o.time() - time).abs().le(&(tolerance + self.margin)) {
            return wrong(format!("time {}, expected {time}: off by {:.1e}", o.time(), o.time() - time));
        }
        if !(o.time_lower() <= o.time() && o.time() <= o.time_upper()) {
            return wrong(format!("bracket out of order: {} {} {}", o.time_lower(), o.time(), o.time_upper()));
        }
        if o.time() - o.time_lower() > tolerance {
            return wrong(format!("time_lower is {:.1e} before time", o.time() - o.time_lower()));
        }
        if !((o.at().normal.length() - 1.0).abs() <= 1e-9 && o.at().point.is_finite()) {
            return wrong(format!("normal {} or point {} is no vector", o.at().normal, o.at().point));
        }
        let Some((normal, point, (a, b))) = self.features else { return Ok(()) };
        if o.at().normal.distance(normal) > 1e-6 {
            return wrong(format!("normal {}, expected {normal}", o.at().normal));
        }
        if o.at().point.distance(point) > 1e-5 {
            return wrong(format!("point {}, expected {point}", o.at().point));
        }
        if o.at().kind != ContactKind::of_active(a, b) {
            return wrong(format!("kind {}, expected {}", o.at().kind.name(), ContactKind::of_active(a, b).name()));
        }
        Ok(())
    }
}
