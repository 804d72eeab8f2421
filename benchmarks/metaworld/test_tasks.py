import numpy as np

from benchmarks.metaworld.tasks import GOAL, OBJECT_1, OBJECT_2, TASKS, observed_objects


def observation(first=(0.1, 0.6, 0.02), second=(0, 0, 0), goal=(0.1, 0.8, 0.1)):
    made = np.zeros(39)
    made[OBJECT_1], made[OBJECT_2], made[GOAL] = first, second, goal
    return made


def names(task, **places):
    return [each.name for each in observed_objects(TASKS[task], observation(**places))]


def test_half_of_meta_world():
    assert len(TASKS) == 25
    assert all(task.instruction and any(task.object_names) for task in TASKS.values())


def test_objects_are_those_that_the_task_names_at_places_that_are_filled():
    objects = observed_objects(TASKS["push"], observation())
    places = [(each.name, each.position_m.tolist(), each.quaternion_xyzw) for each in objects]
    assert places == [("puck", [0.1, 0.6, 0.02], None), ("goal", [0.1, 0.8, 0.1], None)]
    assert names("hammer", second=(0.2, 0.7, 0.1)) == ["hammer", "nail", "goal"]
    assert names("hammer") == ["hammer", "goal"]
    assert names("push", second=(0.2, 0.7, 0.1)) == ["puck", "goal"]


def test_an_object_at_the_place_of_another_is_reported_once():
    assert names("push", goal=(0.1, 0.6, 0.0205)) == ["puck"]
    assert names("push", goal=(0.1, 0.6, 0.0215)) == ["puck", "goal"]
