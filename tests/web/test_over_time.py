"""Success over time, as the list of configurations draws it."""

import pytest

from app.web.prediction_views import HEIGHT, over_time


def heights(points):
    return [float(point.split(",")[1]) for point in points.split()]


@pytest.mark.parametrize("number", [0, 1, 5])
def test_a_few_predictions_show_no_course(number):
    assert over_time([True] * number) is None


def test_what_gets_better_rises():
    drawn = over_time([False] * 3 + [True] * 3)
    assert drawn.words == "in turn 0 of 3, 3 of 3"
    assert heights(drawn.line) == [HEIGHT, 0]


def test_every_prediction_is_in_one_stretch_and_the_line_within_its_band():
    drawn = over_time([k % 3 == 0 for k in range(101)])
    counted = [part.split(" of ") for part in drawn.words.removeprefix("in turn ").split(", ")]
    assert sum(int(trials) for _, trials in counted) == 101
    band, line = heights(drawn.band), heights(drawn.line)
    low, high = band[: len(line)], band[: len(line) - 1 : -1]
    assert all(top <= value <= bottom for top, value, bottom in zip(high, line, low, strict=True))
