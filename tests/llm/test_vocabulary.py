"""The trimmed vocabulary reads numbers and common words as the same tokens as the whole one: the replies are equal."""

import asyncio
import struct
from io import BytesIO

import httpx
import pytest

from app.llm.base import Completion, complete
from app.llm.computed import ScriptedModel
from app.llm.llama import gguf
from app.llm.llama.process import LlamaOptions, LlamaProcess
from app.llm.llama.vocabulary import MATRIX, TrimmedModel, covers, kept_tokens
from app.llm.llama.weights import GEMMA, find_weights, trimmed_gemma
from app.pipeline.prompt import Prompt
from tests.llm.texts import asking, object_frame_prompt

DIM = 32  # numbers in a row; a block of Q8_0
ROW_BYTES = 34


@pytest.fixture(scope="module")
def trimmed_path(settings):
    return trimmed_gemma(settings.cache_folder)()


@pytest.fixture(scope="module")
def whole_server(settings):
    options = LlamaOptions(str(find_weights(GEMMA, settings.cache_folder)()), slots=2, context_tokens=2048, threads=1)
    process = LlamaProcess(options)
    yield process.server
    process.stop()


def small_file():
    """Four tokens, of which the matrix has a row each, and another tensor behind it."""
    tokens = gguf.Array(gguf.STRING, [gguf.string(word) for word in ("a", "b", "ж", "d")])
    values = {"general.architecture": gguf.string_value("gemma3"), "tokenizer.ggml.tokens": tokens}
    rows = b"".join(bytes([number]) * ROW_BYTES for number in range(4))
    padded = rows + bytes(-len(rows) % gguf.ALIGNMENT)
    tensors = {
        MATRIX: gguf.Tensor((DIM, 4), gguf.Q8_0, padded),
        "output_norm.weight": gguf.Tensor((DIM,), 0, struct.pack(f"<{DIM}f", *range(DIM))),
    }
    return gguf.GgufFile(values, tensors)


def written(parts):
    file = BytesIO()
    gguf.write(parts, file)
    return file.getvalue()


def test_a_file_is_written_as_it_was_read():
    assert gguf.read(written(small_file())) == small_file()


def test_rows_are_taken_whole():
    taken = small_file().tensors[MATRIX].take_rows([0, 3])
    assert taken.shape == (DIM, 2)
    assert taken.data[: 2 * ROW_BYTES] == b"\x00" * ROW_BYTES + b"\x03" * ROW_BYTES
    assert len(taken.data) % gguf.ALIGNMENT == 0


def test_rows_of_another_type_are_refused():
    with pytest.raises(ValueError, match="type 0"):
        small_file().tensors["output_norm.weight"].take_rows([0])


@pytest.mark.parametrize("content", [b"", b"GGUF", b"GGUF" + struct.pack("<IQQ", 2, 0, 0), b"PK" + bytes(40)])
def test_other_files_than_gguf_are_refused(content):
    with pytest.raises(ValueError, match="GGUF"):
        gguf.read(content)


@pytest.mark.parametrize("length", [30, 60, 90])
def test_a_file_cut_in_its_head_is_refused(length):
    with pytest.raises(ValueError, match="ends within its head"):
        gguf.read(written(small_file())[:length])


def test_tokens_that_stay():
    texts = ["?"] * 262_144
    texts[7], texts[600], texts[601], texts[70_000], texts[70_001] = "<жж>", "▁blue", "ж", "▁bluer", "+--"
    texts[240_000], texts[240_001], texts[240_002] = "é", "ж", "w"
    kept = set(kept_tokens(texts))
    assert {7, 600, 70_001, 240_000, 240_002} <= kept
    assert not {601, 70_000, 240_001} & kept


def test_the_file_is_less_than_half_and_names_the_change_in_its_metadata(trimmed_path, settings):
    assert trimmed_path.stat().st_size < find_weights(GEMMA, settings.cache_folder)().stat().st_size / 2
    description = gguf.read(trimmed_path.read_bytes()).values["general.description"]
    assert b"Modified by RoboPrompt" in description
    assert b"ai.google.dev/gemma/terms" in description


def pieces(server, text):
    """The texts of the tokens that a prompt is read as."""
    url = server.base_url.replace("/v1", "/tokenize")
    headers = {"Authorization": f"Bearer {server.key}"}
    body = {"content": text, "with_pieces": True}
    answer = httpx.post(url, json=body, headers=headers, timeout=60, trust_env=False).raise_for_status()
    return [token["piece"] for token in answer.json()["tokens"]]


TEXTS = {
    "object_frame": object_frame_prompt().user,
    "paper": "{'red block': [54, 39, 19, 0, 36, 36], 'cup': [1, 2, 3, 0, 0, 71]}>[[54, 39, 20, 0, 36, 1]], ",
    "words": "put the blue cup on the wooden table; open the drawer, close the box, push the button next to the lamp",
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_prompts_are_read_as_the_same_tokens(llama_server, whole_server, text):
    assert pieces(llama_server, text) == pieces(whole_server, text)


def test_rare_words_are_read_in_pieces(llama_server):
    text = " maroon screwdriver"
    assert pieces(llama_server, text) == [" mar", "oon", " scre", "wdriver"]


def test_replies_are_the_same(llama_server, whole_server):
    prompt = object_frame_prompt()
    body = {"prompt": prompt.user, "n_predict": 60, "temperature": 0, "grammar": prompt.grammar, "stop": ["\n"]}

    def reply(server):
        headers = {"Authorization": f"Bearer {server.key}"}
        url = server.base_url.replace("/v1", "/completion")
        return httpx.post(url, json=body, headers=headers, timeout=120, trust_env=False).raise_for_status().json()

    assert reply(llama_server)["content"] == reply(whole_server)["content"]


@pytest.mark.parametrize(
    ("text", "covered"),
    [("press the red button", True), ("la tasse à café", True), ("нажми кнопку", False), ("按红色按钮", False)],
)
def test_other_scripts_need_the_whole_vocabulary(text, covered):
    assert covers(Prompt("", "A red button 1 2 3", text)) is covered
    assert covers(Prompt(text, "", "")) is covered


class Started(ScriptedModel):
    """Replies with its name, and notes whether it was started."""

    started = False

    async def warm_up(self):
        self.started = True


def test_the_whole_model_answers_what_the_trimmed_one_cannot_read():
    trimmed, whole = Started(["trimmed"]), Started(["whole"])
    model = TrimmedModel(trimmed, whole)

    async def scenario():
        await model.warm_up()
        assert (await complete(model, asking(Prompt("", "", "blue")))).text == "trimmed"
        assert (await complete(model, asking(Prompt("", "", "синий")))).text == "whole"
        *_, last = [piece async for piece in model.stream(asking(Prompt("", "", "青い")))]
        assert isinstance(last, Completion)
        assert last.text == "whole"

    asyncio.run(scenario())
    assert trimmed.started
    assert not whole.started
