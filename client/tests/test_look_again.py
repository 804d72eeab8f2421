"""A robot that looks again: which actions follow what, and what ends the run."""

from types import SimpleNamespace

import numpy as np
import pytest

from roboprompt_client.answers import PredictedActions
from roboprompt_client.errors import InvalidInputError, ObjectLostError, ServiceProblemError, UnsafeActionError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.runs.look_again import Follower
from roboprompt_client.runs.loop import run_task
from roboprompt_client.runs.reanchoring import ActionAnchor
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose

DOWN = np.array([1.0, 0, 0, 0])
CUBE, PLATE = np.array([0.1, 0.0, 0.8]), np.array([0.4, 0.0, 0.8])
SHIFT, UP, ASIDE = np.array([0.0, 0.03, 0.0]), np.array([0, 0, 1.0]), np.array([0.2, 0, 0])


def action(place_m, z_m, gripper_open):
    return EndEffectorAction(place_m + z_m * UP, DOWN, gripper_open)


def anchor(name):
    return name and ActionAnchor(name, "w", np.zeros(3), DOWN)


PICK_AND_PLACE = [
    ("cube", action(CUBE, 0.1, True)),
    ("cube", action(CUBE, 0.0, False)),
    ("cube", action(CUBE, 0.1, False)),
    ("plate", action(PLATE, 0.1, False)),
    ("plate", action(PLATE, 0.02, True)),
    ("plate", action(PLATE, 0.1, True)),
]


def answer(plan=PICK_AND_PLACE, **response):
    actions, anchors = tuple(a for _, a in plan), tuple(anchor(name) for name, _ in plan)
    return PredictedActions("p", actions, {"findings": [], **response}, anchors)


class Service:
    def __init__(self, predicted, document=None, limits=None, found=None):
        self.predicted, self._document = predicted, document or {"yaw_symmetry_deg": {"cube": 90}}
        self._limits, self._found, self.asked = limits or MotionLimits(Box((-1, -1, 0), (1, 1, 2))), found, []

    def motion_limits(self, task):
        return self._limits

    def get(self, path):
        return self._document

    def predict(self, task, instruction, observation, **options):
        return self.predicted

    def find_poses(self, frames, models):
        self.asked.append(list(models))
        if isinstance(self._found, Exception):
            raise self._found
        return tuple(self._found[name] for name in models)


class Arm:
    """An arm in a scene that changes: `moves` maps the number of actions carried out to what happens then."""

    def __init__(self, moves=None, frames=()):
        self.scene, self.at = {"cube": CUBE, "plate": PLATE}, None
        self.done, self.looks, self.stopped, self._moves, self._frames = [], [], 0, dict(moves or {}), frames

    def observe(self):
        self.looks.append(len(self.done))
        if self._frames:
            return Observation((), self._frames, tuple(self.scene))
        what = self._moves.pop(len(self.done), None) if len(self.looks) > 1 else None
        if isinstance(what, Exception):
            raise what
        self.scene.update(what or {})
        poses = tuple(ObjectPose(n, p) for n, p in self.scene.items() if p is not None)
        return Observation(poses, end_effector=self.at)

    def execute(self, action):
        self.done.append(action.position_m)

    def stop(self):
        self.stopped += 1


def run(arm, predicted=None, **settings):
    service = settings.pop("service", None) or Service(predicted or answer())
    return run_task(service, arm, "pick", "put the cube on the plate", look_again=True, **settings)


def shifts(arm, plan=PICK_AND_PLACE):
    return [np.round(done - a.position_m, 9).tolist() for done, (_, a) in zip(arm.done, plan, strict=True)]


def test_the_robot_looks_before_each_contact_and_not_for_what_it_holds():
    arm = Arm()
    run(arm)
    assert arm.looks == [0, 0, 1, 3, 4]
    assert shifts(arm) == [[0, 0, 0]] * 6


@pytest.mark.parametrize(
    ("when", "what", "following"),
    [
        (0, "cube", [0, 1, 2]),
        (1, "cube", [1, 2]),
        (0, "plate", [3, 4, 5]),
        (3, "plate", [3, 4, 5]),
        (4, "plate", [4, 5]),
    ],
)
def test_actions_follow_what_was_moved_since(when, what, following):
    arm = Arm({when: {what: {"cube": CUBE, "plate": PLATE}[what] + SHIFT}})
    carried_out = run(arm).actions
    assert [index for index, shift in enumerate(shifts(arm)) if shift == SHIFT.tolist()] == following
    assert [a.position_m.tolist() for a in carried_out] == [done.tolist() for done in arm.done]


def test_what_the_hand_carries_is_not_followed():
    arm = Arm({3: {"cube": CUBE + 0.1 * UP}, 4: {"cube": PLATE + 0.1 * UP}})
    run(arm)
    assert shifts(arm) == [[0, 0, 0]] * 6


def test_after_a_release_an_object_is_where_it_was_put():
    """The robot itself moved the cube to the plate, and grasps it there again."""
    plan = [*PICK_AND_PLACE, ("cube", action(PLATE, 0.1, True)), ("cube", action(PLATE, 0.0, False))]
    arm = Arm({6: {"cube": PLATE}, 7: {"cube": PLATE + SHIFT}})
    run(arm, answer(plan))
    assert shifts(arm, plan) == [[0, 0, 0]] * 7 + [SHIFT.tolist()]


def test_what_an_open_hand_pushes_is_looked_for_until_contact():
    plan = [
        ("cube", action(CUBE, 0.1, True)),
        ("cube", action(CUBE, 0.0, True)),
        ("cube", action(CUBE + SHIFT, 0, True)),
    ]
    arm = Arm({2: {"cube": CUBE + SHIFT}})
    run(arm, answer(plan))
    assert (arm.looks, shifts(arm, plan)) == ([0, 0, 1], [[0, 0, 0]] * 3)


PRESS = [("cube", action(CUBE, 0.1, False)), ("cube", action(CUBE, 0.0, False)), ("cube", action(CUBE, 0.1, False))]
START = (None, action(CUBE - ASIDE, 0.3, True))


@pytest.mark.parametrize("plan", [PRESS, [START, *PRESS]], ids=["closed from the start", "closed on the way"])
def test_what_a_closed_hand_presses_is_looked_for_until_contact(plan):
    contact = len(plan) - 2
    arm = Arm({contact: {"cube": CUBE + SHIFT}})
    run(arm, answer(plan))
    assert shifts(arm, plan) == [[0, 0, 0]] * contact + [SHIFT.tolist()] * 2
    assert arm.looks == [0, contact - 1, contact]


def test_what_the_first_action_grasps_is_not_looked_for():
    arm = Arm({1: {"cube": None}})
    run(arm, answer(PICK_AND_PLACE[1:]))
    assert (arm.looks, len(arm.done)) == ([0, 0, 2, 3], 5)


@pytest.mark.parametrize("what", [{"cube": None}, RuntimeError("the camera is unplugged")])
def test_a_lost_object_stops_the_robot(what):
    arm = Arm({1: what})
    with pytest.raises(ObjectLostError, match="'cube' is lost") as caught:
        run(arm)
    assert (caught.value.object_name, len(arm.done), arm.stopped) == ("cube", 1, 1)


def test_what_no_further_action_needs_may_be_hidden():
    arm = Arm({1: {"plate": None}, 3: {"plate": PLATE}})
    run(arm)
    assert len(arm.done) == 6


@pytest.mark.parametrize(
    ("moves", "limits", "said", "done"),
    [
        ({1: {"cube": CUBE + SHIFT}}, {"workspace": Box((-1, -1, 0), (1, 0.02, 2))}, r"position.y is 0.03 m", 1),
        ({3: {"plate": PLATE + ASIDE}}, {"max_step_m": 0.4}, r"position is 0.5 m from the one before", 3),
    ],
)
def test_actions_that_follow_pass_the_limits_again(moves, limits, said, done):
    arm = Arm(moves)
    arm.at = Pose((0.1, 0.0, 1.1), (1.0, 0.0, 0.0, 0.0))
    with pytest.raises(UnsafeActionError, match=f"action {done}: {said}"):
        run(arm, service=Service(answer(), limits=MotionLimits(**limits)))
    assert (len(arm.done), arm.stopped) == (done, 1)


def test_answers_without_anchors_cannot_be_followed():
    arm = Arm()
    with pytest.raises(InvalidInputError, match="look_again: the answer gives none of its actions an anchor"):
        run(arm, PredictedActions("p", answer().actions, {"findings": []}))
    assert (arm.done, arm.stopped) == ([], 1)


def test_actions_without_an_anchor_go_as_they_are():
    plan = answer()
    arm = Arm({1: {"cube": CUBE + SHIFT}})
    run(arm, PredictedActions("p", plan.actions, {"findings": []}, (None, *plan.anchors[1:])))
    assert [shift == SHIFT.tolist() for shift in shifts(arm)] == [False, True, True, False, False, False]


def frame():
    rgb = np.zeros((4, 4, 3), np.uint8)
    return RgbdFrame(Camera("front", 5, 5, 2, 2, np.eye(4)), rgb, np.ones((4, 4), np.float32), None)


MODELS = {name: {"estimator": "cuboid", "size_m": [0.05] * 3, "color": "red"} for name in ("cube", "plate")}
FOUND = {"cube": ObjectPose("cube", CUBE + SHIFT), "plate": ObjectPose("plate", PLATE)}
WENT_BY = [{"name": "cube", "position": CUBE.tolist()}, {"name": "plate", "position": PLATE.tolist()}]


def test_images_are_looked_at_by_the_service():
    arm = Arm(frames=(frame(),))
    service = Service(answer(objects=WENT_BY), {"object_models": MODELS}, found=FOUND)
    run(arm, service=service)
    assert service.asked == [["cube"], ["cube"], ["plate"], ["plate"]]
    assert [shift == SHIFT.tolist() for shift in shifts(arm)] == [True] * 3 + [False] * 3


def test_images_are_searched_for_the_object_that_axes_point_to_as_well():
    """The plate is seen aside, so that the hand comes to the cube's other side; what is touched is not looked for."""
    beside = ActionAnchor("cube", "ow", np.array([-0.1, 0, 0.1]), DOWN, toward="plate")
    plan = [("cube", action(CUBE - [0.1, 0, 0], 0.1, True)), *PICK_AND_PLACE[1:]]
    predicted = answer(plan, objects=WENT_BY)
    anchors = (beside, *predicted.anchors[1:])
    found = {"cube": ObjectPose("cube", CUBE), "plate": ObjectPose("plate", CUBE + 10 * SHIFT)}
    service = Service(None, {"object_models": MODELS}, found=found)
    service.predicted = PredictedActions("p", predicted.actions, predicted.response, anchors)
    arm = Arm(frames=(frame(),))
    run(arm, service=service)
    assert [sorted(asked) for asked in service.asked] == [["cube", "plate"], ["cube"], ["plate"], ["plate"]]
    np.testing.assert_allclose(arm.done[0] - CUBE, [0, -0.1, 0.1], atol=1e-9)


def test_an_object_that_the_service_does_not_find_is_lost():
    arm, unseen = Arm(frames=(frame(),)), ServiceProblemError(422, {"title": "Object not visible", "detail": "cube"})
    with pytest.raises(ObjectLostError, match="Object not visible"):
        run(arm, service=Service(answer(objects=WENT_BY), {"object_models": MODELS}, found=unseen))
    assert (arm.done, arm.stopped) == ([], 1)


@pytest.mark.parametrize(
    ("models", "said"),
    [({}, "its estimator is the masks"), ({**MODELS, "cube": {"estimator": "remote"}}, "its estimator is remote")],
)
def test_images_without_an_estimator_for_an_object_are_refused_at_once(models, said):
    with pytest.raises(InvalidInputError, match=said):
        run(Arm(frames=(frame(),)), service=Service(answer(objects=WENT_BY), {"object_models": models}))


@pytest.mark.parametrize("shown", [True, False])
def test_a_side_that_looks_alike_by_the_demonstrations_turns_no_hand(shown):
    """The pose of the answer has another of a cube's equal sides in front than the one that is seen then."""
    quarter = np.array([0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    finding = {"code": "symmetry-shown", "severity": "info", "where": "objects[cube]", "symmetry_deg": 90.0}
    (first, *_), at_cube = PICK_AND_PLACE, ActionAnchor("cube", "o", np.array([0, 0, 0.1]), DOWN)
    predicted = PredictedActions("p", (first[1],), {"findings": [finding] * shown}, (at_cube,))

    finder = SimpleNamespace(yaw_symmetry_deg={}, look_for=lambda name, others: {name: ObjectPose(name, CUBE, quarter)})
    follower = Follower(finder, predicted, Observation(ObjectPose("cube", CUBE, np.array([0, 0, 0, 1.0]))), print)
    assert (follower.before(0) is first[1]) is shown
