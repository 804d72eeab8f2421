import numpy as np
import pytest

from app.pipeline.order.order import Order
from app.pipeline.representation.base import PROMPT_FORMATS, REPRESENTATIONS, row_count_bounds
from roboprompt_client.errors import InvalidInputError
from tests.pipeline.asking import codec_of

from ..scenes import WORKSPACE, action, demonstration, pose

ONE, TWO = "push the button", "push the button, then push the button"


def demo(num_actions, instruction=ONE):
    return demonstration(instruction, [pose("button", (0, 0, 1))], [action((0, 0, 1))] * num_actions)


@pytest.mark.parametrize(
    ("demonstrations", "instruction", "max_actions", "expected"),
    [
        ([demo(3)], ONE, 25, (3, 3)),
        ([demo(3), demo(5), demo(4)], ONE, 25, (3, 5)),
        ([demo(3), demo(5)], TWO, 25, (6, 10)),
        # a demonstration of two clauses shows half its rows per clause
        ([demo(6, TWO)], TWO, 25, (6, 6)),
        ([demo(6, TWO)], ONE, 25, (3, 3)),
        ([demo(5, TWO)], ONE, 25, (2, 3)),
        ([demo(1, TWO)], ONE, 25, (1, 1)),
        ([demo(3), demo(7, TWO)], TWO, 25, (6, 7)),
        # never more than asked for
        ([demo(3), demo(9)], TWO, 10, (6, 10)),
        ([demo(9)], ONE, 4, (4, 4)),
    ],
)
def test_row_count_bounds(demonstrations, instruction, max_actions, expected):
    assert row_count_bounds(demonstrations, Order(instruction, ("button",)), max_actions) == expected


@pytest.mark.parametrize("representation", REPRESENTATIONS)
@pytest.mark.parametrize("prompt_format", PROMPT_FORMATS)
def test_the_format_decides_whether_the_observation_has_the_instruction(representation, prompt_format):
    codec = codec_of(representation, prompt_format, [demo(2)], WORKSPACE)
    assert (ONE in codec.observation_text(demo(2))) == (prompt_format == "paper")


@pytest.mark.parametrize("representation", REPRESENTATIONS)
def test_texts_have_plain_integers_only(representation):
    given = demonstration(ONE, [pose("button", np.array([0.1, 0.2, 0.9]), 33)], [action((0.1, 0.2, 1))])
    text = codec_of(representation, "paper", [given], WORKSPACE).demonstration_text(given)
    assert "np" not in text
    assert "int" not in text


@pytest.mark.parametrize(
    ("representation", "prompt_format", "demonstrations", "field"),
    [
        ("relative", "paper", [demo(1)], "representation"),
        ("absolute", "chat", [demo(1)], "prompt_format"),
        ("absolute", "paper", [], "demonstrations"),
        ("object_frame", "paper", [], "demonstrations"),
    ],
)
def test_unknown_names_and_missing_demonstrations_are_refused(representation, prompt_format, demonstrations, field):
    with pytest.raises(InvalidInputError) as caught:
        codec_of(representation, prompt_format, demonstrations, WORKSPACE)
    assert caught.value.field == field
