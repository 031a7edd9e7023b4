"""A session: models, objects, rules, steps. The same calls over shared memory and over an engine in this process."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any, Iterable, Iterator, NamedTuple, Sequence

import numpy as np

from . import _native
from ._native import Lease, MassProperties, Options
from .errors import Error
from .pose import PoseLike, pose
from .records import CONTACT, DETAIL, PATCH, POSE, REGION, Effect, StepStatus, Tag
from .view import Slots, View

_slots = Slots.of
_new = object.__new__


class Face(NamedTuple):
    """A face of a model."""

    #: Index of its primitive in file order.
    primitive: int
    #: The primitive's name in the format: "sphere", "cylinder" …
    name: str
    #: The face's name: "side", "top" …
    face: str
    #: The primitive is subtracted.
    subtracted: bool


class Model(NamedTuple):
    """A model that was loaded."""

    #: Its id.
    id: int
    #: Its faces by face id.
    faces: list[Face]
    #: What the import snapped or dropped.
    warnings: list[str]


@dataclass
class Rule:
    """What happens between two groups of objects. The first rule that names a pair decides; see docs/effects.md."""

    #: The two groups; both may be the same.
    between: Sequence[str]
    #: Single pairs, by object name, that this rule leaves out.
    except_: Sequence[Sequence[str]] = ()
    #: "off", "discrete" or "continuous".
    detect: str = "continuous"
    #: "hit", "time", "contact" or "patch".
    report: str = "contact"
    #: Depth and direction where a step starts in overlap.
    penetration: bool = False
    #: Report at this separation.
    margin: float = 0.0
    #: "report" or "ignore_if_separating".
    initial_overlap: str = "report"
    #: Record only; never stops first.
    sensor: bool = False


class Region(NamedTuple):
    """A contact region of a pair."""

    #: Its slot (dtype ``REGION``): kind, extent, normal, faces, smallest separation. A view.
    slot: View
    #: Its points, half way between the surfaces, world frame: an array of (n, 3).
    points: np.ndarray
    #: The separation at each point: an array of n.
    separations: np.ndarray


class Reply:
    """The answer to a step, read in place.

    ``records`` and all further slots are views: they raise once the session begins another step, reconnects or closes. The header
    (``safe_time``, ``status`` …) stays.
    """

    __slots__ = ("_native", "_lease", "_records", "_slots")

    _native: _native.Reply
    _lease: Lease
    _records: Slots | None
    _slots: Slots | None

    @property
    def records(self) -> View:
        """The contact records (dtype ``CONTACT``) in the order (time, a, b)."""
        self._lease.check()
        records = self._records
        if records is None:
            records = self._records = _slots(self._lease, CONTACT, self._native.n_records)
        return records

    @property
    def slots(self) -> View:
        """All slots as they lie in memory: the records, then their further slots."""
        self._lease.check()
        slots = self._slots
        if slots is None:
            slots = self._slots = _slots(self._lease, CONTACT, self._lease.bytes // CONTACT.itemsize)
        return slots

    def __len__(self) -> int:
        return self._native.n_records

    def __iter__(self) -> Iterator[View]:
        return iter(self.records)

    def __getitem__(self, index: int) -> View:
        return self.records[index]

    def detail(self, record: int | View) -> View | None:
        """The detail slot (dtype ``DETAIL``) of a record, when details were asked for."""
        for slot in self._further(record):
            if slot["a"] == Tag.DETAIL:
                return View(slot.view(DETAIL), self._lease)
        return None

    def regions(self, record: int | View) -> list[Region]:
        """The contact regions of a record in order, when its rule reports patches or has a margin."""
        further = self._further(record)
        found = []
        for i in np.flatnonzero(further["a"] == Tag.REGION):
            slot = further[i, ...].view(REGION)
            n = int(slot["points"])
            patches = further[i + 1 : i + 1 + -(-n // 4)].view(PATCH)
            points = patches["points"].reshape(-1, 3)[:n]
            found.append(Region(View(slot, self._lease), points.copy(), patches["separations"].ravel()[:n].astype(float)))
        return found

    def patches(self, record: int | View) -> View:
        """The slots (dtype ``PATCH``) with the points of a record's regions; a copy where it has several regions."""
        further = self._further(record)
        return self._chosen(further, Tag.PATCH, PATCH)

    @property
    def details(self) -> View:
        """The detail slots of all records in order. A view where they stand alone, as they do unless regions were asked for;
        otherwise a copy."""
        return self._chosen(self.slots._array[self._native.n_records :], Tag.DETAIL, DETAIL)

    @property
    def all_regions(self) -> View:
        """The region slots of all records in order; a copy unless they stand alone."""
        return self._chosen(self.slots._array[self._native.n_records :], Tag.REGION, REGION)

    @property
    def all_patches(self) -> View:
        """The patch slots of all records in order; a copy unless they stand alone."""
        return self._chosen(self.slots._array[self._native.n_records :], Tag.PATCH, PATCH)

    def _further(self, record: int | View) -> np.ndarray:
        own = record if isinstance(record, View) else self.records[record]
        first, n = int(own["slot"]), int(own["slots"])
        return self.slots._array[first : first + n]

    def _chosen(self, further: np.ndarray, tag: Tag, dtype: np.dtype) -> View:
        at = np.flatnonzero(further["a"] == tag)
        if len(at) and at[-1] - at[0] == len(at) - 1:
            return View(further[at[0] : at[-1] + 1].view(dtype), self._lease)
        return View(further[at].view(dtype), self._lease)

    @property
    def safe_time(self) -> float:
        """Smallest time_lower over all pairs: safe to advance to."""
        return self._native.safe_time

    @property
    def status(self) -> StepStatus:
        """Whether any pair meets, or was left undecided."""
        return StepStatus(self._native.status)

    @property
    def truncated(self) -> bool:
        """True when ``max_records`` left records out."""
        return self._native.truncated

    @property
    def step(self) -> int:
        """The step's number."""
        return self._native.step

    @property
    def pairs(self) -> int:
        """Pairs that the broad phase let through."""
        return self._native.pairs

    @property
    def effects(self) -> Effect:
        """Effects that ran."""
        return Effect(self._native.effects)

    @property
    def counters(self) -> dict[str, int]:
        """Counted work; no part of the answer's bits."""
        return dict(self._native.counters)

    @property
    def effect_counters(self) -> dict[str, int]:
        """How often each effect was worked out."""
        return dict(self._native.effect_counters)

    def __repr__(self) -> str:
        return f"Reply(step={self.step}, status={self.status.name}, records={len(self)}, safe_time={self.safe_time})"


class Session:
    """One client's scene. One thread: the one that opened it. A context manager that closes it.

    Errors are ``contactd.Error`` and its subclasses.
    """

    def __init__(self, native: _native.Session) -> None:
        self._native = native
        # Looked up once: a small step takes a few microseconds.
        self._begin, self._finish = native.begin_step, native.finish
        #: What is asked of the steps to come.
        self.options: Options = native.options

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        try:
            self.close()
        except Error:
            # An exception on its way out tells more than one of closing.
            if error is None:
                raise

    @property
    def id(self) -> int:
        """The session's id on its server."""
        return self._native.opened()[0]

    @property
    def epoch(self) -> int:
        """Changes with every start of the server."""
        return self._native.opened()[1]

    @property
    def max_batch(self) -> int:
        """Most records of a batch."""
        return self._native.opened()[2]

    @property
    def closed(self) -> bool:
        """True after ``close``."""
        return self._native.closed

    def load_model(self, name: str, text: str, facets: str = "auto") -> Model:
        """Loads a model from OpenSCAD CSG text; ``name`` stands in error sentences.

        ``facets``: how curved primitives are taken, "auto", "exact" or "as-written".
        """
        id, faces, warnings = self._native.load_model(name, text, facets)
        return Model(id, [Face(*face) for face in faces], warnings)

    def mass_properties(self, model: Model | int, tolerance: float = 1e-6, boxes: int = 1_000_000) -> MassProperties:
        """Volume, centre of mass and inertia of a model, in its own frame and unit, density 1, each with a proven bound."""
        return self._native.mass_properties(_id(model), tolerance, boxes)

    def add_object(
        self,
        name: str,
        model: Model | int,
        *,
        group: str = "default",
        fixed: bool = False,
        rotates: bool = True,
        max_speed: float = math.inf,
        place: PoseLike | None = None,
        at: PoseLike | None = None,
    ) -> int:
        """Adds an object; returns its id.

        ``group``: for rules. ``fixed``: it never moves. ``rotates=False``: a motion that turns it will be refused. ``max_speed``: no
        point of it is ever faster, length per second; steps then need ``options.dt``. ``place``: the model in the object's
        frame. ``at``: where the object stands. Poses are a ``Pose``, a pair of position and quaternion x y z w, or a position.
        """
        return self._native.add_object(name, _id(model), group, fixed, rotates, max_speed, pose(place), pose(at))

    def remove_object(self, object: int) -> None:
        """Removes an object; its id is not used again."""
        self._native.remove_object(object)

    def set_rules(self, rules: Iterable[Rule]) -> None:
        """Replaces the session's rules; ``Refused`` with the index of a bad one."""
        self._native.set_rules(list(rules))

    def set_resolution(self, resolution: float | None) -> None:
        """Sets the resolution of every pair, a length; None: each pair its default."""
        self._native.set_resolution(resolution)

    def begin_step(self, n: int) -> View:
        """Slots for ``n`` poses (dtype ``POSE``), all zero, to be filled in place until the step is sent.

        A batch that was begun and not sent is dropped. The views of the step before are over.
        """
        return _slots(self._begin(n), POSE, n)

    def send(self) -> None:
        """Sends the batch without waiting; ``finish`` does it too."""
        self._native.send()

    def finish(self, timeout: float | None = None) -> Reply:
        """Sends the batch if it was not yet, and waits for its answer, which is read in place.

        ``timeout`` in seconds; None waits for as long as the server lives. Other threads run meanwhile, and Ctrl-C ends the wait
        for a server. ``Refused`` has the index of the offending record, and nothing has changed; after ``Timeout`` the step is
        still in flight: call again; after ``ServerLost`` see ``reconnect`` and ``resend``.
        """
        native = self._finish(timeout)
        reply = _new(Reply)
        reply._native = native
        reply._lease = native.lease
        reply._records = reply._slots = None
        return reply

    def reconnect(self, timeout: float = 10.0) -> None:
        """After ``ServerLost`` or ``ReplyLost``: waits until a server of the same name runs, opens a session there and replays
        models, objects, rules and last poses. Ids stay the same."""
        self._native.reconnect(timeout)

    def resend(self) -> View:
        """After ``reconnect``: the batch that was in flight when the server died, loaned again with the same poses."""
        lease = self._native.resend()
        return _slots(lease, POSE, lease.bytes // POSE.itemsize)

    def close(self) -> None:
        """Ends the session. Again does nothing; a server that is gone has ended it already."""
        self._native.close()


def _id(model: Model | int) -> int:
    return model.id if isinstance(model, Model) else model


def connect(name: str = "default") -> Session:
    """A session on the server called ``name`` of this user (``contactd serve --name NAME``)."""
    return Session(_native.connect(name))


def embedded(config: str | os.PathLike[str] | None = None) -> Session:
    """A session on an engine in this process: no server, the same bits. ``config``: a server's configuration file."""
    return Session(_native.embedded(config))
