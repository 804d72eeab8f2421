"""The simulated tasks for people: a film strip of the expert for each, and a page that lists them."""

import inspect
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from app.evaluation.report.pictures import captions, film_grid, film_tiles
from app.sim.demonstrate import record_demonstration
from app.sim.outcomes import RecordedDemonstration
from app.sim.tasks import TASKS

JPEG_QUALITY = 80
MAX_TILES = 8
INTRODUCTION = """# The simulated tasks

MuJoCo counterparts of the paper's 16 RLBench tasks and 6 real-robot tasks, not RLBench itself. Objects are held by
friction alone. Each strip shows the expert on the scene of seed {seed}; `roboprompt films` makes this page.
"""


@dataclass(frozen=True, eq=False)
class TaskFilm:
    """One task's strip.

    Attributes:
        picture: the file, beside the page.
    """

    task: str
    picture: Path
    recorded: RecordedDemonstration


def film_task(task: str, seed: int, folder: Path) -> TaskFilm:
    """Let the expert solve the scene of a seed and save the strip, at most eight pictures from first to last."""
    recorded = record_demonstration(task, seed, images=False, film_strip=True)
    images = recorded.film_strip
    tiles = film_tiles(images, captions(len(images), recorded.num_expert_poses))
    shown = np.linspace(0, len(tiles) - 1, min(len(tiles), MAX_TILES)).round().astype(int)
    folder.mkdir(parents=True, exist_ok=True)
    picture = folder / f"{task}.jpg"
    Image.fromarray(film_grid([tiles[k] for k in shown])).save(picture, quality=JPEG_QUALITY, optimize=True)
    return TaskFilm(task, picture, recorded)


def write_page(films: Iterable[TaskFilm], seed: int, folder: Path) -> Path:
    """`README.md` in the folder: of each task the instruction, what its scene varies, and the strip."""
    page = folder / "README.md"
    page.write_text("\n".join([INTRODUCTION.format(seed=seed), *map(_section, films)]))
    return page


def _section(film: TaskFilm) -> str:
    scene = film.recorded.scene
    names = ", ".join(pose.name for pose in scene.objects)
    about = inspect.getdoc(TASKS[film.task]) or ""
    return f"""## {film.task}

"{scene.instruction}" ({names})

{about}

![The expert solves {film.task}, from the first picture to the last]({film.picture.name})
"""
