"""Few points for many: what a solver needs of a contact region.

``manifold`` is the one way by which couplings get their contacts, so that how points are chosen can change in one place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .records import Flag, Status, Valid
from .session import Reply
from .view import View

#: Points kept of a region: two bodies that lie on each other are held by three, and a rectangle by its corners.
KEPT = 4


class Point(NamedTuple):
    """A point of a manifold, in contactd's convention."""

    #: Half way between the surfaces, world frame.
    point: np.ndarray
    #: Unit normal from a to b.
    normal: np.ndarray
    #: Positive apart, negative in penetration.
    separation: float


def chosen(points: np.ndarray, separations: np.ndarray, normal: np.ndarray, keep: int = KEPT) -> np.ndarray:
    """Indices, in order, of at most ``keep`` ≤ 4 points that span a region.

    The farthest from the middle; the farthest from that; the farthest from the line of both; and the one that adds most
    area on the line's other side. Near ties go to the smaller index: contactd tells a region's points in an order fixed in the
    bodies, so a body that lies still keeps its points. Separations decide nothing but that the nearest point is among them.
    """
    n = len(points)
    if n <= keep:
        return np.arange(n)
    flat = points - points.mean(axis=0)
    flat = flat - np.outer(flat @ normal, normal)
    size = np.max(np.linalg.norm(flat, axis=1))
    if size == 0.0:
        return np.array([int(np.argmin(separations))])

    def best(values: np.ndarray) -> int:
        # The first of those that are as good as the best but for rounding.
        return int(np.argmax(values >= values.max() - 1e-6 * size))

    first = best(np.linalg.norm(flat, axis=1))
    second = best(np.linalg.norm(flat - flat[first], axis=1))
    along = flat[second] - flat[first]
    length = float(np.linalg.norm(along))
    if length <= 1e-6 * size:
        return np.array([first])
    side = (flat - flat[first]) @ np.cross(normal, along / length)
    picks = [first, second]
    for sign in (1.0, -1.0):
        extreme = best(sign * side)
        if sign * side[extreme] > 1e-3 * size:
            picks.append(extreme)
    nearest = int(np.argmin(separations))
    if separations[nearest] < separations[picks].min() - 1e-3 * size and nearest not in picks:
        # A corner that hangs lower than all that span the region bears first.
        picks[min(range(len(picks)), key=lambda k: np.linalg.norm(flat[picks[k]] - flat[nearest]))] = nearest
    return np.sort(np.array(picks[:keep]))


def manifold(reply: Reply, record: View, keep: int = KEPT) -> list[Point]:
    """The points by which a pair holds itself up: at most ``keep`` of each of its contact regions.

    Of an overlap, which has no regions, the one point that the record proves; with details of a rule that asks for the
    penetration, its depth and direction.
    """
    found = []
    for region in reply.regions(record):
        normal = region.slot["normal"].copy()
        for i in chosen(region.points, region.separations, normal, keep):
            found.append(Point(region.points[i], normal, float(region.separations[i])))
    if not found and record["valid"] & Valid.POINT:
        normal, separation = record["normal"].copy(), float(record["separation"])
        detail = reply.detail(record) if record["status"] == Status.OVERLAP else None
        if detail is not None and detail["penetration"] > 0.0:
            normal, separation = detail["direction"].copy(), -float(detail["penetration"])
        found.append(Point(record["point"].copy(), normal, separation))
    return found


def is_cut(record: View) -> bool:
    """True when the work limit cut the search for a record's regions: there may be more points."""
    return bool(record["flags"] & Flag.REGIONS_INCOMPLETE)
