"""Which geoms MuJoCo lets meet, and what a coupling makes of them: honoured, told by a warning, or refused by name.

MuJoCo's rules (engine_collision_driver.c): geoms of two bodies meet when the ``contype`` of one has a bit of the other's
``conaffinity``, unless the bodies are welded to each other, one is the parent of the other (and neither welded to the world), or an
``<exclude>`` names them; a ``<pair>`` meets whatever these say. A coupling takes the bodies' geoms out of MuJoCo's collisions
and puts solids in their place. So between two coupled bodies it keeps these rules body by body; what it would lose, or
could not keep, is refused before anything is changed.
"""

from __future__ import annotations

from typing import Any, Iterable, Sequence

import mujoco as mj
import numpy as np


class CouplingWarning(UserWarning):
    """The coupling takes something in another way than MuJoCo; the sentence names the body or geom and says what to do."""


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


class Filter:
    """What MuJoCo lets meet in ``model``, whose bodies ``coupled`` are to have solids; raises ``ValueError`` where the coupling would
    make other physics of it, and has the sentences of ``warnings`` for what it takes in another way."""

    def __init__(self, model: mj.MjModel, coupled: Sequence[int]) -> None:
        self._model = model
        self._excluded = {int(s) for s in model.exclude_signature}
        self._parents = not model.opt.disableflags & mj.mjtDisableBit.mjDSBL_FILTERPARENT
        self._coupled = coupled
        self._is_coupled = np.zeros(model.nbody, dtype=bool)
        self._is_coupled[list(coupled)] = True
        self.warnings: list[str] = []
        self._options()
        #: For each coupled body the geom that its contacts have their parameters of, and are told by: the first one that collides.
        self.geoms = {body: self._speaker(body) for body in coupled}
        self._pairs()
        self._others()
        self._flexes()
        #: Coupled bodies that do not meet.
        self.apart = self._apart()

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

    def _colliding(self, body: int) -> list[int]:
        return [g for g in self._all_geoms(body) if self._model.geom_contype[g] or self._model.geom_conaffinity[g]]

    def _bits(self, geoms: Any, others: Any) -> np.ndarray:
        """For each of ``geoms`` (rows) and ``others`` (columns) whether their bits let them meet."""
        contype, conaffinity = self._model.geom_contype, self._model.geom_conaffinity
        forth = contype[geoms][:, None] & conaffinity[others][None, :]
        return (forth | (conaffinity[geoms][:, None] & contype[others][None, :])) != 0

    def _options(self) -> None:
        model = self._model
        if model.opt.integrator == mj.mjtIntegrator.mjINT_RK4:
            raise ValueError("the staged step has no Runge-Kutta: choose Euler, implicit or implicitfast")
        for bit in ("mjDSBL_CONTACT", "mjDSBL_CONSTRAINT"):
            if model.opt.disableflags & getattr(mj.mjtDisableBit, bit):
                flag = bit.removeprefix("mjDSBL_").lower()
                raise ValueError(f"the model's option flag {flag} is off, a coupling adds contacts: switch it on, or step without a coupling")
        for bit, what in _OPTIONS.items():
            if model.opt.enableflags & int(getattr(mj.mjtEnableBit, bit, 0)):
                raise ValueError(f"contacts of solids do not know {what}: switch it off")

    def _speaker(self, body: int) -> int:
        model = self._model
        if not self._all_geoms(body):
            raise ValueError(f"{self.body(body)} has no geom: contacts need one, for friction and to be told by")
        colliding = self._colliding(body)
        if not colliding:
            raise ValueError(
                f"no geom of {self.body(body)} collides (contype and conaffinity are 0; another coupling's bodies are so until it is "
                "closed): give one of them contype=\"1\" conaffinity=\"1\", or leave the body without a solid"
            )
        first = colliding[0]
        for field in _PARAMETERS:
            values = getattr(model, f"geom_{field}")
            others = [g for g in colliding if not np.array_equal(values[g], values[first])]
            if others:
                self.warnings.append(
                    f"contacts of {self.body(body)} have the {field} of its first colliding geom, {self.geom(first)}; {self._names(others)} "
                    "differ: give all of them the same, or make bodies of them"
                )
        for field, word in _UNKNOWN.items():
            values = getattr(model, field, None)
            some = [g for g in colliding if values is not None and np.any(values[g])]
            if some:
                raise ValueError(f"contacts of solids do not know {word}, which {self._names(some)} has: take it out")
        for field in ("margin", "gap"):
            some = [g for g in colliding if getattr(model, f"geom_{field}")[g]]
            if some:
                self.warnings.append(
                    f"the {field} of {self._names(some)} has no effect: contacts of {self.body(body)} act from the coupling's skin on; take "
                    "it out and choose skin"
                )
        return first

    def _names(self, geoms: Iterable[int]) -> str:
        """Some geoms in a sentence, the first three by name."""
        names = [self.geom(g) for g in geoms]
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        return ", ".join(names[:3]) + more

    def _pairs(self) -> None:
        model = self._model
        for k in range(model.npair):
            geoms = int(model.pair_geom1[k]), int(model.pair_geom2[k])
            theirs = [int(model.geom_bodyid[g]) for g in geoms]
            for body in theirs:
                if self._is_coupled[body]:
                    name = mj.mj_id2name(model, mj.mjtObj.mjOBJ_PAIR, k)
                    pair = f"the <pair> {name!r}" if name else "a <pair>"
                    raise ValueError(
                        f"{pair} makes MuJoCo's contacts between {self.geom(geoms[0])} and {self.geom(geoms[1])} beside those of the solid of "
                        f"{self.body(body)}: take it out, and give its parameters to the geoms"
                    )

    def _others(self) -> None:
        """Refuses contacts that the coupling would take away: between a coupled body and one without a solid."""
        model = self._model
        others = np.flatnonzero(~self._is_coupled[model.geom_bodyid])
        for body in self._coupled:
            geoms = self._colliding(body)
            lost = {}
            for k, j in zip(*np.nonzero(self._bits(geoms, others))):
                other = int(model.geom_bodyid[others[j]])
                if other not in lost and self.bodies_meet(body, other):
                    lost[other] = (geoms[k], int(others[j]))
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
            for body in self._coupled:
                for g in self._colliding(body):
                    if model.geom_contype[g] & conaffinity or model.geom_conaffinity[g] & contype:
                        name = mj.mj_id2name(model, mj.mjtObj.mjOBJ_FLEX, flex)
                        raise ValueError(
                            f"{self.body(body)} has a solid, so {self.geom(g)} and the flex {name!r} would no longer meet: say in the model "
                            "that they do not (contype and conaffinity), or leave the body without a solid"
                        )

    def _apart(self) -> list[tuple[int, int]]:
        found = []
        colliding = {body: self._colliding(body) for body in self._coupled}
        for i, a in enumerate(self._coupled):
            for b in self._coupled[i + 1 :]:
                bits = self._bits(colliding[a], colliding[b])
                if not self.bodies_meet(a, b) or not bits.any():
                    found.append((a, b))
                elif not bits.all():
                    k, j = (int(x[0]) for x in np.nonzero(~bits))
                    self.warnings.append(
                        f"{self.body(a)} and {self.body(b)} meet as whole solids, though {self.geom(colliding[a][k])} and "
                        f"{self.geom(colliding[b][j])} do not by their contype and conaffinity: make bodies of them, or give all geoms of a "
                        "body the same"
                    )
        return found
