import pytest

from app.services.limits import Limits
from roboprompt_client.errors import InvalidInputError

TIGHT = Limits(
    max_objects=2, max_cameras=1, max_name_chars=5, max_instruction_chars=10, max_prompt_chars=100, model_files=False
)


@pytest.mark.parametrize(
    ("scene", "field"),
    [
        (("pick up", "go", [], []), "task"),
        (("pick", "go to the end", [], []), "instruction"),
        (("pick", "go", ["a", "b", "c"], []), "objects"),
        (("pick", "go", ["a"], ["x", "y"]), "cameras"),
        (("pick", "go", ["mugmug"], []), "objects.name"),
        (("pick", "go", ["a"], ["camera"]), "cameras.name"),
    ],
)
def test_what_is_too_large_is_named(scene, field):
    with pytest.raises(InvalidInputError, match="at most") as caught:
        TIGHT.check_scene(*scene)
    assert caught.value.field == field


def test_what_fits_passes():
    TIGHT.check_scene("pick", "go", ["mug", "lid"], ["front"])
    TIGHT.check_prompt(100)
    for name in ("embedded/gemma-3-270m", "openai/gpt-4o", "openai_compatible/org/model.gguf", "regression"):
        TIGHT.check_model(name)


def test_models_that_the_operator_wants():
    limits = Limits(allowed_models=("openai/gpt-4o*", "regression"))
    for name in ("openai/gpt-4o", "openai/gpt-4o-mini", "regression"):
        limits.check_model(name)
    for name in ("openai/o3", "OpenAI/gpt-4o", "scripted"):
        with pytest.raises(InvalidInputError, match="not offered here"):
            limits.check_model(name)


def test_a_prompt_that_is_too_long():
    with pytest.raises(InvalidInputError, match="at most 100 characters"):
        TIGHT.check_prompt(101)


@pytest.mark.parametrize("name", ["embedded//etc/passwd", "embedded/~/model.gguf", "embedded/model.gguf"])
def test_a_file_of_the_services_machine(name):
    with pytest.raises(InvalidInputError, match="a file of the service's machine"):
        TIGHT.check_model(name)
    Limits().check_model(name)
