from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.prompt import PromptTemplate
from app.pipeline.reply import ReplyReader
from app.pipeline.workspace import discretize_actions
from tests.pipeline.asking import codec_of, parse_reply

from ..gbnf import matches
from ..scenes import DOWN_DEG, WORKSPACE, action, demonstration, pose, rotated
from .test_object_frame import placed_in_line

PUSH = "push the {} button"
COLORS = ("red", "blue")


def buttons(x_m, y_m):
    return [pose("red button", (x_m, y_m, 0.805)), pose("blue button", (y_m, x_m, 0.805))]


def pushed(color, x_m, y_m):
    """Above a button, and down onto it."""
    objects = buttons(x_m, y_m)
    x, y, z = objects[COLORS.index(color)].position_m
    return demonstration(PUSH.format(color), objects, [action((x, y, z + 0.1)), action((x, y, z), gripper_open=False)])


def opened(x_m, yaw_deg, at_deg=0.0):
    """At a drawer's handle, then 20 cm along the drawer's own x axis."""
    turned = rotated(at_deg, 0, yaw_deg)
    drawer = pose("drawer", (x_m, 0.105, 1.005), turned)
    hand = (turned * rotated(*DOWN_DEG)).as_euler("xyz", degrees=True)
    ways = [turned.apply((along, 0, 0)) for along in (0.0, 0.2)]
    return demonstration("open the drawer", [drawer], [action(drawer.position_m + way, hand) for way in ways])


PUSHES = (pushed("red", 0.105, 0.205), pushed("blue", 0.125, 0.305), pushed("red", 0.305, -0.105))
OPENINGS = (opened(0.105, 0), opened(0.155, 40), opened(0.205, -60), opened(0.305, 90))


def fitted(demonstrations):
    return codec_of("absolute", "sums", demonstrations, WORKSPACE)


def bins(actions):
    return [item.bins for item in discretize_actions(actions, WORKSPACE)]


def test_a_demonstration_repeats_the_instruction_and_names_what_each_row_follows():
    assert fitted(PUSHES).demonstration_text(PUSHES[0]) == (
        "{'red button': [40,70,20], 'blue button': [50,60,20], 'push the red button'}>push the red button "
        "[1 open red button +0 +0 +10: [40+0=40,70+0=70,20+10=30]; "
        "2 closed red button +0 +0 +0: [40+0=40,70+0=70,20+0=20]]\n"
    )


def test_a_difference_that_turns_with_an_object_is_listed_beside_it():
    codec = fitted(OPENINGS)
    assert codec.observation_text(opened(0.105, 90)) == ("{'drawer': [40,60,40,54] a(+0 +20 +0), 'open the drawer'}>")
    row = "2 open drawer a +20 +0 +0: [40+20=60,60+0=60,40+0=40,36+0=36]]"
    assert codec.actions_text(OPENINGS[0]).endswith(row)


@pytest.mark.parametrize("demonstrations", [PUSHES, OPENINGS])
def test_replies_like_the_demonstrations_are_read_as_their_actions(demonstrations):
    codec = fitted(demonstrations)
    for shown in demonstrations:
        text = codec.actions_text(shown)
        assert matches(codec.grammar(shown, 25), text)
        assert bins(ReplyReader(codec, shown).finish(text)) == bins(shown.actions)
        assert codec.reply_text(codec.rows(text, complete=True)) == text


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("+0 +0 +10: [40+0=40", "+0 +0 +9: [40+0=40"),  # a difference that no demonstration shows
        ("40+0=", "50+0="),  # the number of the other button
        ("20+10=", "20+0="),  # not the difference that the row has said
        ("1 open", "2 open"),
    ],
)
def test_a_row_contradicts_neither_the_scene_nor_itself(wrong, right):
    codec = fitted(PUSHES)
    text = codec.actions_text(PUSHES[0])
    assert wrong in text
    assert not matches(codec.grammar(PUSHES[0], 25), text.replace(wrong, right, 1))


def test_which_object_a_row_follows_is_left_to_the_model():
    codec = fitted(PUSHES)
    other = codec.actions_text(PUSHES[1]).removeprefix("push the blue button")
    seen = replace(PUSHES[1], instruction="push the red button")
    assert matches(codec.grammar(seen, 25), f"push the red button{other}")


def test_rows_are_read_as_they_arrive():
    codec = fitted(PUSHES)
    text, reader, seen = codec.actions_text(PUSHES[0]), ReplyReader(codec, PUSHES[0]), []
    for at, character in enumerate(text):
        seen += [(at, item) for item in reader.feed(character)]
    assert [item.bins for item in discretize_actions([item for _, item in seen], WORKSPACE)] == bins(PUSHES[0].actions)
    assert [text[at] for at, _ in seen] == ["]", "]"]
    assert len(reader.finish(text)) == 2


def test_a_row_of_a_draft_does_not_arrive():
    codec = fitted(OPENINGS)
    with pytest.raises(ReplyParseError, match="action 0 does not begin"):
        ReplyReader(codec, OPENINGS[0]).feed(f"Perhaps [{ROW}; ")


@pytest.mark.parametrize(
    ("yaw", "expected"), [("71+20=91", 19), ("3-20=-17", 55), ("71+1=72", 0), ("36", 36), ("36+0=36", 36)]
)
def test_a_yaw_is_read_modulo_a_turn(yaw, expected):
    reply = f"open the drawer [1 open drawer +0 +11 +6: [60+0=60,51+11=62,6+6=12,{yaw}]]"
    (read,) = parse_reply(reply, fitted(OPENINGS), OPENINGS[0].objects, OPENINGS[0].instruction)
    assert bins([read]) == [(60, 62, 12, 0, 36, expected, 1)]


ROW = "1 open drawer: [60+0=60, 51+11=62, 6+6=12, 18]"


@pytest.mark.parametrize(
    "reply",
    [
        "",
        "open the drawer",
        f"[{ROW}",
        f"[{ROW}; ]",
        f"[{ROW}, {ROW}]",
        f"first [{ROW}], but [{ROW}]",
        f"perhaps [{ROW}]",
        "[1 open drawer: []]",
        "[1 drawer: [60+0=60, 51+11=62, 6+6=12, 18]]",
        "[open drawer: [60+0=60, 51+11=62, 6+6=12, 18]]",
        "[1 open drawer: [60+0=60, 51+11=62, 6+6=12]]",
        "[1 open drawer: [60+0=60, 51+11=62, 6+6=100, 18]]",
        "[1 open drawer: [60+0=60, 51+11=62, 6-7=-1, 18]]",
        "[1 open drawer: [60+0=60, 51+11=62, 6+6=12, 71+71=142]]",
        "[1 open drawer: [60+0=60, 51+11, 6+6=12, 18]]",
    ],
)
def test_what_is_no_list_of_rows_is_refused(reply):
    with pytest.raises(ReplyParseError):
        parse_reply(reply, fitted(OPENINGS), OPENINGS[0].objects, OPENINGS[0].instruction)
    assert parse_reply(f"[{ROW}]", fitted(OPENINGS), OPENINGS[0].objects, OPENINGS[0].instruction)


def test_the_grammar_repeats_the_instruction_as_it_is():
    said = 'push the red button, "quickly" \\ now'
    assert '"push the red button, \\"quickly\\" \\\\ now [1 " row' in fitted(PUSHES).grammar(
        Query(said, PUSHES[0].objects), 25
    )


def test_demonstrations_that_say_nothing_new_are_left_out():
    shown = [pushed(COLORS[k % 2], 0.1 + 0.02 * k, 0.2 - 0.03 * k) for k in range(8)]
    prompt = PromptTemplate.write(fitted(shown), shown, "").prefix
    assert prompt.count("\n") == 3


def test_a_place_between_two_objects_is_written_from_the_first():
    codec = fitted(shown := placed_in_line(between=True))
    for item in shown:
        reply = codec.actions_text(item)
        assert "red mark/blue mark " in reply
        query = Query(item.instruction, item.objects)
        assert matches(codec.grammar(query, 25), reply)
        put = parse_reply(reply, codec, item.objects, item.instruction)[-1]
        np.testing.assert_allclose(put.position_m, item.actions[-1].position_m, atol=0.011)
