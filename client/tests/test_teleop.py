"""What a person's keys and a SpaceMouse's reports ask for."""

import socket
import struct

import numpy as np
import pytest

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.recording.teleop import DIRECTIONS, HELD_S, HeldKeys, SpaceMouse, opened


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


FULL = 350  # what a cap reports at the end of its travel


@pytest.fixture
def device():
    """Where a SpaceMouse's reports come in, each by itself, as from hidraw; no SpaceMouse was there."""
    inside, outside = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    outside.setblocking(False)
    with inside, outside:
        yield (
            SpaceMouse(outside.fileno()),
            lambda channel, *values: inside.send(bytes([channel]) + struct.pack(f"<{len(values)}h", *values)),
        )


@pytest.mark.parametrize(
    ("report", "direction"),
    [
        ((1, 0, -FULL, 0), [1, 0, 0, 0, 0, 0]),  # pushed away from the person
        ((1, FULL, 0, 0), [0, -1, 0, 0, 0, 0]),  # to the right
        ((1, 0, 0, 2 * FULL), [0, 0, -1, 0, 0, 0]),  # down
        ((2, 0, 0, -FULL), [0, 0, 0, 0, 0, 1]),  # turned to the left
        ((2, -FULL, 0, 0), [0, 0, 0, 0, 1, 0]),  # tilted forward
        ((1, 0, 0, 0, 0, 0, FULL), [0, 0, 0, 0, 0, -1]),  # all six in one report
        ((1, 10, 10, 10), [0, 0, 0, 0, 0, 0]),  # a hand that rests on it
        ((23, FULL), [0, 0, 0, 0, 0, 0]),  # its battery
    ],
)
def test_a_space_mouse_moves_the_hand_as_its_cap_is_pushed(device, report, direction):
    mouse, send = device
    send(*report)
    said = mouse.read("x")
    np.testing.assert_allclose(said.direction, direction)
    assert said.keys == "x"


def test_of_many_reports_the_last_one_counts_and_an_old_one_moves_nothing(device, monkeypatch):
    mouse, send = device
    for _ in range(10):
        send(1, 0, -FULL, 0)
        send(2, 0, 0, FULL)
    send(2, 0, 0, 0)
    np.testing.assert_allclose(mouse.read("").direction, [1, 0, 0, 0, 0, 0])
    monkeypatch.setattr("roboprompt_client.recording.teleop.STALE_S", 0.0)
    assert not mouse.read("").direction.any()


def test_the_buttons_of_a_space_mouse_close_and_open_once(device):
    mouse, send = device
    send(3, 1)
    assert [mouse.read("").keys for _ in range(3)] == ["c", "", ""]
    send(3, 2)
    assert mouse.read("").keys == "o"


def test_a_space_mouse_is_found_by_its_maker(tmp_path, monkeypatch):
    monkeypatch.setattr("roboprompt_client.recording.teleop.HIDRAW", tmp_path)
    with pytest.raises(InvalidInputError, match="no SpaceMouse is plugged in"), opened("spacemouse"):
        pass
    for name, hid_id in (("hidraw0", "0003:0000046D:0000C52B"), ("hidraw7", "0003:0000256F:0000C635")):
        (tmp_path / name / "device").mkdir(parents=True)
        (tmp_path / name / "device/uevent").write_text(f"DRIVER=hid-generic\nHID_ID={hid_id}\n")
    with pytest.raises(InvalidInputError, match=r"/dev/hidraw7 cannot be read"), opened("spacemouse"):
        pass
