import io

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from app.evaluation.report.charts import DARK, LIGHT, THEMES, speed_plot, success_chart
from app.evaluation.report.page import duration_text, tokens_text
from app.evaluation.scores import Result, Score
from app.pipeline.keyframes import SIMULATION_DELTA_RAD_S
from app.pipeline.success_rate import SuccessRate
from roboprompt_client.trajectory import Trajectory


def trajectory(timestamps_s=None):
    velocities = np.zeros((6, 7))
    velocities[1:4, :2] = [3.0, 4.0]
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (6, 1))
    return Trajectory(velocities, np.zeros((6, 3)), quaternions, np.array([1, 1, 1, 0, 0, 1]), timestamps_s)


def contrast(a, b):
    """WCAG 2.2's contrast ratio of two colors '#rrggbb'."""
    bright, dark = sorted(map(luminance, (a, b)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def luminance(color):
    srgb = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


def result(task, method, successes):
    return Result(task, method, Score(SuccessRate(successes, 4)))


def test_the_speed_plot_shows_norm_threshold_and_keyframes():
    figure = speed_plot(trajectory(), 20.0, [2, 5], LIGHT)
    curve, threshold, *markers = figure.axes[0].lines
    np.testing.assert_allclose(curve.get_ydata(), [0, 5, 5, 5, 0, 0])
    assert list(threshold.get_ydata()) == [SIMULATION_DELTA_RAD_S] * 2
    assert [line.get_xdata()[0] for line in markers] == [0.1, 0.25]


def test_the_success_chart_has_a_bar_and_an_interval_a_method_and_task():
    figure = success_chart([result(t, m, k) for t in ("a", "b") for m, k in (("x", 0), ("y", 3))], DARK)
    axes = figure.axes[0]
    assert [bar.get_width() for bar in axes.patches] == [0, 0, 75, 75]
    low, high = SuccessRate(3, 4).interval
    whiskers = axes.collections[1].get_segments()[0]
    np.testing.assert_allclose(whiskers[:, 0], [100 * low, 100 * high])
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]


@pytest.mark.parametrize("theme", THEMES, ids=lambda theme: theme.name)
def test_charts_are_legible(theme):
    for text in (theme.text, theme.muted, theme.threshold):
        assert contrast(text, theme.background) >= 4.5
    assert contrast(theme.curve, theme.background) >= 3
    for color in theme.series:
        assert contrast(theme.text, color) >= 3


@pytest.mark.parametrize("theme", THEMES, ids=lambda theme: theme.name)
def test_figures_have_the_theme_s_background(theme):
    figure = speed_plot(trajectory(), 20.0, [2, 5], theme)
    assert isinstance(figure, Figure)
    image = io.BytesIO()
    figure.savefig(image, format="png")
    red, green, blue = Image.open(image).convert("RGB").getpixel((0, 0))
    assert f"#{red:02x}{green:02x}{blue:02x}" == theme.background


def test_numbers_for_people():
    assert [duration_text(s) for s in (None, 0.0063, 1.24, 125.2)] == ["\N{EN DASH}", "6.3 ms", "1.24 s", "2 min 5 s"]
    assert [tokens_text(n) for n in (None, 0, 2174.0)] == ["\N{EN DASH}", "0", "2,174"]
