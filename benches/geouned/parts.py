"""Two parts from STEP to OpenMC's cells by GEOUNED, and whether they are the same parts.

Makes a flange and a bracket that is turned, with FreeCAD, as STEP files; converts them with GEOUNED, all digits kept; compares the cells
with the solids that FreeCAD reads back: how far points of their faces are from the cells' surfaces, and whether random points are inside
of both. Writes FOLDER/flange.xml and FOLDER/bracket.xml, which `contactd overlaps` takes.

    apt install freecad-python3        # FreeCAD 0.20
    python3 -m venv --system-site-packages venv && venv/bin/pip install 'geouned<=1.6.2'
    venv/bin/python benches/geouned/parts.py FOLDER
"""

import math
import os
import random
import re
import sys

sys.path += ["/usr/lib/freecad-python3/lib", "/usr/lib/freecad/lib", "/usr/share/freecad/Mod/Part"]

import FreeCAD
import Part
import geouned
import numpy as np
from FreeCAD import Placement, Rotation, Vector

# Without these it writes six digits behind the point of cylinders and cones.
ALL_DIGITS = geouned.NumericFormat(
    **{
        key: "23.16e"
        for key in (
            "P_abc P_d P_xyz S_r S_xyz C_r C_xyz K_xyz K_tan2 T_r T_xyz GQ_1to6 GQ_7to9 GQ_10".split()
        )
    }
)


def flange():
    """A disc with a hub, a bore with a chamfer and six holes, millimetres."""
    part = Part.makeCylinder(50, 10).fuse(Part.makeCylinder(25, 30)).cut(Part.makeCylinder(12.5, 40, Vector(0, 0, -5)))
    for k in range(6):
        angle = math.pi * k / 3
        part = part.cut(Part.makeCylinder(4.5, 20, Vector(38 * math.cos(angle), 38 * math.sin(angle), -5)))
    return part.cut(Part.makeCone(15.5, 12.5, 3))


def bracket():
    """A block with a slanted hole, a round pocket and a conical one, turned."""
    part = Part.makeBox(60, 40, 20).cut(Part.makeCylinder(7, 80, Vector(20, -10, 10), Vector(0.2, 1, 0.1)))
    part = part.cut(Part.makeSphere(12, Vector(45, 20, 22))).cut(Part.makeCone(3, 8, 9, Vector(12, 30, 12)))
    part.Placement = Placement(Vector(3, -7, 11), Rotation(Vector(1, 2, 3), 33))
    return part


def surface(kind, c):
    """Value and gradient of a surface's polynomial, by OpenMC's documentation."""

    def at(p):
        x, y, z = p
        if kind in ("x-plane", "y-plane", "z-plane"):
            axis = np.eye(3)["xyz".index(kind[0])]
            return axis @ p - c[0], axis
        if kind == "plane":
            return c[:3] @ p - c[3], c[:3]
        if kind == "z-cylinder":
            d = np.array([x - c[0], y - c[1], 0.0])
            return d @ d - c[2] ** 2, 2 * d
        if kind == "sphere":
            return (p - c[:3]) @ (p - c[:3]) - c[3] ** 2, 2 * (p - c[:3])
        if kind == "z-cone":
            d = (p - c[:3]) * np.array([1.0, 1.0, -c[3]])
            return d @ (p - c[:3]), 2 * d
        if kind == "quadric":
            a, b, cc, d, e, f, g, h, j, k = c
            value = x * (a * x + d * y + g) + y * (b * y + e * z + h) + z * (cc * z + f * x + j) + k
            slope = [2 * a * x + d * y + f * z + g, 2 * b * y + d * x + e * z + h, 2 * cc * z + e * y + f * x + j]
            return value, np.array(slope)
        raise SystemExit(f"the surface {kind} is not known here")

    return at


def compare(name, folder):
    text = open(f"{folder}/{name}.xml").read()
    rows = re.findall(r'<surface id="(\d+)" type="([a-z-]+)" coeffs="([^"]*)"', text)
    region = re.search(r'<cell id="1"[^>]*region="([^"]*)"', text).group(1)
    used = {abs(int(word)) for word in re.findall(r"-?\d+", region)}
    surfaces = {int(i): surface(kind, np.array([float(x) for x in c.split()])) for i, kind, c in rows if int(i) in used}
    # In Python's words: blanks bind closer than |, as `and` does than `or`.
    side = lambda m: f"(sign({abs(int(m[0]))}) {'>' if int(m[0]) > 0 else '<'} 0)"
    words = re.sub(r"-?\d+", side, region).replace("|", " or ")
    words = re.sub(r"\)\s*\(", ") and (", words)
    solid = Part.read(f"{folder}/{name}.stp")
    worst, points = 0.0, 0
    for face in solid.Faces:
        low_u, high_u, low_v, high_v = face.ParameterRange
        for _ in range(200):
            u, v = random.uniform(low_u, high_u), random.uniform(low_v, high_v)
            if face.isPartOfDomain(u, v):
                p = np.array(face.valueAt(u, v)) / 10
                values = [s(p) for s in surfaces.values()]
                worst = max(worst, min(abs(f) / max(np.linalg.norm(g), 1e-9) for f, g in values))
                points += 1
    box, differ, inside, count = solid.BoundBox, 0, 0, 4000
    for _ in range(count):
        q = [random.uniform(*side) for side in ((box.XMin, box.XMax), (box.YMin, box.YMax), (box.ZMin, box.ZMax))]
        is_inside = solid.isInside(Vector(*q), 1e-7, True)
        p = np.array(q) / 10
        differ += is_inside != bool(eval(words, {"sign": lambda k: surfaces[k](p)[0]}))
        inside += is_inside
    print(
        f"{name}: {points} points of its faces are {worst:.1e} cm from a surface of its cell at most; "
        f"of {count} random points, {inside} of them inside, {differ} are elsewhere"
    )


def main():
    folder = os.path.abspath(sys.argv[1])
    os.makedirs(folder, exist_ok=True)
    random.seed(1)
    for name, part in (("flange", flange()), ("bracket", bracket())):
        part.exportStep(f"{folder}/{name}.stp")
        cad = geouned.CadToCsg(settings=geouned.Settings(outPath=folder), numeric_format=ALL_DIGITS)
        cad.load_step_file(f"{folder}/{name}.stp")
        cad.start()
        cad.export_csg(title=name, geometryName=f"{folder}/{name}", outFormat=("openmc_xml",))
        compare(name, folder)


main()
