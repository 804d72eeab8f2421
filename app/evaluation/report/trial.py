"""One trial as the report shows it."""

from app.evaluation.records import Trial
from app.evaluation.report.demonstration import action_of, scene_picture
from app.evaluation.report.film import captions, film_tiles
from app.evaluation.report.pictures import Picture, PictureFolder
from app.evaluation.report.views import Spans, TrialView
from app.pipeline.prompt_colours import prompt_spans


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
