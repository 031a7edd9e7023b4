//! Where each universe is seen.

use super::lattice::Tile;
use super::logic;
use super::region::{Region, Within, block_text};
use super::surface::Surface;
use super::{Cell, Geometry, Result, Universe, Universes, Use};
use crate::import::written::placed;
use crate::import::{Note, Problem};
use crate::math::Aabb;
use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

/// Places in which one universe is seen at most, those that are alike counted once.
const MOST_USES: usize = 20_000;
/// Cells of a universe at most of which it is asked whether they leave a gap.
const MOST_FILLING: usize = 500;

/// What cuts off, in its own frame, which stands there.
#[derive(Clone, Debug)]
struct Cut {
    by: By,
    pose: Pose,
}

#[derive(Clone, Debug)]
enum By {
    Region(Region),
    Block(Aabb),
}

impl Cut {
    /// What it leaves of a box in the frame that it stands in.
    fn within(&self, geometry: &Geometry, around: &Aabb) -> Within {
        let own = boxed(&self.pose.inverse(), around);
        let left = match &self.by {
            By::Region(region) => region.within(&geometry.surfaces, &own),
            By::Block(block) => {
                let common = block.intersection(&own);
                if common == own {
                    Within::Whole
                } else if common.is_empty() {
                    Within::Nothing
                } else {
                    Within::Text(block_text(block))
                }
            }
        };
        match left {
            Within::Text(text) => Within::Text(placed(&self.pose, &text)),
            other => other,
        }
    }
}

/// A place in which something is seen: what is common to a box and to some regions.
#[derive(Clone, Debug)]
struct Seen {
    around: Aabb,
    cuts: Vec<Cut>,
}

/// Where something is seen.
#[derive(Debug)]
struct Places {
    seen: Vec<Seen>,
    /// What tells them apart.
    keys: HashSet<String>,
    /// A box around all of them, those too that were too many to be kept.
    block: Aabb,
    is_cut_short: bool,
}

impl Default for Places {
    fn default() -> Self {
        Self { seen: Vec::new(), keys: HashSet::new(), block: Aabb::EMPTY, is_cut_short: false }
    }
}

/// A universe, or what is around a lattice that has no outer one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Room {
    Universe(i64),
    Around(i64),
}

/// The box around another one that stands somewhere.
fn boxed(pose: &Pose, of: &Aabb) -> Aabb {
    if *pose == Pose::IDENTITY { *of } else { Aabb::of_points(of.corners().map(|c| pose.point(c))) }
}

impl Geometry {
    /// All universes with where they are seen.
    pub(super) fn seen(&self) -> Result<Universes> {
        let mut out = Universes::default();
        let root = self.root(&mut out.notes)?;
        let mut rooms: BTreeMap<Room, Places> = BTreeMap::new();
        let block = self.root_block(root, &mut out.notes);
        self.add(Room::Universe(root), Seen { around: block, cuts: Vec::new() }, &mut rooms);
        for universe in self.order(root)? {
            let Some(places) = rooms.get(&Room::Universe(universe)) else { continue };
            let (seen, is_cut_short) = (places.seen.clone(), places.is_cut_short);
            if is_cut_short {
                let at = self.cells[self.universes[&universe][0]].at;
                let text = format!(
                    "universe {universe} is seen in more than {MOST_USES} ways: what is in it is asked of in those"
                );
                out.notes.push(Note { at, text, amount: None });
            }
            for index in &self.universes[&universe] {
                let cell = &self.cells[*index];
                let Some(fill) = cell.fill else { continue };
                for place in &seen {
                    let around = cell.region.narrow(&self.surfaces, &place.around);
                    if around.is_empty() {
                        continue;
                    }
                    let back = cell.pose.inverse();
                    let mut inner = Seen { around: boxed(&back, &around), cuts: place.cuts.clone() };
                    inner.cuts.iter_mut().for_each(|cut| cut.pose = back.compose(&cut.pose));
                    // A box that is turned is told by one around it.
                    if cell.pose.rotation != DQuat::IDENTITY {
                        inner.cuts.push(Cut { by: By::Block(around), pose: back });
                    }
                    inner.cuts.push(Cut { by: By::Region(cell.region.clone()), pose: back });
                    self.fill(fill, &inner, &mut rooms)?;
                }
            }
        }
        let surfaces: Arc<[Surface]> = self.surfaces.as_slice().into();
        for (room, places) in rooms {
            out.universes.push(self.made(room, &places, &surfaces, (room == Room::Universe(root), &mut out.notes)));
        }
        Ok(out)
    }

    /// What fills something is seen there.
    fn fill(&self, fill: i64, seen: &Seen, rooms: &mut BTreeMap<Room, Places>) -> Result<()> {
        let Some(lattice) = self.lattices.get(&fill) else {
            self.add(Room::Universe(fill), seen.clone(), rooms);
            return Ok(());
        };
        let Some(tiles) = lattice.tiles(&seen.around) else {
            return Err((
                lattice.at,
                Problem::Limit { what: "tiles in a cell that a lattice fills", limit: super::lattice::MOST_TILES },
            ));
        };
        for Tile { universe, center, around } in tiles {
            let mut cuts = seen.cuts.clone();
            cuts.push(Cut { by: By::Region(lattice.prism.clone()), pose: Pose::at(center) });
            let mut tile = Seen { around, cuts };
            let Some(universe) = universe else {
                self.add(Room::Around(fill), tile, rooms);
                continue;
            };
            tile.cuts.iter_mut().for_each(|cut| cut.pose.position -= center);
            tile.around = Aabb { min: around.min - center, max: around.max - center };
            self.add(Room::Universe(universe), tile, rooms);
        }
        Ok(())
    }

    /// Notes a place in which something is seen, unless there is one like it.
    fn add(&self, room: Room, mut seen: Seen, rooms: &mut BTreeMap<Room, Places>) {
        let mut texts = Vec::new();
        let mut is_nowhere = false;
        seen.cuts.retain(|cut| match cut.within(self, &seen.around) {
            Within::Whole => false,
            Within::Nothing => {
                is_nowhere = true;
                false
            }
            Within::Text(text) => {
                texts.push(text);
                true
            }
        });
        if is_nowhere {
            return;
        }
        // Tiles differ by rounding alone.
        let digits = |v: DVec3| (v / (1e-9 * seen.around.half().length())).round();
        let key = format!("{} {} {}", digits(seen.around.min), digits(seen.around.max), texts.join(" "));
        let places = rooms.entry(room).or_default();
        if !places.keys.contains(&key) {
            places.block = places.block.union(&seen.around);
            // One that is the same everywhere looks the same anywhere.
            let is_told = self.is_one_cell(room) && !places.seen.is_empty();
            if places.seen.len() < MOST_USES && !is_told {
                places.keys.insert(key);
                places.seen.push(seen);
            } else {
                places.is_cut_short |= !is_told;
            }
        }
    }

    /// True for a universe of one cell that is everywhere and that nothing fills.
    fn is_one_cell(&self, room: Room) -> bool {
        let Room::Universe(id) = room else { return false };
        let [only] = self.universes[&id].as_slice() else { return false };
        let cell = &self.cells[*only];
        cell.fill.is_none() && cell.region == Region::All(Vec::new())
    }

    /// The universe that fills nothing.
    fn root(&self, notes: &mut Vec<Note>) -> Result<i64> {
        let mut filling = BTreeSet::new();
        for cell in &self.cells {
            let Some(fill) = cell.fill else { continue };
            if !self.lattices.contains_key(&fill) && !self.universes.contains_key(&fill) {
                let expected = "the id of a universe or lattice as the fill";
                return Err((cell.at, Problem::syntax(expected, fill.to_string())));
            }
            filling.insert(fill);
        }
        for lattice in self.lattices.values() {
            for universe in lattice.filling() {
                if !self.universes.contains_key(&universe) {
                    let expected = "ids of universes in the lattice";
                    return Err((lattice.at, Problem::syntax(expected, universe.to_string())));
                }
                filling.insert(universe);
            }
        }
        let mut roots = self.universes.keys().filter(|u| !filling.contains(u));
        let first = &self.cells[0];
        let none = || (first.at, Problem::syntax("a universe that fills nothing, as the root", "none"));
        let root = *roots.next().ok_or_else(none)?;
        for other in roots {
            let cell = &self.cells[self.universes[other][0]];
            let text = format!("universe {other} is left out: it fills nothing, and universe {root} is the root");
            notes.push(Note { at: cell.at, text, amount: None });
        }
        Ok(root)
    }

    /// Universes, each before those that are in it.
    fn order(&self, root: i64) -> Result<Vec<i64>> {
        let mut after = Vec::new();
        // How far each has been come: begun, or done.
        let mut done: BTreeMap<i64, bool> = BTreeMap::new();
        let mut open = vec![(root, false)];
        while let Some((universe, is_done)) = open.pop() {
            if is_done {
                done.insert(universe, true);
                after.push(universe);
                continue;
            }
            match done.get(&universe) {
                Some(true) => continue,
                Some(false) => {
                    let cell = &self.cells[self.universes[&universe][0]];
                    let found = format!("universe {universe} in itself");
                    return Err((cell.at, Problem::syntax("universes that are not in themselves", found)));
                }
                None => _ = done.insert(universe, false),
            }
            open.push((universe, true));
            for fill in self.universes[&universe].iter().filter_map(|k| self.cells[*k].fill) {
                let inner = match self.lattices.get(&fill) {
                    Some(lattice) => lattice.filling(),
                    None => BTreeSet::from([fill]),
                };
                open.extend(inner.into_iter().filter(|u| done.get(u) != Some(&true)).map(|u| (u, false)));
            }
        }
        after.reverse();
        Ok(after)
    }

    /// The box that is asked of: what the root's cells are in, and where they have no end around all that is told of places.
    fn root_block(&self, root: i64, notes: &mut Vec<Note>) -> Aabb {
        let cells = &self.universes[&root];
        let mut block =
            cells.iter().fold(Aabb::EMPTY, |b, k| b.union(&self.cells[*k].region.narrow(&self.surfaces, &Aabb::ALL)));
        if block.is_finite() {
            return block;
        }
        if block.is_empty() {
            block = Aabb::ALL;
        }
        let mut named = Vec::new();
        cells.iter().for_each(|k| self.cells[*k].region.surfaces(&mut named));
        let mut of = [(f64::INFINITY, f64::NEG_INFINITY); 3];
        for surface in named {
            for (k, extent) in self.surfaces[surface].extent().into_iter().enumerate() {
                let Some((low, high)) = extent else { continue };
                of[k] = (of[k].0.min(low), of[k].1.max(high));
            }
        }
        let sizes = of.iter().filter(|(low, high)| low <= high).map(|(low, high)| high - low);
        let size = sizes.fold(0.0, f64::max);
        let far = if size > 0.0 { size } else { 1.0 };
        let mut beyond = Vec::new();
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let (low, high) = if of[k].0 <= of[k].1 { of[k] } else { (0.0, 0.0) };
            if block.min[k] == f64::NEG_INFINITY || block.max[k] == f64::INFINITY {
                let (least, most) = (low - far, high + far);
                block.min[k] = block.min[k].max(least);
                block.max[k] = block.max[k].min(most);
                beyond.push(format!("{axis} from {} to {}", block.min[k], block.max[k]));
            }
        }
        let text = format!("universe {root} has no end: it is asked of within {} (centimetres)", beyond.join(", "));
        notes.push(Note { at: self.cells[cells[0]].at, text, amount: None });
        block
    }

    /// A universe with the texts of its cells.
    fn made(
        &self,
        room: Room,
        places: &Places,
        surfaces: &Arc<[Surface]>,
        (is_root, notes): (bool, &mut Vec<Note>),
    ) -> Universe {
        let Places { seen, block, is_cut_short, .. } = places;
        let (block, is_cut_short) = (*block, *is_cut_short);
        let whole = block_text(&block);
        let cut = |place: &Seen| {
            let mut texts = Vec::new();
            if place.around != block {
                texts.push(block_text(&place.around));
            }
            texts.extend(place.cuts.iter().filter_map(|cut| match cut.within(self, &place.around) {
                Within::Text(text) => Some(text),
                Within::Whole | Within::Nothing => None,
            }));
            Use { text: texts.join(" "), around: place.around }
        };
        let uses = seen.iter().map(cut).collect();
        let (name, at, cells) = match room {
            Room::Universe(id) => {
                let cells = &self.universes[&id];
                (format!("universe {id}"), self.cells[cells[0]].at, cells.as_slice())
            }
            Room::Around(id) => (format!("lattice {id}, around its tiles"), self.lattices[&id].at, &[][..]),
        };
        let mut rest = Some(Vec::new());
        let mut told = Vec::new();
        for cell in cells.iter().map(|k| &self.cells[*k]) {
            let text = match cell.region.within(&self.surfaces, &block) {
                Within::Nothing => continue,
                Within::Whole => {
                    rest = None;
                    whole.clone()
                }
                Within::Text(text) => format!("intersection() {{ {whole} {text} }}"),
            };
            if let Some(rest) = &mut rest {
                rest.push(text.clone());
            }
            told.push(Cell { name: cell.name.clone(), at: cell.at, text, region: cell.region.clone() });
        }
        if told.len() <= MOST_FILLING && rest.is_some() && !is_root {
            let outside: Vec<Region> = told.iter().map(|cell| cell.region.complement()).collect();
            if logic::have_nothing_in_common(&outside.iter().collect::<Vec<_>>(), &self.surfaces) {
                rest = None;
            }
        }
        if told.len() > MOST_FILLING && !is_root {
            let text = format!("{name} has more than {MOST_FILLING} cells: whether they leave a gap is not asked");
            notes.push(Note { at, text, amount: None });
            rest = None;
        }
        let rest = rest.filter(|_| !is_root).map(|cells| match cells.is_empty() {
            true => whole.clone(),
            false => format!("difference() {{ {whole} {} }}", cells.join(" ")),
        });
        Universe { name, at, cells: told, block, whole, rest, uses, is_cut_short, surfaces: surfaces.clone() }
    }
}
