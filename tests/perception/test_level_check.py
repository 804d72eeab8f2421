from dataclasses import replace

import numpy as np
import pytest

from app.perception.frame_checks import check_level
from roboprompt_client.errors import InvalidInputError
from tests.perception.solid_scene import FRONT, LEFT, cube, shoot


def tilted(degrees):
    """The front camera turned about its own x axis, as a wrong calibration has it."""
    angle = np.radians(degrees)
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return replace(FRONT, camera_to_world=FRONT.camera_to_world @ turn)


@pytest.mark.parametrize("view", [FRONT, LEFT])
def test_a_level_table_passes(view):
    check_level(shoot([cube("red", 0, 0), cube("blue", 0.1, 0.1)], view))


@pytest.mark.parametrize(("degrees", "refused"), [(2, False), (8, True), (-15, True)])
def test_a_tilted_one_is_refused_with_its_tilt(degrees, refused):
    frame = replace(shoot([cube("red", 0, 0)]), camera=tilted(degrees))
    if not refused:
        check_level(frame)
        return
    with pytest.raises(InvalidInputError, match=rf"by {abs(degrees)} degrees") as caught:
        check_level(frame)
    assert caught.value.field == "cameras[front].camera_to_world"


@pytest.mark.parametrize("view", [FRONT, LEFT])
def test_opengl_s_axes_are_refused_as_such(view):
    """Turned half about x, the table is level again, but above the camera."""
    frame = shoot([cube("red", 0, 0)], view)
    opengl = replace(view, camera_to_world=view.camera_to_world @ np.diag([1.0, -1.0, -1.0, 1.0]))
    with pytest.raises(InvalidInputError, match=r"m above it: OpenGL's axes\?") as caught:
        check_level(replace(frame, camera=opengl))
    assert caught.value.field == f"cameras[{view.name}].camera_to_world"


def test_depth_in_another_unit_is_refused_as_such():
    frame = shoot([cube("red", 0, 0)])
    with pytest.raises(InvalidInputError, match=r"m below it; the scale is wrong .*depth_scale") as caught:
        check_level(replace(frame, depth_m=frame.depth_m * 10))
    assert caught.value.field == "depth_front"


def test_without_depth_to_judge_by_nothing_is_said():
    frame = shoot([], noise=False)
    random = np.random.default_rng(0)
    check_level(replace(frame, camera=tilted(15), depth_m=np.zeros_like(frame.depth_m)))
    rubble = random.uniform(0.5, 1.5, frame.depth_m.shape).astype(np.float32)
    check_level(replace(frame, camera=tilted(15), depth_m=rubble))
