import math

import numpy as np
import pytest

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame

WIDTH, HEIGHT = 64, 48


def camera(**changes):
    values = {"name": "front", "fx_px": 60, "fy_px": 60, "cx_px": 31.5, "cy_px": 23.5, "camera_to_world": np.eye(4)}
    return Camera(**{**values, **changes})


def with_rotation(rotation):
    transform = np.eye(4)
    transform[:3, :3] = rotation
    return transform


TRANSLATED_BELOW = np.eye(4).T.copy()
TRANSLATED_BELOW[3, 0] = 0.1
HUGE = [[-1e200, 1e200, 0], [1e200, 1e200, 0], [0, 0, -1]]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"fx_px": -60}, "cameras[front].intrinsics"),
        ({"fy_px": 0}, "cameras[front].intrinsics"),
        ({"cx_px": math.nan}, "cameras[front].intrinsics"),
        ({"depth_scale": 0}, "cameras[front].depth_scale"),
        ({"depth_scale": -0.001}, "cameras[front].depth_scale"),
        ({"depth_scale": math.inf}, "cameras[front].depth_scale"),
        ({"camera_to_world": np.eye(3)}, "cameras[front].camera_to_world"),
        ({"camera_to_world": np.full((4, 4), math.nan)}, "cameras[front].camera_to_world"),
        ({"camera_to_world": with_rotation(1.01 * np.eye(3))}, "cameras[front].camera_to_world"),
        ({"camera_to_world": with_rotation(np.diag([1, 1, -1]))}, "cameras[front].camera_to_world"),
        ({"camera_to_world": with_rotation([[1, 0.01, 0], [0, 1, 0], [0, 0, 1]])}, "cameras[front].camera_to_world"),
        ({"camera_to_world": with_rotation(np.zeros((3, 3)))}, "cameras[front].camera_to_world"),
        ({"camera_to_world": with_rotation(HUGE)}, "cameras[front].camera_to_world"),
        ({"camera_to_world": TRANSLATED_BELOW}, "cameras[front].camera_to_world"),
        ({"name": "a b;"}, "cameras.name"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(changes, field):
    with pytest.raises(InvalidInputError) as caught:
        camera(**changes)
    assert caught.value.field == field


def test_negative_focal_lengths_come_with_the_remedy():
    with pytest.raises(InvalidInputError, match=r"fx = -60, fy = -60 .*RLBench"):
        camera(fx_px=-60, fy_px=-60)


def images(width=WIDTH, height=HEIGHT):
    return {"rgb": np.zeros((height, width, 3), np.uint8), "depth_m": np.ones((height, width), np.float32)}


def mask(width=WIDTH, height=HEIGHT):
    return np.zeros((height, width), np.int32)


@pytest.mark.parametrize("seen_by", [camera(), camera(image_size_px=(WIDTH, HEIGHT))], ids=["unknown size", "known"])
def test_images_of_one_size_that_fit_the_intrinsics(seen_by):
    frame = RgbdFrame(seen_by, **images(), mask=mask())
    assert frame.depth_m.shape == (HEIGHT, WIDTH)


def test_differing_image_sizes_are_refused_by_name():
    with pytest.raises(InvalidInputError, match=r"rgb_front 64x48, depth_front 64x48, mask_front 32x48") as caught:
        RgbdFrame(camera(), **images(), mask=mask(width=32))
    assert caught.value.field == "rgb_front"
    with pytest.raises(InvalidInputError, match="image sizes differ"):
        RgbdFrame(camera(), depth_m=images()["depth_m"], mask=mask(HEIGHT, WIDTH))


@pytest.mark.parametrize(
    ("seen_by", "size"),
    [
        (camera(image_size_px=(WIDTH, HEIGHT)), (WIDTH - 1, HEIGHT)),
        (camera(image_size_px=(WIDTH, HEIGHT)), (HEIGHT, WIDTH)),
        (camera(), (2 * WIDTH, 2 * HEIGHT)),
        (camera(), (WIDTH // 2, HEIGHT // 2)),
        (camera(), (WIDTH, 4 * HEIGHT)),
        (camera(cx_px=-1), (WIDTH, HEIGHT)),
    ],
)
def test_images_of_another_size_than_the_intrinsics_are_refused(seen_by, size):
    with pytest.raises(InvalidInputError) as caught:
        RgbdFrame(seen_by, depth_m=np.ones(size[::-1], np.float32))
    assert caught.value.field == "depth_front"
    assert f"{size[0]}x{size[1]}" in caught.value.message


def test_a_known_size_allows_an_optical_center_far_off():
    cropped = camera(cx_px=-10, image_size_px=(WIDTH, HEIGHT))
    assert RgbdFrame(cropped, **images()).camera is cropped


def looking_down():
    """One meter above the world's origin, its optical axis along -z of the world, its x axis along x."""
    transform = np.diag([1.0, -1.0, -1.0, 1.0])
    transform[2, 3] = 1.0
    return camera(fx_px=60, fy_px=40, camera_to_world=transform)


def test_a_point_on_the_optical_axis_appears_at_the_optical_center():
    pixel, depth_m = looking_down().project([0, 0, 0.25])
    assert pixel.tolist() == [31.5, 23.5]
    assert depth_m == 0.75


def test_u_is_the_column_and_v_the_row_of_every_point_of_a_grid():
    points = np.zeros((2, 5, 3))
    points[0, :, 0] = 0.1 * np.arange(5)  # to the right in the image
    points[1, :, 1] = 0.1 * np.arange(5)  # up in the image
    pixels, depth_m = looking_down().project(points)
    assert pixels.shape == (2, 5, 2)
    assert depth_m.shape == (2, 5)
    np.testing.assert_allclose(pixels[0], [[31.5 + 6 * k, 23.5] for k in range(5)])
    np.testing.assert_allclose(pixels[1], [[31.5, 23.5 - 4 * k] for k in range(5)])


def test_points_beside_and_behind_the_camera_have_no_positive_depth():
    _, depth_m = looking_down().project([[0, 0, 1], [0.2, 0, 1], [0, 0, 1.5]])
    assert depth_m.tolist() == [0, 0, -0.5]


def test_a_projected_point_comes_back_from_its_pixel_and_depth():
    rng = np.random.default_rng(0)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    transform = with_rotation(rotation * np.sign(np.linalg.det(rotation)))
    transform[:3, 3] = 0.3, -0.2, 0.9
    oblique = camera(fx_px=55, camera_to_world=transform)
    points = rng.normal(size=(50, 3))
    pixels, depth_m = oblique.project(points)
    rays = (pixels - (oblique.cx_px, oblique.cy_px)) / (oblique.fx_px, oblique.fy_px)
    in_camera = np.column_stack([rays * depth_m[:, None], depth_m])
    np.testing.assert_allclose(in_camera @ transform[:3, :3].T + transform[:3, 3], points, atol=1e-9)


def test_no_points_give_no_pixels():
    pixels, depth_m = looking_down().project(np.zeros((0, 3)))
    assert pixels.shape == (0, 2)
    assert depth_m.shape == (0,)
