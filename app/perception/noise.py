"""Any estimator made worse on purpose, for the paper's ablation."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.perception.base import ObjectQuery, PoseEstimator
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, disturbed


@dataclass(frozen=True)
class NoisyPoses:
    """Adds Gaussian errors to another estimator's poses; by default those of FoundationPose in the paper.

    The errors depend on seed and poses alone: the same scene is disturbed alike whenever it is asked for.

    Attributes:
        mean_error_m, mean_error_rad: average sizes of the errors.
    """

    inner: PoseEstimator
    mean_error_m: float = MEAN_ERROR_M
    mean_error_rad: float = MEAN_ERROR_RAD
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("mean_error_m", "mean_error_rad"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InvalidInputError(name, f"is {value}", "0 or a positive number")

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        poses = self.inner.estimate(objects, frames)
        places = zlib.crc32(b"".join(pose.position_m.tobytes() for pose in poses))
        random = np.random.default_rng((self.seed, places))
        return disturbed(poses, random, mean_error_m=self.mean_error_m, mean_error_rad=self.mean_error_rad)
