"""The plots of a sweep, each as PNG and SVG: success per task, and over whatever number the sweep varies."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.evaluation import paper
from app.evaluation.methods import Method
from app.evaluation.report.charts import FONT_SIZE, LIGHT, new_figure, style_axes, success_chart
from app.evaluation.results import Evaluation
from app.evaluation.scores import mean_rate, pooled_result, results_of, task_result, trials_of

FORMATS = ("png", "svg")
SIZE_IN = (6.4, 4.0)
PAPER = " (paper)"
GAP_MIDDLE = 0.5  # of the room between two tasks' bars, in bars
# marker, size and whether it is filled: several at one place can still be distinguished
MARKS = {
    "RoboPrompt": ("D", 16, True),
    "VoxPoser": ("o", 40, False),
    "KAT": ("s", 55, False),
    "RVT-2": ("^", 40, False),
    "Act3D": ("v", 40, False),
}
MAX_NAMED_TASKS = 6  # thin lines; more of them would be a tangle
TASK_STYLES = ("-", "--", ":", "-.", (0, (1, 4)), (0, (6, 2, 1, 2, 1, 2)))
PERCENT_RANGE = (-3, 103)


@dataclass(frozen=True)
class Axis:
    """A number that sweeps vary.

    Attributes:
        value: of a method; None for a method that has none.
    """

    name: str
    label: str
    value: Callable[[Method], float | None]


def _interval(method: Method) -> float | None:
    keyframes = method.settings.get("keyframes", {})
    return keyframes["interval"] if keyframes.get("rule") == "uniform" else None


def _noise(method: Method) -> float | None:
    return method.noise if method.asks_service else None


AXES = (
    Axis("demonstrations", "demonstrations in the prompt", lambda method: method.options.get("num_demonstrations")),
    Axis("noise", "noise on object poses, in multiples of 1.68 cm and 4.61 degrees", _noise),
    Axis("sampling", "frames between sampled actions", _interval),
)


def write_plots(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the plots that the evaluation has the data for; returns their paths."""
    figures = {"success": success_beside_the_paper(evaluation)}
    tried = [method for method in evaluation.methods if trials_of(evaluation, method)]
    for axis in AXES:
        if len({axis.value(method) for method in tried} - {None}) > 1:
            figures[axis.name] = success_over(axis, evaluation)
    paths = [folder / f"{name}.{kind}" for name in figures for kind in FORMATS]
    for path in paths:
        figures[path.stem].savefig(path)
    return paths


def success_beside_the_paper(evaluation: Evaluation) -> Figure:
    """A bar for each task and method with its interval; below a task's bars a mark for each of the paper's methods."""
    figure = success_chart(results_of(evaluation), LIGHT)
    axes = figure.axes[0]
    below = len(evaluation.methods) / 2 + GAP_MIDDLE
    heights = {task.task: tick + below for task, tick in zip(evaluation.tasks, axes.get_yticks(), strict=True)}
    for name, percents in paper.SUCCESS_PERCENT.items():
        points = [(percents[task], height) for task, height in heights.items() if task in percents]
        _mark(axes, name, points)
    axes.set_ylim(max(heights.values()) + GAP_MIDDLE, -1)
    marks, names = axes.get_legend_handles_labels()
    known = [(mark, name) for mark, name in zip(marks, names, strict=True) if name.endswith(PAPER)]
    if known:
        figure.legend(*zip(*known, strict=True), loc="outside upper left", ncols=5, frameon=False, fontsize=FONT_SIZE)
    return figure


def _mark(axes: Axes, name: str, points: Sequence[tuple[float, float]]) -> None:
    marker, size, fill = MARKS[name]
    if points:
        percents, heights = zip(*points, strict=True)
        axes.scatter(
            percents,
            heights,
            s=size,
            marker=marker,
            facecolors=LIGHT.threshold if fill else "none",
            edgecolors=LIGHT.text,
            label=name + PAPER,
            clip_on=False,
            zorder=4,
        )


def success_over(axis: Axis, evaluation: Evaluation) -> Figure:
    """A line for each model: the mean over tasks with the interval of all trials taken together.

    Methods without the number are level lines. With one model and few tasks, each task has a thin line.
    """
    figure = new_figure(LIGHT, *SIZE_IN)
    axes = figure.add_subplot()
    style_axes(axes, LIGHT)
    varied = sorted((m for m in evaluation.methods if axis.value(m) is not None), key=lambda m: axis.value(m) or 0)
    models = list(dict.fromkeys(method.options.get("model", "") for method in varied))
    if len(models) == 1 and len(evaluation.tasks) <= MAX_NAMED_TASKS:
        _draw_tasks(axes, axis, evaluation, varied)
    for model, color in zip(models, LIGHT.series, strict=False):
        of_model = [method for method in varied if method.options.get("model", "") == model]
        _draw_mean(axes, axis, evaluation, of_model, color, model or "mean")
    for method, color in zip(evaluation.methods, LIGHT.series[::-1], strict=False):
        if axis.value(method) is None and (mean := mean_rate(evaluation, method)) is not None:
            axes.axhline(100 * mean, color=color, linestyle=(0, (5, 3)), label=method.label)
    numbers = sorted({axis.value(method) or 0 for method in varied})
    axes.set_xticks(numbers, [f"{number:g}" for number in numbers])
    axes.set_ylim(*PERCENT_RANGE)
    axes.set_xlabel(axis.label)
    axes.set_ylabel("success, %")
    axes.grid(color=LIGHT.grid, linewidth=0.8)
    figure.legend(loc="outside right upper", frameon=False, fontsize=FONT_SIZE, labelcolor=LIGHT.text)
    return figure


def _draw_tasks(axes: Axes, axis: Axis, evaluation: Evaluation, methods: Sequence[Method]) -> None:
    for task, style in zip(evaluation.tasks, TASK_STYLES, strict=False):
        scores = [(axis.value(method), task_result(task, method).score.rate) for method in methods]
        points = [(number, 100 * rate.rate) for number, rate in scores if rate.trials]
        axes.plot(*zip(*points, strict=True), color=LIGHT.muted, linestyle=style, linewidth=0.9, label=task.task)


def _draw_mean(
    axes: Axes, axis: Axis, evaluation: Evaluation, methods: Sequence[Method], color: str, label: str
) -> None:
    """The interval is Wilson's of all trials taken together, about their rate."""
    points = []
    for method in methods:
        rate, mean = pooled_result(evaluation, method).score.rate, mean_rate(evaluation, method)
        if mean is not None:
            low, high = rate.interval
            points.append((axis.value(method), 100 * mean, 100 * max(mean - low, 0), 100 * max(high - mean, 0)))
    if points:
        numbers, means, below, above = zip(*points, strict=True)
        errors = [below, above]
        axes.errorbar(numbers, means, errors, color=color, marker="o", linewidth=2, capsize=3, label=label)
