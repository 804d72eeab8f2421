"""What the backends read is what the environment says."""

import pytest
from pydantic import ValidationError

from app.llm.llm_settings import LlmSettings, variable
from app.settings import Settings

VALUES = {
    "default_model": ("openai/gpt-4o", "openai/gpt-4o"),
    "anthropic_api_key": ("k", "**********"),
    "compatible_style": ("completion", "completion"),
    "scripted_replies": ('["[[1]]", "no"]', "('[[1]]', 'no')"),
    "embedded_threads": ("2", "2"),
}


def test_every_llm_setting_can_be_set(monkeypatch):
    for name, (text, _) in VALUES.items():
        monkeypatch.setenv(variable(name), text)
    settings = Settings()
    assert isinstance(settings, LlmSettings)
    assert {name: str(getattr(settings, name)) for name in VALUES} == {
        name: value for name, (_, value) in VALUES.items()
    }


def test_a_bare_one_does_not_read_the_environment(monkeypatch):
    monkeypatch.setenv(variable("default_model"), "openai/gpt-4o")
    assert LlmSettings().default_model == "embedded/gemma-3-270m"
    with pytest.raises(ValidationError, match="embedded_threds"):
        LlmSettings(embedded_threds=3)


@pytest.mark.parametrize("kind", [LlmSettings, Settings])
def test_a_key_is_not_shown(kind):
    settings = kind(openai_api_key="sk-secret", anthropic_api_key="sk-secret", compatible_api_key="sk-secret")
    assert settings.openai_api_key.get_secret_value() == "sk-secret"
    assert "sk-secret" not in f"{settings} {settings!r}"


@pytest.mark.parametrize(("name", "value"), [("embedded_slots", "0"), ("compatible_server", "x")])
def test_a_setting_that_makes_no_sense_is_refused(monkeypatch, name, value):
    monkeypatch.setenv(variable(name), value)
    with pytest.raises(ValidationError, match=name):
        Settings()
