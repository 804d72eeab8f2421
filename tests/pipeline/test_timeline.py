import numpy as np

from app.pipeline.episode import frame_times_s, stretches
from roboprompt_client.trajectory import Trajectory


def trajectory(timestamps_s=None):
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (6, 1))
    return Trajectory(np.zeros((6, 7)), np.zeros((6, 3)), quaternions, np.array([1, 1, 1, 0, 0, 1]), timestamps_s)


def test_times_come_from_timestamps_or_from_the_frequency():
    np.testing.assert_allclose(frame_times_s(trajectory(), 20.0)[:3], [0, 0.05, 0.1])
    np.testing.assert_allclose(frame_times_s(trajectory([5.0, 5.1, 5.3, 5.4, 5.5, 5.6]), 20.0)[:3], [0, 0.1, 0.3])


def test_the_gripper_s_stretches_cover_the_trajectory():
    assert stretches(trajectory().gripper_open) == [(0, 3, True), (3, 5, False), (5, 6, True)]
