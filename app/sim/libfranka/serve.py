"""Serves one scene in a process of its own: `python -m app.sim.libfranka.serve TASK SEED VARIATION [ADDRESS]`.

It prints the loopback address on which libfranka's protocol is served. A line on its standard input asks for judgement:
things come to rest, and it prints whether the task is solved. It ends with its input.
"""

import os
import sys
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from threading import Thread

import franky_sim

from app.sim.libfranka.bridge import STEP_S, SceneSimulator
from app.sim.tasks import make_task
from app.sim.tasks.base import FINAL_HOLD_S, SimTask

ENDED = ""


def main() -> None:
    """Step the scene in real time until the input ends."""
    name, seed, variation, *address = sys.argv[1:]
    task = make_task(name, int(seed), int(variation))
    asked: SimpleQueue[str] = SimpleQueue()
    Thread(target=_listen, args=(asked,), daemon=True).start()
    with SceneSimulator(task) as simulator, franky_sim.SimulationServer(simulator, address or addresses()) as server:
        _say(server.robot_servers[0].hostname)
        while True:
            server.run_once()
            try:
                request = asked.get_nowait()
            except Empty:
                continue
            if request == ENDED:
                return
            _judge(server, task)


def addresses() -> Iterator[str]:
    """Loopback addresses to try; the protocol's ports are fixed, so that each scene needs an address of its own."""
    for number in range(os.getpid(), os.getpid() + 1000):
        yield f"127.62.{number // 254 % 254}.{number % 254 + 1}"


def _judge(server: franky_sim.SimulationServer, task: SimTask) -> None:
    for _ in range(round(FINAL_HOLD_S / STEP_S)):
        server.run_once()
    _say("solved" if task.succeeded() else "not solved")


def _listen(asked: "SimpleQueue[str]") -> None:
    for line in sys.stdin:
        asked.put(line)
    asked.put(ENDED)


def _say(word: str) -> None:
    print(word, flush=True)  # noqa: T201 - the other process reads it


if __name__ == "__main__":
    main()
