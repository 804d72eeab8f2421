import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.object_frame import MAX_REPEATED, ObjectFrameCodec
from app.pipeline.representation.object_rows import OFFSET_UNIT_M
from tests.pipeline.asking import grammar_of, parse_reply, shown_as_they_are

from ..gbnf import matches
from ..scenes import WORKSPACE, action, angle_deg, demonstration, pose, rotated

LIFT = "lift the cup"
UP = np.array([0, 0, 0.2])
PLACES = [((0.1, 0.2, 0.705), 10), ((0.3, -0.1, 0.705), 75), ((0.205, 0.005, 0.705), -40)]


def fitted(*demonstrations, with_instruction=True):
    return ObjectFrameCodec.of(shown_as_they_are(demonstrations), WORKSPACE, with_instruction)


def lifts(offsets_m=((0, 0, 0.1),) * 3, yaws_deg=(0, 0, 0), follow=False):
    """Three demonstrations that touch the cup (offset and gripper's yaw along world axes or the cup's) and lift it."""
    shown = []
    for (position_m, cup_yaw_deg), offset_m, yaw_deg in zip(PLACES, offsets_m, yaws_deg, strict=True):
        turn = rotated(0, 0, cup_yaw_deg if follow else 0)
        touch = np.array(position_m) + turn.apply(offset_m)
        euler_deg = (180, 0, yaw_deg + (cup_yaw_deg if follow else 0))
        actions = [action(touch, euler_deg, False), action(touch + UP, euler_deg)]
        shown.append(demonstration(LIFT, [pose("cup", position_m, cup_yaw_deg)], actions))
    return shown


def rim(frame, yaw_deg=30, number=3):
    """The cup is touched beside its middle; either the place or the hand turns with it."""
    shown = []
    for position_m, cup_yaw_deg in PLACES[:number]:
        turn, off_m = rotated(0, 0, cup_yaw_deg), np.array([-0.05, 0.02, 0.1])
        touch = np.array(position_m) + (turn.apply(off_m) if frame == "ow" else off_m)
        euler_deg = (180, 0, yaw_deg + (cup_yaw_deg if frame == "wo" else 0))
        actions = [action(touch, euler_deg, False), action(touch + UP, euler_deg)]
        shown.append(demonstration(LIFT, [pose("cup", position_m, cup_yaw_deg)], actions))
    return shown


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (rim("ow"), "1 A ow: -10 +4 +20 0 36 42 0; 2 A ow: -10 +4 +60 1"),
        (rim("wo"), "1 A wo: -10 +4 +20 0 36 42 0; 2 A wo: -10 +4 +60 1"),
        (lifts(), "1 A w: +0 +0 +20 0 36 36 0; 2 A w: +0 +0 +60 1"),
        (lifts(((-0.05, 0.02, 0),) * 3), "1 A w: -10 +4 +0 0 36 36 0; 2 A w: -10 +4 +40 1"),
        (
            lifts(((-0.05, 0.02, 0.3),) * 3, (30,) * 3, follow=True),
            "1 A o: -10 +4 +60 0 36 42 0; 2 A o: -10 +4 +100 1",
        ),
    ],
)
def test_actions_are_written_in_the_frame_in_which_they_agree(shown, expected):
    codec = fitted(*shown)
    assert [codec.actions_text(demonstration) for demonstration in shown] == [expected] * 3


@given(
    st.sampled_from(["w", "o", "ow", "wo"]),
    st.floats(0.02, 0.12),
    st.floats(-180, 180),
    st.lists(st.floats(-90, 90), min_size=3, max_size=8).filter(lambda yaws_deg: np.std(yaws_deg) > 25),
    st.floats(-180, 180),
)
def test_a_copied_row_presses_where_the_object_is_turned_to(frame, beside_m, side_deg, yaws_deg, asked_deg):
    """Of a place beside the cup's middle and a hand, each turned with the cup or not, whatever the cup's yaw."""
    off_m = rotated(0, 0, side_deg).apply([beside_m, 0, 0.05])

    def pressed(position_m, yaw_deg):
        place_turn, hand_turn = (rotated(0, 0, yaw_deg * (axes == "o")) for axes in (frame[0], frame[-1]))
        place_m, hand = np.add(position_m, place_turn.apply(off_m)), hand_turn * rotated(180, 0, 25)
        return action(place_m, hand.as_euler("xyz", degrees=True), gripper_open=False)

    scenes = [((0.05 * k, 0.3 - 0.07 * k, 0.7), yaw_deg) for k, yaw_deg in enumerate(yaws_deg)]
    shown = [demonstration(LIFT, [pose("cup", *scene)], [pressed(*scene)]) for scene in scenes]
    codec, asked = fitted(*shown), ((0.4, 0.2, 0.71), asked_deg)
    (seen,) = parse_reply(codec.actions_text(shown[0]), codec, [pose("cup", *asked)], LIFT)
    expected = pressed(*asked)
    assert np.linalg.norm(seen.position_m - expected.position_m) < OFFSET_UNIT_M
    assert angle_deg(seen.quaternion_xyzw, expected.quaternion_xyzw) < 3
    assert codec.actions_text(shown[0]).startswith(f"1 A {frame}: ")


def test_a_frame_that_no_demonstration_calls_for_is_refused():
    cup = pose("cup", PLACES[0][0], 10)
    with pytest.raises(ReplyParseError, match=r"relative to A ow, expected one of A w, A o$"):
        parse_reply("1 A ow: +0 +0 +20 0 36 36 0", fitted(*lifts()), [cup], LIFT)
    with pytest.raises(ReplyParseError, match=r"relative to A wo, expected one of A w, A o, A ow$"):
        parse_reply("1 A wo: +0 +0 +20 0 36 36 0", fitted(*rim("ow")), [cup], LIFT)


def test_the_grammar_of_replies_to_several_clauses_has_the_frames_that_are_shown():
    for frame, has_it in (("ow", True), ("wo", False)):
        shown = [demonstration("lift the cup, then lift it", item.objects, item.actions) for item in rim(frame)]
        grammar = fitted(*shown).grammar(Query(LIFT, shown[0].objects), 25)
        assert matches(grammar, " 1 A ow: -10 +4 +20 0 36 42 0\n") is has_it
        assert matches(grammar, " 1 A wo: -10 +4 +20 0 36 42 0\n") is not has_it


def test_a_tilted_object_turns_its_frame_fully():
    tilts = [rotated(0, -60, 30), rotated(0, -80, -50), rotated(0, -40, 0)]
    grasp, center_m = rotated(0, 90, 0), np.array([0.1, 0.1, 1])
    shown = [
        demonstration(
            "close the lid",
            [pose("lid", center_m, tilt)],
            [action(center_m + tilt.apply([0.25, 0, 0]), (tilt * grasp).as_euler("xyz", degrees=True))],
        )
        for tilt in tilts
    ]
    codec = fitted(*shown)
    texts = {codec.actions_text(demonstration) for demonstration in shown}
    assert len(texts) == 1
    assert texts.pop().startswith("1 A o: +50 +0 +0 ")
    assert (
        codec.observation_text(Query("close the lid", shown[0].objects)) == "A lid 39 59 39 36 24 42; close the lid >"
    )


def test_jitter_of_one_unit_is_calmed_to_the_median():
    # yaws of bins 71, 1 and 0, which are neighbors
    codec = fitted(*(shown := lifts([(0.004, 0, 0.1), (-0.004, 0, 0.104), (0, 0, 0.096)], (176, -176, 180))))
    assert {codec.actions_text(demonstration) for demonstration in shown} == {
        "1 A w: +0 +0 +20 0 36 0 0; 2 A w: +0 +0 +60 1"
    }


def push(named, red_m, blue_m):
    objects = [pose("red button", red_m), pose("blue button", blue_m)]
    x, y, z = red_m if named == "red" else blue_m
    return demonstration(f"push the {named} button.", objects, [action((x, y, z + 0.05), gripper_open=False)])


RED = push("red", (0.1, 0.2, 0.705), (0.3, -0.1, 0.705))
BLUE = push("blue", (0.3, -0.1, 0.705), (0.1, 0.2, 0.705))


def test_the_order_of_mention_makes_texts_of_different_instructions_alike():
    codec = fitted(RED, BLUE)
    red = "A red button 39 69 10; B blue button 59 39 10; push the red button > 1 A w: +0 +0 +10 0 36 36 0\n"
    swapped = red.replace("red", "#").replace("blue", "red").replace("#", "blue")
    assert codec.demonstration_text(RED) == red
    assert codec.demonstration_text(BLUE) == swapped


ROWS = st.tuples(
    st.tuples(*[st.floats(-0.9, 0.9)] * 3),
    st.tuples(st.floats(-179, 179), st.floats(-60, 60), st.floats(-179, 179)),
    st.booleans(),
)
JITTER = st.tuples(*[st.floats(-0.008, 0.008)] * 3)  # some of it calmed, some not


@st.composite
def random_demonstrations(draw, min_size, max_size):
    rows = draw(st.lists(ROWS, min_size=1, max_size=3))
    shown = []
    for _ in range(draw(st.integers(min_size, max_size))):
        center = np.array([draw(st.floats(-0.2, 0.6)), draw(st.floats(-0.4, 0.4)), 0.8])
        cup = pose("cup", center, draw(st.floats(-179, 179)))
        actions = [action(center + offset + draw(JITTER), euler, is_open) for offset, euler, is_open in rows]
        shown.append(demonstration(LIFT, [cup], actions))
    return shown


def check_round_trip(shown, max_offset_units, max_rotation_bins):
    codec = fitted(*shown)
    for given_demonstration in shown:
        (cup,) = given_demonstration.objects
        text = codec.actions_text(given_demonstration)
        seen = parse_reply(text, codec, [cup], LIFT)
        assert matches(grammar_of(codec, LIFT), f" {text}\n")
        for row, was, now in zip(text.split(";"), given_demonstration.actions, seen, strict=True):
            axes = rotated(0, 0, _yaw_deg(cup)) if " A o: " in row else rotated(0, 0, 0)
            off_m = axes.inv().apply(now.position_m - was.position_m)
            assert np.abs(off_m).max() <= max_offset_units * OFFSET_UNIT_M + 1e-9
            assert angle_deg(was.quaternion_xyzw, now.quaternion_xyzw) <= 3 * 5 * max_rotation_bins + 1e-6
            assert now.gripper_open == was.gripper_open


def _yaw_deg(cup):
    return math.degrees(2 * math.atan2(cup.quaternion_xyzw[2], cup.quaternion_xyzw[3]))


@given(random_demonstrations(1, 1))
def test_a_demonstration_comes_back_as_it_was(shown):
    check_round_trip(shown, max_offset_units=1e-9, max_rotation_bins=1e-6)


@pytest.mark.parametrize(
    ("reply", "heights_m", "yaws_deg"),
    [
        ("1 A w: +0 +0 +20 0 36 36 0; 2 A w: +0 +0 +60 1", (0.101, 0.301), (1, 1)),
        ("1 A w: +0 +0 +21 0 36 36 0; 2 A w: +0 +0 +60 1", (0.105, 0.301), (0, 1)),
        ("1 A w: +0 +0 +60 0 36 36 1", (0.3,), (0,)),  # not the first row of a demonstration
    ],
)
def test_a_row_that_demonstrations_have_stands_for_their_mean(reply, heights_m, yaws_deg):
    """The three touches are 9.9, 10.2 and 10.2 cm above the cup, with hands turned by 0, 1 and 2 degrees."""
    shown = lifts(((0, 0, 0.099), (0, 0, 0.102), (0, 0, 0.102)), (0, 1, 2))
    seen = parse_reply(f" {reply}", fitted(*shown), [pose("cup", (0.25, 0.1, 0.705), 0)], LIFT)
    np.testing.assert_allclose([action.position_m[2] - 0.705 for action in seen], heights_m)
    for action_, yaw_deg in zip(seen, yaws_deg, strict=True):
        assert angle_deg(action_.quaternion_xyzw, rotated(180, 0, yaw_deg).as_quat()) < 1e-6


def lifted(place, instruction=LIFT, height_m=0.1):
    """One demonstration with the cup at `place` cm along x."""
    position_m = np.array([place / 100, 0, 0.705])
    touch = action(position_m + UP * (height_m / 0.2), (180, 0, 0), False)
    return demonstration(instruction, [pose("cup", position_m, 0)], [touch])


def test_of_demonstrations_with_the_same_rows_the_last_few_are_written():
    shown = [lifted(place) for place in range(0, 50, 5)]
    assert fitted(*shown).needed() == tuple(shown[-MAX_REPEATED:])


def test_each_thing_to_ask_for_keeps_its_demonstrations():
    lifts = [lifted(place) for place in range(0, 25, 5)]
    taps = [lifted(place, "tap the cup", 0.2) for place in range(0, 25, 5)]
    mixed = [item for pair in zip(lifts, taps, strict=True) for item in pair]
    assert fitted(*mixed).needed() == tuple(mixed[-2 * MAX_REPEATED :])


def placed_in_line(number=4, *, between=False):
    """A peg is put down at x of one mark and y of the other, or between, after a lift to a height of the world."""
    random, shown = np.random.default_rng(2), []
    for k in range(number):
        (one, other, peg), height_m = random.uniform(0, 0.4, (3, 2)), 0.7 + 0.02 * k
        grasp = [action((*peg, height_m), gripper_open=is_open) for is_open in (True, False)]
        put_m = (one + other) / 2 if between else (one[0], other[1])
        rows = [*grasp, action((*peg, 1.0), gripper_open=False), action((*put_m, 0.75))]
        names, places = ("peg", "red mark", "blue mark"), [(*peg, height_m), (*one, 0.7), (*other, 0.7)]
        text = "put the peg in line with the red mark and the blue mark"
        item = demonstration(text, [pose(*pair) for pair in zip(names, places, strict=True)], rows)
        shown.append(item)
    return shown


@pytest.mark.parametrize(
    ("between", "text", "put_m"),
    [(False, "4 C w x=B: +0 +0 +10 1", [0.2, -0.1]), (True, "4 B/C w: +0 +0 +10 1", [0.25, 0.0])],
)
def test_a_row_says_along_which_axes_it_follows_something_else(between, text, put_m):
    codec = fitted(*(shown := placed_in_line(between=between)))
    *_, lifted, put = codec.actions_text(shown[0]).split("; ")
    assert (lifted, put) == ("3 A w z=world: +0 +0 +200 0", text)
    names = ["peg", "blue mark", "red mark"]
    objects = [pose(name, (0.1 + 0.1 * k, 0.3 - 0.2 * k, 0.8)) for k, name in enumerate(names)]
    asked = Query("put the peg in line with the blue mark and the red mark", tuple(objects))
    reply = f" {codec.actions_text(shown[0])}\n"
    assert matches(codec.grammar(asked, 25), reply)
    *_, lift, place = parse_reply(reply, codec, asked.objects, asked.instruction)
    np.testing.assert_allclose(lift.position_m, [0.1, 0.3, 1.0], atol=1e-9)
    np.testing.assert_allclose(place.position_m, [*put_m, 0.85], atol=1e-9)


def test_other_origins_than_those_demonstrated_are_refused():
    codec = fitted(*(shown := placed_in_line()))
    reply = codec.actions_text(shown[0]).replace("x=B", "y=B")
    with pytest.raises(ReplyParseError, match="relative to C w y=B, expected one of"):
        parse_reply(f" {reply}\n", codec, shown[0].objects, shown[0].instruction)
