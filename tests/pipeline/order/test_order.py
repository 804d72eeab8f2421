import pytest

from app.pipeline.order.order import Order


@pytest.mark.parametrize(
    ("names", "instruction", "expected"),
    [
        (("red", "blue"), "put the blue on the red", ("blue", "red")),
        (("red_button",), "push the red button", ("red_button",)),
        # the longest name wins, at every place
        (("cup", "cup holder"), "move the cup holder", ("cup holder",)),
        (("cup", "cup holder"), "put the cup holder beside the other cup holder", ("cup holder",)),
        (("cup", "cup holder"), "put the cup into the cup holder", ("cup", "cup holder")),
        (("cup", "cup holder"), "to the cup holder bring the cup", ("cup holder", "cup")),
        # a part of a word is no mention
        (("lid",), "slide the block", ()),
        (("cup",), "close the cupboard", ()),
        (("no. 5",), "push no. 5 now", ("no. 5",)),
        ((), "push", ()),
    ],
)
def test_an_order_has_its_objects_by_their_first_mention(names, instruction, expected):
    assert Order(instruction, names).objects == expected


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("push the red button", 1),
        ("push the red button, then push the blue button", 2),
        ("push red, then blue, and then green", 3),
        ("Push red. Then push blue", 2),
        ("strengthen the grip", 1),
        ("then push", 1),
        (" push red THEN blue ", 2),
    ],
)
def test_clauses(instruction, expected):
    assert len(Order(instruction, ()).clauses) == expected


@pytest.mark.parametrize(
    ("instruction", "verbs"),
    [
        ("please put the cube on the plate", ("put",)),
        ("Robot, lift the cube and gently place it on the plate", ("robot", "lift", "place")),
        ("use the gripper to take the cube, then push the plate", ("take", "push")),
        ("push the cube, in place of the plate, to its place", ("push", "in", "to")),
        ("with both hands lift the cube", ("lift",)),
        ("task 3: stack the cube on the plate", ("stack",)),
        ("the robot puts the cube on the plate", ("put",)),
        ("Stacking the cube", ("stack",)),
        ("the cube should be placed on the plate", ("place",)),
        ("the cube was brought to the plate", ("bring",)),
        ("press the plate, then the cube gets picked up", ("press", "pick")),
        ("pinching the cube", ("pinch",)),
        ("the cube on the right place", ("the",)),
        ("the cube that is stacked on the plate gets removed", ("remove",)),
        ("dunk the cube", ("dunk",)),
        ("cube", ("",)),
    ],
)
def test_verbs_in_their_base_form(instruction, verbs):
    order = Order(instruction, ("cube", "plate"))
    assert order.verbs == verbs


DRAWERS = ("drawer_bottom", "drawer_middle", "drawer_top")


@pytest.mark.parametrize(
    ("names", "instruction", "expected"),
    [
        (DRAWERS, "open the top drawer", ("drawer_top",)),
        (DRAWERS, "open the Top one, then the bottom one.", ("drawer_top", "drawer_bottom")),
        (DRAWERS, "push the stopper", ()),
        # its own words, all of them, in any order
        (("toy block", "wooden box"), "put the block, a toy, into the box", ("toy block",)),
        (("toy block", "wooden box"), "into the box of wooden planks goes the block", ("wooden box",)),
        # a word that two names share says nothing
        (("red cup", "red plate"), "move the red thing", ()),
        (("red cup", "red plate", "blue cup"), "put the plate by the red thing", ("red plate",)),
        # a name without a word of its own needs its phrase
        (("red cup", "red plate", "blue cup"), "put the cup, the red one, away", ()),
        (("cup", "cup holder"), "put the cup into the holder", ("cup", "cup holder")),
        # a phrase goes first: its words are no longer there for another name, nor for its own
        (("left lid", "lid left of jar"), "take the lid left of jar", ("lid left of jar",)),
        ((*DRAWERS, "top shelf"), "put it on the top shelf in the middle drawer", ("top shelf", "drawer_middle")),
        (DRAWERS, "close the top one, that is drawer_top", ("drawer_top",)),
    ],
)
def test_a_name_is_mentioned_by_the_words_that_no_other_has(names, instruction, expected):
    assert Order(instruction, names).objects == expected


BUTTONS = ("red button", "blue button")


@pytest.mark.parametrize(
    ("names", "instruction", "expected"),
    [
        (BUTTONS, "Push the BLUE button.", "push the <0>"),
        (BUTTONS, "push the red_button, then the blue button", "push the <0>, then the <1>"),
        (BUTTONS, "push the blue button, then the red button", "push the <0>, then the <1>"),
        (BUTTONS, "push the red button twice: red button", "push the <0> twice: <0>"),
        (BUTTONS, "push anything", "push anything"),
        # a name within another or within a placeholder
        (("cup", "cup holder"), "put the cup holder by the cup", "put the <0> by the <1>"),
        (("0", "1", "cup"), "put cup on 0 then 1", "put <0> on <1> then <2>"),
        # distinctive words
        (DRAWERS, "Open the top drawer.", "open the <0> drawer"),
        (DRAWERS, "open the bottom drawer, then the top drawer", "open the <0> drawer, then the <1> drawer"),
        (DRAWERS, "close the top one, that is drawer_top", "close the top one, that is <0>"),
        (("red block", "blue cup"), "push the block that is red", "push the <0> that is <0>"),
        (("cup", "cup holder"), "put the cup into the holder", "put the <0> into the <1>"),
    ],
)
def test_a_form_stands_for_all_instructions_that_ask_for_the_same(names, instruction, expected):
    assert Order(instruction, names).form == expected
