import pytest

from app.services.offered_models import OfferedModels
from roboprompt_client.errors import InvalidInputError

TIGHT = OfferedModels(files=False)


def test_what_fits_passes():
    for name in ("embedded/gemma-3-270m", "openai/gpt-4o", "openai_compatible/org/model.gguf", "regression"):
        TIGHT.check(name)


def test_models_that_the_operator_wants():
    offered = OfferedModels(allowed=("openai/gpt-4o*", "regression"))
    for name in ("openai/gpt-4o", "openai/gpt-4o-mini", "regression"):
        offered.check(name)
    for name in ("openai/o3", "OpenAI/gpt-4o", "scripted"):
        with pytest.raises(InvalidInputError, match="not offered here"):
            offered.check(name)


@pytest.mark.parametrize("name", ["embedded//etc/passwd", "embedded/~/model.gguf", "embedded/model.gguf"])
def test_a_file_of_the_services_machine(name):
    with pytest.raises(InvalidInputError, match="a file of the service's machine"):
        TIGHT.check(name)
    OfferedModels().check(name)
