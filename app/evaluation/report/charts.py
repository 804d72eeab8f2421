"""The chart of a report: success rates as bars with their intervals. Colors suit light and dark pages."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.evaluation.scores import Result

DOTS_PER_INCH = 160
FONT_SIZE = 9.0
WIDTH_IN = 9.0
BAR_IN = 0.24
FURNITURE_IN = 0.85  # axis and legend
BAR_SHARE = 0.78  # of the room between bars
TASK_GAP = 0.9  # in bars


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
    series: tuple[str, ...]


LIGHT = Theme(
    "light",
    "#ffffff",
    "#1f2328",
    "#57606a",
    "#d8dee4",
    ("#56a9dd", "#eda23c", "#45b792", "#d58fb7", "#a0a8b0"),
)
DARK = Theme(
    "dark",
    "#161b22",
    "#e6edf3",
    "#9da7b3",
    "#30363d",
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
