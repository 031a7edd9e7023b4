"""Scenes and robots from files in a session: ``session.load_scene``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, NamedTuple

import numpy as np

from .errors import Refused
from .records import POSE
from .rules import Rule

if TYPE_CHECKING:
    from ._native import LoadedScene, Session
    from .reply import Reply


class Joint(NamedTuple):
    """A joint of a robot that has a value of its own."""

    #: It turns, and its value is an angle in radians; otherwise it slides, metres.
    turns: bool
    #: Its limits; infinite where it has none.
    range: tuple[float, float]
    #: Where it stands.
    value: float


class Scene:
    """A scene that was loaded into a session; made by ``Session.load_scene``.

    The session's calls do all that they do; this knows names, and drives robots by their joints.
    """

    def __init__(self, session: Session, native: LoadedScene) -> None:
        self._session = session
        self._native = native
        objects = native.objects()
        #: Ids of its objects by name, in the order of the file.
        self.objects: dict[str, int] = {name: id for name, id, _ in objects}
        #: Ids of the objects' models, by the objects' names.
        self.models: dict[str, int] = {name: model for name, _, model in objects}
        self.unit, self.notes, self.dt = native.about()

    @property
    def rules(self) -> list[Rule]:
        """The scene's rules."""
        return [Rule(between, tuple(except_), **settings) for between, except_, settings in self._native.rules()]

    @property
    def joints(self) -> dict[str, Joint]:
        """The joints that have values of their own, by name; none of a scene file."""
        told = self._native.joints()
        return {name: Joint(turns, (low, high), value) for name, turns, (low, high), value in told}

    def set_joints(self, values: Mapping[str, float]) -> None:
        """Puts a robot where its joints have these values (radians, metres), the others as they stand. Nothing is searched. What
        is attached to a link goes along. ``Refused`` where a joint is not there, or a value beyond its limits."""
        self._native.set_joints(self._session, _values(values))

    def step(self, to: Mapping[str, float] | None = None, timeout: float | None = None) -> Reply:
        """A step in which joints go from where they stand to these values at constant rates: links go on their true arcs. Of a scene
        file its own step, from its beginning.

        ``Refused`` where two hinges would turn a link at once, which is no arc: move one after the other.
        """
        records = self.records(to)
        try:
            return self._session.step(records, timeout)
        except Refused:
            self._native.refused()
            raise

    def records(self, to: Mapping[str, float] | None = None) -> np.ndarray:
        """The poses of that step (dtype ``POSE``), to be put into a batch with those of other objects. After it the joints stand there."""
        return np.frombuffer(self._native.records(self._session, _values(to or {})), POSE)

    def stop_at(self, time: float) -> None:
        """Puts a robot where its joints were at a time, 0 to 1, of the last step: where it met something, say."""
        self._native.stop_at(self._session, time)

    def __repr__(self) -> str:
        return f"Scene({len(self.objects)} objects, {len(self._native.joints())} joints)"


def _values(values: Mapping[str, Any]) -> dict[str, float]:
    told = {name: float(value) for name, value in values.items()}
    for name, value in told.items():
        if math.isnan(value):
            raise ValueError(f"expected a value of the joint {name}, found NaN")
    return told
