import numpy as np
import pytest
from app.pipeline.findings.frames import Compared
from scipy.spatial.transform import Rotation

from roboprompt_client.types.poses import ObjectPose


def pose(x_m=0.0, yaw_deg=None):
    turn = None if yaw_deg is None else Rotation.from_euler("z", yaw_deg, degrees=True).as_quat()
    return ObjectPose("mug", np.array([x_m, 0, 0]), turn)


@pytest.mark.parametrize(
    ("given", "found", "turn_deg", "agrees"),
    [
        (pose(0.0), pose(0.014), None, True),
        (pose(0.0), pose(0.016), None, False),
        (pose(0, 10), pose(0, -4), None, True),
        (pose(0, 10), pose(0, 100), None, False),
        (pose(0, 10), pose(0, 96), 90.0, True),
        (pose(0, 170), pose(0, -4), 180.0, True),
        (pose(0, 10), pose(0, 130), 0.0, True),
        (pose(0, 10), pose(0), None, True),
    ],
)
def test_a_given_and_a_found_pose_agree_within_noise_and_symmetry(given, found, turn_deg, agrees):
    assert Compared(given, found, turn_deg).agrees is agrees
