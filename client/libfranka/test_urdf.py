"""An arm by its URDF: pinocchio comes with franky-sim, and so does a Research 3's file."""

import numpy as np
import pytest
from franky_sim import FR3_URDF

from roboprompt_client.arms.geometry import UrdfGeometry
from roboprompt_client.arms.panda import PandaGeometry, flange
from roboprompt_client.errors import InvalidInputError, MotionError

DOWN = np.array([1.0, 0, 0, 0])
FRAME = "link8"
BARE = PandaGeometry("fr3", np.eye(4))
BARE_FLANGE, _ = flange(BARE.ready_rad)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_text(FR3_URDF)
    return path


@pytest.fixture(scope="module")
def geometry(file):
    return UrdfGeometry(file, FRAME)


def test_a_research_3_s_file_says_what_our_geometry_says(geometry):
    for position_m in ([0.4, 0.2, 0.4], [0.5, -0.2, 0.3], [0.3, 0.0, 0.6]):
        joints, ours = (item.way(BARE.ready_rad, np.array(position_m), DOWN) for item in (geometry, BARE))
        np.testing.assert_allclose(joints, ours, atol=1e-3)
        assert geometry.nearest_limit(joints).joint == BARE.nearest_limit(ours).joint


def test_what_it_cannot_reach_is_refused(geometry):
    with pytest.raises(MotionError, match=r"joint \d would come to|out of reach"):
        geometry.way(BARE.ready_rad, np.array([1.2, 0, 0.4]), DOWN)
    with pytest.raises(MotionError, match="reports 6 joints, its URDF has 7"):
        geometry.way(np.zeros(6), np.array([0.4, 0, 0.4]), DOWN)


def test_the_frame_of_angles_by_name_whatever_their_order(geometry):
    joints = dict(zip((f"joint{k}" for k in range(1, 8)), BARE.ready_rad, strict=True))
    angles = {"gripper": 1.0, **dict(reversed(joints.items()))}
    np.testing.assert_allclose(geometry.frame(angles), BARE_FLANGE, atol=1e-4)
    del angles["joint3"]
    with pytest.raises(MotionError, match="joints joint3 are not among gripper, joint7"):
        geometry.frame(angles)


def test_what_is_no_urdf_is_refused(file, tmp_path):
    with pytest.raises(InvalidInputError, match=r"urdf_frame.*link8"):
        UrdfGeometry(file, "gripper")
    (tmp_path / "no.urdf").write_text("no")
    with pytest.raises(InvalidInputError, match="a URDF file"):
        UrdfGeometry(tmp_path / "no.urdf", FRAME)
