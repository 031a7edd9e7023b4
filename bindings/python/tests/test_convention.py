"""Every converter against a value worked out by hand, and there and back."""

import numpy as np
import pytest

import contactd.convention as c

RANDOM = np.random.default_rng(7)
HALF = np.sqrt(0.5)
# A quarter turn about z takes x to y; x y z w.
QUARTER = np.array([0.0, 0.0, HALF, HALF])
POSITION = np.array([1.0, 2.0, 3.0])


def rotations(n=200):
    q = RANDOM.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q = np.concatenate([q, np.eye(4), [[HALF, HALF, 0, 0], [0, HALF, HALF, 0], [HALF, 0, HALF, 0], [1e-9, 0, 0, 1]]])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.where(q[:, 3:] < 0, -q, q)


def same_rotation(p, q):
    return np.allclose(np.abs(np.sum(p * q, axis=-1)), 1, atol=1e-14)


def test_quaternion_order():
    assert c.quaternion_from_wxyz([1, 2, 3, 4]).tolist() == [2, 3, 4, 1]
    assert c.quaternion_to_wxyz([1, 2, 3, 4]).tolist() == [4, 1, 2, 3]
    q = rotations()
    assert np.array_equal(c.quaternion_from_wxyz(c.quaternion_to_wxyz(q)), q)
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        c.quaternion_from_wxyz([1, 2, 3])


def test_matrices():
    assert np.allclose(c.matrix_of(QUARTER), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    q = rotations()
    assert same_rotation(c.rotation_of(c.matrix_of(q)), q) and c.matrix_of(q.reshape(2, -1, 4)).shape == (2, 104, 3, 3)
    assert np.allclose(np.linalg.norm(c.rotation_of(c.matrix_of(q)), axis=-1), 1, atol=1e-15)
    for wrong in (2 * np.eye(3), np.diag([1.0, 1, -1]), np.full((3, 3), np.nan), np.eye(3) + 1e-5):
        with pytest.raises(ValueError, match="expected rotation matrices"):
            c.rotation_of(wrong)
    with pytest.raises(ValueError, match="3 by 3"):
        c.rotation_of([1.0, 0, 0])


def test_poses_by_hand():
    p, q = c.from_mujoco(POSITION, [HALF, 0, 0, HALF])
    assert np.array_equal(p, POSITION) and np.array_equal(q, QUARTER)
    assert c.to_mujoco(p, q)[1].tolist() == [HALF, 0, 0, HALF]
    assert c.to_drake(POSITION, QUARTER).tolist() == [HALF, 0, 0, HALF, 1, 2, 3]
    flat = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]]
    assert np.allclose(c.to_mat3x4(POSITION, QUARTER), flat) and np.allclose(c.from_mat3x4(flat)[1], QUARTER)
    assert np.allclose(c.to_opengl(POSITION, QUARTER), [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1])
    assert np.allclose(c.to_mat4(POSITION, QUARTER)[:, 3], [1, 2, 3, 1])


@pytest.mark.parametrize(
    ("there", "back"),
    [
        (c.to_mujoco, lambda made: c.from_mujoco(*made)),
        (c.to_drake, c.from_drake),
        (c.to_mat3x4, c.from_mat3x4),
        (c.to_mat4, c.from_mat4),
        (c.to_opengl, c.from_opengl),
    ],
)
def test_poses_there_and_back(there, back):
    q = rotations()
    p = RANDOM.normal(size=(len(q), 3))
    found = back(there(p, q))
    assert np.array_equal(found[0], p) and same_rotation(found[1], q)
    one = back(there(p[0], q[0]))
    assert one[0].shape == (3,) and one[1].shape == (4,)


def test_wrong_matrices_are_named():
    with pytest.raises(ValueError, match="last row"):
        c.from_mat4(np.eye(4)[::-1])
    with pytest.raises(ValueError, match="3 by 4"):
        c.from_mat3x4(np.eye(4))
    with pytest.raises(ValueError, match="16 numbers"):
        c.from_opengl(np.eye(4))
    with pytest.raises(ValueError, match="7 numbers"):
        c.from_drake(np.eye(4))


# A ball a of radius 1 at the origin, a ball b of radius 1 at x = 1.9: they share .1; and at 2.1.
DEEP = ([0.95, 0, 0], [1, 0, 0], -0.1)
APART = ([1.05, 0, 0], [1, 0, 0], 0.1)


def test_contacts_by_hand():
    pos, frame, dist = c.contact_to_mujoco(*DEEP)
    assert pos.tolist() == [0.95, 0, 0] and frame.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1] and dist == -0.1
    # The point of A is A's deepest in B: at x = 1; that of B at x = .9. The normal points out of B into A.
    a, b, nhat, depth = c.contact_to_drake(*DEEP)
    assert a == pytest.approx([1, 0, 0]) and b == pytest.approx([0.9, 0, 0])
    assert nhat.tolist() == [-1, 0, 0] and depth == 0.1
    a, b, normal, distance = c.contact_to_bullet(*APART)
    assert a == pytest.approx([1, 0, 0]) and b == pytest.approx([1.1, 0, 0])
    assert normal.tolist() == [-1, 0, 0] and distance == 0.1
    assert c.contact_to_physx(*DEEP)[1].tolist() == [-1, 0, 0] and c.contact_to_physx(*DEEP)[2] == -0.1
    assert c.contact_to_ode(*DEEP)[1].tolist() == [-1, 0, 0] and c.contact_to_ode(*DEEP)[2] == 0.1
    assert c.contact_to_coal(*DEEP)[1].tolist() == [1, 0, 0] and c.contact_to_coal(*DEEP)[2] == -0.1
    p1, p2, n1, n2, dist = c.contact_to_rapier(*DEEP)
    assert p1 == pytest.approx([1, 0, 0]) and p2 == pytest.approx([0.9, 0, 0])
    assert n1.tolist() == [1, 0, 0] and n2.tolist() == [-1, 0, 0] and dist == -0.1


@pytest.mark.parametrize(
    ("there", "back"),
    [
        (c.contact_to_mujoco, c.contact_from_mujoco),
        (c.contact_to_drake, c.contact_from_drake),
        (c.contact_to_bullet, c.contact_from_bullet),
        (c.contact_to_physx, c.contact_from_physx),
        (c.contact_to_ode, c.contact_from_ode),
        (c.contact_to_coal, c.contact_from_coal),
        (c.contact_to_rapier, lambda p1, p2, n1, n2, dist: c.contact_from_rapier(p1, p2, n1, dist)),
    ],
)
def test_contacts_there_and_back(there, back):
    points, normals = RANDOM.normal(size=(2, 100, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    separations = RANDOM.normal(size=100)
    found = back(*there(points, normals, separations))
    assert np.allclose(found.point, points, atol=1e-15) and np.array_equal(found.normal, normals)
    assert np.array_equal(found.separation, separations)


def test_mujocos_frames_are_rotations():
    normals = np.concatenate([RANDOM.normal(size=(100, 3)), np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frames = c.contact_to_mujoco(np.zeros((106, 3)), normals, np.zeros(106))[1].reshape(-1, 3, 3)
    assert np.allclose(frames @ np.swapaxes(frames, 1, 2), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(frames), 1) and np.array_equal(frames[:, 0], normals)
