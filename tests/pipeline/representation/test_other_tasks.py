"""Rows of other tasks, read in the scene of a task that was not shown."""

import numpy as np
import pytest

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.order.order import Order
from app.pipeline.prompt import PromptTemplate
from app.pipeline.representation import fit_codec, fit_other_tasks
from tests.pipeline.asking import parse_reply

from ..gbnf import matches
from ..scenes import WORKSPACE, action, demonstration, pose, rotated

PLACES = (((0.1, 0.2, 0.8), 10), ((0.3, -0.1, 0.8), 60), ((0.2, 0.0, 0.8), -40))
PUSH = "push the button"
STACK = "put the cube on the plate"
GRAB = "grab the mug from the tray"


def pushes():
    """Two rows above the only object."""
    return [
        demonstration(PUSH, [pose("button", place)], [action(np.add(place, (0, 0, dz))) for dz in (0.1, 0.02)])
        for place, _ in PLACES
    ]


def stacks():
    """Grasped along the cube's axes, put down on the plate, which has no rotation."""
    return [
        demonstration(
            STACK,
            [pose("plate", (0.4, 0.3, 0.75)), pose("cube", place, yaw)],
            [action(place, (180, 0, yaw), False), action((0.4, 0.3, 0.8), (180, 0, yaw))],
        )
        for place, yaw in PLACES
    ]


SCENE = (pose("tray", (0.5, 0.1, 0.75)), pose("mug", (0.15, -0.2, 0.8), 25))


def template(representation="object_frame", prompt_format="paper", tasks=None):
    tasks = tasks or (pushes(), stacks())
    codec = fit_other_tasks(representation, prompt_format, tasks, WORKSPACE)
    return PromptTemplate.write(codec, [d for task in tasks for d in task], "", of_other_tasks=True)


def test_each_task_reads_as_by_itself():
    """Letters are roles: A is what an instruction mentions first, in each task another object."""
    alone = [
        "".join(codec.demonstration_text(d) for d in task)
        for task in (pushes(), stacks())
        for codec in (fit_codec("object_frame", "paper", task, WORKSPACE),)
    ]
    assert template().prefix == "".join(alone)
    assert "A cube" in alone[1]
    assert "B plate" in alone[1]


def test_the_query_has_its_own_objects_in_the_order_of_mention():
    asked = template().ask(Query(GRAB, SCENE), 25).query
    assert asked == "A mug 44 29 19 41; B tray 79 59 14; grab the mug from the tray >"


def test_a_row_follows_the_object_in_the_same_role():
    read = template()
    (lifted, put) = parse_reply(" 1 A o: +0 +0 +20 0 36 36 0; 2 B w: +0 +0 +4 0", read.codec, SCENE, GRAB, 25)
    np.testing.assert_allclose(lifted.position_m, (0.15, -0.2, 0.9))
    np.testing.assert_allclose(put.position_m, (0.5, 0.1, 0.77))
    assert not lifted.gripper_open


def test_an_object_of_another_task_is_none_of_the_scene():
    with pytest.raises(ReplyParseError, match=r"relative to C w, expected one of A w, A o, B w"):
        parse_reply(" 1 C w: +0 +0 +20 0 36 36 0; 2 A w: +0 +0 +4 0", template().codec, SCENE, GRAB, 25)


@pytest.mark.parametrize(
    ("reply", "fits"),
    [
        (" 1 A o: +0 +0 +20 0 36 36 0; 2 B w: +0 +0 +4 0\n", True),
        (" 1 B w: +100 -7 +20 0 36 36 0; 2 B w: +0 +0 +4 1\n", True),
        (" 1 B o: +0 +0 +20 0 36 36 0; 2 B w: +0 +0 +4 0\n", False),
        (" 1 C w: +0 +0 +20 0 36 36 0; 2 B w: +0 +0 +4 0\n", False),
        (" 1 A w: +0 +0 +20 0 36 36 0\n", False),
    ],
)
def test_the_grammar_allows_every_object_of_the_scene_and_as_many_rows_as_some_task_has(reply, fits):
    """The tray has no rotation, so that nothing can turn with it."""
    assert matches(template().ask(Query(GRAB, SCENE), 25).grammar, reply) == fits


def test_rotations_of_the_scene_stay_as_they_were_seen():
    tray, mug = template().posed(SCENE)
    assert tray.quaternion_xyzw is None
    np.testing.assert_array_equal(mug.quaternion_xyzw, SCENE[1].quaternion_xyzw)


def test_a_tilted_object_shows_its_full_rotation():
    leaning = (SCENE[0], pose("mug", (0.15, -0.2, 0.8), rotated(0, 30, 0)))
    assert template().codec.observation_text(Query(GRAB, leaning)).startswith("A mug 44 29 19 36 42 36;")


def test_clause_by_clause_unless_some_demonstration_strings_them_together():
    both = demonstration(f"{PUSH}, then {PUSH}", pushes()[0].objects, pushes()[0].actions)
    asked = Order("grab the mug, then grab the tray", ("tray", "mug"))
    assert template().codec.questions(asked) == ("grab the mug", "grab the tray")
    assert template(tasks=([both], stacks())).codec.questions(asked) == (asked.text,)


@pytest.mark.parametrize("representation", ["absolute", "action_tokens"])
def test_the_papers_format_shows_several_instructions(representation):
    asked = template(representation).ask(Query(GRAB, SCENE), 25)
    assert asked.prefix.count(f"'{PUSH}'}}>") == asked.prefix.count(f"'{STACK}'}}>") == 3
    assert asked.query.startswith("{'tray': [79, 59, 14], 'mug': [44, 29, 19, 36, 36, 41], ")


def test_the_demonstrations_of_one_task_are_written_once_where_they_agree():
    many = [*pushes(), *pushes()]
    assert template(tasks=(many, stacks())).prefix.count(PUSH) == 3
