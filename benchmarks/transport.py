"""The same observation, 640x480 RGB and depth, to other policy servers and to ours."""

import json
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import json_numpy
import msgpack
import numpy as np
from websockets.sync.client import connect

from app.evaluation.server import running
from benchmarks.peers import pack_array
from benchmarks.processes import Cost, Server, cost, service
from benchmarks.service_time import asked, copied_reply, teach
from roboprompt_client.http.encoding import packed_request, request_parts
from roboprompt_client.types.camera import Camera, RgbdFrame, camera_json

WIDTH, HEIGHT = 640, 480
NUM_REQUESTS = 240


def frame() -> RgbdFrame:
    """A picture that compresses about as well as one of a camera: a smooth scene with noise."""
    random = np.random.default_rng(0)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    smooth = np.stack([rows / 2, columns / 3, (rows + columns) / 5], axis=2)
    rgb = np.clip(smooth + random.normal(0, 3, smooth.shape), 0, 255).astype(np.uint8)
    depth_m = (0.8 + rows / 2000 + random.normal(0, 0.001, rows.shape)).astype(np.float32)
    camera_to_world = np.diag([1.0, -1.0, -1.0, 1.0])
    camera = Camera("front", 500.0, 500.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, camera_to_world)
    return RgbdFrame(camera, rgb, depth_m)


def measure() -> dict[str, Cost]:
    """The cost of each way to send it."""
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as folder:
        data = Path(folder)
        return {**_openvla(data / "openvla.log"), **_openpi(data / "openpi.log"), **_ours(data)}


def _openvla(log: Path) -> dict[str, Cost]:
    seen = frame()
    payload = {"image": seen.rgb, "depth": seen.depth_m, "instruction": "put the cube into the box"}
    with running(["benchmarks.peers", "openvla"], {}, log) as (url, process), httpx.Client(base_url=url) as http:

        def send(_: int) -> None:
            http.post("/act", content=json_numpy.dumps(payload)).raise_for_status()

        return {"OpenVLA-style: POST, json_numpy": cost(Server(url, process.pid), send, NUM_REQUESTS)}


def _openpi(log: Path) -> dict[str, Cost]:
    seen = frame()
    payload = {"image": seen.rgb, "depth": seen.depth_m, "prompt": "put the cube into the box"}
    with running(["benchmarks.peers", "openpi"], {}, log) as (url, process):
        address = url.replace("http", "ws")
        with connect(address, compression=None, max_size=None) as connection:

            def send(_: int) -> None:
                connection.send(msgpack.packb(payload, default=pack_array))
                connection.recv()

            return {"openpi-style: websocket, msgpack": cost(Server(url, process.pid), send, NUM_REQUESTS)}


def _ours(data: Path) -> dict[str, Cost]:
    teach(data)
    seen = frame()
    scripted = {"default_model": "scripted", "scripted_replies": json.dumps([copied_reply(data)])}
    with service(data, warm_up="false", **scripted) as server, httpx.Client(base_url=server.url) as http:

        def ask(k: int, *, packed: bool, kept: bool) -> None:
            document = {**asked(k), "dry_run": not kept, "cameras": [camera_json(seen.camera)]}
            views = [_changed(seen, k)]
            body: dict[str, Any] = {"files": request_parts(document, views)}
            if packed:
                headers = {"Content-Type": "application/msgpack"}
                body = {"content": packed_request(document, views), "headers": headers}
            http.post("/predict", **body).raise_for_status()

        return {
            f"ours: {way}, {what}": cost(server, partial(ask, packed=packed, kept=kept), NUM_REQUESTS)
            for packed, way in ((False, "POST, multipart (JPEG, PNG)"), (True, "POST, msgpack"))
            for kept, what in ((False, "prompt written"), (True, "LLM asked (scripted), images and answer stored"))
        }


def _changed(seen: RgbdFrame, k: int) -> RgbdFrame:
    """The frame with one pixel of its own: equal images are stored once."""
    assert seen.rgb is not None
    rgb = seen.rgb.copy()
    rgb[0, 0] = k % 256
    return replace(seen, rgb=rgb)
