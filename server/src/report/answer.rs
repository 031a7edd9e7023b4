//! The answer for each pair, as the JSON object of `check --json` has it.

use crate::contact::distance::Distance;
use crate::contact::{Outcome, Region, Status};
use crate::solid::{Sense, Solid};
use contactd_proto::Report;
use serde::Serialize;

/// One answer with what it takes to name its features.
#[derive(Clone, Copy, Debug)]
pub struct PairReport<'a> {
    /// Names of the two objects.
    pub names: [&'a str; 2],
    /// Their solids.
    pub solids: [&'a Solid; 2],
    /// The files that these come from.
    pub files: [&'a str; 2],
    /// The answer.
    pub outcome: &'a Outcome,
    /// How much of it is told.
    pub report: Report,
    /// Its contact regions, where its rule asks for them.
    pub regions: &'a [Region],
    /// False when there may be more of them.
    pub regions_complete: bool,
    /// Its least distance over the step, where its rule asks for it.
    pub clearance: Option<&'a Distance>,
    /// True where its rule looks at the end of the step alone.
    pub discrete: bool,
}

/// The object that `check --json` prints.
#[derive(Debug, Serialize)]
pub struct Answer {
    /// The smallest `time_lower` of all pairs searched; 1 without pairs.
    pub safe_time: f64,
    /// One per pair.
    pub pairs: Vec<PairAnswer>,
}

/// One pair of `Answer`; the fields are those of the file format, in its order.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct PairAnswer {
    pub a: String,
    pub b: String,
    pub status: &'static str,
    pub time: Option<f64>,
    pub time_lower: Option<f64>,
    pub time_upper: Option<f64>,
    pub touching: bool,
    /// Told where it holds: `time` could not be continued back from its witness and equals `time_upper`.
    #[serde(skip_serializing_if = "is_false")]
    pub not_continued: bool,
    /// Told where it holds: the rule looks at the end of the step alone, so that nothing is said of what is before.
    #[serde(skip_serializing_if = "is_false")]
    pub discrete: bool,
    pub point: Option<[f64; 3]>,
    pub normal: Option<[f64; 3]>,
    pub separation: Option<f64>,
    pub normal_speed: Option<f64>,
    pub kind: Option<&'static str>,
    pub extent: Option<&'static str>,
    pub resolution: f64,
    pub features: Option<Features>,
    pub cells: u64,
    /// Told of an overlap whose rule asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub penetration: Option<Penetration>,
    /// Told of a clear pair that comes within its margin: until when it is proven farther apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_time: Option<f64>,
    /// Told where the rule asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance: Option<ClearanceAnswer>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<RegionAnswer>,
    /// Told when the work limit cut the search for regions.
    #[serde(skip_serializing_if = "is_true")]
    pub regions_complete: bool,
    /// The larger bounding radius of the two, for rounding.
    #[serde(skip)]
    pub size: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_false(b: &bool) -> bool {
    !*b
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_true(b: &bool) -> bool {
    *b
}

/// How deep an overlap is: along a direction from a to b, at its deepest point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Penetration {
    pub depth: f64,
    pub direction: [f64; 3],
    pub point: [f64; 3],
}

/// The least distance over the step: proven bounds, when, and a point of each body; infinite bounds and points that were not found are
/// none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct ClearanceAnswer {
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    pub time: f64,
    pub points: Option<[[f64; 3]; 2]>,
    pub settled: bool,
}

impl From<&Distance> for ClearanceAnswer {
    fn from(d: &Distance) -> Self {
        let finite = |x: f64| x.is_finite().then_some(x);
        let points = [d.a.point, d.b.point];
        Self {
            lower: finite(d.lower),
            upper: finite(d.upper),
            time: d.time,
            points: points.iter().all(|x| x.is_finite()).then(|| points.map(|x| x.to_array())),
            settled: d.is_settled,
        }
    }
}

/// A region in which a pair touches: points with the separation at each, and the faces that meet.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct RegionAnswer {
    pub kind: &'static str,
    pub extent: &'static str,
    pub normal: [f64; 3],
    pub points: Vec<[f64; 3]>,
    pub separations: Vec<f64>,
    pub features: Features,
}

/// The faces that meet, on each side.
#[derive(Debug, Serialize)]
pub struct Features {
    /// Faces of a.
    pub a: Vec<Feature>,
    /// Faces of b.
    pub b: Vec<Feature>,
}

/// One face of a primitive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Feature {
    /// Index of the primitive in file order.
    pub primitive: u32,
    /// The file format's name of it.
    pub name: String,
    /// Name of the face, in the primitive's frame.
    pub face: String,
    /// "positive", or "negative" where the primitive is subtracted.
    pub sense: &'static str,
    /// The file that it comes from, and its line there; 0 where there is none.
    #[serde(skip)]
    pub at: (String, u32),
}

impl Feature {
    /// The feature behind a face id of `solid`, which comes from `file`; `None` for an id that it does not have.
    pub fn of_face(file: &str, solid: &Solid, face: u32) -> Option<Self> {
        let primitive = *solid.face_owner.get(face as usize)?;
        let p = &solid.primitives[primitive as usize];
        let sense = match solid.senses[primitive as usize] {
            Sense::Positive => "positive",
            Sense::Negative => "negative",
        };
        let face = p.face_name((face - p.first_face) as usize);
        Some(Self { primitive, name: p.label.name.clone(), face, sense, at: (file.to_owned(), p.label.line) })
    }
}

impl Answer {
    /// The answer made of some pairs; `safe_time` covers exactly these.
    pub fn of_pairs(pairs: &[PairReport<'_>]) -> Self {
        let safe_time = pairs.iter().fold(1.0, |t: f64, p| t.min(p.outcome.time_lower()));
        Self { safe_time, pairs: pairs.iter().map(PairAnswer::of_pair).collect() }
    }

    /// One line of JSON.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }
}

impl std::fmt::Display for Feature {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sense = if self.sense == "negative" { "subtracted " } else { "" };
        write!(f, "{} of {sense}{} {}", self.face, self.name, self.primitive)
    }
}

impl PairAnswer {
    fn of_pair(pair: &PairReport<'_>) -> Self {
        let o = pair.outcome;
        let reported = |least| pair.report >= least;
        // A clear pair that touches has the fields of its nearest region.
        let rests = o.status() == Status::Clear && !pair.regions.is_empty();
        let point = o.point().filter(|_| rests || o.meets() && reported(Report::Contact));
        // Bodies that overlap meet in no one way.
        let met = point.filter(|_| o.status() != Status::Overlap);
        let features = |side: usize, faces: &[u32; 3]| {
            let feature = |face: &u32| Feature::of_face(pair.files[side], pair.solids[side], *face);
            faces.iter().filter_map(feature).collect::<Vec<_>>()
        };
        Self {
            a: pair.names[0].to_owned(),
            b: pair.names[1].to_owned(),
            status: o.status().name(),
            time: reported(Report::Time).then_some(o.time()),
            time_lower: reported(Report::Time).then_some(o.time_lower()),
            time_upper: reported(Report::Time).then_some(o.time_upper()),
            touching: o.touching,
            not_continued: o.not_continued() && reported(Report::Time),
            discrete: pair.discrete,
            point: point.map(|p| p.point.to_array()),
            normal: point.map(|p| p.normal.to_array()),
            separation: point.map(|p| p.separation),
            normal_speed: point.map(|p| p.normal_speed),
            kind: met.map(|p| p.kind.name()),
            extent: met.map(|p| p.extent.name()),
            resolution: o.resolution,
            features: point.map(|p| Features { a: features(0, &p.faces_a), b: features(1, &p.faces_b) }),
            cells: o.counters.cells,
            penetration: o.penetration().map(|p| Penetration {
                depth: p.depth,
                direction: p.direction.to_array(),
                point: p.point.to_array(),
            }),
            margin_time: (o.margin_time < 1.0).then_some(o.margin_time),
            clearance: pair.clearance.map(ClearanceAnswer::from),
            regions: pair
                .regions
                .iter()
                .map(|r| RegionAnswer {
                    kind: r.kind.name(),
                    extent: r.extent.name(),
                    normal: r.normal.to_array(),
                    points: r.points.iter().map(|p| p.point.to_array()).collect(),
                    separations: r.points.iter().map(|p| p.separation).collect(),
                    features: Features { a: features(0, &r.faces_a), b: features(1, &r.faces_b) },
                })
                .collect(),
            regions_complete: pair.regions_complete,
            size: pair.solids.map(radius).into_iter().fold(0.0, f64::max),
        }
    }
}

/// The radius of the ball around a solid's box; 0 where it has none.
fn radius(solid: &Solid) -> f64 {
    let bounds = solid.aabb();
    let radius = (bounds.max - bounds.min).length() / 2.0;
    if bounds.is_empty() || !radius.is_finite() { 0.0 } else { radius }
}

#[cfg(test)]
mod tests {
    use super::super::table::TableStyle;
    use super::super::work::work_table;
    use super::*;
    use crate::contact::{Clock, Contact, ContactKind, ContactPoint, Counters, Extent, Verdict};
    use crate::import::{Facets, Limits, import_csg};
    use glam::DVec3;

    fn plate() -> Solid {
        let text =
            "difference() { cube(size = [4, 4, 1], center = true);\n cylinder(h = 2, r1 = 1, r2 = 1, center = true); }";
        import_csg("plate.csg", text, Facets::Auto, &Limits::default()).expect("a plate").solid
    }

    fn contact() -> Outcome {
        let point = ContactPoint {
            point: DVec3::new(1.0, 0.0, 0.0),
            normal: DVec3::X,
            kind: ContactKind::EdgeFace,
            extent: Extent::Line,
            faces_a: [6, u32::MAX, u32::MAX],
            faces_b: [0, 4, u32::MAX],
            ..ContactPoint::default()
        };
        let contact = Contact {
            time_lower: 0.1,
            time: 0.1 + 0.2,
            time_upper: 1.0,
            not_continued: false,
            witness: None,
            point: Some(point),
        };
        Outcome { verdict: Verdict::Contact(contact), ..Outcome::clear(1e-9) }
    }

    /// What is reported of the solid and itself, without regions.
    fn report<'a>(solid: &'a Solid, outcome: &'a Outcome) -> PairReport<'a> {
        PairReport {
            names: ["a", "b"],
            solids: [solid, solid],
            files: ["models/plate.csg"; 2],
            outcome,
            report: Report::Contact,
            regions: &[],
            regions_complete: true,
            clearance: None,
            discrete: false,
        }
    }

    #[test]
    fn json_is_exact_and_names_features() {
        let solid = plate();
        let outcome = contact();
        let pair = report(&solid, &outcome);
        let json = Answer::of_pairs(&[pair]).json().expect("finite numbers");
        let expected = concat!(
            r#"{"safe_time":0.1,"pairs":[{"a":"a","b":"b","status":"contact","time":0.30000000000000004,"#,
            r#""time_lower":0.1,"time_upper":1.0,"touching":false,"point":[1.0,0.0,0.0],"normal":[1.0,0.0,0.0],"#,
            r#""separation":0.0,"normal_speed":0.0,"kind":"edge-face","extent":"line","resolution":1e-9,"#,
            r#""features":{"a":[{"primitive":1,"name":"cylinder","face":"side","sense":"negative"}],"#,
            r#""b":[{"primitive":0,"name":"cube","face":"+x","sense":"positive"},"#,
            r#"{"primitive":0,"name":"cube","face":"+z","sense":"positive"}]},"cells":0}]}"#
        );
        assert_eq!(json, expected);
    }

    #[test]
    fn a_time_that_was_not_continued_is_told_so() {
        let solid = plate();
        let mut outcome = contact();
        if let Verdict::Contact(contact) = &mut outcome.verdict {
            contact.not_continued = true;
        }
        let answer = Answer::of_pairs(&[report(&solid, &outcome)]);
        assert!(answer.json().expect("json").contains(r#""touching":false,"not_continued":true,"point""#));
        let tables = [false, true].map(|wide| answer.table(&TableStyle { wide, ..TableStyle::default() }));
        assert!(tables[0].contains("not continued"), "{}", tables[0]);
        assert!(tables[1].contains("contact (not continued)"), "{}", tables[1]);
        let hit = PairReport { report: Report::Hit, ..report(&solid, &outcome) };
        assert!(!Answer::of_pairs(&[hit]).json().expect("json").contains("not_continued"), "a hit has no time");
    }

    #[test]
    fn what_is_looked_at_where_the_step_ends_is_not_said_to_be_clear_before() {
        let (solid, outcome) = (plate(), Outcome::clear(1e-9));
        let swept = report(&solid, &outcome);
        let discrete = PairReport { discrete: true, ..report(&solid, &outcome) };
        let said = |pairs: &[PairReport<'_>]| Answer::of_pairs(pairs).table(&TableStyle::default());
        assert!(said(&[swept]).contains("proven clear for the whole step\n"));
        let alone = said(std::slice::from_ref(&discrete));
        assert!(alone.contains("looked at where the step ends alone") && !alone.contains("proven"), "{alone}");
        let both = said(&[report(&solid, &outcome), discrete]);
        assert!(both.contains("proven clear for the whole step, discrete pairs where it ends"), "{both}");
    }

    #[test]
    fn fields_without_meaning_are_null() {
        let solid = plate();
        let clear = Outcome::clear(1e-9);
        let pair = report(&solid, &clear);
        let answer = Answer::of_pairs(&[pair]);
        let p = &answer.pairs[0];
        assert!(p.point.is_none() && p.normal.is_none() && p.kind.is_none() && p.extent.is_none());
        assert!(p.separation.is_none() && p.normal_speed.is_none() && p.features.is_none());
        assert_eq!(answer.safe_time, 1.0);
        assert_eq!(Answer::of_pairs(&[]).json().expect("json"), r#"{"safe_time":1.0,"pairs":[]}"#);
    }

    #[test]
    fn work_names_the_primitives_of_a_pair_that_no_search_was_needed_for() {
        let solid = plate();
        let clear = Outcome::clear(1e-9);
        let searched = Outcome {
            counters: Counters { primitives: 4, after_stage1: 3, cells: 7, clauses: 20, ..Counters::default() },
            ..contact()
        };
        let pairs = [report(&solid, &clear), report(&solid, &searched)];
        let wide = TableStyle { wide: true, ..TableStyle::default() };
        let text = work_table(&pairs, &[None, Some(Clock::default())], &wide);
        let words: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(words[1][..4], ["a", "b", "boxes", "4"], "{text}");
        assert_eq!(words[2][..5], ["a", "b", "in", "front", "4"], "{text}");
        assert!(words[2].contains(&"7") && words[2].contains(&"20"), "{text}");
    }

    #[test]
    fn the_table_has_a_block_of_80_columns_or_a_line_of_nine_digits() {
        let solid = plate();
        let mut outcome = contact();
        let Verdict::Contact(contact) = &mut outcome.verdict else { panic!("a contact") };
        let point = contact.point.as_mut().expect("a point");
        (point.point, point.normal) = (DVec3::new(1.0, -3.55e-15, 0.123_456_789), DVec3::new(-0.0, 1e-17, -1.0));
        let pair = PairReport { names: ["peg", "plate"], ..report(&solid, &outcome) };
        let table = |wide| Answer::of_pairs(&[pair]).table(&TableStyle { wide, ..TableStyle::default() });
        let narrow = "1 pair: 1 contact, proven clear until t = 0.100000000\n\n\
                      time         status     a    b\n\
                      0.300000000  contact    peg  plate\n    \
                      edge-face (line), proven clear until 0.100000000, at (1, 0, 0.12346),\n    \
                      normal (0, 0, -1), normal speed 0\n    \
                      a  plate.csg:2 cylinder, side (subtracted)\n    \
                      b  plate.csg:1 cube, +x; plate.csg:1 cube, +z\n";
        assert_eq!(table(false), narrow);
        for word in [
            "0.300000000",
            "0.123456789",
            "(0.000000000, 0.000000000, -1.000000000)",
            "models/plate.csg:2 1 cylinder, side",
        ] {
            assert!(table(true).contains(word), "{word} in {}", table(true));
        }
    }
}
