"""MuJoCo with contactd's contacts: exact solids with real holes, drawn and integrated by MuJoCo.

    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    with contactd.mujoco.Coupling(model, {"plate": "difference() {…}", "peg": "union() {…}"}) as coupling:
        for _ in range(1000):
            coupling.step(data)

Or ``contactd.mujoco.attach(model, {"plate": "plate.csg"})``: then all other geoms meet as the exact solids that they are, too.

Bodies that have a solid meet as these solids do; their geoms are still drawn and still give them mass, but no longer
collide until the coupling is closed. Other bodies keep MuJoCo's own collisions among themselves. Between bodies that have solids the model's
filters are kept: ``<exclude>``, parents, ``contype`` and ``conaffinity``. What a coupling would lose or cannot keep (contacts with bodies
that have no solid, a ``<pair>`` with one geom of a body that has a solid) is refused by name, and what it takes in another way (``margin``, ``gap``,
geoms of one body that differ) is a ``CouplingWarning``. A step is MuJoCo's staged step: ``mj_step1``, one batched
request to contactd, ``mj_addContact`` for each point of the answer, the constraints anew, ``mj_step2``.

MuJoCo's contacts are soft: bodies at rest sink into each other a little, and solids that overlap touch nowhere. So each contact
acts from ``skin`` on (its ``includemargin``) while its ``dist`` is the true gap: bodies rest a fraction of the skin apart, where contactd
knows all their regions. A pair in overlap is asked about once more, moved apart, so that its points are those of the face it came
through: all such pairs in one further request where they can be apart together, in up to eight where they cannot.

A step that raises has not moved ``data`` on: it may be repeated. Where the wait for a server was interrupted, the next step first
waits for the answer that is still under way.

What rests is not asked about again: contactd is told of a body once it has gone by a hundredth of the skin (``slack``) since it was told last,
and a step in which none has makes no request. The contacts of a pair that was not told are carried along with its bodies.
"""

from __future__ import annotations

import ctypes
import os
import pathlib
import warnings
import weakref
from typing import Any, Mapping, NamedTuple

import mujoco as mj
import numpy as np

from . import _native
from . import session as sessions
from .convention import quaternion_from_wxyz
from .manifold import Point
from .mujoco_filter import CouplingWarning, Filter, StandIn
from .mujoco_geoms import MESHES, solid_of
from .pose import Pose
from .session import Session, embedded
from .solid import Solid

__all__ = ["Asked", "Coupling", "CouplingWarning", "attach"]


#: Option flags with which MuJoCo has no contacts.
_OFF = int(mj.mjtDisableBit.mjDSBL_CONTACT) | int(mj.mjtDisableBit.mjDSBL_CONSTRAINT)
#: Addresses of the models of open couplings because of which geoms do not collide.
_taken: set[int] = set()
#: A solid as it is given: OpenSCAD CSG text, a solid that was built, or the path of a file (CSG, STL, OFF …).
Given = str | os.PathLike | Solid


def attach(
    model: mj.MjModel,
    replace: Mapping[str, Given] | None = None,
    *,
    meshes: str = "hull",
    keep_exact: bool = True,
    skin: float | None = None,
    slack: float = 1e-2,
    unit: float = 1.0,
    session: Session | None = None,
) -> Coupling:
    """contactd's contacts for a whole ``MjModel``: each geom that collides meets others as the exact solid that it is.

    Contacts that MuJoCo has in closed form stay MuJoCo's own (``keep_exact``): of a plane with balls, capsules, boxes, cylinders,
    ellipsoids and the hulls of meshes, of a ball with balls, capsules and boxes, of two capsules, of two boxes. They cost what they cost
    without a coupling, and have the ``margin`` and ``gap`` of their geoms.

    ``replace``: for bodies by name, a solid in place of all geoms of the body, as for ``Coupling``. ``meshes``: "hull", as in
    MuJoCo's own collisions, or "exact". Contacts are those that MuJoCo's rules ask for, geom by geom: ``contype``,
    ``conaffinity``, ``<exclude>``, ``<pair>``, parents, ``condim``, friction, solver parameters. What has no solid (a signed distance
    function of a plugin) is refused by name. The rest is ``Coupling``'s.
    """
    return Coupling(
        model, replace or {}, geoms=True, meshes=meshes, keep_exact=keep_exact, skin=skin, slack=slack, unit=unit, session=session
    )


class Asked(NamedTuple):
    """What a coupling has asked contactd since it was made."""

    #: Requests; none in a step in which all bodies rest.
    requests: int
    #: Bodies told in them.
    bodies: int


class _Silenced:
    """What of a model no longer collides as long as a coupling of it is open."""

    def __init__(self, model: mj.MjModel):
        self.model = model
        #: Geoms with their contype and conaffinity, flexes likewise, pairs with their margin.
        self.geoms: list[tuple[int, int, int]] = []
        self.flexes: list[tuple[int, int, int]] = []
        self.pairs: list[tuple[int, float]] = []
        #: What the bits of all geoms of each body were together, where they are other ones meanwhile.
        self.body_bits: tuple[np.ndarray, np.ndarray] | None = None

    def restore(self) -> None:
        """Lets all of it collide again as it did."""
        for geom, contype, conaffinity in self.geoms:
            self.model.geom_contype[geom], self.model.geom_conaffinity[geom] = contype, conaffinity
        for flex, contype, conaffinity in self.flexes:
            self.model.flex_contype[flex], self.model.flex_conaffinity[flex] = contype, conaffinity
        for pair, margin in self.pairs:
            self.model.pair_margin[pair] = margin
        if self.body_bits is not None:
            self.model.body_contype[:], self.model.body_conaffinity[:] = self.body_bits
        if self.geoms or self.flexes or self.pairs:
            _taken.discard(self.model._address)


class Coupling:
    """contactd's contacts for the bodies of an ``MjModel``.

    ``solids``: for each body by name, its solid in the body's frame: OpenSCAD CSG text, a solid that was built
    (``contactd.solid``), or the path of a file; its unit is ``unit`` lengths of MuJoCo (0.001: models in millimetres in a scene in
    metres). ``geoms``: every other geom that collides gets its own solid, too (``attach``); ``meshes``: what a mesh then stands
    for, "hull" or "exact"; ``keep_exact``: what MuJoCo has in closed form stays its own, as ``attach`` says. Bodies
    welded to the world are fixed, unless they hang on a mocap body. ``skin``: the gap, in MuJoCo's
    unit, at which contacts begin to act, in place of the geoms' ``margin``; by default 2e-4, and no more than four thousandths of the
    model's ``<statistic meansize>``. ``slack``: the part of it by which any point of a body
    may go until contactd is asked about it anew; until then its contacts are carried along, and a gap is off by about the
    square of that way over the radius of the surfaces (0: not at all where they are flat). ``session``: to use one that is open (by
    default an embedded one is opened, and closed with the coupling); its rules are replaced.

    Until the coupling is closed geoms that have a solid get ``contype`` and ``conaffinity`` 0, or those by which they meet nothing but
    what they have MuJoCo's own contacts with; a ``<pair>`` of two that have solids has no reach. What
    makes contacts (friction, ``solref``, ``condim`` …) is that of the geoms, of a body with a solid that of its first colliding
    geom, combined as MuJoCo does. The filters are read once: what is changed in the model later is not seen.
    A model has one open coupling at a time; a copy of it that is made before has its own.

    Raises ``ValueError`` before anything is changed where contacts would not be those that the model asks for; warns
    (``CouplingWarning``) where they are taken in another way. Each sentence names the body or geom and says what to do.
    """

    def __init__(
        self,
        model: mj.MjModel,
        solids: Mapping[str, Given],
        *,
        geoms: bool = False,
        meshes: str = "hull",
        keep_exact: bool = True,
        skin: float | None = None,
        slack: float = 1e-2,
        unit: float = 1.0,
        session: Session | None = None,
    ) -> None:
        if skin is None:
            skin = _skin_of(model)
        if not 0.0 < skin < np.inf or not 0.0 < unit < np.inf:
            raise ValueError(f"expected a finite skin and unit above 0, found {skin} and {unit}")
        if not 0.0 <= slack < 1.0:
            raise ValueError(f"expected a part of the skin as slack, at least 0 and below 1, found {slack}")
        if meshes not in MESHES:
            raise ValueError(f"expected one of {', '.join(map(repr, MESHES))} for meshes, found {meshes!r}")
        if model._address in _taken:
            raise ValueError(
                "the model has an open coupling already, because of which its geoms do not collide: close that one first "
                "(by close(), or by using it in a with statement), or attach to a copy of the model that was made before it"
            )
        self.model = model
        self.skin = skin
        self.slack = slack
        self.unit = unit
        self._adheres = bool(np.any(model.actuator_trntype == mj.mjtTrn.mjTRN_BODY))
        self._filter = Filter(model, geoms and keep_exact, hulls=meshes == "hull")
        given = self._given(solids)
        if geoms:
            given += self._own_solids(meshes, [part for part, _ in given])
        self._filter.take([part for part, _ in given])
        #: All contacts are MuJoCo's own.
        self._is_idle = not given
        for sentence in self._filter.warnings:
            warnings.warn(sentence, CouplingWarning, stacklevel=2 + geoms)
        self._contacts: list[tuple[int, int, Point]] | None = None
        self._contact_geoms: list[tuple[str, str]] | None = None
        self._own = session is None
        self.session = embedded() if session is None else session
        self._silenced = _Silenced(model)
        # Of one that is forgotten, too, the model would stay silent for good.
        self._restores = weakref.finalize(self, self._silenced.restore)
        self._restores.atexit = False
        try:
            self._add(given)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Coupling:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Lets the geoms collide again as they did; closes the session, if the coupling opened it."""
        self._restores()
        if self._own:
            self.session.close()

    def _given(self, solids: Mapping[str, Given]) -> list[tuple[StandIn, Given]]:
        """The solids that stand in for whole bodies."""
        found = []
        for name, solid in solids.items():
            body = mj.mj_name2id(self.model, mj.mjtObj.mjOBJ_BODY, name)
            if body < 0:
                raise ValueError(f"the model has no body called {name!r}")
            found.append((self._filter.whole(name, body), solid))
        return found

    def _own_solids(self, meshes: str, wholes: list[StandIn]) -> list[tuple[StandIn, Given]]:
        """The solids of all geoms that collide, or that a ``<pair>`` names, but those of bodies that have one already, and those that
        MuJoCo alone has contacts of."""
        taken = {part.body for part in wholes}
        meeting = [geom for body in range(self.model.nbody) if body not in taken for geom in self._filter.meeting(body)]
        found = []
        for geom in self._filter.keep_exact(meeting, wholes):
            called = self._filter.geom(geom)
            try:
                solid = solid_of(self.model, geom, self.unit, meshes)
            except ValueError as e:
                raise ValueError(f"{called}: {e}: give its body a solid by replace=, or contype and conaffinity 0") from None
            found.append((StandIn(called, int(self.model.geom_bodyid[geom]), [geom], False), solid))
        return found

    def _load(self, part: StandIn, given: Given) -> sessions.Model:
        """Loads a solid; a file by its ending."""
        if isinstance(given, os.PathLike) or isinstance(given, str) and _names_a_file(given):
            path = pathlib.Path(given)
            return self.session.load_model(path.name, path.read_bytes())
        return self.session.load_model(f"{part.name}.csg", given)

    def _add(self, given: list[tuple[StandIn, Given]]) -> None:
        model, session = self.model, self.session
        groups, rules = self._filter.rules(self.skin / self.unit)
        rest = mj.MjData(model)
        mj.mj_kinematics(model, rest)
        loaded: dict[str, sessions.Model] = {}
        parts = []
        for (part, solid), group in zip(given, groups):
            key = solid.text if isinstance(solid, Solid) else str(solid)
            if key not in loaded:
                loaded[key] = self._load(part, solid)
            fixed = not self._filter.moves(part.body)
            at = Pose(rest.xpos[part.body] / self.unit, quaternion_from_wxyz(rest.xquat[part.body]))
            first = part.geoms[0]
            place = None
            if not part.is_whole:
                place = Pose(model.geom_pos[first] / self.unit, quaternion_from_wxyz(model.geom_quat[first]))
            object = session.add_object(part.name, loaded[key], group=group, fixed=fixed, at=at, place=place)
            parts.append((object, part.body, first, self._reach(part), at if fixed else None))
        session.set_rules(rules)
        session.options.details = True
        add_contact, template, offsets = _contact_layout(model, rest, self.skin)
        self._coupled = _native.Coupled(
            session,
            model,
            [(*part, at and (tuple(at.position), tuple(at.rotation))) for *part, at in parts],
            self._filter.pairs,
            (self.slack * self.skin / self.unit, self.unit),
            (add_contact, model._address, mj.mjMINMU, mj.mjMINVAL),
            (template, offsets),
        )
        # Last, so that what is refused before has changed nothing.
        silenced = self._silenced
        own, own_of_flexes = self._filter.own_bits, self._filter.own_flex_bits
        if not given:
            # What is left to MuJoCo is all that there is: by the model's own bits.
            own, own_of_flexes = {}, {}
        for geom in sorted({g for part, _ in given for g in part.geoms} | set(own)):
            silenced.geoms.append((geom, int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])))
            model.geom_contype[geom], model.geom_conaffinity[geom] = own.get(geom, (0, 0))
        for flex, bits in own_of_flexes.items():
            silenced.flexes.append((flex, int(model.flex_contype[flex]), int(model.flex_conaffinity[flex])))
            model.flex_contype[flex], model.flex_conaffinity[flex] = bits
        if own_of_flexes and hasattr(model, "body_contype"):
            # Before it looks at geoms MuJoCo asks whether any of a body's has a bit of the flex.
            silenced.body_bits = model.body_contype.copy(), model.body_conaffinity.copy()
            np.bitwise_or.at(model.body_contype, model.geom_bodyid, model.geom_contype)
            np.bitwise_or.at(model.body_conaffinity, model.geom_bodyid, model.geom_conaffinity)
        for (g1, g2), pair in self._filter.pairs.items():
            silenced.pairs.append((pair, float(model.pair_margin[pair])))
            # With this margin MuJoCo's test of bounding balls leaves the pair out; planes have none, and no distance is so small.
            bounds = float(model.geom_rbound[g1]), float(model.geom_rbound[g2])
            model.pair_margin[pair] = -sum(bounds) if all(bounds) else -mj.mjMAXVAL
        if silenced.geoms or silenced.flexes or silenced.pairs:
            _taken.add(model._address)

    def step(self, data: mj.MjData) -> int:
        """One step of MuJoCo with contactd's contacts; returns how many there were."""
        model = self.model
        if self._is_idle:
            # Nothing to add, so nothing to stage: the step may be one that has no stages (Runge-Kutta).
            mj.mj_step(model, data)
            return 0
        mj.mj_step1(model, data)
        n = self.add_contacts(data)
        if n:
            # What mj_step1 made of the contacts that it knew is made again with all of them.
            mj.mj_makeConstraint(model, data)
            mj.mj_island(model, data)
            if self._adheres:
                # An <adhesion> actuator pulls along the contacts of its body.
                mj.mj_transmission(model, data)
            mj.mj_projectConstraint(model, data)
            mj.mj_referenceConstraint(model, data)
        mj.mj_step2(model, data)
        return n

    def add_contacts(self, data: mj.MjData) -> int:
        """Asks contactd about the bodies as they stand in ``data`` and adds its contacts; for loops that stage their own steps.

        None are asked for while the model's option flags switch contacts or constraints off, as MuJoCo then has none."""
        if self.model.opt.disableflags & _OFF:
            self._contacts, self._contact_geoms = [], []
            return 0
        n = self._coupled.add_contacts(data.xpos, data.xquat, data._address)
        self._contacts = self._contact_geoms = None
        return n

    @property
    def contacts(self) -> list[tuple[int, int, Point]]:
        """The contacts of the last step in the order in which MuJoCo got them: the bodies' ids in MuJoCo, and the point in contactd's
        unit. Its ``id`` names it within the pair of solids for as long as it lasts."""
        if self._contacts is None:
            self._contacts = [
                (a, b, Point(id, group, np.array(position), np.array(normal), separation, np.array(on_a), np.array(on_b)))
                for (a, b, id, group), (position, normal, separation, on_a, on_b) in self._coupled.contacts()
            ]
        return self._contacts

    @property
    def contact_geoms(self) -> list[tuple[str, str]]:
        """The names of the geoms by which MuJoCo is told of each of ``contacts``; "geom 3" for one without."""
        if self._contact_geoms is None:
            self._contact_geoms = [(self._name(first), self._name(second)) for first, second in self._coupled.geoms()]
        return self._contact_geoms

    @property
    def asked(self) -> Asked:
        """What contactd was asked so far."""
        return Asked(*self._coupled.asked())

    def refresh(self) -> None:
        """Asks about all bodies at the next step, wherever they stand: after a change to the session's rules or options."""
        self._coupled.forget()

    def _reach(self, part: StandIn) -> float:
        """How far the geoms of a part are from its body's origin, in contactd's unit; infinite with a plane among them."""
        model = self.model
        bounds = [float(model.geom_rbound[g]) or np.inf for g in part.geoms]
        return max(float(np.linalg.norm(model.geom_pos[g])) + r for g, r in zip(part.geoms, bounds)) / self.unit

    def _name(self, geom: int) -> str:
        return mj.mj_id2name(self.model, mj.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"


def _names_a_file(text: str) -> bool:
    """Whether a string is a path, not a CSG text: texts have calls."""
    return "(" not in text and ";" not in text and bool(pathlib.PurePath(text).suffix)


def _skin_of(model: mj.MjModel) -> float:
    """The skin where none is told: what is held without play is pressed apart by it, which must be little beside its size."""
    size = float(model.stat.meansize)
    return min(2e-4, 4e-3 * size) if size > 0.0 else 2e-4


def _contact_layout(model: mj.MjModel, data: mj.MjData, skin: float) -> tuple[int, bytes, dict[str, int]]:
    """The address of ``mj_addContact``, the bytes of an ``mjContact`` as contacts of solids begin, and the offsets of its fields, as
    MuJoCo's own arrays tell them. ``data`` is only used to look at."""
    add_contact = ctypes.CDLL(mj._functions.__file__).mj_addContact
    add_contact.argtypes = [ctypes.c_void_p] * 3
    blank = mj.MjContact()
    # What begins asleep has been looked at for contacts already.
    data.ncon = 0
    # Numbers that differ, so that a field in another's place is seen below; the first three are each contact's own.
    blank.dist, blank.pos, blank.frame = 0.5, [1.0, 2.0, 3.0], np.arange(4.0, 13.0)
    blank.includemargin = skin
    blank.flex = blank.elem = blank.vert = [-1, -1]
    blank.efc_address = -1
    blank.exclude = 0
    full = mj.mj_addContact(model, data, blank)
    arrays = {name: getattr(data.contact, name) for name in dir(data.contact) if not name.startswith("_")}
    places = {name: a.__array_interface__["data"][0] for name, a in arrays.items() if isinstance(a, np.ndarray) and len(a)}
    if not full:
        first = min(places.values())
        template = ctypes.string_at(first, data.contact.dist.strides[0])
        full = add_contact(model._address, data._address, template)
    if full:
        raise MemoryError("MuJoCo's arena has no room for two contacts: enlarge <size memory>")
    for name in places:
        own, copied = getattr(data.contact, name)
        if not np.array_equal(own, copied):
            raise RuntimeError(f"{name} of MuJoCo's contacts is not where its Python package says: this version is not known")
    address = ctypes.cast(add_contact, ctypes.c_void_p).value or 0
    return address, template, {name: at - first for name, at in places.items()}
