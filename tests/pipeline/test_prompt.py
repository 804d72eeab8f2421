import hashlib

import pytest

from app.pipeline.episode import Query
from app.pipeline.prompt import SYSTEM_PROMPTS, PromptTemplate, system_prompt_text
from roboprompt_client.errors import InvalidInputError
from tests.pipeline.asking import codec_of

from .gbnf import matches
from .scenes import WORKSPACE, action, demonstration, pose

A = SYSTEM_PROMPTS["a"]
DIGESTS = ["9b4e2c79", "842baf91", "d6d95dbc"]


def shown(x_m):
    return demonstration("open the drawer", [pose("drawer", (x_m, 0.155, 0.895))], [action((x_m, 0.245, 1.155))] * 2)


def template(representation, prompt_format="paper"):
    demonstrations = [shown(0.125), shown(0.205)]
    codec = codec_of(representation, prompt_format, demonstrations, WORKSPACE)
    return PromptTemplate.write(codec, demonstrations, A)


EXPECTED = {
    ("absolute", "paper"): (
        "{'drawer': [42, 65, 29], 'open the drawer'}>[[42, 74, 55, 0, 36, 36, 1], [42, 74, 55, 0, 36, 36, 1]], "
        "{'drawer': [50, 65, 29], 'open the drawer'}>[[50, 74, 55, 0, 36, 36, 1], [50, 74, 55, 0, 36, 36, 1]], ",
        "{'drawer': [30, 65, 29], 'open it'}>",
    ),
    ("absolute", "authors"): (
        "{'drawer': [42, 65, 29]}>[[42, 74, 55, 0, 36, 36, 1], [42, 74, 55, 0, 36, 36, 1]], "
        "{'drawer': [50, 65, 29]}>[[50, 74, 55, 0, 36, 36, 1], [50, 74, 55, 0, 36, 36, 1]], ",
        "{'drawer': [30, 65, 29]}>",
    ),
    ("object_frame", "paper"): (
        "A drawer 42 65 29; open the drawer > 1 A w: +0 +18 +52 0 36 36 1; 2 A w: +0 +18 +52 1\n"
        "A drawer 50 65 29; open the drawer > 1 A w: +0 +18 +52 0 36 36 1; 2 A w: +0 +18 +52 1\n",
        "A drawer 30 65 29; open it >",
    ),
}


@pytest.mark.parametrize(("style", "expected"), EXPECTED.items(), ids=" ".join)
def test_the_text_is_the_demonstrations_then_the_query(style, expected):
    prompt = template(*style).ask(Query("open it", shown(0.005).objects), 25)
    assert (prompt.prefix, prompt.query) == expected
    assert prompt.user == "".join(expected)
    assert prompt.system == A


@pytest.mark.parametrize("representation", ["absolute", "object_frame"])
def test_the_prefix_is_the_same_bytes_for_every_query(representation):
    written = template(representation)
    first = written.ask(Query("open it", shown(0.005).objects), 25)
    second = written.ask(Query("close the drawer, then open the drawer", shown(0.5).objects), 3)
    again = template(representation).ask(Query("open the drawer", shown(0.3).objects), 25)
    assert first.prefix.encode() == second.prefix.encode() == again.prefix.encode()
    assert first.query != second.query
    assert matches(first.grammar, GRAMMATICAL[representation])
    assert not matches(second.grammar, GRAMMATICAL[representation])  # which asks for 3 rows
    assert first.stop == second.stop == written.codec.stop


GRAMMATICAL = {
    "absolute": "[[42, 74, 55, 0, 36, 36, 1], [42, 74, 55, 0, 36, 36, 1]]",
    "object_frame": " 1 A w: +0 +18 +52 0 36 36 1; 2 A w: +0 +18 +52 1\n",
}


def test_system_prompts():
    """Those of the paper are its appendix B, letter by letter."""
    digests = [hashlib.sha256(system_prompt_text(choice).encode()).hexdigest()[:8] for choice in "abc"]
    assert digests == DIGESTS
    assert (system_prompt_text("none"), system_prompt_text("Be brief.")) == ("", "Be brief.")


def test_a_long_system_prompt_is_refused():
    assert len(system_prompt_text("x" * 4000)) == 4000
    with pytest.raises(InvalidInputError, match="4001 characters") as caught:
        system_prompt_text("x" * 4001)
    assert caught.value.field == "system_prompt"
