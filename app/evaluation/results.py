"""What an evaluation produces: trials, and those that could not be run, by task."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.evaluation.methods import Method
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.types.poses import EndEffectorAction

# How the errors of timeouts begin: status 504 of the service, no answer of the service itself, or none of an LLM
TIMED_OUT = re.compile(
    r"^(ServiceProblemError: 504 |ServiceUnreachableError: .*(timed out|Timeout)|TimeoutError|ModelTimeoutError)"
)


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
