"""A session: models, objects, rules, steps. The same calls over shared memory and over an engine in this process."""

from __future__ import annotations

import math
import os
from typing import Any, Iterable, Mapping, NamedTuple, Sequence

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._native import MassProperties, Solid
from .errors import Error
from .pose import PoseLike, pose
from .records import POINT, RAY
from .rules import Rule
from .scene import Scene, _values


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


class Recording(NamedTuple):
    """What was recorded."""

    #: The file.
    path: str
    #: Steps that stand in it, or are on their way to it.
    steps: int
    #: Steps that were left out because the recorder could not keep up.
    dropped: int
    #: Steps that stand in it without a picture, for the same reason.
    without_picture: int
    #: Bytes written.
    bytes: int
    #: Why it has ended before its time; empty: it has not.
    failure: str


class Distance(NamedTuple):
    """How far two objects are apart."""

    #: Proven: no two points of them are nearer to each other.
    lower: float
    #: Proven: two points of them are no farther apart; 0 where they share one.
    upper: float
    #: A point of each, world frame: an array of (2, 3).
    points: np.ndarray
    #: The bounds are as near to each other as was asked, or as rounding lets them be.
    settled: bool
    #: Pairs of parts that were looked at.
    cells: int


class Session(_native.Session):
    """One client's scene. One thread: the one that opened it. A context manager that closes it.

    Errors are ``contactd.Error`` and its subclasses.
    """

    # No attributes of its own: ``session.advance = 0.5`` (it is ``session.options.advance``) must not be taken in silence.
    __slots__ = ("__weakref__",)

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        try:
            self.close()
        except Error:
            # An exception on its way out tells more than one of closing.
            if error is None:
                raise

    def load_model(
        self, name: str, text: str | bytes | Solid, facets: str = "auto", *, format: str | None = None
    ) -> Model:
        """Loads a model from OpenSCAD CSG text, from a solid that was built (``contactd.solid``), or from the bytes of a file.

        ``name`` stands in error sentences. ``format``: what it is, such as "csg"; None: bytes are what ``name`` ends in, text is CSG. ``facets``: how curved primitives are taken, "auto", "exact" or "as-written". Large models take seconds; other threads
        run meanwhile, and Ctrl-C is heard when the model is there.
        """
        if isinstance(text, Solid):
            text = text.text
        if isinstance(text, str):
            text, format = text.encode(), format or "csg"
        id, faces, warnings = self._load_model(name, format or "", text, facets)
        return Model(id, [Face(*face) for face in faces], warnings)

    def mass_properties(self, model: Model | int, tolerance: float = 1e-6, boxes: int = 1_000_000) -> MassProperties:
        """Volume, centre of mass and inertia of a model, in its own frame and unit, density 1, each with a proven bound."""
        return self._mass_properties(_id(model), tolerance, boxes)

    def distance(self, a: int, b: int, tolerance: float = 1e-9) -> Distance:
        """How far two objects are apart where the last step has left them: certified bounds to a tolerance (a length)."""
        lower, upper, points, settled, cells = self._distance(a, b, tolerance)
        return Distance(lower, upper, np.array(points), settled, cells)

    def points(
        self,
        points: ArrayLike,
        *,
        surface: float = 1e-9,
        tolerance: float = 1e-6,
        limit: int = 200_000,
        objects: Sequence[int] | None = None,
    ) -> np.ndarray:
        """On which side of the surface points are, and certified bounds of how far: an array of dtype ``POINT``, one for each.

        ``points``: an array of (n, 3), world frame. ``surface``: what is no farther from it is on it. ``tolerance``: how far apart the bounds
        may be; infinite: the side is enough. ``limit``: most parts that are looked at for one. ``objects``: of these alone.
        """
        given = np.ascontiguousarray(points, dtype=float)
        if given.ndim != 2 or given.shape[1] != 3:
            raise ValueError(f"expected points as an array of (n, 3), found one of {given.shape}")
        told = self._points(given.tobytes(), (surface, tolerance, limit), _ids(objects))
        return np.frombuffer(told, POINT)

    def rays(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        length: ArrayLike = math.inf,
        *,
        depth: float = 0.0,
        limit: int = 200_000,
        objects: Sequence[int] | None = None,
    ) -> np.ndarray:
        """What rays meet first, certified: an array of dtype ``RAY``, one for each.

        ``origins``, ``directions``: arrays of (n, 3), world frame; a direction may have any length but 0. ``length``: how far they go,
        one for all or one each; infinite asks objects without bounds as far as anything can be told of them. ``depth``: a ray that comes
        no deeper passes. ``limit``: most stretches that are looked at for one and an object. ``objects``: these alone.
        """
        given = [np.asarray(a, dtype=float) for a in (origins, directions)]
        if any(a.ndim != 2 or a.shape[1] != 3 for a in given) or len(given[0]) != len(given[1]):
            shapes = " and ".join(str(a.shape) for a in given)
            raise ValueError(f"expected origins and directions as arrays of (n, 3), found {shapes}")
        lengths = np.broadcast_to(np.asarray(length, dtype=float), len(given[0]))
        told = self._rays(np.column_stack([*given, lengths]).tobytes(), (depth, limit), _ids(objects))
        return np.frombuffer(told, RAY)

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
        return self._add_object(name, _id(model), group, (fixed, rotates, max_speed), (pose(place), pose(at)))

    def load_scene(
        self,
        path: str | os.PathLike[str],
        joints: Mapping[str, float] | None = None,
        *,
        key: str | None = None,
        hulls: bool = False,
        packages: Sequence[str | os.PathLike[str]] = (),
        srdf: str | os.PathLike[str] | None = None,
        import_root: str | os.PathLike[str] | None = None,
        keep_rules: bool = False,
    ) -> Scene:
        """Loads a scene file (``.toml``) or a robot or world (URDF, SDFormat, MJCF) into the session, beside what it has.

        The files are read here; a server needs none of them. ``joints``: where a robot's joints stand, radians and metres; ``key``: at
        a keyframe of MJCF. ``hulls``: meshes as their convex hulls. ``packages``: folders in which ``package://NAME/…`` is looked for.
        ``srdf``: a file with pairs that are not to be tested. ``import_root``: the folder that texts may import files from; None: their
        own. ``keep_rules``: the session's rules and resolution stay; otherwise the scene's replace them, where it has any.
        ``Refused`` with file, line and column; the session keeps what it had.
        """
        options = (hulls, list(packages), srdf, key, import_root, keep_rules)
        return Scene(self, _native._load_scene(self, path, _values(joints or {}), options))

    def reframe(self, object: int, place: PoseLike, at: PoseLike) -> None:
        """Gives an object another frame, in which its model is at ``place``; the frame rests at ``at``. A motion is one of the frame:
        its origin goes straight while it turns, so what is to turn about an axis needs a frame on that axis."""
        self._reframe(object, pose(place), pose(at))

    def recording(self) -> Recording:
        """What was recorded so far, since ``record``."""
        return Recording(*self._recorded(False))

    def stop_recording(self) -> Recording:
        """Ends the recording: its file is complete when this returns."""
        return Recording(*self._recorded(True))

    def set_rules(self, rules: Iterable[Rule]) -> None:
        """Replaces the session's rules; ``Refused`` with the index of a bad one."""
        rules = list(rules)
        for i, rule in enumerate(rules):
            # A word is a sequence of letters to Python: "ab" would be the groups "a" and "b".
            for field, pairs in (("between", [rule.between]), ("except_", [rule.except_, *rule.except_])):
                if any(isinstance(pair, str) for pair in pairs):
                    raise TypeError(f"rule {i}: expected pairs of names as {field}, found {getattr(rule, field)!r}")
        self._set_rules(rules)


def _ids(objects: Sequence[int] | None) -> list[int] | None:
    return None if objects is None else [int(id) for id in objects]


def _id(model: Model | int) -> int:
    return model.id if isinstance(model, Model) else model


def connect(name: str = "default") -> Session:
    """A session on the server called ``name`` of this user (``contactd serve --name NAME``)."""
    return Session(name)


def embedded(config: str | os.PathLike[str] | None = None) -> Session:
    """A session on an engine in this process: no server, the same bits. ``config``: a server's configuration file."""
    return Session(config=config)
