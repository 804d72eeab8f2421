import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.reply import ReplyReader
from app.pipeline.representation.absolute import AbsoluteCodec
from app.pipeline.workspace import discretize_actions
from tests.pipeline.asking import grammar_of, parse_reply, schema_of

from ..gbnf import matches
from ..scenes import WORKSPACE, action, demonstration, pose
from .wrong_lists import wrong_lists

DRAWER = pose("drawer", (0.125, 0.155, 0.895))
LID, JAR = pose("lid", (0.0, 0.0, 1.0), 45), pose("jar", (0.4, -0.2, 0.8), -90)
ROW = "[46, 74, 55, 54, 36, 37, 1]"
ROW_2 = "[46, 74, 60, 0, 36, 71, 0]"
BINS, BINS_2 = (46, 74, 55, 54, 36, 37, 1), (46, 74, 60, 0, 36, 71, 0)
ACTIONS = (action((0.165, 0.245, 1.155), (90, 0, 5)), action((0.165, 0.245, 1.205), (-180, 0, 175), False))
OPEN = demonstration("open the drawer", [DRAWER], ACTIONS)


def fitted(*demonstrations, with_instruction=True):
    return AbsoluteCodec(WORKSPACE, tuple(demonstrations) or (OPEN,), with_instruction)


@pytest.mark.parametrize(
    ("objects", "with_instruction", "expected"),
    [
        ([DRAWER], False, "{'drawer': [42, 65, 29]}>"),
        ([DRAWER], True, "{'drawer': [42, 65, 29], 'open the drawer'}>"),
        ([LID], False, "{'lid': [29, 49, 39, 36, 36, 45]}>"),
        ([LID, JAR], False, "{'lid': [29, 49, 39, 36, 36, 45], 'jar': [69, 29, 19, 36, 36, 18]}>"),
        ([DRAWER, LID], True, "{'drawer': [42, 65, 29], 'lid': [29, 49, 39, 36, 36, 45], 'open the drawer'}>"),
    ],
)
def test_observation_text(objects, with_instruction, expected):
    codec = fitted(with_instruction=with_instruction)
    assert codec.observation_text(Query("open the drawer", objects)) == expected


def test_demonstration_text():
    assert fitted().actions_text(OPEN) == f"[{ROW}, {ROW_2}]"
    assert fitted().demonstration_text(OPEN) == f"{{'drawer': [42, 65, 29], 'open the drawer'}}>[{ROW}, {ROW_2}], "
    authors = fitted(with_instruction=False)
    assert authors.demonstration_text(OPEN) == f"{{'drawer': [42, 65, 29]}}>[{ROW}, {ROW_2}], "


def read(reply_text):
    """The bins of a reply's actions."""
    seen = parse_reply(reply_text, fitted(), [DRAWER], OPEN.instruction)
    return [discrete.bins for discrete in discretize_actions(seen, WORKSPACE)]


@pytest.mark.parametrize(
    "reply_text",
    [
        f"[{ROW}, {ROW_2}]",
        f"  [{ROW},{ROW_2}]\n",
        f"[ [ 46 ,74,55,54,36,37,1 ]\t, {ROW_2} ]",
        f"```json\n[{ROW}, {ROW_2}]\n```",
        f"Here are the actions:\n```json\n[{ROW}, {ROW_2}]\n```\nGood luck!",
        f"Sure, I open it (slowly): [{ROW}, {ROW_2}]",
        f"[{ROW}, {ROW_2}], ",
        f"[{ROW}, {ROW_2}]\nThese match the trend [of the demos] and end [].",
        f"[[46.0, 74.0, 55, 54, 36, 37, 1.0], {ROW_2}]",
        f"[[46, 7.4e1, 55, 54, 36, 37, 1], {ROW_2}]",
        f'{{"actions": [{ROW}, {ROW_2}]}}',
        f"```json\n[{ROW}, {ROW_2}]",
    ],
)
def test_accepted_replies(reply_text):
    assert read(reply_text) == [BINS, BINS_2]


@pytest.mark.parametrize("reply_text", [ROW, f"```json\n{ROW}\n```", f"One action: {ROW}.", "[46.0,74,55,54,36,37,1]"])
def test_a_flat_list_of_seven_is_one_action(reply_text):
    assert read(reply_text) == [BINS]


REFUSED = {
    "": "0 lists",
    "[[]]": "action 0 has 0 elements",
    f"[{ROW}] or [{ROW_2}]": "2 lists",
    f"{ROW}, {ROW_2}": "2 lists",
    f"```\n[{ROW}]\n```\n```\n[{ROW_2}]\n```": "2 code fences",
    f"```\n[{ROW}]\n[{ROW_2}]\n```": "2 lists",
    # cut off
    f"[{ROW}, {ROW_2}": "not complete",
    "[46, 74, 55, 54, 36, 37": "not complete",
    # not seven integers in range
    "[[46, 74, 55, 54, 36, 37]]": "action 0 has 6 elements, expected 7",
    "[[100, 74, 55, 54, 36, 37, 1]]": "action 0: x is 100, expected an integer from 0 to 99",
    "[[46, -1, 55, 54, 36, 37, 1]]": "action 0: y is -1",
    "[[46, 74, 55, 72, 36, 37, 1]]": "action 0: roll is 72, expected an integer from 0 to 71",
    f"[{ROW}, [46, 74, 55, 54, 36, 72, 1]]": "action 1: yaw is 72",
    "[[46, 74, 55, 54, 36, 37, 2]]": "action 0: gripper is 2, expected an integer from 0 to 1",
    "[[46.5, 74, 55, 54, 36, 37, 1]]": "action 0: x is 46.5",
    "[[NaN, 74, 55, 54, 36, 37, 1]]": "action 0: x is nan",
    "[[46, 74, 1e999, 54, 36, 37, 1]]": "action 0: z is inf",
    f"[[{'9' * 400}, 74, 55, 54, 36, 37, 1]]": "action 0: x is 9999",
    f"[[{'9' * 5000}, 74, 55, 54, 36, 37, 1]]": "not complete or not valid",
    "[[46, 74, 55, 54, 36, 37, true]]": "action 0: gripper is True",
    '[["46", 74, 55, 54, 36, 37, 1]]': "action 0: x is '46'",
    '["46", "74", "55", "54", "36", "37", "1"]': "0 lists",
    "[[46, 74, 55, 54, 36, 37, 1,]]": "not valid",
    # nested
    f"[[{ROW}]]": "action 0 is not a list of numbers",
    f"[{ROW}, 5]": "action 1 is not a list of numbers",
    '[[46, 74, 55, 54, 36, 37, {"a": 1}]]': "action 0 is not a list of numbers",
    # hostile
    f"[{', '.join([ROW] * 26)}]": "26 actions, more than 25",
    "[" * 50_000: "not valid",
    "[ " * 50_000: "not valid",
    "[" * 900 + "]" * 900: "not a list of numbers",
    '["a",' * 20_000: "0 lists",
    "[x" * 50_000: "0 lists",
    " " * 100_001: "longer than 100000",
    f"[{ROW}]" + " " * 100_000: "longer than 100000",
}


@pytest.mark.parametrize(("reply_text", "message"), REFUSED.items(), ids=lambda text: text[:40])
def test_refused_replies_carry_their_text(reply_text, message):
    with pytest.raises(ReplyParseError) as caught:
        parse_reply(reply_text, fitted(), [DRAWER], OPEN.instruction)
    assert message in caught.value.message
    assert len(caught.value.message) < 200
    assert caught.value.reply_text == reply_text


@pytest.mark.parametrize("depth", range(975, 995))
def test_no_depth_of_nesting_gets_through(depth):
    for opening, closing in (("[", "]"), ('{"a":', "}")):
        text = f"[[1, 2, 3, 4, 5, 6, {opening * depth}1{closing * depth}]]"
        assert ReplyReader(fitted(), Query(OPEN.instruction, (DRAWER,))).feed(text) == []
        with pytest.raises(ReplyParseError):
            parse_reply(text, fitted(), [DRAWER], OPEN.instruction)


BIN_ROWS = st.tuples(*[st.integers(0, 99)] * 3, *[st.integers(0, 71)] * 3, st.integers(0, 1)).map(list)


@given(st.lists(BIN_ROWS, min_size=1, max_size=25))
def test_every_row_of_bins_is_written_and_read(rows):
    seen = parse_reply(str(rows), fitted(), [DRAWER], OPEN.instruction)
    shown = demonstration("open", [DRAWER], seen)
    again = parse_reply(fitted().actions_text(shown), fitted(), [DRAWER], OPEN.instruction)
    for first, second in zip(seen, again, strict=True):
        np.testing.assert_allclose(first.position_m, second.position_m)
        np.testing.assert_allclose(abs(first.quaternion_xyzw @ second.quaternion_xyzw), 1, atol=1e-9)
    assert matches(grammar_of(fitted(shown), "open"), str(rows))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"[{ROW}]", False),
        (f"[{ROW}, {ROW_2}]", True),
        (f"[{ROW}, {ROW_2}, {ROW}]", True),
        (f"[{ROW}, {ROW_2}, {ROW}, {ROW}]", False),
        (f"[{ROW},{ROW_2}]", False),
        (f"[{ROW}, [100, 74, 55, 54, 36, 37, 1]]", False),
        (f"[{ROW}, [06, 74, 55, 54, 36, 37, 1]]", False),
        (f"[{ROW}, [46, 74, 55, 54, 36, 1]]", False),
        ("", False),
    ],
)
def test_the_grammar_knows_rows_and_their_number(text, expected):
    longer = demonstration("open the drawer", [DRAWER], [*ACTIONS, ACTIONS[0]])
    codec = fitted(OPEN, longer)
    assert matches(grammar_of(codec, "open the drawer"), text) is expected
    if expected:
        Draft202012Validator(schema_of(codec, "open the drawer")).validate(json.loads(text))


@pytest.mark.parametrize("rows", wrong_lists(ROW, ROW_2))
def test_the_schema_knows_rows_and_their_number(rows):
    longer = demonstration("open the drawer", [DRAWER], [*ACTIONS, ACTIONS[0]])
    validator = Draft202012Validator(schema_of(fitted(OPEN, longer), "open the drawer"))
    assert validator.is_valid([json.loads(ROW), json.loads(ROW_2)])
    assert not validator.is_valid(rows)


def test_the_grammar_asks_for_more_where_the_instruction_has_more_clauses():
    grammar = grammar_of(fitted(), "open the drawer, then open the drawer")
    assert matches(grammar, f"[{', '.join([ROW] * 4)}]")
    assert not matches(grammar, f"[{ROW}, {ROW_2}]")


def test_the_reply_ends_where_the_next_observation_begins():
    assert fitted().observation_text(Query("open", (DRAWER,))).startswith(fitted().stop)
    assert not any(stop in f"[{ROW}, {ROW_2}], " for stop in fitted().stop)
