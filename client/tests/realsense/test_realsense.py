"""The RealSense driver on librealsense's own software device; `make franka` installs what it needs."""

import time

import numpy as np
import pytest

pytest.importorskip("pyrealsense2", reason="pyrealsense2 is not installed: make franka")

from software import BASELINE_M, SoftwareRealSense

from roboprompt_client.cameras.realsense import RealSense
from roboprompt_client.cameras.rig import MountedCamera, Rig
from roboprompt_client.errors import CameraError

SIZE_PX, FX_PX = (640, 480), 600.0
MODE = {"width_px": 640, "height_px": 480, "frame_rate_hz": 30}


class Scene:
    """A wall at 0.8 m, and 0.5 m before the camera a bright square, as color and depth camera see them."""

    def __init__(self, depth_scale=0.001, frames=None):
        self._random, self._scale, self._frames = np.random.default_rng(0), depth_scale, frames
        self.hole, self.frozen = 0.0, None

    def __call__(self):
        if self._frames is not None:
            self._frames -= 1
            if self._frames < 0:
                raise StopIteration
        if self.frozen is not None:
            return self.frozen
        rgb = self._random.integers(90, 110, (480, 640, 3), dtype=np.uint8)
        rgb[200:280, 280:360] = (250, 20, 10)
        rgb[:, 551:553, 2] = 250
        depth_m = np.full((480, 640), 0.8)
        shift_px = round(BASELINE_M * FX_PX / 0.5)
        depth_m[200:280, 280 + shift_px : 360 + shift_px] = 0.5
        depth_m[: round(480 * self.hole)] = 0
        return rgb, np.rint(depth_m / self._scale).astype(np.uint16)


@pytest.fixture
def plugged():
    made = []

    def plug(scene=None, **options):
        made.append(SoftwareRealSense(scene or Scene(), fx_px=FX_PX, size_px=SIZE_PX, **options))
        return made[-1].device

    yield plug
    for camera in made:
        camera.close()


@pytest.mark.parametrize("depth_scale", [0.001, 0.0001])
def test_depth_lies_on_color_in_meters_with_the_factory_s_intrinsics(plugged, depth_scale):
    camera = RealSense(device=plugged(Scene(depth_scale), depth_scale=depth_scale), **MODE)
    asked_s = time.time()
    picture = camera.read()
    camera.close()
    assert picture.depth_scale == pytest.approx(depth_scale)
    assert (picture.intrinsics.fx_px, picture.intrinsics.cx_px, picture.intrinsics.width_px) == (600.0, 319.5, 640)
    assert asked_s <= picture.taken_s <= time.time()
    red = picture.rgb[..., 0] > 200
    assert red.sum() == 80 * 80
    # Whether each pixel of the square, but for its rim, has the square's depth in the color camera's picture
    inner = picture.depth_m[205:275, 285:355]
    np.testing.assert_allclose(inner, 0.5, atol=2 * depth_scale)
    assert np.median(picture.depth_m[300:]) == pytest.approx(0.8, abs=2 * depth_scale)


def test_lens_distortion_is_removed(plugged):
    """A ray at x = 0.4 (column 559.5) falls onto column 551.8 through this lens."""
    camera = RealSense(device=plugged(coeffs=(-0.2, 0.0, 0.0, 0.0, 0.0)), **MODE)
    picture = camera.read()
    camera.close()
    blue = picture.rgb[240, :, 2].astype(float) - 100
    blue[blue < 50] = 0
    assert (blue * np.arange(640)).sum() / blue.sum() == pytest.approx(319.5 + 600 * 0.4, abs=0.5)


def look_often(rig):
    for _ in range(10):
        rig.frames()


def test_a_camera_that_stops_sending_says_so(plugged):
    camera = Rig([MountedCamera("front", RealSense(device=plugged(Scene(frames=45)), **MODE), mount=np.eye(4))])
    camera.frames()
    time.sleep(0.5)  # what was sent before the cable was pulled
    with pytest.raises(CameraError, match=r"camera 'front': .*no pair of frames|camera 'front': .*s old"):
        look_often(camera)
    camera.close()


def test_a_clock_that_is_off_is_named(plugged):
    rig = Rig([MountedCamera("front", RealSense(device=plugged(clock_off_s=-20.0), **MODE), mount=np.eye(4))])
    with pytest.raises(CameraError, match=r"camera 'front': its frames are (19|20)\.\d s old"):
        rig.frames()
    rig.close()
    rig = Rig([MountedCamera("left", RealSense(device=plugged(clock_off_s=5.0), **MODE), mount=np.eye(4))])
    with pytest.raises(CameraError, match=r"camera 'left': its clock is .* s ahead"):
        rig.frames()
    rig.close()


def test_holes_and_frozen_pictures_are_named(plugged):
    scene = Scene()
    rig = Rig([MountedCamera("front", RealSense(device=plugged(scene), **MODE), mount=np.eye(4))])
    rig.frames()
    scene.hole = 0.6
    time.sleep(0.2)
    with pytest.raises(CameraError, match=r"camera 'front': the depth of 6[01]% of its pixels is unknown"):
        rig.frames()
    scene.hole = 0.0
    scene.frozen = scene()
    time.sleep(0.2)
    rig.frames()
    with pytest.raises(CameraError, match="camera 'front': its picture is frozen"):
        rig.frames()
    rig.close()


def test_a_mode_that_the_camera_has_not_is_named(plugged):
    with pytest.raises(CameraError, match="has no color and depth of 1280x720 at 30 Hz"):
        RealSense(device=plugged(), width_px=1280, height_px=720)


def test_no_camera_is_plugged_in():
    with pytest.raises(CameraError, match="no RealSense 123 is plugged in"):
        RealSense("123")
