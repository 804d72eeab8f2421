"""The long versions of what tests/reliability asserts, and what needs root: power cuts and full disks.

Power cut: the data folder lies on an ext4 file system in an image file on a loop device. What the service has not
synced is in the kernel's cache only, not in the image; a copy of the image is what a disk holds after a power cut. The
service is stopped while the copy is taken; everything acknowledged before must be in it after ext4's own recovery.
"""

import argparse
import contextlib
import copy
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from tests.reliability.service import QUESTION, Load, check, kill_repeatedly, serving, upload_files

IMAGE_MB = 256
CUTS_OF_A_DISK = 10  # after each, everything that is stored is looked at
KILLS_OF_A_FOLDER = 20


def say(**figures):
    sys.stdout.write(json.dumps(figures) + "\n")
    sys.stdout.flush()


@contextlib.contextmanager
def mounted(source, folder, *options):
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", *options, str(source), str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def cut_power_repeatedly(folder, num_cuts, seed=0):
    """Returns the figures; an assertion fails where something acknowledged is lost."""
    image, rng, load = folder / "disk.img", random.Random(seed), Load()
    with image.open("wb") as file:
        file.truncate(IMAGE_MB * 1_000_000)
    # The file system commits by itself only once a minute: what is not synced stays out of the image.
    subprocess.run(["mkfs.ext4", "-q", str(image)], check=True)
    unsynced = 0
    with mounted(image, folder / "disk", "-o", "loop,commit=60"), serving(folder / "disk" / "data") as service:
        load.url = service.url
        with load.running():
            for cut in range(num_cuts):
                time.sleep(rng.uniform(0.2, 1.0))
                acknowledged = copy.copy(load)
                acknowledged.episodes, acknowledged.predictions = dict(load.episodes), set(load.predictions)
                (folder / "disk" / "never-synced").write_text(str(cut))
                os.killpg(service.process.pid, signal.SIGSTOP)
                shutil.copyfile(image, folder / "copy.img")
                os.killpg(service.process.pid, signal.SIGCONT)
                with mounted(folder / "copy.img", folder / "copy", "-o", "loop"):
                    check(folder / "copy" / "data", acknowledged)
                    canary = folder / "copy" / "never-synced"
                    unsynced += not canary.exists() or canary.read_text() != str(cut)
                say(power_cuts=cut + 1, acknowledged=len(acknowledged.episodes), canaries_lost=unsynced)
        service.stop()
    return {
        "power_cuts": num_cuts,
        "episodes_acknowledged": len(load.episodes),
        "predictions_acknowledged": len(load.predictions),
        "lost": 0,
        "unsynced_canaries_lost": unsynced,
    }


def fill_the_disk(folder):
    """A tmpfs of 3 MB: uploads until it is full, then space again."""
    disk = folder / "small"
    with mounted("none", disk, "-t", "tmpfs", "-o", "size=3m"), serving(disk / "data") as service:
        stored, refused = 0, None
        while refused is None:
            answer = httpx.post(f"{service.url}/episodes", files=upload_files(stored), timeout=60)
            stored, refused = (stored + 1, None) if answer.status_code == 201 else (stored, answer)
        full = _problem(refused)
        predicted = _predict(service)
        full_predict = _problem(predicted) if predicted.status_code != 200 else "still fitted"
        assert len(_all_ids(service)) == stored
        subprocess.run(["mount", "-o", "remount,size=30m", str(disk)], check=True)
        assert httpx.post(f"{service.url}/episodes", files=upload_files(stored), timeout=60).status_code == 201
        assert _predict(service).status_code == 200
    return {"stored_until_full": stored, "full": full, "full_predict": full_predict}


def turn_read_only(folder):
    """An ext4 file system that meets an error turns read-only under the running service; also a start on such a one."""
    image, disk = folder / "small.img", folder / "failing"
    with image.open("wb") as file:
        file.truncate(30_000_000)
    subprocess.run(["mkfs.ext4", "-q", str(image)], check=True)
    with mounted(image, disk, "-o", "loop,errors=remount-ro"), serving(disk / "data") as service:
        assert httpx.post(f"{service.url}/episodes", files=upload_files(0), timeout=60).status_code == 201
        device = subprocess.check_output(["findmnt", "-no", "SOURCE", str(disk)], text=True).strip()
        (Path("/sys/fs/ext4") / Path(device).name / "trigger_fs_error").write_text("torture")
        upload = _problem(httpx.post(f"{service.url}/episodes", files=upload_files(1), timeout=60))
        predicted = _problem(_predict(service))
        assert len(_all_ids(service)) == 1
        assert httpx.get(f"{service.url}/healthz").is_success
        service.stop()
        with serving_read_only(disk / "data") as said:
            pass
    return {"read_only_upload": upload, "read_only_predict": predicted, "read_only_start": said}


@contextlib.contextmanager
def serving_read_only(data):
    """What the service says that is started on a read-only folder."""
    try:
        with serving(data):
            yield "it started"
    except AssertionError as error:
        yield next(line for line in str(error).splitlines() if "StoreUnavailableError" in line)


def _predict(service):
    return httpx.post(f"{service.url}/predict", json=QUESTION, timeout=60)


def _problem(answer):
    assert answer.status_code == 503, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    return answer.json()["detail"]


def _all_ids(service):
    return [item["id"] for item in httpx.get(f"{service.url}/episodes", params={"limit": 200}).json()["episodes"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--power-cuts", type=int, default=50)
    parser.add_argument("--folder", type=Path, help="to work in; default: a temporary one")
    asked = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="roboprompt-torture-", dir=asked.folder))
    try:
        if os.geteuid() == 0:
            say(**fill_the_disk(folder))
            say(**turn_read_only(folder))
            for seed in range(0, asked.power_cuts, CUTS_OF_A_DISK):
                (disk := folder / f"powered{seed}").mkdir()
                say(**cut_power_repeatedly(disk, min(CUTS_OF_A_DISK, asked.power_cuts - seed), seed))
        else:
            say(left_out="power cuts, full and read-only disks need root: they mount")
        for seed in range(0, asked.kills, KILLS_OF_A_FOLDER):
            number = min(KILLS_OF_A_FOLDER, asked.kills - seed)
            say(**kill_repeatedly(folder / f"killed{seed}", number, seed, report=say))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
