"""Which stored tasks a sentence is about: those of the key, with the objects of the scene."""

from dataclasses import replace

import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import InstructionError, ObjectSetError
from app.pipeline.steps.skills import PlanStep
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.task_settings import TaskSettings
from app.services.teach.upload_checks import Upload
from app.store import tasks
from roboprompt_client.errors import InvalidInputError
from tests.episodes import pick_trajectory

CUP, BOX, BELL = (ObjectQuery(name, (0.3, y_m, 0.8)) for name, y_m in (("cup", 0.2), ("box", 0.0), ("bell", -0.2)))
TASKS = {
    "fill": ((CUP, BOX), "put the cup in the box"),
    "open": ((BOX,), "open the box"),
    "ring": ((BELL,), "press the bell"),
}
SCENE = (CUP, BOX, BELL)


@pytest.fixture
def services(scripted):
    wired = scripted("[]")
    for task, (objects, instruction) in TASKS.items():
        teach(wired, task, instruction, objects)
    return wired


def teach(services, task, instruction, objects):
    episode = Episode(instruction, pick_trajectory(objects[0].position_m))
    services.upload_episode(Upload(task, episode, objects, {}))


def test_a_plan_takes_the_tasks_whose_objects_are_there(services):
    steps = services.read_steps("open the box and put the cup in it, then press the bell twice", SCENE)
    assert steps == tuple(PlanStep(task, TASKS[task][1]) for task in ("open", "fill", "ring", "ring"))
    with pytest.raises(InstructionError) as refused:
        services.read_steps("open the box and put the cup in it", (BOX, BELL))
    assert refused.value.valid.endswith("not with these objects: fill (not seen: cup)")


def test_a_task_that_changed_is_read_again(services):
    said = "open the crate"
    with pytest.raises(InstructionError):
        services.read_steps(said, SCENE)
    with services.store.write() as connection:
        tasks.update_settings(connection, "open", TaskSettings(aliases={"box": ("crate",)}).model_dump(mode="json"))
    assert services.read_steps(said, SCENE) == (PlanStep("open", "open the box"),)


@pytest.mark.parametrize(
    ("objects", "why"),
    [
        ((CUP,), "no task is about these objects"),
        ((BOX, BOX), "given twice: box"),
        ((BOX, ObjectQuery("Box")), "one name"),
    ],
)
def test_objects_of_no_task_and_ambiguous_objects_are_refused(services, objects, why):
    with pytest.raises(ObjectSetError, match=why):
        services.read_steps("open the box", objects)


def test_a_prediction_without_a_task_is_of_the_one_that_fits(services):
    request = PredictRequest("", "open the box", (BOX,))
    assert services.read_steps.with_task(request) == replace(request, task="open")


@pytest.mark.parametrize(
    ("said", "objects", "error", "why"),
    [
        (
            "close the box",
            (BOX,),
            InstructionError,
            r"open: 'open the box'; not with these objects: fill \(not seen: cup\)",
        ),
        ("open the box", (BOX, CUP), InstructionError, r"open \(not of this task: cup\)"),
        ("open the box", (CUP, BELL), ObjectSetError, r"ring \(not of this task: cup\)"),
    ],
)
def test_a_prediction_that_no_task_fits_lists_them_with_the_reasons(services, said, objects, error, why):
    with pytest.raises(error, match=why):
        services.read_steps.with_task(PredictRequest("", said, objects))


def test_of_many_tasks_a_refusal_lists_the_ten_with_the_nearest_words(services):
    for number in range(12):
        teach(services, f"other_{number}", "polish the lamp", (ObjectQuery("lamp", (0.3, 0.1, 0.8)),))
    with pytest.raises(InstructionError) as refused:
        services.read_steps("close the box", (BOX,))
    usable, rest = refused.value.valid.split("; ", 1)
    others, more = rest.rsplit("; ", 1)
    assert usable == "open: 'open the box'"
    assert "not with these objects: fill (not seen: cup); other_0" in others
    assert (others.count("other_"), more) == (8, "and 5 more tasks")
    with pytest.raises(ObjectSetError) as unknown:
        services.read_steps("polish the lamp", (ObjectQuery("mat"),))
    assert unknown.value.valid.startswith("not with these objects: other_0 (not seen: lamp)")
    assert unknown.value.valid.endswith("other_7 (not seen: lamp); and 5 more tasks")


def test_a_prediction_that_two_tasks_fit_is_refused(services):
    teach(services, "unpack", "open the box", (BOX,))
    with pytest.raises(InstructionError, match=r"'open the box' \(open\) or 'open the box' \(unpack\)"):
        services.read_steps.with_task(PredictRequest("", "open the box", (BOX,)))


def test_a_prediction_is_of_one_task_alone(services):
    teach(services, "shut", "close the box", (BOX,))
    with pytest.raises(InstructionError, match=r"asks for open, shut one after the other .*POST /plans"):
        services.read_steps.with_task(PredictRequest("", "open the box, then close it", (BOX,)))


def test_named_episodes_need_their_task(services):
    request = PredictRequest("", "open the box", (BOX,), options=PredictOptions(episode_ids=("1",)))
    with pytest.raises(InvalidInputError, match="is left out beside episode_ids"):
        services.read_steps.with_task(request)
