"""One episode: what was recorded, what was made of it, and what another keyframe rule would find.

It is also shown as the LLM reads it, in each representation; an object of it is taught by clicks in its pictures.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from starlette.responses import Response

from app.api.documents import episode_document
from app.api.routes import Wired
from app.llm.base import LanguageModelError
from app.pipeline.keyframes import Motion, RuleName
from app.pipeline.representation.base import usual_format
from app.pipeline.skill.shown import shown_of
from app.services.container import Services
from app.services.extract import read_episode
from app.services.setting_parts import KeyframeSettings
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import EpisodeRecord, TaskRecord
from app.store.trajectories import get_trajectory
from app.store.values import JsonObject
from app.web.episode_views import EpisodeText, Preview, episode_texts, preview
from app.web.page import HEADERS, PageRoute, render, render_part
from app.web.play import recorded_motion, why_without_arm
from app.web.scene import scene

router = APIRouter(route_class=PageRoute)
documents = APIRouter()
MAX_TRIED = 100  # episodes in which a page looks for an object, the newest
ABOUT_RULES: dict[RuleName, str] = {
    "auto": "rests where the robot rests, else where its path bends",
    "waypoints": "gripper changes and where the path bends",
    "merged": "rest or gripper change (paper)",
    "authors": "their published code",
    "uniform": "every n-th frame",
}


@dataclass(frozen=True, eq=False)
class _Recording:
    """An episode with its task and motion, the gripper as the task's settings read it."""

    record: EpisodeRecord
    task: TaskRecord
    settings: TaskSettings
    motion: Motion

    def preview(self, rule: KeyframeSettings) -> Preview:
        return preview(self.motion, rule, [item.index for item in self.record.keyframes], self.settings)


def _recording(services: Services, episode_id: str) -> _Recording:
    record, settings = read_episode(services.store, episode_id)
    with services.store.read() as connection:
        task, trajectory = tasks.get(connection, record.task), get_trajectory(connection, episode_id)
    return _Recording(record, task, settings, settings.motion_of(trajectory, record.control_frequency_hz))


@router.get("/ui/episodes/{episode_id}")
def episode_page(request: Request, services: Wired, episode_id: str, applied: bool = False) -> Response:
    """The episode; with the fields of a keyframe rule, what that would change."""
    recording = _recording(services, episode_id)
    current = recording.settings.keyframes
    named = {name: value for name, value in request.query_params.items() if name in KeyframeSettings.model_fields}
    shown = recording.preview(KeyframeSettings.model_validate({**current.model_dump(), **named}))
    with services.store.read() as connection:
        num_episodes = tasks.counts(connection)[recording.task.name].episodes
        older, newer = episodes.neighbors(connection, recording.record)
    return render(
        request,
        "episode.html",
        episode=recording.record,
        document=episode_document(recording.record, recording.settings),
        doubts=services.known.doubts(recording.task.name),
        settings=recording.settings,
        without_arm=why_without_arm(recording.motion.trajectory, recording.settings),
        duration_s=float(recording.motion.times_s[-1]),
        preview=shown,
        rules=ABOUT_RULES,
        num_episodes=num_episodes,
        older=older,
        newer=newer,
        applied=applied,
    )


@router.get("/ui/episodes/{episode_id}/texts")
def episode_as_text(request: Request, services: Wired, episode_id: str) -> Response:
    """As the LLM reads it: apart, because it takes seconds to align the task's demonstrations."""
    recording = _recording(services, episode_id)
    texts, about = _texts(services, recording)
    return render(request, "episode_texts.html", episode=recording.record, texts=texts, about=about)


@documents.get("/ui/episodes/{episode_id}/motion")
def episode_motion(services: Wired, episode_id: str) -> Response:
    """Speeds and gripper over time, and the scene without keyframes."""
    recording = _recording(services, episode_id)
    times_s, trajectory = recording.motion.times_s, recording.motion.trajectory
    shown = scene(recording.settings.workspace, recording.record.objects, (), trajectory.positions_m)
    document: JsonObject = {
        "has_joints": trajectory.num_joints > 0,
        "times_s": times_s.round(4).tolist(),
        "speed_rad_s": recording.motion.joint_speeds_rad_s.round(5).tolist(),
        "fastest_joint_rad_s": np.abs(trajectory.joint_velocities_rad_s).max(axis=1, initial=0.0).round(5).tolist(),
        "scene": shown,
        "play": recorded_motion(trajectory, times_s, recording.settings)
        | {"marks_s": [round(float(times_s[item.index]), 3) for item in recording.record.keyframes]},
    }
    return JSONResponse(document, headers=HEADERS)


@documents.get("/ui/episodes/{episode_id}/keyframes")
def episode_keyframes(services: Wired, episode_id: str, rule: Annotated[KeyframeSettings, Query()]) -> Response:
    """What a rule would find: for the plots, and as a table."""
    shown = _recording(services, episode_id).preview(rule)
    html = render_part("keyframes.html", preview=shown)
    return JSONResponse({**shown.document(), "html": html}, headers=HEADERS)


def _texts(services: Services, recording: _Recording) -> tuple[tuple[EpisodeText, ...], str]:
    """The texts, and whose they are."""
    settings, record = recording.settings, recording.record
    with services.store.read() as connection:
        prompted = episodes.demonstrations(connection, record.task, settings.num_demonstrations)
    ids = [demonstration.id for demonstration in prompted]
    usually = "which a prompt shows unless a request asks for others"
    if record.id in ids:
        where = f"Demonstration {ids.index(record.id) + 1} of the first {len(ids)}, {usually}."
    else:
        out = "Left out of prompts; shown here as it would be read after them. " if record.left_out else ""
        where = f"{out}Not among the first {len(ids)} demonstrations, {usually}; so it would be read after them."
        ids.append(record.id)
    representation, prompt_format, whose = _usual_style(services, settings)
    with services.known.reading(record.task) as task:
        skills = task.skills_of(tuple(ids))
        plans = [plan for form in skills.forms for plan in skills.of_form(form).plans]
    written = sorted((item for plan in plans for item in shown_of(plan)), key=lambda item: ids.index(item.id))
    texts = episode_texts(written, ids.index(record.id), settings, representation, prompt_format)
    return texts, f"{where} {whose}"


def _usual_style(services: Services, settings: TaskSettings) -> tuple[str, str, str]:
    """Return the default representation and format of a request, and whether task or model sets them."""
    try:
        profile = services.models.profile(services.default_model)
    except LanguageModelError as error:
        why = f"The default model is not available: {error}"
        return settings.representation or "absolute", settings.prompt_format or "paper", why
    representation = settings.representation or profile.representation
    prompt_format = settings.prompt_format or usual_format(representation, profile.prompt_format)
    whose = "First as the task is set." if settings.representation else f"First as {profile.name} reads it."
    return representation, prompt_format, whose


@router.get("/ui/episodes/{episode_id}/object")
def object_page(request: Request, services: Wired, episode_id: str, name: str = "") -> Response:
    """Where an object is shown in the pictures of an episode."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
        task = tasks.get(connection, record.task)
        ids = episodes.list_ids(connection, record.task)[::-1]
        older, newer = episodes.neighbors(connection, record)
    names = task.object_names or ()
    return render(
        request,
        "object.html",
        episode=record,
        cameras=[camera for camera in record.cameras if camera.has_rgbd],
        names=names,
        chosen=name if name in names else names[0],
        settings=TaskSettings.model_validate(task.settings),
        older=older,
        newer=newer,
        page={"task": record.task, "episode": record.id, "episodes": ids[:MAX_TRIED], "num_episodes": len(ids)},
    )
