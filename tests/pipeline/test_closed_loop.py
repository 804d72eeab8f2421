import numpy as np
import pytest

from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation import fit_codec
from roboprompt_client.errors import InvalidInputError
from tests.pipeline.asking import parse_reply

from .gbnf import matches
from .scenes import WORKSPACE, action, pose

LIFT = "lift the cup"
UP = np.array([0.0, 0.0, 0.1])


def lift(x_m, num_actions=2):
    """Grasp the cup where it stands, then lift it, with which it moves."""
    center = np.array([x_m, 0.2, 0.705])
    actions = [action(center, gripper_open=False), *[action(center + UP)] * (num_actions - 1)]
    cups = [pose("cup", center, 0), *[pose("cup", center + UP, 0)] * (num_actions - 1)]
    return Demonstration(LIFT, (pose("cup", center, 0),), tuple(actions), "e1", tuple((cup,) for cup in cups))


def written(*demonstrations, representation="object_frame"):
    def fit(shown, step):
        return fit_codec(representation, "paper", shown, WORKSPACE, first_row=step + 1)

    return ClosedLoopTemplate.write(fit, demonstrations, "")


def test_observations_and_actions_take_turns():
    template = written(lift(0.1), lift(0.3))
    assert template.prefix == (
        "A cup 39 69 10 36; lift the cup > 1 A w: +0 +0 +0 0 36 36 0\n"
        "A cup 39 69 10 36; lift the cup > 2 A w: +0 +0 +20 0 36 36 1\n"
        "A cup 39 69 20 36; lift the cup > done\n"
        "A cup 59 69 10 36; lift the cup > 1 A w: +0 +0 +0 0 36 36 0\n"
        "A cup 59 69 10 36; lift the cup > 2 A w: +0 +0 +20 0 36 36 1\n"
        "A cup 59 69 20 36; lift the cup > done\n"
    )


def test_the_papers_format():
    template = written(lift(0.1), representation="absolute")
    first = "{'cube': [39, 69, 10, 36, 36, 36], 'lift the cup'}>".replace("cube", "cup")
    assert template.prefix.startswith(f"{first}[[39, 69, 10, 0, 36, 36, 0]], {first}[[")
    assert template.prefix.endswith("done, ")


def test_a_step_is_decoded_against_what_is_seen_at_that_step():
    template = written(lift(0.1), lift(0.3)).at_step(1)
    cup = pose("cup", (0.2, 0.1, 0.8), 0)
    (lifted,) = parse_reply(" 2 A w: +0 +0 +20 0 36 36 1\n", template.codec, [cup], LIFT, 25)
    np.testing.assert_allclose(lifted.position_m, [0.2, 0.1, 0.9])
    assert parse_reply(" done\n", template.codec, [cup], LIFT, 25) == ()


@pytest.mark.parametrize("reply", ["1 A w: +0 +0 +20 0 36 36 1", "2 A w: +0 +0 +20 0 36 36 1; 3 A w: +0 +0 +0 0 0 0 1"])
def test_another_row_than_the_step_s_is_refused(reply):
    template = written(lift(0.1)).at_step(1)
    with pytest.raises(ReplyParseError):
        parse_reply(reply, template.codec, [pose("cup", (0.2, 0.1, 0.8), 0)], LIFT, 1)


def test_the_grammar_of_each_step():
    template = written(lift(0.1), lift(0.3, num_actions=1))
    grammars = [template.at_step(step).codec.grammar(lift(0.1), 25) for step in range(4)]
    grasp, raised = " A w: +0 +0 +0 0 36 36 0\n", " A o: +0 +0 +20 0 36 36 1\n"
    assert [matches(grammar, " done\n") for grammar in grammars] == [True] * 4
    assert [matches(grammar, f" {k + 1}{grasp}") for k, grammar in enumerate(grammars)] == [True, False, False, False]
    assert [matches(grammar, f" {k + 1}{raised}") for k, grammar in enumerate(grammars)] == [False, True, False, False]


def test_after_the_last_step_of_every_demonstration_only_the_end_is_left():
    template = written(lift(0.1)).at_step(7)
    with pytest.raises(ReplyParseError, match="expected 'done'"):
        parse_reply("3 A w: +0 +0 +20 0 36 36 1", template.codec, [pose("cup", (0.2, 0.1, 0.8), 0)], LIFT)


def test_demonstrations_must_have_tracked_their_objects():
    untracked = Demonstration(LIFT, lift(0.1).objects, lift(0.1).actions, "e7")
    with pytest.raises(InvalidInputError, match="closed_loop: episode e7 has no object poses after its first frame"):
        written(lift(0.1), untracked)
