"""A task that nobody has shown, with demonstrations of others: two are taught, the third is only set up."""

import asyncio
from dataclasses import replace

import pytest

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import ObjectSetError, UngroundedInstructionError
from app.services.errors import NoDemonstrationsError, UnsafeReplyError
from app.services.predict.evidence import explain_prediction, task_stats
from app.services.predict.lent import shares
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.predict.select import Demonstrations
from app.services.teach.upload import Upload
from app.store import episodes, predictions
from app.store.errors import ForbiddenTaskError
from app.store.visibility import Visibility, seeing
from roboprompt_client.errors import InvalidInputError
from tests.episodes import pick_trajectory
from tests.services.conftest import written
from tests.services.test_upload_episode import respond

PICKED_M = [(0.1, 0.1 + 0.05 * k, 0.78) for k in range(5)]
BASE = ModelProfile("base", "completion", True, "object_frame", "paper", "b")
CHAT = replace(BASE, style="chat", grammar=False, representation="absolute", system_prompt="a")
ROWS = " 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0"
SCENE = (ObjectQuery("mug", (0.2, -0.1, 0.78)), ObjectQuery("shelf", (0.4, -0.3, 0.9)))
ASKED = PredictRequest("fetch", "fetch the mug", SCENE, options=PredictOptions(demonstrations_from=("pick", "press")))


def teach(services, task, name, instruction, places_m, extra=()):
    for place_m in places_m:
        objects = (ObjectQuery(name, place_m), *(ObjectQuery(other, (0.0, -0.4, 0.8)) for other in extra))
        services.upload_episode(Upload(task, Episode(instruction, pick_trajectory(place_m)), objects, {}), respond)


@pytest.fixture
def services(scripted):
    wired = scripted(ROWS, profile=replace(BASE, name="scripted"))
    teach(wired, "pick", "cube", "pick up the cube", PICKED_M)
    teach(wired, "press", "button", "press the button", PICKED_M[:3], extra=("lamp",))
    wired.configure_task("fetch", {})
    return wired


def question(services, profile=BASE, request=ASKED, **options):
    return written(services, profile, request.with_options(**options))


def lent(services, question):
    """How many of its demonstrations are of which task, in their order."""
    with services.store.read() as connection:
        return [episodes.get(connection, id_).task for id_ in question.prefix.demonstration_ids]


def test_the_prompt_shows_other_tasks_and_asks_for_this_one(services):
    asked = question(services)
    assert lent(services, asked) == ["pick"] * 5 + ["press"] * 3
    *shown, query = asked.prompt.user.split("\n")
    assert [line.split(";")[1] for line in shown] == [" pick up the cube > 1 A w: +0 +0 +20 0 36 36 1"] * 3 + [
        " B lamp 29 9 19"
    ] * 3
    assert query == "A mug 49 39 17; B shelf 69 19 29; fetch the mug >"


def test_a_chat_model_gets_the_papers_format_with_their_instructions(services):
    prompt = question(services, CHAT, num_demonstrations=4).prompt
    assert prompt.system.startswith("You are a Franka Panda robot")
    assert prompt.user.count("'pick up the cube'}>[[") == prompt.user.count("'press the button'}>[[") == 2
    assert prompt.user.endswith("{'mug': [49, 39, 17], 'shelf': [69, 19, 29], 'fetch the mug'}>")


@pytest.mark.parametrize(("number", "tasks", "each"), [(10, 3, [3, 3, 4]), (3, 3, [1, 1, 1]), (8, 3, [2, 3, 3])])
def test_what_is_left_over_comes_from_the_last(number, tasks, each):
    assert shares(number, tasks) == each


def test_the_last_task_stands_nearest_to_the_question(services):
    asked = question(services, demonstrations_from=("press", "pick"), num_demonstrations=3)
    assert lent(services, asked) == ["press", "pick", "pick"]


def test_similar_finds_the_tasks_by_their_words(services):
    fetched = replace(ASKED, instruction="pick up the mug", objects=(ObjectQuery("mug", (0.2, -0.1, 0.78)),))
    assert set(lent(services, question(services, request=fetched, demonstrations_from="similar"))) == {"pick"}
    unrelated = question(services, demonstrations_from="similar")
    assert set(lent(services, unrelated)) == {"pick", "press"}
    assert lent(services, unrelated)[-1] == "press", "which has two objects, too"


def test_similar_leaves_out_the_task_itself_and_those_that_the_key_is_not_for(services):
    options = PredictOptions(demonstrations_from="similar")
    pick = PredictRequest("pick", "pick up the cube", (ObjectQuery("cube", PICKED_M[0]),), options=options)
    assert set(lent(services, question(services, request=pick))) == {"press"}
    with seeing(Visibility("k", ("fetch", "press"))):
        assert set(lent(services, question(services, demonstrations_from="similar"))) == {"press"}
    with seeing(Visibility("k", ("fetch",))), pytest.raises(InvalidInputError, match="no other task has episodes"):
        question(services, demonstrations_from="similar")


def test_a_task_that_the_key_is_not_for_lends_nothing(services):
    question(services)  # what is kept for others must not be handed out
    with seeing(Visibility("k", ("fetch", "press"))):
        with pytest.raises(ForbiddenTaskError, match="'pick'"):
            question(services)
        with pytest.raises(ForbiddenTaskError, match="'no task'") as refused:
            question(services, demonstrations_from=("press", "no task"))
        assert refused.value.field == "demonstrations_from[1]"
        assert set(lent(services, question(services, demonstrations_from=("press",)))) == {"press"}


def test_the_answer_says_that_nobody_has_shown_this_task(services):
    findings = question(services).findings
    assert [(finding.code, finding.severity) for finding in findings] == [("other-tasks-demonstrations", "danger")]
    assert "pick (5), press (3)" in findings[0].message


def test_no_plan_of_another_task_holds_the_actions_but_the_bounds_of_motion_do(services):
    predicted = asyncio.run(services.predict_actions(ASKED))
    assert [action.row for action in predicted.reply.actions] == [None] * 3
    assert predicted.reply.actions[1].action.position_m.tolist() == pytest.approx([0.2, -0.1, 0.78])
    box = {"min": [0.15, -0.15, 0.7], "max": [0.25, -0.05, 0.75]}
    services.configure_task("fetch", {"motion_limits": {"keep_out": [box]}})
    with pytest.raises(UnsafeReplyError, match="keep_out"):
        asyncio.run(services.predict_actions(ASKED))


def test_it_is_kept_and_counted_apart(services):
    predicted = asyncio.run(
        services.predict_actions(replace(ASKED, as_sent={"demonstrations_from": ["pick", "press"]}))
    )
    with services.store.read() as connection:
        record = predictions.get(connection, predicted.id)
    assert record.demonstration_ids == predicted.question.prefix.demonstration_ids
    assert record.findings[0]["code"] == "other-tasks-demonstrations"
    assert explain_prediction(record, Demonstrations((), ())).deviations == ()
    (standing,) = task_stats(services.store, "fetch").configurations
    assert standing.counts.selection == "other tasks"


def test_samples_may_see_them_in_different_orders(services):
    asked = question(services, num_samples=3, permute_demonstrations=True)
    orders = {sample.prefix.demonstration_ids for sample in asked.samples}
    assert len(orders) == 3
    assert len({frozenset(order) for order in orders}) == 1
    assert all(sample.prompt.query == asked.prompt.query for sample in asked.samples)


def test_what_is_taught_later_is_shown(services):
    before = question(services, selection="recent").prefix.demonstration_ids
    teach(services, "press", "button", "press the button", [(0.3, 0.3, 0.78)], extra=("lamp",))
    assert question(services, selection="recent").prefix.demonstration_ids != before


def test_own_episodes_fix_the_objects_and_are_not_shown(services):
    teach(services, "fetch", "mug", "fetch the mug", PICKED_M[:1], extra=("shelf",))
    assert set(lent(services, question(services))) == {"pick", "press"}
    with pytest.raises(ObjectSetError, match="missing: shelf"):
        question(services, request=replace(ASKED, objects=SCENE[:1]))


def test_an_object_stands_once_in_a_scene(services):
    with pytest.raises(ObjectSetError, match="given twice: mug"):
        question(services, request=replace(ASKED, objects=(*SCENE, SCENE[0])))


def test_its_objects_must_be_there_and_its_words_need_not_be_taught(services):
    (part,) = question(services, request=replace(ASKED, instruction="juggle the mug")).parts
    assert part.instruction == "juggle the mug"
    with pytest.raises(UngroundedInstructionError, match="the spoon' is none of"):
        question(services, request=replace(ASKED, instruction="fetch the spoon from the shelf"))
    with pytest.raises(UngroundedInstructionError, match="names no object"):
        question(services, request=replace(ASKED, instruction="tidy up"))


@pytest.mark.parametrize(
    ("options", "field", "valid"),
    [
        ({"demonstrations_from": ("pick", "nope")}, "demonstrations_from[1]", "pick, press"),
        ({"demonstrations_from": ("empty",)}, "demonstrations_from[0]", "pick, press"),
        ({"demonstrations_from": ("pick", "fetch")}, "demonstrations_from[1]", "other tasks"),
        ({"num_demonstrations": 1}, "num_demonstrations", "2 or more"),
        ({"episode_ids": ("one",)}, "episode_ids", "one of the two"),
        ({"closed_loop": True}, "closed_loop", "no demonstrations_from"),
        ({"after": "step"}, "after", "no demonstrations_from"),
        ({"selection": "nearest"}, "selection", "first, recent, random or diverse"),
    ],
)
def test_what_does_not_go_is_refused(services, options, field, valid):
    services.configure_task("empty", {})
    with pytest.raises(InvalidInputError) as refused:
        question(services, **options)
    assert refused.value.field == field
    assert valid in refused.value.valid


@pytest.mark.parametrize("name", ["similar", "sim", "a"])
def test_a_tasks_name_may_be_a_part_of_the_word(services, name):
    services.configure_task(name, {})
    options = PredictOptions(demonstrations_from="similar")
    assert lent(services, question(services, request=replace(ASKED, task=name, options=options)))


def test_demonstrations_outside_of_the_workspace_are_refused(services):
    services.configure_task("fetch", {"workspace": {"min": [0.0, -0.5, 0.6], "max": [0.7, 0.2, 1.6]}})
    with pytest.raises(InvalidInputError, match=r"'pick' reach .* outside of the workspace of 'fetch'") as refused:
        question(services)
    assert refused.value.field == "demonstrations_from[0]"
    assert refused.value.valid.startswith("PUT /tasks/fetch with a workspace")


def test_without_the_field_a_task_that_nobody_showed_stays_without_an_answer(services):
    with pytest.raises(NoDemonstrationsError):
        question(services, demonstrations_from=None)
