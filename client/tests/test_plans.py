"""A plan is carried out step by step, with a new look before each, and ends at the first doubt."""

from dataclasses import replace

import numpy as np
import pytest
from arms import ANSWER, Arm, Service

from roboprompt_client.answers import Outcome, PlannedStep
from roboprompt_client.errors import (
    DangerError,
    MotionError,
    NotConfirmedError,
    RoboPromptError,
    ServiceProblemError,
    StepFailedError,
)
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_plan
from roboprompt_client.types.poses import ObjectPose

STEPS = (PlannedStep("open", "open the box"), PlannedStep("fill", "put the cup in the box"))
OBJECTS = {"open": ["box"], "fill": ["cup", "box"]}
DANGER = replace(ANSWER, response={"findings": [{"severity": "danger", "message": "beyond the demonstrations"}]})


class Robot(Arm):
    """A robot that sees more than any task is about, and something moved at every look."""

    def __init__(self):
        super().__init__()
        self.looks = 0

    def observe(self):
        self.looks += 1
        place_m = np.array([0.1 * self.looks, 0.0, 0.0])
        seen = [ObjectPose(name, place_m) for name in ("cup", "bell")]
        return Observation(seen, to_find="box", mask_ids={"bell": (1,), "box": (2,)})


class Planner(Service):
    """A service that plans `STEPS`, and answers or raises what it is given for each."""

    def __init__(self, *answers):
        super().__init__(ANSWER)
        self._answers, self.questions, self.outcomes = list(answers), [], []

    def plan(self, text, objects):
        self.planned = text, [item if isinstance(item, str) else item.name for item in objects]
        return STEPS

    def get(self, path):
        return {"object_names": OBJECTS[path.removeprefix("/tasks/")]}

    def predict(self, task, instruction, observation, **options):
        self.questions.append((task, instruction, observation, options))
        answer = self._answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def record_outcome(self, prediction_id, success, note):
        self.outcomes.append((prediction_id, success, note))


def test_each_step_is_asked_about_its_own_objects_as_they_are_then():
    robot, planner = Robot(), Planner(ANSWER, ANSWER)
    assert run_plan(planner, robot, "fill the box", model="nearest") == [ANSWER, ANSWER]
    assert planner.planned == ("fill the box", ["cup", "bell", "box"])
    asked = [
        (task, said, [pose.name for pose in seen.objects], seen.to_find) for task, said, seen, _ in planner.questions
    ]
    assert asked == [("open", "open the box", [], ("box",)), ("fill", "put the cup in the box", ["cup"], ("box",))]
    assert [seen.mask_ids for _, _, seen, _ in planner.questions] == [{"box": (2,)}] * 2
    assert planner.questions[1][2].objects[0].position_m[0] == pytest.approx(0.3)
    assert planner.questions[0][3] == {"model": "nearest"}
    assert (len(robot.heights), robot.stopped) == (6, 0)


def test_the_reach_of_each_step_is_checked_before_it_moves():
    robot = Robot()
    robot.check_plan = lambda actions: (_ for _ in ()).throw(MotionError(f"{len(actions)} out of reach"))
    with pytest.raises(MotionError, match="3 out of reach"):
        run_plan(Planner(ANSWER, ANSWER), robot, "fill the box")
    assert (robot.heights, robot.stopped) == ([], 1)


NOTHING = replace(ANSWER, actions=())
REFUSED = ServiceProblemError(422, {"title": "no"})


@pytest.mark.parametrize(
    ("answers", "outcomes", "error", "moved"),
    [
        ([REFUSED], [], ServiceProblemError, 0),
        ([DANGER], [], DangerError, 0),
        ([NOTHING], [], StepFailedError, 0),
        ([ANSWER], [Outcome(success=False, note="it slipped")], StepFailedError, 3),
        ([ANSWER], [None], StepFailedError, 3),
        ([ANSWER, REFUSED], [Outcome(success=True)], ServiceProblemError, 3),
    ],
)
def test_the_first_doubt_ends_it(answers, outcomes, error, moved):
    robot, planner, said = Robot(), Planner(*answers), list(outcomes)
    with pytest.raises(error):
        run_plan(planner, robot, "fill the box", on_outcome=lambda predicted: said.pop(0))
    assert (len(robot.heights), robot.stopped, said) == (moved, 1, [])
    assert planner.outcomes == [("p", *outcome) for outcome in outcomes if outcome]


def test_a_failed_step_is_named_with_the_reason():
    with pytest.raises(StepFailedError, match="step 1 of 2, 'open the box': it slipped"):
        run_plan(Planner(ANSWER), Robot(), "fill", on_outcome=lambda predicted: Outcome(False, "it slipped"))


def test_a_person_sees_the_steps_before_anything_moves():
    robot, shown = Robot(), []
    with pytest.raises(NotConfirmedError, match="the plan was not allowed"):
        run_plan(Planner(), robot, "fill the box", confirm_steps=shown.append)
    assert (shown, robot.heights) == ([STEPS], [])


def test_what_is_no_plan_moves_nothing():
    robot, planner = Robot(), Planner()
    planner.plan = lambda text, objects: (_ for _ in ()).throw(REFUSED)
    with pytest.raises(RoboPromptError):
        run_plan(planner, robot, "dance")
    assert robot.heights == []
