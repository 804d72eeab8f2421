from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.cuboid.estimator import CuboidPoses
from app.perception.cuboid.model import COLORS, ColorModel, CuboidModel, Rank
from app.perception.models import MasksModel
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.quaternions import yaw_rad
from tests.perception.flat_scene import camera
from tests.perception.solid_scene import FRONT, LEFT, Solid, cube, shoot

CUBE_M = (0.05, 0.05, 0.05)


def model(color="red", size_m=CUBE_M, **more):
    return CuboidModel(size_m, ColorModel(COLORS[color]), **more)


def estimate(frames, **models):
    return CuboidPoses().estimate([ObjectQuery(name, model=item) for name, item in models.items()], frames)


def errors(pose, solid, symmetry_deg):
    """cm and degrees."""
    yaw = np.degrees(yaw_rad(pose.quaternion_xyzw) - solid.yaw_rad)
    turn = (yaw + symmetry_deg / 2) % symmetry_deg - symmetry_deg / 2
    return 100 * np.linalg.norm(pose.position_m - np.array(solid.position_m)), abs(turn)


@pytest.mark.parametrize("seed", range(6))
def test_a_cube_is_found_to_two_millimeters_and_two_degrees(seed):
    random = np.random.default_rng(seed)
    solid = cube("red", *random.uniform(-0.1, 0.1, 2), random.uniform(-np.pi, np.pi))
    (pose,) = estimate([shoot([solid], seed=seed)], block=model())
    error_cm, error_deg = errors(pose, solid, 90)
    assert error_cm < 0.2
    assert error_deg < 2
    assert (pose.estimator, pose.cameras) == ("cuboid", ("front",))
    assert pose.confidence > 0.9
    assert abs(np.degrees(yaw_rad(pose.quaternion_xyzw))) <= 45


def test_a_world_whose_origin_is_far_away_gives_the_same_poses():
    frame, away_m = shoot([cube("red", 0.02, 0.03, 0.3)]), np.array([30.0, -25.0, 10.0])
    pose = frame.camera.camera_to_world.copy()
    pose[:3, 3] += away_m
    far = replace(frame, camera=replace(frame.camera, camera_to_world=pose))
    (near_pose,), (far_pose,) = (estimate([item], block=model()) for item in (frame, far))
    np.testing.assert_allclose(far_pose.position_m - away_m, near_pose.position_m, atol=2e-7)
    np.testing.assert_allclose(far_pose.quaternion_xyzw, near_pose.quaternion_xyzw, atol=1e-6)


def test_equal_scenes_give_equal_yaws_whichever_side_is_called_the_front():
    yaws = [0.3, 0.3 + np.pi / 2, 0.3 - np.pi]
    poses = [estimate([shoot([cube("red", 0, 0, yaw)])], block=model())[0] for yaw in yaws]
    for pose in poses[1:]:
        np.testing.assert_allclose(pose.quaternion_xyzw, poses[0].quaternion_xyzw, atol=1e-3)


def test_stacked_cubes_are_distinguished_and_the_lower_ones_yaw_is_its_own():
    lower, upper = cube("blue", 0.05, 0, 0.5), cube("yellow", 0.05, 0, 0.7, storey=1)
    poses = estimate([shoot([lower, upper])], low=model("blue"), high=model("yellow"))
    for pose, solid in zip(poses, (lower, upper), strict=True):
        error_cm, error_deg = errors(pose, solid, 90)
        assert error_cm < 0.3
        assert error_deg < 3


def test_what_stands_before_an_object_does_not_bend_it():
    solid, before = cube("red", 0, 0, 0.4), Solid("grey", (0.05, 0.06, 0.03), 0.9, (0.03, 0.03, 0.06))
    frame = shoot([solid, before])
    hidden = np.count_nonzero(shoot([solid]).mask == 1) - np.count_nonzero(frame.mask == 1)
    assert hidden > 200  # the scene does what its name says
    (pose,) = estimate([frame], block=model())
    error_cm, error_deg = errors(pose, solid, 90)
    assert error_cm < 0.3
    assert error_deg < 3


def test_an_object_that_is_nearly_hidden_is_refused_with_the_reason():
    solid, wall = cube("red", 0, 0), Solid("grey", (0.05, 0.045, 0.05), 0.7, (0.02, 0.2, 0.1))
    frame = shoot([solid, wall])
    assert 100 < np.count_nonzero(frame.mask == 1) < 300  # of 1500
    with pytest.raises(UncertainPoseError, match=r"front: .*visible") as caught:
        estimate([frame], block=model())
    assert caught.value.field == "objects[block]"


def test_a_cuboids_longer_side_and_a_cylinders_lack_of_yaw():
    solid = Solid("green", (0, 0, 0.02), 1.2, (0.09, 0.05, 0.04))
    (pose,) = estimate([shoot([solid])], bar=model("green", solid.size_m))
    assert errors(pose, solid, 180)[1] < 2
    button = Solid("red", (0.02, 0.01, 0.02), 0, (0.06, 0.06, 0.04), round=True)
    (pose,) = estimate([shoot([button])], button=model("red", button.size_m, shape="cylinder", origin_m=(0, 0, 0.02)))
    np.testing.assert_allclose(pose.position_m, [0.02, 0.01, 0.04], atol=0.003)
    np.testing.assert_allclose(pose.quaternion_xyzw, [0, 0, 0, 1], atol=1e-6)


def test_the_origin_may_be_off_the_middle_where_another_object_tells_the_yaws_apart():
    mat, block = Solid("green", (0.1, 0, 0.002), 0.2, (0.08, 0.09, 0.004)), cube("red", -0.05, 0)
    for yaw_rad_, x_m in ((0.2, 0.1), (0.2, -0.12)):
        mat = replace(mat, position_m=(x_m, 0, 0.002), yaw_rad=yaw_rad_)
        mat_model = model("green", mat.size_m, origin_m=(0.01, 0, 0), away_from="block")
        pose = estimate([shoot([mat, block])], mat=mat_model, block=model())[0]
        heading = np.array([np.cos(0.2), np.sin(0.2), 0]) * (1 if x_m > -0.05 else -1)
        np.testing.assert_allclose(pose.position_m, mat.position_m + 0.01 * heading, atol=0.003)
        np.testing.assert_allclose(Rotation.from_quat(pose.quaternion_xyzw).apply([1, 0, 0]), heading, atol=0.04)


def test_two_of_one_color_are_no_guess():
    pair = [cube("red", 0, -0.08), cube("red", 0, 0.08)]
    with pytest.raises(UncertainPoseError, match=r"camera front sees 2 that look like it, at \[") as caught:
        estimate([shoot(pair)], block=model())
    assert caught.value.field == "objects[block]"
    other = Solid("red", (0, 0.12, 0.01), 0, (0.02, 0.02, 0.02))  # of the color, but not of the size
    (pose,) = estimate([shoot([pair[0], other])], block=model())
    assert errors(pose, pair[0], 90)[0] < 0.2


def test_a_rank_chooses_among_its_like_and_refuses_another_count():
    mat = Solid("green", (0, 0, 0.002), 0, (0.08, 0.08, 0.004))
    blocks = [cube("red", 0, -0.1), cube("red", -0.14, 0), cube("red", 0, 0.18)]
    models = {f"block {k}": model(rank=Rank(k, "mat", 3)) for k in (3, 1, 2)}
    frame = shoot([mat, *blocks])
    third, first, second, _ = estimate([frame], **models, mat=model("green", mat.size_m))
    for pose, solid in ((first, blocks[0]), (second, blocks[1]), (third, blocks[2])):
        assert errors(pose, solid, 90)[0] < 0.25
    with pytest.raises(UncertainPoseError, match="2 things that look like it are seen well enough, not 3"):
        estimate([shoot([mat, *blocks[:2]])], **models, mat=model("green", mat.size_m))


def test_cameras_are_fused_and_a_wrong_calibration_is_refused():
    solid = cube("red", 0.03, 0.02, 0.4)
    frames = [shoot([solid], FRONT), shoot([solid], LEFT)]
    (pose,) = estimate(frames, block=model())
    assert set(pose.cameras) == {"front", "left"}
    assert errors(pose, solid, 90)[0] < 0.15
    moved = FRONT.camera_to_world.copy()
    moved[0, 3] += 0.06
    shifted = replace(frames[0], camera=replace(FRONT, camera_to_world=moved))
    with pytest.raises(UncertainPoseError, match=r"cm apart") as caught:
        estimate([shifted, frames[1]], block=model())
    assert "front" in caught.value.message
    assert "left" in caught.value.message


def test_swapped_cameras_are_refused():
    solid = cube("red", 0.1, 0.05, 0.4)
    left = camera("left", (-0.7, 0.6, 0.4))
    for view, other in ((FRONT, left), (left, FRONT)):
        swapped = replace(shoot([solid], view), camera=other)
        with pytest.raises(InvalidInputError, match=r"flat surface .* sees by \d+ degrees") as caught:
            estimate([swapped], block=model())
        assert caught.value.field == f"cameras[{other.name}].camera_to_world"


def test_swapped_cameras_of_equal_tilt_contradict_each_other():
    solid, turned = cube("red", 0.1, 0.05, 0.4), camera("turned", (-0.6, 0.5, 0.7))
    front, other = shoot([solid], FRONT), shoot([solid], turned)
    with pytest.raises(UncertainPoseError, match="cm apart"):
        estimate([replace(front, camera=turned), replace(other, camera=FRONT)], block=model())


def test_one_camera_that_does_not_see_it_is_no_obstacle_but_all_are():
    solid = cube("red", 0, 0)
    empty = shoot([], LEFT)
    (pose,) = estimate([shoot([solid]), empty], block=model())
    assert pose.cameras == ("front",)
    with pytest.raises(ObjectNotVisibleError, match="left: no pixel has its color") as caught:
        estimate([empty], block=model())
    assert caught.value.field == "objects[block]"


def test_depth_of_a_slightly_wrong_scale_is_no_pose():
    frame = shoot([cube("red", 0, 0, 0.3)])
    with pytest.raises(UncertainPoseError):
        estimate([replace(frame, depth_m=frame.depth_m * np.float32(1.4))], block=model())


def test_an_object_without_a_cuboid_model_is_refused():
    for other, what in ((None, "is missing"), (MasksModel(), "is for the estimator 'masks'")):
        with pytest.raises(InvalidInputError, match=what) as caught:
            estimate([shoot([])], block=other)
        assert caught.value.field == "object_models[block]"
    with pytest.raises(InvalidInputError) as caught:
        estimate([], block=model())
    assert caught.value.field == "cameras"


@pytest.mark.parametrize(
    ("models", "field", "message"),
    [
        ({"a": model(away_from="b")}, "object_models[a].away_from", "'b'"),
        ({"a": model(rank=Rank(1, "c", 2))}, "object_models[a].rank.nearest_to", "'c'"),
        ({"a": model(away_from="b"), "b": model("blue", away_from="a")}, "object_models[a]", "a -> b -> a"),
    ],
)
def test_references_must_lead_somewhere(models, field, message):
    with pytest.raises(InvalidInputError) as caught:
        estimate([shoot([])], **models)
    assert caught.value.field == field
    assert message in caught.value.message
