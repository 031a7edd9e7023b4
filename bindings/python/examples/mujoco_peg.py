"""A pin with a shoulder falls on a drilled plate: stock MuJoCo, which meets the plate's convex hull, beside contactd, which knows the hole.

mujoco_peg.py [FOLDER]: writes peg_height.png and, where MuJoCo can render off screen, peg_frames.png to FOLDER.
"""

import os
import pathlib
import sys
import time

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("MPLBACKEND", "Agg")
import mujoco
import numpy as np

import contactd.mujoco

# Millimetres. The peg's frame has its origin under the shoulder, so at rest it lies in the plate's upper face, z = 0.
PLATE, HOLE, PIN, LENGTH, SHOULDER, HEAD = (120.0, 20.0), 10.5, 10.0, 50.0, 18.0, 12.0
SOLIDS = {
    "plate": f"""difference() {{
        multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,{-PLATE[1] / 2}],[0,0,0,1]]) {{
            cube(size = [{PLATE[0]}, {PLATE[0]}, {PLATE[1]}], center = true);
        }}
        cylinder(h = {3 * PLATE[1]}, r1 = {HOLE}, r2 = {HOLE}, center = true);
    }}""",
    "peg": f"""union() {{
        multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,{-LENGTH}],[0,0,0,1]]) {{
            cylinder(h = {LENGTH + 1}, r1 = {PIN}, r2 = {PIN});
        }}
        cylinder(h = {HEAD}, r1 = {SHOULDER}, r2 = {SHOULDER});
    }}""",
}
START, DURATION, DT = 70.0, 0.5, 5e-4


def drilled_plate(n=64):
    """Vertices and triangles of the plate, in metres, for drawing and for stock MuJoCo: rings of the hole and of the rim."""
    angle = 2 * np.pi * np.arange(n) / n
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rim = way / np.abs(way).max(axis=1, keepdims=True) * PLATE[0] / 2
    rings = [np.c_[ring, np.full(n, z)] for ring, z in ((HOLE * way, 0), (rim, 0), (rim, -PLATE[1]), (HOLE * way, -PLATE[1]))]
    faces = []
    for k in range(4):
        for i in range(n):
            a, b, c, d = k * n + i, k * n + (i + 1) % n, (k + 1) % 4 * n + i, (k + 1) % 4 * n + (i + 1) % n
            faces += [(a, c, b), (b, c, d)]
    return np.concatenate(rings) / 1000, np.array(faces)


def scene():
    """The same scene for both."""
    vertices, faces = drilled_plate()
    words = lambda a: " ".join(f"{x:.9g}" for x in np.ravel(a))  # noqa: E731
    mm = 1e-3
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{DT}"/>
      <visual><headlight ambient=".4 .4 .4"/><global offwidth="960" offheight="720"/></visual>
      <default><geom solref="0.004 1" friction=".3 .005 .0001"/></default>
      <asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/>
        <mesh name="plate" vertex="{words(vertices)}" face="{words(faces)}"/></asset>
      <worldbody>
        <light pos=".2 -.3 .5" dir="-.4 .6 -1"/>
        <camera name="eye" pos=".01 -.25 .17" xyaxes="1 .04 0 -.02 .52 .85" fovy="36"/>
        <body name="plate"><geom type="mesh" mesh="plate" rgba=".55 .6 .68 .65"/></body>
        <body name="peg" pos=".0002 0 {START * mm}" euler="0.3 0.2 0"><freejoint/>
          <geom type="cylinder" size="{PIN * mm} {LENGTH / 2 * mm}" pos="0 0 {-LENGTH / 2 * mm}" rgba=".85 .45 .2 1"/>
          <geom type="cylinder" size="{SHOULDER * mm} {HEAD / 2 * mm}" pos="0 0 {HEAD / 2 * mm}" rgba=".85 .45 .2 1"/>
        </body>
      </worldbody></mujoco>""")


def run(model, step, times):
    """Heights of the peg over the time, and its positions at ``times`` for drawing."""
    data = mujoco.MjData(model)
    heights, kept = [], []
    for k in range(int(DURATION / DT)):
        if len(kept) < len(times) and k * DT >= times[len(kept)] - 1e-9:
            kept.append(data.qpos.copy())
        heights.append(1000 * data.qpos[2])
        step(data)
    kept += [data.qpos.copy()] * (len(times) - len(kept))
    return np.array(heights), kept, data


def main(folder):
    times = [0.0, 0.06, 0.09, 0.11, 0.13, DURATION]
    stock = scene()
    lines = {"stock MuJoCo": run(stock, lambda data: mujoco.mj_step(stock, data), times)}
    model = scene()
    started = time.perf_counter()
    with contactd.mujoco.Coupling(model, SOLIDS, unit=1e-3) as coupling:
        lines["with contactd"] = run(model, coupling.step, times)
        seconds, asked = time.perf_counter() - started, coupling.asked.requests
    for name, (heights, _, data) in lines.items():
        speed = np.abs(data.qvel[:3]).max()
        print(f"{name}: ends {heights[-1]:.3f} mm above its seat, {1000 * speed:.3f} mm/s")
    print(f"contactd: {len(heights)} steps in {seconds:.1f} s, {asked} of which asked anything")
    tilt = np.degrees(2 * np.arcsin(np.linalg.norm(lines["with contactd"][2].qpos[4:6])))
    # The peg stands on its shoulder, a fraction of the skin above the plate, upright; stock MuJoCo never enters the hole.
    assert abs(lines["with contactd"][0][-1]) < 0.2 and tilt < 0.02, "the peg did not come to rest on its shoulder"
    assert lines["stock MuJoCo"][0].min() > 15.0, "stock MuJoCo entered a hole that its hull does not have"
    figure(folder, lines)
    frames(folder, stock, lines, times)


def figure(folder, lines):
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    for (name, (heights, _, _)), colour in zip(lines.items(), ("#8a8f98", "#c8551b")):
        axes.plot(1000 * DT * np.arange(len(heights)), heights, label=name, color=colour, linewidth=1.8)
    axes.axhline(0, color="k", linewidth=0.6, linestyle=":")
    axes.text(495, 1.5, "on its shoulder", ha="right", fontsize=8)
    axes.axhline(LENGTH, color="k", linewidth=0.6, linestyle=":")
    axes.text(495, LENGTH + 1.5, "pin on the plate's hull", ha="right", fontsize=8)
    axes.set(xlabel="time, ms", ylabel="shoulder above the plate, mm", xlim=(0, 500))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="center right")
    fig.savefig(folder / "peg_height.png", dpi=110)
    plt.close(fig)


def frames(folder, model, lines, times):
    try:
        renderer = mujoco.Renderer(model, 260, 220)
    except Exception as e:  # no GL: MuJoCo raises whatever its back end does
        print(f"no frames: MuJoCo cannot render off screen here ({e})")
        return
    import matplotlib.pyplot as plt

    data = mujoco.MjData(model)
    fig, axes = plt.subplots(len(lines), len(times), figsize=(1.6 * len(times), 3.4), layout="constrained")
    for first, row, (name, (_, kept, _)) in zip((True, False), axes, lines.items()):
        for cell, qpos, at in zip(row, kept, times):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data, camera="eye")
            cell.imshow(renderer.render())
            cell.set(xticks=[], yticks=[])
            cell.spines[:].set_visible(False)
            if first:
                cell.set_title(f"{1000 * at:.0f} ms", fontsize=8)
        row[0].set_ylabel(name, fontsize=8)
    renderer.close()
    fig.savefig(folder / "peg_frames.png", dpi=130)
    plt.close(fig)


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    target.mkdir(parents=True, exist_ok=True)
    main(target)
