"""What an evaluation produces."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.sim.demonstrate import RecordedDemonstration, RolloutResult, SceneView
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import EndEffectorAction

# How the errors of timeouts begin: status 504 of the service, or no answer of the service itself
TIMED_OUT = re.compile(r"^(ServiceProblemError: 504 |ServiceUnreachableError: .*(timed out|Timeout)|TimeoutError)")
FIRST_TEST_SEED = 100_000  # demonstrations are drawn from the seeds below

# Where a method's actions come from; `app.evaluation.trials` has the function for each.
Poses = Literal["given", "vision"]
NoiseOn = Literal["both", "test"]
Source = Literal[
    "service",
    "closed loop",
    "nearest demonstration",
    "expert replay",
    "expert",
    "robot loop",
    "voxposer oracle",
]


@dataclass(frozen=True)
class Method:
    """A way to get from a scene to actions: one configuration of a sweep.

    Attributes:
        label: how tables name it.
        options: for `POST /predict`.
        settings: for `PUT /tasks/{name}`, beside those of every evaluation; methods that differ here are taught under
            different task names.
        noise: added to poses, as a multiple of the error in `app.evaluation.paper`.
        noise_on: whether it is added to the poses of demonstrations and tests, or of tests alone.
        poses: whether the service is given the objects' poses, or finds them in images (`app.evaluation.teach`).
        stored: episodes that the task must have for the service to choose from, if more than it shows.
        source: where the actions come from; `closed loop` asks the service for one at a time, `robot loop` once for
            all, and the robot carries them out one by one; others do not ask it.
        shift_m: how far the free objects are moved between answer and first action; for the `robot loop`.
        look_again: whether the robot then looks again (`roboprompt_client.look_again`).
        lead_s: where objects move by themselves, how far ahead the robot then aims (`roboprompt_client.leading`).
        unseen: whether the task is taught nothing, and prompts show the most similar ones of the other tasks.
    """

    label: str
    options: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    noise: float = 0.0
    source: Source = "service"
    poses: Poses = "given"
    stored: int = 0
    noise_on: NoiseOn = "both"
    shift_m: float = 0.0
    look_again: bool = False
    lead_s: float = 0.0
    unseen: bool = False

    def __post_init__(self) -> None:
        if self.unseen and (self.taught_noise or self.poses == "vision" or self.source != "service"):
            why = "demonstrations of other tasks have given poses without noise, and one answer is asked for"
            raise InvalidInputError(
                f"methods[{self.label}].unseen", f"is true, but {why}", "noise_on 'test', poses given"
            )
        if self.poses == "vision" and (self.noise or self.source != "service"):
            why = "noise is added to given poses" if self.noise else f"{self.source} takes given poses"
            raise InvalidInputError(f"methods[{self.label}].poses", f"is 'vision', but {why}", "given")

    @property
    def asks_service(self) -> bool:
        """Whether an LLM is asked."""
        return self.source in ("service", "closed loop", "robot loop")

    @property
    def sees_poses(self) -> bool:
        """Whether the actions depend on where objects are seen."""
        return self.asks_service or self.source in ("nearest demonstration", "voxposer oracle")

    @property
    def taught_noise(self) -> float:
        """The noise on the poses of demonstrations."""
        return self.noise if self.noise_on == "both" else 0.0


# The baseline's programs as people write them, planned without the service: its planner alone
VOXPOSER_ORACLE = Method("voxposer oracle", source="voxposer oracle")
REPLAY = Method("expert replay", source="expert replay")
EXPERT = Method("expert", source="expert")


@dataclass(frozen=True, eq=False)
class TaughtEpisode:
    """A demonstration with the service's description of it (`POST /episodes`)."""

    recorded: RecordedDemonstration
    document: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Trial:
    """One scene under one method.

    Attributes:
        scene: the objects at their true poses.
        answer: the service's answer (`POST /predict`), without actions if the LLM's reply had none; None if the
            service was not asked.
        error: why the LLM's reply gave no actions; empty otherwise.
        execution: None where nothing was executed.
        predict_s: from the request to the answer, as the robot sees it.
        execute_s: of simulation.
        actions: what was to be executed.
        shift_m: how far the free objects were moved after the scene had been seen.
        refused: whether the service refused the instruction, before any LLM was asked.
    """

    task: str
    seed: int
    method: str
    scene: SceneView
    answer: Mapping[str, Any] | None = None
    error: str = ""
    execution: RolloutResult | None = None
    predict_s: float = 0.0
    execute_s: float = 0.0
    actions: tuple[EndEffectorAction, ...] = ()
    shift_m: float = 0.0
    refused: bool = False

    @property
    def succeeded(self) -> bool:
        """Whether the scene was solved."""
        return self.execution is not None and self.execution.succeeded

    @property
    def failure(self) -> str:
        """Why it was not; empty if it was."""
        return self.error or ("" if self.execution is None else self.execution.failure)


@dataclass(frozen=True)
class Crash:
    """A trial that could not be run: it says nothing about the method, and counts nowhere."""

    task: str
    seed: int
    method: str
    message: str

    @property
    def timed_out(self) -> bool:
        """Whether the service, its LLM or a pose server was too slow."""
        return bool(TIMED_OUT.search(self.message))


@dataclass(frozen=True, eq=False)
class TaskEvaluation:
    """Everything of one task."""

    task: str
    taught: tuple[TaughtEpisode, ...]
    trials: tuple[Trial, ...]
    crashes: tuple[Crash, ...] = ()


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything of one run.

    Attributes:
        methods: in the order of the tables; the first is what the run is about.
        command: the command line that repeats it.
    """

    command: str
    methods: tuple[Method, ...]
    tasks: tuple[TaskEvaluation, ...]
    duration_s: float
    models: tuple[Mapping[str, Any], ...] = field(default=())
