"""What to run, what of it a ledger has already, and whether the two belong together."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.failures import OtherModelError
from app.evaluation.ledger import Ledger, digest_of
from app.evaluation.results import FIRST_TEST_SEED, Crash, Evaluation, Method, TaskEvaluation, Trial
from app.evaluation.teach import Lesson, Recording
from app.evaluation.trials import Cell
from app.sim.demonstrate import Recordings, RobotName

CONTROL_FREQUENCY_HZ = 20.0  # of RLBench's demonstrations


@dataclass(frozen=True)
class Plan:
    """Tasks x seeds x methods.

    Attributes:
        episodes: unseen scenes a task.
        demonstrations: in a prompt, unless a method says otherwise.
        command: for the report.
        images: whether demonstrations are uploaded with their images; recording takes a few times longer.
        predictions_at_once: requests that the service is asked at a time.
        recordings: whether the expert rests at its poses while it demonstrates.
        first_test_seed: unseen scenes are drawn from this seed on.
        robot: what moves the arm, in demonstrations and tests.
        lending: tasks that are taught beside those that are tested, for methods that show other tasks' demonstrations.
    """

    tasks: tuple[str, ...]
    methods: tuple[Method, ...]
    episodes: int
    demonstrations: int
    command: str
    images: bool = False
    predictions_at_once: int = 1
    control_frequency_hz: float = CONTROL_FREQUENCY_HZ
    recordings: Recordings = "rests"
    first_test_seed: int = FIRST_TEST_SEED
    robot: RobotName = "simulated"
    lending: tuple[str, ...] = ()

    @property
    def recorded(self) -> int:
        """Demonstrations to record a task: as many as the method that needs most."""
        shown: list[int] = [method.options.get("num_demonstrations", 0) for method in self.methods]
        return max(self.demonstrations, *shown, *(method.stored for method in self.methods))

    @property
    def taught(self) -> tuple[str, ...]:
        """Every task that is taught."""
        return tuple(dict.fromkeys([*self.tasks, *self.lending]))

    @property
    def asks_default_model(self) -> bool:
        """Whether a method leaves the model to the service."""
        return any(method.asks_service and "model" not in method.options for method in self.methods)

    @property
    def seeds(self) -> range:
        """Of the unseen scenes."""
        return range(self.first_test_seed, self.first_test_seed + self.episodes)

    @property
    def recording(self) -> Recording:
        """How demonstrations are recorded; they are drawn from the seeds from 0 on, but for those of unseen scenes."""
        return Recording(self.control_frequency_hz, self.recordings, self.seeds, self.robot)

    def cells(self) -> Iterator[Cell]:
        """Every trial. A method's trials on a task follow each other, so that the LLM keeps their common prefix."""
        for task in self.tasks:
            for method in self.methods:
                for seed in self.seeds:
                    yield Cell(task, seed, method)

    def digest(self, method: Method) -> str:
        """See `app.evaluation.ledger`."""
        taught: dict[str, Any] = {
            "demonstrations": self.demonstrations,
            "recorded": self.recorded,
            "hz": self.control_frequency_hz,
        }
        if self.recordings != "rests":  # results that do not say stay valid
            taught["recordings"] = self.recordings
        if self.robot != "simulated":
            taught["robot"] = self.robot
        if self.first_test_seed != FIRST_TEST_SEED:
            taught["first_test_seed"] = self.first_test_seed
        if self.first_test_seed < FIRST_TEST_SEED:  # their number decides which scenes are left to demonstrate
            taught["episodes"] = self.episodes
        if method.unseen:  # which of them lend their demonstrations depends on all
            taught["lending"] = sorted(self.taught)
        return digest_of(method, taught)

    def outcome(self, ledger: Ledger, cell: Cell) -> Trial | Crash | None:
        """What the ledger has of a trial."""
        return ledger.find(cell.task, cell.seed, cell.method.label, self.digest(cell.method))

    def remaining(self, ledger: Ledger) -> list[Cell]:
        """The trials to be run: those without an outcome, and those that crashed."""
        return [cell for cell in self.cells() if not isinstance(self.outcome(ledger, cell), Trial)]


def evaluation_of(
    plan: Plan,
    ledger: Ledger,
    taught: Mapping[str, Lesson] | None = None,
    duration_s: float = 0.0,
    models: Sequence[Mapping[str, Any]] = (),
) -> Evaluation:
    """What the ledger has of the plan."""
    outcomes = [outcome for cell in plan.cells() if (outcome := plan.outcome(ledger, cell)) is not None]
    tasks = tuple(
        TaskEvaluation(
            task,
            taught[task].taught if taught and task in taught else (),
            tuple(outcome for outcome in outcomes if isinstance(outcome, Trial) and outcome.task == task),
            tuple(outcome for outcome in outcomes if isinstance(outcome, Crash) and outcome.task == task),
        )
        for task in plan.tasks
    )
    return Evaluation(plan.command, plan.methods, tasks, duration_s, tuple(models))


def check_default_model(plan: Plan, ledger: Ledger, models: Sequence[Mapping[str, Any]]) -> None:
    """Refuse to go on with another LLM where methods leave it to the service.

    Raises:
        OtherModelError.
    """
    default = next(model["name"] for model in models if model["default"])
    for cell in plan.cells():
        outcome = plan.outcome(ledger, cell)
        if not cell.method.asks_service or "model" in cell.method.options or not isinstance(outcome, Trial):
            continue
        used = (outcome.answer or {"model": default})["model"]
        if used != default:
            remedy = f"give --model {used}, or another folder"
            raise OtherModelError(f"the results are of {used}, but the service's default model is {default}: {remedy}")
