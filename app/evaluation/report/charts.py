"""The charts of a report: success rates as bars with their intervals, and the speed of the joints.

The speed is plotted over a demonstration, with the places where its keyframes are found (paper, section III-B). Colors
suit light and dark pages.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.evaluation.scores import Result
from app.pipeline.episode import frame_times_s, stretches
from app.pipeline.keyframes import SIMULATION_DELTA_RAD_S
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

DOTS_PER_INCH = 160
FONT_SIZE = 9.0
WIDTH_IN = 9.0
BAR_IN = 0.24
FURNITURE_IN = 0.85  # axis and legend
BAR_SHARE = 0.78  # of the room between bars
TASK_GAP = 0.9  # in bars
SIZE_IN = (9.0, 3.0)
MIN_TEXT_SHARE = 0.06  # of the duration: a shorter stretch of the gripper's band has no room for a word
HEADROOM = 1.08


@dataclass(frozen=True)
class Theme:
    """Colors of one mode.

    Attributes:
        series: for one method after the other. Hues of Okabe and Ito (2008), distinguishable with the common
            deficiencies of color vision; light on light pages, dark on dark ones, so that `text` stands out on them.
    """

    name: str
    background: str
    text: str
    muted: str
    grid: str
    curve: str
    threshold: str
    series: tuple[str, ...]


LIGHT = Theme(
    "light",
    "#ffffff",
    "#1f2328",
    "#57606a",
    "#d8dee4",
    "#0b5cad",
    "#b3261e",
    ("#56a9dd", "#eda23c", "#45b792", "#d58fb7", "#a0a8b0"),
)
DARK = Theme(
    "dark",
    "#161b22",
    "#e6edf3",
    "#9da7b3",
    "#30363d",
    "#6cb6ff",
    "#ff8f87",
    ("#2277b3", "#b06c00", "#14856a", "#a85a88", "#6b7580"),
)
THEMES = (LIGHT, DARK)
Draw = Callable[[Theme], Figure]


def new_figure(theme: Theme, width_in: float, height_in: float) -> Figure:
    """An empty figure outside pyplot's global state."""
    return Figure((width_in, height_in), DOTS_PER_INCH, facecolor=theme.background, layout="constrained")


def style_axes(axes: Axes, theme: Theme) -> None:
    """Colors of the theme, no box, small type."""
    axes.set_facecolor(theme.background)
    axes.tick_params(colors=theme.muted, labelsize=FONT_SIZE, length=3)
    axes.xaxis.label.set(color=theme.text, fontsize=FONT_SIZE)
    axes.yaxis.label.set(color=theme.text, fontsize=FONT_SIZE)
    for side, spine in axes.spines.items():
        spine.set_color(theme.grid)
        spine.set_visible(side in ("left", "bottom"))


def success_chart(results: Sequence[Result], theme: Theme) -> Figure:
    """A bar for each task and method, in their order, with the 95 % interval of the rate."""
    tasks = list(dict.fromkeys(result.task for result in results))
    methods = list(dict.fromkeys(result.method for result in results))
    rows = len(tasks) * (len(methods) + TASK_GAP)
    legend_rows = -(-len(methods) // 2)
    figure = new_figure(theme, WIDTH_IN, rows * BAR_IN + FURNITURE_IN + legend_rows * 0.2)
    axes = figure.add_subplot()
    for number, method in enumerate(methods):
        of_method = [result for result in results if result.method == method]
        heights = [tasks.index(result.task) * (len(methods) + TASK_GAP) + number for result in of_method]
        _draw_method(axes, method, of_method, heights, theme.series[number % len(theme.series)], theme)
    middles = [k * (len(methods) + TASK_GAP) + (len(methods) - 1) / 2 for k in range(len(tasks))]
    _finish(axes, tasks, middles, theme)
    figure.legend(
        loc="outside lower left", ncols=2, frameon=False, fontsize=FONT_SIZE, labelcolor=theme.text, handlelength=1.2
    )
    return figure


def _draw_method(
    axes: Axes, method: str, results: Sequence[Result], heights: Sequence[float], color: str, theme: Theme
) -> None:
    rates = [100 * result.score.rate.rate for result in results]
    bounds = [[100 * bound for bound in result.score.rate.interval] for result in results]
    below = [max(rate - low, 0) for rate, (low, _) in zip(rates, bounds, strict=True)]
    above = [max(high - rate, 0) for rate, (_, high) in zip(rates, bounds, strict=True)]
    axes.barh(heights, rates, BAR_SHARE, color=color, label=method)
    axes.errorbar(rates, heights, xerr=[below, above], fmt="|", color=theme.text, elinewidth=1.2, capsize=2.5)
    for result, height in zip(results, heights, strict=True):
        counts = f"{result.score.rate.successes}/{result.score.rate.trials}"
        axes.text(102, height, counts, va="center", color=theme.text, fontsize=FONT_SIZE)


def _finish(axes: Axes, tasks: Sequence[str], middles: Sequence[float], theme: Theme) -> None:
    style_axes(axes, theme)
    axes.set_yticks(middles, tasks)
    axes.tick_params(axis="y", labelcolor=theme.text, length=0)
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("success, % (bar) and 95 % interval (line)")
    axes.grid(axis="x", color=theme.grid, linewidth=0.8)
    axes.set_axisbelow(True)


def speed_plot(trajectory: Trajectory, control_frequency_hz: float, keyframes: Sequence[int], theme: Theme) -> Figure:
    """The norm of the joint velocities over time with threshold and keyframes, above a band of the gripper's state."""
    times_s = frame_times_s(trajectory, control_frequency_hz)
    figure = new_figure(theme, *SIZE_IN)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(10, 1))
    _draw_speed(upper, times_s, np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1), theme)
    _draw_keyframes((upper, lower), [float(times_s[index]) for index in keyframes], theme)
    _draw_gripper(lower, times_s, trajectory.gripper_open.tolist(), theme)
    return figure


def _draw_speed(axes: Axes, times_s: Array, speeds_rad_s: Array, theme: Theme) -> None:
    style_axes(axes, theme)
    axes.plot(times_s, speeds_rad_s, color=theme.curve, linewidth=1.6)
    axes.axhline(SIMULATION_DELTA_RAD_S, color=theme.threshold, linewidth=1.1, linestyle=(0, (5, 3)))
    label = f"at rest below {SIMULATION_DELTA_RAD_S:g}"
    axes.annotate(
        label,
        (1, SIMULATION_DELTA_RAD_S),
        xytext=(4, 0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="center",
        color=theme.threshold,
        fontsize=FONT_SIZE,
    )
    axes.set_xlim(float(times_s[0]), float(times_s[-1]))
    axes.set_ylim(0, max(float(speeds_rad_s.max()), SIMULATION_DELTA_RAD_S) * HEADROOM)
    axes.set_ylabel("joint speed ‖q̇‖, rad/s")
    axes.tick_params(axis="x", length=0)


def _draw_keyframes(both: tuple[Axes, Axes], times_s: Sequence[float], theme: Theme) -> None:
    for number, time_s in enumerate(times_s, start=1):
        for axes in both:
            axes.axvline(time_s, color=theme.text, linewidth=1, linestyle=(0, (1, 2)), zorder=3)
        top = both[0].get_xaxis_transform()
        both[0].text(time_s, 1.02, str(number), transform=top, ha="center", color=theme.text, fontsize=FONT_SIZE)


def _draw_gripper(axes: Axes, times_s: Array, gripper_open: Sequence[bool], theme: Theme) -> None:
    style_axes(axes, theme)
    axes.spines["left"].set_visible(False)
    ends = np.append(times_s, times_s[-1])
    for first, end, is_open in stretches(gripper_open):
        start_s, end_s = float(ends[first]), float(ends[end])
        axes.axvspan(start_s, end_s, color=theme.series[2] if is_open else theme.muted, alpha=0.35, linewidth=0)
        if end_s - start_s > MIN_TEXT_SHARE * times_s[-1]:
            word = "open" if is_open else "closed"
            middle = (start_s + end_s) / 2
            axes.text(middle, 0.45, word, ha="center", va="center", color=theme.text, fontsize=FONT_SIZE - 1)
    axes.set_yticks([0.5], ["gripper"])
    axes.tick_params(axis="y", labelcolor=theme.text, length=0)
    axes.set_ylim(0, 1)
    axes.set_xlabel("time, s")
