"""A recording is what the arm's state was, and a folder that can be sent again."""

import io
import json
import time
from dataclasses import replace

import httpx
import numpy as np
import pytest
from arms import client_of

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.errors import InvalidInputError, MotionError, ServiceUnreachableError
from roboprompt_client.recording import Recorder, upload_recording, write_recording
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import npz_from_trajectory

FRONT = RgbdFrame(Camera("front", 5, 5, 2, 2, np.eye(4)), np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), np.float32))
SCENE = Observation(ObjectPose("cube", np.array([0.4, 0, 0.1])), FRONT)
PICK = {"task": "pick", "instruction": "pick up the cube", "corrects": None}


class Guided:
    """An arm that a person leads down; its fingers close half-way."""

    def __init__(self, joints=6, breaks_after=None, **gripper):
        self.broken = False
        self._began_s, self._joints, self._left, self._gripper = time.monotonic(), joints, breaks_after, gripper

    def state(self):
        if (left := self._left) is not None:
            self._left = left - 1
            if left == 0:
                self.broken = True
                raise MotionError("the cable is out")
        t = time.monotonic() - self._began_s
        angles = None if self._joints == 0 else np.full(self._joints, t)
        width_m = 0.08 if t < 0.15 else 0.02
        gripper = self._gripper or {"gripper_width_m": width_m}
        felt = np.array([0, 0, 10 * t, 0, 0, 0.1]) if self._joints == 7 else None
        hand = (np.array([0.4, 0, 0.5 - t]), np.array([1.0, 0, 0, 0]))
        return ArmState(*hand, angles, None, wrench_n_nm=felt, **gripper)


def record(arm, seconds=0.3):
    recorder = Recorder(arm, 100)
    recorder.start()
    time.sleep(seconds)
    return recorder.stop()


def test_forces_are_recorded_and_uploaded_where_the_arm_tells_them():
    trajectory = record(Guided(7))
    felt = np.load(io.BytesIO(npz_from_trajectory(trajectory)))["wrenches"]
    np.testing.assert_allclose(felt[:, 2], 10 * (0.5 - trajectory.positions_m[:, 2]))
    np.testing.assert_array_equal(felt[:, 5], 0.1)
    assert record(Guided()).wrenches_n_nm is None


class SlowClock(Guided):
    """A simulated arm on a busy machine: half as much time passes for it."""

    def state(self):
        state = super().state()
        return replace(state, time_s=100.0 + state.joint_positions_rad[0] / 2)


def test_an_arm_s_own_clock_gives_the_times():
    trajectory = record(SlowClock())
    times_s = trajectory.timestamps_s
    assert times_s[0] == 0
    np.testing.assert_allclose(2 * np.diff(times_s), np.diff(trajectory.joint_positions_rad[:, 0]), atol=1e-9)


def test_a_guided_arm_with_measured_fingers():
    trajectory = record(Guided())
    assert len(trajectory) >= 20 * 0.3
    assert trajectory.num_joints == 6
    angles_rad, times_s = trajectory.joint_positions_rad, trajectory.timestamps_s
    np.testing.assert_allclose(np.ptp(angles_rad, axis=0), np.ptp(times_s), rtol=0.05)  # 1 rad/s by the arm's own clock
    np.testing.assert_allclose(trajectory.joint_velocities_rad_s, np.gradient(angles_rad, times_s, axis=0))
    assert trajectory.gripper_open[0]
    assert not trajectory.gripper_open[-1]


@pytest.mark.parametrize("gripper", [{"gripper_open": True}, {"gripper_width_m": None}, {"gripper_width_m": 0.08}])
def test_a_gripper_that_is_not_there_or_does_not_move_counts_as_open(gripper):
    trajectory = record(Guided(0, **gripper), 0.1)
    assert trajectory.gripper_open.all()
    assert trajectory.num_joints == 0


@pytest.mark.parametrize("gripper", [{"gripper_open": False}, {"gripper_width_m": 0.0}])
def test_fingers_that_stay_closed_are_closed(gripper):
    assert not record(Guided(**gripper), 0.1).gripper_open.any()


def test_an_arm_that_falls_silent_ends_the_recording():
    arm = Guided(breaks_after=12)
    recorder = Recorder(arm, 100)
    recorder.start()
    while not arm.broken:
        time.sleep(0.01)
    with pytest.raises(MotionError, match="cable"):
        recorder.stop()


def test_a_rate_that_misses_keyframes_is_refused():
    with pytest.raises(InvalidInputError, match="20 to 1000"):
        Recorder(Guided(), 5)


def test_a_recording_is_sent_again_with_the_same_key_and_content(tmp_path):
    trajectory, keys, bodies = record(Guided(), 0.1), [], []

    def answer(request):
        keys.append(request.headers["Idempotency-Key"])
        bodies.append(request.read())
        if len(keys) == 1:
            raise httpx.ReadError("cut")
        return httpx.Response(201, json={"id": "e1"})

    folder = write_recording(tmp_path / "recordings", PICK, trajectory, SCENE)
    client = client_of(answer)
    with pytest.raises(ServiceUnreachableError, match="cut"):
        upload_recording(client, folder)
    stored = upload_recording(client, folder)
    assert (stored, keys) == ({"id": "e1"}, [folder.name] * 2)
    for part in ("metadata", "trajectory", "rgb_front", "depth_front"):
        assert f'name="{part}"; filename='.encode() in bodies[-1]
    assert b'"cameras": [{"name": "front"' in bodies[-1]
    assert npz_from_trajectory(trajectory) in bodies[-1]
    assert json.loads((folder / "metadata.json").read_text())["instruction"] == "pick up the cube"


def test_a_recording_that_was_not_written_to_its_end_is_not_sent(tmp_path, monkeypatch):
    def full(path, data):
        raise OSError("No space left on device")

    trajectory = record(Guided(), 0.1)
    with monkeypatch.context() as patched:
        patched.setattr("pathlib.Path.write_bytes", full)
        with pytest.raises(InvalidInputError, match=r"No space left on device \(valid: a disk with space"):
            write_recording(tmp_path, PICK, trajectory, SCENE)
    assert list(tmp_path.iterdir()) == []
    begun = write_recording(tmp_path, PICK, trajectory, SCENE).rename(tmp_path / "broken.part")
    for folder in (begun, tmp_path, tmp_path / "none"):
        with pytest.raises(InvalidInputError, match="is not a finished recording"):
            upload_recording(client_of(lambda request: pytest.fail("sent")), folder)
