"""The kept OpenAPI document is true, and its examples can be sent as they are."""

import json
from functools import cache
from pathlib import Path

from app.bootstrap import build_app
from app.settings import Settings

SNAPSHOT = Path(__file__).parents[2] / "openapi" / "openapi.json"
OPERATIONS = {
    "upload_episode", "list_episodes", "get_episode", "delete_episode", "get_trajectory", "get_image",
    "list_tasks", "get_task", "configure_task", "predict", "list_predictions", "get_prediction", "record_outcome",
    "list_models", "healthz", "readyz", "metrics", "find_poses", "learn_object_models", "check_task",
    "label_object", "preview_label", "list_labels", "delete_label", "learn_from_labels", "try_object_model",
    "get_episode_overlay",
    "get_prediction_overlay",
    "get_metadata", "edit_episode", "get_task_stats", "get_upload",
    "get_job", "list_jobs",
    "delete_prediction", "delete_task", "plan", "report_run", "end_run", "list_runs", "stop_run",
    "keep_case", "drop_case",
}  # fmt: skip


@cache
def openapi_text():
    """As `make openapi` writes it."""
    return json.dumps(build_app(Settings()).openapi(), indent=2, sort_keys=True) + "\n"


def test_snapshot_is_what_the_service_says():
    assert SNAPSHOT.read_text() == openapi_text(), "run `make openapi` and look at the difference"


def test_operation_ids_are_stable():
    paths = json.loads(openapi_text())["paths"]
    assert {operation["operationId"] for item in paths.values() for operation in item.values()} == OPERATIONS


def test_every_reference_resolves():
    text = openapi_text()
    schemas = json.loads(text)["components"]["schemas"]
    referred = {part.split('"')[0] for part in text.split('"#/components/schemas/')[1:]}
    assert referred <= set(schemas)
