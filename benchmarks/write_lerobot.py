"""Writes trajectories with the package `lerobot`, which lives in an environment of its own; prints the seconds it took.

python benchmarks/write_lerobot.py EPISODES.npz FOLDER
"""

import sys
import time

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset


def main() -> None:
    """Read, write, measure."""
    arrays = dict(np.load(sys.argv[1]))
    features = {
        name: {"dtype": str(array.dtype), "shape": array.shape[2:], "names": None} for name, array in arrays.items()
    }
    episodes, frames = next(iter(arrays.values())).shape[:2]
    begin = time.perf_counter()
    dataset = LeRobotDataset.create("local/bench", fps=20, features=features, root=sys.argv[2], use_videos=False)
    for episode in range(episodes):
        for frame in range(frames):
            values = {name: array[episode, frame] for name, array in arrays.items()}
            dataset.add_frame({**values, "task": "pick up the cube"})
        dataset.save_episode()
    dataset.finalize()
    print(time.perf_counter() - begin)  # noqa: T201


if __name__ == "__main__":
    main()
