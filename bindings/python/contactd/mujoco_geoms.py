"""The exact solid of a geom of MuJoCo, in the geom's own frame."""

from __future__ import annotations

from typing import Callable

import mujoco as mj
import numpy as np

from . import solid
from .solid import Solid

#: What a mesh stands for: "hull", its convex hull, as in MuJoCo's own collisions, or "exact", the mesh itself.
MESHES = ("hull", "exact")


def solid_of(model: mj.MjModel, geom: int, unit: float, meshes: str) -> Solid:
    """The solid of a geom; ``unit``: the solid's unit in MuJoCo's lengths. ``ValueError``: its kind has no solid here."""
    kind = int(model.geom_type[geom])
    make = _KINDS.get(kind)
    if make is not None:
        return make(*(float(x) / unit for x in model.geom_size[geom]))
    if kind == mj.mjtGeom.mjGEOM_HFIELD:
        return _height_field(model, int(model.geom_dataid[geom]), unit)
    if kind == mj.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]), unit, meshes)
    raise ValueError(f"its kind, {_name_of_kind(kind)}, has no solid here")


#: Sizes as in MuJoCo's documentation of geoms: radii and half lengths.
_KINDS: dict[int, Callable[[float, float, float], Solid]] = {
    # A plane is infinite to MuJoCo's collisions, whatever its size: that is for drawing.
    int(mj.mjtGeom.mjGEOM_PLANE): lambda x, y, z: solid.half_space([0.0, 0.0, 1.0], 0.0),
    int(mj.mjtGeom.mjGEOM_SPHERE): lambda r, y, z: solid.sphere(r),
    int(mj.mjtGeom.mjGEOM_CAPSULE): lambda r, half, z: solid.capsule(r, 2.0 * half),
    int(mj.mjtGeom.mjGEOM_ELLIPSOID): lambda x, y, z: solid.sphere(1.0).scaled(x, y, z),
    int(mj.mjtGeom.mjGEOM_CYLINDER): lambda r, half, z: solid.cylinder(r, 2.0 * half),
    int(mj.mjtGeom.mjGEOM_BOX): lambda x, y, z: solid.box(2.0 * x, 2.0 * y, 2.0 * z),
}


def _name_of_kind(kind: int) -> str:
    return mj.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()


def _height_field(model: mj.MjModel, field: int, unit: float) -> Solid:
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first = int(model.hfield_adr[field])
    x, y, top, bottom = (float(s) / unit for s in model.hfield_size[field])
    heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns).astype(float) * top
    return solid.height_field(heights.tolist(), 2.0 * x, 2.0 * y, -bottom)


def _mesh(model: mj.MjModel, mesh: int, unit: float, meshes: str) -> Solid:
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    points = model.mesh_vert[first : first + count].astype(float) / unit
    faces = _hull_faces(model, mesh) if meshes == "hull" else None
    if faces is None:
        first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        faces = model.mesh_face[first : first + count]
    else:
        corners, index = np.unique(faces, return_inverse=True)
        points, faces = points[corners], index.reshape(-1, 3)
    # MuJoCo lists a corner once for each normal or texture that it has there.
    points, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    whole = solid.polyhedron(points.tolist(), faces.tolist())
    return solid.hull(whole) if meshes == "hull" else whole


def _hull_faces(model: mj.MjModel, mesh: int) -> np.ndarray | None:
    """The triangles of the hull that MuJoCo collides, of which ``maxhullvert`` may have cut corners off; ``None`` where it made none.

    Its graph holds the numbers of corners and of faces, then two lists of corners, the edges, the faces (mjModel, ``mesh_graph``)."""
    at = int(model.mesh_graphadr[mesh])
    if at < 0:
        return None
    corners, faces = (int(n) for n in model.mesh_graph[at : at + 2])
    first = at + 2 + 2 * corners + (corners + 3 * faces)
    return model.mesh_graph[first : first + 3 * faces].reshape(-1, 3)
