//! OpenMC geometries against a judge that knows the sign of each surface's polynomial at a point and OpenMC's rules of where a point is,
//! and nothing of boxes, solids or places.
//!
//! `CONTACTD_OPENMC=2000 CONTACTD_OPENMC_SEED=1 cargo test --release -p contactd-tests --test models openmc:: -- --nocapture` sets the number of
//! random geometries (6 by default) and where they begin.

use contactd::import::openmc::read_openmc;
use contactd::import::{Facets, Limits, Scene};
use contactd::octree::Model;
use contactd::overlaps::{Beside, Found, Verdict, decide, of_cells, scene_of_cells, scene_of_uses};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// A surface: its type and its coefficients.
#[derive(Clone, Debug)]
struct Surface(&'static str, Vec<f64>);

impl Surface {
    /// The formulas of OpenMC's documentation.
    fn value(&self, p: DVec3) -> f64 {
        let c = &self.1;
        let (x, y, z) = (p.x, p.y, p.z);
        let at = |i: usize| p - DVec3::new(c[i], c[i + 1], c[i + 2]);
        match self.0 {
            "x-plane" => x - c[0],
            "y-plane" => y - c[0],
            "z-plane" => z - c[0],
            "plane" => c[0] * x + c[1] * y + c[2] * z - c[3],
            "x-cylinder" => (y - c[0]).powi(2) + (z - c[1]).powi(2) - c[2] * c[2],
            "y-cylinder" => (x - c[0]).powi(2) + (z - c[1]).powi(2) - c[2] * c[2],
            "z-cylinder" => (x - c[0]).powi(2) + (y - c[1]).powi(2) - c[2] * c[2],
            "sphere" => at(0).length_squared() - c[3] * c[3],
            "x-cone" => at(0).y.powi(2) + at(0).z.powi(2) - c[3] * at(0).x.powi(2),
            "y-cone" => at(0).x.powi(2) + at(0).z.powi(2) - c[3] * at(0).y.powi(2),
            "z-cone" => at(0).x.powi(2) + at(0).y.powi(2) - c[3] * at(0).z.powi(2),
            "quadric" => {
                x * (c[0] * x + c[3] * y + c[6])
                    + y * (c[1] * y + c[4] * z + c[7])
                    + z * (c[2] * z + c[5] * x + c[8])
                    + c[9]
            }
            torus => {
                let d = at(0);
                let (along, out) = match torus {
                    "x-torus" => (d.x, d.y.hypot(d.z)),
                    "y-torus" => (d.y, d.x.hypot(d.z)),
                    _ => (d.z, d.x.hypot(d.y)),
                };
                along * along / (c[4] * c[4]) + (out - c[3]).powi(2) / (c[5] * c[5]) - 1.0
            }
        }
    }

    fn random(r: &mut Random) -> Self {
        let at = |r: &mut Random| r.within(-0.8, 0.8);
        let p: Vec<f64> = (0..3).map(|_| at(r)).collect();
        let radius = r.within(0.2, 0.9);
        let kinds = [
            "x-plane",
            "y-plane",
            "z-plane",
            "plane",
            "x-cylinder",
            "y-cylinder",
            "z-cylinder",
            "sphere",
            "x-cone",
            "y-cone",
            "z-cone",
            "quadric",
            "x-torus",
            "y-torus",
            "z-torus",
        ];
        let kind = kinds[r.below(kinds.len())];
        let of = |more: &[f64]| p.iter().copied().chain(more.iter().copied()).collect();
        let numbers = match kind {
            "x-plane" | "y-plane" | "z-plane" => vec![p[0]],
            "plane" => of(&[r.within(-0.5, 0.5)]),
            "x-cylinder" | "y-cylinder" | "z-cylinder" => vec![p[0], p[1], radius],
            "sphere" => of(&[radius]),
            "x-cone" | "y-cone" | "z-cone" => of(&[r.within(0.1, 2.0)]),
            "quadric" => {
                let mut c: Vec<f64> = (0..9).map(|_| r.within(-1.0, 1.0)).collect();
                c.push(r.within(-0.3, 0.3));
                c
            }
            _ => {
                let minor = r.within(0.1, 0.35);
                of(&[r.within(0.4, 0.9), minor, minor])
            }
        };
        Self(kind, numbers)
    }
}

/// A region as it is written.
#[derive(Clone, Debug)]
enum Region {
    Side(i64),
    All(Vec<Self>),
    Any(Vec<Self>),
    Not(Box<Self>),
}

impl Region {
    fn holds(&self, surfaces: &BTreeMap<i64, Surface>, p: DVec3) -> bool {
        match self {
            Self::Side(id) => (surfaces[&id.abs()].value(p) > 0.0) == (*id > 0),
            Self::All(parts) => parts.iter().all(|q| q.holds(surfaces, p)),
            Self::Any(parts) => parts.iter().any(|q| q.holds(surfaces, p)),
            Self::Not(part) => !part.holds(surfaces, p),
        }
    }

    fn text(&self) -> String {
        let join = |parts: &[Self], by: &str| parts.iter().map(Self::text).collect::<Vec<_>>().join(by);
        match self {
            Self::Side(id) => id.to_string(),
            Self::All(parts) => format!("({})", join(parts, " ")),
            Self::Any(parts) => format!("({})", join(parts, " | ")),
            Self::Not(part) => format!("~({})", part.text()),
        }
    }
}

#[derive(Clone, Debug)]
struct Cell {
    id: i64,
    region: Region,
    fill: Option<i64>,
    translation: Option<DVec3>,
    rotation: Option<DVec3>,
}

impl Cell {
    /// A point in the frame of what fills it, by the matrix of OpenMC's reader.
    fn inner(&self, p: DVec3) -> DVec3 {
        let p = p - self.translation.unwrap_or_default();
        let Some(angles) = self.rotation else { return p };
        let [phi, theta, psi] = (-angles).to_array().map(f64::to_radians);
        let (sf, cf, st, ct, sp, cp) = (phi.sin(), phi.cos(), theta.sin(), theta.cos(), psi.sin(), psi.cos());
        DVec3::new(
            DVec3::new(ct * cp, -cf * sp + sf * st * cp, sf * sp + cf * st * cp).dot(p),
            DVec3::new(ct * sp, cf * cp + sf * st * sp, -sf * cp + cf * st * sp).dot(p),
            DVec3::new(-st, sf * ct, cf * ct).dot(p),
        )
    }
}

#[derive(Clone, Debug)]
struct Lattice {
    id: i64,
    /// Middles of tiles with what fills them, by layers from below, rows from above, from the left.
    tiles: Vec<(DVec3, i64)>,
    /// Half the sides, of rectangular tiles; the pitches of hexagonal ones.
    half: DVec3,
    is_hexagonal: bool,
    outer: Option<i64>,
    text: String,
}

impl Lattice {
    fn random(r: &mut Random, id: i64, universes: &[i64]) -> Self {
        let is_hexagonal = r.chance(0.5);
        let has_layers = r.chance(0.5);
        let outer = r.chance(0.7).then(|| universes[r.below(universes.len())]);
        let center = r.vector(0.3);
        let mut middles = Vec::new();
        let layers = if has_layers { 1 + r.below(2) } else { 1 };
        let height = r.within(0.4, 1.5);
        let (half, head);
        if is_hexagonal {
            let (rings, pitch, is_x) = (1 + r.below(3), r.within(0.3, 0.8), r.chance(0.5));
            // All middles within the outermost ring, by what a triangular grid is.
            let steps = if is_x { [(1.0, 0.0), (0.5, 0.75_f64.sqrt())] } else { [(0.0, 1.0), (0.75_f64.sqrt(), 0.5)] };
            let n = rings as i64 - 1;
            let mut flat = Vec::new();
            for i in -n..=n {
                for j in -n..=n {
                    if (i + j).abs() <= n {
                        let (i, j) = (i as f64, j as f64);
                        flat.push((
                            pitch * (i * steps[0].0 + j * steps[1].0),
                            pitch * (i * steps[0].1 + j * steps[1].1),
                        ));
                    }
                }
            }
            let key = |y: f64| -(y / pitch * 1e6).round() as i64;
            flat.sort_by(|p, q| key(p.1).cmp(&key(q.1)).then(p.0.total_cmp(&q.0)));
            for k in 0..layers {
                let z = if has_layers { center.z + (k as f64 + 0.5 - 0.5 * layers as f64) * height } else { 0.0 };
                middles.extend(flat.iter().map(|(x, y)| DVec3::new(center.x + x, center.y + y, z)));
            }
            half = DVec3::new(pitch, pitch, 0.5 * if has_layers { height } else { f64::INFINITY });
            let orientation = match (is_x, r.chance(0.5)) {
                (true, _) => " orientation=\"x\"",
                (false, true) => " orientation=\"y\"",
                _ => "",
            };
            head = if has_layers {
                format!(
                    "<hex_lattice id=\"{id}\" n_rings=\"{rings}\" n_axial=\"{layers}\"{orientation}><pitch>{pitch:?} {height:?}</pitch>\
                     <center>{:?} {:?} {:?}</center>",
                    center.x, center.y, center.z
                )
            } else {
                format!(
                    "<hex_lattice id=\"{id}\" n_rings=\"{rings}\"{orientation}><pitch>{pitch:?}</pitch><center>{:?} {:?}</center>",
                    center.x, center.y
                )
            };
        } else {
            let n = [1 + r.below(4), 1 + r.below(4), layers];
            let pitch = DVec3::new(r.within(0.3, 1.0), r.within(0.3, 1.0), height);
            let low = center - DVec3::new(0.5 * n[0] as f64 * pitch.x, 0.5 * n[1] as f64 * pitch.y, 0.5);
            for z in 0..n[2] {
                for y in (0..n[1]).rev() {
                    for x in 0..n[0] {
                        let mut at = low + pitch * DVec3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5);
                        at.z = if has_layers { at.z } else { 0.0 };
                        middles.push(at);
                    }
                }
            }
            half = DVec3::new(0.5 * pitch.x, 0.5 * pitch.y, if has_layers { 0.5 * pitch.z } else { f64::INFINITY });
            let more = |z: String| if has_layers { format!(" {z}") } else { String::new() };
            head = format!(
                "<lattice id=\"{id}\" dimension=\"{} {}{}\"><pitch>{:?} {:?}{}</pitch><lower_left>{:?} {:?}{}</lower_left>",
                n[0],
                n[1],
                more(n[2].to_string()),
                pitch.x,
                pitch.y,
                more(format!("{:?}", pitch.z)),
                low.x,
                low.y,
                more(format!("{:?}", low.z))
            );
        }
        let tiles: Vec<(DVec3, i64)> =
            middles.into_iter().map(|at| (at, universes[r.below(universes.len())])).collect();
        let words: Vec<String> = tiles.iter().map(|t| t.1.to_string()).collect();
        let around = outer.map_or(String::new(), |outer| format!("<outer>{outer}</outer>"));
        let end = if is_hexagonal { "hex_lattice" } else { "lattice" };
        let text = format!("{head}{around}<universes>{}</universes></{end}>\n", words.join(" "));
        Self { id, tiles, half, is_hexagonal, outer, text }
    }

    /// The universe that a point is in, and where there; the tiles around are those of the same grid.
    fn find(&self, p: DVec3) -> Option<(i64, DVec3)> {
        // The tile whose middle is nearest, or that holds it.
        let is_in = |at: DVec3| {
            let d = (p - at).abs();
            d.z <= self.half.z && if self.is_hexagonal { true } else { d.x <= self.half.x && d.y <= self.half.y }
        };
        if !self.is_hexagonal {
            if let Some((at, universe)) = self.tiles.iter().find(|(at, _)| is_in(*at)) {
                return Some((*universe, p - *at));
            }
            let first = self.tiles[0].0;
            let step = |k: usize| {
                if self.half[k].is_finite() {
                    ((p[k] - first[k]) / (2.0 * self.half[k])).round() * 2.0 * self.half[k]
                } else {
                    0.0
                }
            };
            let at = first + DVec3::new(step(0), step(1), step(2));
            return Some((self.outer?, p - at));
        }
        // Around the first one a grid of the same directions, large enough.
        let pitch = self.half.x;
        let is_x = self.text.contains("orientation=\"x\"");
        let steps = if is_x { [(1.0, 0.0), (0.5, 0.75_f64.sqrt())] } else { [(0.0, 1.0), (0.75_f64.sqrt(), 0.5)] };
        let first = self.tiles[0].0;
        let z = if self.half.z.is_finite() {
            first.z + ((p.z - first.z) / (2.0 * self.half.z)).round() * 2.0 * self.half.z
        } else {
            0.0
        };
        let mut best = (f64::INFINITY, DVec3::ZERO);
        for i in -11..=11 {
            for j in -11..=11 {
                let (i, j) = (f64::from(i), f64::from(j));
                let at = DVec3::new(
                    first.x + pitch * (i * steps[0].0 + j * steps[1].0),
                    first.y + pitch * (i * steps[0].1 + j * steps[1].1),
                    z,
                );
                let d = (p - at).truncate().length();
                if d < best.0 {
                    best = (d, at);
                }
            }
        }
        let known = self.tiles.iter().find(|(at, _)| at.distance(best.1) < 1e-6);
        let universe = known.map(|t| t.1).or(self.outer)?;
        Some((universe, p - best.1))
    }
}

#[derive(Clone, Debug, Default)]
struct Geometry {
    surfaces: BTreeMap<i64, Surface>,
    universes: BTreeMap<i64, Vec<Cell>>,
    lattices: BTreeMap<i64, Lattice>,
}

/// What is wrong at a point: two cells of a universe, a universe without a cell there, a lattice without a tile there.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Wrong {
    Both(i64, i64),
    Gap(i64),
    Around(i64),
}

impl Geometry {
    /// Everything that a point is in, one universe within the other: the universe, the point in its frame, and the cells that hold it.
    /// Of two cells both are followed.
    fn follow(&self, universe: i64, p: DVec3, out: &mut Vec<(i64, DVec3, Vec<i64>)>, around: &mut Vec<(i64, DVec3)>) {
        let cells: Vec<&Cell> =
            self.universes[&universe].iter().filter(|c| c.region.holds(&self.surfaces, p)).collect();
        out.push((universe, p, cells.iter().map(|c| c.id).collect()));
        for cell in cells {
            let Some(fill) = cell.fill else { continue };
            let inner = cell.inner(p);
            match self.lattices.get(&fill) {
                None => self.follow(fill, inner, out, around),
                Some(lattice) => match lattice.find(inner) {
                    Some((universe, q)) => self.follow(universe, q, out, around),
                    None => around.push((fill, inner)),
                },
            }
        }
    }

    /// What is wrong at a point of the root.
    fn wrong(&self, p: DVec3) -> BTreeSet<Wrong> {
        let (mut seen, mut around) = (Vec::new(), Vec::new());
        self.follow(0, p, &mut seen, &mut around);
        let mut out: BTreeSet<Wrong> = around.into_iter().map(|(id, _)| Wrong::Around(id)).collect();
        for (universe, _, cells) in seen {
            if cells.is_empty() && universe != 0 {
                out.insert(Wrong::Gap(universe));
            }
            for (i, a) in cells.iter().enumerate() {
                out.extend(cells[i + 1..].iter().map(|b| Wrong::Both(*a.min(b), *a.max(b))));
            }
        }
        out
    }

    fn text(&self, r: &mut Random) -> String {
        let mut out = String::from("<?xml version='1.0'?>\n<geometry>\n");
        for (id, Surface(kind, c)) in &self.surfaces {
            let c: Vec<String> = c.iter().map(|x| format!("{x:?}")).collect();
            out += &format!("<surface id=\"{id}\" type=\"{kind}\" coeffs=\"{}\"/>\n", c.join(" "));
        }
        for (universe, cells) in &self.universes {
            for cell in cells {
                let mut keys = vec![("id", cell.id.to_string()), ("region", cell.region.text())];
                if *universe != 0 || r.chance(0.5) {
                    keys.push(("universe", universe.to_string()));
                }
                let three = |v: DVec3| format!("{:?} {:?} {:?}", v.x, v.y, v.z);
                keys.push(cell.fill.map_or(("material", "void".into()), |fill| ("fill", fill.to_string())));
                keys.extend(cell.translation.map(|v| ("translation", three(v))));
                keys.extend(cell.rotation.map(|v| ("rotation", three(v))));
                if r.chance(0.5) {
                    let all: Vec<String> = keys.iter().map(|(k, v)| format!("{k}=\"{v}\"")).collect();
                    out += &format!("<cell {}/>\n", all.join(" "));
                } else {
                    let all: Vec<String> = keys.iter().map(|(k, v)| format!("<{k}>{v}</{k}>")).collect();
                    out += &format!("<cell>{}</cell>\n", all.join(""));
                }
            }
        }
        self.lattices.values().for_each(|l| out += &l.text);
        out + "</geometry>\n"
    }

    /// Splits space again and again: whatever is left belongs to one cell.
    fn random(r: &mut Random) -> Self {
        let mut g = Self::default();
        let mut next = 1;
        // A box, for the root.
        let walls: Vec<Region> = (0..6)
            .map(|k| {
                let kind = ["x-plane", "y-plane", "z-plane"][k / 2];
                let side = if k % 2 == 0 { 1 } else { -1 };
                g.surfaces.insert(k as i64 + 1, Surface(kind, vec![f64::from(-side) * SIZE]));
                Region::Side(i64::from(side) * (k as i64 + 1))
            })
            .collect();
        let depth = 1 + r.below(3);
        // Those that fill others come first.
        let mut inner: Vec<i64> = Vec::new();
        for level in (0..=depth).rev() {
            let count = if level == 0 { 1 } else { 1 + r.below(2) };
            let mut of_level = Vec::new();
            for _ in 0..count {
                let universe = if level == 0 { 0 } else { 100 + next };
                next += 1;
                let mut leaves: Vec<Vec<Region>> = vec![Vec::new()];
                for _ in 0..1 + r.below(3) {
                    let id = g.surfaces.len() as i64 + 1;
                    g.surfaces.insert(id, Surface::random(r));
                    let leaf = leaves.swap_remove(r.below(leaves.len()));
                    for side in [id, -id] {
                        let mut part = leaf.clone();
                        part.push(Region::Side(side));
                        leaves.push(part);
                    }
                }
                let mut regions: Vec<Region> = leaves.into_iter().map(Region::All).collect();
                // Two that become one, and some that are told by what they are not.
                if regions.len() > 2 && r.chance(0.5) {
                    let (a, b) = (regions.pop().expect("one"), regions.pop().expect("another"));
                    regions.push(Region::Any(vec![a, b]));
                }
                if r.chance(0.4) {
                    let others = regions.split_off(1);
                    regions[0] = Region::Not(Box::new(Region::Any(others.clone())));
                    regions.extend(others);
                }
                let cells = regions.into_iter().map(|region| {
                    let region =
                        if level == 0 { Region::All(walls.iter().cloned().chain([region]).collect()) } else { region };
                    next += 1;
                    let mut cell = Cell { id: next, region, fill: None, translation: None, rotation: None };
                    if !inner.is_empty() && r.chance(0.6) {
                        if r.chance(0.4) {
                            let lattice = Lattice::random(r, 5_000 + next, &inner);
                            cell.fill = Some(lattice.id);
                            g.lattices.insert(lattice.id, lattice);
                        } else {
                            cell.fill = Some(inner[r.below(inner.len())]);
                        }
                        cell.translation = r.chance(0.4).then(|| r.vector(0.4));
                        cell.rotation = r.chance(0.4).then(|| r.vector(180.0));
                    }
                    cell
                });
                let cells: Vec<Cell> = cells.collect();
                g.universes.insert(universe, cells);
                of_level.push(universe);
            }
            inner.extend(of_level);
        }
        // What is used nowhere would be another root.
        let used: BTreeSet<i64> = g
            .universes
            .values()
            .flatten()
            .filter_map(|c| c.fill)
            .chain(g.lattices.values().flat_map(|l| l.tiles.iter().map(|t| t.1).chain(l.outer)))
            .collect();
        g.universes.retain(|id, _| *id == 0 || used.contains(id));
        g
    }
}

/// Half a side of the root.
const SIZE: f64 = 1.2;
/// Deeper than this in each other nothing may be that is told as separate.
const TOLERANCE: f64 = 1e-6;

fn models(scene: &Scene) -> Vec<Arc<Model>> {
    let imports = scene.load_models(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
    imports.into_iter().map(|import| Arc::new(Model::new(import.solid))).collect()
}

fn overlaps(path: &Path, tolerance: f64) -> Found {
    let universes = read_openmc(path).unwrap_or_else(|e| panic!("{e}"));
    let whole = models(&scene_of_cells(path, &universes));
    let (found, suspects) = of_cells(&universes, &whole, Some(tolerance));
    let cut = models(&scene_of_uses(path, &universes, &suspects));
    decide(&universes, (&whole, &cut), (found, suspects), Some(tolerance))
}

/// The number behind a word.
fn number(name: &str) -> i64 {
    let digits: String = name.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    digits.parse().expect("a number")
}

/// What is told, with the points.
fn told(found: &Found) -> (BTreeMap<Wrong, DVec3>, usize) {
    let mut out = BTreeMap::new();
    let mut open = 0;
    for pair in &found.pairs {
        let Verdict::Overlap(at, _) = pair.verdict else {
            open += 1;
            continue;
        };
        let wrong = match &pair.b {
            Beside::Other(b) => {
                let [a, b] = [number(&pair.a), number(b)];
                Wrong::Both(a.min(b), a.max(b))
            }
            _ if pair.within.starts_with("lattice") => Wrong::Around(number(&pair.within)),
            _ => Wrong::Gap(number(&pair.within)),
        };
        out.insert(wrong, at);
    }
    (out, open)
}

/// Random points of the root: what is wrong at any of them must be told, unless it is less deep than the tolerance.
#[test]
fn what_random_points_find_is_told_and_nothing_that_is_not_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("geometry.xml");
    let first: u64 = sized("CONTACTD_OPENMC_SEED", 1);
    let (mut sampled, mut reported, mut clean, mut open, mut pairs) = (0, 0, 0, 0, 0);
    let count = sized("CONTACTD_OPENMC", 6_u64);
    for seed in first..first + count {
        let mut r = Random::new(seed);
        let mut g = Geometry::random(&mut r);
        // In two of three a cell grows, is lost, or is there twice.
        let ids: Vec<i64> = g.universes.keys().copied().collect();
        let universe = ids[r.below(ids.len())];
        let cells = g.universes.get_mut(&universe).expect("it");
        let k = r.below(cells.len());
        match r.below(3) {
            0 => {}
            1 => {
                let mut other = Surface::random(&mut r);
                while other.0.contains("torus") {
                    other = Surface::random(&mut r);
                }
                let id = g.surfaces.len() as i64 + 1;
                g.surfaces.insert(id, other);
                let region = cells[k].region.clone();
                cells[k].region = if universe == 0 {
                    Region::Any(vec![
                        region,
                        Region::All(
                            (1..7)
                                .map(|w| Region::Side(if w % 2 == 1 { w } else { -w }))
                                .chain([Region::Side(id)])
                                .collect(),
                        ),
                    ])
                } else {
                    Region::Any(vec![region, Region::Side(id)])
                };
            }
            _ if cells.len() > 1 && cells[k].fill.is_none() => drop(cells.remove(k)),
            _ => {}
        }
        let text = g.text(&mut r);
        std::fs::write(&path, &text).expect("written");
        let found = overlaps(&path, TOLERANCE);
        pairs += found.separate.iter().sum::<u64>() as usize + found.pairs.len();
        let (told, left) = told(&found);
        open += left;
        let mut seen: BTreeMap<Wrong, DVec3> = BTreeMap::new();
        for _ in 0..700 {
            let p = r.vector(SIZE);
            // Where a small way around the same is wrong it is no matter of a tolerance.
            let near = [DVec3::X, DVec3::Y, DVec3::Z].map(|d| [g.wrong(p + d * 1e-4), g.wrong(p - d * 1e-4)]);
            for wrong in g.wrong(p).into_iter().filter(|w| near.iter().flatten().all(|n| n.contains(w))) {
                seen.entry(wrong).or_insert(p);
            }
        }
        sampled += seen.len();
        for (wrong, at) in &seen {
            let is_open = left > 0;
            assert!(
                told.contains_key(wrong) || is_open,
                "seed {seed}: {wrong:?} at {at:?} is not told\n{found:?}\n{text}"
            );
        }
        for (wrong, at) in &told {
            assert!(g.is_so(wrong, *at), "seed {seed}: {wrong:?} at {at:?} is not there\n{text}");
            reported += 1;
        }
        clean += usize::from(told.is_empty() && left == 0);
    }
    println!(
        "{count} geometries, {pairs} pairs: {reported} overlaps and gaps are told and there, {sampled} of them found by random points; \
         {clean} geometries without any; {open} pairs not proven"
    );
    assert!(reported * 4 > count as usize && clean > 0 && open * 100 <= pairs + 200, "{reported} {clean} {open}");
}

impl Geometry {
    /// Whether a point of a universe, or of a lattice, is what it is said to be; and that it is seen.
    fn is_so(&self, wrong: &Wrong, at: DVec3) -> bool {
        let holding = |universe: i64| -> Vec<i64> {
            self.universes[&universe].iter().filter(|c| c.region.holds(&self.surfaces, at)).map(|c| c.id).collect()
        };
        let owner =
            |cell: i64| self.universes.iter().find(|(_, cells)| cells.iter().any(|c| c.id == cell)).map(|u| *u.0);
        let (room, is_wrong) = match wrong {
            Wrong::Both(a, b) => {
                let universe = owner(*a).expect("a universe");
                let cells = holding(universe);
                (universe, cells.contains(a) && cells.contains(b))
            }
            Wrong::Gap(universe) => (*universe, holding(*universe).is_empty()),
            Wrong::Around(lattice) => (*lattice, self.lattices[lattice].find(at).is_none()),
        };
        is_wrong && self.is_seen(room, at, 0)
    }

    /// Whether a point of a universe or lattice can be come to from the root.
    fn is_seen(&self, room: i64, at: DVec3, depth: usize) -> bool {
        if room == 0 {
            return true;
        }
        for (universe, cells) in &self.universes {
            for cell in cells {
                let Some(fill) = cell.fill else { continue };
                let mut inner = Vec::new();
                if fill == room {
                    inner.push(at);
                } else if let Some(lattice) = self.lattices.get(&fill) {
                    // Any tile that it could be of.
                    inner.extend(lattice.sources(room, at));
                }
                for q in inner {
                    let p = cell.outer(q);
                    // A little off, where rounding decides.
                    let is_in = cell.region.holds(&self.surfaces, p);
                    if is_in && depth < 10 && self.is_seen(*universe, p, depth + 1) {
                        return true;
                    }
                }
            }
        }
        false
    }
}

impl Cell {
    /// A point of what fills it in its own frame.
    fn outer(&self, q: DVec3) -> DVec3 {
        let turned = if self.rotation.is_some() {
            // The matrix turns: its transpose turns back.
            let column = |d: DVec3| Self { translation: None, ..self.clone() }.inner(d);
            let [x, y, z] = [column(DVec3::X), column(DVec3::Y), column(DVec3::Z)];
            DVec3::new(x.dot(q), y.dot(q), z.dot(q))
        } else {
            q
        };
        turned + self.translation.unwrap_or_default()
    }
}

impl Lattice {
    /// Points of the lattice that are this one of a universe in it.
    fn sources(&self, universe: i64, at: DVec3) -> Vec<DVec3> {
        let mut out = Vec::new();
        let mut middles: Vec<DVec3> = self.tiles.iter().filter(|t| t.1 == universe).map(|t| t.0).collect();
        if self.outer == Some(universe) {
            // The grid goes on: whatever is found from near the middles of all tiles that could be.
            let first = self.tiles[0].0;
            for i in -11..=11 {
                for j in -11..=11 {
                    for k in if self.half.z.is_finite() { -8..=8 } else { 0..=0 } {
                        let (i, j, k) = (f64::from(i), f64::from(j), f64::from(k));
                        let z = if self.half.z.is_finite() { 2.0 * k * self.half.z } else { 0.0 };
                        let flat = if self.is_hexagonal {
                            let is_x = self.text.contains("orientation=\"x\"");
                            let s = 0.75_f64.sqrt() * self.half.x;
                            if is_x {
                                DVec3::new(i * self.half.x + 0.5 * j * self.half.x, j * s, z)
                            } else {
                                DVec3::new(j * s, i * self.half.x + 0.5 * j * self.half.x, z)
                            }
                        } else {
                            DVec3::new(2.0 * i * self.half.x, 2.0 * j * self.half.y, z)
                        };
                        middles.push(first + flat);
                    }
                }
            }
        }
        for middle in middles {
            let p = middle + at;
            // No point of the root is farther off, whatever moves it.
            if p.length() < 4.0 && self.find(p).is_some_and(|(u, q)| u == universe && q.distance(at) < 1e-9) {
                out.push(p);
            }
        }
        out
    }
}

/// Of a lattice one tile is filled with two cells that overlap: that is told where a cell shows this tile, and not where it shows another.
#[test]
fn each_tile_of_a_lattice_is_where_it_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("geometry.xml");
    let mut r = Random::new(5);
    let mut several = 0;
    for k in 0..16 {
        let lattice = Lattice::random(&mut r, 7, &[1]);
        let count = lattice.tiles.len();
        let (bad, other) = (r.below(count), r.below(count));
        let words = |n: usize| (0..n).map(|i| if i == bad { "2" } else { "1" }).collect::<Vec<_>>().join(" ");
        let all = vec!["1"; count].join(" ");
        let text = lattice.text.replace(&format!("<universes>{all}<"), &format!("<universes>{}<", words(count)));
        assert_ne!(text, lattice.text);
        for (shown, is_told) in [(bad, true), (other, other == bad)] {
            let at = lattice.tiles[shown].0;
            // Layers are as high as they are; a tile is 0.3 wide at least.
            let walls: String = (0..6)
                .map(|w| {
                    let kind = ["x-plane", "y-plane", "z-plane"][w / 2];
                    let off = if w % 2 == 0 { -0.1 } else { 0.1 };
                    format!("<surface id=\"{}\" type=\"{kind}\" coeffs=\"{:?}\"/>", w + 1, at[w / 2] + off)
                })
                .collect();
            let geometry = format!(
                "<geometry>{walls}<cell id=\"1\" fill=\"7\" region=\"1 -2 3 -4 5 -6\"/>{text}\
                 <cell id=\"2\" universe=\"1\" material=\"void\"/>\
                 <cell id=\"3\" universe=\"2\" material=\"void\"/><cell id=\"4\" universe=\"2\" material=\"void\"/></geometry>"
            );
            std::fs::write(&path, &geometry).expect("written");
            let (told, open) = told(&overlaps(&path, 1e-6));
            let expected: Vec<Wrong> = is_told.then_some(Wrong::Both(3, 4)).into_iter().collect();
            assert_eq!(
                (told.into_keys().collect::<Vec<_>>(), open),
                (expected, 0),
                "{k}: tile {bad}, {shown} shown\n{geometry}"
            );
        }
        several += usize::from(other != bad);
    }
    assert!(several > 8, "{several}");
}

/// A lattice of many universes, each of a core, a layer around it and the rest. In some the layer begins too soon or too late by a known
/// depth: an overlap, or a gap. What is as thin as that holds a ball of half of it.
#[test]
fn overlaps_and_gaps_of_a_known_depth_are_found_and_no_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("model.xml");
    let mut r = Random::new(sized("CONTACTD_OPENMC_SEED", 1_u64));
    let (mut all, mut right, mut least) = (0, 0, f64::INFINITY);
    for k in 0..sized("CONTACTD_OPENMC", 8_u64).div_ceil(4) {
        let (columns, rows) = (2 + r.below(6), 2 + r.below(4));
        let (mut surfaces, mut cells) = (String::new(), String::new());
        let mut planted = BTreeMap::new();
        for n in 1..=(columns * rows) as i64 {
            let (radius, thick) = (r.within(0.1, 0.3), r.within(0.05, 0.15));
            let depth = 10.0_f64.powf(r.within(-9.0, -1.5));
            let off = match r.below(3) {
                0 => depth,
                1 => -depth,
                _ => 0.0,
            };
            if off != 0.0 {
                planted.insert(n, off);
            }
            let center = r.vector(0.05);
            let kind = ["z-cylinder", "x-cylinder", "sphere", "plane", "y-plane", "z-torus"][r.below(6)];
            let turn = r.direction();
            for (i, at) in [radius, radius + off, radius + thick].into_iter().enumerate() {
                let c = match kind {
                    "z-cylinder" | "x-cylinder" => format!("{:?} {:?} {at:?}", center.x, center.y),
                    "sphere" => format!("{:?} {:?} {:?} {at:?}", center.x, center.y, center.z),
                    "y-plane" => format!("{at:?}"),
                    "z-torus" => format!("{:?} {:?} 0.0 0.48 {at:?} {at:?}", center.x, center.y),
                    // Not of length 1.
                    _ => format!("{:?} {:?} {:?} {:?}", 3.0 * turn.x, 3.0 * turn.y, 3.0 * turn.z, 3.0 * (at - 0.2)),
                };
                surfaces += &format!("<surface id=\"{}\" type=\"{kind}\" coeffs=\"{c}\"/>\n", 10 * n + i as i64);
            }
            let s = 10 * n;
            for (i, region) in
                [format!("-{s}"), format!("{} -{}", s + 1, s + 2), format!("+{}", s + 2)].iter().enumerate()
            {
                cells +=
                    &format!("<cell id=\"{}\" universe=\"{n}\" material=\"1\" region=\"{region}\"/>\n", s + i as i64);
            }
        }
        let words: Vec<String> = (1..=columns * rows).map(|n| n.to_string()).collect();
        let (x, y) = (0.5 * columns as f64, 0.5 * rows as f64);
        let text = format!(
            "<model><materials/><geometry>\n{surfaces}{cells}\
             <surface id=\"1\" type=\"x-plane\" coeffs=\"{:?}\"/><surface id=\"2\" type=\"x-plane\" coeffs=\"{x:?}\"/>\
             <surface id=\"3\" type=\"y-plane\" coeffs=\"{:?}\"/><surface id=\"4\" type=\"y-plane\" coeffs=\"{y:?}\"/>\
             <surface id=\"5\" type=\"z-plane\" coeffs=\"-0.5\"/><surface id=\"6\" type=\"z-plane\" coeffs=\"0.5\"/>\
             <cell id=\"1\" fill=\"1000\" region=\"1 -2 3 -4 5 -6\"/>\n\
             <lattice id=\"1000\" dimension=\"{columns} {rows}\" pitch=\"1 1\" lower_left=\"{:?} {:?}\" universes=\"{}\"/>\
             </geometry></model>",
            -x,
            -y,
            -x,
            -y,
            words.join(" ")
        );
        std::fs::write(&path, &text).expect("written");
        let found = overlaps(&path, 2e-10);
        for pair in &found.pairs {
            let universe = number(&pair.within);
            let Verdict::Overlap(_, depth) = pair.verdict else { panic!("{k}: {pair:?}\n{text}") };
            let off = planted.remove(&universe).unwrap_or_else(|| panic!("{k}: {pair:?} was not planted\n{text}"));
            let is_gap = pair.b == Beside::Nothing;
            assert!(is_gap == (off > 0.0), "{k}: {pair:?}, planted {off}");
            assert!(depth <= 0.5 * off.abs() + 1e-12 && depth > 2e-10, "{k}: {depth} of {off}\n{text}");
            least = least.min(off.abs());
            all += 1;
        }
        assert!(planted.is_empty(), "{k}: {planted:?} were not found: {:?}\n{text}", found.pairs);
        right += columns * rows;
    }
    println!("{all} of {right} universes were made wrong, by {least:.1e} at least: found, and no other");
    assert!(all * 3 > right, "{all} of {right}");
}

/// What is wrong with a file is one sentence with its place.
#[test]
fn what_is_wrong_is_told_in_one_sentence_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("geometry.xml");
    let of = |inner: &str| {
        std::fs::write(&path, format!("<geometry>\n{inner}\n</geometry>")).expect("written");
        let told = read_openmc(&path).map(|u| u.notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "));
        match told {
            Ok(notes) => format!("notes: {notes}"),
            Err(e) => e.to_string().rsplit_once("geometry.xml:").expect("a place").1.to_owned(),
        }
    };
    let ball = "<surface id='1' type='sphere' coeffs='0 0 0 1'/>";
    let cases = [
        ("", "1:1: expected cells in the geometry, found none"),
        (
            "<surface id='1' type='sphere' coeffs='0 0 0'/>",
            "2:1: expected 4 numbers as coeffs of the sphere, found \"0 0 0\"",
        ),
        (
            "<surface id='1' type='sphere' coeffs='0 0 0 -1'/>",
            "2:1: expected a positive radius as the last of the coeffs of the sphere, found \"0 0 0 -1\"",
        ),
        (
            "<surface id='1' type='x-torus' coeffs='0 0 0 3 1 2'/>",
            "2:1: expected a supported construct, found a x-torus of an elliptic section, which is not supported",
        ),
        (
            "<surface id='1' type='ball' coeffs='0 0 0 1'/>",
            "2:1: expected a supported construct, found the surface ball, which is not supported",
        ),
        (
            "<dagmc_universe id='1' filename='a.h5m'/>",
            "2:1: expected a supported construct, found <dagmc_universe>, which is not supported",
        ),
        ("<cell id='1' region='-7' material='1'/>", "2:49: expected the id of a surface in the region, found 7"),
        (
            "<cell id='1' region='-1 | ' material='1'/>",
            "2:49: expected a surface, ~ or ( in the region, found the region's end",
        ),
        ("<cell id='1' region='(-1' material='1'/>", "2:49: expected ) in the region, found the region's end"),
        ("<cell id='1' region='-1)' material='1'/>", "2:49: expected a surface, |, ~ or ( in the region, found \")\""),
        ("<cell id='1' region='-1' fill='9'/>", "2:49: expected the id of a universe or lattice as the fill, found 9"),
        (
            "<cell id='1' material='1' region='-1' rotation='0 0 1'/>",
            "2:49: expected a fill of a cell with a translation or rotation, found none",
        ),
        (
            "<cell id='1' material='1'/><cell id='1' material='1'/>",
            "2:76: expected an id that no other cell has, found \"1\"",
        ),
        (
            "<cell id='1' fill='2'/><cell id='2' universe='2' fill='3'/><cell id='3' universe='3' fill='2'/>",
            "2:72: expected universes that are not in themselves, found universe 2 in itself",
        ),
        ("<cell id='1' region='-1'/>", "2:49: expected either a material or a fill of cell 1, found \"neither\""),
        (
            "<cell id='1' region='-1' material='1' fill='2'/>",
            "2:49: expected either a material or a fill of cell 1, found \"both\"",
        ),
        (
            "<cell id='1' region='-1' material='1'/><cell id='2' universe='5' material='1'/>",
            "notes: 2:88: universe 5 is left out: it fills nothing, and universe 0 is the root",
        ),
        (
            "<cell id='1' region='-1' material='1' densty='2'/>",
            "notes: 2:49: <cell> has no attribute \"densty\": it is left out",
        ),
        (
            "<cell id='1' region='1' material='1'/>",
            "notes: 2:49: universe 0 has no end: it is asked of within x from -3 to 3, y from -3 to 3, z from -3 to 3 (centimetres)",
        ),
    ];
    for (inner, sentence) in cases {
        let inner = if inner.contains("<cell") { format!("{ball}{inner}") } else { inner.to_owned() };
        assert_eq!(of(&inner), sentence, "{inner}");
    }
}
