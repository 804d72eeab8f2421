import pytest

from app.llm.openai_compatible import LLAMA_CPP, SERVERS, ServerQuirks, quirks_of, request_body
from app.llm.sse import THINKING_TOKENS
from app.llm.streaming import error_message
from app.pipeline.prompt import Prompt
from tests.llm.texts import asking

PROMPT = Prompt("Be brief.", "a>1, ", "b>", stop=("\n",), grammar='root ::= "1"')
COMMON = {"model", "temperature", "seed", "stream", "stream_options", "messages", "max_tokens"}


def chat_body(model="little", prompt=PROMPT, quirks=None, **options):
    return request_body(asking(prompt, **options), model, "chat", quirks or ServerQuirks())


def test_only_the_common_fields_are_sent_to_a_server_without_quirks():
    assert set(chat_body(cache_key="task-1")) == COMMON


@pytest.mark.parametrize("server", SERVERS)
def test_a_server_whose_chat_model_may_reason_gets_no_stop_string(server):
    """It would end the reasoning, and what the model considered would be left."""
    assert "stop" not in request_body(asking(PROMPT), "little", "chat", SERVERS[server])
    assert request_body(asking(PROMPT), "little", "completion", SERVERS[server])["stop"] == ["\n"]


def test_openai_calls_the_limit_differently_and_routes_by_prefix():
    quirks = quirks_of("https://api.openai.com/v1")
    body = chat_body("gpt-4o", quirks=quirks, cache_key="task-1", max_tokens=9)
    assert body["max_completion_tokens"] == 9
    assert body["prompt_cache_key"] == "task-1"
    assert set(body) == COMMON - {"max_tokens"} | {"stop", "max_completion_tokens", "prompt_cache_key"}
    assert "prompt_cache_key" not in chat_body("gpt-4o", quirks=quirks)


@pytest.mark.parametrize("model", ["o3-mini", "gpt-5", "gpt-5-mini"])
def test_reasoning_models_get_none_of_the_fields_they_refuse(model):
    assert not {"temperature", "stop", "seed"} & set(chat_body(model, quirks=quirks_of("https://api.openai.com/v1")))


def test_a_model_that_thinks_has_room_for_it():
    quirks = quirks_of("https://api.openai.com/v1")
    limits = [chat_body(model, quirks=quirks, max_tokens=9)["max_completion_tokens"] for model in ("gpt-4o", "gpt-5.6")]
    assert limits == [9, 9 + THINKING_TOKENS]


@pytest.mark.parametrize(
    ("server", "field", "value"),
    [
        ("llama_cpp", "grammar", 'root ::= "1"'),
        ("vllm", "structured_outputs", {"grammar": 'root ::= "1"'}),
        ("sglang", "ebnf", 'root ::= "1"'),
    ],
)
@pytest.mark.parametrize("style", ["chat", "completion"])
def test_a_server_gets_the_grammar_where_it_takes_one(server, field, value, style):
    body = request_body(asking(PROMPT), "little", style, SERVERS[server])
    assert body[field] == value
    assert field not in request_body(asking(Prompt("", "", "b>")), "little", style, SERVERS[server])


@pytest.mark.parametrize("server", ["ollama", "lm_studio"])
def test_a_chat_server_gets_the_schema_where_it_takes_one(server):
    asked, schema = Prompt("", "a>1, ", "b>", (), 'root ::= "1"', {"type": "array"}), {"type": "array"}
    body = request_body(asking(asked), "little", "chat", SERVERS[server])
    assert body["response_format"]["json_schema"]["schema"] == schema
    assert "grammar" not in body
    for prompt, style in ((asked, "completion"), (PROMPT, "chat")):
        assert "response_format" not in request_body(asking(prompt), "little", style, SERVERS[server])


def test_raw_text_has_the_system_prompt_first_if_there_is_one():
    bodies = [
        request_body(asking(Prompt(system, "a>1, ", "b>")), "m", "completion", LLAMA_CPP) for system in ("", "Be.")
    ]
    assert [body["prompt"] for body in bodies] == ["a>1, b>", "Be.\na>1, b>"]
    assert all(body["cache_prompt"] for body in bodies)
    assert all("messages" not in body and "stop" not in body and "grammar" not in body for body in bodies)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('{"error": {"message": "no"}}', "no"),
        ('{"error": "no"}', "no"),
        ('{"detail": "no"}', '{"detail": "no"}'),
        ('{"error": {}}', '{"error": {}}'),
        ("[1]", "[1]"),
        (" \n", "no message"),
        ("x" * 1000, "x" * 300),
    ],
)
def test_the_message_is_found_in_an_errors_body(body, message):
    assert error_message(body) == message
