"""Trials for tests, without simulation."""

from app.evaluation.results import Trial
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

OBJECTS = (ObjectPose("cube", [0.1, 0.2, 0.8], [0, 0, 0, 1]), ObjectPose("plate", [0.3, 0.1, 0.8]))
ACTION = EndEffectorAction([0.1, 0.2, 0.9], [1, 0, 0, 0], True)
ANSWER = {
    "id": "p1",
    "actions": [],
    "model": "embedded/gemma-3-270m",
    "representation": "object_frame",
    "prompt_format": "paper",
    "prompt": {"system": "", "user": "{'cube': [1, 2, 3]}>"},
    "reply_text": "[[1, 2, 3, 4, 5, 6, 1]]",
    "usage": {"prompt_tokens": 100, "cached_tokens": 90, "completion_tokens": 20},
    "timings_ms": {"llm": 500.0, "outside_llm": 5.0},
}


def trial(task, seed, method, succeeded, answer=None):
    scene = SceneView(task, seed, "put the cube on the plate", OBJECTS, (), {})
    failure = "" if succeeded else "every action was carried out, but the task is not solved"
    execution = RolloutResult(1, succeeded, failure)
    return Trial(task, seed, method, scene, answer, execution=execution, execute_s=0.4, actions=(ACTION,))
