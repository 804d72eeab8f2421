"""An evaluation -> a folder with `index.html` and its images; numbers are written as people read them.

Texts are as users and LLMs wrote them; the templates escape them.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from app.evaluation.illustrate import detailed_failures, detailed_successes, failures_in_order
from app.evaluation.ledger import action_of
from app.evaluation.methods import Method
from app.evaluation.report.charts import success_chart
from app.evaluation.report.pictures import Picture, PictureFolder, captions, draw_scene, film_grid, film_tiles
from app.evaluation.results import Evaluation, TaskEvaluation, Trial
from app.evaluation.scores import NOTHING, Result, results_of
from app.pipeline.spans import Span, prompt_spans
from app.sim.outcomes import SceneView
from app.sim.rendering import CAMERA
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

Shown = dict[str, Any]  # what a template shows


def write_report(evaluation: Evaluation, folder: Path, illustrated: Iterable[TaskEvaluation] | None = None) -> Path:
    """Write the report into `folder`, over an earlier one; returns the path of its `index.html`.

    At most 12 failures and 2 successes of each task are shown with pictures; the other failures are listed.

    Args:
        illustrated: the evaluation's tasks with their pictures; consumed one by one. None: they have them.
    """
    pictures, results, methods = PictureFolder(folder), results_of(evaluation), evaluation.methods
    tasks = [
        _task(pictures, number, task, methods, [result for result in results if result.task == task.task])
        for number, task in enumerate(illustrated or evaluation.tasks, start=1)
    ]
    models = any(not method.is_yardstick for method in methods)
    page = {
        "command": evaluation.command,
        "duration_s": evaluation.duration_s,
        "chart": _chart(pictures, results),
        "tasks": tasks,
        "yardsticks": {method.label for method in methods if models and method.is_yardstick},
    }
    index = folder / "index.html"
    index.write_text(_environment().get_template("index.html").render(page=page), encoding="utf-8")
    return index


def _environment() -> Environment:
    """Templates that escape everything: instructions, replies and errors are data."""
    loader = PackageLoader("app.evaluation.report")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(duration=duration_text, tokens=tokens_text, percent=percent_text, spans=_spans)
    return environment


def duration_text(seconds: float | None) -> str:
    """For example ``6.3 ms``, ``1.24 s``, ``2 min 5 s``; a dash for None."""
    if seconds is None:
        return NOTHING
    if seconds < 1:
        return f"{1000 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def tokens_text(tokens: float | None) -> str:
    """A whole number with thousands set apart; a dash for None."""
    return NOTHING if tokens is None else f"{tokens:,.0f}"


def percent_text(share: float) -> str:
    """A share in [0, 1] as whole percent, without the sign."""
    return f"{100 * share:.0f}"


def _spans(text: str, representation: str = "absolute", prompt_format: str = "paper") -> tuple[Span, ...]:
    return prompt_spans(text, representation, prompt_format)


def _chart(pictures: PictureFolder, results: Sequence[Result]) -> Picture:
    alt = "Success rates: " + "; ".join(f"{result.task}, {result.method}: {result.score.rate}" for result in results)
    return pictures.chart("success", lambda theme: success_chart(results, theme), alt)


def _task(
    pictures: PictureFolder, number: int, task: TaskEvaluation, methods: Sequence[Method], results: Sequence[Result]
) -> Shown:
    anchor = f"{number}-{re.sub('[^A-Za-z0-9]+', '-', task.task)}"  # the section's id, and how its images' names begin

    def in_detail(kind: str, trials: Sequence[Trial]) -> list[Shown]:
        return [_trial(pictures, f"{anchor}-{kind}-{k:02}", trial) for k, trial in enumerate(trials, start=1)]

    return {
        "task": task.task,
        "anchor": anchor,
        "results": results,
        "failures": in_detail("failure", detailed_failures(task.trials, methods)),
        "successes": in_detail("success", detailed_successes(task.trials, methods)),
        "failed": failures_in_order(task.trials, methods),
        "num_trials": len(task.trials),
    }


def _trial(pictures: PictureFolder, name: str, trial: Trial) -> Shown:
    """What a trial planned and what happened."""
    answer, film = trial.answer, () if trial.execution is None else trial.execution.film_strip
    actions = [] if answer is None else [action_of(item) for item in answer["actions"]]
    shown: Shown = {"trial": trial, "film_strip": None, "animation": None}
    shown["scene"] = _scene_picture(pictures, f"{name}-scene", trial.scene, trial.scene.objects, actions)
    if film:
        texts = captions(len(film), None if answer is None else len(actions))
        tiles, happened = film_tiles(film, texts), f"{trial.task}, seed {trial.seed}, {trial.method}"
        alt = f"Film strip of {happened}: {texts[0]} to {texts[-1]}"
        shown["film_strip"] = pictures.photo(f"{name}-film", film_grid(tiles), alt)
        if len(tiles) > 1:
            alt = f"The same pictures of {happened} as an animation"
            shown["animation"] = pictures.animation(f"{name}-film", tiles, alt)
    return shown


def _scene_picture(
    pictures: PictureFolder,
    name: str,
    scene: SceneView,
    poses: Sequence[ObjectPose],
    actions: Sequence[EndEffectorAction],
) -> Picture | None:
    """The image of camera `front` with object poses and actions; None for a scene without images."""
    alt = f"The scene before the arm moves, with the axes of {_listed(pose.name for pose in poses)}"
    if actions:
        alt += f" and the path of {len(actions)} actions"
    for frame in scene.frames:
        if frame.camera.name == CAMERA and frame.rgb is not None:
            return pictures.photo(name, draw_scene(frame.rgb, frame.camera, poses, actions), alt)
    return None


def _listed(words: Iterable[str]) -> str:
    *most, last = list(words) or ["nothing"]
    return f"{', '.join(most)} and {last}" if most else last
