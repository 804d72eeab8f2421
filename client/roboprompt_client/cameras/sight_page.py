"""What the cameras see as one HTML file: the pictures with the objects drawn in, and the tables of `sight`."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
import numpy.typing as npt

from roboprompt_client.camera import RgbdFrame
from roboprompt_client.cameras.sight import (
    CAMERA_COLUMNS,
    OBJECT_COLUMNS,
    Sight,
    camera_rows,
    object_rows,
)
from roboprompt_client.extras import import_extra
from roboprompt_client.quaternions import to_matrix
from roboprompt_client.trajectory import ObjectPose

AXIS_M = 0.05
AXIS_COLORS = ("#e5342b", "#2b9e3f", "#2f6fe4")
STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1000px;padding:0 1em}"
    "svg{width:100%;max-width:640px;display:block}table{border-collapse:collapse;margin:1em 0}"
    "td,th{text-align:left;padding:.2em .8em;border-bottom:1px solid #ccc}.doubt{color:#a40000;font-weight:600}"
    "text{font:600 14px system-ui,sans-serif;paint-order:stroke;stroke:#000;stroke-width:3px;fill:#fff}"
    "figure{display:inline-block;margin:0 1em 1em 0;width:min(100%,480px)}"
)
# A click says the pixel under the mouse, as `roboprompt-robot label` takes it.
SCRIPT = (
    "for(const picture of document.querySelectorAll('svg'))picture.onclick=event=>{"
    "const at=new DOMPoint(event.clientX,event.clientY).matrixTransform(picture.getScreenCTM().inverse());"
    "document.getElementById('clicked').textContent="
    "`--click ${picture.dataset.camera} ${Math.floor(at.x)} ${Math.floor(at.y)}`}"
)


def sight_page(sight: Sight) -> str:
    """The page.

    Raises:
        InvalidInputError: if OpenCV, which encodes the pictures, is not installed.
    """
    poses = [found.pose for found in sight.objects if found.pose is not None]
    doubts = "".join(f'<p class="doubt">{escape(doubt)}</p>' for doubt in sight.doubts())
    figures = "".join(_figure(frame, poses) for frame in sight.frames)
    tables = _table(OBJECT_COLUMNS, object_rows(sight)) + _table(CAMERA_COLUMNS, camera_rows(sight))
    head = f'<meta charset="utf-8"><title>What the cameras see</title><style>{STYLE}</style>'
    title = '<h1>What the cameras see</h1><p id="clicked">Click into a picture for the option of `label`.</p>'
    return f'<!doctype html><html lang="en">{head}{title}{doubts}{figures}{tables}<script>{SCRIPT}</script></html>\n'


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(_cells(row, len(columns)))}</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _cells(row: Sequence[str], columns: int) -> Iterable[str]:
    *cells, last = map(escape, row)
    yield from (f"<td>{cell}</td>" for cell in cells)
    yield f'<td colspan="{columns - len(cells)}">{last}</td>'


def _figure(frame: RgbdFrame, poses: Iterable[ObjectPose]) -> str:
    if frame.rgb is None:
        return ""
    height_px, width_px = frame.rgb.shape[:2]
    picture = f'<image href="{_png(frame.rgb)}" width="{width_px}" height="{height_px}"/>'
    marks = "".join(_mark(frame, pose) for pose in poses)
    name = escape(frame.camera.name)
    caption = f"<figcaption>{name}</figcaption>"
    box = f'data-camera="{name}" viewBox="0 0 {width_px} {height_px}"'
    return f"<figure><svg {box}>{picture}{marks}</svg>{caption}</figure>"


def _mark(frame: RgbdFrame, pose: ObjectPose) -> str:
    """The object's name at its place, and its axes where its rotation is known; empty behind the camera."""
    rotation = np.eye(3) if pose.quaternion_xyzw is None else to_matrix(pose.quaternion_xyzw)
    ends_m = np.vstack([pose.position_m, pose.position_m + AXIS_M * rotation.T])
    pixels, depth_m = frame.camera.project(ends_m)
    if (depth_m <= 0).any():
        return ""
    (x, y), *tips = (pixels + 0.5).round(1).tolist()  # the page counts from pixels' corners, a camera from their middle
    axes = (
        ""
        if pose.quaternion_xyzw is None
        else "".join(
            f'<line x1="{x}" y1="{y}" x2="{u}" y2="{v}" stroke="{color}" stroke-width="3"/>'
            for (u, v), color in zip(tips, AXIS_COLORS, strict=True)
        )
    )
    dot = f'<circle cx="{x}" cy="{y}" r="5" fill="none" stroke="#fff" stroke-width="2"/>'
    return f'{axes}{dot}<text x="{x + 9}" y="{y - 9}">{escape(pose.name)}</text>'


def _png(rgb: npt.NDArray[np.uint8]) -> str:
    cv2 = import_extra("cv2", "opencv-python-headless", "images")
    data = cv2.imencode(".png", rgb[..., ::-1])[1].tobytes()
    return f"data:image/png;base64,{b64encode(data).decode()}"
