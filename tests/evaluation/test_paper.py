import pytest

from app.evaluation.paper import METHODS, SUCCESS_PERCENT, mean_percent

RLBENCH = list(SUCCESS_PERCENT["RVT-2"])
REAL = [task for task in SUCCESS_PERCENT["RoboPrompt"] if task not in RLBENCH]


# section IV "Results" names the same for RoboPrompt and VoxPoser, but 21.0, 81.4 and 65.0 for the others
@pytest.mark.parametrize(
    ("method", "mean"), [("RoboPrompt", 51.75), ("VoxPoser", 21.0), ("KAT", 20.75), ("RVT-2", 87.125), ("Act3D", 65.75)]
)
def test_means_of_the_table(method, mean):
    assert mean_percent(method, RLBENCH) == mean


def test_tasks():
    assert (len(RLBENCH), len(REAL)) == (16, 6)
    assert METHODS[0] == "RoboPrompt"
    assert mean_percent("RoboPrompt", ["push_multiple_buttons"]) == 80
    assert mean_percent("RVT-2", REAL) is None
