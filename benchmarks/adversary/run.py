"""Which cases there are, which of them the results have already, and the rest carried out."""

import json
import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from app.evaluation.teach import TeachingError, record
from app.evaluation.world import Panda, World
from app.executors import Executor, call
from app.sim.outcomes import RecordedDemonstration, SceneView
from benchmarks.adversary.case import Case, unchanged_case
from benchmarks.adversary.kinds import KINDS
from benchmarks.adversary.measure import Bench, Outcome, mutated
from benchmarks.adversary.undetectable import undetectable
from benchmarks.adversary.words import Wording, worded
from roboprompt_client.client import RoboPromptClient

DEMONSTRATIONS = 10
SEED_STEP = 1000  # between the demonstrations of one seed and of the next
OWN_SEEDS = 900  # by which the scenes of tasks differ
CONTROL = "unchanged"  # a scene that is not solved then says nothing about what is wrong


def own_seed(task: str) -> int:
    """Return what a task's seeds are counted from: tasks that draw places alike would else all have the same ones."""
    return zlib.crc32(task.encode()) % OWN_SEEDS


@dataclass
class Run:
    """Kinds x tasks x seeds.

    Attributes:
        demonstrations: recordings of each case.
        every: of the wrong kinds each task and seed has one in so many, in turn, so that over as many seeds it has all.
        results: a line for each outcome; those that are there are not run again. None: nothing is kept.
        wording: of all instructions; None: as the world has them.
    """

    client: RoboPromptClient
    executor: Executor
    world: World
    tasks: Sequence[str]
    kinds: Sequence[str]
    seeds: Sequence[int]
    every: int = 1
    demonstrations: int = DEMONSTRATIONS
    results: Path | None = None
    wording: Wording | None = None
    recorded: dict[tuple[str, int], tuple[RecordedDemonstration, ...]] = field(default_factory=dict)

    def __call__(self) -> Iterator[tuple[Outcome, Mapping[str, Any]]]:
        """Each outcome with the answer, which is empty for one that was there before."""
        known = self._known()
        for seed in self.seeds:
            for number, task in enumerate(self.tasks):
                asked = self._kinds_of(number, seed)
                if all((kind, task, seed) in known for kind in asked):
                    yield from ((known[kind, task, seed], {}) for kind in asked)
                else:
                    yield from self._of_task(task, seed, asked, known)

    def _kinds_of(self, number: int, seed: int) -> list[str]:
        asked = [k for i, k in enumerate(self.kinds) if not KINDS[k].wrong or (i + number + seed) % self.every == 0]
        return list(dict.fromkeys([CONTROL, *asked]))

    def _known(self) -> dict[tuple[str, str, int], Outcome]:
        lines = self.results.read_text().splitlines() if self.results and self.results.exists() else ()
        outcomes = (Outcome.from_json(json.loads(line)) for line in lines)
        return {(item.kind, item.task, item.seed): item for item in outcomes}

    def _of_task(
        self, task: str, seed: int, kinds: Sequence[str], known: Mapping[tuple[str, str, int], Outcome]
    ) -> Iterator[tuple[Outcome, Mapping[str, Any]]]:
        """The outcomes of a task and seed; none if its expert fails, or that of the task it is mixed with."""
        try:
            yield from self._scene(task, seed, kinds, known)
        except TeachingError as error:
            sys.stderr.write(f"{task} {seed} is left out: {error}\n")

    def _scene(
        self, task: str, seed: int, kinds: Sequence[str], known: Mapping[tuple[str, str, int], Outcome]
    ) -> Iterator[tuple[Outcome, Mapping[str, Any]]]:
        scene = call(self.executor, self.world.view, task, self.world.first_test_seed + seed + own_seed(task))
        bench = Bench(self.client, self.executor, self.world, scene, seed)
        case, solved = self._case(task, seed, scene), False
        for kind in kinds:
            if KINDS[kind].wrong and not solved:
                continue
            answer: Mapping[str, Any] = {}
            if (outcome := known.get((kind, task, seed))) is None:
                if (changed := mutated(kind, case, task, seed)) is None:
                    continue
                outcome, answer = bench.run(kind, changed)
                outcome = replace(outcome, undetectable=outcome.wrong and undetectable(case, changed))
                self._keep(outcome)
            solved = outcome.succeeded if kind == CONTROL else solved
            yield outcome, answer

    def _case(self, task: str, seed: int, scene: SceneView) -> Case:
        others = self.tasks if len(self.tasks) > 1 else list(self.world.tasks)
        other = others[(list(others).index(task) + 1) % len(others)]
        case = unchanged_case(self.world, self._record(task, seed), self._record(other, seed), scene)
        return case if self.wording is None else worded(case, self.wording)

    def _record(self, task: str, seed: int) -> tuple[RecordedDemonstration, ...]:
        """At rest at the expert's poses with even seeds, continuous with odd ones."""
        if (task, seed) not in self.recorded:
            world = self.world
            if isinstance(world, Panda) and seed % 2:
                world = replace(world, recordings="continuous")
            first = SEED_STEP * seed + own_seed(task)
            self.recorded[task, seed] = record(
                self.executor, world, task, self.demonstrations, images=False, first_seed=first
            )
        return self.recorded[task, seed]

    def _keep(self, outcome: Outcome) -> None:
        if self.results is not None:
            with self.results.open("a") as file:
                file.write(json.dumps(outcome.to_json()) + "\n")
