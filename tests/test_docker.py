"""What can be checked of docker/ without Docker: hadolint's rules, and names that must exist."""

import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from app.settings import Settings

DOCKER = Path(__file__).parents[1] / "docker"
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())


def test_dockerfile_follows_hadolints_rules():
    hadolint = Path(sys.executable).with_name("hadolint")
    linted = subprocess.run([hadolint, DOCKER / "Dockerfile"], capture_output=True, text=True, check=False)
    assert (linted.returncode, linted.stdout) == (0, "")


@pytest.mark.parametrize("name", ["Dockerfile", "compose.yaml"])
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
