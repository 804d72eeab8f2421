"""Demonstrations that scatter where the gripper acts."""

import numpy as np
import pytest

from app.pipeline.findings.actions import scatter_findings
from app.pipeline.plans.support import Support
from tests.pipeline.scenes import action, demonstration, pose

INSTRUCTION = "pick up the cube"


def plans(off_m, number=10, after_m=None, closes=1):
    """Approach, grasp and lift, whose grasp is off by `off_m` here and there, and the lift by `after_m` or as much."""
    shown = []
    for k in range(number):
        x_m, way_m = 0.03 * k, np.array([np.cos(2.4 * k), np.sin(2.4 * k), 0.0])
        offs_m = [0.0, off_m, off_m if after_m is None else after_m]
        places_m = [(x_m, 0, 0.9 - 0.05 * row) + off * way_m for row, off in enumerate(offs_m)]
        rows = [action(place_m, gripper_open=row < closes) for row, place_m in enumerate(places_m)]
        shown.append(demonstration(INSTRUCTION, (pose("cube", (x_m, 0, 0.8), 0),), rows))
    return Support.of([shown]).placed(shown[0])


@pytest.mark.parametrize(("off_m", "severity"), [(0.005, None), (0.02, "info"), (0.05, "warning"), (0.1, "danger")])
def test_the_centre_counts(off_m, severity):
    found = list(scatter_findings(plans(off_m)))
    assert [finding.severity for finding in found] == ([] if severity is None else [severity])
    for finding in found:
        assert (finding.code, finding.where) == ("scattered-demonstrations", "actions[1]")
        assert finding.numbers["scatter_m"] == pytest.approx(off_m, rel=0.2)


def test_more_demonstrations_make_up_for_noise():
    few, many = (next(scatter_findings(plans(0.03, number))) for number in (5, 20))
    assert (few.severity, many.severity) == ("warning", "info")


def test_many_demonstrations_do_not_make_up_for_what_no_noise_does():
    """Of two plans that with more demonstrations scatters farther, and its centre is the better known."""
    wide, narrow = plans(0.1, number=40), plans(0.06, number=5)
    assert wide[0][1].centre_off_m < narrow[0][1].centre_off_m
    (finding,) = scatter_findings((*narrow, *wide))
    assert (finding.severity, finding.numbers["scatter_m"]) == ("danger", wide[0][1].scatter_m)


def test_an_empty_hand_that_closes_on_the_way_says_nothing():
    assert list(scatter_findings(plans(0.15, after_m=0.0))) == []
    (lost,) = scatter_findings(plans(0.15))
    assert lost.severity == "danger"


def test_without_a_switch_nothing_acts():
    assert list(scatter_findings(plans(0.05, closes=5))) == []
    assert list(scatter_findings(())) == []
