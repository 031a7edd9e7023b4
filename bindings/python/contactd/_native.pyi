"""The native part of contactd; use the package, not this module."""

import os
import pathlib
from typing import Any, Callable, Mapping, Self, Sequence, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .reply import Reply as PublicReply
from .view import View

__version__: str
PROTOCOL_VERSION: int

_Layout: TypeAlias = tuple[list[str], list[str], list[int], int]
_Pose: TypeAlias = tuple[ArrayLike, ArrayLike]
_Vector: TypeAlias = list[float]
_Point: TypeAlias = tuple[int, int, _Vector, _Vector, float, _Vector, _Vector]

def layouts() -> list[tuple[str, _Layout]]: ...
def constants() -> list[tuple[str, str, int]]: ...
def words() -> list[tuple[str, list[str]]]: ...
def _command_line(arguments: Sequence[str], again: Sequence[str]) -> int: ...
def error_codes() -> list[tuple[str, int, str]]: ...
def _whole_in_rust(session: Session, batch: np.ndarray) -> int: ...
def _fields_in_rust(
    session: Session, objects: np.ndarray, flags: int, positions: np.ndarray, rotations: np.ndarray
) -> int: ...

class Options:
    """What is asked of the steps to come. Stays as it is set, but for ``advance``, which each accepted step puts back to 1."""

    advance: float
    """Fraction 0..1 of its previous step at which every object stands before the next one."""
    dt: float
    """Duration of a step in seconds, for objects with a declared largest speed; 0: unknown."""
    first: bool
    """Only the pairs whose bracket meets the scene's earliest contact."""
    details: bool
    """A detail slot with each record."""
    clear: bool
    """Records of clear pairs too."""
    polling: bool
    """Poll while waiting; the server then need not wake this client."""
    max_records: int
    """Most records, the earliest first; 0: all."""
    cell_limit: int
    """Most cells that one pair's search may refine; 0: the server's default."""
    batch_limit: int
    """Most cells that all searches of a step may refine together; 0: the server's default."""

class MassProperties:
    """Volume, centre of mass and inertia of a solid of even density. Every true value lies within its error of the one given."""

    @property
    def volume(self) -> float: ...
    @property
    def volume_error(self) -> float: ...
    @property
    def center(self) -> tuple[float, float, float]: ...
    @property
    def center_error(self) -> tuple[float, float, float]: ...
    @property
    def density(self) -> float: ...
    @property
    def mass(self) -> float: ...
    @property
    def mass_error(self) -> float: ...
    @property
    def inertia(self) -> tuple[float, float, float, float, float, float]:
        """About the centre of mass: xx, yy, zz, xy, xz, yz."""
    @property
    def inertia_error(self) -> tuple[float, float, float, float, float, float]: ...
    @property
    def boxes(self) -> int: ...
    def with_density(self, density: float) -> MassProperties:
        """The same solid of another density."""
    def placed(self, position: Sequence[float], rotation: Sequence[float] = ...) -> MassProperties:
        """The same solid seen from the parent of a pose."""

class Lease:
    """The memory of one step's poses or reply."""

    @property
    def alive(self) -> bool: ...
    @property
    def address(self) -> int: ...
    @property
    def bytes(self) -> int: ...
    def check(self) -> None: ...
    def export(self) -> Export: ...
    def __buffer__(self, flags: int, /) -> memoryview: ...

class Export:
    """A counted way to a lease's memory."""

    def __buffer__(self, flags: int, /) -> memoryview: ...

class Slots:
    """The first slots of a lease: ``contactd.view.Slots``."""

    def __new__(cls, lease: Lease, count: int) -> Self: ...
    @property
    def _lease(self) -> Lease: ...
    @property
    def _array(self) -> np.ndarray: ...
    def __len__(self) -> int: ...
    def __setitem__(self, key: Any, value: Any) -> None: ...

class Session:
    """One client's scene: ``contactd.Session``."""

    def __new__(cls, server: str | None = None, config: str | os.PathLike[str] | None = None) -> Self: ...
    @property
    def options(self) -> Options:
        """What is asked of the steps to come."""
    @property
    def id(self) -> int:
        """The session's id on its server."""
    @property
    def epoch(self) -> int:
        """Changes with every start of the server."""
    @property
    def max_batch(self) -> int:
        """Most records of a batch."""
    @property
    def closed(self) -> bool:
        """True after ``close``."""
    def _load_model(
        self, name: str, format: str, bytes: bytes, facets: str
    ) -> tuple[int, list[tuple[int, str, str, bool]], list[str]]: ...
    def _mass_properties(self, model: int, tolerance: float, boxes: int) -> MassProperties: ...
    def _add_object(
        self,
        name: str,
        model: int,
        group: str,
        moves: tuple[bool, bool, float],
        poses: tuple[_Pose, _Pose],
    ) -> int: ...
    def _set_rules(self, rules: list) -> None: ...
    def _distance(self, a: int, b: int, tolerance: float) -> tuple[float, float, list[list[float]], bool, int]: ...
    def _points(self, points: bytes, options: tuple[float, float, int], objects: list[int] | None) -> bytes: ...
    def _rays(self, rays: bytes, options: tuple[float, int], objects: list[int] | None) -> bytes: ...
    def _recorded(self, stop: bool) -> tuple[str, int, int, int, int, str]: ...
    def record(self, path: str | os.PathLike[str]) -> None:
        """Records the session's steps from now on into a new MCAP file, until ``stop_recording`` or the end of the session.

        ``contactd replay FILE`` repeats it bit for bit. A recorder that cannot keep up leaves out whole steps and counts them: no
        step waits for it. ``Refused``: the file exists or cannot be made, the session is being recorded already, or the server has a
        deadline, with which answers depend on time.
        """
    def save_step(self, folder: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the last step as a scene in a new folder, for ``contactd check``; returns the scene's path. ``Refused``: the folder
        exists or cannot be written."""
    def remove_object(self, object: int) -> None:
        """Removes an object; its id is not used again. What it carried is detached before."""
    def attach(self, part: int, carrier: int, touching: Sequence[int] = ...) -> None:
        """From now on ``part`` moves with ``carrier``, as it stands to it (at ``options.advance`` of the last step), and is not tested
        against it nor against the objects in ``touching``. It has the carrier's frame and gets its records; a record of its own is
        ``Misuse``. ``Misuse``, too: a part to itself or to what it carries, and names that other objects share with those that are not
        tested."""
    def detach(self, part: int) -> None:
        """The part stays where it is (at ``options.advance`` of the last step), in the frame that it had of its own, with what is
        attached to it, and is tested as the rules say. ``advance`` must be left as it is until the next step, here and where a part is
        attached or its carrier removed: a step that begins elsewhere is ``Misuse``."""
    def carrier(self, part: int) -> int | None:
        """The object at the end of a part's chain, whose records it gets; None where it is not attached."""
    def allow(self, pairs: Sequence[Sequence[int]], allowed: bool = True) -> None:
        """Pairs of objects that may meet and are not tested, whatever the rules say; ``allowed=False``: no longer. ``Misuse``: names that
        other objects share with them."""
    def _reframe(self, object: int, place: _Pose, at: _Pose) -> None: ...
    def set_resolution(self, resolution: float | None) -> None:
        """Sets the resolution of every pair, a length; None: each pair its default."""
    def begin_step(self, n: int) -> View:
        """Slots for ``n`` poses (dtype ``POSE``), all zero, to be filled in place until the step is sent.

        A batch that was begun and not sent is dropped. The views of the step before are over.
        """
    def step(self, poses: np.ndarray | Sequence[Any], timeout: float | None = None) -> PublicReply:
        """A whole step in one call: ``begin_step``, every slot set from ``poses``, ``finish``.

        ``poses``: an array of dtype ``POSE`` along one axis and without gaps, which costs one copy, or whatever else
        ``begin_step(len(poses))[:]`` takes. Errors are those of the three.
        """
    def send(self) -> None:
        """Sends the batch without waiting; ``finish`` does it too."""
    def finish(self, timeout: float | None = None) -> PublicReply:
        """Sends the batch if it was not yet, and waits for its answer, which is read in place.

        ``timeout`` in seconds; None waits for as long as the server lives. Other threads run meanwhile, and Ctrl-C ends the wait
        for a server. ``Refused`` has the index of the offending record, and nothing has changed; after ``Timeout`` the step is
        still in flight: call again; after ``ServerLost`` see ``reconnect`` and ``resend``.
        """
    def reconnect(self, timeout: float = 10.0) -> None:
        """After ``ServerLost`` or ``ReplyLost``: waits until a server of the same name runs, opens a session there and replays
        models, objects, rules and last poses. Ids stay the same. An embedded session has nothing to find again: ``Misuse``."""
    def resend(self) -> View:
        """After ``reconnect``: the batch that was in flight when the server died, loaned again with the same poses."""
    def close(self) -> None:
        """Ends the session. Again does nothing; a server that is gone has ended it already."""

class Reply:
    """The answer to a step: ``contactd.Reply``."""

    def __new__(cls, lease: Lease) -> Self: ...
    def __len__(self) -> int: ...
    @property
    def records(self) -> View:
        """The contact records (dtype ``CONTACT``) in the order (time, a, b)."""
    @property
    def slots(self) -> View:
        """All slots as they lie in memory: the records, then their further slots."""
    @property
    def _lease(self) -> Lease: ...
    @property
    def step(self) -> int:
        """The step's number."""
    @property
    def _status(self) -> int: ...
    @property
    def safe_time(self) -> float:
        """Smallest time_lower over all pairs: safe to advance to."""
    @property
    def truncated(self) -> bool:
        """True when ``max_records`` left records out."""
    @property
    def _effects(self) -> int: ...
    @property
    def pairs(self) -> int:
        """Pairs that the broad phase let through."""
    @property
    def counters(self) -> dict[str, int]:
        """Counted work by name; no part of the answer's bits."""
    @property
    def effect_counters(self) -> dict[str, int]:
        """How often each effect was worked out, by its word."""

class LoadedScene:
    """A scene that was loaded: ``contactd.Scene``."""

    def objects(self) -> list[tuple[str, int, int]]: ...
    def joints(self) -> list[tuple[str, bool, list[float], float]]: ...
    def about(self) -> tuple[str, list[str], float | None]: ...
    def rules(self) -> list[tuple[list[str], list[list[str]], dict[str, Any]]]: ...
    def set_joints(self, session: Session, values: dict[str, float]) -> None: ...
    def stop_at(self, session: Session, time: float) -> None: ...
    def records(self, session: Session, to: dict[str, float]) -> bytes: ...
    def refused(self) -> None: ...

class Manifolds:
    """The points of all pairs, from step to step: ``contactd.manifold.Manifolds``."""

    def __new__(cls) -> Self: ...
    def _update(self, reply: Reply, placed: Callable[[int, float], _Pose]) -> None: ...
    def start(self) -> None:
        """Begins an update that is made record by record."""
    def _add(self, reply: Reply, record: int, a: _Pose, b: _Pose) -> None: ...
    def finish(self) -> None:
        """Ends an update: pairs that were not added are forgotten."""
    def _pairs(self) -> list[tuple[int, int, int, bool, list[_Point]]]: ...

class Coupled:
    """A model's contacts: what ``contactd.mujoco.Coupling`` does in every step."""

    def __new__(
        cls,
        session: Session,
        model: Any,
        parts: Sequence[tuple[int, int, int, float, _Pose | None]],
        pairs: Mapping[tuple[int, int], int],
        scale: tuple[float, float],
        mujoco: tuple[int, int, float, float],
        contact: tuple[bytes, Mapping[str, int]],
    ) -> Self: ...
    def add_contacts(self, xpos: np.ndarray, xquat: np.ndarray, data: int) -> int: ...
    def contacts(
        self,
    ) -> list[tuple[tuple[int, int, int, int], tuple[_Vector, _Vector, float, _Vector, _Vector]]]: ...
    def geoms(self) -> list[tuple[int, int]]: ...
    def asked(self) -> tuple[int, int]: ...
    def forget(self) -> None: ...

class Solid:
    """A solid in the making, immutable and cheap to copy; made by ``contactd.solid``."""

    @property
    def text(self) -> str:
        """OpenSCAD's text of it, which is what is loaded."""
    def __add__(self, other: Solid) -> Solid: ...
    def __sub__(self, other: Solid) -> Solid: ...
    def __and__(self, other: Solid) -> Solid: ...
    def moved(self, x: float, y: float, z: float) -> Solid: ...
    def placed(self, pose: Any) -> Solid:
        """The same in the frame of a pose's parent: a ``Pose``, a pair of position and quaternion x y z w, or a position."""
    def mirrored(self, normal: Sequence[float]) -> Solid:
        """The mirror image in the plane through the origin with this normal."""
    def scaled(self, x: float, y: float, z: float) -> Solid: ...
    def transformed(self, rows: Sequence[Sequence[float]]) -> Solid:
        """The same under an affine map: three rows of 3 numbers of the linear part and a translation each."""
    def with_pieces(self, pieces: int) -> Solid:
        """The same with curves cut into so many pieces where something made of them has no exact form."""
    def cut(self) -> Outline:
        """The outline that z = 0 cuts out of it."""
    def shadow(self) -> Outline:
        """The shadow on z = 0."""

class Outline:
    """A flat shape in the making, in the plane of x and y; made by ``contactd.solid``."""

    def __add__(self, other: Outline) -> Outline: ...
    def __sub__(self, other: Outline) -> Outline: ...
    def __and__(self, other: Outline) -> Outline: ...
    def moved(self, x: float, y: float) -> Outline: ...
    def turned(self, angle: float) -> Outline: ...
    def mirrored(self, normal: Sequence[float]) -> Outline: ...
    def scaled(self, x: float, y: float) -> Outline: ...
    def offset(self, by: float, corners: str = "round") -> Outline:
        """What is within a distance, corners "round", "sharp" or "cut"; below 0 what is farther inside."""
    def with_pieces(self, pieces: int) -> Outline: ...
    def extrude(self, height: float, scale: tuple[float, float] = ...) -> Solid:
        """The solid over it between -height/2 and height/2, scaled towards its upper end."""
    def twist(self, height: float, angle: float, slices: int) -> Solid:
        """The same, turned about z towards its upper end, radians counter-clockwise."""
    def revolve(self, angle: float = ...) -> Solid:
        """The solid that it makes about an axis: x becomes the distance from z, y becomes z."""

class Batch:
    """A scene that takes queries: ``contactd.batch.Scene``."""

    def __new__(cls, scene: str, cache: str | os.PathLike[str] | None, resolution: float | None) -> Self: ...
    @property
    def key(self) -> str: ...
    @property
    def notes(self) -> list[str]: ...
    def _objects(self) -> list[tuple[str, bool, int, list[float]]]: ...
    def _faces(self) -> list[list[str]]: ...
    def _solve(
        self, offsets: bytes, records: bytes, options: tuple[bool, bool, int, int, int, int]
    ) -> tuple[list[bytes], list[tuple[int, str]]]: ...

def _load_scene(
    session: Session, path: str | os.PathLike[str], joints: dict[str, float], options: tuple[Any, ...]
) -> LoadedScene: ...
def _batch_key(scene: str, resolution: float | None) -> str: ...
def _primitive(name: str, numbers: Sequence[float]) -> Solid: ...
def _outline(name: str, numbers: Sequence[float]) -> Outline: ...
def _polygon(paths: Sequence[Sequence[Sequence[float]]]) -> Outline: ...
def _height_field(rows: Sequence[Sequence[float]], x: float, y: float, base: float) -> Solid: ...
def _polyhedron(points: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> Solid: ...
def _join(name: str, of: Sequence[Solid]) -> Solid: ...
def _join_outlines(name: str, of: Sequence[Outline]) -> Outline: ...
