"""MuJoCo with contactd's contacts, held against MuJoCo's own where both are right."""

import signal

import numpy as np
import pytest
from conftest import in_a_moment, interrupt

mujoco = pytest.importorskip("mujoco")

import contactd  # noqa: E402
from contactd.convention import contact_to_mujoco  # noqa: E402
from contactd.mujoco import Coupling  # noqa: E402

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
        assert n == 4 and data.ncon == 4 and coupling.retracted > 0
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


def test_a_pair_that_stays_in_overlap_keeps_its_depth_and_ids():
    # A box of 100 mm jammed between walls 98 mm apart: out of one is into the other.
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
            mujoco.mj_step1(model, data)
            assert coupling.add_contacts(data) == data.ncon == 5
            by_wall = {}
            for a, b, point in coupling.contacts:
                assert point.separation == pytest.approx(-1.0, abs=1e-2)
                by_wall.setdefault(model.body(a).name, []).append(point.id)
            assert sorted(map(len, by_wall.values())) == [1, 4]
            assert all(min(ids) >= 0 and len(set(ids)) == len(ids) for ids in by_wall.values())
            seen.append(by_wall)
        assert seen[0] == seen[1] == seen[2] and coupling.retracted == 3


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
        own_server.process.send_signal(signal.SIGSTOP)
        try:
            for _ in range(2):
                with pytest.raises(KeyboardInterrupt), in_a_moment(interrupt):
                    coupling.step(data)
        finally:
            own_server.process.send_signal(signal.SIGCONT)
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
        <body name="exact" pos=".5 0 .05"><freejoint/><geom size=".05"/></body></worldbody></mujoco>"""
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


def test_misuse_is_named():
    with pytest.raises(ValueError, match="Runge-Kutta"):
        Coupling(scene(box(), option='integrator="RK4"'), {})
    with pytest.raises(ValueError, match="no body called 'nobody'"):
        Coupling(scene(box()), {"nobody": BOX})
    with pytest.raises(ValueError, match="skin"):
        Coupling(scene(box()), {}, skin=0.0)
    with pytest.raises(contactd.Refused, match="body.csg:1:"):
        Coupling(scene(box()), {"body": "cube(;"})
