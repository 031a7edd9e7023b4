"""Which geoms MuJoCo lets meet, and what a coupling makes of them: honoured, told by a warning, or refused by name.

MuJoCo's rules (engine_collision_driver.c): geoms of two bodies meet when the ``contype`` of one has a bit of the other's
``conaffinity``, unless the bodies are welded to each other, one is the parent of the other (and neither welded to the world), or an
``<exclude>`` names them; a ``<pair>`` meets whatever these say. A coupling takes geoms out of MuJoCo's collisions and puts
solids in their place, each for one geom or for all of a body. Between two of them it keeps these rules; what it would
lose, or could not keep, is refused before anything is changed.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, Iterable, NamedTuple, Sequence

import mujoco as mj
import numpy as np

from .rules import Rule


class CouplingWarning(UserWarning):
    """The coupling takes something in another way than MuJoCo; the sentence names the body or geom and says what to do."""


class StandIn(NamedTuple):
    """A solid that stands in for geoms."""

    #: How the session calls it.
    name: str
    #: The body that it rides on.
    body: int
    #: The colliding geoms that it stands for. Its contacts have the parameters of the first, and are told by it.
    geoms: Sequence[int]
    #: It stands for all geoms of the body; otherwise for one geom.
    is_whole: bool


#: What makes contacts of geoms: the parameters of which one geom of a body has to speak for all.
_PARAMETERS = ("condim", "friction", "solref", "solimp", "solmix", "priority")
#: Properties of geoms that act through their contacts and that contacts of solids do not have.
_UNKNOWN = {"geom_adhesion": "adhesion", "geom_surfacevel": "surfacevel"}
#: Options of MuJoCo that change what contacts are or do.
_OPTIONS = {
    "mjENBL_OVERRIDE": "contact parameters that override those of geoms (option flag override)",
    "mjENBL_SLEEP": "bodies that sleep (option flag sleep), which a contact of a solid would not wake",
    "mjENBL_IPC": "incremental potential contact (option flag ipc)",
    "mjENBL_SPECULATIVE": "speculative contacts (option flag speculative)",
}


_G = mj.mjtGeom
#: Kinds of geoms of which MuJoCo has all contacts in closed form, exact as contactd's are (engine_collision_primitive.c,
#: engine_collision_box.c).
_EXACT = {
    *(frozenset({_G.mjGEOM_PLANE, k}) for k in (_G.mjGEOM_SPHERE, _G.mjGEOM_CAPSULE, _G.mjGEOM_ELLIPSOID, _G.mjGEOM_CYLINDER, _G.mjGEOM_BOX)),
    *(frozenset({_G.mjGEOM_SPHERE, k}) for k in (_G.mjGEOM_SPHERE, _G.mjGEOM_CAPSULE, _G.mjGEOM_BOX)),
    frozenset({_G.mjGEOM_CAPSULE}),
    frozenset({_G.mjGEOM_BOX}),
    # Of these it has none (mjCOLLISIONFUNC, engine_collision_driver.c).
    frozenset({_G.mjGEOM_PLANE}),
    frozenset({_G.mjGEOM_HFIELD}),
    frozenset({_G.mjGEOM_PLANE, _G.mjGEOM_HFIELD}),
}  # fmt: skip
#: Of a plane and a mesh's hull MuJoCo has the hull's corners (mjc_PlaneConvex, engine_collision_convex.c), exact too.
_EXACT_OF_HULLS = frozenset({_G.mjGEOM_PLANE, _G.mjGEOM_MESH})
#: What stands for a flex where kinds of geoms are told.
_FLEX = -1
#: Bits of contype and conaffinity.
_BITS = 31


class Filter:
    """What MuJoCo lets meet in ``model``: ``take`` says which solids are to stand in for which of its geoms. ``keep_exact``: contacts
    that MuJoCo has in closed form stay its own, between two geoms of which each has a solid for itself. ``hulls``: meshes stand for
    their convex hulls."""

    def __init__(self, model: mj.MjModel, keep_exact: bool = False, hulls: bool = True) -> None:
        self._model = model
        self._exact = {*_EXACT, _EXACT_OF_HULLS} if hulls else _EXACT
        #: The contype and conaffinity of geoms by which they meet what they have MuJoCo's own contacts with, and nothing else.
        self.own_bits: dict[int, tuple[int, int]] = {}
        #: The same of flexes, which have no solids: all of their contacts are MuJoCo's.
        self.own_flex_bits: dict[int, tuple[int, int]] = {}
        self._keeps_exact = keep_exact
        self._excluded = {int(s) for s in model.exclude_signature}
        self._parents = not model.opt.disableflags & mj.mjtDisableBit.mjDSBL_FILTERPARENT
        self.warnings: list[str] = []
        #: ``<pair>`` by its two geoms, the smaller id first, where solids stand in for both.
        self.pairs: dict[tuple[int, int], int] = {}

    def take(self, parts: Sequence[StandIn]) -> None:
        """Raises ``ValueError`` where solids in place of these geoms would make other physics; ``warnings`` are the sentences for what
        is taken in another way."""
        self._parts = parts
        self._part_of = {g: i for i, part in enumerate(parts) for g in part.geoms}
        if parts:
            self._options()
        for part in parts:
            self._check(part)
        self._find_pairs()
        self._others()
        self._flexes()
        self._mixed()

    def body(self, body: int) -> str:
        """How a sentence calls a body."""
        name = mj.mj_id2name(self._model, mj.mjtObj.mjOBJ_BODY, body)
        return f"body {name!r}" if name else f"body {body}"

    def geom(self, geom: int) -> str:
        """How a sentence calls a geom."""
        name = mj.mj_id2name(self._model, mj.mjtObj.mjOBJ_GEOM, geom)
        return f"geom {name!r}" if name else f"geom {geom} of {self.body(int(self._model.geom_bodyid[geom]))}"

    def bodies_meet(self, a: int, b: int) -> bool:
        """Whether geoms of two bodies may meet, as far as that is said of the bodies."""
        model = self._model
        if (min(a, b) << 16) + max(a, b) in self._excluded:
            return False
        weld = [int(model.body_weldid[body]) for body in (a, b)]
        if not any(model.body_dofnum[w] for w in weld):
            return False
        above = [int(model.body_weldid[model.body_parentid[w]]) for w in weld]
        kin = weld[0] == above[1] or weld[1] == above[0]
        return weld[0] != weld[1] and not (self._parents and 0 not in weld and kin)

    def moves(self, body: int) -> bool:
        """Whether a body may move: it has joints between itself and the world, or hangs on a mocap body."""
        model = self._model
        if model.body_weldid[body] != 0:
            return True
        while body != 0 and model.body_mocapid[body] < 0:
            body = int(model.body_parentid[body])
        return body != 0

    def _all_geoms(self, body: int) -> range:
        first = int(self._model.body_geomadr[body])
        return range(first, first + int(self._model.body_geomnum[body])) if first >= 0 else range(0)

    def colliding(self, body: int) -> list[int]:
        """The geoms of a body that collide."""
        return [g for g in self._all_geoms(body) if self._model.geom_contype[g] or self._model.geom_conaffinity[g]]

    def meeting(self, body: int) -> list[int]:
        """The geoms of a body that collide, or that a ``<pair>`` names."""
        named = {int(g) for g in (*self._model.pair_geom1, *self._model.pair_geom2)}
        return sorted({*self.colliding(body), *named.intersection(self._all_geoms(body))})

    def _flex_kind(self, flex: int) -> tuple[int, int, int]:
        model = self._model
        return _FLEX, int(model.flex_contype[flex]), int(model.flex_conaffinity[flex])

    def _kind(self, geom: int) -> tuple[int, int, int]:
        model = self._model
        return int(model.geom_type[geom]), int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])

    def keep_exact(self, geoms: Sequence[int], wholes: Sequence[StandIn]) -> list[int]:
        """Leaves to MuJoCo what it has in closed form, of geoms that would each have a solid for itself beside ``wholes``; returns those
        that meet something else, too."""
        if not self._keeps_exact:
            return list(geoms)
        model = self._model
        flexes = range(getattr(model, "nflex", 0))
        kinds = sorted({self._kind(g) for g in geoms} | {self._flex_kind(f) for f in flexes})
        if len(kinds) > _BITS:
            self._keeps_exact = False
            return list(geoms)
        meets = lambda a, b: bool(a[1] & b[2] or b[1] & a[2])  # noqa: E731
        stays = lambda a, b: _FLEX in (a[0], b[0]) or frozenset({a[0], b[0]}) in self._exact  # noqa: E731
        partners = [[j for j, b in enumerate(kinds) if meets(a, b) and stays(a, b)] for a in kinds]
        bits = lambda i: (1 << i, sum(1 << j for j in partners[i])) if partners[i] else (0, 0)  # noqa: E731
        for f in flexes:
            self.own_flex_bits[f] = bits(kinds.index(self._flex_kind(f)))
        for g in geoms:
            # A bit for each kind: one meets those whose bits it has. What meets none so must not by its old bits.
            self.own_bits[g] = bits(kinds.index(self._kind(g)))
        others = {self._kind(g) for part in wholes for g in part.geoms}
        many = Counter(self._kind(g) for g in geoms)
        # A geom that is the only one of its kind does not meet that.
        left = lambda i, j: j not in partners[i] and (i != j or many[kinds[i]] > 1)  # noqa: E731
        needed = {
            a for i, a in enumerate(kinds)
            if any(meets(a, b) for b in others) or any(meets(a, b) and left(i, j) for j, b in enumerate(kinds))
        }  # fmt: skip
        named = set()
        for k in range(model.npair):
            pair = int(model.pair_geom1[k]), int(model.pair_geom2[k])
            if not self._is_exact(*pair):
                named.update(pair)
        return [g for g in geoms if self._kind(g) in needed or g in named]

    def _is_exact(self, g1: int, g2: int) -> bool:
        """Whether the contacts of two geoms stay MuJoCo's own."""
        types = frozenset({int(self._model.geom_type[g1]), int(self._model.geom_type[g2])})
        return self._keeps_exact and types in self._exact

    def _are_exact(self, a: StandIn, b: StandIn) -> bool:
        return not a.is_whole and not b.is_whole and self._is_exact(a.geoms[0], b.geoms[0])

    def _bits(self, geoms: Any, others: Any) -> np.ndarray:
        """For each of ``geoms`` (rows) and ``others`` (columns) whether their bits let them meet."""
        contype, conaffinity = self._model.geom_contype, self._model.geom_conaffinity
        forth = contype[geoms][:, None] & conaffinity[others][None, :]
        return (forth | (conaffinity[geoms][:, None] & contype[others][None, :])) != 0

    def _options(self) -> None:
        model = self._model
        if model.opt.integrator == mj.mjtIntegrator.mjINT_RK4:
            raise ValueError("the staged step has no Runge-Kutta: choose Euler, implicit or implicitfast")
        for bit, what in _OPTIONS.items():
            if model.opt.enableflags & int(getattr(mj.mjtEnableBit, bit, 0)):
                raise ValueError(f"contacts of solids do not know {what}: switch it off")

    def whole(self, name: str, body: int) -> StandIn:
        """The part of a solid that stands in for all geoms of a body."""
        if not self._all_geoms(body):
            raise ValueError(f"{self.body(body)} has no geom: contacts need one, for friction and to be told by")
        colliding = self.colliding(body)
        if not colliding:
            raise ValueError(
                f"no geom of {self.body(body)} collides (contype and conaffinity are 0; another coupling's bodies are so until it is "
                "closed): give one of them contype=\"1\" conaffinity=\"1\", or leave the body without a solid"
            )
        return StandIn(name, body, colliding, True)

    def _check(self, part: StandIn) -> None:
        model, (first, *more) = self._model, part.geoms
        for field in _PARAMETERS:
            values = getattr(model, f"geom_{field}")
            others = [g for g in more if not np.array_equal(values[g], values[first])]
            if others:
                self.warnings.append(
                    f"contacts of {self.body(part.body)} have the {field} of its first colliding geom, {self.geom(first)}; "
                    f"{self._names(others)} differ: give all of them the same, or make bodies of them"
                )
        for field, word in _UNKNOWN.items():
            values = getattr(model, field, None)
            some = [g for g in part.geoms if values is not None and np.any(values[g])]
            if some:
                raise ValueError(f"contacts of solids do not know {word}, which {self._names(some)} has: take it out")
        for field in ("margin", "gap"):
            some = [g for g in part.geoms if getattr(model, f"geom_{field}")[g]]
            if some and (part.is_whole or any(self._may_meet(part, other) for other in self._parts)):
                self.warnings.append(
                    f"the {field} of {self._names(some)} has no effect: contacts of {self.body(part.body)} act from the coupling's skin on; take "
                    "it out and choose skin"
                )

    def _may_meet(self, a: StandIn, b: StandIn) -> bool:
        """Whether two solids may have contacts with each other."""
        is_bodies = a is not b and self.bodies_meet(a.body, b.body) and not self._are_exact(a, b)
        return is_bodies and bool(self._bits(list(a.geoms), list(b.geoms)).any())

    def _names(self, geoms: Iterable[int]) -> str:
        """Some geoms in a sentence, the first three by name."""
        names = [self.geom(g) for g in geoms]
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        return ", ".join(names[:3]) + more

    def _find_pairs(self) -> None:
        model = self._model
        for k in range(model.npair):
            geoms = int(model.pair_geom1[k]), int(model.pair_geom2[k])
            if self._is_exact(*geoms) and not any(part.is_whole for part in self._parts if set(geoms) & set(part.geoms)):
                continue
            parts = [self._parts[self._part_of[g]] if g in self._part_of else None for g in geoms]
            if all(part is not None and not part.is_whole for part in parts):
                self.pairs[min(geoms), max(geoms)] = k
                if model.pair_margin[k] or model.pair_gap[k]:
                    self.warnings.append(
                        f"margin and gap of the <pair> of {self.geom(geoms[0])} and {self.geom(geoms[1])} have no effect: its contacts act "
                        "from the coupling's skin on; take them out and choose skin"
                    )
                continue
            for part in parts:
                if part is not None:
                    name = mj.mj_id2name(model, mj.mjtObj.mjOBJ_PAIR, k)
                    pair = f"the <pair> {name!r}" if name else "a <pair>"
                    raise ValueError(
                        f"{pair} makes MuJoCo's contacts between {self.geom(geoms[0])} and {self.geom(geoms[1])} beside those of the solid of "
                        f"{self.body(part.body)}: take it out, and give its parameters to the geoms"
                    )

    def _others(self) -> None:
        """Refuses contacts that the coupling would take away: between a coupled body and one without a solid."""
        model = self._model
        others = np.array([g for g in range(model.ngeom) if g not in self._part_of and g not in self.own_bits], dtype=int)
        for part in self._parts:
            body, lost = part.body, {}
            for k, j in zip(*np.nonzero(self._bits(list(part.geoms), others))):
                other = int(model.geom_bodyid[others[j]])
                if other not in lost and self.bodies_meet(body, other):
                    lost[other] = (part.geoms[k], int(others[j]))
            if lost:
                other, (g1, g2) = next(iter(lost.items()))
                more = f", and so with {len(lost) - 1} more" if len(lost) > 1 else ""
                raise ValueError(
                    f"{self.body(body)} has a solid and {self.body(other)} has none, so {self.geom(g1)} and {self.geom(g2)} would no "
                    f"longer meet{more}: give {self.body(other)} a solid too, or say in the model that they do not meet (<exclude>, or "
                    "contype and conaffinity)"
                )

    def _flexes(self) -> None:
        model = self._model
        for flex in range(getattr(model, "nflex", 0)):
            contype, conaffinity = int(model.flex_contype[flex]), int(model.flex_conaffinity[flex])
            for g, part in self._part_of.items():
                if g in self.own_bits:
                    continue  # It meets the flex by its own bits.
                if model.geom_contype[g] & conaffinity or model.geom_conaffinity[g] & contype:
                    name = mj.mj_id2name(model, mj.mjtObj.mjOBJ_FLEX, flex)
                    raise ValueError(
                        f"{self.body(self._parts[part].body)} has a solid, so {self.geom(g)} and the flex {name!r} would no longer meet: say "
                        "in the model that they do not (contype and conaffinity), or leave the body without a solid"
                    )

    def _mixed(self) -> None:
        """Warns where some geoms of two parts meet and others do not."""
        whole = [part for part in self._parts if part.is_whole]
        for i, a in enumerate(whole):
            for b in whole[i + 1 :] + [part for part in self._parts if not part.is_whole]:
                bits = self._bits(list(a.geoms), list(b.geoms))
                if bits.any() and not bits.all() and self.bodies_meet(a.body, b.body):
                    k, j = (int(x[0]) for x in np.nonzero(~bits))
                    self.warnings.append(
                        f"{self.body(a.body)} and {self.body(b.body)} meet as whole solids, though {self.geom(a.geoms[k])} and "
                        f"{self.geom(b.geoms[j])} do not by their contype and conaffinity: make bodies of them, or give all geoms of a "
                        "body the same"
                    )

    def rules(self, margin: float) -> tuple[list[str], list[Rule]]:
        """The group of each part, and the rules between groups, which report from ``margin`` on: parts that no rule names do not meet.

        Parts that meet the same others share a group; those of a ``<pair>`` have their own."""
        model, paired = self._model, {g for pair in self.pairs for g in pair}
        keys: dict[Any, list[int]] = {}
        for i, part in enumerate(self._parts):
            bits = tuple(sorted({(int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in part.geoms}))
            kind = -1 if part.is_whole else int(model.geom_type[part.geoms[0]])
            keys.setdefault((bits, kind, i if part.geoms[0] in paired else -1), []).append(i)
        members = list(keys.values())
        groups = [""] * len(self._parts)
        for number, group in enumerate(members):
            for i in group:
                groups[i] = f"mujoco {number}"
        rule = lambda between, apart: Rule(between, except_=apart, report="patch", margin=margin, penetration=True)  # noqa: E731
        rules = [rule((groups[self._part_of[g1]], groups[self._part_of[g2]]), ()) for g1, g2 in self.pairs]
        for number, group in enumerate(members):
            for other in members[number:]:
                a, b = self._parts[group[0]], self._parts[other[0]]
                if self._bits(list(a.geoms), list(b.geoms)).any() and not self._are_exact(a, b):
                    rules.append(rule((groups[group[0]], groups[other[0]]), self._apart(group, other)))
        if not rules and groups:
            # Without any rule everything would meet.
            rules.append(Rule((groups[0], groups[0]), detect="off"))
        return groups, rules

    def _apart(self, group: list[int], other: list[int]) -> list[tuple[str, str]]:
        """Pairs of two groups that do not meet by their bodies, as far as one of the two moves."""
        found = []
        for i in group:
            for j in other:
                a, b = self._parts[i], self._parts[j]
                if (group is not other or i < j) and (self.moves(a.body) or self.moves(b.body)):
                    if not self.bodies_meet(a.body, b.body):
                        found.append((a.name, b.name))
        return found
