"""Poses, and the records of a batch that are made of them."""

from __future__ import annotations

from typing import NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike

from .records import Order

#: Numbers in a row: a list, a tuple, an array.
Vector = ArrayLike


class Pose(NamedTuple):
    """A rigid placement, ``parent = rotation · local + position``. The quaternion is x y z w."""

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0, 1.0)


#: A pose, a pair of position and rotation, or a position alone.
PoseLike = Union[Pose, tuple[Vector, Vector], Vector]


def pose(value: PoseLike | None) -> Pose:
    """The pose that ``value`` means; None is the origin.

    Raises ``ValueError`` for anything else than three numbers, or three and four.
    """
    if value is None:
        return Pose()
    pair = value if isinstance(value, tuple) and len(value) == 2 else (value, (0.0, 0.0, 0.0, 1.0))
    position, rotation = _numbers(pair[0]), _numbers(pair[1])
    if len(position) != 3 or len(rotation) != 4:
        raise ValueError(f"expected a position of 3 numbers and a quaternion x y z w, found {position} and {rotation}")
    return Pose(position, rotation)


def _numbers(vector: Vector) -> tuple[float, ...]:
    return tuple(np.asarray(vector, dtype=float).ravel().tolist())


def end(object: int, position: Vector, rotation: Vector = (0.0, 0.0, 0.0, 1.0)) -> tuple:
    """The record by which an object moves to a pose the shortest way: ``poses[i] = end(object, position, rotation)``."""
    return (object, Order.END, _numbers(position), _numbers(rotation))


def start(object: int, position: Vector, rotation: Vector = (0.0, 0.0, 0.0, 1.0)) -> tuple:
    """The record that puts an object at a pose before the step, without motion."""
    return (object, Order.START, _numbers(position), _numbers(rotation))


def turn(object: int, position: Vector, rotation_vector: Vector) -> tuple:
    """The record by which an object's origin moves to ``position`` while it turns by a rotation vector (world axes, radians)."""
    return (object, Order.TURN, _numbers(position), (*_numbers(rotation_vector), 0.0))
