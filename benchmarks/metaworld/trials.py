"""Teach a task, replay its demonstrations, ask in unseen scenes, execute."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Any

from benchmarks.metaworld.demonstrate import DemonstrationCache, thinning, trajectory
from benchmarks.metaworld.execute import execute
from benchmarks.metaworld.ledger import REPLAY, Ledger, Taught, Trial
from benchmarks.metaworld.plan import Plan, is_llm
from benchmarks.metaworld.service import Service, ServiceError
from benchmarks.metaworld.tasks import TASKS, observed_objects, with_noise
from benchmarks.metaworld.world import OpenWorld, World

ATTEMPTS = 2  # a demonstration: no scripted policy succeeds everywhere
DETAILS = ("id", "reply_text", "usage", "timings_ms")


class Benchmark:
    """A plan, run against a service, with what the ledger has left out.

    Args:
        report: gets a line about each task that is done.
    """

    def __init__(
        self,
        plan: Plan,
        service: Service,
        ledger: Ledger,
        open_world: OpenWorld,
        demonstrations: DemonstrationCache,
        report: Callable[[str], None],
    ) -> None:
        self._plan = plan
        self._service = service
        self._ledger = ledger
        self._open_world = open_world
        self._demonstrations = demonstrations
        self._report = report
        self._run_id = int(time.time())  # other tasks in every run: nothing of an earlier one is in the way

    def run(self, tasks: Sequence[str]) -> None:
        """All tasks without LLMs first, which is quick, then with them.

        Raises:
            ServiceError: if the service does not answer, or differs from the one that the results began with.
        """
        yardsticks = [REPLAY, *(model for model in self._plan.models if not is_llm(model))]
        for methods in (yardsticks, [model for model in self._plan.models if is_llm(model)]):
            for task in tasks:
                missing = {method: seeds for method in methods if (seeds := self._missing(task, method))}
                if missing or self._ledger.taught(task) is None:
                    self._run_task(task, missing)

    def _missing(self, task: str, method: str) -> list[int]:
        done = {trial.seed for trial in self._ledger.trials(task, method)}
        return [seed for seed in self._plan.seeds(method) if seed not in done]

    def _run_task(self, task: str, missing: Mapping[str, Sequence[int]]) -> None:
        started_s = time.monotonic()
        with closing(self._open_world(task)) as world:
            taught = self._teach(world, task)
            for method, seeds in missing.items():
                for seed in seeds:
                    trial = self._replay if method == REPLAY else self._test
                    self._ledger.add(trial(world, taught, method, seed))
        scores = (f"{method} {self._score(task, method)}" for method in missing)
        self._report(f"{task}: {', '.join(scores)}; {time.monotonic() - started_s:.0f} s")

    def _score(self, task: str, method: str) -> str:
        trials = self._ledger.trials(task, method)
        return f"{sum(trial.success for trial in trials)}/{len(trials)}"

    def _teach(self, world: World, task: str) -> Taught:
        """Upload the demonstrations, unless the service has those of an earlier run."""
        before = self._ledger.taught(task)
        if before is not None and self._service.has_task(before.service_task):
            return before
        taught = self._upload(world, task)
        if before is not None and taught.keyframes != before.keyframes:
            raise ServiceError(
                f"{task}: the service finds {taught.keyframes} keyframes where it found {before.keyframes} when "
                f"{self._ledger.path} was begun: name another file with --out"
            )
        self._ledger.add(taught)
        return taught

    def _upload(self, world: World, task: str) -> Taught:
        plan, service_task = self._plan, f"metaworld {task} {self._run_id}"
        every = thinning(world.step_hz, plan.record_hz)
        if plan.settings:
            self._service.configure(service_task, plan.settings)
        seeds: dict[str, int] = {}
        refused: list[str] = []
        for seed in range(plan.first_demo_seed, plan.first_demo_seed + ATTEMPTS * plan.demos):
            if len(seeds) + len(refused) == plan.demos:
                break
            demonstration = self._demonstrations.get(world, task, seed)
            if demonstration is None:
                continue
            objects = observed_objects(TASKS[task], demonstration.observation)
            metadata = {
                "task": service_task,
                "instruction": TASKS[task].instruction,
                "objects": with_noise(objects, plan.noise("demos"), seed),
                "control_frequency_hz": world.step_hz / every,
            }
            answer = self._service.upload(metadata, trajectory(demonstration, every))
            if answer.problem is None:
                seeds[answer.document["id"]] = seed
            else:
                refused.append(answer.problem)
        keyframes = [len(self._service.keyframes(episode)) for episode in seeds]
        return Taught(task, service_task, seeds, keyframes, refused)

    def _replay(self, world: World, taught: Taught, method: str, number: int) -> Trial:
        """A demonstration's keyframes in its own scene: what execution and keyframes leave possible."""
        if number >= len(taught.seeds):
            return Trial(taught.task, method, number, success=False, problem="no demonstration")
        episode, seed = list(taught.seeds.items())[number]
        success, steps = execute(world, seed, self._service.keyframes(episode))
        return Trial(taught.task, method, number, success, steps=steps, details={"scene": seed})

    def _test(self, world: World, taught: Taught, model: str, seed: int) -> Trial:
        """Predict and execute in an unseen scene."""
        task = TASKS[taught.task]
        objects = with_noise(observed_objects(task, world.reset(seed)), self._plan.noise("tests"), seed)
        question = {"task": taught.service_task, "instruction": task.instruction, "model": model, "objects": objects}
        answer = self._service.predict(question)
        seconds, details = round(answer.seconds, 3), dict[str, Any](objects=objects)
        if answer.problem is not None:
            return Trial(taught.task, model, seed, False, seconds, problem=answer.problem, details=details)
        reply = answer.document
        success, steps = execute(world, seed, reply["actions"])
        self._service.record_outcome(reply["id"], success=success)
        details |= {"actions": len(reply["actions"]), **{key: reply.get(key) for key in DETAILS}}
        return Trial(taught.task, model, seed, success, seconds, steps, details=details)
