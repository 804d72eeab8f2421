import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.llm.base import ModelResponseError, TextDelta
from app.llm.streaming import AnswerText, Chunk, assembled
from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.reasoning import DELIMITERS
from app.pipeline.reply import ReplyReader
from tests.pipeline.asking import codec_of
from tests.pipeline.scenes import WORKSPACE, action, demonstration, pose

CUP = pose("cup", (0.1, 0.2, 0.7), 30)
CODEC = codec_of("absolute", "paper", [demonstration("lift the cup", [CUP], [action((0.1, 0.2, 0.8))])], WORKSPACE)
DRAFT = "[[1, 1, 1, 0, 36, 36, 1], [1, 1, 2, 0, 36, 36, 1]]"
FINAL = "[[9, 9, 9, 0, 36, 36, 1], [9, 9, 8, 0, 36, 36, 1]]"
QUERY = Query("lift the cup", (CUP,))
# what may stand in a model's reasoning: also drafts, stop strings, and parts of delimiters
PIECES = [DRAFT, "{'cup': [9, 9, 9]}>", "<", "<thi", "[THIN", " so ", "\n", "é"]
CONSIDERED = st.lists(st.sampled_from(PIECES), max_size=8).map("".join)
STOPPED = f" {FINAL}, {{'cup': [1, 1, 1]}}>{DRAFT}"


def cuts(data, text):
    at = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=6)))
    return [text[a:b] for a, b in zip([0, *at], [*at, len(text)], strict=True)]


def places(rows):
    return {tuple(item.position_m) for item in CODEC.decoder(QUERY)(0, CODEC.rows(rows, complete=True))}


def heard(pieces, finish_reason, *, may_reason, streamed):
    """The places of the whole reply's actions, or what is wrong with it; and of those that came before its end."""
    reader, early = ReplyReader(CODEC, QUERY), set()

    async def chunks():
        for piece in pieces:
            yield Chunk(piece)
        yield Chunk("", finish_reason)

    async def read():
        async for piece in assembled(chunks(), CODEC.stop, "some/model", may_reason=may_reason):
            if isinstance(piece, TextDelta) and streamed:
                early.update(tuple(item.position_m) for item in reader.feed(piece.text))
        return (
            "cut off" if piece.finish_reason == "length" else {tuple(a.position_m) for a in reader.finish(piece.text)}
        )

    try:
        return asyncio.run(read()), early
    except (ModelResponseError, ReplyParseError) as error:
        return str(error), early


@given(
    considered=CONSIDERED,
    marks=st.sampled_from(DELIMITERS),
    opened=st.booleans(),
    closed=st.booleans(),
    answer=st.sampled_from([FINAL, f"```json\n{FINAL}\n```", STOPPED, ""]),
    finish_reason=st.sampled_from(["stop", "length"]),
    data=st.data(),
)
def test_no_action_of_a_draft_is_one_of_the_reply(considered, marks, opened, closed, answer, finish_reason, data):
    begin, end = marks
    text = begin * opened + considered + (end + answer) * closed
    may_reason = not opened or data.draw(st.booleans())
    (whole, _), (in_pieces, early) = (
        heard(cuts(data, text), finish_reason, may_reason=may_reason, streamed=streamed) for streamed in (False, True)
    )
    assert whole == in_pieces
    if closed and answer and (finish_reason == "stop" or answer == STOPPED):
        assert whole == places(FINAL)
        assert early <= places(FINAL)
    elif opened or closed or finish_reason == "length":
        assert isinstance(whole, str)
        assert not early


@given(st.text("abc", max_size=30), st.lists(st.text("abc", max_size=3), max_size=3), st.data())
def test_where_a_text_stops_does_not_depend_on_its_pieces(text, stop, data):
    answer = AnswerText(stop, may_reason=False)
    said = "".join(map(answer.feed, cuts(data, text))) + answer.finish()
    ends = [at + len(s) for s in stop if s and (at := text.find(s)) >= 0]
    assert answer.stopped == bool(ends)
    if not ends:
        assert said == text
    else:
        stopped_by = [s for s in stop if s and text[: min(ends)].endswith(s)]
        assert said == text[: min(ends) - max(map(len, stopped_by))]


def test_text_that_cannot_begin_a_stop_string_is_not_held_back():
    answer = AnswerText(["]]"], may_reason=False)
    assert [answer.feed(piece) for piece in ("[[1", "], ", "[2]", "]", " more")] == ["[[1", "], ", "[2", "", ""]


@pytest.mark.parametrize(("begin", "end"), DELIMITERS)
def test_reasoning_is_left_out_wherever_its_delimiters_are_cut(begin, end):
    text = f"\n{begin.upper()} 1 {end} 2"
    for place in range(len(text)):
        answer = AnswerText(["1"], may_reason=False)
        assert (answer.feed(text[:place]) + answer.feed(text[place:]) + answer.finish()).split() == ["2"]


@pytest.mark.parametrize("begin", dict(DELIMITERS))
@pytest.mark.parametrize("may_reason", [False, True])
def test_reasoning_without_an_end_is_an_error_that_names_the_remedy(begin, may_reason):
    answer = AnswerText(["{'"], may_reason=may_reason)
    answer.feed(f"{begin}Draft: {DRAFT}. Check with {{'cup'")
    with pytest.raises(ModelResponseError, match=r"within its reasoning \(.*max_actions.*--reasoning-parser"):
        answer.finish()


def test_reasoning_after_the_answer_has_begun_is_an_error():
    answer = AnswerText([], may_reason=False)
    assert answer.feed(DRAFT) == DRAFT
    with pytest.raises(ModelResponseError, match="after it has begun to answer"):
        answer.feed("<think>")
