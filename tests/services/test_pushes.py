"""Pushes to a goal: actions follow the direction from one object to another, from the upload to the answer."""

import asyncio

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.services.predict.request import PredictRequest
from app.services.teach.upload_checks import Upload
from tests.episodes import rests_at

PUSH = "push the block to the goal"
BEHIND_M, BEFORE_M, TABLE_M = 0.09, 0.05, 0.8


def scene(block_m, way_m):
    """The block and the goal, and where the hand goes: above behind the block, down, to before the goal, up."""
    block_m, way_m = np.array([*block_m, TABLE_M]), np.array([*way_m, 0.0])
    goal_m, ahead = block_m + way_m, way_m / np.linalg.norm(way_m)
    behind_m, end_m, above_m = block_m - BEHIND_M * ahead, goal_m - BEFORE_M * ahead, np.array([0, 0, 0.15])
    objects = tuple(ObjectQuery(name, tuple(at_m.tolist())) for name, at_m in (("block", block_m), ("goal", goal_m)))
    return objects, [behind_m + above_m, behind_m, end_m, end_m + above_m]


@pytest.fixture
def taught(nearest):
    random = np.random.default_rng(8)
    for number in range(8):
        angle_rad = np.pi * number / 4
        way_m = random.uniform(0.15, 0.3) * np.array([np.cos(angle_rad), np.sin(angle_rad)])
        objects, ways_m = scene(random.uniform(-0.1, 0.1, 2), way_m)
        recorded = rests_at([(0.0, 0.0, 1.2, False), (0.0, 0.0, 1.2, False), *((*at_m, False) for at_m in ways_m)])
        nearest.upload_episode(Upload("push", Episode(PUSH, recorded), objects, {}))
    return nearest


def predicted(services, objects):
    return asyncio.run(services.predict_actions(PredictRequest("push", PUSH, objects)))


@pytest.mark.parametrize("angle_deg", [20, 110, 200, 290])
def test_a_block_is_pushed_in_directions_that_no_demonstration_has(taught, angle_deg):
    angle_rad = np.radians(angle_deg)
    objects, ways_m = scene((0.05, -0.02), 0.22 * np.array([np.cos(angle_rad), np.sin(angle_rad)]))
    prediction = predicted(taught, objects)
    actions = prediction.reply.actions
    np.testing.assert_allclose([item.action.position_m for item in actions], ways_m, atol=0.003)
    anchors = [item.document["anchor"] for item in actions]
    assert [(anchor["object"], anchor["frame"], anchor["toward"]) for anchor in anchors] == [
        ("block", "ow", "goal"),
        ("block", "ow", "goal"),
        ("goal", "ow", "block"),
        ("goal", "ow", "block"),
    ]
    assert not any(finding.severity == "danger" for finding in prediction.findings)


def test_a_goal_so_near_that_noise_decides_the_direction_is_a_danger(taught):
    objects, _ = scene((0.05, -0.02), (0.03, 0.0))
    codes = {finding.code for finding in predicted(taught, objects).findings if finding.severity == "danger"}
    assert "unusual-scene" in codes
