"""What a plan is going to cost: requests and tokens of each method on each task, from dry runs of their prompts.

A reply is taken to be as long as one of the prompt's demonstrations with its observation, for each clause of the
instruction: a little more than it is. Tokens that a model thinks are not foreseen.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

from app.evaluation.costs import Kind, Prices, Usage, kind_of, tokens_of
from app.evaluation.methods import Method
from app.evaluation.teach import Lesson
from app.evaluation.trials import PlannedTrial
from app.pipeline.language.mentions import clauses
from app.sim.outcomes import SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation

LessonOf = Callable[[PlannedTrial], Lesson | Exception]


def estimates(
    client: RoboPromptClient,
    planned: Iterable[PlannedTrial],
    lesson_of: LessonOf,
    look: Callable[[PlannedTrial], SceneView],
    prices: Prices,
) -> dict[Kind, Usage]:
    """What one trial of each kind uses; without those that could not be taught, which ask no LLM.

    Raises:
        ServiceProblemError, ServiceUnreachableError: if the service writes no prompt.
    """
    longest: dict[str, SceneView] = {}
    found: dict[Kind, Usage] = {}
    planned = list(planned)
    for trial in {(trial.task, trial.seed): trial for trial in planned}.values():
        scene = look(trial)
        known = longest.setdefault(trial.task, scene)
        longest[trial.task] = max(known, scene, key=lambda view: len(clauses(view.instruction)))
    for trial in {kind_of(trial): trial for trial in planned}.values():
        if isinstance(lesson := lesson_of(trial), Lesson):
            usage = _of_a_trial(client, trial.method, lesson, longest[trial.task])
            price = prices.get(trial.method.options["model"])
            cost = None if price is None else price.of(usage.read, usage.written)
            found[kind_of(trial)] = replace(usage, cost=cost)
    return found


def _of_a_trial(client: RoboPromptClient, method: Method, lesson: Lesson, scene: SceneView) -> Usage:
    stepwise = method.source == "closed loop"
    options = {**method.options, **({"closed_loop": True} if stepwise else {})}
    answer = client.dry_run(lesson.name, scene.instruction, Observation(scene.objects), **options)
    prompt = answer["prompt"]
    read = tokens_of(prompt["system"]) + tokens_of(prompt["user"])
    parts = len(clauses(scene.instruction))
    demonstration = tokens_of(prompt["user"]) / max(1, len(answer["demonstration_ids"]))
    # a step for each keyframe of a demonstration, and one that says that there are no more
    requests = parts * max(len(item.document["keyframes"]) for item in lesson.taught) + 1 if stepwise else 1
    return Usage(requests, requests * read, parts * demonstration)
