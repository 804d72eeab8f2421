"""What the checks on `/predict` cost: keys, rate limit, headers, limits of requests, bounds of motion.

Two real services, one that lets in anybody and one that checks everything, answer the same predictions (scripted
backend, 10 demonstrations, 3 actions) in turns; compared is the CPU time of their processes. Beside it each check
alone. Run: ``python -m benchmarks.checks [--requests 400] [--json]``.
"""

import argparse
import asyncio
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from fastapi import FastAPI
from rich.console import Console
from rich.table import Table
from starlette.types import Receive, Scope, Send

from app.api.access import Access, AccessControl
from app.api.middleware import OuterMiddleware
from app.evaluation.server import running_server
from app.services.api_keys import KeyRing, create_key
from app.services.limits import Limits
from app.services.measures import Metrics
from app.store.store import Store
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.motion_guard import MotionGuard
from roboprompt_client.motion_limits import Box, MotionLimits, Pose
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, Trajectory

ROUND = 20  # requests to one service before the other's turn
TASK, INSTRUCTION = "pick", "pick up the cube"
REPLY = "[[50, 50, 20, 0, 36, 36, 1], [50, 50, 22, 0, 36, 36, 1], [50, 50, 24, 0, 36, 36, 0]]"
SCRIPTED = {
    "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([REPLY]),
    "ROBOPROMPT_DEFAULT_MODEL": "scripted",
    "ROBOPROMPT_WARM_UP": "false",
}
OPEN = {**SCRIPTED, "ROBOPROMPT_AUTH": "off"}
GUARDED = {**SCRIPTED, "ROBOPROMPT_AUTH": "on", "ROBOPROMPT_RATE_LIMIT_PER_S": "100000"}
KEEP_OUT = [{"min": [0.6, 0.4, 0.6], "max": [0.7, 0.5, 0.7]}] * 4
BEFORE = Pose((0.2, 0.1, 1.1), (1.0, 0.0, 0.0, 0.0))
MOTION_LIMITS = {"keep_out": KEEP_OUT, "max_step_m": 0.5, "max_step_rotation_deg": 90}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=400, help="to each service")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    result = {"predict_cpu_ms": compare(arguments.requests), "alone_us": alone()}
    per_request_us = sum(result["alone_us"].values())
    result["checks_share"] = per_request_us / 1000 / result["predict_cpu_ms"]["open"]
    print(json.dumps(result)) if arguments.json else show(result)  # noqa: T201


def compare(num_requests: int) -> dict[str, float]:
    """Milliseconds of CPU for a prediction, by service, medians over rounds; and their ratio."""
    with ExitStack() as stack:
        ask = {
            "open": stack.enter_context(service(OPEN, {})),
            "guarded": stack.enter_context(service(GUARDED, MOTION_LIMITS)),
        }
        rounds: dict[str, list[float]] = {name: [] for name in ask}
        for number in range(num_requests // ROUND + 2):
            for name, measure in ask.items():
                cpu_ms = measure(ROUND) / ROUND
                if number >= 2:  # the first ones warm up
                    rounds[name].append(cpu_ms)
    ratios = [guarded / free for guarded, free in zip(rounds["guarded"], rounds["open"], strict=True)]
    medians = {name: statistics.median(values) for name, values in rounds.items()}
    return {**medians, "guarded_to_open": statistics.median(ratios)}


@contextmanager
def service(environment: dict[str, str], motion_limits: dict[str, Any]) -> Iterator[Callable[[int], float]]:
    """A service with ten demonstrations; yields a function that asks it a number of times and tells its CPU time."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Path(folder))
        token = create_key(store, "benchmark", ["admin"])
        store.close()
        with running_server(Path(folder), environment) as url, RoboPromptClient(url, api_key=token) as client:
            teach(client, motion_limits)
            body = {
                "task": TASK,
                "instruction": INSTRUCTION,
                "objects": [{"name": "cube", "position": [0.2, 0.1, 0.78]}],
                "end_effector": {"position": BEFORE.position_m, "quaternion_xyzw": BEFORE.quaternion_xyzw},
            }
            process_id = server_process(folder)
            with httpx.Client(base_url=url, headers={"authorization": f"Bearer {token}"}) as http:

                def measure(number: int) -> float:
                    before = cpu_ms(process_id)
                    for _ in range(number):
                        assert http.post("/predict", json=body).status_code == 200
                    return cpu_ms(process_id) - before

                yield measure


def teach(client: RoboPromptClient, motion_limits: dict[str, Any]) -> None:
    """Ten demonstrations of three actions."""
    speeds_rad_s = np.array([[0.0] * 7, [0.5] * 7] * 3 + [[0.0] * 7])
    down_xyzw = np.tile([1.0, 0.0, 0.0, 0.0], (7, 1))
    for k in range(10):
        place_m = np.array([0.02 * k, 0.01 * k, 0.78])
        positions_m = place_m + np.linspace([0, 0, 0.3], [0, 0, 0.0], 7)
        trajectory = Trajectory(speeds_rad_s, positions_m, down_xyzw, np.zeros(7))
        client.upload(TASK, INSTRUCTION, trajectory, Observation((ObjectPose("cube", place_m),)))
    client.configure_task(TASK, motion_limits=motion_limits)


def server_process(folder: str) -> int:
    """The process that serves this folder."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().decode(errors="replace").split("\0")
        except OSError:  # it has ended
            continue
        if folder in words and "serve" in words:
            return int(path.parent.name)
    raise RuntimeError("no process serves the folder")


def cpu_ms(process_id: int) -> float:
    """CPU time of a process so far, all its threads together."""
    nanoseconds = 0
    for path in Path(f"/proc/{process_id}/task").glob("*/schedstat"):
        nanoseconds += int(path.read_text().split()[0])
    return nanoseconds / 1e6


def alone() -> dict[str, float]:
    """Microseconds of each check for a prediction of three actions."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Path(folder))
        token = create_key(store, "benchmark", ["predict"])
        middleware = asyncio.run(middleware_us(store, token))
        store.close()
    limits = Limits()
    keep_out = tuple(Box(tuple(box["min"]), tuple(box["max"])) for box in KEEP_OUT)
    bounds = MotionLimits(Box((-0.3, -0.5, 0.6), (0.7, 0.5, 1.6)), keep_out, 0.5, 90)
    actions = [EndEffectorAction(np.array([0.1, 0.1, z]), np.array([1.0, 0, 0, 0]), True) for z in (0.8, 0.9, 1.0)]

    def guard() -> None:
        checked = MotionGuard(bounds, before=BEFORE)
        for action in actions:
            checked.check(action)

    scene = (TASK, INSTRUCTION, ["cube"], [])
    return {
        "key, scope, rate limit, origin, headers": middleware,
        "limits of the request": microseconds(lambda: limits.check_scene(*scene)),
        "bounds of motion, 3 actions": microseconds(guard),
    }


async def middleware_us(store: Store, token: str) -> float:
    """What the two middlewares add to a request that passes."""

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-type", b"text/plain")]})
        await send({"type": "http.response.body", "body": b""})

    owner = FastAPI()
    owner.state.services = type("Services", (), {"keys": KeyRing(store), "metrics": Metrics()})()
    access = Access(key_required=True, requests_per_s=1e9)
    guarded = OuterMiddleware(AccessControl(answer, access))
    headers = [(b"host", b"127.0.0.1"), (b"authorization", f"Bearer {token}".encode())]
    scope = {"type": "http", "method": "POST", "path": "/predict", "query_string": b"", "headers": headers}
    scope["app"] = owner
    scope["client"] = ("127.0.0.1", 1)

    async def nothing(*_: object) -> Any:  # noqa: ANN401
        return None

    async def timed(app: Any, number: int = 3000) -> float:  # noqa: ANN401
        started = time.process_time()
        for _ in range(number):
            await app(dict(scope), nothing, nothing)
        return (time.process_time() - started) / number * 1e6

    differences = [await timed(guarded) - await timed(answer) for _ in range(7)]
    return statistics.median(differences)


def microseconds(call: Callable[[], object], number: int = 3000) -> float:
    """CPU time of a call, the median of a few series."""
    series = []
    for _ in range(7):
        started = time.process_time()
        for _ in range(number):
            call()
        series.append((time.process_time() - started) / number * 1e6)
    return statistics.median(series)


def show(result: dict[str, Any]) -> None:
    """Print the tables."""
    table = Table("one prediction", "CPU", title=f"{os.cpu_count()} cores")
    compared = result["predict_cpu_ms"]
    table.add_row("nothing required", f"{compared['open']:.2f} ms")
    table.add_row("everything checked", f"{compared['guarded']:.2f} ms")
    table.add_row("ratio, median of rounds", f"{compared['guarded_to_open']:.3f}")
    for name, value in result["alone_us"].items():
        table.add_row(f"{name}, alone", f"{value:.1f} us")
    table.add_row("all checks to a prediction", f"{result['checks_share']:.1%}")
    Console().print(table)


if __name__ == "__main__":
    main()
