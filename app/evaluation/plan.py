"""The trials of an evaluation, and which of them a ledger has already."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from app.evaluation.ledger import Ledger
from app.evaluation.methods import Method
from app.evaluation.results import Crash, Evaluation, TaskEvaluation, Trial
from app.evaluation.world import WORLD, World

DIGEST_CHARS = 12


class PlannedTrial(NamedTuple):
    """A trial to be run. Its `key` is unique within a plan."""

    task: str
    seed: int
    method: Method

    @property
    def key(self) -> tuple[str, int, str]:
        """Task, seed and the method's label."""
        return self.task, self.seed, self.method.label


@dataclass(frozen=True)
class Plan:
    """Tasks x seeds x methods.

    Attributes:
        episodes: unseen scenes a task.
        demonstrations: in a prompt, unless a method says otherwise.
        command: for the report.
        world: where demonstrations are recorded and actions carried out.
        images: whether demonstrations are uploaded with their images; recording takes a few times longer.
        first_test_seed: unseen scenes are drawn from this seed on.
        settings: of every task at the service, unless a method says otherwise.
    """

    tasks: tuple[str, ...]
    methods: tuple[Method, ...]
    episodes: int
    demonstrations: int
    command: str
    world: World = WORLD
    images: bool = False
    first_test_seed: int = WORLD.first_test_seed
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def recorded(self) -> int:
        """Demonstrations to record a task: as many as the method that needs most."""
        shown: list[int] = [method.options.get("num_demonstrations", 0) for method in self.methods]
        return max(self.demonstrations, *shown)

    @property
    def asks_default_model(self) -> bool:
        """Whether a method leaves the model to the service."""
        return any(method.asks_service and "model" not in method.options for method in self.methods)

    @property
    def seeds(self) -> range:
        """The seeds of the unseen scenes."""
        return range(self.first_test_seed, self.first_test_seed + self.episodes)

    def trials(self) -> Iterator[PlannedTrial]:
        """Yield every trial; those of one method and task in a row, so that the LLM keeps their common prefix."""
        for task in self.tasks:
            for method in self.methods:
                for seed in self.seeds:
                    yield PlannedTrial(task, seed, method)

    def digest(self, method: Method) -> str:
        """Return a digest of everything besides the label that can change a method's results."""
        everything = {
            "method": {**asdict(method), "label": ""},
            "demonstrations": self.demonstrations,
            "recorded": self.recorded,
            "first_test_seed": self.first_test_seed,
            "settings": self.settings,
            **self.world.conditions(),
        }
        if self.first_test_seed < self.world.first_test_seed:  # demonstrations skip the seeds of tests
            everything["episodes"] = self.episodes
        return hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:DIGEST_CHARS]

    def outcome(self, ledger: Ledger, planned: PlannedTrial) -> Trial | Crash | None:
        """Return a trial's outcome in the ledger; None without one."""
        return ledger.find(*planned.key, self.digest(planned.method))

    def remaining(self, ledger: Ledger) -> list[PlannedTrial]:
        """Return the trials without an outcome and those that crashed."""
        return [planned for planned in self.trials() if not isinstance(self.outcome(ledger, planned), Trial)]


def evaluation_of(plan: Plan, ledger: Ledger) -> Evaluation:
    """Return the plan's outcomes in the ledger."""
    outcomes = [outcome for planned in plan.trials() if (outcome := plan.outcome(ledger, planned)) is not None]
    tasks = tuple(
        TaskEvaluation(
            task,
            tuple(outcome for outcome in outcomes if isinstance(outcome, Trial) and outcome.task == task),
            tuple(outcome for outcome in outcomes if isinstance(outcome, Crash) and outcome.task == task),
        )
        for task in plan.tasks
    )
    return Evaluation(plan.command, plan.methods, tasks)
