"""From a scene to actions by a program: of a language model, by one prompt for every task, or of a person.

The published method asks a chain of language models: one splits the instruction, one composes value maps, one writes
each kind of map. Here one reply does all three, in a program of the same kinds of steps. `functions.txt` has what it
may call, `examples.txt` worked examples, of tasks that no evaluation here has. People's programs, which measure the
planner alone, are in `oracle_programs.txt`, a section for each task or several.
"""

import json
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from importlib.resources import files
from typing import Any, Self

import numpy as np
from anyio.from_thread import start_blocking_portal

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.voxposer.planner import plan_moves
from app.evaluation.voxposer.sandbox import Scene, run_program
from app.llm.base import Completion, CompletionRequest, complete
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from app.pipeline.workspace import Workspace
from app.sim.outcomes import SceneView
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_TOKENS = 1024  # of a program; the longest of oracle_programs.txt has about 900
TIMEOUT_S = 300.0
ASSUMED_RADIUS_M = 0.025  # of an object, of which a model's programs see nothing but its pose


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def _programs() -> dict[str, str]:
    """People's, by task; under `common` what each begins with."""
    _, *sections = re.split(r"^## (.*)\n", _text("oracle_programs.txt"), flags=re.MULTILINE)
    named = zip(sections[::2], sections[1::2], strict=True)
    return {task: program for names, program in named for task in names.split(", ")}


PROGRAMS: Mapping[str, str] = _programs()
SYSTEM = (
    "You control a robot arm with a parallel gripper. For a task and the objects in the scene you write a short "
    "program in a small part of Python that paints 3D value maps and moves the gripper by them. Reply with the "
    f"program alone.\n\n{_text('functions.txt')}"
)
EXAMPLES = _text("examples.txt")
STOP = ("\n# objects:", "\n# task:")
_FENCED = re.compile(r"```(?:python|py)?[ \t]*\n(.*?)```", re.DOTALL)


class Models:
    """The models of a registry, asked from one event loop in a thread of its own. A context manager."""

    def __init__(self, settings: LlmSettings) -> None:
        self._settings = settings
        self._registry = ModelRegistry(settings)
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        self._portal = self._stack.enter_context(start_blocking_portal())
        self._stack.callback(lambda: self._portal.call(self._registry.aclose))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def complete(self, name: str | None, request: CompletionRequest) -> tuple[str, Completion]:
        """The model's name and its reply. Blocking; safe for concurrent use.

        Args:
            name: None: the default model.

        Raises:
            LanguageModelError: if it cannot answer.
        """
        return self._portal.call(self._complete, name or self._settings.default_model, request)

    async def _complete(self, name: str, request: CompletionRequest) -> tuple[str, Completion]:
        async with self._registry.using(name) as model:
            return model.profile.name, await complete(model, request)


def program_prompt(objects: Sequence[ObjectPose], instruction: str) -> Prompt:
    """The prompt that asks for a program."""
    names = ", ".join(json.dumps(pose.name, ensure_ascii=False) for pose in objects)
    return Prompt(SYSTEM, EXAMPLES, f"# objects: {names}\n# task: {instruction}\n", STOP)


def program_of(reply_text: str) -> str:
    """The program in a reply: all of it, or what stands in its only ``` fence.

    Raises:
        ProgramRefusedError: if there are several fences, or one that does not end.
    """
    if "```" not in reply_text:
        return reply_text
    fenced = _FENCED.findall(reply_text)
    if len(fenced) != 1 or reply_text.count("```") != 2:
        raise ProgramRefusedError("the reply is not one program (valid: the program alone, or in one ``` fence)")
    return str(fenced[0])


def ask_for_program(
    models: Models, model: str | None, objects: Sequence[ObjectPose], instruction: str
) -> tuple[Completion, dict[str, Any]]:
    """The reply of the model, and the record of it in the form of an answer of the service, without actions.

    Raises:
        LanguageModelError: if the model does not answer.
    """
    prompt, started = program_prompt(objects, instruction), time.perf_counter()
    request = CompletionRequest(prompt, max_tokens=MAX_TOKENS, timeout_s=TIMEOUT_S, cache_key="voxposer")
    name, completion = models.complete(model, request)
    llm_ms = 1000 * (time.perf_counter() - started)
    return completion, {
        "model": name,
        "representation": "voxposer",
        "prompt_format": "program",
        "prompt": {"system": prompt.system, "user": prompt.user},
        "reply_text": completion.text,
        "usage": asdict(completion.usage),
        "timings_ms": {"llm": llm_ms, "outside_llm": 0.0, "total": llm_ms},
        "actions": [],
    }


def program_actions(completion: Completion, scene: SceneView, workspace: Workspace) -> tuple[EndEffectorAction, ...]:
    """What the planner makes of the program in a reply. Runs in a worker.

    Args:
        scene: with the objects as they are seen.

    Raises:
        ProgramRefusedError: if the program is cut off, not allowed, fails, or asks for nothing that can be planned.
    """
    if completion.finish_reason == "length":
        raise ProgramRefusedError(f"the program was cut off after {completion.usage.completion_tokens} tokens")
    return _planned(program_of(completion.text), scene, workspace, ASSUMED_RADIUS_M)


def oracle_actions(scene: SceneView) -> tuple[EndEffectorAction, ...]:
    """What the planner makes of the program that a person wrote for the task. Runs in a worker.

    Raises:
        ProgramRefusedError: if the task has no program, or it is refused.
    """
    if scene.task not in PROGRAMS:
        valid = ", ".join(task for task in PROGRAMS if task != "common")
        raise ProgramRefusedError(f"no program was written for {scene.task} (valid: {valid})")
    program = oracle_program(scene.task, scene.instruction, [pose.name for pose in scene.objects])
    return _planned(program, scene, Workspace.rlbench(), radius_m=0.0)


def oracle_program(task: str, instruction: str, object_names: Sequence[str]) -> str:
    """The program that solves a scene of the task; KeyError for a task without one."""
    pattern = "|".join(re.escape(name) for name in sorted(object_names, key=len, reverse=True))
    mentioned = ", ".join(map(json.dumps, re.findall(pattern, instruction)))
    return f"mentioned = [{mentioned}]\n{PROGRAMS['common']}{PROGRAMS[task]}"


def _planned(program: str, seen: SceneView, workspace: Workspace, radius_m: float) -> tuple[EndEffectorAction, ...]:
    """Run the program, and plan what it asks for; the gripper is open before the first move."""
    if seen.end_effector is None:
        raise ProgramRefusedError("the scene does not say where the end effector is")
    position_m, quaternion_xyzw = (np.array(values) for values in seen.end_effector)
    scene = Scene(workspace, seen.objects, radius_m, EndEffectorAction(position_m, quaternion_xyzw, gripper_open=True))
    return plan_moves(run_program(program, scene), scene)
