"""Records as they lie in memory: numpy dtypes with the protocol's own field names, and the numbers that they hold.

The dtypes are made from the layout that the native module was compiled with.
"""

from __future__ import annotations

import enum

import numpy as np

from . import _native


def _dtype(layout: tuple[list[str], list[str], list[int], int]) -> np.dtype:
    names, formats, offsets, size = layout
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


_LAYOUTS = {name: _dtype(layout) for name, layout in _native.layouts()}
_WORDS = dict(_native.words())

#: A pose of a batch, 64 bytes: object, flags (an ``Order``), position, rotation (quaternion x y z w, or a rotation vector and 0).
POSE: np.dtype = _LAYOUTS["POSE"]
#: The answer for a pair, 128 bytes: world frame, times as fractions of the step, normal from a to b.
CONTACT: np.dtype = _LAYOUTS["CONTACT"]
#: A further slot: what few callers need of every pair.
DETAIL: np.dtype = _LAYOUTS["DETAIL"]
#: A further slot: a contact region; the patch slots with its points follow it.
REGION: np.dtype = _LAYOUTS["REGION"]
#: A further slot: the least distance of a pair over the step: certified bounds, when, a point of each body, faces there, work.
CLEARANCE: np.dtype = _LAYOUTS["CLEARANCE"]
#: A further slot: up to four points of a region.
PATCH: np.dtype = _LAYOUTS["PATCH"]

#: The answer about a point: object (or ``NO_OBJECT``), side (into ``SIDE_NAMES``), certified bounds of its signed distance from the surface,
#: the nearest point found, faces there, work.
POINT: np.dtype = _LAYOUTS["POINT"]
#: The answer about a ray: object, outcome (into ``OUTCOME_NAMES``), whether it begins in the object; a hit's bracket lower <= t <= upper
#: (of a miss infinite, of what is undecided ``lower`` is where it is free until), point, normal, face, all faces there, work.
RAY: np.dtype = _LAYOUTS["RAY"]

#: "No object" in ``object`` of a point or ray.
NO_OBJECT = 0xFFFF_FFFF
#: "No face" in ``faces_a`` and ``faces_b``.
NO_FACE = 0xFFFF_FFFF


class Order(enum.IntEnum):
    """``flags`` of a pose."""

    END = 1
    TURN = 2
    START = 4


class Status(enum.IntEnum):
    """``status`` of a contact record."""

    CONTACT = 1
    CLEAR = 2
    OVERLAP = 3
    UNDECIDED = 4


class Flag(enum.IntFlag):
    """``flags`` of a contact record."""

    TOUCHING = 1
    NOT_CONTINUED = 2
    AVERAGED_NORMAL = 4
    SENSOR = 8
    REGIONS_INCOMPLETE = 16
    WITHIN_MARGIN = 32
    COARSER_RESOLUTION = 64


class Valid(enum.IntFlag):
    """``valid`` of a contact record: a bit for each field that has meaning."""

    TIME = 1
    POINT = 2
    NORMAL = 4
    SEPARATION = 8
    NORMAL_SPEED = 16
    KIND = 32
    FACES = 64


class StepStatus(enum.IntEnum):
    """Outcome of a step over all its pairs."""

    CLEAR = 1
    CONTACT = 2
    UNDECIDED = 3


class Tag(enum.IntEnum):
    """First word of a further slot."""

    DETAIL = 1
    PATCH = 2
    REGION = 3
    CLEARANCE = 4


class ClearanceFlag(enum.IntFlag):
    """``flags`` of a clearance slot: its bounds are as near as was asked; points were found."""

    SETTLED = 1
    POINTS = 2


#: Words for ``status``, ``kind`` and ``extent``, by number.
STATUS_NAMES: list[str] = _WORDS["status"]
KIND_NAMES: list[str] = _WORDS["kind"]
EXTENT_NAMES: list[str] = _WORDS["extent"]
#: Words for ``side`` of a point and ``outcome`` of a ray, by number.
SIDE_NAMES: list[str] = _WORDS["side"]
OUTCOME_NAMES: list[str] = _WORDS["outcome"]
