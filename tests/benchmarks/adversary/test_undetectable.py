"""Which wrong cases are undetectable: the scene alone differs, and is one that the recordings do not exclude."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.adversary.objects import in_question, lifted, lying, shifted, swapped, taken_for_another, unturned
from benchmarks.adversary.recordings import gripper_inverted, in_half
from benchmarks.adversary.undetectable import undetectable
from benchmarks.adversary.whole import declared_round, scene_of_a_recording
from tests.benchmarks.adversary.cases import picks

MIDDLE_M = np.array([[0.35, 0.0, 0.78], [0.42, 0.15, 0.78], [0.3, -0.15, 0.78]])


def right():
    """Asked about a scene in the middle of the recorded ones."""
    case = picks()
    nearly_unturned = (0.0, 0.0, 0.0005, 1.0)
    found = zip(case.objects, MIDDLE_M, strict=True)
    return replace(case, objects=tuple(replace(p, position_m=m, quaternion_xyzw=nearly_unturned) for p, m in found))


@pytest.mark.parametrize(
    ("mutation", "expected"),
    [
        (in_question(shifted(0.02, 0.03)), True),
        (in_question(swapped), True),
        (in_question(taken_for_another), False),
        (in_question(shifted(0.5, 0.6)), False),
        (in_question(lifted(0.02, 0.06)), False),
        (in_question(lying), False),
        (in_question(unturned), False),
        (scene_of_a_recording, False),
        (in_half(gripper_inverted), False),
        (declared_round, False),
    ],
)
def test_a_scene_that_recordings_do_not_exclude(mutation, expected):
    case = right()
    assert undetectable(case, mutation(case, np.random.default_rng(3))) is expected
