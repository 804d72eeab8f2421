"""Everyday objects of boxes, cylinders, capsules and spheres; their origins stand on the table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.scene import SceneBody
from roboprompt_client.types.arrays import Array

ROLL_STEP_DEG = 5.0  # of a body that is round about its x axis


@dataclass(frozen=True)
class Thing:
    """An object of the scenes.

    Attributes:
        build: adds its shapes to a body whose origin is on the table.
        radius_m: of the circle around the origin that holds it.
        symmetry_deg: the turn about z that leaves it unchanged: 0 any, None none.
        roll_deg: the same about the axis along x at half its height: lying so, it is the same body at the same place.
        height_m: given with `roll_deg`.
    """

    build: Callable[[SceneBody], object]
    radius_m: float
    symmetry_deg: float | None = None
    roll_deg: float | None = None
    height_m: float = 0.0

    @property
    def rolls(self) -> list[Array]:
        """The transforms (4, 4) about the axis along x that leave it unchanged, the identity first."""
        poses = []
        for angle_deg in [0.0] if self.roll_deg is None else np.arange(0, 360, self.roll_deg or ROLL_STEP_DEG):
            pose, middle_m = np.eye(4), np.array([0, 0, self.height_m / 2])
            pose[:3, :3] = Rotation.from_euler("x", angle_deg, degrees=True).as_matrix()
            pose[:3, 3] = middle_m - pose[:3, :3] @ middle_m
            poses.append(pose)
        return poses


def _mug(part: SceneBody) -> None:
    part.wall("blue", bottom_m=0.0, top_m=0.095, bottom_radius_m=0.038, thickness_m=0.004)
    part.cylinder(0.038, 0.003, "blue", at_m=(0, 0, 0.003))
    for z_m in (0.03, 0.07):
        part.box((0.014, 0.005, 0.005), "blue", at_m=(0.05, 0, z_m))
    part.box((0.005, 0.005, 0.025), "blue", at_m=(0.062, 0, 0.05))


def _bowl(part: SceneBody) -> None:
    part.wall("orange", bottom_m=0.0, top_m=0.055, bottom_radius_m=0.035, top_radius_m=0.07, thickness_m=0.004)
    part.cylinder(0.036, 0.003, "orange", at_m=(0, 0, 0.003))


def _jar(part: SceneBody) -> None:
    part.cylinder(0.038, 0.04, "black", at_m=(0, 0, 0.04)).cylinder(0.041, 0.011, "red", at_m=(0, 0, 0.091))


def _tool(part: SceneBody) -> None:
    side = Rotation.from_euler("y", 90, degrees=True)
    part.capsule(0.015, 0.035, "red", at_m=(-0.04, 0, 0.015), rotation=side)
    part.capsule(0.005, 0.045, "grey", at_m=(0.055, 0, 0.015), rotation=side)


def _car(part: SceneBody) -> None:
    part.box((0.055, 0.022, 0.011), "yellow", at_m=(0, 0, 0.022)).box(
        (0.025, 0.019, 0.011), "blue", at_m=(-0.015, 0, 0.044)
    )
    for x_m in (-0.035, 0.035):
        part.capsule(0.013, 0.02, "black", at_m=(x_m, 0, 0.013), rotation=Rotation.from_euler("x", 90, degrees=True))


def _carton(part: SceneBody) -> None:
    part.box((0.02, 0.032, 0.055), "white", at_m=(0, 0, 0.055))
    part.box((0.0205, 0.02, 0.018), "green", at_m=(0.0, 0.005, 0.075)).box(
        (0.01, 0.0325, 0.02), "red", at_m=(0, 0, 0.05)
    )
    part.box((0.0202, 0.033, 0.006), "purple", at_m=(0.001, 0.001, 0.012))


def _drawer_front(part: SceneBody) -> None:
    part.box((0.1, 0.008, 0.06), "white", at_m=(0, 0.008, 0.06))
    for x_m in (-0.045, 0.045):
        part.box((0.005, 0.015, 0.005), "grey", at_m=(x_m, -0.015, 0.065))
    part.box((0.055, 0.006, 0.006), "grey", at_m=(0, -0.03, 0.065))


def _kettle(part: SceneBody) -> None:
    part.cylinder(0.05, 0.045, "green", at_m=(0, 0, 0.045)).cylinder(0.018, 0.008, "black", at_m=(0, 0, 0.098))
    tilt = Rotation.from_euler("y", 45, degrees=True)
    part.capsule(0.009, 0.03, "green", at_m=(0.065, 0, 0.065), rotation=tilt)
    for z_m in (0.025, 0.075):
        part.box((0.016, 0.006, 0.006), "black", at_m=(-0.062, 0, z_m))
    part.box((0.006, 0.006, 0.031), "black", at_m=(-0.075, 0, 0.05))


def _bracket(part: SceneBody) -> None:
    part.box((0.045, 0.012, 0.012), "purple", at_m=(0.02, 0, 0.012)).box(
        (0.012, 0.035, 0.012), "purple", at_m=(-0.013, 0.035, 0.012)
    )


def _bulb(part: SceneBody) -> None:
    part.cylinder(0.035, 0.006, "black", at_m=(0, 0, 0.006)).cylinder(0.013, 0.02, "grey", at_m=(0, 0, 0.03))
    part.sphere(0.03, "yellow", at_m=(0, 0, 0.075))


def _brick(part: SceneBody) -> None:
    part.box((0.045, 0.02, 0.025), "wood", at_m=(0, 0, 0.025)).box((0.012, 0.0205, 0.0255), "cyan", at_m=(0, 0, 0.025))


def _bottle(part: SceneBody) -> None:
    part.cylinder(0.033, 0.06, "green", at_m=(0, 0, 0.06)).cylinder(0.014, 0.025, "green", at_m=(0, 0, 0.14))
    part.cylinder(0.016, 0.01, "white", at_m=(0, 0, 0.17)).cylinder(0.0336, 0.02, "pink", at_m=(0, 0, 0.06))


THINGS: Mapping[str, Thing] = {
    "mug": Thing(_mug, 0.07),
    "bowl": Thing(_bowl, 0.073, 0.0),
    "jar": Thing(_jar, 0.043, 0.0),
    "tool": Thing(_tool, 0.105, roll_deg=0.0, height_m=0.03),
    "car": Thing(_car, 0.062),
    "carton": Thing(_carton, 0.04),
    "drawer": Thing(_drawer_front, 0.108),
    "kettle": Thing(_kettle, 0.095),
    "bracket": Thing(_bracket, 0.075),
    "bulb": Thing(_bulb, 0.037, 0.0),
    "brick": Thing(_brick, 0.05, 180.0, roll_deg=180.0, height_m=0.05),
    "bottle": Thing(_bottle, 0.036, 0.0),
}


def _arm(part: SceneBody) -> None:
    """A forearm along x with its hand at the origin, its middle line at z = 0."""
    along = Rotation.from_euler("y", 90, degrees=True)
    part.capsule(0.04, 0.2, "grey", at_m=(0.3, 0, 0), rotation=along)
    part.box((0.05, 0.04, 0.015), "pink", at_m=(0.03, 0, 0))
    for y_m in (-0.03, -0.01, 0.01, 0.03):
        part.capsule(0.008, 0.03, "pink", at_m=(-0.05, y_m, 0), rotation=along)


def _gripper(part: SceneBody) -> None:
    """A hand above the origin, its fingers open by 9 cm."""
    part.box((0.1, 0.03, 0.04), "white", at_m=(0, 0, 0.1)).cylinder(0.05, 0.06, "white", at_m=(0, 0, 0.2))
    for x_m in (-0.055, 0.055):
        part.box((0.01, 0.01, 0.035), "grey", at_m=(x_m, 0, 0.03))


def _shelf(part: SceneBody) -> None:
    part.box((0.2, 0.25, 0.05), "white", at_m=(0, 0, 0.05))


PROPS: Mapping[str, Thing] = {"arm": Thing(_arm, 0.5), "gripper": Thing(_gripper, 0.1), "shelf": Thing(_shelf, 0.3)}
