"""MuJoCo with contactd's contacts, held against MuJoCo's own where both are right."""


import numpy as np
import pytest
from conftest import in_a_moment, interrupt

mujoco = pytest.importorskip("mujoco")

import contactd  # noqa: E402
from contactd.convention import contact_to_mujoco  # noqa: E402
from contactd.mujoco import Coupling, CouplingWarning  # noqa: E402

TABLE = "multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,-100],[0,0,0,1]]) { cube(size = [2000, 2000, 200], center = true); }"
BOX = "cube(size = [100, 100, 100], center = true);"


def scene(body, table='<geom type="box" size="1 1 .1" pos="0 0 -.1"/>', option=""):
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" {option}/><default><geom solref="0.004 1"/></default><worldbody>
        <body name="table">{table}</body><body name="body" pos="0 0 .07"><freejoint/>{body}</body></worldbody></mujoco>"""
    )


def box(**attributes):
    words = " ".join(f'{k}="{v}"' for k, v in attributes.items())
    return f'<geom type="box" size=".05 .05 .05" {words}/>'


def test_a_box_falls_and_rests_as_mujocos_own_does():
    model = scene(box())
    data = mujoco.MjData(model)
    stock = scene(box())
    theirs = mujoco.MjData(stock)
    with Coupling(model, {"table": TABLE, "body": BOX}, unit=1e-3) as coupling:
        for _ in range(400):
            n = coupling.step(data)
            mujoco.mj_step(stock, theirs)
        assert n == 4 and data.ncon == 4
    # MuJoCo's rests a little in the table; this one as far in the skin.
    assert data.qpos[2] == pytest.approx(theirs.qpos[2] + coupling.skin, abs=1e-6)
    assert np.abs(data.qvel).max() < 1e-5 and np.abs(data.qpos[3:] - [1, 0, 0, 0]).max() < 1e-6
    force = np.zeros(6)
    total = 0.0
    for i in range(4):
        mujoco.mj_contactForce(model, data, i, force)
        total += force[0]
    assert total == pytest.approx(9.81 * model.body_mass[2], rel=1e-3)
    corners = {tuple(np.sign(c.pos[:2]).astype(int)) for c in data.contact}
    assert corners == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


@pytest.mark.parametrize(
    ("table", "body"),
    [
        ({}, {}),
        ({"friction": ".9 .02 .001"}, {"friction": ".3 .05 .0001", "condim": 6}),
        ({"solmix": 3, "solref": ".01 1"}, {"solmix": 1, "solref": ".03 .5", "solimp": ".8 .9 .01 .4 3"}),
        ({"priority": 2, "friction": ".1 .01 .001", "condim": 1}, {"friction": ".8 .2 .1"}),
        ({"solref": "-1000 -10"}, {"solref": "-2000 -5"}),
        ({"solmix": 0}, {"solmix": 0}),
        ({"solmix": 0}, {"solref": ".05 2"}),
        ({"friction": "0 0 0"}, {"friction": "0 0 0"}),
    ],
)
def test_contacts_have_the_parameters_that_mujoco_gives_them(table, body):
    words = " ".join(f'{k}="{v}"' for k, v in table.items())
    make = lambda: scene(box(**body), f'<geom type="box" size="1 1 .1" pos="0 0 -.1" {words}/>')  # noqa: E731
    stock, model = make(), make()
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    for d in (theirs, data):
        d.qpos[2] = 0.05
    theirs.qpos[2] -= 1e-6
    mujoco.mj_forward(stock, theirs)
    with Coupling(model, {"table": TABLE, "body": BOX}, unit=1e-3) as coupling:
        mujoco.mj_step1(model, data)
        assert data.ncon == 0 and coupling.add_contacts(data) == 4
    own, their = data.contact[0], theirs.contact[0]
    for field in ("dim", "friction", "solref", "solimp"):
        assert np.allclose(getattr(own, field), getattr(their, field), atol=1e-15), field
    assert list(own.geom) == list(their.geom) and own.dist == pytest.approx(0, abs=1e-12)
    assert np.allclose(own.frame, their.frame, atol=1e-9), "normal and MuJoCo's own tangents"


def test_frames_are_mujocos_own_in_every_direction():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom size="1"/><body name="b"><freejoint/><geom size="1"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    for normal in np.random.default_rng(5).normal(size=(60, 3)):
        normal /= np.linalg.norm(normal)
        data.qpos[:3] = 1.9 * normal
        mujoco.mj_forward(model, data)
        pos, frame, dist = contact_to_mujoco(0.95 * normal, normal, -0.1)
        own = data.contact[0]
        assert np.allclose(own.frame, frame, atol=1e-12) and np.allclose(own.pos, pos) and own.dist == pytest.approx(dist)


def test_a_ball_falls_through_a_real_hole():
    plate = "difference() { cube(size = [200, 200, 20], center = true); cylinder(h = 60, r1 = 21, r2 = 21, center = true); }"
    geom = '<geom type="box" size=".1 .1 .01"/>'
    model = scene('<geom type="sphere" size=".02"/>', geom)
    data = mujoco.MjData(model)
    with Coupling(model, {"table": plate, "body": "sphere(r = 20);"}, unit=1e-3) as coupling:
        for _ in range(250):
            coupling.step(data)
        assert data.qpos[2] < -0.1
        # Beside the hole it stays up.
        mujoco.mj_resetData(model, data)
        data.qpos[0] = 0.06
        for _ in range(400):
            coupling.step(data)
        assert data.qpos[2] == pytest.approx(0.03, abs=coupling.skin)


def test_contacts_of_a_body_at_rest_keep_their_ids():
    model = scene(box(), '<geom type="box" size="1 1 .1" pos="0 0 -.1"/>')
    data = mujoco.MjData(model)
    with Coupling(model, {"table": TABLE, "body": BOX}, unit=1e-3) as coupling:
        data.qpos[2] = 0.0501
        for _ in range(200):
            coupling.step(data)
        first = {point.id: point.on_b for _, _, point in coupling.contacts}
        assert len(first) == 4
        for _ in range(100):
            assert coupling.step(data) == 4 and data.ncon == 4
            for a, b, point in coupling.contacts:
                assert model.body(b).name == "body" and np.allclose(point.on_b, first[point.id], atol=1e-6)


def test_a_body_between_two_walls_is_told_by_both_faces_and_keeps_its_ids():
    # A box of 100 mm jammed between walls 98 mm apart: out of one is into the other, so it is moved out of each by itself.
    wall = '<body name="{0}" pos="{1} 0 0"><geom type="box" size=".05 .2 .2"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody>{wall.format("left", -0.099)}{wall.format("right", 0.099)}
        <body name="box"><freejoint/>{box()}</body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    slab = "cube(size = [100, 400, 400], center = true);"
    with Coupling(model, {"left": slab, "right": slab, "box": BOX}, unit=1e-3) as coupling:
        seen = []
        for _ in range(3):
            # By more than the slack, so that it is asked about.
            data.qpos[2] += 1e-5
            mujoco.mj_step1(model, data)
            assert coupling.add_contacts(data) == data.ncon == 8
            by_wall = {}
            for a, b, point in coupling.contacts:
                assert point.separation == pytest.approx(-1.0, abs=1e-2)
                by_wall.setdefault(model.body(a).name, []).append(point.id)
            assert sorted(map(len, by_wall.values())) == [4, 4]
            assert all(min(ids) >= 0 and len(set(ids)) == len(ids) for ids in by_wall.values())
            seen.append(by_wall)
        assert seen[0] == seen[1] == seen[2]
        asked, kept = coupling.asked, coupling.contacts
        assert asked == (3, 3)
        mujoco.mj_step1(model, data)
        assert coupling.add_contacts(data) == data.ncon == 8 and coupling.asked == asked, "nothing has moved"
        assert [p.id for *_, p in coupling.contacts] == [p.id for *_, p in kept] and coupling.contacts is not kept


def turned_over(session):
    """A box that has been turned over where it lay, so that its points have ids from 4 on; the coupling and MuJoCo's data."""
    model = scene(box())
    data = mujoco.MjData(model)
    coupling = Coupling(model, {"table": TABLE, "body": BOX}, unit=1e-3, session=session)
    for pose in ((0, 0, 0.0501, 1, 0, 0, 0), (0.4, 0, 0.0501, 0, 1, 0, 0)):
        data.qpos[:] = pose
        coupling.step(data)
    assert {point.id for _, _, point in coupling.contacts} == {4, 5, 6, 7}
    return coupling, data


def test_an_interrupted_request_changes_nothing(own_server):
    with contactd.connect("own") as session:
        coupling, data = turned_over(session)
        before, kept = data.qpos.copy(), coupling.contacts
        with own_server.suspended():
            for _ in range(2):
                with pytest.raises(KeyboardInterrupt), in_a_moment(interrupt):
                    coupling.step(data)
        assert np.array_equal(data.qpos, before) and coupling.contacts is kept
        for _ in range(20):
            assert coupling.step(data) == 4
            assert {point.id for _, _, point in coupling.contacts} == {4, 5, 6, 7}


def test_a_failed_request_changes_nothing(session):
    coupling, data = turned_over(session)
    kept = coupling.contacts
    mujoco.mj_step1(coupling.model, data)
    at = data.xpos[coupling.model.body("body").id]
    height, at[2] = at[2], np.nan
    for _ in range(2):
        with pytest.raises(contactd.Refused):
            coupling.add_contacts(data)
    assert coupling.contacts is kept
    at[2] = height
    assert coupling.add_contacts(data) == 4
    assert {point.id for _, _, point in coupling.contacts} == {4, 5, 6, 7}


def test_bodies_without_a_solid_keep_mujocos_collisions():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001"/><worldbody><geom type="plane" size="1 1 .1"/>
        <body name="free" pos="0 0 .05"><freejoint/><geom size=".05"/></body>
        <body name="exact" pos=".5 0 .05"><freejoint/><geom size=".05"/></body></worldbody>
        <contact><exclude body1="world" body2="exact"/><exclude body1="free" body2="exact"/></contact></mujoco>"""
    )
    data = mujoco.MjData(model)
    with Coupling(model, {"exact": "sphere(r = 0.05);"}) as coupling:
        for _ in range(200):
            coupling.step(data)
    assert data.qpos[2] > 0.04 and data.qpos[9] < 0, "what has no partner falls"


def test_a_session_of_ones_own_and_bodies_on_joints():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001"/><worldbody>
        <body name="arm" pos="0 0 .2"><joint axis="0 1 0"/><geom type="capsule" size=".01" fromto="0 0 0 .2 0 0"/>
          <body name="hand" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".03"/></body></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    solids = {"arm": "multmatrix([[0,0,1,0],[0,1,0,0],[-1,0,0,0],[0,0,0,1]]) { cylinder(h = 0.2, r1 = 0.01, r2 = 0.01); }",
              "hand": "sphere(r = 0.03);"}
    with contactd.embedded() as session:
        coupling = Coupling(model, solids, session=session)
        for _ in range(50):
            assert coupling.step(data) == 0, "parent and child do not meet"
        coupling.close()
        assert not session.closed
        session.begin_step(0)
        session.finish()


def bodies(*inner, before="", after="", option=""):
    """A model of bodies, each a name, its attributes and joints, and its geoms."""
    text = "".join(f'<body name="{name}" {words}>{geoms}</body>' for name, words, geoms in inner)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.001">{option}</option><worldbody>{before}{text}</worldbody>{after}</mujoco>'
    )


FREE = "<freejoint/>"
CUBE = "cube(size = [0.1, 0.1, 0.1], center = true);"


def touching(coupling):
    """The pairs of bodies' names that contacts were added for in a model's rest position."""
    data = mujoco.MjData(coupling.model)
    mujoco.mj_step1(coupling.model, data)
    coupling.add_contacts(data)
    return {(coupling.model.body(a).name, coupling.model.body(b).name) for a, b, _ in coupling.contacts}


def test_contacts_that_would_be_lost_are_refused():
    free = ("free", 'pos="0 0 .1"', FREE + '<geom name="ball" size=".05"/>')
    two = lambda **k: bodies(("exact", "", FREE + box(name="block")), free, **k)  # noqa: E731
    floor = '<geom name="floor" type="plane" size="1 1 .1"/>'
    model = two()
    with pytest.raises(ValueError, match="body 'exact' has a solid and body 'free' has none, so geom 'block' and geom 'ball' would"):
        Coupling(model, {"exact": CUBE})
    assert model.geom_contype.tolist() == [1, 1], "what is refused has changed nothing"
    with pytest.raises(ValueError, match="body 'exact' has a solid and body 'world' has none.* geom 'floor' .* and so with 1 more"):
        Coupling(two(before=floor), {"exact": CUBE})
    # What the model itself keeps apart is nobody's loss.
    exclude = '<contact><exclude body1="free" body2="exact"/></contact>'
    Coupling(two(after=exclude), {"exact": CUBE}).close()
    Coupling(bodies(("exact", "", FREE + box(contype=2, conaffinity=2)), free, before=floor), {"exact": CUBE}).close()
    # And the world may have a solid like any other body.
    slab = "multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,-0.5],[0,0,0,1]]) { cube(size = [4, 4, 1], center = true); }"
    model = bodies(("exact", 'pos="0 0 .0501"', FREE + box()), before=floor)
    with Coupling(model, {"world": slab, "exact": CUBE}) as coupling:
        assert touching(coupling) == {("world", "exact")}


def test_a_flex_that_would_lose_its_contacts_is_refused():
    flex = """<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" mass="1" radius=".01" dim="2" pos="0 0 1">
        <contact selfcollide="none"/></flexcomp>"""
    with pytest.raises(ValueError, match="body 'exact' has a solid, so geom 'block' and the flex 'cloth' would no longer meet"):
        Coupling(bodies(("exact", "", FREE + box(name="block")), before=flex), {"exact": CUBE})
    Coupling(bodies(("exact", "", FREE + box(contype=4, conaffinity=4)), before=flex), {"exact": CUBE}).close()


def test_pairs_are_refused():
    geoms = [(n, f'pos="0 0 {z}"', FREE + box(name=f"{n} block")) for n, z in (("a", 0), ("b", 0.1))]
    pair = '<contact><pair name="grip" geom1="a block" geom2="b block"/></contact>'
    with pytest.raises(ValueError, match="the <pair> 'grip' makes MuJoCo's contacts between geom 'a block' and geom 'b block'"):
        Coupling(bodies(*geoms, after=pair), {"a": CUBE, "b": CUBE})


def test_filters_between_coupled_bodies_are_mujocos():
    stack = [(n, f'pos="0 0 {0.1 * i}"', FREE + box()) for i, n in enumerate("abc")]
    solids = dict.fromkeys("abc", CUBE)
    with Coupling(bodies(*stack), solids) as coupling:
        assert touching(coupling) == {("a", "b"), ("b", "c")}
    exclude = '<contact><exclude body1="b" body2="a"/></contact>'
    with Coupling(bodies(*stack, after=exclude), solids) as coupling:
        assert touching(coupling) == {("b", "c")}
    bits = [(n, f'pos="0 0 {0.1 * i}"', FREE + box(contype=1 << i, conaffinity=1)) for i, n in enumerate("abc")]
    with Coupling(bodies(*bits), solids) as coupling:
        assert touching(coupling) == {("a", "b")}
    # Welded bodies are one; the child of a moving body does not meet it, unless the model says so.
    hand = FREE + box() + f'<body name="b" pos="0 0 .1">{box()}<body name="c" pos="0 0 .1"><joint/>{box()}</body></body>'
    with Coupling(bodies(("a", "", hand)), solids) as coupling:
        assert touching(coupling) == set()
    with Coupling(bodies(("a", "", hand), option='<flag filterparent="disable"/>'), solids) as coupling:
        assert touching(coupling) == {("b", "c")}


def test_filters_that_bodies_cannot_keep_are_told():
    mixed = FREE + box(name="shell") + '<geom name="core" size=".01" contype="2" conaffinity="2"/>'
    model = bodies(("a", "", mixed), ("b", 'pos="0 0 .1"', FREE + box(name="block")))
    with pytest.warns(CouplingWarning, match="body 'a' and body 'b' meet as whole solids, though geom 'core' and geom 'block' do not"):
        Coupling(model, {"a": CUBE, "b": CUBE}).close()


@pytest.mark.parametrize(("field", "value"), [("margin", ".01"), ("gap", ".01")])
def test_margin_and_gap_are_told(field, value):
    model = bodies(("a", "", FREE + box(name="block", **{field: value})))
    with pytest.warns(CouplingWarning, match=f"the {field} of geom 'block' has no effect: contacts of body 'a' act from the coupling's skin"):
        Coupling(model, {"a": CUBE}).close()


def test_the_first_colliding_geom_gives_the_parameters():
    seen = '<geom name="seen" size=".01" contype="0" conaffinity="0" friction=".9 .1 .1" condim="6" margin=".5"/>'
    for geoms in (seen + box(name="block", friction=".3 .02 .001"), box(name="block", friction=".3 .02 .001") + seen):
        model = bodies(("a", "", FREE + geoms), ("b", 'pos="0 0 .1"', FREE + box(friction=".2 .01 .001")))
        data = mujoco.MjData(model)
        with Coupling(model, {"a": CUBE, "b": CUBE}) as coupling:
            mujoco.mj_step1(model, data)
            assert coupling.add_contacts(data) == 4
            contact = data.contact[0]
            assert model.geom(contact.geom[0]).name == "block" and contact.dim == 3 and contact.friction[0] == 0.3
    with pytest.raises(ValueError, match="no geom of body 'a' collides .* give one of them contype"):
        Coupling(bodies(("a", "", FREE + seen.replace("<geom", '<geom mass="1"'))), {"a": CUBE})


@pytest.mark.parametrize("words", ['friction=".1"', 'condim="4"', 'solref=".1 1"', 'solimp=".5"', 'solmix="2"', 'priority="1"'])
def test_geoms_of_one_body_that_differ_are_told(words):
    field = words.split("=")[0]
    other = f'<geom name="other" size=".01" {words}/>'
    with pytest.warns(CouplingWarning, match=f"have the {field} of its first colliding geom, geom 'block'; geom 'other' differ"):
        Coupling(bodies(("a", "", FREE + box(name="block") + other)), {"a": CUBE}).close()


@pytest.mark.parametrize("flag", ["contact", "constraint"])
def test_a_model_whose_contacts_are_off_has_none_until_they_are_on(flag):
    inside = FREE + box()
    off, on = (bodies(("a", "", inside), ("b", 'pos="0 0 .1001"', inside), option=f'<flag {flag}="{word}"/>') for word in ("disable", "enable"))
    stock, data = mujoco.MjData(off), mujoco.MjData(off)
    for _ in range(20):
        mujoco.mj_step(off, stock)
    with Coupling(off, {"a": CUBE, "b": CUBE}) as coupling:
        for _ in range(20):
            assert coupling.step(data) == 0 and data.ncon == 0 and coupling.contacts == [] and coupling.contact_geoms == []
        assert data.qpos.tolist() == stock.qpos.tolist() and coupling.asked.requests == 0
        # Switched on while it runs it is a model in which they are on.
        off.opt.disableflags = on.opt.disableflags
        mujoco.mj_resetData(off, data)
        other = mujoco.MjData(on)
        with Coupling(on, {"a": CUBE, "b": CUBE}) as another:
            assert coupling.step(data) == another.step(other) > 0
        assert data.qvel.tolist() == other.qvel.tolist()


def test_options_that_change_contacts_are_refused():
    for flag, sentence in [
        ('override="enable"', "option flag override"),
        ('sleep="enable"', "bodies that sleep"),
    ]:
        try:
            model = bodies(("a", "", FREE + box()), option=f"<flag {flag}/>")
        except ValueError:
            continue  # this MuJoCo has no such flag
        with pytest.raises(ValueError, match=sentence):
            Coupling(model, {"a": CUBE})
    for field, word in (("geom_adhesion", "adhesion"), ("geom_surfacevel", "surfacevel")):
        model = bodies(("a", "", FREE + box(name="belt")))
        if hasattr(model, field):
            getattr(model, field)[:] = 1.0
            with pytest.raises(ValueError, match=f"do not know {word}, which geom 'belt' has"):
                Coupling(model, {"a": CUBE})


def test_a_closed_coupling_gives_the_geoms_back():
    model = bodies(("a", "", FREE + box(contype=3, conaffinity=5)), ("b", 'pos="0 0 1"', FREE + box()))
    with Coupling(model, {"a": CUBE, "b": CUBE}):
        assert not model.geom_contype.any() and not model.geom_conaffinity.any()
        with pytest.raises(ValueError, match="an open coupling already"):
            Coupling(model, {"a": CUBE, "b": CUBE})
    assert model.geom_contype.tolist() == [3, 1] and model.geom_conaffinity.tolist() == [5, 1]
    with pytest.raises(contactd.Refused):
        Coupling(model, {"a": CUBE, "b": "cube(;"})
    assert model.geom_contype.tolist() == [3, 1]


def test_a_mocap_body_moves():
    model = bodies(("paddle", 'mocap="true"', box()), ("ball", 'pos="0 0 .2"', FREE + '<geom size=".05"/>'))
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    with Coupling(model, {"paddle": CUBE, "ball": "sphere(r = 0.05);"}) as coupling:
        assert coupling.step(data) == 0
        for _ in range(300):
            data.mocap_pos[0, 2] += 0.0005
            coupling.step(data)
    # A mocap body has no velocity to give, so the ball lags behind; were the paddle taken for a fixed body it would lie at .2.
    assert data.qpos[2] > 0.22


def test_misuse_is_named():
    model = bodies(("a", "", FREE + box()))
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(ValueError, match="Runge-Kutta"):
        Coupling(model, {"a": CUBE})
    with pytest.raises(ValueError, match="no body called 'nobody'"):
        Coupling(scene(box()), {"nobody": BOX})
    with pytest.raises(ValueError, match="skin"):
        Coupling(scene(box()), {}, skin=0.0)
    with pytest.raises(ValueError, match="unit"):
        Coupling(scene(box()), {}, unit=float("inf"))
    with pytest.raises(ValueError, match="body 'table' has no geom"):
        Coupling(scene(box(), table=""), {"table": TABLE})
    with pytest.raises(contactd.Refused, match="body.csg:1:"):
        Coupling(scene(box()), {"table": TABLE, "body": "cube(;"})
