"""Solids told in code: ``box(40, 40, 4) - cylinder(r=3, h=9)``, printed as the OpenSCAD text that the server loads.

>>> from contactd.solid import box, cylinder
>>> print((box(40, 40, 4) - cylinder(r=3, h=9)).text.expandtabs(4))
difference() {
    cube(size = [40, 40, 4], center = true);
    cylinder(h = 9, r1 = 3, r2 = 3, center = true);
}
<BLANKLINE>

Everything stands around the origin of its own frame: a box is centred, a cylinder's axis is z and its middle the origin. Lengths are in
the model's unit, angles in radians. ``+`` is the union, ``-`` the difference, ``&`` the intersection. ``Solid.text`` is what is loaded,
by ``session.load_model(name, solid)`` too. What makes no sense is a ``ValueError`` of the call that asks for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from . import _native
from ._native import Outline, Solid

__all__ = [
    "Outline",
    "Solid",
    "box",
    "capsule",
    "circle",
    "cone",
    "cylinder",
    "half_space",
    "height_field",
    "hull",
    "hyperbolic_dome",
    "hyperboloid",
    "intersection",
    "minkowski",
    "paraboloid",
    "polygon",
    "polyhedron",
    "quadric",
    "rectangle",
    "sphere",
    "superellipsoid",
    "torus",
    "union",
]


def box(x: float, y: float, z: float) -> Solid:
    """A box with these lengths of its edges."""
    return _native._primitive("box", [x, y, z])


def sphere(r: float) -> Solid:
    """A ball."""
    return _native._primitive("sphere", [r])


def cylinder(r: float, h: float) -> Solid:
    """A cylinder along z, from -h/2 to h/2."""
    return _native._primitive("cylinder", [r, h])


def cone(r1: float, r2: float, h: float) -> Solid:
    """A cone or frustum along z, of radius ``r1`` at -h/2 and ``r2`` at h/2; one of them may be 0."""
    return _native._primitive("cone", [r1, r2, h])


def torus(major: float, minor: float) -> Solid:
    """All points within ``minor`` of the circle of radius ``major`` about z."""
    return _native._primitive("torus", [major, minor])


def capsule(r: float, length: float) -> Solid:
    """All points within ``r`` of the segment along z from -length/2 to length/2."""
    return _native._primitive("capsule", [r, length])


def paraboloid(r: float, h: float) -> Solid:
    """A dome along z, from its rim of radius ``r`` at -h/2 to its tip at h/2; scaled along x and y it is elliptic."""
    return _native._primitive("paraboloid", [r, h])


def hyperboloid(r: float, waist: float, h: float) -> Solid:
    """A hyperboloid of one sheet about z, of radius ``r`` at ±h/2 and ``waist``, which is smaller, at z = 0."""
    return _native._primitive("hyperboloid", [r, waist, h])


def hyperbolic_dome(r: float, h: float, cone: float) -> Solid:
    """A dome as ``paraboloid``, of one sheet of a hyperboloid of two; it nears a cone whose tip is ``cone`` above its own."""
    return _native._primitive("hyperbolic_dome", [r, h, cone])


def quadric(m: Sequence[Sequence[float]], min: Sequence[float], max: Sequence[float]) -> Solid:
    """All points of a box with [x, y, z, 1] M [x, y, z, 1]ᵀ <= 0, ``m`` a symmetric matrix of four rows. Planes alone are none."""
    rows = [list(row) for row in m]
    if [len(row) for row in rows] != [4] * 4:
        raise ValueError(f"quadric: expected four rows of four numbers, found rows of {[len(row) for row in rows]}")
    return _native._primitive("quadric", [*(x for row in rows for x in row), *min, *max])


def superellipsoid(r: Sequence[float], e: Sequence[float]) -> Solid:
    """All points with (|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1) <= 1, ``r`` = (a, b, c) and ``e`` = (e1, e2).

    e1 shapes it north to south, e2 east to west, each from 0.1 to 1: an ellipsoid with both 1, towards 0 a box.
    """
    if len(r) != 3 or len(e) != 2:
        raise ValueError(f"superellipsoid: expected three radii and two exponents, found {len(r)} and {len(e)}")
    return _native._primitive("superellipsoid", [*r, *e])


def half_space(normal: Sequence[float], offset: float) -> Solid:
    """The half-space normal·x <= offset |normal|: a floor or a wall of its own, or to be cut with something."""
    return _native._primitive("half_space", [*normal, offset])


def height_field(rows: Iterable[Sequence[float]], x: float, y: float, base: float) -> Solid:
    """The solid between the plane z = ``base`` and heights above it.

    Rows go up in y, heights within one in x, at the corners of equal cells of a rectangle of the lengths ``x`` and ``y``
    about the origin. Each cell is two triangles that meet along the diagonal from its corner of least x and y to that of
    most.
    """
    return _native._height_field([list(row) for row in rows], x, y, base)


def polyhedron(points: Iterable[Sequence[float]], faces: Iterable[Sequence[int]]) -> Solid:
    """The solid within faces, convex or not: indices of ``points``, counter-clockwise as seen from outside."""
    return _native._polyhedron([list(p) for p in points], [list(f) for f in faces])


def circle(r: float) -> Outline:
    """A disc."""
    return _native._outline("circle", [r])


def rectangle(x: float, y: float) -> Outline:
    """A rectangle, centred."""
    return _native._outline("rectangle", [x, y])


def polygon(*paths: Iterable[Sequence[float]]) -> Outline:
    """What is within an odd number of closed paths: a polygon, or one with holes."""
    return _native._polygon([[list(p) for p in path] for path in paths])


def _join(name: str, of: tuple[Solid, ...] | tuple[Outline, ...]) -> Solid | Outline:
    flat = bool(of) and isinstance(of[0], Outline)
    return _native._join_outlines(name, list(of)) if flat else _native._join(name, list(of))


def union(*of):
    """All points of any of some solids, or outlines."""
    return _join("union", of)


def intersection(*of):
    """All points that some solids, or outlines, have in common."""
    return _join("intersection", of)


def hull(*of):
    """The convex hull of some solids, or outlines."""
    return _join("hull", of)


def minkowski(*of: Solid) -> Solid:
    """The Minkowski sum of some solids."""
    return _native._join("minkowski", list(of))
