import logging
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from scipy.ndimage import binary_erosion, generic_gradient_magnitude, sobel
from scipy.spatial.transform import Rotation

from app.pipeline.geometry import backproject
from app.sim import rendering, select_backend
from app.sim.rendering import OpenGLRenderer, RayCaster, open_renderer, opengl_works
from app.sim.tasks import make_task
from app.sim.tasks.cubes import HALF_SIZE_M
from app.sim.world import CAMERA_NAMES, HEIGHT_PX, SKY_RGB, WIDTH_PX, calibrated

needs_opengl = pytest.mark.skipif(not opengl_works(), reason="no OpenGL on this machine: rays are cast instead")
RENDERERS = [RayCaster, pytest.param(OpenGLRenderer, marks=needs_opengl)]


@pytest.fixture(scope="module")
def scene():
    return make_task("stack_cube", 3)


def interior(pixels):
    """The pixels that are not on an edge."""
    return binary_erosion(pixels, iterations=2)


def distance_to_cube_m(points, pose):
    """From the surface of a 5 cm cube, positive outside."""
    local = np.abs(Rotation.from_quat(pose.quaternion_xyzw).inv().apply(points - pose.position_m))
    return np.max(local - HALF_SIZE_M, axis=1)


@pytest.mark.parametrize("renderer_class", RENDERERS)
@pytest.mark.parametrize("camera", CAMERA_NAMES)
def test_pixels_back_project_onto_the_objects(scene, renderer_class, camera):
    with renderer_class(scene.model) as renderer:
        frame = renderer.rgbd(scene.data, camera)
    for pose in scene.object_poses():
        pixels = interior(np.isin(frame.mask, scene.mask_ids()[pose.name]))
        points = backproject(frame, pixels)
        assert len(points) > 100
        distances = distance_to_cube_m(points, pose)
        assert np.abs(distances).max() < 2e-3
        # Half a pixel, 1.3 mm on the objects, would show in the mean.
        assert np.abs(distances).mean() < 1e-4


@needs_opengl
@pytest.mark.parametrize("camera", CAMERA_NAMES)
def test_renderers_agree(scene, camera):
    with OpenGLRenderer(scene.model) as opengl, RayCaster(scene.model) as rays:
        expected, cast = opengl.rgbd(scene.data, camera), rays.rgbd(scene.data, camera)
    assert np.mean(expected.mask == cast.mask) > 0.995
    # Away from edges and from the grazing far floor, where a pixel spans centimeters of depth
    smooth = generic_gradient_magnitude(expected.depth_m, sobel) < 0.1
    steady = interior(smooth & (expected.mask == cast.mask) & (expected.depth_m < 2.5))
    assert steady.mean() > 0.3
    difference_m = np.abs(expected.depth_m - cast.depth_m)
    # OpenGL draws the arm's round links as facets.
    arm = [scene.model.body(f"link{i}").id for i in range(8)]
    assert difference_m[steady & ~np.isin(expected.mask, arm)].max() < 1e-3
    assert np.quantile(difference_m[steady], 0.99) < 1e-3
    colors_differ = np.abs(expected.rgb.astype(int) - cast.rgb).mean()
    assert colors_differ < 40


@pytest.mark.parametrize("renderer_class", RENDERERS)
def test_sky_has_no_depth_and_no_id(scene, renderer_class):
    with renderer_class(scene.model) as renderer:
        frame = renderer.rgbd(scene.data, "front")
    assert (frame.depth_m[:20, :20] == 0).all()
    assert (frame.mask[:20, :20] == 0).all()
    assert np.abs(frame.rgb[0, 0] / 255 - SKY_RGB).max() < 0.01
    assert frame.rgb.shape == (HEIGHT_PX, WIDTH_PX, 3)


def test_calibration_is_that_of_the_compiled_camera(scene):
    for name in CAMERA_NAMES:
        camera, compiled = calibrated(name), scene.data.camera(name)
        opencv_axes = compiled.xmat.reshape(3, 3) @ np.diag([1, -1, -1])
        np.testing.assert_allclose(camera.camera_to_world[:3, :3], opencv_axes, atol=1e-9)
        np.testing.assert_allclose(camera.camera_to_world[:3, 3], compiled.xpos, atol=1e-9)
        assert abs(camera.camera_to_world[2, 0]) < 1e-12  # the horizon is level


def test_a_broken_opengl_falls_back_to_rays_and_says_why(scene, monkeypatch, caplog):
    def broken(*_):
        raise RuntimeError("no device")

    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(mujoco, "Renderer", broken)
    rendering._opengl_process.cache_clear()
    with caplog.at_level(logging.WARNING), open_renderer(scene.model) as renderer:
        assert isinstance(renderer, RayCaster)
    rendering._opengl_process.cache_clear()
    assert "no device" in caplog.text


def test_a_fork_of_a_process_that_used_opengl_casts_rays(scene, monkeypatch, caplog):
    monkeypatch.setattr(rendering, "_opengl_process", lambda: os.getpid() + 1)
    with caplog.at_level(logging.WARNING), open_renderer(scene.model) as renderer:
        assert isinstance(renderer, RayCaster)
    assert "spawn" in caplog.text


def test_without_opengl_the_simulation_imports_and_renders():
    code = """
from app.sim.demonstrate import view_scene
frame = view_scene("push_button", 0).frames[0]
print(frame.rgb.shape, len(set(frame.mask.ravel().tolist())) > 4)
"""
    environment = {**os.environ, "MUJOCO_GL": "disable"}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "(480, 640, 3) True"


@pytest.mark.parametrize(
    ("found", "loadable", "expected"),
    [
        ({"EGL", "OSMesa"}, True, "egl"),
        ({"OSMesa"}, True, "osmesa"),
        (set(), True, "disable"),
        ({"EGL", "OSMesa"}, False, "disable"),  # of another architecture
    ],
)
def test_the_backend_is_one_whose_library_loads(found, loadable, expected, monkeypatch):
    def load(_):
        if not loadable:
            raise OSError("wrong architecture")

    monkeypatch.setattr("platform.system", lambda: "Linux")
    monkeypatch.delitem(sys.modules, "mujoco")
    monkeypatch.setattr("ctypes.util.find_library", lambda name: name if name in found else None)
    monkeypatch.setattr("ctypes.CDLL", load)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    select_backend()
    assert os.environ["MUJOCO_GL"] == expected


def test_once_mujoco_is_imported_nothing_changes(monkeypatch):
    monkeypatch.setattr("platform.system", lambda: "Linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    select_backend()
    assert "MUJOCO_GL" not in os.environ


def test_the_users_choice_of_backend_stands(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    select_backend()
    assert os.environ["MUJOCO_GL"] == "glfw"
