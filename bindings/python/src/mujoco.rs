//! Contacts for MuJoCo in one call a step: `contactd_client::manifold::cache` asks, and what it tells is added to MuJoCo's data.
//!
//! The first half knows nothing of Python but buffers: the model's columns, the layout of `mjContact` as MuJoCo's own Python package
//! tells it, the address of `mj_addContact`. `contactd/mujoco.py` looks these up, and decides what meets what.

use crate::pose::{PoseFields, pose};
use crate::session::Session;
use crate::slots::Held;
use contactd_client::convention::from_mujoco;
use contactd_client::manifold::Point;
use contactd_client::manifold::cache::ContactCache;
use contactd_proto::Pose;
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use std::collections::HashMap;
use std::ffi::{c_int, c_void};

/// `mj_addContact(model, data, contact)`; not 0 where there is no room.
type AddContact = unsafe extern "C" fn(*const c_void, *mut c_void, *const c_void) -> c_int;

/// Object, body, the geom whose contacts its own are, how far it reaches; where it stands, if it never moves.
type PartFields = (u32, usize, usize, f64, Option<PoseFields>);
/// Ids of the bodies in MuJoCo, id and group of the point; position, normal, separation, on a, on b.
type ContactFields = ((usize, usize, u32, u32), ([f64; 3], [f64; 3], f64, [f64; 3], [f64; 3]));

/// An array of the model, which lives where it is for as long as the array does.
struct Column<T> {
    /// Keeps it, and the model.
    _array: Py<PyAny>,
    start: usize,
    len: usize,
    of: std::marker::PhantomData<T>,
}

impl<T: Copy> Column<T> {
    fn of(model: &Bound<'_, PyAny>, name: &str) -> PyResult<Self> {
        let array = model.getattr(name)?;
        let held = Held::of(&array)?;
        let len = held.len() / size_of::<T>();
        let per = array.getattr("itemsize")?.extract::<usize>()?;
        if per != size_of::<T>() {
            return Err(PyValueError::new_err(format!(
                "{name}: expected numbers of {} bytes, found {per}",
                size_of::<T>()
            )));
        }
        Ok(Self { start: held.start() as usize, len, _array: array.unbind(), of: std::marker::PhantomData })
    }

    /// Row `i` of `N` numbers.
    fn row<const N: usize>(&self, i: usize) -> [T; N] {
        assert!((i + 1) * N <= self.len, "a row of the model");
        // SAFETY: within the array, as was compared, which lives; MuJoCo's arrays are aligned for their numbers. The interpreter's lock
        // is held, so nobody writes meanwhile but those who write to a model that is being stepped.
        unsafe { (self.start as *const [T; N]).add(i).read() }
    }

    fn at(&self, i: usize) -> T {
        self.row::<1>(i)[0]
    }
}

/// What of a model makes contacts of two geoms. Read anew for each pair and step: a model may be changed while it runs.
struct Columns {
    kind: Column<i32>,
    body: Column<i32>,
    priority: Column<i32>,
    dim: Column<i32>,
    mix: Column<f64>,
    friction: Column<f64>,
    solref: Column<f64>,
    solimp: Column<f64>,
    pair_first: Column<i32>,
    pair_dim: Column<i32>,
    pair_friction: Column<f64>,
    pair_solref: Column<f64>,
    pair_solreffriction: Column<f64>,
    pair_solimp: Column<f64>,
    /// `mjMINMU`, `mjMINVAL`.
    least: [f64; 2],
}

/// Contact parameters of a pair of geoms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Parameters {
    dim: i32,
    friction: [f64; 5],
    solref: [f64; 2],
    /// That of a `<pair>`.
    solreffriction: Option<[f64; 2]>,
    solimp: [f64; 5],
}

impl Columns {
    fn of(model: &Bound<'_, PyAny>, least: [f64; 2]) -> PyResult<Self> {
        Ok(Self {
            kind: Column::of(model, "geom_type")?,
            body: Column::of(model, "geom_bodyid")?,
            priority: Column::of(model, "geom_priority")?,
            dim: Column::of(model, "geom_condim")?,
            mix: Column::of(model, "geom_solmix")?,
            friction: Column::of(model, "geom_friction")?,
            solref: Column::of(model, "geom_solref")?,
            solimp: Column::of(model, "geom_solimp")?,
            pair_first: Column::of(model, "pair_geom1")?,
            pair_dim: Column::of(model, "pair_dim")?,
            pair_friction: Column::of(model, "pair_friction")?,
            pair_solref: Column::of(model, "pair_solref")?,
            pair_solreffriction: Column::of(model, "pair_solreffriction")?,
            pair_solimp: Column::of(model, "pair_solimp")?,
            least,
        })
    }

    /// MuJoCo tells the geoms of a contact by their types, where these are the same by their bodies, or as the pair does.
    fn is_swapped(&self, [g1, g2]: [usize; 2], pair: Option<usize>) -> bool {
        let first = pair.map(|k| self.pair_first.at(k) as usize);
        let rank = |g: usize| (self.kind.at(g), first != Some(g), self.body.at(g), g);
        rank(g2) < rank(g1)
    }

    fn of_pair(&self, k: usize) -> Parameters {
        Parameters {
            dim: self.pair_dim.at(k),
            friction: self.pair_friction.row::<5>(k).map(|mu| mu.max(self.least[0])),
            solref: self.pair_solref.row(k),
            solreffriction: Some(self.pair_solreffriction.row(k)),
            solimp: self.pair_solimp.row(k),
        }
    }

    /// As mj_contactParam (engine_collision_driver.c): those of the geom of higher priority, else the larger condim and friction, and solver
    /// parameters mixed.
    fn of_geoms(&self, [g1, g2]: [usize; 2]) -> Parameters {
        let (p1, p2) = (self.priority.at(g1), self.priority.at(g2));
        let [f1, f2] = [g1, g2].map(|g| self.friction.row::<3>(g));
        let [r1, r2] = [g1, g2].map(|g| self.solref.row::<2>(g));
        let [i1, i2] = [g1, g2].map(|g| self.solimp.row::<5>(g));
        let (dim, friction, solref, solimp);
        if p1 == p2 {
            let mix = self.mix(self.mix.at(g1), self.mix.at(g2));
            let mixed = |x: f64, y: f64| mix * x + (1.0 - mix) * y;
            dim = self.dim.at(g1).max(self.dim.at(g2));
            friction = std::array::from_fn(|k| f1[k].max(f2[k]));
            let standard = r1[0] > 0.0 && r2[0] > 0.0;
            solref = std::array::from_fn(|k| if standard { mixed(r1[k], r2[k]) } else { r1[k].min(r2[k]) });
            solimp = std::array::from_fn(|k| mixed(i1[k], i2[k]));
        } else if p1 > p2 {
            (dim, friction, solref, solimp) = (self.dim.at(g1), f1, r1, i1);
        } else {
            (dim, friction, solref, solimp) = (self.dim.at(g2), f2, r2, i2);
        }
        let [slide, spin, roll]: [f64; 3] = friction.map(|mu: f64| mu.max(self.least[0]));
        Parameters { dim, friction: [slide, slide, spin, roll, roll], solref, solreffriction: None, solimp }
    }

    /// Weight of the first geom's solver parameters.
    fn mix(&self, first: f64, second: f64) -> f64 {
        let least = self.least[1];
        match (first >= least, second >= least) {
            (true, true) => first / (first + second),
            (false, false) => 0.5,
            (true, false) => 1.0,
            (false, true) => 0.0,
        }
    }
}

/// One `mjContact`, written again and again.
struct Row {
    /// As many words as it has, and no fewer bytes.
    words: Vec<u64>,
    bytes: usize,
    dist: usize,
    pos: usize,
    frame: usize,
    friction: usize,
    solref: usize,
    solreffriction: usize,
    solimp: usize,
    dim: usize,
    /// The geoms, and what they were called before MuJoCo 3.
    geom: usize,
    geom1: Option<usize>,
    geom2: Option<usize>,
}

impl Row {
    /// `template`: the bytes of one; `offsets`: of its fields.
    fn new(template: &[u8], offsets: &HashMap<String, usize>) -> PyResult<Self> {
        let at = |name: &str| offsets.get(name).copied();
        let needed = |name: &str| {
            at(name).ok_or_else(|| PyValueError::new_err(format!("this MuJoCo's contacts have no field {name}")))
        };
        let mut row = Self {
            words: vec![0; template.len().div_ceil(size_of::<u64>())],
            bytes: template.len(),
            dist: needed("dist")?,
            pos: needed("pos")?,
            frame: needed("frame")?,
            friction: needed("friction")?,
            solref: needed("solref")?,
            solreffriction: needed("solreffriction")?,
            solimp: needed("solimp")?,
            dim: needed("dim")?,
            geom: needed("geom")?,
            geom1: at("geom1"),
            geom2: at("geom2"),
        };
        row.put(0, template);
        Ok(row)
    }

    fn put<T: bytemuck::NoUninit>(&mut self, at: usize, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        bytemuck::cast_slice_mut::<u64, u8>(&mut self.words)[..self.bytes][at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn set_pair(&mut self, [g1, g2]: [usize; 2], p: &Parameters) {
        let geoms = [g1 as i32, g2 as i32];
        self.put(self.geom, &geoms);
        for (at, geom) in [self.geom1, self.geom2].into_iter().zip(geoms) {
            at.into_iter().for_each(|at| self.put(at, &[geom]));
        }
        self.put(self.dim, &[p.dim]);
        self.put(self.friction, &p.friction);
        self.put(self.solref, &p.solref);
        self.put(self.solreffriction, &p.solreffriction.unwrap_or_default());
        self.put(self.solimp, &p.solimp);
    }
}

/// What stands in for geoms.
struct Part {
    object: u32,
    body: usize,
    geom: usize,
    is_fixed: bool,
}

/// A contact as it was told.
struct Told {
    bodies: [usize; 2],
    geoms: [usize; 2],
    point: Point,
}

/// A model's contacts; `contactd.mujoco.Coupling` holds one.
#[pyclass(module = "contactd._native")]
pub struct Coupled {
    session: Py<Session>,
    unit: f64,
    parts: Vec<Part>,
    pairs: HashMap<(usize, usize), usize>,
    columns: Columns,
    cache: ContactCache,
    poses: Vec<Pose>,
    told: Vec<Told>,
    row: Row,
    /// Addresses of `mj_addContact` and of the model.
    add_contact: usize,
    model: usize,
    /// A request is under way, unless its wait was interrupted long ago.
    is_sent: bool,
    /// Steps of the session after the last request: others may have moved its objects since.
    steps: u64,
}

#[pymethods]
impl Coupled {
    /// `scale`: slack (a length of the session) and unit. `pairs`: geoms of a `<pair>`, the smaller id first, and its number. `mujoco`:
    /// addresses of `mj_addContact` and of the model, mjMINMU, mjMINVAL. `contact`: the bytes of an `mjContact` and its fields' offsets.
    #[new]
    fn new(
        session: Py<Session>,
        model: &Bound<'_, PyAny>,
        parts: Vec<PartFields>,
        pairs: HashMap<(usize, usize), usize>,
        scale: (f64, f64),
        mujoco: (usize, usize, f64, f64),
        contact: (Vec<u8>, HashMap<String, usize>),
    ) -> PyResult<Self> {
        let (slack, unit) = scale;
        let (add_contact, address, least_mu, least) = mujoco;
        if add_contact == 0 || address == 0 {
            return Err(PyValueError::new_err("expected the addresses of mj_addContact and of a model"));
        }
        let mut cache = ContactCache::new(slack);
        for (object, _, _, reach, at) in &parts {
            match at {
                Some(at) => cache.add_fixed(*object, pose(at.0, at.1)),
                None => cache.add_moving(*object, *reach),
            }
        }
        let part = |(object, body, geom, _, at): PartFields| Part { object, body, geom, is_fixed: at.is_some() };
        Ok(Self {
            session,
            unit,
            parts: parts.into_iter().map(part).collect(),
            pairs,
            columns: Columns::of(model, [least_mu, least])?,
            cache,
            poses: Vec::new(),
            told: Vec::new(),
            row: Row::new(&contact.0, &contact.1)?,
            add_contact,
            model: address,
            is_sent: false,
            steps: 0,
        })
    }

    /// Asks about the bodies as they stand, if any has moved, and adds all contacts to the data at an address; returns how many.
    fn add_contacts(
        &mut self,
        py: Python<'_>,
        xpos: &Bound<'_, PyAny>,
        xquat: &Bound<'_, PyAny>,
        data: usize,
    ) -> PyResult<usize> {
        self.place(&Held::of(xpos)?, &Held::of(xquat)?)?;
        self.ask(py)?;
        self.tell();
        self.add(data)
    }

    /// The contacts of the last call, in the session's unit.
    fn contacts(&self) -> Vec<ContactFields> {
        let fields = |t: &Told| {
            let p = &t.point;
            let [position, normal, on_a, on_b] = [p.position, p.normal, p.on_a, p.on_b].map(|v| v.to_array());
            ((t.bodies[0], t.bodies[1], p.id, p.group), (position, normal, p.separation, on_a, on_b))
        };
        self.told.iter().map(fields).collect()
    }

    /// The geoms of the contacts of the last call, as MuJoCo was told.
    fn geoms(&self) -> Vec<[usize; 2]> {
        self.told.iter().map(|t| t.geoms).collect()
    }

    /// Requests, bodies told in them.
    fn asked(&self) -> (u64, u64) {
        let asked = self.cache.asked();
        (asked.requests, asked.bodies)
    }

    /// All bodies are told anew at the next call.
    fn forget(&mut self) {
        self.cache.forget();
    }
}

impl Coupled {
    /// Reads where the moving bodies stand.
    fn place(&mut self, xpos: &Held, xquat: &Held) -> PyResult<()> {
        let most = self.parts.iter().map(|part| part.body + 1).max().unwrap_or(0);
        if xpos.len() < most * size_of::<[f64; 3]>() || xquat.len() < most * size_of::<[f64; 4]>() {
            return Err(PyValueError::new_err("expected the data of the coupling's own model"));
        }
        self.poses.clear();
        for part in self.parts.iter().filter(|part| !part.is_fixed) {
            // SAFETY: rows of both buffers, as was compared, which are held; of numbers, as MuJoCo has them, and aligned for these.
            let (position, rotation) = unsafe {
                let (p, q) = (xpos.start().cast::<[f64; 3]>(), xquat.start().cast::<[f64; 4]>());
                (p.add(part.body).read(), q.add(part.body).read())
            };
            self.poses.push(from_mujoco(position.map(|x| x / self.unit), rotation));
        }
        Ok(())
    }

    /// Asks the session where something has moved.
    fn ask(&mut self, py: Python<'_>) -> PyResult<()> {
        let session = self.session.bind(py).clone();
        if self.is_sent {
            // An earlier request whose wait was interrupted: its answer is of no use any more.
            Session::drain(&session)?;
            self.is_sent = false;
        }
        if Session::steps(&session)? != self.steps {
            self.cache.forget();
        }
        if self.cache.begin(&self.poses).is_empty() {
            return Ok(());
        }
        // Unless all goes well what the engine has is unknown.
        self.steps = u64::MAX;
        let (cache, is_sent) = (&mut self.cache, &mut self.is_sent);
        let records = cache.records().to_vec();
        Session::ask(&session, &records, is_sent, |reply| cache.answer(reply))?;
        self.steps = Session::steps(&session)?;
        Ok(())
    }

    /// Notes what the cache tells, with the names that MuJoCo knows.
    fn tell(&mut self) {
        self.told.clear();
        for (pair, point) in self.cache.contacts() {
            let [a, b] = [pair.a, pair.b].map(|object| self.parts.binary_search_by_key(&object, |part| part.object));
            let (Ok(a), Ok(b)) = (a, b) else { continue };
            let [a, b] = [&self.parts[a], &self.parts[b]];
            self.told.push(Told { bodies: [a.body, b.body], geoms: [a.geom, b.geom], point });
        }
    }

    /// Adds what was told to MuJoCo's data.
    fn add(&mut self, data: usize) -> PyResult<usize> {
        if data == 0 {
            return Err(PyValueError::new_err("expected the address of MuJoCo's data"));
        }
        // SAFETY: the address of this function, of this type, as MuJoCo's own package has loaded it.
        let add_contact =
            unsafe { std::mem::transmute::<*const c_void, AddContact>(self.add_contact as *const c_void) };
        let mut last = None;
        let mut is_swapped = false;
        for told in &mut self.told {
            let geoms @ [g1, g2] = told.geoms;
            if last != Some(geoms) {
                last = Some(geoms);
                let pair = self.pairs.get(&(g1.min(g2), g1.max(g2))).copied();
                is_swapped = self.columns.is_swapped(geoms, pair);
                let geoms = if is_swapped { [g2, g1] } else { geoms };
                let parameters = pair.map_or_else(|| self.columns.of_geoms(geoms), |k| self.columns.of_pair(k));
                self.row.set_pair(geoms, &parameters);
            }
            let mut contact = told.point.contact();
            if is_swapped {
                told.geoms = [g2, g1];
                contact.normal = -contact.normal;
            }
            let (pos, frame, dist) = contact.to_mujoco();
            self.row.put(self.row.pos, &(pos * self.unit).to_array());
            self.row.put(self.row.frame, &frame);
            self.row.put(self.row.dist, &[dist * self.unit]);
            // SAFETY: the model and its data, whose owners the caller holds, and a whole contact, which is read alone.
            let full = unsafe {
                add_contact(self.model as *const c_void, data as *mut c_void, self.row.words.as_ptr().cast())
            };
            if full != 0 {
                return Err(PyMemoryError::new_err(
                    "MuJoCo's arena has no room for another contact: enlarge <size memory>",
                ));
            }
        }
        Ok(self.told.len())
    }
}
