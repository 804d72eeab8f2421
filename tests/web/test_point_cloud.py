"""The point cloud of a picture with depth, as pages fetch it."""

import numpy as np

from app.services.setting_parts import WorkspaceSettings
from app.web.play import AROUND_M, MAX_POINTS, point_cloud
from roboprompt_client.types.camera import Camera, RgbdFrame

WORKSPACE = WorkspaceSettings(min=(-0.5, -0.5, 0.0), max=(0.5, 0.5, 1.0))


def looking_down(width, depth_m):
    """A camera 1.5 m above the origin, x to the right of the picture; left half red, right half blue."""
    pose = np.diag([1.0, -1, -1, 1])
    pose[2, 3] = 1.5
    camera = Camera("front", width, width, (width - 1) / 2, (width - 1) / 2, pose)
    rgb = np.zeros((width, width, 3), np.uint8)
    rgb[:, : width // 2], rgb[:, width // 2 :] = (255, 0, 0), (0, 0, 255)
    return RgbdFrame(camera, rgb, np.full((width, width), depth_m, np.float32))


def read(data):
    number = len(data) // 15
    points = np.frombuffer(data[: 12 * number], "<f4").reshape(number, 3)
    return points, np.frombuffer(data[12 * number :], np.uint8).reshape(number, 3)


def test_every_point_lies_where_it_was_seen_in_its_color():
    frame = looking_down(40, 1.2)
    frame.depth_m[0] = 0.0  # not measured
    points, colors = read(point_cloud(frame, WORKSPACE))
    assert len(points) == 39 * 40
    np.testing.assert_allclose(points[:, 2], 0.3, atol=1e-6)
    assert (colors[points[:, 0] < 0] == (255, 0, 0)).all()
    assert (colors[points[:, 0] > 0] == (0, 0, 255)).all()


def test_the_room_behind_the_workspace_is_left_out():
    points, _ = read(point_cloud(looking_down(40, 1.5 + AROUND_M + 0.1), WORKSPACE))
    assert len(points) == 0


def test_a_large_picture_is_thinned_evenly():
    points, colors = read(point_cloud(looking_down(300, 1.2), WORKSPACE))
    assert len(points) == len(colors) == MAX_POINTS
    assert np.abs(points[:, :2].mean(axis=0)).max() < 0.01
