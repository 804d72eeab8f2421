from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.markers.estimator import MarkerPoses, confidence, depth_contradiction
from app.perception.markers.fit import MarkerFit
from app.perception.markers.model import Marker, MarkersModel
from app.perception.markers.view import MarkerView, SeenMarker, find_markers
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from app.pipeline.geometry import inverse_transform
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from synthetic.camera_noise import as_a_camera_sees_it
from tests.perception.flat_scene import camera, marker_quad, render

DICTIONARY = "DICT_4X4_50"
SIZE_M = 0.04


def pose_of(position_m, yaw_deg=0.0, tilt_deg=0.0):
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("zx", [yaw_deg, tilt_deg], degrees=True).as_matrix()
    transform[:3, 3] = position_m
    return transform


def rows(transform):
    return tuple(map(tuple, np.asarray(transform, float).tolist()))


def scene(view, *markers, dictionary=DICTIONARY, seed=0):
    """A noisy frame with markers: (id, size_m, marker_to_world)."""
    family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    quads = [marker_quad(family, *marker) for marker in markers]
    return as_a_camera_sees_it(render(view, quads), np.random.default_rng(seed))


def cube(name="red cube", id_=3, **settings):
    """Marker `id_` on top of a cube of 5 cm."""
    return ObjectQuery(name, model=MarkersModel(DICTIONARY, (Marker(id_, SIZE_M, rows(ON_TOP)),), **settings))


def estimate(frames, *queries):
    return MarkerPoses().estimate(queries or [cube()], frames)


def error_of(pose, object_to_world):
    """Centimeters and degrees."""
    turn = Rotation.from_quat(pose.quaternion_xyzw).inv() * Rotation.from_matrix(object_to_world[:3, :3])
    return 100 * np.linalg.norm(pose.position_m - object_to_world[:3, 3]), np.degrees(turn.magnitude())


ON_TOP = pose_of((0, 0, 0.025))
CUBE = pose_of((0.05, -0.02, 0.025), 25)
SEEN = (3, SIZE_M, CUBE @ ON_TOP)


@pytest.mark.parametrize("dictionary", [DICTIONARY, "DICT_APRILTAG_36h11"])
def test_corners_are_found_to_a_tenth_of_a_pixel(dictionary):
    view = camera()
    frame = scene(view, (3, SIZE_M, CUBE), (8, 0.03, pose_of((-0.1, 0.1, 0), 110)), dictionary=dictionary)
    markers = {marker.id: marker for marker in find_markers(frame.rgb, dictionary, {3, 8})}
    assert set(markers) == {3, 8}
    corners_m = SIZE_M / 2 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    world_to_camera = np.linalg.inv(view.camera_to_world)
    x, y, z = ((corners_m @ CUBE[:3, :3].T + CUBE[:3, 3]) @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]).T
    expected = np.stack([view.fx_px * x / z + view.cx_px, view.fy_px * y / z + view.cy_px], axis=1)
    np.testing.assert_allclose(markers[3].corners_px, expected, atol=0.1)


def test_an_image_without_markers():
    assert find_markers(np.full((48, 64, 3), 90, np.uint8), DICTIONARY, {1}) == ()


@pytest.mark.parametrize("dictionary", [DICTIONARY, "DICT_APRILTAG_36h11"])
def test_small_markers_are_found_in_the_enlarged_image(dictionary):
    view = camera(eye_m=(0.8, 0.6, 0.6))
    places = [pose_of((x, y, 0), 37 * i) for i, (x, y) in enumerate([(0, 0), (0.1, 0.1), (-0.1, 0.05), (0.1, -0.1)])]
    frame = scene(view, *((i, 0.03, place) for i, place in enumerate(places)), dictionary=dictionary)
    wanted = find_markers(frame.rgb, dictionary, range(4))
    assert sorted(marker.id for marker in wanted) == [0, 1, 2, 3]
    (one,) = find_markers(frame.rgb, dictionary, {2})
    assert one.id == 2
    for marker in wanted:
        x, y, z = inverse_transform(view.camera_to_world)[:3] @ places[marker.id][:, 3]
        middle_px = view.fx_px * x / z + view.cx_px, view.fy_px * y / z + view.cy_px
        np.testing.assert_allclose(marker.corners_px.mean(axis=0), middle_px, atol=0.3)


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_a_cube_is_found_to_millimeters(seed, upright):
    random = np.random.default_rng(seed)
    truth = pose_of((*random.uniform(-0.15, 0.15, 2), 0.025), random.uniform(-180, 180))
    view = camera(eye_m=(*random.uniform(0.3, 0.6, 2), random.uniform(0.5, 0.8)))
    (pose,) = estimate([scene(view, (3, SIZE_M, truth @ ON_TOP), seed=seed)], cube(upright=upright))
    centimeters, degrees = error_of(pose, truth)
    assert centimeters < 0.2
    assert degrees < 1
    assert (pose.name, pose.estimator, pose.cameras) == ("red cube", "markers", ("front",))
    assert pose.confidence > 0.9


def test_a_tilted_object_is_found_as_it_lies():
    truth = pose_of((0, 0, 0.05), 40, 30)
    (pose,) = estimate([scene(camera(), (3, SIZE_M, truth @ ON_TOP))])
    centimeters, degrees = error_of(pose, truth)
    assert centimeters < 0.2
    assert degrees < 1


def test_all_markers_of_a_fixture_count():
    # the fixture's origin lies 20 cm from either marker: one alone would turn its errors into several millimeters
    left, right = pose_of((-0.15, 0.1, 0)), pose_of((0.15, 0.1, 0), 90)
    fixture = pose_of((0, -0.1, 0), 10)
    frame = scene(camera(), (1, 0.03, fixture @ left), (2, SIZE_M, fixture @ right))
    model = MarkersModel(DICTIONARY, (Marker(1, 0.03, rows(left)), Marker(2, SIZE_M, rows(right)), Marker(9, 0.03)))
    (pose,) = estimate([frame], ObjectQuery("fixture", model=model))
    centimeters, degrees = error_of(pose, fixture)
    assert centimeters < 0.15
    assert degrees < 0.3


def test_depth_gives_the_range_where_a_marker_was_printed_too_large():
    frame = scene(camera(), (3, 1.04 * SIZE_M, CUBE @ ON_TOP))
    (pose,) = estimate([frame], cube(upright=True))
    # by its size alone the marker of 4.16 cm, 92 cm away, would be 3.5 cm too near
    assert error_of(pose, CUBE)[0] < 0.5


def test_several_cameras_are_fused_and_objects_come_in_the_order_asked():
    views = [camera("front"), camera("left", (-0.5, 0.6, 0.6))]
    other = pose_of((-0.1, 0.05, 0.025), -70)
    frames = [scene(view, SEEN, (5, SIZE_M, other @ ON_TOP)) for view in views]
    blue, red = estimate(frames, cube("blue cube", 5), cube())
    assert (blue.name, red.name) == ("blue cube", "red cube")
    assert sorted(red.cameras) == ["front", "left"]
    assert error_of(red, CUBE)[0] < 0.1
    assert error_of(blue, other)[0] < 0.1


def test_a_camera_that_does_not_see_the_object_does_no_harm():
    views = [camera("front"), camera("ceiling", (0.5, 0.5, 2), (3, 3, 0))]
    (pose,) = estimate([scene(view, SEEN) for view in views])
    assert pose.cameras == ("front",)


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        (lambda f: RgbdFrame(f.camera, f.rgb[:, ::-1].copy(), f.depth_m), ObjectNotVisibleError, "no marker 3"),
        (lambda f: RgbdFrame(f.camera, f.rgb, f.depth_m / 2), UncertainPoseError, "depth_scale"),
        (lambda f: RgbdFrame(f.camera, f.rgb, f.depth_m * 1.3), UncertainPoseError, "size_m"),
        (
            lambda f: RgbdFrame(f.camera, f.rgb, f.depth_m * (np.arange(480) == 0)[:, None]),
            UncertainPoseError,
            "no depth",
        ),
    ],
    ids=["mirrored", "half the depth", "wrong size", "a hole"],
)
def test_bad_images_are_refused_by_object_and_camera(change, error, said):
    with pytest.raises(error, match=said) as caught:
        estimate([change(scene(camera(), SEEN))])
    assert caught.value.field == "objects[red cube]"
    assert "front" in caught.value.message


def test_swapped_cameras_are_noticed():
    views = [camera("front"), camera("left", (-0.5, 0.6, 0.6))]
    front, left = (scene(view, SEEN) for view in views)
    swapped = [RgbdFrame(views[0], left.rgb, left.depth_m), RgbdFrame(views[1], front.rgb, front.depth_m)]
    with pytest.raises(UncertainPoseError, match=r"front.*left|left.*front") as caught:
        estimate(swapped)
    assert caught.value.field == "objects[red cube]"


def test_an_object_that_leans_is_not_called_upright():
    leaning = pose_of((0, 0, 0.05), 40, 30)
    with pytest.raises(UncertainPoseError, match="px off the pose"):
        estimate([scene(camera(), (3, SIZE_M, leaning @ ON_TOP))], cube(upright=True))


def test_the_same_marker_twice_is_ambiguous():
    frame = scene(camera(), SEEN, (3, SIZE_M, pose_of((-0.1, 0.1, 0))))
    with pytest.raises(UncertainPoseError, match="more than once"):
        estimate([frame])


def test_some_camera_is_needed():
    with pytest.raises(InvalidInputError) as caught:
        estimate([])
    assert caught.value.field == "cameras"


def test_every_object_needs_a_model():
    with pytest.raises(InvalidInputError) as caught:
        estimate([scene(camera(), SEEN)], ObjectQuery("red cube"))
    assert caught.value.field == "object_models[red cube]"


def test_two_objects_cannot_be_the_same():
    with pytest.raises(InvalidInputError, match="red cube") as caught:
        estimate([scene(camera(), SEEN)], cube(), cube("blue cube"))
    assert caught.value.field == "object_models[blue cube].markers"


CAMERA = Camera("front", 600, 600, 320, 240, np.eye(4))
GOOD = MarkerFit(np.eye(4), 5.0, 0.1, 0.001, np.radians(1))


def view(depth_m):
    """A marker of 4 cm that faces the camera, 24 px wide: 1 m away by its size."""
    corners_px = np.array([[308.0, 228], [332, 228], [332, 252], [308, 252]])
    return MarkerView(Marker(3, 0.04), SeenMarker(3, corners_px, 0.1), np.full((20, 3), depth_m))


def test_a_good_fit_is_trusted():
    assert confidence(CAMERA, GOOD, [view(1.0)]) == (1.0, "")


@pytest.mark.parametrize(
    ("changes", "depth_m", "expected", "said"),
    [
        ({"corner_rms_px": 1.75}, 1.0, 0.5, "1.8 px off"),
        ({"corner_rms_px": 9.0}, 1.0, 0.0, "9.0 px off"),
        ({"position_sigma_m": 0.0125}, 1.0, 0.5, "1.2 cm"),
        ({"rotation_sigma_rad": np.radians(7.5)}, 1.0, 0.5, "degrees"),
        ({"rival_cost": 5.0}, 1.0, 0.0, "two tilts"),
        ({"rival_cost": 9.0}, 1.0, np.tanh(1), "two tilts"),
        ({"rival_cost": 50.0}, 1.0, 1.0, ""),
        ({}, 1.1, 0.5, "+10 %"),
        ({"corner_rms_px": 1.0}, 0.9, 0.5, "-10 %"),
    ],
)
def test_the_worst_doubt_counts(changes, depth_m, expected, said):
    certain, reason = confidence(CAMERA, replace(GOOD, **changes), [view(1.0), view(depth_m)])
    assert certain == pytest.approx(expected, abs=0.01)
    assert said in reason


def test_impossible_depth_is_distinguished_from_possible_depth():
    assert depth_contradiction(CAMERA, view(1.1)) == ""
    for depth_m in (0.001, 0.8, 1.2, 1000):
        said = depth_contradiction(CAMERA, view(depth_m))
        assert f"{depth_m:.3g} m" in said
        assert "depth_scale" in said
