"""A sentence over tasks that were taught apart becomes their steps, or is refused with the part that is not clear."""

import numpy as np
import pytest

from app.pipeline.errors import InstructionError
from app.pipeline.names import shared_aliases
from app.pipeline.order.reading import read
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import TaughtWords
from app.pipeline.steps.reading import read_steps
from app.pipeline.steps.skills import PlanStep, Skill, TasksOfScene

TASKS = {
    "open": (("upper box", "lower box"), ("open the upper box", "open the lower box")),
    "close": (("upper box", "lower box"), ("close the upper box",)),
    "pack": (
        ("green pear", "red pear", "tin", "upper box", "lower box"),
        ("put the green pear in the upper box", "put the red pear in the lower box", "put the tin in the upper box"),
    ),
    "tin": (("tin",), ("close the tin",)),
    "buttons": (("left button", "right button"), ("press the left button", "press the right button")),
    "shake": (("tin",), ("shake the tin",)),
    "wipe": (("tin", "cloth"), ("wipe the tin with the cloth",)),
    "rinse": (("cloth",), ("rinse the cloth, then wring it",)),
    "lift": (("green pear", "red pear"), ("lift the green pear", "lift the red pear")),
    "water": (("can", "green pear", "red pear"), ("pour water from the can on the green pear",)),
    "knob": (("knob",), ("turn the knob to the left twice",)),
}
NAMES = tuple(dict.fromkeys(name for names, _ in TASKS.values() for name in names))
OPEN, CLOSE = "open the upper box", "close the upper box"
GREEN, RED = "put the green pear in the upper box", "put the red pear in the upper box"
LEFT, RIGHT, SHAKE = "press the left button", "press the right button", "shake the tin"


def skill(task, names, texts, **aliases):
    return Skill(task, TaughtWords(names, aliases, texts))


SKILLS = tuple(skill(task, names, texts) for task, (names, texts) in TASKS.items())


def plan(said, skills=SKILLS, names=NAMES, layout=None):
    aliases = shared_aliases([each.taught.aliases for each in skills], names)
    return read_steps(said, TasksOfScene(names, aliases, skills), layout)


def texts(steps):
    return [step.instruction for step in steps]


@pytest.mark.parametrize(
    ("said", "steps"),
    [
        ("open the upper box, put the green pear in it, then close it", [OPEN, GREEN, CLOSE]),
        ("open the upper box, put the green pear in it, put the red one in it, close it", [OPEN, GREEN, RED, CLOSE]),
        ("put both pears in the upper box, close it, and press the left button", [GREEN, RED, CLOSE, LEFT]),
        ("put all pears in the upper box except the red one, then close it", [GREEN, CLOSE]),
        ("put the green pear and the red pear in the upper box", [GREEN, RED]),
        ("put the green pear in the upper box and the red one in the lower box",
         [GREEN, "put the red pear in the lower box"]),
        ("take the red pear out of the way", None),
        ("press the left button before the right one", [LEFT, RIGHT]),
        ("press the left button after the right one", [RIGHT, LEFT]),
        ("before closing the upper box, put the red pear in it", [RED, CLOSE]),
        ("after you open the upper box, put the red pear in it and close it", [OPEN, RED, CLOSE]),
        ("close the upper box after putting the red pear in it", [RED, CLOSE]),
        ("shake the tin three times, then press the left button", [SHAKE] * 3 + [LEFT]),
        ("press each of the buttons", [LEFT, RIGHT]),
        ("press both buttons, then press them", [LEFT, RIGHT, LEFT, RIGHT]),
        ("open the lower box, put the green pear and the tin in the upper box, then put them in the lower box",
         ["open the lower box", GREEN, "put the tin in the upper box",
          "put the green pear in the lower box", "put the tin in the lower box"]),
        ("pour water from the can on both pears",
         ["pour water from the can on the green pear", "pour water from the can on the red pear"]),
        ("put every pear except the red one in the upper box", [GREEN]),
        ("shake the tin, but do not close the tin", [SHAKE]),
        ("shake the tin and press the left button twice", [SHAKE, LEFT, LEFT]),
        ("turn the knob left twice", ["turn the knob to the left twice"]),
        ("open the upper box, then close the upper box again", [OPEN, CLOSE]),
        ("put the green pear in the upper box, the red pear in the lower box and the tin in the upper box",
         [GREEN, "put the red pear in the lower box", "put the tin in the upper box"]),
        ("use the cloth to wipe the tin", ["wipe the tin with the cloth"]),
        ("rinse the cloth, then wring it", ["rinse the cloth, then wring it"]),
        ("press the left button instead of the right one, then wipe the tin", [LEFT, "wipe the tin with the cloth"]),
        ("wipe the tin with the cloth and shake it", ["wipe the tin with the cloth", SHAKE]),
        ("press the left button after wiping the tin with the cloth", ["wipe the tin with the cloth", LEFT]),
        ("shake the tin before rinsing the cloth", None),
        ("the tin should be shaken", None),
        ("hoist the red pear", None),
        ("raise the red pear", None),
    ],
)  # fmt: skip
def test_every_step_is_said_in_the_words_of_its_task(said, steps):
    if steps is None:
        with pytest.raises(InstructionError):
            plan(said)
        return
    found = plan(said)
    assert texts(found) == steps
    for step in found:
        task_words = next(each.taught for each in SKILLS if each.task == step.task)
        assert read(step.instruction, task_words).text == step.instruction


def test_it_names_the_task_of_each_step():
    assert plan("shake the tin and press the left button") == (PlanStep("shake", SHAKE), PlanStep("buttons", LEFT))


NOT_CERTAIN = [
    # what "it" and "them" stand for, if the object may be another one, or is too far away
    "put the tin in the upper box, then close it", "put the green pear in the upper box and wipe it",
    "put the tin in the upper box, then shake it", "open the upper box, press the left button and close it",
    "close it", "put it in it", "open both boxes and put the red pear in it", "press them",
    "press the left button, then press them", "press both buttons, then press it", "press both buttons and them",
    "press the right button, then press the left button and it", "press both buttons, then shake the tin and them",
    "open both boxes, then put the tin in them",
    "put both pears in the upper box, shake the tin and put them in the lower box", "shake the tin, and it",
    "take from the green pear and put it in the lower box", "shake the tin, but do not close it",
    "lift the red pear and put it in the upper box",
    # which objects "both", "all" and "except" take
    "press both boxes", "press both", "press any button", "put the green pear in both boxes",
    "press every button, but not the left one", "press all buttons except the left one and the right one",
    "press only the left button", "press all buttons except the tin", "press all buttons except with the left one",
    "press all buttons except the left and the right one",
    # how often, and which part
    "press both buttons, then press them twice", "take twice the green pear and put it in the lower box",
    "press the left button and the right button twice", "press both buttons twice",
    "open the upper box and close it twice", "press the left button, not the right one twice",
    "shake the tin 99 times", "shake the tin a few times", "shake the tin again and again",
    "turn the knob to the right twice",
    # in which order, or when
    "close the upper box after it", "before pressing the left button, then the right one",
    "open the upper box before closing it and put the red pear in it",
    "open the upper box, before closing it put the red pear in it",
    "press the left button after the right one and shake the tin",
    "do not press the left button before the right one", "press the left button before",
    "before pressing the left button", "press the left button before after the right one",
    "press the left button once the tin is closed", "shake the tin until it is empty", "if the tin is open, shake it",
    # what is not meant
    "do not shake the tin, then press the left button", "open the upper box, but do not open the upper box",
    "shake the tin, but do not touch the cloth", "press the left button or the right one", "never shake the tin",
    # nothing that a task was taught, or no order
    "open the box", "the left button", "shake the tin slowly", "shake the tin and dance", "close the lower tin",
    "close the cloth", "put the upper box in the tin", "put the cloth in the upper box", "turn the knob to the left",
    "shook the tin", "shake", "shake the tin again",
    # what the hand cannot do, and two destinations
    "lift the green pear, then lift the red pear", "lift both pears", "lift the red pear and press the left button",
    "put the green pear in the upper box, the red pear in the lower box", "wipe the tin, but not with the cloth",
]  # fmt: skip


@pytest.mark.parametrize("said", NOT_CERTAIN)
def test_what_is_not_certain_is_refused(said):
    with pytest.raises(InstructionError):
        plan(said)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("open the upper box, then rinse the tin", "'rinse the tin' is nothing that a task was taught"),
        ("open the upper box, wipe it", "'wipe it' is nothing"),
        ("shake the tin and close it twice", "'close it twice' leaves open whether this part alone is repeated"),
        ("put the tin in the upper box, then close it", "'close it' leaves open what 'it' or 'them' stands for"),
        ("press the left button after the right one and shake the tin", "leaves open what comes first"),
        ("press the spoon", "'the spoon' is none"),
        ("shake the tin " + "and shake the tin " * 24, "over 24 steps"),
    ],
)
def test_a_refusal_names_the_part_and_what_the_tasks_were_taught(said, why):
    with pytest.raises(InstructionError, match=why) as refused:
        plan(said)
    assert "open: 'open the upper box', 'open the lower box'; " in refused.value.valid


def test_what_takes_too_many_steps_to_read_is_refused():
    with pytest.raises(InstructionError, match="too involved"):
        plan("press " + "the left button and " * 40)


def test_of_two_tasks_the_one_with_the_very_words_is_meant_and_of_two_with_equal_words_none():
    mug = ("mug",)
    skills = (skill("pick", mug, ("pick up the mug",)), skill("lift", mug, ("lift the mug",)))
    assert plan("lift the mug", skills, mug) == (PlanStep("lift", "lift the mug"),)
    with pytest.raises(InstructionError, match=r"'pick up the mug' \(pick\) or 'lift the mug' \(lift\)"):
        plan("grasp the mug", skills, mug)


def test_an_object_of_the_scene_that_a_task_does_not_have_is_not_another_one():
    only = (skill("press", ("red button",), ("press the button",)),)
    assert texts(plan("press the button", only, ("red button",))) == ["press the button"]
    for said in ("press the button", "press the blue button", "press"):
        with pytest.raises(InstructionError):
            plan(said, only, ("red button", "blue button"))


def test_a_word_for_two_objects_stands_for_neither():
    wash, fill = skill("wash", ("mug",), ("wash the mug",), mug=("cup",)), skill("fill", ("cup",), ("fill the cup",))
    assert texts(plan("wash the cup", (wash,), ("mug",))) == ["wash the mug"]
    with pytest.raises(InstructionError):
        plan("wash the cup", (wash, fill), ("mug", "cup"))


def test_words_of_place_are_those_of_the_whole_scene_before_anything_is_moved():
    places_m = {"red cube": (0.3, 0.2, 0.0), "blue cube": (0.3, -0.2, 0.0), "tray": (0.5, 0.0, 0.0)}
    layout = Layout({name: np.array(place_m) for name, place_m in places_m.items()}, np.zeros(3))
    names = tuple(places_m)
    skills = (
        skill("put", names, ("put the red cube on the tray", "put the blue cube on the tray")),
        skill("press", names[:2], ("press the red cube", "press the blue cube")),
    )
    assert texts(plan("press the leftmost cube", skills, names, layout)) == ["press the red cube"]
    for said in (
        "put the red cube on the tray and press the leftmost cube",
        "press the cube on the left, then press it",
    ):
        with pytest.raises(InstructionError):
            plan(said, skills, names, layout if "tray" in said else None)


def test_a_text_that_one_task_knows_as_a_whole_is_that_of_every_task_with_it():
    names, text = ("red cube", "blue cube"), "pick up the red cube"
    aliased = skill("aliased", names, (text,), **{"red cube": ("the blue cube",)})
    assert aliased.wholes == (text,)
    skills = (aliased, skill("picks", names, (text,)))
    scene = TasksOfScene(names, shared_aliases([each.taught.aliases for each in skills], names), skills)
    with pytest.raises(InstructionError, match=r"aliased.*picks"):
        read_steps(text, scene, None)


STORED = "put the pear in the box and close it"


@pytest.mark.parametrize(
    "said", [STORED, "place the pear in the box, then shut the box", "put the pear in the box, close it"]
)
def test_what_one_task_was_taught_as_a_whole_is_one_step(said):
    found = plan(said, (skill("store", ("pear", "box"), [STORED]),), ("pear", "box"))
    assert found == (PlanStep("store", STORED),)


@pytest.mark.parametrize(
    "said",
    [
        "put the pear in the box after you close it",
        "close the box before you put the pear in it",
        "put the pear in the box and don't close it",
    ],
)
def test_what_one_task_was_taught_as_a_whole_has_its_order(said):
    with pytest.raises(InstructionError):
        plan(said, (skill("store", ("pear", "box"), [STORED]),), ("pear", "box"))


def test_what_one_task_was_taught_as_a_whole_and_others_do_in_steps_is_refused():
    apart = [skill("put", ("pear", "box"), ["put the pear in the box"]), skill("close", ("box",), ["close the box"])]
    with pytest.raises(InstructionError, match="may mean"):
        plan(
            "place the pear in the box, then shut it",
            (skill("store", ("pear", "box"), [STORED]), *apart),
            ("pear", "box"),
        )
