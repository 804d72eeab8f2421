"""How fast the joints move over a demonstration, and where its keyframes are found (paper, section III-B)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.evaluation.report.theme import FONT_SIZE, Theme, new_figure, style_axes
from app.pipeline.arrays import Array
from app.pipeline.episode import Trajectory
from app.pipeline.keyframes import SIMULATION_DELTA_RAD_S
from app.pipeline.timeline import frame_times_s, gripper_stretches

SIZE_IN = (9.0, 3.0)
MIN_TEXT_SHARE = 0.06  # of the duration: a shorter stretch of the gripper's band has no room for a word
HEADROOM = 1.08


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
    for first, end, is_open in gripper_stretches(gripper_open):
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
