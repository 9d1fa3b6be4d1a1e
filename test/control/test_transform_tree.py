"""Poses along a tree of frames, against products of matrices."""

import numpy as np
from scipy.spatial.transform import Rotation

from snake_control.control.transform_tree import Edge, TransformTree

RNG = np.random.default_rng(5)


def edge(parent, stamp_ns=None):
    return Edge(
        parent, stamp_ns, RNG.normal(size=3), Rotation.random(random_state=RNG.integers(99))
    )


def matrix(e):
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = e.rotation.as_matrix(), e.position
    return found


def tree(**edges):
    found = TransformTree()
    for child, e in edges.items():
        found.put(child, e)
    return found


def test_a_chain_up_and_down_again():
    # world - room - camera, and world - stand - body - marker.
    edges = {
        "room": edge("world"),
        "camera": edge("room", 30),
        "stand": edge("world"),
        "body": edge("stand", 20),
        "marker": edge("body"),
    }
    m = {name: matrix(e) for name, e in edges.items()}
    found = tree(**edges).pose("camera", "marker")
    expected = np.linalg.inv(m["room"] @ m["camera"]) @ m["stand"] @ m["body"] @ m["marker"]
    np.testing.assert_allclose(matrix(found), expected, atol=1e-12)
    assert found.parent == "camera"
    assert found.stamp_ns == 20
    direct = tree(**edges).pose("world", "body")
    np.testing.assert_allclose(matrix(direct), m["stand"] @ m["body"], atol=1e-12)
    back = tree(**edges).pose("marker", "body")
    np.testing.assert_allclose(matrix(back), np.linalg.inv(m["marker"]), atol=1e-12)
    assert back.stamp_ns is None


def test_frames_without_a_connection_have_no_pose():
    found = tree(camera=edge("room", 1), body=edge("world", 1))
    assert found.pose("room", "body") is None
    assert found.pose("world", "nobody") is None


def test_the_pose_that_came_last_counts():
    found = tree(body=edge("world", 20))
    last = edge("world", 10)
    found.put("body", last)
    np.testing.assert_array_equal(found.pose("world", "body").position, last.position)
    assert found.pose("world", "body").stamp_ns == 10


def test_a_loop_ends():
    found = tree(a=edge("b", 1), b=edge("a", 1))
    assert found.pose("world", "a") is None
