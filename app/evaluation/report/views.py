"""What the page's templates show. Texts are as users and LLMs wrote them; the templates escape them."""

from dataclasses import dataclass

from app.evaluation.records import Trial
from app.evaluation.report.pictures import Picture
from app.evaluation.report.results import Result
from app.pipeline.prompt_colours import Span

Spans = tuple[Span, ...]


@dataclass(frozen=True)
class DemonstrationView:
    """A demonstration and what the service extracted from it.

    Attributes:
        estimators: what found the object poses.
    """

    seed: int
    instruction: str
    scene: Picture | None
    speed: Picture
    num_keyframes: int
    observation: Spans
    actions: Spans
    estimators: str


@dataclass(frozen=True, eq=False)
class TrialView:
    """One trial in detail.

    Attributes:
        prompt, reply: None where the service gave no answer.
    """

    trial: Trial
    scene: Picture | None
    film_strip: Picture | None
    animation: Picture | None
    system_prompt: str
    prompt: Spans | None
    reply: Spans | None


@dataclass(frozen=True, eq=False)
class TaskView:
    """One task.

    Attributes:
        anchor: the section's id.
        failures: those shown in detail.
        failed: all failed trials.
    """

    task: str
    anchor: str
    results: tuple[Result, ...]
    num_demonstrations: int
    demonstration: DemonstrationView | None
    failures: tuple[TrialView, ...]
    successes: tuple[TrialView, ...]
    failed: tuple[Trial, ...]
    num_trials: int


@dataclass(frozen=True, eq=False)
class PageView:
    """The whole report."""

    command: str
    duration_s: float
    chart: Picture
    tasks: tuple[TaskView, ...]
