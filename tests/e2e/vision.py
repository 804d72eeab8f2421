"""Cubes on a table, uploaded and asked about by their images."""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from roboprompt_client.encoding import request_parts
from roboprompt_client.types.camera import camera_json
from tests.episodes import arrays, npz, pick_trajectory
from tests.perception.solid_scene import FRONT, LEFT, cube, shoot

RED_MODEL = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}
BLUE_MODEL = {**RED_MODEL, "color": "blue"}
MODELS = {"red cube": RED_MODEL, "blue cube": BLUE_MODEL}
NAMES = [{"name": name} for name in MODELS]
VIEWS = (FRONT, LEFT)
INSTRUCTION = "pick up the red cube"
PLACES = (
    (cube("red", 0.05, 0.10, 0.3), cube("blue", -0.10, -0.05, 0.1)),
    (cube("red", -0.08, 0.02, 0.6), cube("blue", 0.10, -0.08, -0.2)),
    (cube("red", 0.10, -0.06, -0.3), cube("blue", -0.04, 0.12, 0.5)),
)


@cache
def frames(solids, masks=False):
    """RGB-D of both cameras; masks have the solids' numbers, from 1, as ids."""
    return tuple(replace(frame, mask=frame.mask if masks else None) for frame in map(partial(shoot, solids), VIEWS))


def seen(task, views, objects=NAMES, **more):
    """The multipart parts of a question about what the cameras see."""
    cameras = [camera_json(frame.camera) for frame in views]
    document = {"task": task, "instruction": INSTRUCTION, "objects": objects, "cameras": cameras, **more}
    return request_parts(document, views)


def episode(task, views, place_m=(0.1, 0.1, 0.78), objects=NAMES):
    """The parts of an upload."""
    return {**seen(task, views, objects), "trajectory": ("trajectory.npz", npz(**arrays(pick_trajectory(place_m))))}


def teach(http, task, models=MODELS, places=PLACES):
    """Configure the task and upload a demonstration for each of the places; returns the episodes."""
    assert http.put(f"/tasks/{task}", json={"object_models": models}).status_code == 200
    answers = [http.post("/episodes", files=episode(task, frames(solids), solids[0].position_m)) for solids in places]
    assert [answer.status_code for answer in answers] == [201] * len(places), [answer.text for answer in answers]
    return [answer.json() for answer in answers]


def assert_found(objects, solids, atol_m=0.003):
    for found, solid in zip(objects, solids, strict=True):
        np.testing.assert_allclose(found["position"], solid.position_m, atol=atol_m)
