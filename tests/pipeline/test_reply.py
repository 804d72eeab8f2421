import pytest

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.reply import ReplyReader
from roboprompt_client.motion.limits import USUAL_ACTIONS
from tests.pipeline.asking import codec_of, parse_reply

from .scenes import WORKSPACE, action, demonstration, pose, same_actions

LIFT = "lift the cup"
CUP = pose("cup", (0.1, 0.2, 0.7), 30)
SHOWN = demonstration(LIFT, [CUP], [action((0.1, 0.2, 0.8)), action((0.1, 0.2, 0.9), gripper_open=False)])
ABSOLUTE, OBJECT_FRAME = (codec_of(name, "paper", [SHOWN], WORKSPACE) for name in ("absolute", "object_frame"))
LIST = "[[46, 74, 55, 54, 36, 37, 1], [46, 74, 60, 0, 36, 71, 0]]"
LINE = "1 A w: +0 +0 +20 0 36 36 1; 2 A o: -10 +2 +40 71 36 0 0"
REPLIES = [  # with the number of actions that are known before the reply is complete
    (ABSOLUTE, LIST, 2),
    (ABSOLUTE, f"```json\n{LIST}\n```", 2),
    (ABSOLUTE, f"Sure!\n```json\n{LIST}\n```", 0),
    (ABSOLUTE, LIST.replace(" ", "\n  ").replace("[[", "[\n[") + " as shown [above].", 2),
    (ABSOLUTE, "The action is [46, 74, 55, 54, 36, 37, 1].", 0),
    (OBJECT_FRAME, LINE, 1),
    (OBJECT_FRAME, f" {LINE}\n", 1),
    (OBJECT_FRAME, f"\n{LINE}\n".replace("; ", ";\n"), 1),
    (OBJECT_FRAME, f"```text\n{LINE}\n```", 1),
]


def fed(codec, pieces):
    """A reader with the actions it gave after each piece."""
    reader = ReplyReader(codec, Query(LIFT, (CUP,)))
    return reader, [reader.feed(piece) for piece in pieces]


@pytest.mark.parametrize(("codec", "text", "num_early"), REPLIES)
def test_reading_in_pieces_gives_the_same_actions_wherever_the_text_is_split(codec, text, num_early):
    expected = parse_reply(text, codec, [CUP], LIFT)
    for pieces in [list(text), *([text[:cut], text[cut:]] for cut in range(len(text) + 1))]:
        reader, given = fed(codec, pieces)
        assert same_actions([seen for actions in given for seen in actions], expected[:num_early])
        assert same_actions(reader.finish(text), expected)


@pytest.mark.parametrize(
    ("codec", "text", "mark", "early"), [(ABSOLUTE, LIST, "]", 2), (OBJECT_FRAME, f" {LINE}", ";", 1)]
)
def test_an_action_comes_as_soon_as_its_row_is_complete(codec, text, mark, early):
    _, given = fed(codec, text)
    complete = [k for k, character in enumerate(text) if character == mark][:early]
    assert [k for k, actions in enumerate(given) if actions] == complete
    assert all(len(given[k]) == 1 for k in complete)


def test_rounding_does_not_make_a_reply_contradict_itself():
    """Rows that arrive one by one are decoded one by one, and numpy may round a single row otherwise than many."""
    rows = [f"{k} A o: +{k} -{3 * k} +{7 * k} {k} 36 {2 * k} 0" for k in range(1, 10)]
    for yaw_deg in range(0, 360, 7):
        cup = pose("cup", (0.1 + yaw_deg / 997, 0.2 - yaw_deg / 991, 0.7), yaw_deg)
        reader = ReplyReader(OBJECT_FRAME, Query(LIFT, (cup,)))
        early = [seen for row in rows for seen in reader.feed(f"{row}; ")]
        assert same_actions(reader.finish("; ".join(rows)), early)


@pytest.mark.parametrize(
    ("codec", "pieces"),
    [
        (ABSOLUTE, ["[[46, 74, 55, 54, 36, 37, 1], [46, 74, 60, 99, ", "36, 71, 0], [1, "]),
        (ABSOLUTE, ["[[46, 74, 55, 54, 36, 37, 1], [46, 74", "]"]),
        (OBJECT_FRAME, ["1 A w: +0 +0 +20 0 36 36 1; 2 B o: -10 +2", " +40 71 36 0 0; 3 A"]),
        (OBJECT_FRAME, ["1 A w: +0 +0 +20 0 36 36 1; 3 A w: +0 +0 +20 0 36 36 1", ";"]),
    ],
)
def test_an_error_midway_carries_the_text_so_far(codec, pieces):
    first, second = pieces
    reader = ReplyReader(codec, Query(LIFT, (CUP,)))
    assert len(reader.feed(first)) == 1
    with pytest.raises(ReplyParseError, match="action 1") as caught:
        reader.feed(second)
    assert caught.value.reply_text == first + second


@pytest.mark.parametrize(
    "complete",
    [
        LIST.replace("46, 74, 55", "47, 74, 55"),
        LIST.replace("54, 36, 37, 1]", "54, 36, 37, 0]"),
        LIST.replace("54, 36, 37, 1]", "54, 36, 38, 1]"),
        "[[46, 74, 55, 54, 36, 37, 1]]",
    ],
)
def test_a_complete_reply_that_contradicts_what_was_handed_out_is_refused(complete):
    reader, _ = fed(ABSOLUTE, [LIST])
    assert parse_reply(complete, ABSOLUTE, [CUP], LIFT)
    with pytest.raises(ReplyParseError, match="contradicts") as caught:
        reader.finish(complete)
    assert caught.value.reply_text == complete


@pytest.mark.parametrize("opened", ["<think>", "[THINK]", ""])
def test_what_a_model_only_considered_is_no_action(opened):
    text = f"{opened}{LIST}</think>"
    with pytest.raises(ReplyParseError, match="contains reasoning"):
        ReplyReader(ABSOLUTE, Query(LIFT, (CUP,))).finish(text)
    with pytest.raises(ReplyParseError, match="contains reasoning"):
        fed(ABSOLUTE, list(text)[: len(opened) or None])


def test_early_actions_do_not_excuse_a_reply_that_is_refused_as_a_whole():
    reader, given = fed(ABSOLUTE, [LIST, " or ", LIST])
    assert len(given[0]) == 2
    with pytest.raises(ReplyParseError, match="2 lists"):
        reader.finish(f"{LIST} or {LIST}")


@pytest.mark.parametrize("num_actions", [USUAL_ACTIONS, USUAL_ACTIONS + 1])
def test_more_actions_than_allowed_are_an_error(num_actions):
    text = f"[{', '.join(['[46, 74, 55, 54, 36, 37, 1]'] * num_actions)}]"
    if num_actions <= USUAL_ACTIONS:
        assert len(parse_reply(text, ABSOLUTE, [CUP], LIFT)) == len(fed(ABSOLUTE, [text])[1][0]) == num_actions
        return
    for read in (lambda: parse_reply(text, ABSOLUTE, [CUP], LIFT), lambda: fed(ABSOLUTE, [text])):
        with pytest.raises(ReplyParseError, match="26 actions, more than 25"):
            read()


def test_an_endless_reply_is_refused_while_it_arrives():
    reader, _ = fed(ABSOLUTE, ["x" * 100_000])
    with pytest.raises(ReplyParseError, match="longer than 100000 characters"):
        reader.feed("x")
