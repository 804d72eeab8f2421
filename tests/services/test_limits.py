import pytest

from app.services.limits import Limits
from roboprompt_client.errors import InvalidInputError

TIGHT = Limits(model_files=False)


def test_what_fits_passes():
    for name in ("embedded/gemma-3-270m", "openai/gpt-4o", "openai_compatible/org/model.gguf", "regression"):
        TIGHT.check_model(name)


def test_models_that_the_operator_wants():
    limits = Limits(allowed_models=("openai/gpt-4o*", "regression"))
    for name in ("openai/gpt-4o", "openai/gpt-4o-mini", "regression"):
        limits.check_model(name)
    for name in ("openai/o3", "OpenAI/gpt-4o", "scripted"):
        with pytest.raises(InvalidInputError, match="not offered here"):
            limits.check_model(name)


@pytest.mark.parametrize("name", ["embedded//etc/passwd", "embedded/~/model.gguf", "embedded/model.gguf"])
def test_a_file_of_the_services_machine(name):
    with pytest.raises(InvalidInputError, match="a file of the service's machine"):
        TIGHT.check_model(name)
    Limits().check_model(name)
