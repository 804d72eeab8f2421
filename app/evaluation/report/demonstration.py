"""One demonstration as the report shows it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from app.evaluation.records import TaughtEpisode
from app.evaluation.report.overlay import draw_scene
from app.evaluation.report.pictures import Picture, PictureFolder
from app.evaluation.report.speed_plot import speed_plot
from app.evaluation.report.views import DemonstrationView
from app.pipeline.episode import EndEffectorAction, ObjectPose
from app.pipeline.prompt_colours import prompt_spans
from app.pipeline.timeline import frame_times_s
from app.sim.demonstrate import SceneView
from app.sim.film import CAMERA


def demonstration_view(pictures: PictureFolder, name: str, taught: TaughtEpisode) -> DemonstrationView:
    """Draw what the service found in a demonstration; `name` begins the names of its images."""
    document, scene = taught.document, taught.recorded.scene
    actions = [action_of(item) for item in document["keyframes"]]
    return DemonstrationView(
        seed=scene.seed,
        instruction=document["instruction"],
        scene=scene_picture(pictures, f"{name}-scene", scene, _poses(document), actions),
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


def action_of(item: Mapping[str, Any]) -> EndEffectorAction:
    """An action of one of the service's documents."""
    return EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])


def _poses(document: Mapping[str, Any]) -> list[ObjectPose]:
    return [ObjectPose(item["name"], item["position"], item["quaternion_xyzw"]) for item in document["objects"]]


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
