"""Rows that follow the direction from one object to another, as pushes do."""

from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.object_frame import ObjectFrameCodec
from tests.pipeline.asking import parse_reply

from ..gbnf import matches
from ..scenes import WORKSPACE, action, angle_deg, demonstration, pose

PUSH = "push the {} to the {}"
BEHIND_M, BEFORE_M = 0.09, 0.05  # of the block's center, and of the goal's
ROWS = "1 A ow>B: -18 +0 +20 0 36 36 0; 2 A ow>B: -18 +0 +2 0; 3 B ow>A: +10 +0 +2 0"


def pushed(block_m, way_m, *, hand_turns=False, names=("block", "goal"), noise_m=0.0, random=None):
    """The hand comes down behind a block and pushes it until it is before the goal."""
    block_m, way_m = np.array([*block_m, 0.7]), np.array([*way_m, 0.0])
    ahead, goal_m = way_m / np.linalg.norm(way_m), block_m + way_m
    yaw_deg = float(np.degrees(np.arctan2(ahead[1], ahead[0]))) if hand_turns else 0.0
    behind_m, end_m = block_m - BEHIND_M * ahead, goal_m - BEFORE_M * ahead
    hand_m = np.add([behind_m, behind_m, end_m], [[0, 0, 0.1], [0, 0, 0.01], [0, 0, 0.01]])
    rows = [action(at_m, (180, 0, yaw_deg), False) for at_m in hand_m]
    off_m = np.zeros((2, 3)) if random is None else random.normal(0, noise_m, (2, 3))
    objects = [pose(name, at_m) for name, at_m in zip(names, np.array([block_m, goal_m]) + off_m, strict=True)]
    return replace(demonstration(PUSH.format(*names), objects, rows), plan=0)


def pushes(number=5, *, seed=3, spread_deg=360.0, far_m=(0.1, 0.3), **options):
    random = np.random.default_rng(seed)
    shown = []
    for k in range(number):
        angle_rad = np.radians(spread_deg * k / number)
        way_m = random.uniform(*far_m) * np.array([np.cos(angle_rad), np.sin(angle_rad)])
        shown.append(pushed(random.uniform(-0.2, 0.2, 2), way_m, random=random, **options))
    return shown


def fitted(shown):
    return ObjectFrameCodec.fit(shown, WORKSPACE, True)


@pytest.mark.parametrize("number", [3, 5, 10])
def test_pushes_in_all_directions_are_the_same_rows(number):
    codec = fitted(shown := pushes(number))
    assert {codec.actions_text(item) for item in shown} == {ROWS}


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_half_a_centimeter_hides_no_direction(seed):
    shown = pushes(10, seed=seed, noise_m=0.005, far_m=(0.2, 0.3))
    rows = fitted(shown).table[0]
    assert [(row.anchor.object_name, row.anchor.toward) for row in rows] == [("block", "goal")] * 2 + [
        ("goal", "block")
    ]


@pytest.mark.parametrize(
    "shown",
    [pushes(2), pushes(spread_deg=5.0), pushes(far_m=(0.03, 0.04)), [pushed((0.1, 0.1), (0.2, 0.1))]],
    ids=["two", "one direction", "objects too near", "one"],
)
def test_without_evidence_no_row_follows_a_direction(shown):
    assert not any(row.anchor.toward for rows in fitted(shown).table for row in rows)


@pytest.mark.parametrize("names", [("block", "goal"), ("goal", "block")])
@pytest.mark.parametrize("way_m", [(0.2, 0.0), (-0.1, 0.12), (0.0, -0.3)])
def test_a_copied_push_goes_to_where_the_goal_is(way_m, names):
    asked = pushed((0.05, -0.02), way_m, names=names)
    codec = fitted(shown := pushes())
    query = Query(asked.instruction, asked.objects)
    reply = f" {codec.actions_text(shown[0])}\n"
    assert matches(codec.grammar(query, 25), reply)
    for got, meant in zip(parse_reply(reply, codec, query.objects, query.instruction), asked.actions, strict=True):
        np.testing.assert_allclose(got.position_m, meant.position_m, atol=1e-6)
        assert angle_deg(got.quaternion_xyzw, meant.quaternion_xyzw) < 1e-6


def test_only_directions_that_demonstrations_have_are_accepted():
    codec = fitted(shown := pushes())
    reply = codec.actions_text(shown[0]).replace("B ow>A", "B o>A")
    with pytest.raises(ReplyParseError, match="relative to B o>A, expected one of"):
        parse_reply(f" {reply}\n", codec, shown[0].objects, shown[0].instruction)
