"""The answer to a step: records, and what effects tell beside them."""

from __future__ import annotations

from typing import Iterator, NamedTuple

import numpy as np

from . import _native
from .records import CLEARANCE, DETAIL, PATCH, REGION, StepStatus, Tag
from .rules import Effect
from .view import Part, View


class Region(NamedTuple):
    """A contact region of a pair."""

    #: Its slot (dtype ``REGION``): kind, extent, normal, faces, smallest separation. A view.
    slot: View
    #: Its points, half way between the surfaces, world frame: an array of (n, 3).
    points: np.ndarray
    #: The separation at each point: an array of n.
    separations: np.ndarray


class Reply(_native.Reply):
    """The answer to a step, read in place.

    ``records`` and all further slots are views: they raise once the session begins another step, reconnects or closes. The header
    (``safe_time``, ``status`` …) stays.
    """

    __slots__ = ()

    def __iter__(self) -> Iterator[View]:
        return iter(self.records)

    def __getitem__(self, index: int) -> View:
        return self.records[index]

    def detail(self, record: int | View) -> View | None:
        """The detail slot (dtype ``DETAIL``) of a record, when details were asked for."""
        for slot in self._further(record):
            if slot["a"] == Tag.DETAIL:
                return Part(slot.view(DETAIL), self._lease)
        return None

    def clearance(self, record: int | View) -> View | None:
        """The least distance of a record's pair over the step (dtype ``CLEARANCE``), when its rule asks for its clearance."""
        for slot in self._further(record):
            if slot["a"] == Tag.CLEARANCE:
                return Part(slot.view(CLEARANCE), self._lease)
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
            found.append(Region(Part(slot, self._lease), points.copy(), patches["separations"].ravel()[:n].astype(float)))
        return found

    def patches(self, record: int | View) -> View:
        """The slots (dtype ``PATCH``) with the points of a record's regions; a copy where it has several regions."""
        further = self._further(record)
        return self._chosen(further, Tag.PATCH, PATCH)

    @property
    def details(self) -> View:
        """The detail slots of all records in order. A view where they stand alone, as they do unless regions were asked for;
        otherwise a copy."""
        return self._chosen(self.slots._array[len(self) :], Tag.DETAIL, DETAIL)

    @property
    def clearances(self) -> View:
        """The clearance slots of all records in order; a copy unless they stand alone."""
        return self._chosen(self.slots._array[len(self) :], Tag.CLEARANCE, CLEARANCE)

    @property
    def all_regions(self) -> View:
        """The region slots of all records in order; a copy unless they stand alone."""
        return self._chosen(self.slots._array[len(self) :], Tag.REGION, REGION)

    @property
    def all_patches(self) -> View:
        """The patch slots of all records in order; a copy unless they stand alone."""
        return self._chosen(self.slots._array[len(self) :], Tag.PATCH, PATCH)

    def _further(self, record: int | View) -> np.ndarray:
        own = record if isinstance(record, View) else self.records[record]
        first, n = int(own["slot"]), int(own["slots"])
        return self.slots._array[first : first + n]

    def _chosen(self, further: np.ndarray, tag: Tag, dtype: np.dtype) -> View:
        at = np.flatnonzero(further["a"] == tag)
        if len(at) and at[-1] - at[0] == len(at) - 1:
            return Part(further[at[0] : at[-1] + 1].view(dtype), self._lease)
        return Part(further[at].view(dtype), self._lease)

    @property
    def status(self) -> StepStatus:
        """Whether any pair meets, or was left undecided."""
        return StepStatus(self._status)

    @property
    def effects(self) -> Effect:
        """Effects that ran."""
        return Effect(self._effects)

    def __repr__(self) -> str:
        return f"Reply(step={self.step}, status={self.status.name}, records={len(self)}, safe_time={self.safe_time})"
