"""A whole model of MuJoCo with contactd's contacts: random models, judged by MuJoCo's own contacts.

Long form: CONTACTD_MUJOCO_MODELS=1000 python -m pytest tests/test_mujoco_attach.py
"""

import copy
import gc
import os
import warnings

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

import contactd  # noqa: E402
from contactd.mujoco import CouplingWarning, attach  # noqa: E402
from contactd.mujoco_geoms import _hull_faces, solid_of  # noqa: E402

MODELS = int(os.environ.get("CONTACTD_MUJOCO_MODELS", 40))
STATES = 5
SKIN = 1e-4


def words(**attributes):
    return " ".join(f'{k}="{v}"' for k, v in attributes.items())


def numbers(values):
    return " ".join(f"{x:.6g}" for x in values)


class Maker:
    """A random model: a tree of bodies around the origin, so that many of them meet."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.names = []

    def chance(self, p):
        return self.rng.random() < p

    def geom(self, name, kinds):
        rng = self.rng
        kind = rng.choice(kinds)
        size = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3, "plane": 3}[kind]
        more = {}
        if self.chance(0.3):
            more |= {"contype": rng.integers(0, 4), "conaffinity": rng.integers(0, 4)}
        if self.chance(0.3):
            more |= {"friction": numbers(rng.uniform(0, 1, 3)), "condim": rng.choice([1, 3, 4, 6])}
        if self.chance(0.3):
            more |= {"solref": numbers(rng.uniform(0.01, 1, 2)), "solmix": round(rng.uniform(0, 2), 3)}
        if self.chance(0.2):
            more |= {"solref": numbers(-rng.uniform(1, 100, 2))}
        if self.chance(0.2):
            more |= {"solimp": numbers([*np.sort(rng.uniform(0.1, 0.95, 2)), 0.01, 0.4, 2]), "priority": rng.integers(0, 3)}
        at = {"pos": numbers(rng.uniform(-0.1, 0.1, 3)), "euler": numbers(rng.uniform(-90, 90, 3))}
        if kind == "plane":
            at = {"pos": numbers([0, 0, rng.uniform(-0.3, -0.1)]), "euler": numbers([*rng.uniform(-10, 10, 2), 0])}
        self.names.append(name)
        return f'<geom name="{name}" type="{kind}" size="{numbers(rng.uniform(0.05, 0.15, size))}" {words(**at, **more)}/>'

    def body(self, depth):
        rng, name = self.rng, f"b{len(self.bodies)}"
        self.bodies.append(name)
        joint = "<freejoint/>" if depth == 0 else rng.choice(["", '<joint type="ball"/>', '<joint axis="0 1 0"/>'])
        kinds = ["sphere", "capsule", "cylinder", "box", "ellipsoid"]
        geoms = "".join(self.geom(f"{name}g{i}", kinds) for i in range(rng.integers(1, 4)))
        inner = "".join(self.body(depth + 1) for _ in range(rng.integers(0, 3))) if depth < 2 else ""
        return f'<body name="{name}" pos="{numbers(rng.uniform(-0.2, 0.2, 3))}">{joint}{geoms}{inner}</body>'

    def text(self):
        rng, self.bodies = self.rng, []
        floor = "".join(self.geom(f"w{i}", ["plane", "box", "cylinder"]) for i in range(rng.integers(0, 3)))
        trees = "".join(self.body(0) for _ in range(rng.integers(2, 4)))
        inside = ""
        if self.chance(0.5):
            a, b = rng.choice(self.bodies, 2, replace=False)
            inside += f'<exclude body1="{a}" body2="{b}"/>'
        if self.chance(0.5):
            a, b = rng.choice([n for n in self.names if n[0] == "b"], 2, replace=False)
            more = words(condim=rng.choice([1, 3, 4, 6]), friction=numbers(rng.uniform(0.1, 1, 5)), solref=numbers(rng.uniform(0.01, 1, 2)))
            inside += f'<pair geom1="{a}" geom2="{b}" {more}/>'
        flag = '<flag filterparent="disable"/>' if self.chance(0.2) else ""
        return f'<mujoco><option>{flag}</option><worldbody>{floor}{trees}</worldbody><contact>{inside}</contact></mujoco>'


def contacts(model, data):
    """Contacts by their geoms: the least distance, and the parameters, which are the same for all of a pair."""
    found = {}
    for c in data.contact:
        pair = (int(c.geom[0]), int(c.geom[1]))
        fields = (c.dim, *c.friction, *c.solref, *c.solreffriction, *c.solimp)
        dist, _ = found.get(pair, (np.inf, None))
        found[pair] = (min(dist, float(c.dist)), np.array(fields))
    return found


def shuffled(model, data, rng):
    """Bodies anywhere near the origin, in a heap or with room."""
    mujoco.mj_resetData(model, data)
    room = rng.choice([0.25, 0.5, 1.0])
    for j in range(model.njnt):
        at = model.jnt_qposadr[j]
        kind = model.jnt_type[j]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[at : at + 3] = rng.uniform(-room, room, 3)
            at += 3
        if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
            q = rng.normal(size=4)
            data.qpos[at : at + 4] = q / np.linalg.norm(q)
        elif kind == mujoco.mjtJoint.mjJNT_HINGE:
            data.qpos[at] = rng.uniform(-np.pi, np.pi)


def judged(seed, keep_exact):
    """Compares all contacts of some states of a random model; tells how many pairs were told by both."""
    text = Maker(seed).text()
    stock, model = (mujoco.MjModel.from_xml_string(text) for _ in range(2))
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    common = 0
    kind = lambda g: mujoco.mjtGeom(stock.geom_type[g]).name.removeprefix("mjGEOM_").lower()  # noqa: E731
    with attach(model, skin=SKIN, keep_exact=keep_exact) as coupling:
        for state in range(STATES):
            shuffled(stock, theirs, rng)
            data.qpos[:] = theirs.qpos
            mujoco.mj_forward(stock, theirs)
            mujoco.mj_step1(model, data)
            kept = {frozenset(kind(g) for g in contact.geom) for contact in data.contact}
            assert kept <= EXACT if keep_exact else not kept, f"MuJoCo's own contacts: {kept}"
            before = data.ncon
            coupling.add_contacts(data)
            added = {frozenset(kind(g) for g in contact.geom) for contact in list(data.contact)[before:]}
            assert not keep_exact or not added & EXACT
            own, stocks = contacts(model, data), contacts(stock, theirs)
            for pair in own.keys() | stocks.keys():
                what = f"model {seed}, state {state}, {[kind(g) for g in pair]} {pair}"
                told, asked = own.get(pair), stocks.get(pair)
                # Near the border MuJoCo's iterations and the skin may differ.
                if asked is None:
                    assert pair[::-1] not in stocks, f"{what}: told the other way round"
                    assert told[0] > -1e-5, f"{what}: at {told[0]} here alone"
                elif told is None:
                    assert asked[0] > -1e-5, f"{what}: at {asked[0]} by MuJoCo alone"
                else:
                    common += 1
                    assert np.allclose(told[1], asked[1], atol=1e-12), f"{what}: {told[1]} and {asked[1]}"
    return common


#: What MuJoCo has in closed form.
EXACT = {frozenset(pair.split()) for pair in [
    "plane sphere", "plane capsule", "plane ellipsoid", "plane cylinder", "plane box", "plane mesh", "sphere", "sphere capsule", "sphere box", "capsule", "box",
]}  # fmt: skip


@pytest.mark.parametrize("keep_exact", [True, False])
def test_random_models_have_the_contacts_that_mujoco_gives_them(keep_exact):
    common = sum(judged(seed, keep_exact) for seed in range(MODELS))
    print(f"{MODELS} models, {STATES} states each: {common} pairs told by both")
    assert common > 5 * MODELS


def uneven(corners, rise):
    """A disc of a mesh whose bottom's corners lie within ``rise`` above a plane, none of four in one: as a scan or a rounding leaves it."""
    rng = np.random.default_rng(4)
    turn = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    rings = [np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1) for r in (0.1, 0.2, 0.3)]
    bottom = np.concatenate(rings)
    # Bent a little outwards, so that all of them are on the hull.
    below = rise * (1.0 + (bottom**2).sum(axis=1)) + rise * 1e-3 * rng.uniform(size=len(bottom))
    points = np.concatenate([np.column_stack([bottom, below]), np.column_stack([rings[-1], np.full(corners, 0.2)])])
    return " ".join(f"{x:.12g}" for x in points.ravel())


def test_a_mesh_on_a_plane_has_mujocos_own_contacts():
    """The lowest corner of each hull is where the mesh's corners say, whatever the coupling does, and so are margin and gap."""
    text = (
        f'<mujoco><asset><mesh name="disc" vertex="{uneven(64, 1e-6)}"/><mesh name="rock" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1 .1 .1 .1"/>'
        '</asset><worldbody><geom name="floor" type="plane" size="1 1 1" margin=".001"/><body pos="0 0 .05"><freejoint/>'
        '<geom name="disc" type="mesh" mesh="disc"/></body><body pos="2 0 .1"><freejoint/><geom name="rock" type="mesh" '
        'mesh="rock"/></body></worldbody></mujoco>'
    )
    stock, model = (mujoco.MjModel.from_xml_string(text) for _ in range(2))
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    disc = stock.geom("disc").id
    mujoco.mj_forward(stock, theirs)
    first = stock.mesh_vertadr[0]
    corners = stock.mesh_vert[first : first + stock.mesh_vertnum[0]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        coupling = attach(model)
    with coupling:
        for gap in (-1e-4, 8e-7, 5e-5, 9e-4, 3e-3):
            lowest = (theirs.geom_xmat[disc].reshape(3, 3) @ corners.T)[2].min() + theirs.geom_xpos[disc][2]
            theirs.qpos[2] += gap - lowest
            data.qpos[2] = theirs.qpos[2]
            mujoco.mj_step1(stock, theirs)
            mujoco.mj_step1(model, data)
            coupling.add_contacts(data)
            told = contacts(model, data)
            assert told.keys() == contacts(stock, theirs).keys()
            ours = [float(c.dist) for c in data.contact if disc in c.geom]
            assert (min(ours) == pytest.approx(gap, abs=1e-9)) if gap < 1e-3 else not ours
            assert sorted(c.dist for c in data.contact) == sorted(c.dist for c in theirs.contact)
        assert not coupling.contacts
    # A mesh that stands for itself may meet the plane elsewhere than its hull does: contactd has all of it.
    rock = stock.geom("rock").id
    corners = stock.mesh_vert[stock.mesh_vertadr[1] :][: stock.mesh_vertnum[1]]
    lowest = (theirs.geom_xmat[rock].reshape(3, 3) @ corners.T)[2].min() + theirs.geom_xpos[rock][2]
    with pytest.warns(CouplingWarning, match="the margin of geom 'floor'"), attach(model, meshes="exact") as coupling:
        data.qpos[9] += 5e-5 - lowest
        mujoco.mj_step1(model, data)
        assert data.ncon == 0 and coupling.add_contacts(data) > 0
        assert min(c.dist for c in data.contact) == pytest.approx(5e-5, abs=1e-9)


@pytest.mark.parametrize("option", ['integrator="RK4"', 'integrator="implicitfast"><flag sleep="enable"/></option><option '])
def test_a_model_whose_contacts_all_stay_mujocos_may_step_as_it_likes(option):
    """Its steps are mj_step's, to the bit; with one contact of contactd's the same options are refused."""
    inner = (
        '<geom type="plane" size="1 1 1"/><body pos="0 0 .3"><freejoint/><geom size=".1"/><body pos=".3 0 0"><joint axis="0 1 0"/>'
        '<geom type="box" size=".1 .1 .1"/></body></body>{}'
    )
    make = lambda more="": mujoco.MjModel.from_xml_string(  # noqa: E731
        f"<mujoco><option {option}/><worldbody>{inner.format(more)}</worldbody></mujoco>"
    )
    stock, model = make(), make()
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    with attach(model) as coupling:
        met = 0
        for _ in range(300):
            mujoco.mj_step(stock, theirs)
            assert coupling.step(data) == 0 and data.ncon == theirs.ncon
            met += data.ncon
        assert met > 0 and coupling.asked.requests == 0
        assert data.qpos.tolist() == theirs.qpos.tolist() and data.qvel.tolist() == theirs.qvel.tolist()
    with pytest.raises(ValueError, match="Runge-Kutta|bodies that sleep"):
        attach(make(2 * '<body pos="1 0 1"><freejoint/><geom type="cylinder" size=".1 .1"/></body>'))


def test_a_model_that_begins_asleep_is_taken():
    """MuJoCo looks for contacts when it makes such a model's data, the box's on the plane."""
    text = (
        '<mujoco><option><flag sleep="enable"/></option><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .0999" sleep="init">'
        '<freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody></mujoco>'
    )
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError:
        pytest.skip("this MuJoCo knows no bodies that begin asleep")
    data = mujoco.MjData(model)
    assert data.ncon > 0
    with attach(model) as coupling:
        coupling.step(data)
    assert data.qpos[2] == 0.0999


def cloths_among_geoms(seed):
    """How many contacts of flexes a random model has, which are those of stock MuJoCo; the bits are given back."""
    rng = np.random.default_rng(seed)
    bits = lambda: f'contype="{rng.integers(8)}" conaffinity="{rng.integers(8)}"'  # noqa: E731
    kinds = ['type="plane" size="1 1 1"', 'type="box" size=".1 .1 .1"', 'size=".1"', 'type="capsule" size=".05 .1"', 'type="cylinder" size=".1 .05"']
    geoms = "".join(
        f'<body pos="{.1 * (i % 3)} {.1 * (i // 3)} 0"><freejoint/><geom {kinds[k]} {bits()}/></body>' for i, k in enumerate([1, 2, 3, 4, 1, 2])
    )
    cloths = "".join(
        f'<flexcomp name="c{i}" type="grid" count="4 4 1" spacing=".08 .08 .1" mass=".1" radius=".02" dim="2" pos=".1 .05 {.05 * i}">'
        f'<contact selfcollide="none" {bits()}/></flexcomp>'
        for i in range(2)
    )
    make = lambda: scene(f"<geom {kinds[0]} {bits()}/>" + geoms + cloths)  # noqa: E731
    state = rng.bit_generator.state
    stock = make()
    rng.bit_generator.state = state
    model = make()
    before = [a.copy() for a in (model.geom_contype, model.flex_contype, model.flex_conaffinity, model.body_contype)]
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    of_flexes = lambda d: sorted((*c.geom, *c.flex, *c.elem, *c.vert, float(c.dist)) for c in d.contact if max(c.flex) >= 0)  # noqa: E731
    met = 0
    with attach(model) as coupling:
        for _ in range(20):
            mujoco.mj_step(stock, theirs)
            data.qpos[:], data.qvel[:] = theirs.qpos, theirs.qvel
            mujoco.mj_forward(stock, theirs)
            mujoco.mj_step1(model, data)
            coupling.add_contacts(data)
            told = of_flexes(data)
            assert told == of_flexes(theirs)
            met += len(told)
    assert all(np.array_equal(a, b) for a, b in zip(before, (model.geom_contype, model.flex_contype, model.flex_conaffinity, model.body_contype)))
    return met


def test_contacts_of_flexes_stay_mujocos_own():
    """Whatever bits geoms and flexes have."""
    assert sum(cloths_among_geoms(seed) for seed in range(6)) > 100


def test_small_bodies_without_play_are_not_thrown_apart_by_the_skin():
    """26 cubes of 6 mm around a core, as in MuJoCo's own model of Rubik's cube: its own contacts let them lie still, and those of
    contactd press each from its neighbours by the skin, which is to be little beside them."""
    n = 0.003
    places = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)]
    cubes = "".join(
        '<body><joint type="ball" damping="5e-4" armature="1e-4" frictionloss="1e-3"/>'
        f'<geom type="box" size="{n} {n} {n}" pos="{2 * n * x} {2 * n * y} {2 * n * z}" mass=".0025" condim="1"/></body>'
        for x, y, z in places
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep=".01" integrator="implicitfast"/><worldbody><body><freejoint/><geom size="{n}" contype="0" conaffinity="0"/>'
        f"{cubes}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        assert coupling.skin == pytest.approx(4e-3 * model.stat.meansize)
        fastest = 0.0
        for _ in range(12):
            coupling.step(data)
            fastest = max(fastest, np.abs(data.qvel[6:]).max())
    assert fastest < 0.1, f"{fastest} rad/s"
    # What is large has the skin that it had.
    with attach(scene('<body><freejoint/><geom size="1"/></body>')) as coupling:
        assert coupling.skin == 2e-4


@pytest.mark.parametrize("kinds", [("sphere", "sphere"), ("sphere", "capsule"), ("capsule", "capsule"), ("plane", "sphere"), ("plane", "capsule")])
def test_distances_are_mujocos_where_it_has_closed_forms(kinds):
    first, second = (f'type="{kind}" size="{"1 1 1" if kind == "plane" else ".08 .1"}"' for kind in kinds)
    inner = f'<geom {first}/><body><freejoint/><geom {second}/></body>'
    stock, model = scene(inner), scene(inner)
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    rng = np.random.default_rng(11)
    worst, met = 0.0, 0
    with attach(model, keep_exact=False, skin=SKIN) as coupling:
        for _ in range(100 * MODELS // 40):
            shuffled(stock, theirs, rng)
            theirs.qpos[:3] *= 0.3 / np.linalg.norm(theirs.qpos[:3]) * rng.uniform(0.2, 1.0)
            data.qpos[:] = theirs.qpos
            mujoco.mj_forward(stock, theirs)
            mujoco.mj_step1(model, data)
            coupling.add_contacts(data)
            own, stocks = (min((c.dist for c in d.contact), default=1.0) for d in (data, theirs))
            # Of what lies deeper than its radius the depth is that of the largest ball that both hold. Where two capsules cross, the
            # direction of the depth is found to some hundredths alone, so the distance along it to their square.
            if -0.05 < stocks < 0:
                assert own == pytest.approx(stocks, abs=1e-6 if "capsule" not in kinds[:1] else 1e-2 * abs(stocks))
                worst, met = max(worst, abs(own - stocks)), met + 1
    print(f"{kinds[0]} and {kinds[1]}: {met} in overlap, {worst:.2g} at most apart from MuJoCo's")
    assert met > 3


def scene(inner, *, option="", assets="", after=""):
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.001">{option}</option><asset>{assets}</asset><worldbody>{inner}</worldbody>{after}</mujoco>'
    )


FLOOR = '<geom name="floor" type="plane" size="1 1 .1"/>'
BALL = '<body name="ball" pos="{} {} {}"><freejoint/><geom name="ball" size=".05"/></body>'


def after(model, steps, **options):
    """The state after some steps, and the contacts of the last by name."""
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False, **options) as coupling:
        for _ in range(steps):
            coupling.step(data)
        return data, coupling.contact_geoms


def test_contacts_are_told_by_the_names_of_their_geoms():
    model = scene(FLOOR + BALL.format(0, 0, 0.051) + '<body pos="1 0 .051"><freejoint/><geom size=".05"/></body>')
    data, names = after(model, 100)
    assert sorted(names) == [("floor", "ball"), ("floor", "geom 2")] and data.qpos[2] == pytest.approx(0.05, abs=2e-4)


def test_a_body_with_a_solid_of_its_own_meets_the_geoms_of_others(tmp_path):
    plate = "difference() { cube(size = [200, 200, 20], center = true); cylinder(h = 60, r1 = 60, r2 = 60, center = true); }"
    (tmp_path / "plate.csg").write_text(plate)
    inner = '<body name="plate"><geom name="slab" type="box" size=".1 .1 .01"/></body>' + BALL.format(0, 0, 0.2)
    # The box is whole: the ball rests on it. The plate has a hole: the ball falls through, be it a text, a file or built.
    assert after(scene(inner), 400)[0].qpos[2] > 0.059
    for given in (tmp_path / "plate.csg", str(tmp_path / "plate.csg"), plate):
        assert after(scene(inner), 400, replace={"plate": given}, unit=1e-3)[0].qpos[2] < -0.1
    # Beside the hole it rests on the plate, which is told by the geom that it stands in for.
    beside = inner.replace('pos="0 0 0.2"', 'pos="0.08 0 0.08"')
    data, names = after(scene(beside), 400, replace={"plate": plate}, unit=1e-3)
    assert names == [("ball", "slab")] and data.qpos[2] == pytest.approx(0.06, abs=2e-4)
    solid = contactd.solid.box(0.2, 0.2, 0.02) - contactd.solid.cylinder(0.06, 0.06)
    assert after(scene(inner), 400, replace={"plate": solid})[0].qpos[2] < -0.1


def corner(size):
    """Corners and triangles of an L of two boxes: concave."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]) * size
    n = len(outline)
    points = [(*p, z) for z in (0.0, size) for p in outline]
    faces = [(i, (i + 1) % n, n + (i + 1) % n) for i in range(n)] + [(i, n + (i + 1) % n, n + i) for i in range(n)]
    caps = [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)]
    faces += [tuple(n + k for k in f) for f in caps] + [f[::-1] for f in caps]
    return numbers(np.ravel(points)), " ".join(str(i) for f in faces for i in f)


def test_a_mesh_is_its_hull_or_itself():
    vertices, faces = corner(0.1)
    mesh = f'<mesh name="corner" vertex="{vertices}" face="{faces}" inertia="exact"/>'
    # In the inner corner, a little above the floor: within the hull, beside the mesh.
    inner = '<geom name="corner" type="mesh" mesh="corner" pos="0 0 0"/>' + BALL.format(0.16, 0.16, 0.05).replace(".05\"/>", ".02\"/>")
    make = lambda: scene(inner, assets=mesh, option='<flag gravity="disable"/>')  # noqa: E731
    for meshes, meets in (("hull", True), ("exact", False)):
        model = make()
        data = mujoco.MjData(model)
        # The mesh's frame is about its centre of mass; MuJoCo has moved the geom there.
        with attach(model, meshes=meshes) as coupling:
            mujoco.mj_step1(model, data)
            assert (coupling.add_contacts(data) > 0) == meets, meshes
    own = mujoco.MjData(stock := make())
    mujoco.mj_forward(stock, own)
    assert own.ncon > 0, "stock MuJoCo meets the hull"
    with pytest.raises(ValueError, match="expected one of 'hull', 'exact' for meshes, found 'convex'"):
        attach(make(), meshes="convex")


@pytest.mark.parametrize("most", [None, 12])
def test_the_hull_of_a_mesh_is_mujocos(most):
    """``maxhullvert`` cuts corners off a hull: what MuJoCo does not collide, contactd does not."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(200, 3))
    points /= 10 * np.linalg.norm(points, axis=1)[:, None]
    limit = "" if most is None else f' maxhullvert="{most}"'
    mesh = f'<mesh name="round" vertex="{numbers(points.ravel())}"{limit}/>'
    geoms = '<geom name="round" type="mesh" mesh="round" pos="0 0 0"/>'
    model = scene(geoms, assets=mesh)
    corners = model.mesh_vert[np.unique(_hull_faces(model, 0))].astype(float)
    assert len(corners) == (len(points) if most is None else most)
    with contactd.embedded() as session:
        hull = session.add_object("hull", session.load_model("hull", solid_of(model, 0, 1.0, "hull")))
        session.begin_step(1)[0] = contactd.end(hull, (0, 0, 0))
        session.finish()
        middle = corners.mean(axis=0)
        beyond = session.points(middle + (corners - middle) * (1 + 1e-6))
        within = session.points(middle + (corners - middle) * (1 - 1e-6))
        left_out = session.points(model.mesh_vert.astype(float) * (1 + 1e-6))
    side = [contactd.SIDE_NAMES[k] for k in np.concatenate([beyond, within, left_out])["side"]]
    assert set(side[: len(corners)]) == {"outside"}, "its corners are the hull's"
    assert set(side[len(corners) : 2 * len(corners)]) == {"inside"}
    assert set(side[2 * len(corners) :]) == {"outside"}, "no corner of the mesh is deeper than the hull"


def test_a_ball_on_a_height_field_stands_where_mujocos_own_does():
    rng = np.random.default_rng(3)
    heights = rng.uniform(0, 1, (6, 5))
    field = f'<hfield name="hills" nrow="6" ncol="5" size=".5 .6 .1 .05" elevation="{numbers(heights.ravel())}"/>'
    inner = '<geom name="hills" type="hfield" hfield="hills"/>' + BALL.format(0, 0, 0)
    stock, model = (scene(inner, assets=field) for _ in range(2))
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    met = 0
    with attach(model, skin=SKIN) as coupling:
        for _ in range(60):
            data.qpos[:3] = theirs.qpos[:3] = (*rng.uniform(-0.4, 0.4, 2), rng.uniform(0.05, 0.2))
            mujoco.mj_forward(stock, theirs)
            mujoco.mj_step1(model, data)
            coupling.add_contacts(data)
            depth = lambda d: min((c.dist for c in d.contact), default=1.0)  # noqa: E731
            met += depth(theirs) < 0
            if abs(depth(theirs)) > 2e-3:
                assert (depth(theirs) < 0) == (depth(data) < SKIN)
    assert met > 10


def test_what_has_no_solid_is_refused_by_name():
    model = scene(FLOOR + BALL.format(0, 0, 1))
    model.geom_type[1] = mujoco.mjtGeom.mjGEOM_SDF
    with pytest.raises(ValueError, match="geom 'ball': its kind, sdf, has no solid here: give its body a solid by replace="):
        attach(model)
    with attach(model, {"ball": "sphere(r = 0.05);"}):
        pass


def test_a_pair_is_met_by_its_own_parameters_and_given_back():
    pair = '<contact><pair name="grip" geom1="floor" geom2="ball" condim="4" friction=".5 .4 .3 .2 .1"/></contact>'
    model = scene(FLOOR + BALL.format(0, 0, 0.0501), after=pair)
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        mujoco.mj_step1(model, data)
        assert data.ncon == 0 and coupling.add_contacts(data) == 1
        contact = data.contact[0]
        assert contact.dim == 4 and contact.friction.tolist() == [0.5, 0.4, 0.3, 0.2, 0.1] and contact.includemargin == 2e-4
        assert contact.dist == pytest.approx(0.0001, abs=1e-9) and list(contact.geom) == [0, 1]
    assert model.pair_margin[0] == 0 and model.geom_contype.tolist() == [1, 1]


def test_an_adhesion_actuator_pulls_along_contacts_of_solids():
    ceiling = '<geom type="box" size=".2 .2 .01" pos="0 0 .5"/>'
    actuator = '<actuator><adhesion body="ball" ctrlrange="0 1" gain="50"/></actuator>'
    stock, model = (scene(ceiling + BALL.format(0, 0, 0.4401), after=actuator) for _ in range(2))
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    theirs.ctrl[:] = data.ctrl[:] = 1
    with attach(model, keep_exact=False) as coupling:
        for _ in range(250):
            mujoco.mj_step(stock, theirs)
            coupling.step(data)
        # It hangs, by the skin nearer to where it touches.
        assert theirs.qpos[2] - 3e-4 < data.qpos[2] < theirs.qpos[2]
        data.ctrl[:] = 0
        for _ in range(100):
            coupling.step(data)
        assert data.qpos[2] < 0.43


TWENTY = FLOOR + "".join(
    f'<body pos="{0.3 * (i % 5)} {0.3 * (i // 5)} .05"><freejoint/><geom type="{kind}" size=".05 .05 .05"/></body>'
    for i, kind in enumerate(["box", "cylinder"] * 10)
)


def test_a_settled_scene_stays_as_still_as_mujocos_own():
    stock, model = scene(TWENTY), scene(TWENTY)
    theirs = mujoco.MjData(stock)
    data = mujoco.MjData(model)
    with attach(model) as coupling:
        for _ in range(1500):
            mujoco.mj_step(stock, theirs)
            coupling.step(data)
    own, stocks = (np.abs(d.qvel).max() for d in (data, theirs))
    print(f"fastest of 20 bodies after 1500 steps: {own} here, {stocks} in stock MuJoCo")
    assert own < max(2 * stocks, 1e-9)


def test_what_rests_is_not_asked_about():
    model = scene(TWENTY)
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        for _ in range(1000):
            coupling.step(data)
        settled = coupling.asked
        for _ in range(200):
            assert coupling.step(data) == data.ncon == 80
        assert coupling.asked == settled, "20 bodies at rest take no request"
        # One goes, and is the one that is told; the others' contacts stay.
        first = {(a, b, p.id): p for a, b, p in coupling.contacts}
        data.qpos[0] += 1e-5
        assert coupling.step(data) == 80
        requests, bodies = (now - before for now, before in zip(coupling.asked, settled))
        assert (requests, bodies) == (1, 1)
        for a, b, p in coupling.contacts:
            way = [1e-5, 0, 0] if b == 1 else np.zeros(3)
            assert np.allclose(p.position, first[a, b, p.id].position + way, atol=1e-8)


def test_contacts_that_are_carried_along_are_those_that_a_request_would_tell():
    compared = carries = 0
    for seed in range(MODELS):
        model = mujoco.MjModel.from_xml_string(Maker(seed).text())
        data = mujoco.MjData(model)
        rng = np.random.default_rng(seed)
        with attach(model, skin=SKIN) as coupling:
            for _ in range(STATES):
                shuffled(model, data, rng)
                mujoco.mj_step1(model, data)
                coupling.add_contacts(data)
                # A creep: none of its points goes by the slack, a hundredth of the skin. Bodies reach less than a metre.
                data.qvel[:] = rng.uniform(-1, 1, model.nv)
                mujoco.mj_integratePos(model, data.qpos, data.qvel, 1e-7)
                mujoco.mj_step1(model, data)
                asked = coupling.asked
                coupling.add_contacts(data)
                # What touches by one point or two is asked about all the same.
                carries += coupling.asked == asked
                carried = contacts(model, data)
                asked = coupling.asked
                coupling.refresh()
                mujoco.mj_step1(model, data)
                coupling.add_contacts(data)
                # Where all contacts stay MuJoCo's nothing is asked, ever.
                assert coupling.asked.requests > asked.requests or not coupling.asked.requests
                anew = contacts(model, data)
                for pair in carried.keys() | anew.keys():
                    (dist, fields), (other, others) = (found.get(pair, (SKIN, None)) for found in (carried, anew))
                    if min(dist, other) < -0.01:
                        # Deep in each other: one of several ways out, and which one may hang on a bit.
                        continue
                    # The depth of an overlap is found to a part of it.
                    assert dist == pytest.approx(other, abs=1e-7 + 2e-3 * abs(min(other, 0))), f"model {seed}: {pair}"
                    assert fields is None or others is None or np.array_equal(fields, others)
                    compared += fields is not None and others is not None
    assert compared > 2 * MODELS and carries > 0


def test_parameters_are_those_of_the_model_as_it_is():
    model = scene(FLOOR + BALL.format(0, 0, 0.0501))
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        for friction in (0.3, 0.7):
            model.geom_friction[:, 0] = friction
            mujoco.mj_step1(model, data)
            assert coupling.add_contacts(data) == 1 and data.contact[0].friction[0] == friction
        assert coupling.asked.requests == 1


def test_what_others_have_moved_in_the_session_is_told_anew():
    model = scene(FLOOR + BALL.format(0, 0, 0.0501))
    data = mujoco.MjData(model)
    with contactd.embedded() as session, attach(model, keep_exact=False, session=session) as coupling:
        mujoco.mj_step1(model, data)
        assert coupling.add_contacts(data) == 1
        # The plane is the session's first object, the ball its second one.
        session.begin_step(1)[0] = contactd.start(2, (0, 0, 5.0))
        session.finish()
        mujoco.mj_step1(model, data)
        assert coupling.add_contacts(data) == 1 and coupling.asked.requests == 2


def test_the_slack_may_be_none_and_is_checked():
    model = scene(FLOOR + BALL.format(0, 0, 0.0501))
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False, slack=0.0) as coupling:
        for k in range(3):
            data.qpos[0] = k * 1e-12
            mujoco.mj_step1(model, data)
            coupling.add_contacts(data)
        assert coupling.asked.requests == 3
    for slack in (-1e-3, 1.0, np.nan):
        with pytest.raises(ValueError, match="expected a part of the skin as slack"):
            attach(scene(FLOOR), slack=slack)


def test_an_arena_without_room_is_told():
    text = f'<mujoco><size memory="20K"/><worldbody>{TWENTY}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        mujoco.mj_kinematics(model, data)
        with pytest.raises(MemoryError, match="enlarge <size memory>"):
            coupling.add_contacts(data)


def test_data_of_another_model_is_refused():
    model = scene(FLOOR + BALL.format(0, 0, 0.0501))
    other = mujoco.MjData(scene(FLOOR))
    with attach(model, keep_exact=False) as coupling, pytest.raises(ValueError, match="the data of the coupling's own model"):
        coupling.add_contacts(other)


def test_a_model_without_anything_to_warn_of_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error", CouplingWarning)
        attach(scene(FLOOR + BALL.format(0, 0, 1))).close()
    wide = FLOOR + BALL.format(0, 0, 0.055).replace('size=".05"', 'size=".05" margin=".01"')
    with pytest.warns(CouplingWarning, match="the margin of geom 'ball' has no effect"):
        attach(scene(wide), keep_exact=False).close()


def test_what_mujoco_has_in_closed_form_stays_its_own_with_its_margin():
    model = scene(FLOOR + BALL.format(0, 0, 0.055).replace('size=".05"', 'size=".05" margin=".01" gap=".002"'))
    stock = scene(FLOOR + BALL.format(0, 0, 0.055).replace('size=".05"', 'size=".05" margin=".01" gap=".002"'))
    data, theirs = mujoco.MjData(model), mujoco.MjData(stock)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CouplingWarning)
        with attach(model) as coupling:
            for _ in range(300):
                mujoco.mj_step(stock, theirs)
                coupling.step(data)
            assert data.ncon == 1 and np.array_equal(data.qpos, theirs.qpos) and coupling.asked.requests == 0
            assert data.contact[0].includemargin == theirs.contact[0].includemargin
    assert model.geom_contype.tolist() == [1, 1] and model.geom_conaffinity.tolist() == [1, 1]


@pytest.mark.parametrize("keep_exact", [True, False])
@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_a_stack_stays_as_still_as_stock(kind, keep_exact):
    body = '<body pos="0 0 {}"><freejoint/><geom type="{}" size=".05 .05 .05"/></body>'
    inner = FLOOR + "".join(body.format(round(0.05 + 0.1 * i, 2), kind) for i in range(5))
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    with attach(model, keep_exact=keep_exact) as coupling:
        for _ in range(1500):
            coupling.step(data)
    assert abs(data.qvel).max() < 1e-9 and np.abs(data.qpos[2::7] - model.qpos0[2::7]).max() < 3e-3


@pytest.mark.parametrize("words", ['size=".05"', 'type="capsule" size=".05 .05" euler="90 0 0"', 'type="cylinder" size=".05 .05" euler="90 0 0"'])
def test_what_is_round_lies_as_still_as_stock_on_a_solid(words):
    body = f'<body pos="0 0 .05"><freejoint/><geom {words}/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    with attach(model, keep_exact=False) as coupling:
        for _ in range(1000):
            coupling.step(data)
        settled = data.qpos.copy()
        for _ in range(1000):
            coupling.step(data)
    assert abs(data.qvel).max() < 1e-8 and np.abs(data.qpos - settled).max() < 1e-8


def test_where_nothing_may_meet_nothing_does():
    ball = BALL.replace("<geom", '<geom contype="0" conaffinity="1"')
    model = scene(FLOOR.replace("<geom", '<geom contype="0" conaffinity="1"') + ball.format(0, 0, 0.04))
    fixed = '<body mocap="true" pos="{} 0 .04"><geom size=".05"/></body>'
    mocap = scene(FLOOR + fixed.format(0) + fixed.format(0.05) + BALL.format(1, 0, 1))
    for model in (model, mocap):
        data = mujoco.MjData(model)
        with attach(model, keep_exact=False) as coupling:
            mujoco.mj_step1(model, data)
            assert coupling.add_contacts(data) == 0 and data.ncon == 0


def test_edges_and_corners_are_as_deep_as_mujoco_says():
    for euler, points in (("0 0 0", 4), ("45 0 0", 2), ("30 20 0", 1)):
        inner = FLOOR + f'<body pos="0 0 .07"><freejoint/><geom type="box" size=".05 .05 .05" euler="{euler}"/></body>'
        stock, model = scene(inner), scene(inner)
        theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
        with attach(model, keep_exact=False) as coupling:
            for z in np.linspace(0.03, 0.06, 7):
                theirs.qpos[2] = data.qpos[2] = z
                mujoco.mj_forward(stock, theirs)
                mujoco.mj_step1(model, data)
                coupling.add_contacts(data)
                own, stocks = (min((c.dist for c in d.contact), default=1.0) for d in (data, theirs))
                assert own == pytest.approx(stocks, abs=1e-8) or min(own, stocks) > 0, (euler, z)
                assert data.ncon == points or own > -1e-3, (euler, z, data.ncon)


def test_a_model_has_one_open_coupling_at_a_time():
    text = FLOOR + '<body name="b" pos="0 0 .06"><freejoint/><geom type="cylinder" size=".05 .05"/></body>'
    model = scene(text)
    other = copy.copy(model)
    bits = model.geom_contype.copy(), model.geom_conaffinity.copy()
    refused = pytest.raises(ValueError, match=r"an open coupling already.*close that one first.*or attach to a copy of the model")

    def rests(model, coupling):
        data = mujoco.MjData(model)
        for _ in range(200):
            coupling.step(data)
        assert 0.049 < data.qpos[2] < 0.051, data.qpos[2]

    first = attach(model, keep_exact=False)
    with refused:
        attach(model, keep_exact=False)
    # A copy that was made before has a coupling of its own, and the first one is as it was.
    with attach(other, keep_exact=False) as second:
        rests(other, second)
    rests(model, first)
    first.close()
    first.close()
    assert np.array_equal(model.geom_contype, bits[0]) and np.array_equal(model.geom_conaffinity, bits[1])
    second = attach(model, keep_exact=False)
    first.close()
    with refused:
        attach(model, keep_exact=False)
    rests(model, second)
    # One that is forgotten is closed.
    del second
    gc.collect()
    assert np.array_equal(model.geom_contype, bits[0]) and np.array_equal(model.geom_conaffinity, bits[1])
    with attach(model, keep_exact=False) as third:
        rests(model, third)
