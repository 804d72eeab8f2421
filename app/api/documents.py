"""Stored records -> the JSON documents that clients get (see `schemas.responses`)."""

from collections.abc import Mapping
from dataclasses import fields, replace
from datetime import datetime
from typing import Any

from pydantic import BaseModel

from app.api.schemas.predictions import StoredPrediction
from app.api.schemas.responses import EpisodeOut, ListedEpisode
from app.llm.computed import YARDSTICKS
from app.pipeline.order.order import Order
from app.pipeline.prompt import Prompt
from app.pipeline.representation.absolute import AbsoluteCodec
from app.pipeline.workspace import Workspace, discretize_actions, object_bins
from app.services.measures import timings
from app.services.predict.question import Question
from app.services.predict.record import Prediction
from app.services.task_settings import TaskSettings
from app.store.prediction_lists import Configuration, Counts
from app.store.records import EpisodeRecord, PredictionRecord, TaskRecord
from app.store.values import JsonObject, KeyframeRecord, ObjectRecord
from roboprompt_client.types.camera import camera_json


def _fields(record: object, *names: str) -> JsonObject:
    return {name: getattr(record, name) for name in names}


def answer(model: type[BaseModel], record: object, **others: object) -> JsonObject:
    """An answer of that kind: its fields are the record's, but for those that are given here."""
    values = {name: others[name] if name in others else getattr(record, name) for name in model.model_fields}
    return {name: value.isoformat() if isinstance(value, datetime) else value for name, value in values.items()}


def episode_document(record: EpisodeRecord, settings: TaskSettings) -> JsonObject:
    """An `EpisodeOut`, or a `ListedEpisode` of a record without `extra`."""
    workspace = settings.workspace.workspace()
    demonstration = record.demonstration()
    demonstration = replace(demonstration, objects=settings.canonical(demonstration.objects))
    prompt_format = "authors" if settings.prompt_format == "authors" else "paper"
    codec = AbsoluteCodec(workspace, (demonstration,), with_instruction=prompt_format == "paper")
    return answer(
        ListedEpisode if record.extra is None else EpisodeOut,
        record,
        keyframes=[_keyframe(item, workspace) for item in record.keyframes],
        objects=[_object(item, workspace) for item in record.objects],
        cameras=[camera.name for camera in record.cameras],
        observation_text=codec.observation_text(demonstration),
        actions_text=codec.actions_text(demonstration),
    )


def metadata_document(record: EpisodeRecord) -> JsonObject:
    """An `EpisodeMetadata`: what was uploaded, to be uploaded elsewhere; no link to a prediction of here."""
    names = {"name": "name", "position": "position_m", "quaternion_xyzw": "quaternion_xyzw", "mask_ids": "mask_ids"}
    return {
        **_fields(record, "task", "instruction"),
        "objects": [{name: item[stored] for name, stored in names.items()} for item in record.given_objects],
        "cameras": [camera_json(item.camera()) for item in record.cameras],
        "control_frequency_hz": record.control_frequency_hz,
        "extra": record.extra or {},
        **_fields(record, "left_out", "note", "uploaded_instruction"),
    }


def _keyframe(record: KeyframeRecord, workspace: Workspace) -> JsonObject:
    (discrete,) = discretize_actions([record.action()], workspace)
    document = {name: value for name, value in record.to_json().items() if name != "objects"}
    return {**document, "bins": list(discrete.bins), "clamped": discrete.clamped}


def _object(record: ObjectRecord, workspace: Workspace) -> JsonObject:
    return {**record.to_json(), "bins": list(object_bins(record.pose(), workspace))}


def task_document(
    record: TaskRecord, settings: TaskSettings, num_episodes: int, num_unseen: int | None = None
) -> JsonObject:
    """A `TaskOut`.

    Args:
        num_unseen: its episodes without images with color and depth; None in lists, which do not count them.
    """
    stored: dict[str, Any] = settings.model_dump(mode="json")
    names = None if record.object_names is None else list(record.object_names)
    described = {"name": record.name, "version": record.version, "object_names": names, "num_episodes": num_episodes}
    if num_unseen is not None:
        note = (
            f"{num_unseen} of {num_episodes} episodes have no images with color and depth: their objects' poses stay as"
            " they were given, and object_models apply to predictions alone. Answers to images say so with a finding,"
            " poses-of-another-source, until an episode with given poses and images shows that both mean the same."
        )
        described["note"] = note if stored["object_models"] and num_unseen else ""
    return {**described, **stored}


def stats_document(task: str, counted: Mapping[Configuration, Counts]) -> JsonObject:
    """A `TaskStatsOut`."""
    names = [field.name for field in fields(Counts)]
    total = Counts(**{name: sum(getattr(counts, name) for counts in counted.values()) for name in names})
    configurations = [
        {**vars(way), "is_yardstick": way.model in YARDSTICKS, **_counts(counts)} for way, counts in counted.items()
    ]
    return {"task": task, **_counts(total), "configurations": configurations}


def _counts(counts: Counts) -> JsonObject:
    rate = counts.rate
    return {**vars(counts), "success_rate": rate.rate if rate.trials else None, "interval": list(rate.interval)}


def _asked(question: Question, prompt: Prompt) -> JsonObject:
    """Return the members that a prediction and a dry run have in common."""
    return {
        "task": question.request.task,
        **understood_document(question.grounded),
        "objects": [ObjectRecord.of(pose).to_json() for pose in question.known.observed],
        "model": question.known.profile.name,
        **_fields(question.known.style, "representation", "prompt_format"),
        "demonstration_ids": list(question.prefix.demonstration_ids),
        "prompt": {"system": prompt.system, "user": prompt.user},
        "prefix_hash": question.prefix.cache_key,
    }


def understood_document(order: Order) -> JsonObject:
    """An `UnderstoodOut`."""
    return {"canonical_instruction": order.text, "grounding": [phrase.to_json() for phrase in order.phrases]}


def prediction_document(prediction: Prediction) -> JsonObject:
    """A `PredictionOut`."""
    reply = prediction.reply
    return {
        "id": prediction.id,
        "actions": [item.document for item in reply.actions],
        **_asked(reply.question, reply.prompt),
        "reply_text": reply.text or "",
        "usage": dict(vars(reply.usage)),
        "timings_ms": prediction.timings_ms,
        "findings": [finding.to_json() for finding in prediction.findings],
    }


def dry_run_document(question: Question) -> JsonObject:
    """A `DryRunOut`."""
    return {
        "id": None,
        **_asked(question, question.prompt),
        "grammar": question.prompt.grammar,
        "findings": [finding.to_json() for finding in question.findings],
        "timings_ms": timings().ms,
    }


def stored_prediction_document(record: PredictionRecord) -> JsonObject:
    """A `StoredPrediction`."""
    outcome = None
    if record.outcome_success is not None and record.outcome_at is not None:
        recorded_at = record.outcome_at.isoformat()
        outcome = {"success": record.outcome_success, "note": record.outcome_note, "recorded_at": recorded_at}
    return answer(
        StoredPrediction,
        record,
        **understood_document(Order.from_json(record.grounding, ())),
        prompt={"system": record.prompt_system, "user": record.prompt_user},
        objects=[item.to_json() for item in record.objects],
        cameras=[item.name for item in record.cameras],
        usage=record.tokens,
        outcome=outcome,
    )
