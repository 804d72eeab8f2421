"""What an instruction becomes: what was taught, byte for byte, and what each phrase was taken for."""

import time
from contextlib import suppress

import numpy as np
import pytest

from app.pipeline.errors import UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.reading import read
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import TaughtWords

BUTTONS = ("red button", "blue button")
PUSH = ["push the red button", "push the blue button"]


def taught(names, instructions, **aliases):
    return TaughtWords(names, aliases, instructions)


@pytest.mark.parametrize(
    ("names", "instructions", "said", "canonical"),
    [
        (BUTTONS, PUSH, "Push the BLUE button.", "Push the BLUE button."),
        (BUTTONS, PUSH[:1], "push the blue button", "push the blue button"),
        (BUTTONS, ["Push the red button."], "press the blue one", "Push the blue button."),
        (BUTTONS, PUSH, "Press the azure button!", "push the blue button"),
        (BUTTONS, ["push red"], "push red and then push blue", "push red, then push blue"),
        (BUTTONS, ["push red"], "press red and then blue", "push red, then push blue"),
        (BUTTONS, PUSH, "push the red one and then the blue one", "push the red button, then push the blue button"),
        (("red_button", "blue_button"), ["push red_button"], "press the blue button", "push blue_button"),
        (("drawer_top", "drawer_bottom"), ["open the top drawer"], "open the lowest drawer", "open the bottom drawer"),
        (("drawer_top", "drawer_bottom"), ["open drawer_top"], "open up the bottom one", "open drawer_bottom"),
        (("mug", "plate"), ["Put the mug on the plate"], "place the mug onto the plate", "Put the mug on the plate"),
        (("red cube", "blue cube"), ["stack red on blue"], "put the blue cube on the red cube", "stack blue on red"),
    ],
)  # fmt: skip
def test_the_canonical_instruction_is_worded_as_it_was_taught(names, instructions, said, canonical):
    assert read(said, taught(names, instructions)).text == canonical


@pytest.mark.parametrize("options", [{}, {"allow_unfamiliar": True}])
def test_what_takes_too_many_steps_to_read_is_refused(options):
    names = [f"{color} mug" for color in ("red", "green", "blue", "yellow", "black", "white", "pink", "orange")]
    words = taught(names, [f"push the {name}" for name in names])
    with pytest.raises(UngroundedInstructionError, match="too involved"):
        read("push " + "the red mug and " * 28, words, **options)


def test_of_what_was_taught_and_takes_too_many_steps_only_the_very_words_are_understood():
    long = "push " + "the red button and " * 28 + "the blue button"
    words = taught(BUTTONS, [long, *PUSH])
    assert read(long, words).text == long
    with pytest.raises(UngroundedInstructionError, match=r"'push the red button and .* is too involved"):
        read("press the blue one", words)


@pytest.mark.parametrize(
    ("said", "phrase", "name", "by"),
    [
        ("push the red button", "red button", "red button", "name"),
        ("press the red one", "the red one", "red button", "name"),
        ("push the big one", "the big one", "red button", "alias"),
        ("push the crimson button", "the crimson button", "red button", "color"),
        ("push the button on the left", "the button on the left", "red button", "relation"),
    ],
)
def test_every_phrase_tells_what_it_was_taken_for_and_by_what(said, phrase, name, by):
    layout = Layout({"red button": np.array([0.3, 0.2, 0.8]), "blue button": np.array([0.3, -0.2, 0.8])}, np.zeros(3))
    words = TaughtWords(BUTTONS, {"red button": ("big one", "start")}, PUSH)
    assert read(said, words, layout).phrases == (Grounding(phrase, name, by),)


def test_what_was_understood_survives_being_stored():
    order = read("push the crimson button", taught(BUTTONS, PUSH))
    assert Order.from_json(order.to_json(), BUTTONS) == order


@pytest.mark.parametrize(
    ("names", "instructions", "said"),
    [
        (("button",), ["press"], "press"),
        (("button",), ["press"], "push the button, please"),
        (("button",), ["press"], "tap it"),
        (("cube",), ["pick up the cube"], "grab it"),
        (("cube",), ["pick up the cube"], "pick up the cube, then pick up the cube"),
        (("drawer_top",), ["open the drawer"], "open the drawer"),
        (("mug", "plate"), ["clear the table"], "clear the table"),
        (("mug", "plate"), ["clear the table"], "please clear the table"),
        (("handle",), ["open the top drawer"], "open the top drawer"),
    ],
)
def test_a_task_of_one_object_or_without_names_keeps_working(names, instructions, said):
    assert read(said, taught(names, instructions)).text in (*instructions, said)


@pytest.mark.parametrize(
    ("names", "instructions", "said", "error"),
    [
        (("button",), ["press"], "press the lever", UngroundedInstructionError),
        (("button",), ["press"], "press not the button", UnfamiliarInstructionError),
        (("button",), ["press"], "don't press", UnfamiliarInstructionError),
        (("button",), ["press"], "dance", UnfamiliarInstructionError),
        (("drawer",), ["open the top drawer"], "open the bottom drawer", UngroundedInstructionError),
        (("left tap",), ["turn left tap"], "turn the right tap", UngroundedInstructionError),
        (("mug", "plate"), ["clear the table"], "pick up the mug", UnfamiliarInstructionError),
        (("mug", "plate"), ["clear the table"], "clear the mug", UnfamiliarInstructionError),
        (("mug", "plate"), ["clear the table"], "clear the desk", UngroundedInstructionError),
        # a noun that is only a part of a name
        (("wine bottle", "cup"), ["lift the wine bottle"], "lift the wine", UngroundedInstructionError),
        (("cup holder", "lid"), ["move the cup holder", "move the lid"], "move the cup", UngroundedInstructionError),
        # an article is no letter of a name
        (("block a", "block b"), ["lift block a", "lift block b"], "lift a block", UngroundedInstructionError),
        # a number that was not taught
        (("part12", "bin"), ["put part12 in the bin"], "put part13 in the bin", UngroundedInstructionError),
        (("red block", "pad"), ["put 2 bricks on the pad"], "put 3 bricks on the pad", UngroundedInstructionError),
        (("red block", "pad"), ["put 2 bricks on the pad"], "put bricks on the pad", UngroundedInstructionError),
        # a word that decides, and was taught
        (BUTTONS, ["press the red and the blue button in the reverse order"],
         "press the blue and the red button in this order", UnfamiliarInstructionError),
        (("drawer",), ["open the drawer halfway"], "open the drawer", UnfamiliarInstructionError),
        # part of a plan that was taught as a whole
        (("door", "mug"), ["open the door, then lift the mug"], "lift the mug", UnfamiliarInstructionError),
        # two taught verbs that a third is like
        (BUTTONS, ["push the red button", "tap the red button"], "hit the blue button", UngroundedInstructionError),
    ],
)  # fmt: skip
def test_other_words_are_refused(names, instructions, said, error):
    with pytest.raises(error):
        read(said, taught(names, instructions))


def test_a_plan_of_several_clauses_is_understood_as_a_whole():
    words = taught(("door", "mug", "bowl"), ["open the door, then lift the mug"])
    assert read("open the door and then grab the bowl", words).text == "open the door, then lift the bowl"


@pytest.mark.parametrize(
    ("said", "passed_on"),
    [
        ("pull the red button", "pull the red button"),
        ("lift the azure button", "lift the blue button"),
        ("push the red button twice", "push the red button twice"),
    ],
)
def test_an_unfamiliar_instruction_may_be_passed_on_with_its_objects_named(said, passed_on):
    order = read(said, taught(BUTTONS, PUSH), allow_unfamiliar=True)
    assert (order.text, bool(order.unfamiliar)) == (passed_on, True)
    assert [phrase.phrase in said for phrase in order.phrases] == [True]


@pytest.mark.parametrize(
    "said", ["dance", "open the drawer", "pull the purple button", "pull the button", "do not pull the red button",
             "pull the frobnicator to the red button", "pull the red one, not the blue one"],
)  # fmt: skip
def test_objects_that_are_not_clear_are_refused_all_the_same(said):
    with pytest.raises((UngroundedInstructionError, UnfamiliarInstructionError)):
        read(said, taught(BUTTONS, PUSH), allow_unfamiliar=True)


def test_a_refusal_lists_what_the_task_knows():
    words = TaughtWords(BUTTONS, {"blue button": ("stop",)}, PUSH)
    with pytest.raises(UngroundedInstructionError, match="'the purple button' is none") as refused:
        read("push the purple button", words)
    assert refused.value.valid == (
        "objects red button, blue button (or stop); taught 'push the red button', 'push the blue button'"
    )


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("pull the red button", "'pull' in 'pull the red button' is no action that was taught"),
        ("push the red button slowly", "'slowly' in 'push the red button slowly' is not understood"),
        ("push the red button up", "'push the red button up' has the form of no taught instruction"),
        ("push on", "'push on' has the form of no taught instruction"),
        ("don't push the red button", "says what not to do in a way that is not understood: say only what to do"),
    ],
)
def test_a_refusal_names_the_words_and_what_is_wrong_with_them(said, why):
    with pytest.raises(UnfamiliarInstructionError, match=why):
        read(said, taught(BUTTONS, PUSH))


def test_a_word_said_twice_is_no_compound_of_itself():
    with pytest.raises(UnfamiliarInstructionError):
        read("mur", taught(("murmur", "plate"), ["push the murmur"]))


@pytest.mark.parametrize(
    ("names", "phrase", "candidates"),
    [
        (BUTTONS, "the button", "red button, blue button"),
        (("green button", "blue button", "button"), "the turquoise button", "green button, blue button"),  # or none
    ],
)
def test_an_ambiguous_phrase_names_its_candidates(names, phrase, candidates):
    with pytest.raises(UngroundedInstructionError, match=f"{phrase!r} may be {candidates}"):
        read(f"push {phrase}", taught(names, [f"push the {name}" for name in names[:2]]))


@pytest.mark.parametrize(
    "said", ["push the red button and " * 20 + "push the red button", "the " * 100, "red " * 100, ", " * 200]
)
def test_no_instruction_takes_long(said):  # fmt: skip
    words = taught(BUTTONS, PUSH)
    read("press the red one", words)
    started_s = time.process_time()
    with suppress(UngroundedInstructionError, UnfamiliarInstructionError):
        read(said, words)
    assert time.process_time() - started_s < 0.5


MUGS = ("red mug", "white mug", "plate 1", "plate 2")
TWO_MUGS = "put the white mug on plate 1 and put the red mug on plate 2"
CLOSE = "put the bowl in the drawer and close it"
COOK = "turn on the stove and put the pot on it"


@pytest.mark.parametrize(
    ("names", "instruction", "said", "canonical"),
    [
        (MUGS, TWO_MUGS, "place the white mug on plate 1, then place the red mug on plate 2", TWO_MUGS),
        (MUGS, TWO_MUGS, "put the white mug on plate 1 and the red mug on plate 2", TWO_MUGS),
        (MUGS, TWO_MUGS, "put the white mug on the right plate and put the red mug on the left plate", TWO_MUGS),
        (
            MUGS,
            TWO_MUGS,
            "set the red mug on plate 2 and set the white mug on plate 1",
            "put the red mug on plate 2 and put the white mug on plate 1",
        ),
        (("bowl", "cup", "drawer"), CLOSE, "place the bowl in the drawer, then shut the drawer", CLOSE),
        (("bowl", "cup", "drawer"), CLOSE, "place the cup in the drawer and shut it", CLOSE.replace("bowl", "cup")),
        (("stove", "pot"), COOK, "switch on the stove, then place the pot on the stove", COOK),
        (("stove", "pot"), COOK, "Switch on the stove and place the pot on it.", COOK),
        (
            ("cloth",),
            "rinse the cloth, then wring it",
            "rinse the cloth and wring it",
            "rinse the cloth, then wring it",
        ),
    ],
)
def test_an_instruction_of_several_clauses_is_understood_in_other_words(names, instruction, said, canonical):
    places_m = {"plate 1": [0.6, -0.2, 0.0], "plate 2": [0.6, 0.2, 0.0]}
    layout = Layout({name: np.array(places_m.get(name, [0.5, 0.0, 0.0])) for name in names}, np.zeros(3))
    assert read(said, taught(names, [instruction]), layout).text == canonical


@pytest.mark.parametrize(
    ("names", "instruction", "said", "why"),
    [
        (("bowl", "drawer"), CLOSE, "put the bowl in the drawer", "taught as a part of"),
        (("bowl", "drawer"), CLOSE, "close the drawer", "taught as a part of"),
        (("stove", "pot"), COOK, "put the pot on the stove", "taught as a part of"),
        (("bowl", "box"), "put the bowl in the bottom drawer of the box and close it", "close the bowl", "a part of"),
        (("bowl", "drawer"), CLOSE, "close the drawer and put the bowl in it", "another place, direction"),
        (("bowl", "cup", "drawer"), CLOSE, "put the bowl in the drawer and close the cup", "another place, direction"),
        (MUGS, TWO_MUGS, "put the white mug on plate 1 and put the red mug on plate 1", "on plate 1"),
        (("stove", "pot"), COOK, "turn off the stove and put the pot on it", "turn off"),
        (("mug", "box"), "lift the mug and polish the box", "lift the mug and lift the box", "another place"),
        (("mug", "box"), "lift the mug and polish the box", "the mug and the box", "another place"),
        (("cloth",), "rinse the cloth, then wring it", "rinse the cloth, then rinse it", "another place"),
        (("cloth",), "rinse the cloth, then wring it", "wring the cloth", "taught as a part of"),
    ],
)
def test_of_several_clauses_neither_a_part_nor_another_sequence_is_understood(names, instruction, said, why):
    with pytest.raises((UnfamiliarInstructionError, UngroundedInstructionError), match=why):
        read(said, taught(names, [instruction]))


def test_a_relation_that_no_object_needs_may_be_a_destination():
    places_m = {"mug 1": [0.5, 0.2, 0.0], "mug 2": [0.5, -0.2, 0.0], "tray": [0.9, 0.0, 0.0]}
    layout = Layout({name: np.array(place_m) for name, place_m in places_m.items()}, np.zeros(3))
    words = taught(tuple(places_m), ["put mug 1 on the tray"])
    assert read("put the mug next to mug 2 on the tray", words, layout).text == "put mug 1 on the tray"
    for said in ("put mug 1 next to mug 2 on the tray", "put mug 2 on the tray next to mug 1"):
        with pytest.raises((UngroundedInstructionError, UnfamiliarInstructionError)):
            read(said, words, layout)


BOWLS_M = {
    "bowl 1": [0.5, 0.3, 0.02],
    "bowl 2": [0.5, -0.3, 0.05],
    "box": [0.51, -0.3, 0.03],
    "plate": [0.7, 0.0, 0.01],
}


def bowls(**moved_m):
    places_m = BOWLS_M | {name.replace("_", " "): place_m for name, place_m in moved_m.items()}
    return Layout({name: np.array(place_m) for name, place_m in places_m.items()}, np.zeros(3))


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("pick up the bowl on the box and place it on the plate", "bowl 2"),
        ("pick up the bowl that stands on the box and place it on the plate", "bowl 2"),
        ("pick up the bowl on top of the box and place it on the plate", "bowl 2"),
        ("put the bowl on the box on the plate", "bowl 2"),
    ],
)
def test_an_object_is_told_by_what_it_rests_on(said, meant):
    words = taught(tuple(BOWLS_M), ["pick up bowl 1 and place it on the plate", "put bowl 1 on the plate"])
    assert read(said, words, bowls()).objects == (meant, "plate")
