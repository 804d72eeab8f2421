"""What is asked of the LLM: clause by clause, and read while it arrives."""

import asyncio
from contextlib import aclosing
from dataclasses import replace

import pytest

from app.llm.base import ModelResponseError, TextDelta
from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import ReplyParseError
from app.services.errors import RefusedReplyError
from app.services.measures import timings_of_its_own
from app.services.predict.part_reply import PredictedAction
from app.services.predict.record import Prediction
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.teach.upload_checks import Upload
from roboprompt_client.errors import InvalidInputError
from tests.episodes import pick_trajectory
from tests.services.conftest import with_options
from tests.services.test_predict_actions import ask, recorded
from tests.services.test_upload_episode import upload

ROW = "[50, 50, 20, 0, 36, 36, 1]"
RELATIVE = " 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0\n"
CUBE = (ObjectQuery("cube", (0.2, 0.1, 0.8)),)
REQUEST = PredictRequest("pick", "pick up the cube", CUBE, options=PredictOptions(representation="object_frame"))


@pytest.fixture
def taught(scripted):
    def wire(*replies, **options):
        services = scripted(*replies, **options)
        services.upload_episode(upload("cube"))
        return services

    return wire


def streamed(services, request=REQUEST):
    """Everything that comes, and the error at the end."""

    async def collect():
        items = []
        question = await services.predict_actions.prepare(request)
        with timings_of_its_own():
            async with aclosing(services.predict_actions.stream(question)) as answer:
                try:
                    async for item in answer:
                        items.append(item)
                except Exception as error:
                    return items, error
        return items, None

    return asyncio.run(collect())


def test_each_clause_is_asked_for_after_the_replies_before(taught):
    services = taught(RELATIVE)
    twice = replace(REQUEST, instruction="pick up the cube, then pick up the cube")
    prediction = ask(services, twice)
    assert len(prediction.reply.actions) == 6
    last = prediction.reply.prompt.user.splitlines()
    assert last[-2].endswith(f"pick up the cube >{RELATIVE.rstrip()}")
    assert last[-1].endswith("pick up the cube >")
    assert prediction.reply.text.count("1 A w") == 2
    (record,) = recorded(services.store)
    assert (record.prompt_user, len(record.actions)) == (prediction.reply.prompt.user, 6)


TWICE = replace(REQUEST, instruction="pick up the cube, then pick up the cube")
FAR = RELATIVE.replace("+0 +0 +0 0", "+0 +20 +0 0")


def test_an_unsupported_action_of_a_later_clause_is_named_by_its_place_among_all(taught):
    services = taught(RELATIVE, FAR)
    with pytest.raises(RefusedReplyError) as caught:
        ask(services, TWICE)
    assert caught.value.cause.field == "actions[4]"
    (record,) = recorded(services.store)
    assert (record.status, record.actions) == ("unsupported", None)


def test_a_reply_that_ends_too_early_is_refused(taught):
    services = taught("[[60, 50, 20, 0, 36, 36, 1], [60, 50, 10, 0, 36, 36, 0]]")
    with pytest.raises(RefusedReplyError, match="3 actions") as caught:
        ask(services, with_options(REQUEST, representation="absolute"))
    assert caught.value.cause.field == "actions[2]"


def test_an_unsupported_action_is_let_pass_with_a_finding(taught):
    prediction = ask(taught(RELATIVE, FAR), with_options(TWICE, unsupported="allow"))
    assert len(prediction.reply.actions) == 6
    dangers = [(finding.code, finding.where) for finding in prediction.findings if finding.severity == "danger"]
    assert ("unusual-action", "actions[4]") in dangers


@pytest.mark.parametrize(("vase_m", "codes"), [((0.2, 0.11, 0.93), ["passes-close"]), ((0.2, 0.3, 0.93), [])])
def test_what_stands_in_the_way_is_a_finding_of_answer_record_and_stream(scripted, vase_m, codes):
    """The hand comes down and goes up over the cube; demonstrations had the vase far from there."""
    services = scripted(RELATIVE)
    for place_m in ((0.1, 0.1, 0.78), (0.15, 0.0, 0.78), (0.2, -0.1, 0.78)):
        objects = (ObjectQuery("cube", place_m), ObjectQuery("vase", (0.2, 0.3, 0.93)))
        services.upload_episode(Upload("pick", Episode("pick up the cube", pick_trajectory(place_m)), objects, {}))
    asked = replace(REQUEST, objects=(*CUBE, ObjectQuery("vase", vase_m)))
    dangers = [finding for finding in ask(services, asked).findings if finding.where == "objects[vase]"]
    assert [finding.code for finding in dangers if finding.severity == "danger"] == codes
    items, error = streamed(services, asked)
    assert error is None
    assert [finding.code for finding in items[-1].findings if finding.code == "passes-close"] == codes
    for record in recorded(services.store):
        assert [found["code"] for found in record.findings if found["code"] == "passes-close"] == codes


def test_too_many_clauses_for_the_actions_allowed(taught):
    services = taught(RELATIVE)
    thrice = with_options(TWICE, max_actions=3)
    with pytest.raises(InvalidInputError, match="is 3, but the 2 parts of the instruction take 6 actions or more"):
        ask(services, thrice)


def test_actions_are_allowed_as_the_plans_need_unless_the_request_says_how_many(taught):
    services = taught(RELATIVE)
    nine = replace(TWICE, instruction=", then ".join(["pick up the cube"] * 9))
    assert len(ask(services, nine).reply.actions) == 27
    with pytest.raises(InvalidInputError, match="is 25, but the 9 parts of the instruction take 27 actions or more"):
        ask(services, with_options(nine, max_actions=25))


def test_the_papers_format_asks_for_a_whole_instruction_at_once(taught):
    services = taught(f"[{ROW}]")
    both = with_options(TWICE, representation="absolute", unsupported="allow")
    assert "then" in ask(services, both).reply.prompt.query


def test_actions_come_while_the_reply_arrives(taught):
    items, error = streamed(taught(RELATIVE, delay_s=0.02))
    assert error is None
    assert [type(item) for item in items] == [PredictedAction] * 3 + [Prediction]
    assert items[-1].reply.actions == items[:3]
    timings_ms = items[-1].timings_ms
    assert timings_ms["first_action"] < timings_ms["llm"]


def test_a_reply_that_goes_wrong_in_the_middle_ends_there(taught):
    services = taught(RELATIVE.replace("3 A", "5 A") + "; ; ;")
    items, error = streamed(services)
    assert [type(item) for item in items] == [PredictedAction] * 2
    assert isinstance(error.cause, ReplyParseError)
    (record,) = recorded(services.store)
    assert (record.id, record.status, record.actions) == (error.prediction_id, "parse_error", None)
    assert record.reply_text.startswith(" 1 A w")


def test_a_model_that_fails_after_a_clause_keeps_what_it_said(taught):
    services = taught(RELATIVE, ModelResponseError("out of order"))
    with pytest.raises(ModelResponseError):
        ask(services, replace(REQUEST, instruction="pick up the cube, then pick up the cube"))
    (record,) = recorded(services.store)
    assert (record.status, record.reply_text.strip()) == ("model_error", RELATIVE.strip())


def test_the_text_comes_in_pieces_if_it_is_wished(taught):
    items, error = streamed(taught(RELATIVE), with_options(REQUEST, stream_text=True))
    assert error is None
    pieces = [item.text for item in items if isinstance(item, TextDelta)]
    assert len(pieces) > 3
    assert "".join(pieces) == items[-1].reply.text
    assert sum(isinstance(item, PredictedAction) for item in items) == 3
    assert not any(isinstance(item, TextDelta) for item in streamed(taught(RELATIVE))[0])


def test_pieces_of_a_reply_that_goes_wrong_come_before_the_error(taught):
    items, error = streamed(taught("no list of actions"), with_options(REQUEST, stream_text=True))
    assert isinstance(error.cause, ReplyParseError)
    assert "".join(item.text for item in items) == error.reply_text == "no list of actions"


def test_one_part_of_two_that_were_shown_together_is_in_danger(scripted):
    services = scripted(RELATIVE)
    one = upload("cube")
    services.upload_episode(replace(one, episode=replace(one.episode, instruction=TWICE.instruction)))
    codes = [(finding.code, finding.severity) for finding in ask(services, REQUEST).findings]
    assert ("new-instruction", "danger") in codes
    assert "new-instruction" not in [finding.code for finding in ask(services, TWICE).findings]
