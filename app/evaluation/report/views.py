"""What the page's templates show of demonstrations and trials.

Texts are as users and LLMs wrote them; the templates escape them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from app.evaluation.ledger import action_of, poses_of
from app.evaluation.report.charts import speed_plot
from app.evaluation.report.drawing import draw_scene
from app.evaluation.report.pictures import Picture, PictureFolder, captions, film_tiles
from app.evaluation.results import TaughtEpisode, Trial
from app.evaluation.scores import Result
from app.pipeline.episode import frame_times_s
from app.pipeline.spans import Span, prompt_spans
from app.sim.outcomes import SceneView
from app.sim.rendering import CAMERA
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

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
    """The whole report.

    Attributes:
        yardsticks: methods without an LLM, which models are held against.
    """

    command: str
    duration_s: float
    chart: Picture
    tasks: tuple[TaskView, ...]
    yardsticks: frozenset[str]


def demonstration_view(pictures: PictureFolder, name: str, taught: TaughtEpisode) -> DemonstrationView:
    """Draw what the service found in a demonstration; `name` begins the names of its images."""
    document, scene = taught.document, taught.recorded.scene
    actions = [action_of(item) for item in document["keyframes"]]
    return DemonstrationView(
        seed=scene.seed,
        instruction=document["instruction"],
        scene=scene_picture(pictures, f"{name}-scene", scene, poses_of(document), actions),
        speed=_speed_picture(pictures, f"{name}-speed", taught),
        num_keyframes=len(actions),
        observation=prompt_spans(document["observation_text"], "absolute", "paper"),
        actions=prompt_spans(document["actions_text"], "absolute", "paper"),
        estimators=", ".join(dict.fromkeys(item["estimator"] for item in document["objects"])),
    )


def scene_picture(
    pictures: PictureFolder,
    name: str,
    scene: SceneView,
    poses: Sequence[ObjectPose],
    actions: Sequence[EndEffectorAction] = (),
) -> Picture | None:
    """The image of camera `front` with object poses and actions; None for a scene without images."""
    alt = f"The scene before the arm moves, with the axes of {_listed(pose.name for pose in poses)}"
    if actions:
        alt += f" and the path of {len(actions)} actions"
    for frame in scene.frames:
        if frame.camera.name == CAMERA and frame.rgb is not None:
            return pictures.photo(name, draw_scene(frame.rgb, frame.camera, poses, actions), alt)
    return None


def _speed_picture(pictures: PictureFolder, name: str, taught: TaughtEpisode) -> Picture:
    recorded = taught.recorded
    trajectory, frequency_hz = recorded.trajectory, recorded.control_frequency_hz
    keyframes = [item["index"] for item in taught.document["keyframes"]]
    times_s = frame_times_s(trajectory, frequency_hz)
    listed = _listed(f"{times_s[index]:.1f}" for index in keyframes)
    alt = f"Joint speed over {times_s[-1]:.1f} s; {len(keyframes)} keyframes, at {listed} s"
    return pictures.chart(name, lambda theme: speed_plot(trajectory, frequency_hz, keyframes, theme), alt)


def _listed(words: Iterable[str]) -> str:
    *most, last = list(words) or ["nothing"]
    return f"{', '.join(most)} and {last}" if most else last


def trial_view(pictures: PictureFolder, name: str, trial: Trial) -> TrialView:
    """Draw what a trial planned and what happened; `name` begins the names of its images."""
    answer = trial.answer
    actions = [] if answer is None else [action_of(item) for item in answer["actions"]]
    film_strip, animation = _film(pictures, name, trial)
    return TrialView(
        trial,
        scene=scene_picture(pictures, f"{name}-scene", trial.scene, trial.scene.objects, actions),
        film_strip=film_strip,
        animation=animation,
        system_prompt="" if answer is None else answer["prompt"]["system"],
        prompt=_spans(trial, "" if answer is None else answer["prompt"]["user"]),
        reply=_spans(trial, "" if answer is None else answer["reply_text"]),
    )


def _spans(trial: Trial, text: str) -> Spans | None:
    """`text` of the trial's answer; None without one."""
    if trial.answer is None:
        return None
    return prompt_spans(text, trial.answer["representation"], trial.answer["prompt_format"])


def _film(pictures: PictureFolder, name: str, trial: Trial) -> tuple[Picture | None, Picture | None]:
    """The film strip, and the animation where there is motion to show."""
    images = () if trial.execution is None else trial.execution.film_strip
    if not images:
        return None, None
    texts = captions(len(images), None if trial.answer is None else len(trial.answer["actions"]))
    tiles = film_tiles(images, texts)
    happened = f"{trial.task}, seed {trial.seed}, {trial.method}"
    strip = pictures.film_strip(f"{name}-film", tiles, f"Film strip of {happened}: {texts[0]} to {texts[-1]}")
    if len(tiles) == 1:
        return strip, None
    return strip, pictures.animation(f"{name}-film", tiles, f"The same pictures of {happened} as an animation")
