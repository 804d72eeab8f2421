import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.pipeline.episode import Demonstration, Query
from app.pipeline.prompt import SYSTEM_PROMPTS, PromptTemplate
from app.pipeline.representation.base import PROMPT_FORMATS, REPRESENTATIONS, formats_of
from app.pipeline.spans import prompt_spans
from app.pipeline.workspace import Workspace
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose
from tests.pipeline.asking import codec_of

STYLES = [(representation, form) for representation in REPRESENTATIONS for form in formats_of(representation)]
FORMATS = [(name, form) for name, form in STYLES if name != "parts" and form in PROMPT_FORMATS]
DOWN = [1.0, 0.0, 0.0, 0.0]
LEVEL = [0.0, 0.0, 0.0, 1.0]
# what looks like structure: digits in names, an apostrophe, a quotation, an instruction that ends like an object
INSTRUCTIONS = ("push the red button", "don't push 'cube 2', push the red button 1 2 3")


def demonstration(instruction, x_m):
    objects = (
        ObjectPose("red button", [x_m, 0.1, 0.8], LEVEL),
        ObjectPose("cube 2", [0.3, x_m, 0.8], LEVEL),
        ObjectPose("грань_v1.0", [0.2, 0.2, 0.8]),
    )
    actions = [EndEffectorAction([x_m, 0.1, z], DOWN, z > 0.9) for z in (1.0, 0.85, 1.0)]
    return Demonstration(instruction, objects, tuple(actions))


def prompt_and_actions(representation, prompt_format, instruction):
    demonstrations = [demonstration(instruction, x_m) for x_m in (0.1, 0.2)]
    codec = codec_of(representation, prompt_format, demonstrations, Workspace.rlbench())
    template = PromptTemplate.write(codec, demonstrations, "")
    query = demonstration(instruction, 0.3)
    return template.ask(Query(instruction, query.objects), 25).user, [codec.actions_text(d) for d in demonstrations]


def texts(spans, kind):
    return [span.text for span in spans if span.kind == kind]


@pytest.mark.parametrize("instruction", INSTRUCTIONS)
@pytest.mark.parametrize(("representation", "prompt_format"), FORMATS)
def test_every_part_of_a_prompt_has_its_kind(representation, prompt_format, instruction):
    prompt, actions = prompt_and_actions(representation, prompt_format, instruction)
    spans = prompt_spans(prompt, representation, prompt_format)
    assert "".join(span.text for span in spans) == prompt
    objects = texts(spans, "object")
    assert len(objects) == 3 * 3
    for name in ("red button", "cube 2", "грань_v1.0"):
        assert sum(name in text for text in objects) == 3
    shown = f"'{instruction}'" if representation != "object_frame" else instruction
    assert texts(spans, "instruction") == ([shown] * 3 if prompt_format == "paper" else [])
    assert len(texts(spans, "separator")) == 2
    assert "".join(texts(spans, "action")) == "".join(actions).replace("; ", "")
    assert not set("".join(texts(spans, "plain"))) - set("{}, >;")


def test_the_paper_s_example():
    text = "{'drawer': [42, 65, 29], 'open it'}>[[46, 74, 55, 54, 36, 37, 1], [40, 7, 5, 4, 6, 7, 0]], "
    assert [(span.kind, span.text) for span in prompt_spans(text, "absolute", "paper")] == [
        ("plain", "{"),
        ("object", "'drawer': [42, 65, 29]"),
        ("plain", ", "),
        ("instruction", "'open it'"),
        ("plain", "}>"),
        ("action", "[[46, 74, 55, 54, 36, 37, 1], [40, 7, 5, 4, 6, 7, 0]]"),
        ("separator", ", "),
    ]


def test_what_is_no_row_stays_plain():
    spans = prompt_spans("1 A w: +0 +0 +14 0 36 36; I'd rather not", "object_frame", "paper")
    assert {span.kind for span in spans} == {"plain"}


def test_rows_that_are_sums():
    prompt, (reply, _) = prompt_and_actions("absolute", "sums", INSTRUCTIONS[1])
    spans = prompt_spans(prompt, "absolute", "sums")
    assert len(texts(spans, "object")) == 3 * 3
    assert texts(spans, "instruction") == [f"'{INSTRUCTIONS[1]}'"] * 3
    assert len(texts(spans, "action")) == 2 * 3
    assert len(texts(spans, "separator")) == 2
    assert texts(spans, "action")[:3] == texts(prompt_spans(reply, "absolute", "sums"), "action")


def test_a_step_of_sums_belongs_to_its_object():
    drawer, row = "'drawer': [60,51,6,36,36,18] a(+0 +11 +6) b(+0 +1 +6 0)", "1 drawer a +0 +11 +6: [60+0=60,1]"
    spans = prompt_spans(f"{{{drawer}, 'open it'}}>open it [{row}]", "absolute", "sums")
    assert texts(spans, "object") == [drawer]
    assert texts(spans, "action") == [row]


def test_the_steps_of_parts():
    parts = "Objects: green block\nAt plate 2: red block, cup\nInstruction: build it: 2 high\nSteps:"
    steps = "1. grasp green block\n2. release 2 plate 2"
    spans = prompt_spans(f"{parts}\n{steps}\n\nObjects: cup\nSteps:", "parts", "paper")
    assert texts(spans, "object") == ["Objects: green block", "At plate 2: red block, cup", "Objects: cup"]
    assert texts(spans, "instruction") == ["build it: 2 high"]
    assert texts(spans, "action") == ["1. grasp green block", "2. release 2 plate 2"]
    assert texts(spans, "separator") == ["\n\n"]


@given(st.text(alphabet="ab'{}[]<>;:, \n019+-w", max_size=60) | st.text(), st.sampled_from(STYLES))
def test_nothing_is_lost_or_repeated(text, style):
    assert "".join(span.text for span in prompt_spans(text, *style)) == text


@pytest.mark.parametrize("system", SYSTEM_PROMPTS.values())
def test_a_text_of_another_representation_stays_as_it_is(system):
    assert "".join(span.text for span in prompt_spans(system, "action_tokens", "paper")) == system


@pytest.mark.parametrize(
    "frame", ["A w", "A o", "A ow>B", "A wo hand=B", "world", "start hand=A>B", "A w z=world x=B", "A/B w axes=C"]
)
def test_a_row_of_every_frame_is_an_action(frame):
    row = f"1 {frame}: +0 -3 +24 0 36 36 0"
    assert texts(prompt_spans(row, "object_frame", "paper"), "action") == [row]
