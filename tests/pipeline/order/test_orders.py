"""Texts that are not orders, or other orders than were taught, are refused; written without knowing the parser."""

import pytest

from app.pipeline.errors import UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order.order import Order
from app.pipeline.order.reading import read
from app.pipeline.order.roles import Stranger, strangers
from app.pipeline.order.taught import TaughtWords

TASKS = {
    "slider": (("slider",), ("move the slider from left to right",)),
    "dial": (("dial",), ("turn the dial from 2 to 5",)),
    "knob": (("knob",), ("turn the knob to the left",)),
    "panel": (("panel",), ("press the green button on the panel",)),
    "chess": (("pawn", "board"), ("move the pawn from the red square to the black square",)),
    "drawer": (("mug", "plate"), ("put the mug in the top drawer",)),
    "shelf": (("cup", "spoon"), ("put the cup on the left shelf", "put the cup on the right shelf")),
    "tap": (("left tap", "right tap"), ("turn left tap", "turn right tap")),
    "one tap": (("left tap",), ("turn left tap",)),
    "lamp": (("lamp",), ("turn on the lamp",)),
    "buttons": (("red button", "blue button"), ("push the red button", "push the blue button")),
    "kitchen": (("apple", "banana", "bowl", "plate"), ("put the apple in the bowl", "put the apple on the plate")),
    "tubes": (("test tube 1", "test tube 2", "rack"), ("place test tube 1 in the rack",)),
    "pour": (("water bottle", "glass"), ("pour water from the bottle into the glass",)),
    "tools": (("hammer", "screwdriver"), ("give me the hammer",)),
    "order": (("tray",), ("empty the tray in the reverse order",)),
    "safe": (("money", "safe"), ("put the money away in the safe on the bottom shelf",)),
    "either": (("table", "sponge"), ("wipe the table", "wipe the table with the sponge")),
    "pick": (("apple", "banana", "bowl"), ("pick up the apple", "put the apple in the bowl")),
    "wipe": (("table", "sponge", "tray"), ("wipe the table with the sponge",)),
    "block": (("block", "wall", "box"), ("push the block to the wall",)),
    "cubes": (("red cube", "blue cube", "green cube"), ("stack the red cube on the blue cube",)),
    "dirt": (("broom", "dustpan"), ("sweep the dirt away to the dustpan",)),
    "belt": (("conveyor belt",), ("stop the conveyor belt",)),
    "hot plate": (("small flask", "large flask", "hot plate"), ("put the small flask on the hot plate",)),
    "printer": (("label printer",), ("press the button of the label printer",)),
    "cans": (("oil can", "rain barrel"), ("fill the oil can from the rain barrel",)),
    "rags": (("bench", "sponge", "rag"), ("wipe the bench with the sponge", "wipe the bench with the rag")),
    "cap": (("fuel cap",), ("screw the fuel cap on", "screw the fuel cap off")),
    "crank": (("crank",), ("turn the crank counterclockwise",)),
    "bin": (("parts bin",), ("push the parts bin to the left",)),
    "mugs": (("mug 1", "mug 2", "tray"), ("put mug 1 on the tray", "pick up mug 1")),
}
TAUGHT = {task: TaughtWords(names, {}, texts) for task, (names, texts) in TASKS.items()}


@pytest.mark.parametrize(
    ("task", "said", "canonical"),
    [
        ("slider", "please move the slider from left to right", "move the slider from left to right"),
        ("slider", "move the slider to the right from the left", "move the slider from left to right"),
        ("dial", "rotate the dial from two to five", "turn the dial from 2 to 5"),
        ("dial", "turn the dial to 5 from 2", "turn the dial from 2 to 5"),
        ("knob", "turn the knob left", "turn the knob to the left"),
        ("drawer", "place the mug in the top drawer", "put the mug in the top drawer"),
        ("shelf", "place the cup on the right shelf", "put the cup on the right shelf"),
        ("lamp", "turn the lamp on", "turn on the lamp"),
        ("lamp", "switch on the lamp", "turn on the lamp"),
        ("buttons", "would you mind pushing the red button", "push the red button"),
        ("buttons", "could you push the red button. Thank you!", "push the red button"),
        ("buttons", "instead of pushing the red button, push the blue one", "push the blue button"),
        ("buttons", "the red button should be pushed", "push the red button"),
        ("kitchen", "put the apple in the bowl, not on the plate", "put the apple in the bowl"),
        ("kitchen", "drop the apple into the bowl", "put the apple in the bowl"),
        ("tools", "hand me the screwdriver", "give me the screwdriver"),
        ("safe", "put the money in the safe", "put the money away in the safe on the bottom shelf"),
        ("wipe", "wipe the table", "wipe the table with the sponge"),
        ("either", "please wipe the table", "wipe the table"),
        ("either", "please wipe the table with the sponge", "wipe the table with the sponge"),
        ("pick", "pick up the apple and put it in the bowl", "put the apple in the bowl"),
        ("pick", "pick up the apple, then pick up the apple", "pick up the apple, then pick up the apple"),
        ("block", "push the block into the box", "push the block to the box"),
        ("buttons", "push the red and blue buttons", "push the red button, then push the blue button"),
        ("buttons", "the red and the blue button", "push the red button, then push the blue button"),
        ("dirt", "sweep the dirt to the dustpan", "sweep the dirt away to the dustpan"),
        ("dirt", "sweep away the dirt to the dustpan", "sweep the dirt away to the dustpan"),
        ("hot plate", "put the big flask back on the hotplate", "put the large flask on the hot plate"),
        ("hot plate", "place the little flask on the hot-plate", "put the small flask on the hot plate"),
        ("printer", "press the label printer's button", "press the button of the label printer"),
        ("cans", "fill the oil can", "fill the oil can from the rain barrel"),
        ("rags", "use the rag to wipe the bench", "wipe the bench with the rag"),
        ("cap", "please screw the fuel cap off", "screw the fuel cap off"),
        ("crank", "rotate the crank anti-clockwise", "turn the crank counterclockwise"),
        ("bin", "slide the parts bin leftwards", "push the parts bin to the left"),
        ("pour", "pour some water into the glass", "pour water from the bottle into the glass"),
        ("mugs", "put mug one on the tray", "put mug 1 on the tray"),
        ("mugs", "pick up mug 2 and put it on the tray", "put mug 2 on the tray"),
    ],
)
def test_what_is_meant_is_understood(task, said, canonical):
    assert read(said, TAUGHT[task]).text == canonical


REFUSED = {
    "slider": ["move the slider from right to left", "move the slider left", "move the slider to the left",
        "move the slider"],
    "dial": ["turn the dial from 5 to 2", "turn the dial from 2 to 5 to 2", "turn the dial 5 2",
        "turn the dial from -2 to 5"],
    "knob": ["turn the knob", "turn the left knob", "turn the knob to the right",
        "turn the knob to the left, then right now"],
    "panel": ["press the green panel", "press the panel on the green button"],
    "chess": ["move the pawn from the black square to the red square", "move the black pawn to the red square",
        "move the pawn to the black square"],
    "drawer": ["put the mug in the bottom drawer", "put the mug in the middle drawer",
        "put the top mug in the drawer", "put the mug in the drawer"],
    "shelf": ["put the cup on the shelf", "put the left cup on the shelf", "put the cup on the top shelf"],
    "tap": ["turn left", "turn the tap left"],
    "one tap": ["turn around", "turn the tap left"],
    "lamp": ["turn off the lamp", "turn the lamp off"],
    "buttons": ["pushed the red button", "pushing the red button", "pushes the red button", "pushed the red button?",
        "the red button?", "push the red button? push the blue button", "red", "push the red button now and then",
        "push the red button next", "push the red button after that", "push the blue button, avoid the red button",
        "push the blue button, do not touch the red button", "push the blue button and keep away from the red button",
        "do not push just the red button, push the blue button",
        "do not push the red button first, push the blue button"],
    "kitchen": ["put the apple in the bowl, then put the apple on the plate",
        "put the apple in the bowl, then on the plate", "put the apple in the bowl, then put the banana on the apple",
        "put the apple in the bowl, do not touch the plate"],
    "safe": ["put the money in the safe on the top shelf", "put the money on the left shelf in the safe"],
    "order": ["empty the tray"],
    "block": ["push the block to the wall in the box", "push the block to the wall on the box"],
    "cubes": ["stack red on blue and blue on green",
        "stack the red cube on the blue cube, then stack the blue cube on the green one"],
    "wipe": ["wipe the sponge", "wipe with the sponge"],
    "pick": ["pick up the apple, then put the apple in the bowl",
        "pick up the apple, then put the banana on the apple"],
    "tubes": ["place test tube -1 in the rack"],
    "pour": ["pour water from the glass into the bottle"],
    "belt": ["stop", "please stop!"],
    "rags": ["wipe the bench", "wipe the bench, not with the rag"],
    "cap": ["screw the fuel cap", "screw the cap back"],
    "hot plate": ["put the back flask on the hot plate", "put the flask on the hot plate away"],
    "mugs": ["put mug 1 next to mug 2 on the tray", "pick up mug 1, then pick up mug 2", "pick up both mugs"],
}  # fmt: skip


@pytest.mark.parametrize(("task", "said"), [(task, said) for task, phrases in REFUSED.items() for said in phrases])
def test_what_is_another_order_or_none_is_refused(task, said):
    with pytest.raises((UnfamiliarInstructionError, UngroundedInstructionError)):
        read(said, TAUGHT[task])


@pytest.mark.parametrize(
    ("names", "said", "taught", "found"),
    [
        (("door", "window"), "open the door", ("open the door", "close the window"), []),
        (
            ("door", "window"),
            "close the door",
            ("open the door", "close the window"),
            [Stranger("door", ("window",), True)],
        ),
        (("red button", "blue button"), "push the blue button", ("push the red button",), []),
        (("apple", "banana"), "pick up the banana", ("pick up the apple",), [Stranger("banana", ("apple",), False)]),
        (("box a", "box b", "bin"), "put box b in the bin", ("put box a in the bin",), []),
        (("red cube", "blue block"), "pick up the blue block", ("pick up the red cube",), []),
        (
            TASKS["kitchen"][0],
            "put the apple on the banana",
            TASKS["kitchen"][1],
            [Stranger("banana", ("plate",), False)],
        ),
        (
            TASKS["kitchen"][0],
            "put the banana on the plate",
            ("put the banana in the bowl", "put the apple on the plate"),
            [],
        ),
        (("a", "b"), "something else", ("pick up a",), []),
    ],
)
def test_another_kind_of_thing_in_a_place_is_found(names, said, taught, found):
    assert list(strangers(Order(said, names), taught)) == found
