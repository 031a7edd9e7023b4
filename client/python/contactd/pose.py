"""Poses, and the records of a batch that are made of them."""

from __future__ import annotations

from typing import NamedTuple, Sequence, Union

from .records import Order

#: Three numbers: a list, a tuple, an array.
Vector = Sequence[float]


class Pose(NamedTuple):
    """A rigid placement, ``parent = rotation · local + position``. The quaternion is x y z w."""

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0, 1.0)


#: A pose, a pair of position and rotation, or a position alone.
PoseLike = Union[Pose, Sequence[Vector], Vector]


def pose(value: PoseLike | None) -> Pose:
    """The pose that ``value`` means; None is the origin.

    Raises ``ValueError`` for anything else than three numbers, or three and four.
    """
    if value is None:
        return Pose()
    if isinstance(value, Pose):
        position, rotation = value
    elif len(value) == 2:
        position, rotation = value
    else:
        position, rotation = value, (0.0, 0.0, 0.0, 1.0)
    numbers = Pose(tuple(map(float, position)), tuple(map(float, rotation)))
    if len(numbers.position) != 3 or len(numbers.rotation) != 4:
        raise ValueError(f"expected a position of 3 numbers and a quaternion x y z w, found {position} and {rotation}")
    return numbers


def end(object: int, position: Vector, rotation: Vector = (0.0, 0.0, 0.0, 1.0)) -> tuple:
    """The record by which an object moves to a pose the shortest way: ``poses[i] = end(object, position, rotation)``."""
    return (object, Order.END, tuple(position), tuple(rotation))


def start(object: int, position: Vector, rotation: Vector = (0.0, 0.0, 0.0, 1.0)) -> tuple:
    """The record that puts an object at a pose before the step, without motion."""
    return (object, Order.START, tuple(position), tuple(rotation))


def turn(object: int, position: Vector, rotation_vector: Vector) -> tuple:
    """The record by which an object's origin moves to ``position`` while it turns by a rotation vector (world axes, radians)."""
    x, y, z = rotation_vector
    return (object, Order.TURN, tuple(position), (x, y, z, 0.0))
