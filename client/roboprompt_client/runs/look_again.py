"""Look again before contact, so that the remaining actions follow objects that moved since the prediction.

The robot looks before every action that refers to an object that it has not touched yet, and only then:

- The object that the gripper grasps counts as touched until the gripper opens again.
- An object at which the gripper neither grasps nor opens is pushed or pressed: it counts as touched after two actions
  that refer to it, the approach and the contact. A hand that is closed and then comes nearer to the object does not
  grasp it, whether it was closed before the first action or closes on its way.
- The action that retreats from an object after the gripper grasped it or opened at it stays as it was predicted.

Objects that the robot itself moved are not followed: after a release, the next observed pose is the one to start from.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ObjectLostError, ServiceProblemError
from roboprompt_client.robot import Observation, Robot
from roboprompt_client.runs.reanchoring import MOVED_M, Poses, has_moved, reanchored
from roboprompt_client.types.poses import EndEffectorAction

Check = Callable[[tuple[EndEffectorAction, ...]], None]


class ObjectFinder:
    """Finds objects again: by the robot's own poses, or, if it has images only, by the service's `POST /poses`.

    Raises:
        InvalidInputError: if neither is possible; nothing has moved by then.
    """

    def __init__(self, client: RoboPromptClient, robot: Robot, task: str, first: Observation) -> None:
        document = client.get(f"/tasks/{task}")
        self.yaw_symmetry_deg: Mapping[str, float] = document.get("yaw_symmetry_deg") or {}
        self._client, self._robot = client, robot
        self._models = document.get("object_models") or {}
        if not first.objects:
            self._check_images(first)

    def look_for(self, name: str, others: Iterable[str]) -> Poses:
        """Return the poses of the objects in sight by name; images are searched for `name` and the others.

        Raises:
            ObjectLostError: if `name` is not in sight, or in images one of the others.
            ServiceUnreachableError: if the service is needed and does not answer.
        """
        try:
            seen = self._robot.observe()
        except Exception as error:
            raise ObjectLostError(name, f"the robot cannot look: {error}") from error
        poses = seen.objects
        if not poses:
            try:
                models = {each: self._models[each] for each in (name, *others) if each == name or each in self._models}
                poses = self._client.find_poses(seen.frames, models)
            except ServiceProblemError as error:
                raise ObjectLostError(name, str(error)) from error
        by_name = {pose.name: pose for pose in poses}
        if name not in by_name:
            raise ObjectLostError(name, f"the robot sees {', '.join(by_name) or 'nothing'}")
        return by_name

    def _check_images(self, first: Observation) -> None:
        """Refuse what `POST /poses` cannot find: it needs images, and object models without masks or a server."""
        if not first.frames or not first.to_find:
            valid = "an observation with the objects' poses, or with images and `to_find`"
            raise InvalidInputError("look_again", "the robot's observation names no objects to look for", valid)
        for name in first.to_find:
            estimator = (self._models.get(name) or {}).get("estimator")
            if estimator in (None, "remote"):
                why = f"POST /poses cannot find {name!r} in images: its estimator is {estimator or 'the masks'}"
                raise InvalidInputError("look_again", why, "an object model cuboid or markers, or a robot with poses")


class Follower:
    """Moves the remaining actions of a prediction along with their objects while the robot carries them out.

    Args:
        first: what the robot saw when it asked.
        check: raises if the actions, all of them in their order, are beyond the limits.

    Attributes:
        actions: all actions: the past ones as they were carried out, the others as they are planned now.
    """

    def __init__(self, finder: ObjectFinder, predicted: PredictedActions, first: Observation, check: Check) -> None:
        if predicted.actions and not any(predicted.anchors):
            message = "the answer gives none of its actions an anchor"
            raise InvalidInputError("look_again", message, "a service and a model whose actions have an `anchor`")
        self.actions = predicted.actions
        self._anchors = predicted.anchors
        self._names = [None if anchor is None else anchor.object_name for anchor in predicted.anchors]
        self._known = {pose.name: pose for pose in first.objects or predicted.objects}
        self._symmetry_deg = {**predicted.shown_symmetry_deg, **finder.yaw_symmetry_deg}
        self._finder, self._check = finder, check
        self._touched: set[str] = set()
        self._visits: Counter[str] = Counter()

    def before(self, index: int) -> EndEffectorAction:
        """Return the action; look for the object that it refers to first, if the rules above say so.

        Raises:
            ObjectLostError, ServiceUnreachableError: see `ObjectFinder.look_for`.
            UnsafeActionError: if an action that follows its object would be beyond the limits of motion.
        """
        name = self._names[index]
        retreats = index > 0 and self._names[index - 1] == name and self._switches(index - 1)
        if name is not None and name not in self._touched and not retreats:
            anchor = self._anchors[index]
            seen = self._finder.look_for(name, () if anchor is None else anchor.others - self._touched)
            self._follow(index, {other: pose for other, pose in seen.items() if other not in self._touched})
        return self.actions[index]

    def after(self, index: int) -> None:
        """Note that the action was carried out."""
        name, switches = self._names[index], self._switches(index)
        if switches and self.actions[index].gripper_open:
            for released in self._touched:
                self._known.pop(released, None)
            self._touched.clear()
            self._visits.clear()
        elif name is not None:
            self._visits[name] += 1
            grasps_later = any(self._switches(k) for k in range(index + 1, len(self.actions)) if self._names[k] == name)
            if switches or (self._visits[name] > 1 and not grasps_later):
                self._touched.add(name)

    def _switches(self, index: int) -> bool:
        """Return whether the gripper grasps or opens after an action; before the first its state is not known."""
        is_open = self.actions[index].gripper_open
        if index == 0:
            return not is_open and not self._comes_nearer(index)
        return is_open != self.actions[index - 1].gripper_open and (is_open or not self._comes_nearer(index))

    def _comes_nearer(self, index: int) -> bool:
        """Return whether the next action brings the closed hand nearer to the object of this one."""
        pose = self._known.get(self._names[index] or "")
        if pose is None or self._names[index + 1 : index + 2] != [pose.name] or self.actions[index + 1].gripper_open:
            return False
        here_m, next_m = (np.linalg.norm(self.actions[k].position_m - pose.position_m) for k in (index, index + 1))
        return bool(next_m < here_m - MOVED_M)

    def _follow(self, index: int, now: Poses) -> None:
        done, ahead = self.actions[:index], self.actions[index:]
        followed = reanchored(ahead, self._anchors[index:], self._known, now, self._symmetry_deg)
        if any(new is not old for new, old in zip(followed, ahead, strict=True)):
            self._check((*done, *followed))
        self.actions = (*done, *followed)
        for name, pose in now.items():
            known = self._known.get(name)
            if known is None or has_moved(known, pose, self._symmetry_deg.get(name)):
                self._known[name] = pose
