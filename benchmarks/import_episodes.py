"""Episodes a second of `roboprompt import`, against plain files with fsync and LeRobot's own writer, in one run.

    python benchmarks/import_episodes.py --episodes 1000 --lerobot-python /path/to/venv/bin/python

Each episode has 200 frames and one 640x480 RGB-D frame (JPEG and 16-bit PNG), no two images alike. The rounds take
turns, so that whatever else the machine does meets all alike. Episodes are made before the clock runs.
"""

import argparse
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from app.cli.import_data import import_dataset, prepare_tasks
from app.datasets.archive import open_archive, write_archive
from app.datasets.options import ImportOptions
from app.datasets.parcel import ObjectEntry, Parcel, canonical_json
from app.evaluation.server import running_server
from roboprompt_client.camera import Camera
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.trajectory import Trajectory
from roboprompt_client.trajectory_npz import trajectory_from_npz

FRAMES, WIDTH_PX, HEIGHT_PX = 200, 640, 480
DWELL_FRAMES = 40
NOISE = 4.0  # of 255, and of mm: a camera's, which decides how well images compress
LEROBOT_WRITER = Path(__file__).with_name("write_lerobot.py")


def parcel(number: int) -> Parcel:
    """An episode of a random motion that rests five times."""
    random = np.random.default_rng(number)
    moving = (np.arange(FRAMES) % DWELL_FRAMES >= DWELL_FRAMES // 4)[:, None]
    velocities = moving * (1 + 0.1 * random.normal(size=(FRAMES, 7)))
    place_m = np.array([0.2, 0.0, 0.9]) + random.uniform(-0.1, 0.1, 3)
    positions_m = place_m + np.cumsum(moving * random.normal(0, 1e-3, (FRAMES, 3)), axis=0)
    joints = np.cumsum(velocities / 20, axis=0)
    downward = np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, 1))
    trajectory = Trajectory(
        velocities, positions_m, downward, np.arange(FRAMES) < FRAMES // 2, joint_positions_rad=joints
    )
    camera = Camera("front", 600, 600, 319.5, 239.5, np.eye(4), image_size_px=(WIDTH_PX, HEIGHT_PX))
    objects = (ObjectEntry("cube", tuple(place_m.tolist())),)
    return Parcel.of(
        task="bench",
        instruction="pick up the cube",
        trajectory=trajectory,
        control_frequency_hz=20.0,
        objects=objects,
        cameras=(camera,),
        images=_images(random),
    )


def _images(random: np.random.Generator) -> dict[str, bytes]:
    rows, columns = np.indices((HEIGHT_PX, WIDTH_PX))
    scene = 128 + 80 * np.sin(columns / 40 + random.uniform(0, 6)) * np.cos(rows / 60)
    rgb = scene[..., None] + random.normal(0, NOISE, (HEIGHT_PX, WIDTH_PX, 3))
    depth = 1000 + 2 * scene + random.normal(0, NOISE, scene.shape)
    jpeg = cv2.imencode(".jpg", np.clip(rgb, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
    return {
        "rgb_front": jpeg.tobytes(),
        "depth_front": cv2.imencode(".png", depth.astype(np.uint16))[1].tobytes(),
    }


def into_files(folder: Path, parcels: Sequence[Parcel]) -> None:
    """What a careful script does: every file of an episode, and its folder, on the disk before the next."""
    for number, item in enumerate(parcels):
        episode = folder / f"{number:06d}"
        episode.mkdir(parents=True)
        for name, data in {"metadata.json": canonical_json(item.metadata), **item.files}.items():
            with (episode / name).open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        for directory in (episode, folder):
            descriptor = os.open(directory, os.O_RDONLY)
            os.fsync(descriptor)
            os.close(descriptor)


def into_service(archive: Path, client: RoboPromptClient, expected: int) -> None:
    """As `roboprompt import` does it, with keyframes, poses and checks of everything."""
    dataset = open_archive(archive, ImportOptions())
    prepare_tasks(dataset, client)
    statuses = [result.status for result in import_dataset(dataset, client)]
    assert statuses == ["imported"] * expected, statuses


def with_lerobot(python: str, folder: Path, parcels: Sequence[Parcel]) -> float:
    """Seconds in LeRobot's own writer, in its own process; trajectories only, it takes no image of one frame alone."""
    stacked = [trajectory_from_npz(item.files["trajectory"]) for item in parcels]
    arrays = {
        "observation.joint_velocities": np.stack([t.joint_velocities_rad_s for t in stacked]),
        "observation.joint_positions": np.stack([t.joint_positions_rad for t in stacked]),
        "observation.end_effector_position": np.stack([t.positions_m for t in stacked]),
        "observation.end_effector_quaternion_xyzw": np.stack([t.quaternions_xyzw for t in stacked]),
        "observation.gripper_open": np.stack([t.gripper_open[:, None].astype(np.float32) for t in stacked]),
    }
    folder.mkdir(parents=True)
    np.savez(folder / "episodes.npz", **arrays)
    command = [python, str(LEROBOT_WRITER), str(folder / "episodes.npz"), str(folder / "set")]
    offline = {**os.environ, "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(command, env=offline, check=True, capture_output=True, text=True)
    return float(done.stdout.splitlines()[-1])


def seconds(action: Callable[[], None]) -> float:
    """How long it takes."""
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--lerobot-python", help="interpreter that has the package lerobot; left out without it")
    arguments = parser.parse_args()
    size = arguments.episodes // arguments.rounds
    rates: dict[str, list[float]] = {}
    bytes_each: list[int] = []
    with (
        tempfile.TemporaryDirectory() as temporary,
        running_server(Path(temporary) / "data", {"ROBOPROMPT_WARM_UP": "false"}) as url,
        RoboPromptClient(url) as client,
    ):
        for number in range(arguments.rounds):
            folder = Path(temporary) / f"round{number}"
            parcels = [parcel(number * size + k) for k in range(size)]
            bytes_each += [sum(map(len, item.files.values())) for item in parcels]
            archive = folder / "episodes.zip"
            write_archive(archive, "bench", {}, parcels)
            taken_s = {
                "roboprompt import": seconds(lambda: into_service(archive, client, size)),  # noqa: B023
                "plain files + fsync": seconds(lambda: into_files(folder / "files", parcels)),  # noqa: B023
            }
            if arguments.lerobot_python:
                taken_s["LeRobot's writer, no images"] = with_lerobot(
                    arguments.lerobot_python, folder / "lerobot", parcels
                )
            for name, duration_s in taken_s.items():
                rates.setdefault(name, []).append(size / duration_s)
        stored = client.get("/tasks/bench")["num_episodes"]
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"{stored} episodes of {FRAMES} frames, {np.mean(bytes_each) / 1000:.0f} kB each; ", end="")  # noqa: T201
    print(f"{os.cpu_count()} cores, load at the end {load}\n")  # noqa: T201
    print("| method | episodes/s, median of rounds | slowest | fastest |\n| --- | --- | --- | --- |")  # noqa: T201
    for name, values in rates.items():
        print(f"| {name} | {np.median(values):.1f} | {min(values):.1f} | {max(values):.1f} |")  # noqa: T201


if __name__ == "__main__":
    main()
