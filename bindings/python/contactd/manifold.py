"""Few points for many: what a solver needs of contact regions, with ids that stay from step to step.

    manifolds = contactd.manifold.Manifolds()
    …                                                    # after each step
    manifolds.update(reply, lambda object, time: poses[object])
    for pair in manifolds:
        for p in pair.points:
            print(pair.a, pair.b, p.id, p.position, p.normal, p.separation)

At most four points of each direction of contact. The rule of a pair needs ``report="patch"``; with a margin it tells points before
they touch. Of an overlap they are those of the face that the bodies came through, with the depth there, where the rule
asks for ``penetration``, too; without it there is one, which proves the overlap. How points are chosen, and which ids they get, is told in ``client/src/manifold.rs``: this is the same code.
"""

from __future__ import annotations

from typing import Callable, Iterator, NamedTuple

import numpy as np

from . import _native
from .pose import PoseLike
from .pose import pose as as_pose
from .reply import Reply


class Point(NamedTuple):
    """A point of a manifold, in contactd's convention."""

    #: Names the point within its pair, for as long as it lasts.
    id: int
    #: Which of the pair's groups of one normal it belongs to, from 0.
    group: int
    #: Half way between the surfaces, world frame.
    position: np.ndarray
    #: Unit normal from a to b, world frame.
    normal: np.ndarray
    #: Distance of the surfaces along the normal: positive apart, negative in penetration.
    separation: float
    #: The point on a's surface, in a's object frame.
    on_a: np.ndarray
    #: The point on b's surface, in b's object frame.
    on_b: np.ndarray


class Manifold(NamedTuple):
    """The points of a pair."""

    #: The object with the smaller id.
    a: int
    #: The other one.
    b: int
    #: The record's ``Status``: contact, clear or overlap.
    status: int
    #: False when the work limit cut the search for regions: there may be more points.
    is_complete: bool
    #: Groups in the order in which they were told, the points of each by id.
    points: list[Point]


class Manifolds(_native.Manifolds):
    """The points of all pairs, from step to step."""

    def update(self, reply: Reply, pose: Callable[[int, float], PoseLike]) -> None:
        """Takes the answer to a step, once after each.

        ``pose(object, time)``: where an object stood at that fraction of the step, fixed ones too: 0, its start, for pairs told
        where they begin; the time of contact for those that meet. (For the pairs of ``detect="discrete"``, which are told
        at their end, answer 0 with that; steps of ``Order.START`` have one pose.) Pairs that are not told are forgotten.
        """
        self._update(reply, lambda object, time: as_pose(pose(object, time)))

    def add(self, reply: Reply, record: int, a: PoseLike, b: PoseLike) -> None:
        """Takes one record of a reply, whose bodies stood at these poses at the moment that it tells of: between ``start()`` and
        ``finish()``. A pair that is added again before the next ``start()`` gets the points of the last time that told any; between
        the two lies a ``finish()``, or none."""
        self._add(reply, record, as_pose(a), as_pose(b))

    @property
    def pairs(self) -> list[Manifold]:
        """All pairs that have points, in the order (a, b)."""
        found = []
        for a, b, status, is_complete, points in self._pairs():
            told = [
                Point(id, group, np.array(position), np.array(normal), separation, np.array(on_a), np.array(on_b))
                for id, group, position, normal, separation, on_a, on_b in points
            ]
            found.append(Manifold(a, b, status, is_complete, told))
        return found

    def __iter__(self) -> Iterator[Manifold]:
        return iter(self.pairs)
