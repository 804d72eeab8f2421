"""Instructions of a case in other words."""

import pytest

from benchmarks.adversary.words import WORDINGS, worded
from tests.benchmarks.adversary.cases import changes, picks

SAID = {
    "polite": "please stack the red cube on the lid",
    "infinitive": "to stack the red cube on the lid",
    "numbered": "task 3: stack the red cube on the lid",
    "capitals": "STACK THE RED CUBE ON THE LID",
    "without articles": "stack red cube on lid",
    "gerund": "stacking the red cube on the lid",
    "third person": "the robot stacks the red cube on the lid",
    "fetching": "pick up the red cube and bring it to the lid",
    "moving": "move the red cube on the lid",
    "names only": "red cube and lid",
}


@pytest.mark.parametrize("name", WORDINGS)
def test_a_case_in_other_words_says_the_same(name):
    assert worded(picks("stack the red cube on the lid."), WORDINGS[name]).instruction == SAID[name]


def test_only_words_change():
    question, recordings, number = changes(picks(), worded(picks(), WORDINGS["polite"]))
    assert (question, recordings, number) == ({"words"}, {"words"}, len(picks().recordings))
