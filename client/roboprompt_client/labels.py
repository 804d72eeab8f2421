"""Labels: where an object is in pictures, and what the service learns from them (`POST /tasks/{name}/labels`)."""

from collections.abc import Mapping, Sequence
from typing import Any

from roboprompt_client.camera import RgbdFrame
from roboprompt_client.client import RoboPromptClient

Pixel = tuple[float, float]  # column, row


def label_object(
    client: RoboPromptClient,
    task: str,
    name: str,
    clicks: Mapping[str, Pixel],
    *,
    frames: Sequence[RgbdFrame] = (),
    episode_id: str | None = None,
    yaw_deg: float | None = None,
) -> dict[str, Any]:
    """Say where an object is; its mask grows from one click, in the other cameras too. Returns the label.

    Args:
        clicks: a pixel of the object by camera; one camera is enough.
        frames: pictures of color and depth; or:
        episode_id: the episode whose first pictures are meant.
        yaw_deg: where the object's x axis points; None: the service matches the views by themselves.

    Raises:
        ServiceProblemError: if no mask follows from the click.
        ServiceUnreachableError.
    """
    clicked = {camera: list(pixel) for camera, pixel in clicks.items()}
    document = {"object": name, "episode_id": episode_id, "clicks": clicked, "yaw_deg": yaw_deg}
    return client.post(f"/tasks/{task}/labels", document, frames)


def learn_from_labels(
    client: RoboPromptClient, task: str, name: str, symmetric: str | float = "none", *, yaw_may_be_unknown: bool = False
) -> dict[str, Any]:
    """Let the service learn an object from its labels, and find it by that from now on; returns its model.

    Args:
        symmetric: "none", "yaw" for what looks the same all around, or degrees.

    Raises:
        ServiceProblemError: if the labels give no model that can be relied on.
        ServiceUnreachableError.
    """
    document = {"object": name, "symmetric": symmetric, "yaw_may_be_unknown": yaw_may_be_unknown}
    return client.post(f"/tasks/{task}/labels/learn", document)
