"""Writes an evaluation as a folder with `index.html` and images that any browser shows without network or scripts.

Instructions, replies and errors are texts of users and LLMs; the templates escape them.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from app.evaluation.illustrate import detailed_failures, detailed_successes, failures_in_order
from app.evaluation.ledger import action_of
from app.evaluation.methods import Method
from app.evaluation.report.pictures import PagePicture, captions, draw_scene, film_grid, film_tiles, save_photo
from app.evaluation.results import Evaluation, TaskEvaluation, Trial
from app.evaluation.scores import NOTHING, task_result
from app.pipeline.spans import prompt_spans
from app.sim.outcomes import SceneView
from app.sim.rendering import CAMERA
from roboprompt_client.types.poses import EndEffectorAction

Shown = dict[str, Any]  # the variables of a template


def write_report(evaluation: Evaluation, folder: Path, illustrated: Iterable[TaskEvaluation] | None = None) -> Path:
    """Write the report into `folder`, over an earlier one. Return the path of its `index.html`.

    At most 12 failures and 2 successes of each task are shown with pictures; the other failures are listed.

    Args:
        illustrated: the evaluation's tasks with pictures, consumed one by one; None: the evaluation has them.
    """
    methods = evaluation.methods
    tasks = [_task(folder, k, task, methods) for k, task in enumerate(illustrated or evaluation.tasks, start=1)]
    asks_models = any(not method.is_yardstick for method in methods)
    page = {
        "command": evaluation.command,
        "duration_s": evaluation.duration_s,
        "tasks": tasks,
        "yardsticks": {method.label for method in methods if asks_models and method.is_yardstick},
    }
    folder.mkdir(parents=True, exist_ok=True)
    index = folder / "index.html"
    index.write_text(_environment().get_template("index.html").render(page=page), encoding="utf-8")
    return index


def _environment() -> Environment:
    """Return templates that escape every text."""
    loader = PackageLoader("app.evaluation.report")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(duration=duration_text, tokens=tokens_text, spans=prompt_spans)
    environment.filters["percent"] = lambda share: f"{100 * share:.0f}"
    return environment


def duration_text(seconds: float | None) -> str:
    """Return a duration such as ``6.3 ms``, ``1.24 s``, ``2 min 5 s``; a dash for None."""
    if seconds is None:
        return NOTHING
    if seconds < 1:
        return f"{1000 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def tokens_text(tokens: float | None) -> str:
    """Return a whole number with a separator of thousands; a dash for None."""
    return NOTHING if tokens is None else f"{tokens:,.0f}"


def _task(folder: Path, number: int, task: TaskEvaluation, methods: Sequence[Method]) -> Shown:
    anchor = f"{number}-{re.sub('[^A-Za-z0-9]+', '-', task.task)}"  # the section's id, and the prefix of image names

    def in_detail(kind: str, trials: Sequence[Trial]) -> list[Shown]:
        return [_trial(folder, f"{anchor}-{kind}-{k:02}", trial) for k, trial in enumerate(trials, start=1)]

    return {
        "task": task.task,
        "anchor": anchor,
        "results": [task_result(task, method) for method in methods],
        "failures": in_detail("failure", detailed_failures(task.trials, methods)),
        "successes": in_detail("success", detailed_successes(task.trials, methods)),
        "failed": failures_in_order(task.trials, methods),
        "num_trials": len(task.trials),
    }


def _trial(folder: Path, name: str, trial: Trial) -> Shown:
    """Return the trial with a picture of its scene and planned actions, and a film strip of what happened."""
    answer, film = trial.answer, () if trial.execution is None else trial.execution.film_strip
    actions = [] if answer is None else [action_of(item) for item in answer["actions"]]
    film_strip = None
    if film:
        texts = captions(len(film), None if answer is None else len(actions))
        alt = f"Film strip of {trial.task}, seed {trial.seed}, {trial.method}: {texts[0]} to {texts[-1]}"
        film_strip = save_photo(folder, f"{name}-film", film_grid(film_tiles(film, texts)), alt)
    scene = _scene_picture(folder, f"{name}-scene", trial.scene, actions)
    return {"trial": trial, "scene": scene, "film_strip": film_strip}


def _scene_picture(
    folder: Path, name: str, scene: SceneView, actions: Sequence[EndEffectorAction]
) -> PagePicture | None:
    """Return the image of camera `front` with object poses and actions; None for a scene without images."""
    *most, last = [pose.name for pose in scene.objects] or ["nothing"]
    objects = f"{', '.join(most)} and {last}" if most else last
    alt = f"The scene before the arm moves, with the axes of {objects}"
    if actions:
        alt += f" and the path of {len(actions)} actions"
    for frame in scene.frames:
        if frame.camera.name == CAMERA and frame.rgb is not None:
            return save_photo(folder, name, draw_scene(frame.rgb, frame.camera, scene.objects, actions), alt)
    return None
