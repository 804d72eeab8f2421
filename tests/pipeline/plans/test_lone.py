"""A demonstration that acts with its hand turned otherwise is a plan of its own."""

from dataclasses import replace

import numpy as np

from app.pipeline.plans.ways import lone_way

from ..scenes import action, demonstration, pose


def put_down(number, release_deg):
    cup_m = np.array([0.05 * number, 0.1, 0.7])
    actions = [
        action(cup_m + np.array([0, 0, 0.1]), (180, 0, 10)),
        action(cup_m, (180, 0, 10), gripper_open=False),
        action((0.4, 0.2, 0.75), (180, 0, release_deg)),
    ]
    objects = [pose("cup", cup_m, 10), pose("plate", (0.4, 0.2, 0.7), 0)]
    shown = demonstration("put the cup on the plate", objects, actions)
    return replace(shown, plan=0)


def test_one_hand_turned_otherwise_at_the_release_is_alone():
    assert lone_way([put_down(k, 100 if k == 2 else 10) for k in range(5)]) == 2


def test_among_few_or_in_like_or_in_scattered_ways_none_is_alone():
    assert lone_way([put_down(k, 100 if k == 2 else 10) for k in range(3)]) is None
    assert lone_way([put_down(k, 10 + 5 * k) for k in range(5)]) is None
    assert lone_way([put_down(k, 72 * k) for k in range(5)]) is None
    assert lone_way([put_down(k, 100 * (k % 2)) for k in range(6)]) is None
