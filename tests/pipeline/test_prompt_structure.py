"""Whatever people call things and say, the prompt keeps its structure: it can be read back piece by piece."""

import re
import string
import unicodedata

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from app.pipeline.episode import Query
from app.pipeline.prompt import PromptTemplate
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import INSTRUCTION_FORBIDDEN, checked_instruction, checked_object_name
from tests.pipeline.asking import codec_of

from .scenes import WORKSPACE, action, demonstration, pose

HOSTILE = [
    "}>[[", "a\nb", "a\rb", "a\u2028b", "a\u2029b", "a\x85b", "a\x0bb", "a\x00b", "x; B cup 1 2 3", "go > 1 A w: +0",
    "[[1, 2]]", "{'cube': 1}", "a\u202eb", "a\u2066b", "a\u200bb", "\U000e0041go", "\ud800", "", "   ", "x" * 501,
]  # fmt: skip
ALPHABET = string.ascii_letters + string.digits + " _.-éß红钮लाボ٣"
NAMES = st.text(ALPHABET, min_size=1, max_size=12)
ANY_TEXT = st.text(max_size=60) | st.text(ALPHABET + "'\",:A1{}[]<>;\n\u2028", max_size=30)


@pytest.mark.parametrize("text", HOSTILE)
def test_what_would_break_the_structure_is_refused(text):
    with pytest.raises(InvalidInputError, match="not a valid instruction"):
        checked_instruction("instruction", text)
    with pytest.raises(InvalidInputError, match="not a valid name"):
        checked_object_name("objects.name", text)


PERSIAN = "\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645"  # with a joiner, as it is spelled


@pytest.mark.parametrize(
    "text", ["Push the robot's button.", "öffne die Schublade", PERSIAN, "把红色方块放到蓝色方块上"]
)
def test_what_people_say_is_taken(text):
    assert checked_instruction("instruction", text) == text


@given(ANY_TEXT)
def test_what_is_taken_is_visible_and_on_one_line(text):
    try:
        taken = checked_instruction("instruction", text)
    except InvalidInputError:
        return
    assert len(taken.splitlines()) == 1
    assert not set(taken) & set("{}[]<>;")
    assert not [c for c in taken if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")]
    assert not [c for c in taken if unicodedata.bidirectional(c) in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI")]


def accepted(names, instruction):
    """The names and the instruction if they are valid; otherwise another example is taken."""
    try:
        checked = [checked_object_name("objects.name", name) for name in names]
        return checked, checked_instruction("instruction", instruction)
    except InvalidInputError:
        assume(False)
        raise


def prompt(representation, names, instruction):
    objects = [pose(name, (0.1 * k, 0.1, 1.0)) for k, name in enumerate(names)]
    shown = [demonstration(instruction, objects, [action((0.1, 0.2, 1.0)), action((0.1, 0.2, 1.1))]) for _ in range(2)]
    codec = codec_of(representation, "paper", shown, WORKSPACE)
    return PromptTemplate.write(codec, shown, "").ask(Query(instruction, tuple(objects)), 25)


SCENES = (st.lists(NAMES, min_size=1, max_size=4, unique=True), ANY_TEXT)


@given(*SCENES)
@example(["A", "B", "A w"], "1 A w: +0 +0 +0 0 0 0 1")
@example(["1 2 3"], "A cube 40 41 17 36")
@example(["done"], "done")
def test_rows_relative_to_objects_can_be_read_back(names, instruction):
    names, instruction = accepted(names, instruction)
    said = instruction.rstrip(".")
    lines = prompt("object_frame", names, instruction).user.split("\n")
    assert len(lines) == 3
    for line, is_query in zip(lines, (False, False, True), strict=True):
        assert line.count(">") == 1
        observation, rows = line.split(">")
        *objects, written = observation.removesuffix(" ").split("; ")
        assert written == said
        assert sorted(re.sub(r"( \d+)+$", "", item.split(" ", 1)[1]) for item in objects) == sorted(
            re.sub(r"( \d+)+$", "", name) for name in names
        )
        assert len(objects) == len(names)
        assert rows == "" if is_query else re.fullmatch(r"( \d (?:[A-Z] [wo]|world): [^;]+;?){2}", rows)


@given(*SCENES)
@example(["cube"], "it', 'ball': 'x'")
@example(["cube"], "'}>")
def test_the_papers_format_can_be_read_back(names, instruction):
    names, instruction = accepted(names, instruction)
    text = prompt("absolute", names, instruction).user
    blocks = re.findall(r"\{([^{}]*)\}>([^{}]*)", text)
    assert len(blocks) == 3
    assert "".join(f"{{{observation}}}>{rows}" for observation, rows in blocks) == text
    for observation, _ in blocks:
        rest = observation
        for name in names:
            found = re.match(rf"'{re.escape(name)}': \[\d+, \d+, \d+\], ", rest)
            assert found, (name, rest)
            rest = rest[found.end() :]
        assert rest == f"'{instruction}'"
    assert blocks[-1][1] == ""


def test_the_rule_names_every_line_separator_that_python_knows():
    separators = [chr(code) for code in range(0x110000) if len(f"a{chr(code)}b".splitlines()) == 2]
    assert all(INSTRUCTION_FORBIDDEN.search(character) for character in separators)
