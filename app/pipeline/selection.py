"""Which of many scenes to show: by where their objects stand."""

import numpy as np

from app.pipeline.arrays import Array


def nearest_last(scenes_m: Array, observed_m: Array, number: int) -> list[int]:
    """The indices of the `number` scenes nearest to the observed one, the nearest last.

    Args:
        scenes_m: (N, K, 3) positions of each scene's K objects in metres, world frame.
        observed_m: (K, 3) the same of the observed scene.
    """
    distances_m = np.linalg.norm(scenes_m - observed_m, axis=2).sum(axis=1)
    nearest = np.argsort(distances_m, kind="stable")[:number]
    return [int(index) for index in nearest[::-1]]


def most_diverse(scenes_m: Array, number: int) -> list[int]:
    """The indices of `number` scenes that lie far apart, in ascending order.

    Farthest-point sampling (Gonzalez 1985, "Clustering to minimize the maximum intercluster distance"): begins with
    the first scene, then takes again and again the one that is farthest from all that were taken.

    Args:
        scenes_m: as for `nearest_last`.
    """
    number = min(number, len(scenes_m))
    chosen: list[int] = []
    gaps_m = np.full(len(scenes_m), np.inf)
    for _ in range(number):
        farthest = int(np.argmax(gaps_m))
        chosen.append(farthest)
        to_it_m = np.linalg.norm(scenes_m - scenes_m[farthest], axis=2).sum(axis=1)
        gaps_m = np.minimum(gaps_m, to_it_m)
        gaps_m[chosen] = -1.0  # of several scenes that are the same each is taken once
    return sorted(chosen)
