"""Every value of every JSON body replaced by what no robot should send: an answer, never an unexpected error."""

import base64
import copy
import json

import numpy as np
import pytest

from tests.episodes import arrays, camera, metadata, pick_trajectory, png, upload

PLACE_M = (0.1, 0.1, 0.78)
TASK = "extremes"
# As JSON text: some of it cannot be made from Python's values.
EXTREMES = (
    *("1e155", "-1e155", "1e308", "-1e308", "1e-320", "-0.0", "1" + "0" * 400, "NaN", "Infinity", "-Infinity"),
    *("-1", "true", "null"),
    *('""', '"AAAA"', r'"\ud800"', r'"\u0000"', "[]", "[[]]", "{}", r'{"\ud800": 1}', "[1e308, -1e308, 1e308]"),
)
RGB, DEPTH, MASK = (np.full((48, 64, 3), 128, np.uint8), np.full((48, 64), 900, np.uint16), np.eye(48, 64, dtype="u1"))
IMAGES = {
    name: base64.b64encode(png(image)).decode() for name, image in (("rgb", RGB), ("depth", DEPTH), ("mask", MASK))
}
PREDICT = {
    **metadata(TASK, {"cube": PLACE_M}),
    "end_effector": {"position": PLACE_M, "quaternion_xyzw": [0, 0, 0, 1]},
    "model": "nearest",
    "representation": "object_frame",
    "selection": "nearest",
    "episode_ids": None,
    "num_demonstrations": 2,
    "seed": 1,
    "temperature": 0.5,
    "max_actions": 25,
    "timeout_s": 5.0,
}
EPISODE = {
    "metadata": metadata(TASK, {"cube": PLACE_M}, cameras=[camera()], control_frequency_hz=20.0, extra={"note": 1}),
    "trajectory": {name: array[:8].tolist() for name, array in arrays(pick_trajectory(PLACE_M)).items()},
    **{f"{name}_front": data for name, data in IMAGES.items()},
}
CUBOID = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": {"hue_deg": [0, 10], "saturation": [0, 1]}}
SETTINGS = {
    "workspace": {"min": [-0.3, -0.5, 0.6], "max": [0.7, 0.5, 1.6]},
    "keyframes": {"rule": "merged", "delta_rad_s": 0.1, "interval": 5},
    "motion_limits": {"keep_out": [{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}], "max_step_m": 1.0},
    "yaw_symmetry_deg": {"cube": 90},
    "num_demonstrations": 5,
    "system_prompt": "b",
    "object_models": {"cube": CUBOID},
}
LABEL = {
    "object": "cube",
    "cameras": [camera()],
    "rgb_front": IMAGES["rgb"],
    "depth_front": IMAGES["depth"],
    "clicks": {"front": [32, 24]},
    "boxes": {"front": [1, 1, 9, 9]},
    "arrows": {"front": [[1, 1], [9, 9]]},
}
POSES = {"objects": [{"name": "cube", "model": CUBOID}], "cameras": [camera()], "rgb_front": IMAGES["rgb"]}


def places(value, path=()):
    """The paths of all values within; of a list its first two."""
    if path:
        yield path
    within = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, item in within:
        yield from places(item, (*path, key))


def spoilt(document, path, text):
    """The document as JSON with `text` at a path."""
    changed = copy.deepcopy(document)
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = "@here@"
    return json.dumps(changed).replace('"@here@"', text)


@pytest.fixture(scope="module")
def taught(http):
    for number in range(2):
        assert upload(http, TASK, (0.1, 0.1 + number / 10, 0.78)).status_code == 201
    return http


@pytest.mark.parametrize(
    ("method", "address", "document"),
    [
        ("POST", "/predict", PREDICT),
        ("POST", "/episodes", EPISODE),
        ("PUT", f"/tasks/{TASK}_settings", SETTINGS),
        ("POST", "/poses", POSES),
        ("POST", f"/tasks/{TASK}/object_models/learn", {"objects": ["cube"], "episodes": 2}),
        ("POST", f"/tasks/{TASK}/labels/preview", LABEL),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.long)])
def test_no_value_is_an_unexpected_error(taught, method, address, document, every):
    """Of `every` values one at each place, in turn."""
    statuses = set()
    for number, path in enumerate(places(document)):
        for text in EXTREMES[number % every :: every]:
            body = spoilt(document, path, text)
            response = taught.request(method, address, content=body, headers={"content-type": "application/json"})
            assert response.status_code != 500, (path, text, response.text)
            if response.status_code >= 400:
                assert response.headers["content-type"] == "application/problem+json"
            statuses.add(response.status_code)
    assert 422 in statuses
    assert taught.get(f"/ui/episodes?task={TASK}").status_code == 200
