"""A recording survives what happens to it."""

import json
import time

import httpx
import numpy as np
import pytest

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, MotionError, ServiceUnreachableError
from roboprompt_client.recorder import Recorder, trajectory_from_journal
from roboprompt_client.robot import Observation
from roboprompt_client.spool import JOURNAL, Spool
from roboprompt_client.trajectory import ObjectPose

SCENE = Observation((ObjectPose("cube", np.array([0.4, 0, 0.1])),))


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
        return ArmState(np.array([0.4, 0, 0.5 - t]), np.array([1.0, 0, 0, 0]), angles, None, **gripper)


def record(arm, journal, seconds=0.3):
    recorder = Recorder(arm, journal, 100)
    recorder.start()
    time.sleep(seconds)
    return recorder.stop()


def test_a_guided_arm_with_measured_fingers(tmp_path):
    trajectory = record(Guided(), tmp_path / "journal")
    assert len(trajectory) >= 20 * 0.3
    assert trajectory.num_joints == 6
    assert np.median(trajectory.joint_velocities_rad_s) == pytest.approx(1.0, abs=0.05)
    assert trajectory.gripper_open[0]
    assert not trajectory.gripper_open[-1]


@pytest.mark.parametrize("gripper", [{"gripper_open": True}, {"gripper_width_m": None}, {"gripper_width_m": 0.08}])
def test_a_gripper_that_is_not_there_or_does_not_move_counts_as_open(tmp_path, gripper):
    trajectory = record(Guided(0, **gripper), tmp_path / "journal", 0.1)
    assert trajectory.gripper_open.all()
    assert trajectory.num_joints == 0


def test_fingers_that_stay_closed_are_closed(tmp_path):
    assert not record(Guided(gripper_width_m=0.0), tmp_path / "journal", 0.1).gripper_open.any()


def test_what_was_recorded_before_the_arm_fell_silent_is_kept(tmp_path):
    arm = Guided(breaks_after=12)
    recorder = Recorder(arm, tmp_path / "journal", 100)
    recorder.start()
    while not arm.broken:
        time.sleep(0.01)
    with pytest.raises(MotionError, match="cable"):
        recorder.stop()
    assert len(trajectory_from_journal(tmp_path / "journal")) == 12


def test_a_crash_in_the_middle_of_a_row_costs_that_row(tmp_path):
    whole = record(Guided(), tmp_path / "journal")
    cut = tmp_path / "cut"
    cut.write_bytes((tmp_path / "journal").read_bytes()[:-5])
    assert len(trajectory_from_journal(cut)) == len(whole) - 1
    for spoilt in (b"", b"{}\n", b'{"joints": 6}\n'):
        cut.write_bytes(spoilt)
        with pytest.raises(InvalidInputError):
            trajectory_from_journal(cut)


def test_a_rate_that_misses_keyframes_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="20 to 1000"):
        Recorder(Guided(), tmp_path / "journal", 5)


class Service:
    """Answers as the test says, one after the other, and notes the keys."""

    def __init__(self, *answers):
        self._answers, self.keys = list(answers), []

    def __call__(self, request):
        self.keys.append(request.headers["Idempotency-Key"])
        answer = self._answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def client(self):
        return RoboPromptClient(connection=httpx.Client(transport=httpx.MockTransport(self), base_url="http://robots"))


@pytest.fixture
def spooled(tmp_path):
    spool = Spool(tmp_path)
    folder = spool.new("pick", "pick up the cube", SCENE)
    record(Guided(), folder / JOURNAL, 0.3)
    return spool, folder


def test_a_recording_waits_until_the_service_has_it(spooled):
    spool, folder = spooled
    service = Service(httpx.ConnectError("refused"), httpx.ReadError("cut"), httpx.Response(201, json={"id": "e1"}))
    waits = []
    sent = spool.send(service.client(), folder, waits.append)
    assert (sent.stored, sent.answer["id"], waits) == (True, "e1", [1.0, 2.0])
    assert service.keys == [folder.name] * 3  # one key: it is stored once
    assert list(spool.waiting()) == []


def test_a_service_that_stays_away_leaves_it_waiting(spooled):
    spool, folder = spooled
    with pytest.raises(ServiceUnreachableError):
        spool.send(Service(*[httpx.ConnectError("refused")] * 5).client(), folder, lambda _: None)
    assert list(Spool(folder.parent).waiting()) == [folder]


@pytest.mark.parametrize("status", [401, 403, 429, 503])
def test_a_service_that_takes_nothing_from_this_robot_leaves_it_waiting(spooled, status):
    spool, folder = spooled
    with pytest.raises(ServiceUnreachableError):
        spool.send(Service(httpx.Response(status, json={"title": "No"})).client(), folder, lambda _: None)
    assert list(spool.waiting()) == [folder]


def test_a_refusal_is_kept_beside_it(spooled):
    spool, folder = spooled
    problem = {"title": "Unprocessable", "detail": "cube: no such object"}
    sent = spool.send(Service(httpx.Response(422, json=problem)).client(), folder)
    assert (sent.stored, sent.answer["detail"]) == (False, "cube: no such object")
    assert json.loads((folder / "refused.json").read_text())["title"] == "Unprocessable"
    assert list(spool.waiting()) == []
    spool.discard(folder)
    assert not folder.exists()
