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
knows all their regions. A pair that was driven into overlap is asked about once more, moved back by its depth, so that its
points are those of the face it came through; this second request happens in the steps after a hard impact alone.

A step that raises has not moved ``data`` on: it may be repeated. Where the wait for a server was interrupted, the next step first
waits for the answer that is still under way.
"""

from __future__ import annotations

import os
import pathlib
import warnings
from typing import Any, Container, Mapping

import mujoco as mj
import numpy as np

from . import session as sessions
from .convention import contact_to_mujoco, quaternion_from_wxyz
from .errors import Error
from .manifold import Manifold, Manifolds, Point
from .mujoco_filter import CouplingWarning, Filter, StandIn
from .mujoco_geoms import MESHES, solid_of
from .pose import Pose
from .records import Order, Status
from .reply import Reply
from .session import Session, embedded
from .solid import Solid

__all__ = ["Coupling", "CouplingWarning", "attach"]


#: A solid as it is given: OpenSCAD CSG text, a solid that was built, or the path of a file (CSG, STL, OFF …).
Given = str | os.PathLike | Solid


def attach(
    model: mj.MjModel,
    replace: Mapping[str, Given] | None = None,
    *,
    meshes: str = "hull",
    skin: float = 2e-4,
    unit: float = 1.0,
    session: Session | None = None,
) -> Coupling:
    """contactd's contacts for a whole ``MjModel``: each geom that collides meets others as the exact solid that it is.

    ``replace``: for bodies by name, a solid in place of all geoms of the body, as for ``Coupling``. ``meshes``: "hull", as in
    MuJoCo's own collisions, or "exact". Contacts are those that MuJoCo's rules ask for, geom by geom: ``contype``,
    ``conaffinity``, ``<exclude>``, ``<pair>``, parents, ``condim``, friction, solver parameters. What has no solid (a signed distance
    function of a plugin) is refused by name. The rest is ``Coupling``'s.
    """
    return Coupling(model, replace or {}, geoms=True, meshes=meshes, skin=skin, unit=unit, session=session)


class Coupling:
    """contactd's contacts for the bodies of an ``MjModel``.

    ``solids``: for each body by name, its solid in the body's frame: OpenSCAD CSG text, a solid that was built
    (``contactd.solid``), or the path of a file; its unit is ``unit`` lengths of MuJoCo (0.001: models in millimetres in a scene in
    metres). ``geoms``: every other geom that collides gets its own solid, too (``attach``); ``meshes``: what a mesh then stands
    for, "hull" or "exact". Bodies welded to the world are fixed, unless they hang on a mocap body. ``skin``: the gap, in MuJoCo's
    unit, at which contacts begin to act, in place of the geoms' ``margin``. ``session``: to use one that is open (by
    default an embedded one is opened, and closed with the coupling); its rules are replaced.

    Geoms that have a solid get ``contype`` and ``conaffinity`` 0 until the coupling is closed, and no contact of a ``<pair>``. What
    makes contacts (friction, ``solref``, ``condim`` …) is that of the geoms, of a body with a solid that of its first colliding
    geom, combined as MuJoCo does. The filters are read once: what is changed in the model later is not seen.

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
        skin: float = 2e-4,
        unit: float = 1.0,
        session: Session | None = None,
    ) -> None:
        if not 0.0 < skin < np.inf or not 0.0 < unit < np.inf:
            raise ValueError(f"expected a finite skin and unit above 0, found {skin} and {unit}")
        if meshes not in MESHES:
            raise ValueError(f"expected one of {', '.join(map(repr, MESHES))} for meshes, found {meshes!r}")
        self.model = model
        self.skin = skin
        self.unit = unit
        self._filter = Filter(model)
        given = self._given(solids)
        if geoms:
            given += self._own_solids(meshes, {part.body for part, _ in given})
        self._filter.take([part for part, _ in given])
        for sentence in self._filter.warnings:
            warnings.warn(sentence, CouplingWarning, stacklevel=2 + geoms)
        #: Second requests so far, for pairs in overlap.
        self.retracted = 0
        #: The contacts of the last step in the order in which MuJoCo got them: the bodies' ids in MuJoCo, and the point in contactd's
        #: unit. Its ``id`` names it within the pair of solids for as long as it lasts.
        self.contacts: list[tuple[int, int, Point]] = []
        #: The names of the geoms by which MuJoCo is told of each of ``contacts``; "geom 3" for one without.
        self.contact_geoms: list[tuple[str, str]] = []
        self._manifolds = Manifolds()
        self._in_flight = False
        self._own = session is None
        self.session = embedded() if session is None else session
        #: What no longer collides: geoms with their contype and conaffinity, pairs with their margin.
        self._silenced: list[tuple[int, int, int]] = []
        self._unpaired: list[tuple[int, float]] = []
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
        for geom, contype, conaffinity in self._silenced:
            self.model.geom_contype[geom], self.model.geom_conaffinity[geom] = contype, conaffinity
        for pair, margin in self._unpaired:
            self.model.pair_margin[pair] = margin
        self._silenced, self._unpaired = [], []
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

    def _own_solids(self, meshes: str, taken: Container[int]) -> list[tuple[StandIn, Given]]:
        """The solids of all geoms that collide, or that a ``<pair>`` names, but those of bodies that have one already."""
        found = []
        for body in range(self.model.nbody):
            for geom in () if body in taken else self._filter.meeting(body):
                called = self._filter.geom(geom)
                try:
                    solid = solid_of(self.model, geom, self.unit, meshes)
                except ValueError as e:
                    raise ValueError(f"{called}: {e}: give its body a solid by replace=, or contype and conaffinity 0") from None
                found.append((StandIn(called, body, [geom], False), solid))
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
        self._bodies: dict[int, int] = {}
        self._geoms: dict[int, int] = {}
        self._fixed: dict[int, Pose] = {}
        loaded: dict[str, sessions.Model] = {}
        moving = []
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
            self._bodies[object] = part.body
            self._geoms[object] = first
            if fixed:
                self._fixed[object] = at
            else:
                moving.append(object)
        self._moving = np.array(moving, dtype=np.uint32)
        self._index = {object: i for i, object in enumerate(moving)}
        self._moving_bodies = np.array([self._bodies[o] for o in moving], dtype=int)
        session.set_rules(rules)
        session.options.details = True
        # Last, so that what is refused before has changed nothing.
        for geom in sorted(g for part, _ in given for g in part.geoms):
            self._silenced.append((geom, int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])))
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
        for (g1, g2), pair in self._filter.pairs.items():
            self._unpaired.append((pair, float(model.pair_margin[pair])))
            # With this margin MuJoCo's test of bounding balls leaves the pair out; planes have none, and no distance is so small.
            bounds = float(model.geom_rbound[g1]), float(model.geom_rbound[g2])
            model.pair_margin[pair] = -sum(bounds) if all(bounds) else -mj.mjMAXVAL

    def step(self, data: mj.MjData) -> int:
        """One step of MuJoCo with contactd's contacts; returns how many there were."""
        model = self.model
        mj.mj_step1(model, data)
        n = self.add_contacts(data)
        if n:
            # What mj_step1 made of the contacts that it knew is made again with all of them.
            mj.mj_makeConstraint(model, data)
            mj.mj_island(model, data)
            mj.mj_projectConstraint(model, data)
            mj.mj_referenceConstraint(model, data)
        mj.mj_step2(model, data)
        return n

    def add_contacts(self, data: mj.MjData) -> int:
        """Asks contactd about the bodies as they stand in ``data`` and adds its contacts; for loops that stage their own steps."""
        positions = data.xpos[self._moving_bodies] / self.unit
        rotations = quaternion_from_wxyz(data.xquat[self._moving_bodies])
        points = self._points(positions, rotations)
        self.contacts, self.contact_geoms = [], []
        for a, b, point in points:
            self.contacts.append((self._bodies[a], self._bodies[b], point))
            contact = self._contact(a, b, point)
            self.contact_geoms.append((self._name(int(contact.geom[0])), self._name(int(contact.geom[1]))))
            if mj.mj_addContact(self.model, data, contact) != 0:
                raise MemoryError("MuJoCo's arena has no room for another contact: enlarge <size memory>")
        return len(points)

    def _points(self, positions: np.ndarray, rotations: np.ndarray) -> list[tuple[int, int, Point]]:
        """Objects and points of all contacts, in contactd's unit."""
        reply = self._ask(positions, rotations)
        # Not before there is an answer: without one, what is kept stays that of the last step.
        self._manifolds.start()
        pairs = self._told(reply, positions, rotations)
        deep = {(pair.a, pair.b): pair.points[0] for pair in pairs if pair.status == Status.OVERLAP}
        if not deep:
            return [(pair.a, pair.b, p) for pair in pairs for p in pair.points]
        back = self._retracted(deep, positions)
        moved = positions + back
        found = []
        for pair in self._told(self._ask(moved, rotations), moved, rotations, deep):
            # The gap that a pair has where it really is: one that is still in overlap was told there.
            was_moved = (pair.a, pair.b) in deep and pair.status != Status.OVERLAP
            away = self._gone(pair.a, pair.b, back) if was_moved else 0.0
            gaps = [p._replace(separation=p.separation - float(np.sum(p.normal * away))) for p in pair.points]
            found.extend((pair.a, pair.b, p) for p in gaps)
        return found

    def _told(
        self, reply: Reply, positions: np.ndarray, rotations: np.ndarray, again: Container[tuple[int, int]] | None = None
    ) -> list[Manifold]:
        """The points of all pairs with those of an answer; ``again``: only these pairs are taken of it, where they are out of
        overlap, in place of what they had."""
        for i, record in enumerate(reply):
            a, b = int(record["a"]), int(record["b"])
            if again is None or ((a, b) in again and record["status"] != Status.OVERLAP):
                self._manifolds.add(reply, i, self._place(a, positions, rotations), self._place(b, positions, rotations))
        self._manifolds.finish()
        return self._manifolds.pairs

    def _retracted(self, deep: dict[tuple[int, int], Point], positions: np.ndarray) -> np.ndarray:
        """How far each body goes so that the pairs in overlap are apart along their directions, the moving body alone, by half a
        skin's gap."""
        self.retracted += 1
        back = np.zeros_like(positions)
        for (a, b), p in deep.items():
            way = p.normal * (0.5 * self.skin / self.unit - p.separation)
            # The normal points from a to b: b goes along, a against; where both move b does.
            body, way = (self._index[b], way) if b in self._index else (self._index[a], -way)
            # What an earlier pair has asked for already need not be gone again.
            length = np.linalg.norm(way)
            back[body] += way * max(0.0, 1.0 - float(back[body] @ way) / float(length * length))
        return back

    def _gone(self, a: int, b: int, back: np.ndarray) -> np.ndarray | float:
        """How far b went from a."""
        return (back[self._index[b]] if b in self._index else 0.0) - (back[self._index[a]] if a in self._index else 0.0)

    def _place(self, object: int, positions: np.ndarray, rotations: np.ndarray) -> Pose:
        """Where an object stands."""
        at = self._index.get(object)
        return self._fixed[object] if at is None else Pose(positions[at], rotations[at])

    def _ask(self, positions: np.ndarray, rotations: np.ndarray) -> Reply:
        if self._in_flight:
            # An earlier request whose wait was interrupted: its answer is of no use any more.
            try:
                self.session.finish()
            except Error:
                pass  # it is over all the same
            self._in_flight = False
        poses = self.session.begin_step(len(self._moving))
        poses["object"] = self._moving
        poses["flags"] = Order.START
        poses["position"] = positions
        poses["rotation"] = rotations
        self._in_flight = True
        try:
            reply = self.session.finish()
        except Error:
            self._in_flight = False
            raise
        self._in_flight = False
        return reply

    def _name(self, geom: int) -> str:
        return mj.mj_id2name(self.model, mj.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"

    def _contact(self, a: int, b: int, point: Point) -> mj.MjContact:
        model = self.model
        g1, g2, normal = self._geoms[a], self._geoms[b], point.normal
        k = self._filter.pairs.get((min(g1, g2), max(g1, g2)))
        # MuJoCo tells the geoms of a contact by their types, where these are the same by their bodies, or as the pair does.
        first = int(model.pair_geom1[k]) if k is not None else -1
        if self._order(g2, first) < self._order(g1, first):
            g1, g2, normal = g2, g1, -normal
        contact = mj.MjContact()
        contact.pos, contact.frame, contact.dist = contact_to_mujoco(
            point.position * self.unit, normal, point.separation * self.unit
        )
        contact.geom = [g1, g2]
        contact.flex = contact.elem = contact.vert = [-1, -1]
        contact.efc_address = -1
        contact.includemargin = self.skin
        contact.exclude = 0
        if k is None:
            self._parameters(contact, g1, g2)
        else:
            contact.dim = int(model.pair_dim[k])
            contact.friction = np.maximum(model.pair_friction[k], mj.mjMINMU)
            contact.solref, contact.solimp = model.pair_solref[k], model.pair_solimp[k]
            contact.solreffriction = model.pair_solreffriction[k]
        return contact

    def _order(self, geom: int, first: int) -> tuple[int, bool, int, int]:
        return int(self.model.geom_type[geom]), geom != first, int(self.model.geom_bodyid[geom]), geom

    def _parameters(self, contact: mj.MjContact, g1: int, g2: int) -> None:
        """As mj_contactParam: the geom of higher priority, else the larger condim and friction, and solver parameters mixed."""
        model = self.model
        p1, p2 = model.geom_priority[g1], model.geom_priority[g2]
        if p1 != p2:
            g = g1 if p1 > p2 else g2
            dim, friction = model.geom_condim[g], model.geom_friction[g]
            solref, solimp = model.geom_solref[g], model.geom_solimp[g]
        else:
            dim = max(model.geom_condim[g1], model.geom_condim[g2])
            friction = np.maximum(model.geom_friction[g1], model.geom_friction[g2])
            mix = _mix(model.geom_solmix[g1], model.geom_solmix[g2])
            r1, r2 = model.geom_solref[g1], model.geom_solref[g2]
            solref = mix * r1 + (1 - mix) * r2 if r1[0] > 0 and r2[0] > 0 else np.minimum(r1, r2)
            solimp = mix * model.geom_solimp[g1] + (1 - mix) * model.geom_solimp[g2]
        contact.dim = int(dim)
        slide, spin, roll = np.maximum(friction, mj.mjMINMU)
        contact.friction = [slide, slide, spin, roll, roll]
        contact.solref, contact.solimp = solref, solimp


def _names_a_file(text: str) -> bool:
    """Whether a string is a path, not a CSG text: texts have calls."""
    return "(" not in text and ";" not in text and bool(pathlib.PurePath(text).suffix)


def _mix(first: float, second: float) -> float:
    """Weight of the first geom's solver parameters (engine_collision_driver.c, mj_contactParam)."""
    least = mj.mjMINVAL
    if first >= least and second >= least:
        return float(first / (first + second))
    if first < least and second < least:
        return 0.5
    return 0.0 if first < least else 1.0
