"""What an evaluation produces."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.sim.demonstrate import RecordedDemonstration, RolloutResult, SceneView

FIRST_TEST_SEED = 100_000  # demonstrations are drawn from the seeds below


@dataclass(frozen=True)
class Method:
    """A way to get from a scene to actions.

    Attributes:
        label: how tables name it.
        options: for `POST /predict`; None replays the expert's own keyframes, cut into bins (the ceiling).
    """

    label: str
    options: Mapping[str, Any] | None


REPLAY = Method("expert replay", None)


@dataclass(frozen=True, eq=False)
class TaughtEpisode:
    """A demonstration with the service's description of it (`POST /episodes`)."""

    recorded: RecordedDemonstration
    document: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Trial:
    """One scene under one method.

    Attributes:
        answer: the service's answer (`POST /predict`), or None if it gave none.
        error: why there is no answer; empty otherwise.
        execution: None where nothing was executed.
        predict_s: from the request to the answer, as the robot sees it.
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

    @property
    def succeeded(self) -> bool:
        """Whether the scene was solved."""
        return self.execution is not None and self.execution.succeeded

    @property
    def failure(self) -> str:
        """Why it was not; empty if it was."""
        return self.error or ("" if self.execution is None else self.execution.failure)


@dataclass(frozen=True, eq=False)
class TaskEvaluation:
    """Everything of one task."""

    task: str
    taught: tuple[TaughtEpisode, ...]
    trials: tuple[Trial, ...]


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
