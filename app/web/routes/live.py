"""What runs now, in every process of the service."""

import time
from datetime import UTC, datetime

import numpy as np
from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse
from sqlalchemy import Connection
from starlette.responses import Response

from app.api.routes import Wired
from app.services.container import Services
from app.services.task_settings import TaskSettings
from app.store import jobs, prediction_lists, runs
from app.store.records import JobRecord
from app.store.runs import RunRecord
from app.store.values import JsonObject
from app.store.visibility import present
from app.web.page import HEADERS, PageRoute, render, render_part
from app.web.play import skeletons
from app.web.scene import scene

NUM_JOBS = 10  # the newest
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


def job_left_s(record: JobRecord) -> float | None:
    """Seconds that a re-extraction will still take at its pace so far; None where that is not known yet."""
    if record.status != "running" or not record.num_extracted:
        return None
    elapsed_s = (datetime.now(UTC) - record.created_at).total_seconds()
    return elapsed_s * max(record.num_episodes - record.num_extracted, 0) / record.num_extracted


@router.get("/ui/live")
def live_page(request: Request, services: Wired) -> Response:
    """What runs; its script asks again and again."""
    running, listed = _now(services)
    return render(request, "live.html", running=running, jobs=listed)


@documents.get("/ui/live/now")
def live_part(request: Request, services: Wired) -> Response:
    """The part of the page that changes."""
    root = request.scope.get("root_path", "")
    running, listed = _now(services)
    return HTMLResponse(render_part("live_now.html", running=running, jobs=listed, root=root), headers=HEADERS)


@documents.get("/ui/live/runs")
def live_runs(services: Wired) -> Response:
    """The robots under way, each with where its arm is, as the 3D view draws it."""
    with services.store.read() as connection:
        listed = [_run(connection, record) for record in runs.living(connection)]
    return JSONResponse({"runs": listed}, headers=HEADERS)


def _run(connection: Connection, record: RunRecord) -> JsonObject:
    settings = TaskSettings.of(connection, record.task)
    state = record.state
    (arm,) = skeletons(np.array([state.get("joint_positions", ())]), settings) or (None,)
    return {
        "id": record.id,
        "task": record.task,
        "instruction": state["instruction"],
        "prediction_id": state.get("prediction_id"),
        "action": state.get("action"),
        "hand": state.get("end_effector") or state.get("target"),
        "is_measured": "end_effector" in state,
        "open": state.get("gripper_open", True),
        "arm": arm,
        "stop": record.stop,
        "silent_s": round((datetime.now(UTC) - record.heard_at).total_seconds(), 1),
        "scene": scene(settings.workspace, (), ()),
    }


def _now(services: Services) -> tuple[list[JsonObject], list[tuple[JobRecord, float | None]]]:
    """Predictions under way, with the median time of their models' latest answers; the newest re-extractions."""
    notes = [note for note in services.store.under_way.all() if present().has_task(note.task)]
    with services.store.read() as connection:
        latest = jobs.list_page(connection, limit=NUM_JOBS).items
        usual_ms = {model: prediction_lists.usual_llm_ms(connection, model) for model in {note.model for note in notes}}
    running = []
    for note in notes:
        elapsed_s, usual_s = time.time() - note.started_s, (usual_ms[note.model] or 0) / 1000
        left_s = usual_s - elapsed_s if usual_s > elapsed_s else None
        running.append({"note": note, "elapsed_s": elapsed_s, "usual_s": usual_s, "left_s": left_s})
    return running, [(record, job_left_s(record)) for record in latest]
