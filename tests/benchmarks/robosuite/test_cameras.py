"""The cameras around robosuite's table: their calibration, as MuJoCo has it, and which body a pixel belongs to."""

import mujoco
import numpy as np
import pytest

from benchmarks.robosuite import cameras

LOOKED_AT_M = (0.1, -0.25, 0.8)
TABLE_AND_NUT = """
<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="nut_main">
    <geom type="box" size=".1 .1 .1"/>
    <body><geom type="box" size=".1 .1 .1" pos=".2 0 0"/></body>
  </body>
  <body name="peg1"><geom type="box" size=".1 .1 .1" pos="0 1 0"/></body>
  <body name="robot"><geom type="box" size=".1 .1 .1" pos="0 -1 0"/></body>
</worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(TABLE_AND_NUT)


@pytest.mark.parametrize("name", cameras.AZIMUTHS_DEG)
def test_the_calibration_is_that_of_mujocos_camera(model, name):
    view = cameras.view_from(cameras.AZIMUTHS_DEG[name], LOOKED_AT_M)
    data, scene = mujoco.MjData(model), mujoco.MjvScene(model, 100)
    mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eyes = scene.camera  # one for each eye, at nearly one place
    camera = cameras.camera_of(name, view)
    forward, up = np.array(eyes[0].forward), np.array(eyes[0].up)
    np.testing.assert_allclose(camera.camera_to_world[:3, 2], forward, atol=1e-6)
    np.testing.assert_allclose(camera.camera_to_world[:3, 1], -up, atol=1e-6)
    np.testing.assert_allclose(camera.camera_to_world[:3, 3], (np.array(eyes[0].pos) + eyes[1].pos) / 2, atol=1e-6)
    assert np.linalg.det(camera.camera_to_world[:3, :3]) == pytest.approx(1)
    assert model.vis.global_.fovy == cameras.VERTICAL_FIELD_DEG


def test_a_pixel_belongs_to_the_named_body_on_which_its_part_is_mounted(model):
    assert cameras.mask_ids(model, ["peg1", "nut_main"]).tolist() == [0, 2, 2, 1, 0]
