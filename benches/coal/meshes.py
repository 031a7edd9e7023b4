#!/usr/bin/env python3
"""The questions of the benchmark `meshes`, asked of coal (Python package `coal`, formerly hpp-fcl).

    cargo run --release -p contactd-benches --bin meshes -- --export DIR
    pip install coal
    python3 benches/coal/meshes.py DIR [--steps N]

coal answers about one instant. A first contact is looked for as its users do it: collision tests at N instants of the
step, then halving between the last one without a contact and the first one with one. What lies between two instants is
not seen. Told are its times beside ours, how far apart coal says that the bodies are at our time, and three counts:

- later: coal finds a contact at an instant before our time, with no distance between the bodies by its own account. It would be our
  error.
- apart: at our time coal sees the bodies more than 1e-6 apart. It would be our error, too.
- unseen: contacts of ours that no instant shows, for all are between two.
"""

import argparse
import csv
import pathlib
import sys
import time

try:
    import coal
    import numpy as np
except ImportError as missing:
    sys.exit(f"meshes.py: {missing.name} is not installed (pip install coal): nothing is compared")

# Lengths and times within which two answers are the same: coal's own tolerance for meshes is of single steps of GJK.
SAME = 1e-6
# Lengths within which bodies touch.
TOUCHING = 1e-8
LINE = "{:28} {:28} {:9} {:>5} {:>10} {:>11} {:>11} {:>6} {:>6} {:>7} {:>9}"


def off(path):
    """Points and triangles of an OFF file."""
    words = path.read_text().split()
    points, faces = int(words[1]), int(words[2])
    numbers = np.array(words[4 : 4 + 3 * points], dtype=float).reshape(-1, 3)
    triangles = np.array(words[4 + 3 * points : 4 + 3 * points + 4 * faces], dtype=int).reshape(-1, 4)[:, 1:]
    return numbers, triangles


def shape(folder, text):
    """A body of coal by its words: a file's name, or a primitive with its sizes."""
    kind, *sizes = text.split() if not text.endswith(".off") else [text]
    sizes = [float(s) for s in sizes]
    if kind == "ball":
        return coal.Sphere(sizes[0])
    if kind == "box":
        return coal.Box(*(2 * s for s in sizes))
    if kind == "capsule":
        return coal.Capsule(sizes[1], 2 * sizes[0])
    points, triangles = off(folder / text)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(points))
    mesh.addVertices(points)
    mesh.addTriangles(triangles.astype(np.uint32))
    mesh.endModel()
    return mesh


def pose(motion, t):
    """Placement at a time: straight on, turning at a constant rate about the world's axis (radians a step)."""
    position = np.array(motion[0:3]) + t * np.array(motion[7:10])
    x, y, z, w = motion[3:7]
    start = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    spin = t * np.array(motion[10:13])
    angle = np.linalg.norm(spin)
    turn = np.eye(3)
    if angle > 0:
        a, b, c = spin / angle
        cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return coal.Transform3s(turn @ start, position)


def first_contact(bodies, motions, steps):
    """The first instant with a contact, by steps and halving, and the number of tests."""
    request = coal.CollisionRequest()

    def meets(t):
        return coal.collide(bodies[0], pose(motions[0], t), bodies[1], pose(motions[1], t), request, coal.CollisionResult())

    tests = 0
    for k in range(steps + 1):
        tests += 1
        if not meets(k / steps):
            continue
        low, high = max(k - 1, 0) / steps, k / steps
        while high - low > 1e-9:
            tests += 1
            middle = 0.5 * (low + high)
            low, high = (low, middle) if meets(middle) else (middle, high)
        return high, tests
    return None, tests


def ask(folder, row, shapes, steps):
    """One question: our time, coal's, seconds, and coal's distance at our time."""
    for name in (row["a"], row["b"]):
        shapes.setdefault(name, None)
        if shapes[name] is None:
            shapes[name] = shape(folder, name)
    bodies = shapes[row["a"]], shapes[row["b"]]
    numbers = list(row.values())
    motions = [float(x) for x in numbers[2:15]], [float(x) for x in numbers[15:28]]
    begun = time.perf_counter()
    found, tests = first_contact(bodies, motions, steps)
    seconds = time.perf_counter() - begun
    own = float(row["time"]) if row["status"] == "Contact" else None

    def distance(t):
        if t is None:
            return 0.0
        poses = [pose(m, t) for m in motions]
        return coal.distance(bodies[0], poses[0], bodies[1], poses[1], coal.DistanceRequest(), coal.DistanceResult())

    # Its test says yes from a millionth apart on: a contact is where its distance is none.
    if found is not None and distance(found) > TOUCHING and (own is None or found < own):
        found = own
    return own, found, seconds / tests, seconds, distance(own)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, help="what `meshes --export` has written")
    parser.add_argument("--steps", type=int, default=200, help="instants of a step (200)")
    options = parser.parse_args()
    shapes, classes = {}, {}
    with open(options.folder / "scenes.csv", newline="") as file:
        for row in csv.DictReader(file):
            turns = any(float(row[f"{k}_w{c}"]) != 0 for k in "ab" for c in "xyz")
            key = row["a"], row["b"], "turning" if turns else "straight"
            answer = ask(options.folder, row, shapes, options.steps)
            classes.setdefault(key, []).append((*answer, float(row["own_us"])))
    print(f"coal {coal.__version__}, BVHModelOBBRSS, {options.steps} instants a step; medians of a class")
    print(LINE.format("a", "b", "motion", "cases", "own_us", "a_test_us", "search_us", "later", "apart", "unseen", "off"))
    total = np.zeros(3, dtype=int)
    for (a, b, motion), all_of in classes.items():
        both = [(own, found) for own, found, *_ in all_of if own is not None and found is not None]
        later = sum(found < own - SAME for own, found in both) + sum(
            own is None and found is not None for own, found, *_ in all_of
        )
        apart = sum(distance > SAME for *_, distance, _ in all_of)
        unseen = sum(own is not None and found is None for own, found, *_ in all_of)
        total += later, apart, unseen
        median = [np.median([x[k] for x in all_of]) for k in (5, 2, 3)]
        worst = max((abs(found - own) for own, found in both), default=0.0)
        print(
            LINE.format(
                a, b, motion, len(all_of), f"{median[0]:.0f}", f"{1e6 * median[1]:.0f}", f"{1e6 * median[2]:.0f}",
                later, apart, unseen, f"{worst:.1e}",
            )
        )  # fmt: skip
    print(f"later {total[0]}, apart {total[1]}, unseen {total[2]}")
    return 1 if total[0] or total[1] else 0


if __name__ == "__main__":
    sys.exit(main())
