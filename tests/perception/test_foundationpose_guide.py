"""The wrapper in docs/foundationpose.md, run as it stands there, asked by the estimator `remote`."""

import re
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import uvicorn

from app.perception.base import ObjectQuery
from app.perception.models import model_from_json
from app.perception.remote import RemotePoses
from app.pipeline.errors import ObjectNotVisibleError
from app.pipeline.geometry import inverse_transform, rigid
from roboprompt_client.types.camera import RgbdFrame
from tests.perception.flat_scene import camera, render

GUIDE = (Path(__file__).parents[2] / "docs" / "foundationpose.md").read_text()
TRUTH = rigid((0.1, -0.05, 0.03), (0.0, 0.0, 0.6, 0.8))


def wrapper(register):
    """The guide's module, with the part that a lab writes."""
    (source,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    module = {}
    exec(source, module)
    module["register"] = register
    return module["app"]


@contextmanager
def running(app):
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="warning", lifespan="off"))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/poses"
    finally:
        server.should_exit = True
        thread.join()


def ask(register, frames):
    with running(wrapper(register)) as url:
        settings = {"estimator": "remote", "url": url, "model": {"mesh": "mug.obj"}}
        query = ObjectQuery("mug", mask_ids=(7,), model=model_from_json("mug", settings))
        return RemotePoses().estimate([query], frames)[0]


def seen(view, ids=7):
    frame = render(view, [])
    mask = np.zeros(frame.depth_m.shape, np.int32)
    mask[100:120, 200:240] = ids
    return RgbdFrame(frame.camera, frame.rgb, frame.depth_m, mask)


@pytest.mark.parametrize("ids", [7, 70_000], ids=["png masks", "npy masks"])
def test_the_guides_server_answers(ids):
    views = {620.0: camera("front"), 630.0: camera("left", (-0.5, 0.6, 0.6))}
    views[630.0] = type(views[630.0])("left", 630, 620, 319.5, 239.5, views[630.0].camera_to_world)
    frames = [seen(view, ids) for view in views.values()]
    given = []

    def register(model, rgb, depth_m, mask, k):
        given.append((model, rgb, depth_m, mask))
        return inverse_transform(views[k[0, 0]].camera_to_world) @ TRUTH, 0.8

    pose = ask(register, frames)
    np.testing.assert_allclose(pose.position_m, TRUTH[:3, 3], atol=1e-9)
    np.testing.assert_allclose(pose.quaternion_xyzw, [0, 0, 0.6, 0.8], atol=1e-9)
    assert sorted(pose.cameras) == ["front", "left"]
    assert pose.confidence == pytest.approx(0.8)
    for frame, (model, rgb, depth_m, mask) in zip(frames, given, strict=True):
        assert model == {"mesh": "mug.obj"}
        np.testing.assert_array_equal(rgb, frame.rgb)
        np.testing.assert_allclose(depth_m, frame.depth_m, atol=0.0006)
        np.testing.assert_array_equal(mask, frame.mask == 7)


def test_an_object_that_the_guides_server_does_not_find():
    with pytest.raises(ObjectNotVisibleError, match="front: not in the image"):
        ask(lambda *_: None, [seen(camera())])
