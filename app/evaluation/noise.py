"""Errors of a pose estimator for given poses, in multiples of those of the paper's (section V "Robustness ...")."""

from collections.abc import Iterable

import numpy as np

from app.pipeline import noise
from app.pipeline.episode import ObjectPose

STREAM = 7  # keeps the draw of an error apart from that of the same seed's scene


def disturbed(poses: Iterable[ObjectPose], scale: float, seed: int) -> tuple[ObjectPose, ...]:
    """The poses with Gaussian errors whose average sizes are `scale` times 1.68 cm and 4.61 degrees.

    A seed's errors point the same way at every scale, so that scales compare on equal terms.
    """
    if scale == 0:
        return tuple(poses)
    sizes = {"mean_error_m": scale * noise.MEAN_ERROR_M, "mean_error_rad": scale * noise.MEAN_ERROR_RAD}
    return noise.disturbed(poses, np.random.default_rng((STREAM, seed)), **sizes)
