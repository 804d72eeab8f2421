"""What can be checked of docker/ without Docker: hadolint's rules, Kubernetes' schemas, and names that must exist."""

import json
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import kubernetes_validate
import pytest
import yaml

from app.services.measures import Metrics
from app.settings import Settings

DOCKER = Path(__file__).parents[1] / "docker"
MANIFESTS = list(yaml.safe_load_all((DOCKER / "kubernetes/roboprompt.yaml").read_text()))
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())


def test_dockerfile_follows_hadolints_rules():
    hadolint = Path(sys.executable).with_name("hadolint")
    linted = subprocess.run([hadolint, DOCKER / "Dockerfile"], capture_output=True, text=True, check=False)
    assert (linted.returncode, linted.stdout) == (0, "")


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda manifest: manifest["kind"])
def test_manifests_fit_kubernetes_schemas(manifest):
    kubernetes_validate.validate(manifest, "1.34", strict=True)


@pytest.mark.parametrize("name", ["Dockerfile", "compose.yaml", "kubernetes/roboprompt.yaml"])
def test_settings_that_are_named_exist(name):
    named = set(re.findall(r"\bROBOPROMPT_(\w+)", (DOCKER / name).read_text()))
    assert named
    assert named <= {setting.upper() for setting in Settings.model_fields}


def test_services_that_others_wait_for_exist():
    services = COMPOSE["services"]
    assert {other for item in services.values() for other in item.get("depends_on", ())} <= set(services)
    mounted = {volume.partition(":")[0] for item in services.values() for volume in item.get("volumes", ())}
    assert mounted == set(COMPOSE["volumes"])
    assert services["roboprompt"]["read_only"]


def test_passwords_are_made_once_for_this_user_alone(tmp_path):
    script = shutil.copy(DOCKER / "passwords", tmp_path)
    (tmp_path / ".env").write_text("S3_PASSWORD=chosen\n")
    subprocess.run([script], check=True)
    made = (tmp_path / ".env").read_text()
    assert re.fullmatch(r"S3_PASSWORD=chosen\nPOSTGRES_PASSWORD=[0-9a-f]{48}\n", made)
    subprocess.run([script], check=True)
    assert (tmp_path / ".env").read_text() == made


def test_every_password_that_compose_asks_for_is_made(tmp_path):
    subprocess.run([shutil.copy(DOCKER / "passwords", tmp_path)], check=True)
    asked = set(re.findall(r"\$\{(\w+):\?", (DOCKER / "compose.yaml").read_text()))
    assert asked == set(re.findall(r"^(\w+)=", (tmp_path / ".env").read_text(), re.MULTILINE))
    assert stat.S_IMODE((tmp_path / ".env").stat().st_mode) == 0o600


def test_dashboard_asks_for_metrics_that_exist():
    metrics = Metrics()
    metrics.observe_request("GET", "/", 200, 0.1)
    metrics.observe_prediction("m", "absolute", "ok", {"llm": 1.0}, {"prompt_tokens": 1})
    metrics.observe_outcome("m", success=True)
    exposed = set(re.findall(r"^(roboprompt_\w+)", metrics.text().decode(), re.MULTILINE))
    dashboard = json.loads((DOCKER / "grafana/roboprompt.json").read_text())
    asked = {
        name for p in dashboard["panels"] for t in p["targets"] for name in re.findall(r"roboprompt_\w+", t["expr"])
    }
    assert asked
    assert asked <= exposed
