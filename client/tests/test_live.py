"""A watched run: what the service hears, and how its Stop and its silence reach the robot."""

import threading
import time
from functools import partial

import numpy as np
import pytest
from arms import ANSWER, Arm, Service

from roboprompt_client.errors import InvalidInputError, MotionError, ServiceUnreachableError, StoppedError
from roboprompt_client.runs.live import LOST_S, Live
from roboprompt_client.runs.loop import run_task

PATIENCE_S = 5.0


class Watching(Service):
    """A service that hears of runs, and answers what `tells` says of each word."""

    def __init__(self, tells=lambda state: False, at_the_end=False):
        super().__init__(ANSWER)
        self._tells, self._at_the_end, self.heard, self.ended = tells, at_the_end, [], []

    def report_run(self, run_id, state, timeout_s):
        self.heard.append(state)
        return self._tells(state)

    def end_run(self, run_id, timeout_s):
        self.ended.append(run_id)
        return self._at_the_end


class SlowArm(Arm):
    """Its motions last until it is stopped, or for a moment."""

    def __init__(self, moves_s):
        super().__init__()
        self._moves_s, self._halted = moves_s, threading.Event()

    def execute(self, action):
        super().execute(action)
        if self._halted.wait(self._moves_s):
            raise MotionError("halted")

    def stop(self):
        super().stop()
        self._halted.set()


def run(service, arm, **how):
    return run_task(service, arm, "pick", "pick up the cube", watch=partial(Live, service, arm, **how))


def test_the_service_hears_what_is_carried_out():
    service, arm = Watching(), SlowArm(0.3)
    assert run(service, arm) is ANSWER
    said = service.heard[-1]
    assert (said["task"], said["instruction"], said["prediction_id"]) == ("pick", "pick up the cube", "p")
    assert said["action"] == 3
    assert said["target"]["position"] == [0.1, 0.2, 0.8]
    assert (len(service.ended), arm.stopped) == (1, 0)


def test_a_stop_reaches_a_motion_that_is_under_way():
    pressed = threading.Event()
    service, arm = Watching(lambda state: pressed.is_set()), SlowArm(PATIENCE_S)
    threading.Timer(0.3, pressed.set).start()
    begun_s = time.monotonic()
    with pytest.raises(StoppedError, match="a person stopped the robot"):
        run(service, arm)
    assert time.monotonic() - begun_s < PATIENCE_S / 2
    assert arm.heights == [1.0]
    assert arm.stopped >= 2
    assert len(service.ended) == 1


def test_a_stop_before_the_first_motion_lets_none_begin():
    service, arm = Watching(lambda state: True), SlowArm(0)
    asked = service.predict
    service.predict = lambda *what, **how: (time.sleep(0.3), asked(*what, **how))[1]
    with pytest.raises(StoppedError):
        run(service, arm)
    assert arm.heights == []


def test_a_stop_during_the_last_word_is_not_lost():
    service, arm = Watching(at_the_end=True), Arm()
    with pytest.raises(StoppedError):
        run(service, arm)
    assert arm.stopped == 1


def lost(state):
    raise ServiceUnreachableError("no route")


def test_lost_contact_stops_where_the_cell_says_so():
    service, arm = Watching(lost), SlowArm(2 * LOST_S)
    with pytest.raises(StoppedError, match="no contact with the service for 1 s: no route"):
        run(service, arm, on_lost="stop")
    assert arm.heights == [1.0]


def test_lost_contact_is_logged_once_where_the_run_goes_on(caplog):
    service, arm = Watching(lost), SlowArm(0.6)
    assert run(service, arm) is ANSWER
    assert [record.message for record in caplog.records] == ["the service does not hear of this run: no route"]


def test_another_error_of_the_motion_stays_what_it_is():
    service, arm = Watching(), Arm(fails_at=1, error=MotionError("blocked"))
    with pytest.raises(MotionError, match="blocked") as failed:
        run(service, arm)
    assert not isinstance(failed.value, StoppedError)
    assert len(service.ended) == 1


@pytest.mark.parametrize("broken", [MotionError("no answer"), RuntimeError("cable"), None])
def test_a_robot_that_says_where_it_is_is_heard_and_a_broken_one_can_be_stopped(broken):
    class Telling(SlowArm):
        joint_positions_rad, position_m, quaternion_xyzw = np.zeros(7), np.ones(3), np.array([1.0, 0, 0, 0])

        def state(self):
            if broken:
                raise broken
            return self

    service = Watching(lambda state: len(service.heard) > 2)
    with pytest.raises(StoppedError):
        run(service, Telling(PATIENCE_S))
    assert ("end_effector" in service.heard[0]) == (broken is None)


def test_what_a_cell_may_say():
    with pytest.raises(InvalidInputError, match=r"lost_contact: is 'halt' .*continue or stop"):
        Live(Watching(), Arm(), "pick", "pick", on_lost="halt")
