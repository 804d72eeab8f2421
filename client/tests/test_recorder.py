"""A recording survives what happens to it."""

import errno
import io
import json
import os
import stat
import time
from dataclasses import replace

import httpx
import numpy as np
import pytest
from arms import client_of

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.errors import InvalidInputError, MotionError, ServiceUnreachableError
from roboprompt_client.recording.journal import trajectory_from_journal
from roboprompt_client.recording.recorder import Recorder
from roboprompt_client.recording.spool import JOURNAL, Spool
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import npz_from_trajectory

FRONT = RgbdFrame(Camera("front", 5, 5, 2, 2, np.eye(4)), np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), np.float32))
SCENE = Observation(ObjectPose("cube", np.array([0.4, 0, 0.1])), FRONT)


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


def record(arm, journal, seconds=0.3):
    recorder = Recorder(arm, journal, 100)
    recorder.start()
    time.sleep(seconds)
    return recorder.stop()


def test_forces_are_recorded_and_uploaded_where_the_arm_tells_them(tmp_path):
    trajectory = record(Guided(7), tmp_path / "journal")
    felt = np.load(io.BytesIO(npz_from_trajectory(trajectory)))["wrenches"]
    np.testing.assert_allclose(felt[:, 2], 10 * (0.5 - trajectory.positions_m[:, 2]))
    np.testing.assert_array_equal(felt[:, 5], 0.1)
    assert record(Guided(), tmp_path / "without").wrenches_n_nm is None


class SlowClock(Guided):
    """A simulated arm on a busy machine: half as much time passes for it."""

    def state(self):
        state = super().state()
        return replace(state, time_s=100.0 + state.joint_positions_rad[0] / 2)


def test_an_arm_s_own_clock_gives_the_times(tmp_path):
    trajectory = record(SlowClock(), tmp_path / "journal")
    times_s = trajectory.timestamps_s
    assert times_s[0] == 0
    np.testing.assert_allclose(2 * np.diff(times_s), np.diff(trajectory.joint_positions_rad[:, 0]), atol=1e-9)


def test_a_guided_arm_with_measured_fingers(tmp_path):
    trajectory = record(Guided(), tmp_path / "journal")
    assert len(trajectory) >= 20 * 0.3
    assert trajectory.num_joints == 6
    angles_rad, times_s = trajectory.joint_positions_rad, trajectory.timestamps_s
    np.testing.assert_allclose(np.ptp(angles_rad, axis=0), np.ptp(times_s), rtol=0.05)  # 1 rad/s by the arm's own clock
    np.testing.assert_allclose(trajectory.joint_velocities_rad_s, np.gradient(angles_rad, times_s, axis=0))
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
        self.body = request.read()
        answer = self._answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def client(self):
        return client_of(self)


@pytest.fixture
def spooled(tmp_path):
    spool = Spool(tmp_path)
    folder = spool.new("pick", "pick up the cube", SCENE)
    record(Guided(), folder / JOURNAL, 0.1)
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


def test_what_was_seen_is_uploaded_with_it(spooled):
    spool, folder = spooled
    service = Service(httpx.Response(201, json={"id": "e1"}))
    spool.send(service.client(), folder)
    for part in ("metadata", "trajectory", "rgb_front", "depth_front"):
        assert f'name="{part}"; filename='.encode() in service.body
    assert b'"cameras": [{"name": "front"' in service.body
    stream = io.BytesIO()
    np.save(stream, FRONT.depth_m)
    assert stream.getvalue() in service.body


@pytest.fixture
def full(monkeypatch):
    def create(path):
        raise OSError(errno.ENOSPC, "No space left on device")

    def fill():
        monkeypatch.setattr("roboprompt_client.recording.spool.create_private", create)

    return fill


def test_a_full_disk_leaves_nothing_half_written(full, tmp_path):
    spool = Spool(tmp_path)
    full()
    with pytest.raises(InvalidInputError, match=r"No space left on device \(valid: .* on a disk with space"):
        spool.new("pick", "pick up the cube", SCENE)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_loses_no_answer(full, spooled, caplog):
    spool, folder = spooled
    full()
    assert spool.send(Service(httpx.Response(201, json={"id": "e1"})).client(), folder).stored
    assert "the answer is not noted" in caplog.text
    assert list(spool.waiting()) == [folder]  # and goes again with the same key


def test_recordings_are_for_their_user_alone(tmp_path):
    before = os.umask(0)
    try:
        spool = Spool(tmp_path / "spool")
        folder = spool.new("pick", "pick up the cube", SCENE)
        record(Guided(), folder / JOURNAL, 0.1)
        spool.send(Service(httpx.Response(422, json={"title": "No"})).client(), folder)
    finally:
        os.umask(before)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "spool").rglob("*")}
    assert modes.pop(folder.name) == 0o700
    assert stat.S_IMODE((tmp_path / "spool").stat().st_mode) == 0o700
    assert set(modes) == {"scene.json", "journal", "rgb_front.npy", "depth_front.npy", "refused.json"}
    assert set(modes.values()) == {0o600}


def test_a_spool_that_was_open_to_others_is_closed(tmp_path):
    (tmp_path / "spool").mkdir(mode=0o755)
    Spool(tmp_path / "spool")
    assert stat.S_IMODE((tmp_path / "spool").stat().st_mode) == 0o700


@pytest.fixture
def secret(tmp_path_factory):
    path = tmp_path_factory.mktemp("home") / "id_ed25519"
    path.write_bytes(b"PRIVATE KEY")
    return path


def send_nothing(spool, folder, match):
    service = Service()
    with pytest.raises(InvalidInputError, match=match):
        spool.send(service.client(), folder, lambda _: None)
    assert service.keys == []


@pytest.mark.parametrize("name", ["scene.json", "journal", "rgb_front.npy", "mask_front.npy"])
@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_links_are_not_followed(spooled, secret, name, link):
    spool, folder = spooled
    (folder / name).unlink(missing_ok=True)
    link(secret, folder / name)
    send_nothing(spool, folder, "is a link")


def test_a_folder_that_is_a_link_is_not_followed(spooled, tmp_path_factory):
    spool, folder = spooled
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    folder.rename(elsewhere / "recording")
    folder.symlink_to(elsewhere / "recording")
    send_nothing(spool, folder, "is a link")


def test_a_prepared_scene_names_no_files(spooled, secret):
    """It is the service's to refuse what it does not know; nothing but the recording is read."""
    spool, folder = spooled
    scene = json.loads((folder / "scene.json").read_text())
    prepared = {**scene, "parts": {"rgb_front": [str(secret), "text/plain"], "rgb_side": ["../../id", "text/plain"]}}
    (folder / "scene.json").write_text(json.dumps(prepared))
    service = Service(httpx.Response(422, json={"title": "No"}))
    spool.send(service.client(), folder)
    assert b"PRIVATE KEY" not in service.body


def test_what_others_may_write_is_not_sent(spooled):
    spool, folder = spooled
    (folder / "scene.json").chmod(0o666)
    send_nothing(spool, folder, "may be written by others")
    (folder / "scene.json").chmod(0o600)
    folder.chmod(0o777)
    send_nothing(spool, folder, "may be written by others")


def test_what_another_user_wrote_is_not_sent(spooled, monkeypatch):
    spool, folder = spooled
    own = os.getuid()
    monkeypatch.setattr("roboprompt_client.recording.spool.os.getuid", lambda: own + 1)
    send_nothing(spool, folder, "belongs to another user")


def test_a_journal_is_never_written_over(tmp_path, secret):
    (tmp_path / "journal").symlink_to(secret.with_name("nothing-yet"))
    recorder = Recorder(Guided(), tmp_path / "journal", 100)
    recorder.start()
    with pytest.raises(InvalidInputError, match="journal"):
        recorder.stop()
    assert not secret.with_name("nothing-yet").exists()
