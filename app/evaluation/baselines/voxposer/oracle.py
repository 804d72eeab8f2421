"""The planner alone, with the programs that people wrote: oracle_programs.txt, a section for each task or several."""

import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files

from app.evaluation.baselines.voxposer.ask import planned, start_of
from app.evaluation.baselines.voxposer.sandbox import Scene, SeenObject
from app.evaluation.failures import ProgramRefusedError
from app.pipeline.workspace import Workspace
from app.sim.outcomes import SceneView
from roboprompt_client.trajectory import EndEffectorAction


def _programs() -> dict[str, str]:
    """By task; under `common` what each begins with."""
    text = files(__package__).joinpath("oracle_programs.txt").read_text(encoding="utf-8")
    _, *sections = re.split(r"^## (.*)\n", text, flags=re.MULTILINE)
    named = zip(sections[::2], sections[1::2], strict=True)
    return {task: program for names, program in named for task in names.split(", ")}


PROGRAMS: Mapping[str, str] = _programs()


def oracle_actions(scene: SceneView) -> tuple[EndEffectorAction, ...]:
    """What the planner makes of the program that a person wrote for the task. Runs in a worker.

    Raises:
        ProgramRefusedError: if the task has no program, or it is refused.
    """
    if scene.task not in PROGRAMS:
        valid = ", ".join(task for task in PROGRAMS if task != "common")
        raise ProgramRefusedError(f"no program was written for {scene.task} (valid: {valid})")
    objects = tuple(SeenObject(pose, pose.position_m[None]) for pose in scene.objects)
    program = oracle_program(scene.task, scene.instruction, [pose.name for pose in scene.objects])
    return planned(program, Scene(Workspace.rlbench(), objects, start_of(scene)))


def oracle_program(task: str, instruction: str, object_names: Sequence[str]) -> str:
    """The program that solves a scene of the task.

    Raises:
        KeyError: for a task without one.
    """
    pattern = "|".join(re.escape(name) for name in sorted(object_names, key=len, reverse=True))
    mentioned = ", ".join(map(json.dumps, re.findall(pattern, instruction)))
    return f"mentioned = [{mentioned}]\n{PROGRAMS['common']}{PROGRAMS[task]}"
