"""pyspacemouse's own reading of raw reports; no SpaceMouse was there."""

import struct

import numpy as np
import pyspacemouse

from roboprompt_client.teleop import SpaceMouse

FULL = 350  # what a cap reports at the end of its travel


def mouse_after(*reports):
    class Hid:
        def read(self, _):
            return waiting.pop(0) if waiting else b""

    waiting = [bytes([channel]) + struct.pack("<3h", *values) for channel, *values in reports]
    spec = pyspacemouse.get_device_specs()["SpaceMouseCompact"]
    info = pyspacemouse.apply_axis_convention(spec, pyspacemouse.AxisConvention.ROS)
    return SpaceMouse(pyspacemouse.SpaceMouseDevice(info, Hid()))


def test_a_cap_that_is_pushed_away_moves_the_hand_away_from_the_base():
    """Its reports have x to the right, y to the person, z down."""
    np.testing.assert_allclose(mouse_after((1, 0, -FULL, 0)).read("").direction, [1, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(mouse_after((1, FULL, 0, 0)).read("").direction, [0, -1, 0, 0, 0, 0])
    np.testing.assert_allclose(mouse_after((1, 0, 0, FULL)).read("").direction, [0, 0, -1, 0, 0, 0])
    np.testing.assert_allclose(mouse_after((2, 0, 0, -FULL)).read("").direction, [0, 0, 0, 0, 0, 1])


def test_of_many_reports_the_last_one_counts():
    mouse = mouse_after(*([(1, 0, -FULL, 0), (2, 0, 0, FULL)] * 10), (1, 0, 0, 0), (2, 0, 0, 0))
    assert not mouse.read("").direction.any()
    assert mouse_after((3, 1, 0, 0)).read("").keys == "c"
