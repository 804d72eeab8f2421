"""What a person's keys and a SpaceMouse's reports ask for."""

from types import SimpleNamespace

import numpy as np
import pytest

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.teleop import DIRECTIONS, HELD_S, STALE_S, HeldKeys, SpaceMouse, opened


def test_every_direction_has_two_keys():
    np.testing.assert_array_equal(sum(DIRECTIONS.values()), np.zeros(6))
    np.testing.assert_array_equal(sum(map(np.abs, DIRECTIONS.values())), np.full(6, 2.0))
    assert not set(DIRECTIONS) & set("ocx \n")  # which the recording has


def test_a_key_moves_for_as_long_as_it_is_held_faster_and_faster():
    keys = HeldKeys()
    for now_s in np.arange(0, 2, 0.04):
        keys.press("w", now_s)
    assert keys.direction(now_s)[0] == 1.0
    assert keys.direction(now_s + HELD_S)[0] == 0.0
    keys.press("w", 5.0)
    keys.press("d", 5.0)
    np.testing.assert_allclose(keys.direction(5.0), [0.2, -0.2, 0, 0, 0, 0])


class Device:
    """What pyspacemouse says, of a cap that is pushed away and down."""

    def __init__(self):
        self.state = SimpleNamespace(x=0.5, y=0.04, z=-1.4, roll=0.0, pitch=0.0, yaw=0.3, buttons=[0, 0], t=10.0)

    def read(self):
        return self.state


def test_a_space_mouse_moves_the_hand_as_its_cap_is_pushed():
    mouse = SpaceMouse(Device(), clock=lambda: 10.1)
    np.testing.assert_allclose(mouse.read("x").direction, [0.5, 0, -1, 0, 0, 0.3])
    assert mouse.read("x").keys == "x"


def test_a_space_mouse_that_was_unplugged_moves_nothing():
    assert not SpaceMouse(Device(), clock=lambda: 10.01 + STALE_S).read("").direction.any()


def test_the_buttons_of_a_space_mouse_close_and_open_once():
    device = Device()
    mouse = SpaceMouse(device, clock=lambda: 10.1)
    device.state.buttons = [1, 0]
    assert [mouse.read("").keys for _ in range(3)] == ["c", "", ""]
    device.state.buttons = [0, 1]
    assert mouse.read("").keys == "o"
    device.state.buttons = []  # of a device without any
    assert mouse.read("").keys == ""


def test_no_space_mouse_is_said(monkeypatch):
    def fail(axis_convention):
        assert axis_convention == "ros"
        raise RuntimeError("No device connected/supported")

    package = SimpleNamespace(open=fail, AxisConvention=SimpleNamespace(ROS="ros"))
    monkeypatch.setattr("roboprompt_client.teleop.import_extra", lambda *_: package)
    with pytest.raises(InvalidInputError, match="no SpaceMouse: No device connected"), opened("spacemouse"):
        pass
