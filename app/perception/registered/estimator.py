"""The estimator `registered`: finds taught objects in RGB-D images of one or more cameras together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery, model_of
from app.perception.object_model import ObjectModelError
from app.perception.registered.decide import HELP_SEE, SAME_PLACE_M, FoundPose, find
from app.perception.registered.depth_view import Index
from app.perception.registered.model import RegisteredModel
from app.perception.registered.scene import Scene
from app.perception.registered.symmetry import symmetry_remedy
from app.perception.registered.template import Template
from app.perception.registered.turns import in_words
from app.pipeline.errors import UncertainPoseError
from app.pipeline.geometry import canonical_pose
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

TAUGHT = "a model that POST /tasks/{name}/labels/learn made"
HELP_ONE_CAMERA = 'a further camera that sees it; symmetric: "yaw" if it is round'
WELL_SEEN = 0.6  # less support lowers the confidence


@dataclass(frozen=True)
class TaughtQuery(ObjectQuery):
    """A query with the template that its model names."""

    template: Template | None = None


class RegisteredPoses:
    """Registers templates to the points above the table; images are prepared once for all objects.

    An object with `mask_ids` is searched in its masks only, so a detector can select one of several that look alike.

    Objects stand upright, as in their labeled views. An object's origin is the middle of its visible points, or on the
    axis of a round object.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        """Return one pose for each object; see `app.perception.base.PoseEstimator`.

        Raises:
            InvalidInputError: if a query has no template, or the images are unusable.
            ObjectNotVisibleError, UncertainPoseError: see `app.perception.registered.decide.find`; also if the yaw is
                undecided, or a single camera sees an object that is not round.
        """
        models = [model_of(query, RegisteredModel, TAUGHT) for query in objects]
        templates = [_template_of(query) for query in objects]
        scene = Scene.of(frames)
        return tuple(
            _pose(query.name, model, template, scene, _outside_masks(query, scene))
            for query, model, template in zip(objects, models, templates, strict=True)
        )


def _template_of(query: ObjectQuery) -> Template:
    if isinstance(query, TaughtQuery) and query.template is not None:
        return query.template
    message, remedy = "names a template that is not stored here", f"a question to the task that was taught; {TAUGHT}"
    raise ObjectModelError(query.name, message, remedy, within="template")


def _outside_masks(query: ObjectQuery, scene: Scene) -> Index | None:
    """Return indices of the points outside of the object's masks in all cameras; None if it has no masks."""
    if not query.mask_ids:
        return None
    if all(view.mask is None for view in scene.views):
        raise InvalidInputError(f"objects[{query.name}].mask_ids", "is given, but no camera has a mask", "mask_NAME")
    return np.flatnonzero(~scene.masked(query.mask_ids))


def _pose(name: str, model: RegisteredModel, template: Template, scene: Scene, elsewhere: Index | None) -> ObjectPose:
    found = find(name, template, scene, elsewhere)
    symmetry_deg = model.yaw_symmetry_deg
    unknown = "" if symmetry_deg == 0 else _why_no_yaw(found)
    if unknown and not model.yaw_may_be_unknown:
        remedy = symmetry_remedy(template, found.turns_deg) if found.turns_deg else HELP_ONE_CAMERA
        raise UncertainPoseError(name, f"its yaw is undecided: {unknown}", f"{remedy}; yaw_may_be_unknown: true")
    if unknown and found.spread_m > SAME_PLACE_M:
        message = f"its yaw is undecided, and its place with it by {100 * found.spread_m:.0f} cm: {unknown}"
        raise UncertainPoseError(name, message, HELP_SEE)
    best = found.best
    well_seen = min(1.0, best.support / WELL_SEEN)
    confidence = round(min(1.0, best.value) * (0.6 + 0.4 * well_seen), 3)
    reason = "" if well_seen == 1 else f"{100 * best.support:.0f} % of the side that faces the cameras is seen"
    if confidence < model.min_confidence:
        message = f"confidence {confidence:.2f} is below {model.min_confidence:g}: {reason}"
        raise UncertainPoseError(name, message, HELP_SEE)
    quaternion = None if unknown else Rotation.from_matrix(best.rotation).as_quat(canonical=True)
    reason = "; ".join(filter(None, (reason, unknown)))
    pose = ObjectPose(name, best.origin_m, quaternion, "registered", found.cameras, confidence, reason)
    return canonical_pose(pose, symmetry_deg)


def _why_no_yaw(found: FoundPose) -> str:
    """Return why the yaw is uncertain; empty if it is certain."""
    if found.turns_deg:
        return f"{in_words(found.turns_deg)} it fits what {', '.join(found.cameras)} show as well"
    if len(found.cameras) == 1:
        return f"only {found.cameras[0]} sees it, and one camera does not decide a yaw"
    return ""
