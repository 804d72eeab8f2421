"""The skills of a task: instructions of several clauses in the scenes that the clauses before leave."""

from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.episode import Query
from app.pipeline.skill.skills import Skills
from tests.pipeline.skill.shown import WORDS, drawn, home, posed, recordings

TWICE = "put the cup on the coaster, then put the bowl on the cup"


@pytest.fixture(scope="module")
def skills():
    bowl = posed("bowl", (0.5, -0.35, 0.82))
    shown = recordings(8)
    with_bowl = [replace(item.demonstration, objects=(*item.demonstration.objects, bowl)) for item in shown]
    again = [type(item).of(demonstration, item.motion) for item, demonstration in zip(shown, with_bowl, strict=True)]
    return Skills(tuple(again), {}, ("cup", "coaster", "bowl"))


def asked(instruction, seed=5):
    cup, coaster = drawn(np.random.default_rng(seed))
    return Query(instruction, (cup, coaster, posed("bowl", (0.5, -0.35, 0.82))), start=home())


def test_what_a_clause_puts_somewhere_is_there_for_the_next(skills):
    _, coaster, bowl = asked(TWICE).objects
    first, second = (replace(asked(TWICE), instruction=clause.text) for clause in asked(TWICE).order.clauses)
    (one, (plan,)), (other, (next_plan,)) = skills.in_turn((first, second))
    assert one is first
    np.testing.assert_allclose(other.object("cup").position_m[:2], coaster.position_m[:2], atol=0.01)
    np.testing.assert_allclose(other.object("bowl").position_m, bowl.position_m)
    releases = [
        k for k, row in enumerate(plan) if row.action.gripper_open and k and not plan[k - 1].action.gripper_open
    ]
    let_go_m = [placed[releases[0]].action.position_m for placed in (plan, next_plan)]
    np.testing.assert_allclose(let_go_m[1][:2], let_go_m[0][:2], atol=0.01)
    assert let_go_m[1][2] > let_go_m[0][2] + 0.03  # on the cup, not in it
    (strung,) = skills.placed(asked(TWICE))
    assert [row.action.position_m.tolist() for row in strung] == [
        row.action.position_m.tolist() for row in (*plan, *next_plan)
    ]


def test_what_words_do_not_say_is_moved_stays(skills):
    query = replace(asked(WORDS), instruction="touch the cup, then touch the cup")
    (plan,) = skills.placed(replace(query, instruction=WORDS))
    left = skills.left_by(replace(query, instruction="touch the cup"), plan)
    assert [pose.position_m.tolist() for pose in left.objects] == [p.position_m.tolist() for p in query.objects]
