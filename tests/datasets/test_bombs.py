"""Small files that unpack to gigabytes: 1 MB of zip took 2.1 GB.

The real command, whose memory and time the system counts.
"""

import hashlib
import json
import zipfile

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from app.datasets.lerobot_writer import write_lerobot
from tests.datasets.parcels import parcels
from tests.forked import run

MAX_FILE_BYTES = 3_000_000
MAX_UNPACKED_MB = 100
MAX_MEMORY_MB = 850  # 150 of the importer itself, and what it may take at most for 100 MB unpacked
MAX_SECONDS = 60
ZEROS = bytes(1_000_000)


def imported(path):
    """What `roboprompt import --dry-run` says, its status, and the most memory that one of its processes had."""
    options = ["--dry-run", "--instruction", "x", "--max-unpacked-mb", str(MAX_UNPACKED_MB)]
    done = run("tests.datasets.counted", path, *options, timeout_s=MAX_SECONDS)
    *said, counted = done.stdout.splitlines()
    return {"said": "\n".join([*said, done.stderr]), **json.loads(counted)}


def zip_of_one_picture(folder):
    return archive(folder / "task.zip", {"rgb_front": 110})


def zip_of_many_pictures(folder):
    return archive(folder / "task.zip", {f"rgb_{number}": 11 for number in range(10)})


def archive(path, megabytes):
    """A task of one episode whose pictures have so many megabytes."""
    files = {"task.json": b"{}", "episodes/000000/metadata.json": b"{}", "episodes/000000/trajectory.npz": b"x"}
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in files.items():
            file.writestr(name, data)
        for name, size in megabytes.items():
            digests[f"episodes/000000/{name}"] = "0" * 64
            with file.open(f"episodes/000000/{name}", "w") as member:
                for _ in range(size):
                    member.write(ZEROS)
        manifest = {"format": "roboprompt-task", "version": 1, "task": "t", "files": digests}
        file.writestr("manifest.json", json.dumps(manifest))
    return path


def lerobot(folder):
    write_lerobot(folder / "set", parcels())
    (rows,) = (folder / "set/data").rglob("*.parquet")
    return folder / "set", rows


def parquet_of_equal_rows(folder):
    """Twenty million times one number."""
    root, path = lerobot(folder)
    feature = "observation.gripper_open"
    rows = pa.table({feature: np.full(10_000_000, 0.5, np.float32)})
    with parquet.ParquetWriter(path, rows.schema) as writer:
        for _ in range(2):
            writer.write_table(rows)
    info = json.loads((root / "meta/info.json").read_text())
    info["features"] = {feature: info["features"][feature]}
    (root / "meta/info.json").write_text(json.dumps(info))
    return root


def parquet_of_long_instructions(folder):
    """A dictionary of one text of 1 MB, which 3,000 episodes name."""
    root, _ = lerobot(folder)
    (path,) = (root / "meta/episodes").rglob("*.parquet")
    row = parquet.read_table(path).slice(0, 1).to_pylist()[0]
    tasks = pa.ListArray.from_arrays(
        pa.array(range(3001), pa.int32()),
        pa.DictionaryArray.from_arrays(np.zeros(3000, np.int32), pa.array(["x" * 1_000_000])),
    )
    others = {name: pa.array([value] * 3000) for name, value in row.items() if name != "tasks"}
    table = pa.table({**others, "tasks": tasks})
    parquet.write_table(table, path, compression="zstd", store_schema=False)
    return root


def hdf5_of_nothing(folder):
    """A billion numbers of which none is written."""
    with h5py.File(folder / "data.hdf5", "w") as file:
        demo = file.create_group("data/demo_0")
        demo.create_dataset("actions", shape=(1 << 30, 7), dtype="f8", chunks=(1024, 7))
        demo.create_group("obs")
    return folder / "data.hdf5"


def by_make_attack(bomb):
    return pytest.param(bomb, marks=pytest.mark.long)


BOMBS = (
    by_make_attack(zip_of_one_picture),
    zip_of_many_pictures,
    parquet_of_equal_rows,
    by_make_attack(parquet_of_long_instructions),
    hdf5_of_nothing,
)


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_is_named_and_does_not_go_off(tmp_path, bomb):
    path = bomb(tmp_path)
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < MAX_FILE_BYTES
    done = imported(path)
    assert done["status"] == 1
    assert "Traceback" not in done["said"]
    reasons = ("unpacks to more than", "needs more memory")
    assert any(reason in done["said"] for reason in reasons), done["said"]
    assert done["memory_mb"] < MAX_MEMORY_MB, done
