import re
import sys
from pathlib import Path

import pytest

from benchmarks.metaworld.plan import Plan
from benchmarks.metaworld.run import facts, parser, plan_of
from benchmarks.metaworld.server import own_service
from benchmarks.metaworld.service import ServiceError

FOLDER = Path(__file__).parents[3] / "benchmarks" / "metaworld"


def parsed(*arguments):
    return parser().parse_args(["--url", "http://127.0.0.1:1", *arguments])


def test_by_default_a_newcomers_settings_and_every_task():
    arguments = parsed()
    assert plan_of(arguments) == Plan()
    assert plan_of(arguments).settings is None
    assert len(arguments.tasks) == 25


def test_every_option_reaches_the_plan():
    options = "--demos 3 --tests 2 --llm-tests 1 --models a b/c --seed 7 --demo-seed 50 --noise 0.01 --noise-on both"
    arguments = parsed(*options.split(), "--record-hz", "10", "--settings", '{"keyframes": {"rule": "merged"}}')
    assert plan_of(arguments) == Plan(
        demos=3,
        tests=2,
        llm_tests=1,
        models=("a", "b/c"),
        first_demo_seed=50,
        first_test_seed=7,
        noise_m=0.01,
        noise_on="both",
        record_hz=10,
        settings={"keyframes": {"rule": "merged"}},
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--settings", "{"), "not JSON"),
        (("--settings", "[]"), "not an object"),
        (("--record-hz", "30"), "invalid choice: 30"),
        (("--tasks", "juggle"), "invalid choice: 'juggle'"),
        (("--tests", "-1"), "-1 is negative"),
        (("--serve-with", "python"), "not allowed with"),
    ],
)
def test_a_wrong_command_line_is_named(capsys, arguments, said):
    with pytest.raises(SystemExit):
        parsed(*arguments)
    assert said in capsys.readouterr().err


def test_facts_say_how_the_results_came_about():
    said = facts(Plan(noise_m=0.01, settings={"workspace": "auto"}), {"metaworld": "1.0"})
    assert said["recorded at"] == "27 Hz; noise on observed positions: 1 cm on tests"
    assert said["set at the service"] == '`{"workspace": "auto"}`'
    assert "metaworld 1.0" in said["versions"]
    assert facts(Plan(), {})["set at the service"] == "nothing"


def test_a_service_that_does_not_start_is_an_error(tmp_path):
    broken = tmp_path / "python"
    broken.write_text("#!/bin/sh\necho no server here\nexit 1\n")
    broken.chmod(0o755)
    with pytest.raises(ServiceError, match="no server here"), own_service(broken):
        pass


def test_a_service_of_its_own_answers_and_ends(monkeypatch):
    import httpx

    monkeypatch.setenv("ROBOPROMPT_WARM_UP", "false")
    with own_service(Path(sys.executable)) as url:
        assert httpx.get(f"{url}/healthz").is_success
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{url}/healthz")


def test_the_environment_of_the_benchmark_has_neither_server_nor_any_index():
    sources = [path.read_text() for path in FOLDER.glob("*.py")]
    assert len(sources) >= 9
    assert not any(re.search(r"^\s*(from|import) app\b", source, re.MULTILINE) for source in sources)
    lines = (FOLDER / "requirements.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith(" ")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+ \\", line) for line in pins)
    assert all(re.fullmatch(r"    --hash=sha256:[0-9a-f]{64}( \\)?", line) for line in lines if line not in pins)
    assert {"metaworld", "mujoco", "httpx", "packaging", "numpy"} <= {line.partition("==")[0] for line in pins}


def test_only_one_module_imports_meta_world():
    importers = [
        path.name for path in FOLDER.glob("*.py") if re.search(r"^\s*from metaworld\b", path.read_text(), re.M)
    ]
    assert importers == ["simulator.py"]
    assert "metaworld" not in sys.modules
