"""Wrong choices end a command before any work starts, in words that say what would be right."""

import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest
from typer.testing import CliRunner

from app.cli import COMMANDS, application, load
from app.evaluation.server import free_port
from roboprompt_client import cli as script
from roboprompt_client.version import VERSION
from tests.e2e.processes import answering


def said(run):
    return " ".join(run.output.replace("\N{BOX DRAWINGS LIGHT VERTICAL}", " ").split())


@pytest.fixture(autouse=True)
def _no_work(monkeypatch):
    """Whatever would record, simulate or serve fails the test."""

    def begun(*arguments, **settings):
        raise AssertionError("work has begun")

    monkeypatch.setattr("app.cli.demo.service", begun)
    monkeypatch.setattr("app.evaluation.sweep_run.service", begun)
    monkeypatch.setattr("uvicorn.run", begun)
    monkeypatch.delenv("ROBOPROMPT_OPENAI_API_KEY", raising=False)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["demo", "--task", "foo"], "'foo' is not one of push_button, stack_cube"),
        (["demo", "--model", "gpt-5"], "there is no model 'gpt-5'; there are embedded/gemma-3-270m"),
        (["demo", "--model", "openai/gpt-4o"], "needs a key: set ROBOPROMPT_OPENAI_API_KEY"),
        (["eval", "--model", "nearest", "--model", "gpt-5"], "there is no model 'gpt-5'"),
        (["eval", "--sweep", "everything"], "main, formats"),
        (["eval", "--task", "fold_laundry"], "open_drawer"),
        (["eval", "--method", "best"], "'expert replay'"),
        (["eval", "--recordings", "shaky"], "'continuous'"),
        (["eval", "--noise", "-1"], "or equal to 0"),
        (["eval", "--noise", "inf"], "a finite number"),
        (["eval", "--noise", "1", "--sweep", "noise"], "noise of 0.5 of its own"),
        (["eval", "--noise", "1", "--poses", "vision"], "noise is added to given poses"),
        (["eval", "--seed", "-1"], "or equal to 0"),
        (["eval", "--shift", "0.03", "--task", "push_button"], "push_button: nothing in its scenes"),
        (["eval", "--shift", "-1"], "above 0"),
        (["eval", "--shift", "nan"], "above 0"),
        (["eval", "--shift", "0.03", "--poses", "vision"], "given poses"),
        (["eval", "--shift", "0.03", "--method", "expert"], "'expert' does not ask the service"),
        (["serve", "--port", "99999"], "99999 is not a port (valid: 1 to 65535)"),
        (["serve", "--port", "0"], "0 is not a port (valid: 1 to 65535)"),
    ],
)
def test_wrong_choices(words, expected):
    run = CliRunner().invoke(application, words)
    assert run.exit_code == 2, run.output
    assert expected in said(run)


def test_a_demo_is_not_taught_on_top_of_an_earlier_one(tmp_path):
    run = CliRunner().invoke(application, ["demo", "--data", str(tmp_path)])
    assert run.exit_code == 2, run.output
    assert "exists (valid: a new folder)" in said(run)


@pytest.fixture(params=[("text/html", b"<h1>It works!</h1>"), ("application/json", b'{"jobs": []}')])
def stranger(request):
    """Some other server: pages for whoever asks, or a JSON document that is not the service's."""
    with answering(lambda *_: (200, *request.param)) as url:
        yield url


def commands(url, folder):
    return [
        ["export", "--task", "x", "--archive", str(folder / "x.zip"), "--url", url],
        ["eval", "--url", url, "--model", "nearest", "--out", str(folder / "out")],
    ]


def assert_one_line(url, folder, expected):
    for words in commands(url, folder):
        run = CliRunner().invoke(application, words)
        assert run.exit_code == 1, run.output
        assert len(run.output.splitlines()) == 1
        assert expected in run.output
    assert list(folder.iterdir()) == []


def test_an_address_of_another_server_is_named(stranger, tmp_path):
    assert_one_line(stranger, tmp_path, "what answers there is not a RoboPrompt service")


def test_an_unreachable_service_is_named(tmp_path):
    url = f"http://127.0.0.1:{free_port()}"
    assert_one_line(url, tmp_path, f"GET {url}/healthz: ")


@pytest.mark.parametrize("url", ["127.0.0.1:8000", "localhost", "ftp://localhost", "http://", "http://localhost:99999"])
def test_invalid_addresses_are_refused(url, tmp_path):
    assert_one_line(url, tmp_path, f"{url!r} is not the address of a service (valid: one like http://127.0.0.1:8000)")


def run_script(monkeypatch, capsys, *words):
    monkeypatch.setattr("sys.argv", ["roboprompt-robot", *words])
    code = script.main()
    return code, capsys.readouterr().err


def test_the_robots_script_at_wrong_addresses(stranger, monkeypatch, capsys, tmp_path):
    objects = tmp_path / "objects.json"
    objects.write_text('[{"name": "cube", "position": [0.1, 0.1, 0.8]}]')
    scene = ("--task", "x", "--instruction", "x", "--objects", str(objects))
    for url, expected in (
        (stranger, "not a RoboPrompt service"),
        ("localhost:8000", "is not the address of a service"),
    ):
        code, errors = run_script(monkeypatch, capsys, "--url", url, "predict", *scene)
        assert (code, len(errors.splitlines())) == (1, 1)
        assert expected in errors


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "No such file"),
        ("{", "cannot be read"),
        ('{"cube": 1}', "is not a list of objects"),
        ('[{"position": [0, 0, 1]}]', "is not a list of objects"),
        ('[{"name": "cube", "position": [0, 1]}]', "position"),
    ],
)
def test_the_robots_script_says_what_objects_it_wants(content, expected, monkeypatch, capsys, tmp_path):
    file = tmp_path / "objects.json"
    if content is not None:
        file.write_text(content)
    monkeypatch.setattr("roboprompt_client.client.RoboPromptClient.ping", lambda self: None)
    words = ("predict", "--task", "x", "--instruction", "x", "--objects", str(file))
    code, errors = run_script(monkeypatch, capsys, *words)
    assert (code, len(errors.splitlines())) == (1, 1)
    assert "--objects: " in errors
    assert str(file) in errors
    assert expected in errors
    assert '[{"name": "cube", "position": [x, y, z]}]' in errors


def test_serve_refuses_a_data_folder_of_an_unknown_version_in_a_sentence(tmp_path):
    with closing(sqlite3.connect(tmp_path / "roboprompt.db")) as database, database:
        database.execute("CREATE TABLE alembic_version (version_num TEXT)")
        database.execute("INSERT INTO alembic_version VALUES ('9999')")
    run = CliRunner().invoke(application, ["serve", "--data", str(tmp_path)])
    assert run.exit_code == 1
    assert run.output.startswith("database sqlite:///")
    assert f"is at revision 9999, which RoboPrompt {VERSION} (revision 2.0) does not know" in run.output
    assert len(run.output.splitlines()) == 1


def test_version():
    run = CliRunner().invoke(application, ["--version"])
    assert (run.exit_code, run.output) == (0, f"roboprompt {VERSION}\n")


def test_the_list_imports_no_command():
    code = "import sys; from app.cli import application as run; run(['--help'], standalone_mode=False)"
    code += "; print('app.cli.serve' in sys.modules)"
    listed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert listed.endswith("False\n")
    for name in COMMANDS:
        assert name in listed


def test_one_name_for_the_address():
    for command in ("import", "export", "eval"):
        help_text = CliRunner().invoke(application, [command, "--help"]).output
        assert "--url" in help_text


def test_nothing_is_hidden():
    """Every command and every option is in the help."""

    def commands_below(command):
        yield command
        for inner in getattr(command, "commands", {}).values():
            yield from commands_below(inner)

    everything = [found for name in COMMANDS for found in commands_below(load(name))]
    assert len(everything) > len(COMMANDS)
    assert not [item.name for item in everything if item.hidden]
    assert not [item.name for command in everything for item in command.params if getattr(item, "hidden", False)]
