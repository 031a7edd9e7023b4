"""Named converters for the conventions of the field: quaternion order, direction of the normal, sign of the depth, point or
pair of points. docs/coupling.md has the table of engines.

contactd: quaternions x y z w; the unit normal points from a to b; the separation is positive apart, negative in penetration; one point,
half way between the surfaces. All functions take arrays with any leading axes and return new ones.

Poses: ``from_X`` makes ``(position, rotation)`` of contactd, ``to_X`` the engine's own. Contacts: ``contact_from_X`` makes
``Contact(point, normal, separation)``, ``contact_to_X`` the engine's. In each, body 1 (A, first) of the engine is a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

#: How far a matrix may be off a rotation, in any element of RᵀR − I.
ROTATION_TOLERANCE = 1e-6


class Contact(NamedTuple):
    """A contact in contactd's convention."""

    #: Half way between the surfaces, world frame: (…, 3).
    point: np.ndarray
    #: Unit normal from a to b: (…, 3).
    normal: np.ndarray
    #: Positive apart, negative in penetration: (…).
    separation: np.ndarray


def _array(values: ArrayLike, last: int, what: str) -> np.ndarray:
    array = np.array(values, dtype=float)
    if array.ndim == 0 or array.shape[-1] != last:
        raise ValueError(f"expected {what} with {last} numbers in the last axis, found the shape {array.shape}")
    return array


# Quaternions


def quaternion_from_wxyz(quaternion: ArrayLike) -> np.ndarray:
    """x y z w from w x y z (MuJoCo, Drake, Isaac Sim, SAPIEN, Eigen's constructor)."""
    return np.roll(_array(quaternion, 4, "quaternions w x y z"), -1, axis=-1)


def quaternion_to_wxyz(rotation: ArrayLike) -> np.ndarray:
    """w x y z from x y z w."""
    return np.roll(_array(rotation, 4, "quaternions x y z w"), 1, axis=-1)


def matrix_of(rotation: ArrayLike) -> np.ndarray:
    """Rotation matrices (…, 3, 3) of unit quaternions x y z w; their columns are the frame's axes."""
    x, y, z, w = np.moveaxis(_array(rotation, 4, "quaternions x y z w"), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_of(matrix: ArrayLike) -> np.ndarray:
    """Unit quaternions x y z w, w ≥ 0, of rotation matrices (…, 3, 3).

    By the largest of the four components (S. W. Shepperd, "Quaternion from rotation matrix", 1978), so that none is found by
    cancellation. ``ValueError`` for what is no rotation: scaled, skewed, mirrored.
    """
    m = _array(matrix, 3, "matrices")
    if m.ndim < 2 or m.shape[-2] != 3:
        raise ValueError(f"expected 3 by 3 matrices, found the shape {m.shape}")
    gram = np.swapaxes(m, -1, -2) @ m
    if not np.all(np.abs(gram - np.eye(3)) <= ROTATION_TOLERANCE) or not np.all(np.linalg.det(m) > 0):
        raise ValueError("expected rotation matrices: orthonormal, right-handed, without scale")
    t = [m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]]
    # 4 q qᵀ, row by row: the row of the largest component is the quaternion but for its length.
    off = lambda i, j, sign: m[..., i, j] + sign * m[..., j, i]  # noqa: E731
    rows = [
        [1 + t[0] - t[1] - t[2], off(1, 0, 1), off(0, 2, 1), off(2, 1, -1)],
        [off(1, 0, 1), 1 - t[0] + t[1] - t[2], off(2, 1, 1), off(0, 2, -1)],
        [off(0, 2, 1), off(2, 1, 1), 1 - t[0] - t[1] + t[2], off(1, 0, -1)],
        [off(2, 1, -1), off(0, 2, -1), off(1, 0, -1), 1 + t[0] + t[1] + t[2]],
    ]
    products = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    largest = np.argmax(np.stack([products[..., i, i] for i in range(4)], axis=-1), axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., 3:] < 0, -q, q)


# Poses


def from_mujoco(pos: ArrayLike, quat: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """From MuJoCo's ``xpos`` and ``xquat`` (w x y z)."""
    return _array(pos, 3, "positions"), quaternion_from_wxyz(quat)


def to_mujoco(position: ArrayLike, rotation: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's ``xpos`` and ``xquat`` (w x y z)."""
    return _array(position, 3, "positions"), quaternion_to_wxyz(rotation)


def from_drake(state: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """From the seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z."""
    state = _array(state, 7, "states qw qx qy qz x y z")
    return state[..., 4:].copy(), quaternion_from_wxyz(state[..., :4])


def to_drake(position: ArrayLike, rotation: ArrayLike) -> np.ndarray:
    """The seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z."""
    return np.concatenate([quaternion_to_wxyz(rotation), _array(position, 3, "positions")], axis=-1)


def from_mat3x4(matrix: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """From [R | p], three rows of four (the matrices of computer vision, trimesh without its last row)."""
    m = _array(matrix, 4, "matrices")
    if m.ndim < 2 or m.shape[-2] != 3:
        raise ValueError(f"expected 3 by 4 matrices, found the shape {m.shape}")
    return m[..., 3].copy(), rotation_of(m[..., :3])


def to_mat3x4(position: ArrayLike, rotation: ArrayLike) -> np.ndarray:
    """[R | p], three rows of four."""
    p = _array(position, 3, "positions")
    return np.concatenate([matrix_of(rotation), p[..., None]], axis=-1)


def from_mat4(matrix: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """From homogeneous matrices (…, 4, 4) with the position in the last column (Drake's GetAsMatrix4, trimesh, pinocchio)."""
    m = _array(matrix, 4, "matrices")
    if m.ndim < 2 or m.shape[-2] != 4 or not np.all(m[..., 3, :] == [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("expected 4 by 4 matrices whose last row is 0 0 0 1")
    return from_mat3x4(m[..., :3, :])


def to_mat4(position: ArrayLike, rotation: ArrayLike) -> np.ndarray:
    """Homogeneous matrices (…, 4, 4) with the position in the last column."""
    top = to_mat3x4(position, rotation)
    last = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*top.shape[:-2], 1, 4))
    return np.concatenate([top, last], axis=-2)


def from_opengl(matrix: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """From 16 numbers column by column (OpenGL, three.js, Bullet's getOpenGLMatrix)."""
    m = _array(matrix, 16, "matrices, column by column,")
    return from_mat4(np.swapaxes(m.reshape(*m.shape[:-1], 4, 4), -1, -2))


def to_opengl(position: ArrayLike, rotation: ArrayLike) -> np.ndarray:
    """16 numbers column by column."""
    m = np.swapaxes(to_mat4(position, rotation), -1, -2)
    return m.reshape(*m.shape[:-2], 16).copy()


# Contacts


def _contact(point: ArrayLike, normal: ArrayLike, separation: ArrayLike) -> Contact:
    return Contact(_array(point, 3, "points"), _array(normal, 3, "normals"), np.array(separation, dtype=float))


def contact_from_mujoco(pos: ArrayLike, frame: ArrayLike, dist: ArrayLike) -> Contact:
    """From ``mjContact``: midpoint, frame whose first three numbers are the normal from geom 1 to geom 2, dist < 0 in penetration."""
    return _contact(pos, _array(frame, 9, "frames")[..., :3], dist)


def contact_to_mujoco(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``pos``, ``frame`` (normal, then two tangents: 9 numbers) and ``dist`` of ``mjContact``."""
    c = _contact(point, normal, separation)
    n = c.normal
    # The tangent that MuJoCo's own mju_makeFrame chooses: y, or z where the normal is near y.
    axis = np.where(np.abs(n[..., 1:2]) < 0.5, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    first = axis - n * np.sum(n * axis, axis=-1, keepdims=True)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return c.point, np.concatenate([n, first, np.cross(n, first)], axis=-1), c.separation


def contact_from_drake(p_WCa: ArrayLike, p_WCb: ArrayLike, nhat_BA_W: ArrayLike, depth: ArrayLike) -> Contact:
    """From ``PenetrationAsPointPair``: a point of each surface, the normal from B into A, depth > 0 in penetration."""
    point = (_array(p_WCa, 3, "points") + _array(p_WCb, 3, "points")) / 2
    return _contact(point, -_array(nhat_BA_W, 3, "normals"), -np.array(depth, dtype=float))


def contact_to_drake(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``p_WCa``, ``p_WCb``, ``nhat_BA_W``, ``depth`` of ``PenetrationAsPointPair``."""
    on_a, on_b = _pair(point, normal, separation)
    return on_a, on_b, -_array(normal, 3, "normals"), -np.array(separation, dtype=float)


def contact_from_bullet(
    position_on_a: ArrayLike, position_on_b: ArrayLike, normal_on_b: ArrayLike, distance: ArrayLike
) -> Contact:
    """From PyBullet's ``getContactPoints``: a point of each surface, the normal on B towards A, distance < 0 in penetration."""
    point = (_array(position_on_a, 3, "points") + _array(position_on_b, 3, "points")) / 2
    return _contact(point, -_array(normal_on_b, 3, "normals"), distance)


def contact_to_bullet(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``positionOnA``, ``positionOnB``, ``contactNormalOnB``, ``contactDistance``."""
    on_a, on_b = _pair(point, normal, separation)
    return on_a, on_b, -_array(normal, 3, "normals"), np.array(separation, dtype=float)


def contact_from_physx(position: ArrayLike, normal: ArrayLike, separation: ArrayLike) -> Contact:
    """From PhysX's ``PxContactPairPoint``: one point, the normal from the second shape to the first, separation < 0 in penetration."""
    return _contact(position, -_array(normal, 3, "normals"), separation)


def contact_to_physx(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``position``, ``normal``, ``separation`` of ``PxContactPairPoint``."""
    c = _contact(point, normal, separation)
    return c.point, -c.normal, c.separation


def contact_from_ode(pos: ArrayLike, normal: ArrayLike, depth: ArrayLike) -> Contact:
    """From ODE's ``dContactGeom``: one point, the normal into body 1, depth > 0 in penetration."""
    return _contact(pos, -_array(normal, 3, "normals"), -np.array(depth, dtype=float))


def contact_to_ode(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``pos``, ``normal``, ``depth`` of ``dContactGeom``."""
    c = _contact(point, normal, separation)
    return c.point, -c.normal, -c.separation


def contact_from_coal(point: ArrayLike, normal: ArrayLike, penetration_depth: ArrayLike) -> Contact:
    """From Coal's ``Contact``: midpoint, the normal from object 1 to object 2, its "penetration_depth" < 0 in penetration."""
    return _contact(point, normal, penetration_depth)


def contact_to_coal(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``pos``, ``normal``, ``penetration_depth`` of Coal's ``Contact``."""
    return _contact(point, normal, separation)


def contact_from_rapier(point1: ArrayLike, point2: ArrayLike, normal1: ArrayLike, dist: ArrayLike) -> Contact:
    """From parry's ``Contact`` in the world frame: a point of each shape, the normal out of shape 1, dist < 0 in penetration."""
    point = (_array(point1, 3, "points") + _array(point2, 3, "points")) / 2
    return _contact(point, normal1, dist)


def contact_to_rapier(
    point: ArrayLike, normal: ArrayLike, separation: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``point1``, ``point2``, ``normal1``, ``normal2``, ``dist`` of parry's ``Contact``, world frame."""
    on_a, on_b = _pair(point, normal, separation)
    n = _array(normal, 3, "normals")
    return on_a, on_b, n, -n, np.array(separation, dtype=float)


def _pair(point: ArrayLike, normal: ArrayLike, separation: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """A point on each surface: half the separation from the middle, along the normal."""
    c = _contact(point, normal, separation)
    half = c.normal * (c.separation[..., None] / 2)
    return c.point - half, c.point + half
