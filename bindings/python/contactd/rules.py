"""Rules of pairs, and the effects that ran in a step.

Not to be edited: made of the tables in proto/src/rule.rs and proto/src/effects.rs by proto/tests/python.rs.
"""

from __future__ import annotations

import enum
from dataclasses import KW_ONLY, dataclass
from typing import Sequence


@dataclass
class Rule:
    """What happens between two groups of objects. The first rule that names a pair decides; see docs/effects.md."""

    #: The two groups; both may be the same.
    between: Sequence[str]
    #: Single pairs, by object name, that this rule leaves out.
    except_: Sequence[Sequence[str]] = ()
    _: KW_ONLY
    #: How the pair is searched.
    #: One of "off", "discrete" or "continuous".
    detect: str = "continuous"
    #: What is told of it.
    #: One of "hit", "time", "contact" or "patch".
    report: str = "contact"
    #: What a pair that starts in overlap does.
    #: One of "report" or "ignore_if_separating".
    initial_overlap: str = "report"
    #: Depth and direction where a step starts in overlap; with patches, too, by which faces the bodies are in each other.
    penetration: bool = False
    #: Record only; never stops a search for the scene's first contact.
    sensor: bool = False
    #: Report at this separation too (length, >= 0): measured by f, never late, early at sharp features.
    margin: float = 0.0
    #: Tell the least distance over the step, its bounds no farther apart than this (length); 0: not asked.
    clearance: float = 0.0


class Effect(enum.IntFlag):
    """Effects that ran in a step."""

    #: Pairs searched over the whole step.
    CONTINUOUS = 1
    #: Pairs tested at the end of the step only.
    DISCRETE = 2
    #: Of the pairs searched over the step those of which a body turns: their bounds are those of rotation.
    TURNING = 4
    #: Times of contact worked out: continued from the witness back to where the surfaces meet.
    TIME = 8
    #: Contact points with their normal, kind and faces.
    CONTACT = 16
    #: Pairs whose contact regions were looked for.
    PATCH = 32
    #: Deepest points of overlaps at the start.
    PENETRATION = 64
    #: Separations tested against a margin.
    MARGIN = 128
    #: Overlaps at the start that were searched past.
    PAST_OVERLAP = 256
    #: Sensor pairs told.
    SENSOR = 512
    #: Least distances over the step worked out.
    CLEARANCE = 1024
