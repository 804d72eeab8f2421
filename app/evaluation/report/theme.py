"""Colours of charts for light and dark pages, and how figures are made and saved."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

DOTS_PER_INCH = 160
FONT_SIZE = 9.0


@dataclass(frozen=True)
class Theme:
    """Colours of one mode.

    Attributes:
        series: for one method after the other. Hues of Okabe and Ito (2008), distinguishable with the common
            deficiencies of colour vision; light on light pages, dark on dark ones, so that `text` stands out on them.
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
    """Colours of the theme, no box, small type."""
    axes.set_facecolor(theme.background)
    axes.tick_params(colors=theme.muted, labelsize=FONT_SIZE, length=3)
    axes.xaxis.label.set(color=theme.text, fontsize=FONT_SIZE)
    axes.yaxis.label.set(color=theme.text, fontsize=FONT_SIZE)
    for side, spine in axes.spines.items():
        spine.set_color(theme.grid)
        spine.set_visible(side in ("left", "bottom"))


def save(figure: Figure, path: Path) -> None:
    """Write a PNG."""
    figure.savefig(path, format="png")
