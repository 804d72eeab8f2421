"""Of what people may say, every phrasing is right or refused; none moves another object."""

import pytest

from app.pipeline.errors import UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order.reading import read
from tests.pipeline.order.phrasings import (
    LAYOUTS,
    PHRASINGS,
    REFUSED_THOUGH_CLEAR,
    TAUGHT,
    TAUGHT_INSTRUCTIONS,
    listed,
    meant,
)

REFUSALS = (UngroundedInstructionError, UnfamiliarInstructionError)


def objects_asked_for(task, instruction):
    """In the order in which prompts have them."""
    order = read(instruction, TAUGHT[task], LAYOUTS[task])
    return tuple(name for clause in order.clauses for name in clause.objects)


@pytest.mark.parametrize(("task", "words", "said"), [item for item in PHRASINGS if item[1]])
def test_what_is_meant_is_understood(task, words, said):
    assert objects_asked_for(task, said) == meant(task, words)


@pytest.mark.parametrize(("task", "said"), [(task, said) for task, words, said in PHRASINGS if not words])
def test_what_is_not_clear_is_refused(task, said):
    with pytest.raises(REFUSALS) as refused:
        read(said, TAUGHT[task], LAYOUTS[task])
    assert refused.value.field == "instruction"
    assert all(text in refused.value.valid for text in (*TAUGHT[task].names, *TAUGHT_INSTRUCTIONS[task]))


@pytest.mark.parametrize(("task_and_words", "said"), listed(REFUSED_THOUGH_CLEAR))
def test_what_is_beyond_the_grammar_is_refused(task_and_words, said):
    task = task_and_words[0].split(":")[0]
    with pytest.raises(REFUSALS):
        read(said, TAUGHT[task], LAYOUTS[task])


@pytest.mark.parametrize("task", TAUGHT)
def test_every_taught_instruction_is_itself(task):
    for instruction in TAUGHT_INSTRUCTIONS[task]:
        assert read(instruction, TAUGHT[task]).text == instruction


def test_there_are_many_phrasings_of_both_kinds():
    assert sum(bool(words) for _, words, _ in PHRASINGS) > 90 < sum(not words for _, words, _ in PHRASINGS)
