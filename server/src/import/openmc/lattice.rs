//! Lattices: tiles of one size, each filled with a universe.

use super::region::Region;
use super::surface::Surface;
use super::{Result, array, needed, value};
use crate::import::{Place, Problem, xml};
use crate::math::Aabb;
use glam::{DVec2, DVec3};
use roxmltree::Node;
use std::collections::{BTreeSet, HashMap};

/// Tiles of a lattice, and those around it that its outer universe fills, at most.
pub(super) const MOST_TILES: usize = 1_000_000;

/// A lattice of rectangular or of hexagonal tiles.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    /// Its id.
    pub(super) id: i64,
    /// Where the file has it.
    pub(super) at: Place,
    /// The universe around it.
    pub(super) outer: Option<i64>,
    tiling: Tiling,
    /// Universes by the places of tiles.
    universes: HashMap<[i64; 3], i64>,
    /// What is within a hexagonal tile about the origin; everywhere of rectangular ones, whose boxes say it.
    pub(super) prism: Region,
    /// Half the sides of the box around a tile; without end along z where the lattice has no layers.
    half: DVec3,
}

/// Where tiles are.
#[derive(Clone, Debug)]
struct Tiling {
    /// The middle of tile 0, 0, 0.
    origin: DVec3,
    /// From a tile to the next.
    steps: [DVec3; 3],
    has_layers: bool,
}

/// A tile.
pub(super) struct Tile {
    /// The universe that fills it; `None` where the lattice has none.
    pub(super) universe: Option<i64>,
    /// Its middle.
    pub(super) center: DVec3,
    /// The box around it.
    pub(super) around: Aabb,
}

impl Lattice {
    /// Reads a `lattice` or `hex_lattice`; planes of hexagonal tiles are added to the surfaces.
    pub(super) fn read(node: Node<'_, '_>, surfaces: &mut Vec<Surface>) -> Result<Self> {
        let id = super::id(node, "id")?;
        let outer = value(node, "outer").map(|_| super::id(node, "outer")).transpose()?;
        let words: Vec<i64> = needed(node, "universes")?
            .split_whitespace()
            .map(|w| w.parse().map_err(|_| xml::wrong(node, "ids of universes in the lattice", Some(w))))
            .collect::<Result<_>>()?;
        if words.len() > MOST_TILES {
            return Err((xml::place(node), Problem::Limit { what: "tiles of a lattice", limit: MOST_TILES }));
        }
        let mut lattice = Self {
            id,
            at: xml::place(node),
            outer,
            tiling: Tiling { origin: DVec3::ZERO, steps: [DVec3::X, DVec3::Y, DVec3::Z], has_layers: false },
            universes: HashMap::new(),
            prism: Region::All(Vec::new()),
            half: DVec3::ONE,
        };
        if node.tag_name().name() == "lattice" {
            lattice.rectangular(node, &words)?;
        } else {
            lattice.hexagonal(node, &words, surfaces)?;
        }
        Ok(lattice)
    }

    /// Rows from the top down, layers from the bottom up.
    fn rectangular(&mut self, node: Node<'_, '_>, words: &[i64]) -> Result<()> {
        let counts: Vec<i64> = array(node, "dimension")?.into_iter().map(|x| x as i64).collect();
        let (pitch, low) = (array(node, "pitch")?, array(node, "lower_left")?);
        let axes = counts.len();
        let is_whole = (2..=3).contains(&axes) && counts.iter().all(|n| (1..=MOST_TILES as i64).contains(n));
        if !is_whole || pitch.len() != axes || low.len() != axes || pitch.iter().any(|p| *p <= 0.0) {
            let expected = "a dimension of 2 or 3 whole numbers, and as many positive ones as pitch and as lower_left";
            return Err(xml::wrong(node, expected, value(node, "dimension").as_deref()));
        }
        let tiles = counts.iter().try_fold(1_i64, |n, k| n.checked_mul(*k)).unwrap_or(i64::MAX);
        if words.len() as i64 != tiles {
            let expected = format!("{tiles} universes in the lattice");
            return Err(xml::wrong(node, expected, Some(&words.len().to_string())));
        }
        for (k, universe) in (0_i64..).zip(words) {
            let (x, y, z) = (k % counts[0], k / counts[0] % counts[1], k / (counts[0] * counts[1]));
            self.universes.insert([x, counts[1] - 1 - y, z], *universe);
        }
        self.half = DVec3::INFINITY;
        for k in 0..axes {
            self.half[k] = 0.5 * pitch[k];
            self.tiling.steps[k] = DVec3::AXES[k] * pitch[k];
            self.tiling.origin[k] = low[k] + 0.5 * pitch[k];
        }
        self.tiling.has_layers = axes == 3;
        Ok(())
    }

    /// Rings, in rows from the top down, layers from the bottom up. In coordinates of two steps that enclose an angle of 60 degrees a
    /// tile is in the lattice where both and their sum stay below the number of rings.
    fn hexagonal(&mut self, node: Node<'_, '_>, words: &[i64], surfaces: &mut Vec<Surface>) -> Result<()> {
        let rings = super::id(node, "n_rings")?;
        let layers = value(node, "n_axial").map(|_| super::id(node, "n_axial")).transpose()?;
        let (center, pitch) = (array(node, "center")?, array(node, "pitch")?);
        let axes = if layers.is_some() { 3 } else { 2 };
        let is_sized = (1..=1_000).contains(&rings) && layers.is_none_or(|n| (1..=MOST_TILES as i64).contains(&n));
        if !is_sized || center.len() != axes || pitch.len() != axes - 1 || pitch.iter().any(|p| *p <= 0.0) {
            let expected =
                "n_rings, a center of 2 numbers (3 with n_axial) and a pitch of 1 (2 with n_axial), positive";
            return Err(xml::wrong(node, expected, value(node, "n_rings").as_deref()));
        }
        let of_layer = 3 * rings * rings - 3 * rings + 1;
        let tiles = layers.unwrap_or(1).saturating_mul(of_layer);
        if words.len() as i64 != tiles {
            let expected = format!("{tiles} universes in the hex_lattice");
            return Err(xml::wrong(node, expected, Some(&words.len().to_string())));
        }
        let is_x = match value(node, "orientation").as_deref().unwrap_or("y") {
            "x" => true,
            "y" => false,
            other => return Err(xml::wrong(node, "x or y as the orientation", Some(other))),
        };
        // cos 30°, by which rows stand closer than tiles in them.
        let closer = 0.75_f64.sqrt();
        let p = pitch[0];
        // Along a step of y orientation x grows and y by half, of x orientation the other way around.
        let (first, second) = if is_x {
            (DVec2::new(p, 0.0), DVec2::new(0.5 * p, closer * p))
        } else {
            (DVec2::new(closer * p, 0.5 * p), DVec2::new(0.0, p))
        };
        self.tiling.steps = [first.extend(0.0), second.extend(0.0), DVec3::Z];
        self.tiling.origin = DVec3::new(center[0], center[1], 0.0);
        self.half = if is_x {
            DVec3::new(0.5 * p, p / 3.0_f64.sqrt(), f64::INFINITY)
        } else {
            DVec3::new(p / 3.0_f64.sqrt(), 0.5 * p, f64::INFINITY)
        };
        if let Some(layers) = layers {
            self.tiling.has_layers = true;
            self.tiling.steps[2] = DVec3::Z * pitch[1];
            self.tiling.origin.z = center[2] - 0.5 * (layers - 1) as f64 * pitch[1];
            self.half.z = 0.5 * pitch[1];
        }
        // All places of a layer, in the order of the text: rows from the top, in a row from the left.
        let last = rings - 1;
        let mut places: Vec<[i64; 2]> = (-last..=last)
            .flat_map(|i| (-last..=last).map(move |j| [i, j]))
            .filter(|[i, j]| (i + j).abs() <= last)
            .collect();
        // Twice the height in rows of half a pitch, or in whole rows.
        places.sort_by_key(|[i, j]| if is_x { (-j, *i) } else { (-(2 * j + i), *i) });
        for (k, universe) in words.iter().enumerate() {
            let [i, j] = places[k % places.len()];
            self.universes.insert([i, j, (k / places.len()) as i64], *universe);
        }
        let mut sides = Vec::new();
        for k in 0..6 {
            let of = if k < 3 { [first, second, second - first][k] } else { -[first, second, second - first][k - 3] };
            sides.push(Region::Side { surface: surfaces.len(), outside: false });
            surfaces.push(Surface::Plane { normal: (of / p).extend(0.0), offset: 0.5 * p });
        }
        self.prism = Region::All(sides);
        Ok(())
    }

    /// The universes in it and around it.
    pub(super) fn filling(&self) -> BTreeSet<i64> {
        self.universes.values().copied().chain(self.outer).collect()
    }

    /// The tiles that a box may reach, those around the lattice among them; `None`: more than may be.
    pub(super) fn tiles(&self, reached: &Aabb) -> Option<Vec<Tile>> {
        let Tiling { origin, steps: [a, b, c], has_layers } = &self.tiling;
        // The coordinates of the box's corners in steps.
        let back = glam::DMat2::from_cols(a.truncate(), b.truncate()).inverse();
        let around = Aabb { min: reached.min - *origin, max: reached.max - *origin };
        let corners = around.corners().map(|x| back * x.truncate());
        let grow = 1.0;
        let range = |of: [f64; 8]| {
            let (low, high) = of.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
            ((low - grow).floor(), (high + grow).ceil())
        };
        let (i, j) = (range(corners.map(|x| x.x)), range(corners.map(|x| x.y)));
        let k = if *has_layers {
            ((around.min.z / c.z - grow).floor(), (around.max.z / c.z + grow).ceil())
        } else {
            (0.0, 0.0)
        };
        let count = [i, j, k].iter().map(|(low, high)| high - low + 1.0).product::<f64>();
        if count.is_nan() || count > MOST_TILES as f64 {
            return None;
        }
        let mut tiles = Vec::new();
        for z in k.0 as i64..=k.1 as i64 {
            for y in j.0 as i64..=j.1 as i64 {
                for x in i.0 as i64..=i.1 as i64 {
                    let center = *origin + *a * x as f64 + *b * y as f64 + *c * z as f64;
                    let tile = Aabb { min: center - self.half, max: center + self.half };
                    let common = tile.intersection(reached);
                    // What meets in a side alone is not reached.
                    if !(common.max - common.min).cmpgt(1e-12 * (reached.max - reached.min)).all() {
                        continue;
                    }
                    let universe = self.universes.get(&[x, y, z]).copied().or(self.outer);
                    tiles.push(Tile { universe, center, around: common });
                }
            }
        }
        Some(tiles)
    }
}
