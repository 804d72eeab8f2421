"""Writes an evaluation as a folder with `index.html` and images that any browser shows without network or scripts.

Trials that are shown in detail are simulated again for their pictures, which take longer than the simulation.
Instructions, replies and errors are texts of users and LLMs; the templates escape them.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.progress import Progress

from app.evaluation.ledger import action_of
from app.evaluation.methods import Method
from app.evaluation.report.pictures import PagePicture, captions, draw_scene, film_grid, film_tiles, save_photo
from app.evaluation.results import NOTHING, Evaluation, TaskEvaluation, Trial, result_of
from app.evaluation.world import film
from app.executors import Executor
from app.pipeline.spans import prompt_spans
from app.sim.outcomes import RolloutResult, SceneView
from app.sim.rendering import CAMERA
from roboprompt_client.types.poses import EndEffectorAction

Shown = dict[str, Any]  # the variables of a template
MAX_FAILURES = 12  # a task
MAX_SUCCESSES = 2  # a task


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
        "results": [result_of(task, method) for method in methods],
        "failures": in_detail("failure", _detailed_failures(task.trials, methods)),
        "successes": in_detail("success", _detailed_successes(task.trials, methods)),
        "failed": _failures_in_order(task.trials, methods),
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


def _failures_in_order(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return the failed trials, by method and then in the order in which they ran."""
    return list(chain.from_iterable(_by_method(trials, methods, succeeded=False)))


def _detailed_failures(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return at most 12 failed trials, alternating methods; of yardsticks only if there is no other method."""
    chosen = _in_turns(_by_method(trials, _models(methods), succeeded=False))[:MAX_FAILURES]
    return [trial for trial in _failures_in_order(trials, methods) if trial in chosen]


def _detailed_successes(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return at most two solved trials, of different methods if possible; of yardsticks only if there is no other."""
    in_turns = _in_turns(_by_method(trials, _models(methods), succeeded=True))
    return sorted(in_turns, key=lambda trial: trial.answer is None)[:MAX_SUCCESSES]


def _models(methods: Sequence[Method]) -> Sequence[Method]:
    return [method for method in methods if not method.is_yardstick] or methods


def _by_method(trials: Sequence[Trial], methods: Sequence[Method], *, succeeded: bool) -> list[list[Trial]]:
    return [
        [trial for trial in trials if trial.method == method.label and trial.succeeded == succeeded]
        for method in methods
    ]


def _in_turns(groups: Sequence[Sequence[Trial]]) -> list[Trial]:
    return [trial for turn in zip_longest(*groups) for trial in turn if trial is not None]


def illustrated(evaluation: Evaluation, executor: Executor, progress: Progress) -> Iterator[TaskEvaluation]:
    """Yield the evaluation's tasks with pictures of the detailed trials, one by one: a task's take some 100 MB."""
    methods = evaluation.methods
    shown = [
        [*_detailed_failures(task.trials, methods), *_detailed_successes(task.trials, methods)]
        for task in evaluation.tasks
    ]
    bar = progress.add_task("pictures", total=sum(map(len, shown)))
    for task, chosen in zip(evaluation.tasks, shown, strict=True):
        pictures = {
            trial: executor.submit(film, trial.scene, trial.actions if trial.execution else None, trial.shift_m)
            for trial in chosen
        }
        for future in pictures.values():
            future.add_done_callback(lambda _: progress.advance(bar))
        trials = (_illustrate(trial, pictures[trial].result()) if trial in pictures else trial for trial in task.trials)
        yield replace(task, trials=tuple(trials))


def _illustrate(trial: Trial, pictures: tuple[SceneView, RolloutResult | None]) -> Trial:
    """Return the trial with pictures. It keeps its outcome; a note says if the pictures show another one."""
    execution, (scene, again) = trial.execution, pictures
    if execution is not None and again is not None:
        differs = again.succeeded != execution.succeeded
        note = " (simulated again for these pictures: another outcome)" if differs else ""
        execution = replace(execution, film_strip=again.film_strip, failure=execution.failure + note)
    return replace(trial, scene=scene, execution=execution)
