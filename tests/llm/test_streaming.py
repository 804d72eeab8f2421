from hypothesis import given
from hypothesis import strategies as st

from app.llm.streaming import StopStrings


@given(st.text("abc", max_size=30), st.lists(st.text("abc", max_size=3), max_size=3), st.data())
def test_where_a_text_stops_does_not_depend_on_its_pieces(text, stop, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=6)))
    pieces = [text[a:b] for a, b in zip([0, *cuts], [*cuts, len(text)], strict=True)]
    stops = StopStrings(stop)
    said = "".join(map(stops.feed, pieces)) + stops.flush()
    ends = [at + len(s) for s in stop if s and (at := text.find(s)) >= 0]
    assert stops.stopped == bool(ends)
    if not ends:
        assert said == text
    else:
        stopped_by = [s for s in stop if s and text[: min(ends)].endswith(s)]
        assert said == text[: min(ends) - max(map(len, stopped_by))]


def test_text_that_cannot_begin_a_stop_string_is_not_held_back():
    stops = StopStrings(["]]"])
    assert [stops.feed(piece) for piece in ("[[1", "], ", "[2]", "]", " more")] == ["[[1", "], ", "[2", "", ""]
