"""From a scene to actions by a program that a language model writes; one prompt for every task.

The published method asks a chain of language models: one splits the instruction, one composes value maps, one writes
each kind of map. Here one reply does all three, in a program of the same kinds of steps. `functions.txt` has what it
may call, `examples.txt` worked examples, of tasks that no evaluation here has.
"""

import json
import re
import time
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.baselines.models import Models
from app.evaluation.baselines.voxposer.plan import plan_moves
from app.evaluation.baselines.voxposer.sandbox import Scene, SeenObject, run_program
from app.evaluation.failures import ProgramRefusedError
from app.llm.base import Completion, CompletionRequest
from app.pipeline.prompt import Prompt
from app.pipeline.workspace import Workspace
from app.sim.outcomes import SceneView
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

# The way over value maps has more corners than a list of keyframes has rows.
MAX_ACTIONS = 100
MAX_TOKENS = 1024  # of a program; the longest of oracle_programs.txt has about 900
TIMEOUT_S = 300.0
ASSUMED_RADIUS_M = 0.025  # of an object, of which programs see nothing but its pose
SPACING_M = 0.005


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


SYSTEM = (
    "You control a robot arm with a parallel gripper. For a task and the objects in the scene you write a short "
    "program in a small part of Python that paints 3D value maps and moves the gripper by them. Reply with the "
    f"program alone.\n\n{_text('functions.txt')}"
)
EXAMPLES = _text("examples.txt")
STOP = ("\n# objects:", "\n# task:")
_FENCED = re.compile(r"```(?:python|py)?[ \t]*\n(.*?)```", re.DOTALL)


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
    objects = tuple(SeenObject(pose, _ball_m(pose)) for pose in scene.objects)
    return planned(program_of(completion.text), Scene(workspace, objects, start_of(scene)))


def planned(program: str, scene: Scene) -> tuple[EndEffectorAction, ...]:
    """Run the program, and plan what it asks for."""
    return plan_moves(run_program(program, scene), scene, MAX_ACTIONS)


def start_of(scene: SceneView) -> EndEffectorAction:
    """The end effector before the first move, with the gripper open."""
    if scene.end_effector is None:
        raise ProgramRefusedError("the scene does not say where the end effector is")
    position_m, quaternion_xyzw = (np.array(values) for values in scene.end_effector)
    return EndEffectorAction(position_m, quaternion_xyzw, gripper_open=True)


def _ball_m(pose: ObjectPose) -> Array:
    """(N, 3) points of a ball of 2.5 cm radius about the object's position."""
    side = np.linspace(-ASSUMED_RADIUS_M, ASSUMED_RADIUS_M, int(2 * ASSUMED_RADIUS_M / SPACING_M) + 1)
    points_m = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    turn = Rotation.identity() if pose.quaternion_xyzw is None else Rotation.from_quat(pose.quaternion_xyzw)
    inside = points_m[np.linalg.norm(points_m, axis=1) <= ASSUMED_RADIUS_M]
    placed_m: Array = turn.apply(inside) + pose.position_m
    return placed_m
