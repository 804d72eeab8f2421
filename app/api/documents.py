"""Stored records -> the JSON documents that clients get (see `schemas.responses`)."""

from collections.abc import Sequence
from typing import Any

from app.llm.base import ModelProfile
from app.pipeline.episode import Demonstration
from app.pipeline.order.order import Order
from app.pipeline.prompt import Prompt
from app.pipeline.representation import fit_codec
from app.pipeline.workspace import Workspace, discretize_action, object_bins
from app.services.measures import timings
from app.services.predict.question import Question
from app.services.predict.record import Prediction
from app.services.predict.standing import Standing, StandingComparison, TaskStats
from app.services.task_settings import TaskSettings
from app.store.configurations import Counts
from app.store.records import EpisodeFields, EpisodeRecord, JobRecord, PredictionRecord, TaskRecord
from app.store.runs import RunRecord
from app.store.values import JsonObject, KeyframeRecord, ObjectRecord
from app.store.visibility import present
from roboprompt_client.camera import camera_json


def episode_document(record: EpisodeFields, settings: TaskSettings) -> JsonObject:
    """An `EpisodeOut`, or a `ListedEpisode` of a record without `extra`."""
    workspace = settings.workspace.workspace()
    poses = settings.canonical(tuple(item.pose() for item in record.objects))
    actions = tuple(keyframe.action() for keyframe in record.keyframes)
    demonstration = Demonstration(record.instruction, poses, actions, record.id)
    # KAT's format is for its action tokens only
    prompt_format = "authors" if settings.prompt_format == "authors" else "paper"
    codec = fit_codec("absolute", prompt_format, [demonstration], workspace)
    return {
        "id": record.id,
        "task": record.task,
        "instruction": record.instruction,
        "num_frames": record.num_frames,
        "control_frequency_hz": record.control_frequency_hz,
        "keyframes": [_keyframe(item, workspace) for item in record.keyframes],
        "objects": [_object(item, workspace) for item in record.objects],
        "cameras": [camera.name for camera in record.cameras],
        **({} if record.extra is None else {"extra": record.extra}),
        "prediction_id": record.prediction_id,
        "left_out": record.left_out,
        "note": record.note,
        "uploaded_instruction": record.uploaded_instruction,
        "observation_text": codec.observation_text(demonstration),
        "actions_text": codec.actions_text(demonstration),
        "created_at": record.created_at.isoformat(),
    }


def metadata_document(record: EpisodeRecord) -> JsonObject:
    """An `EpisodeMetadata`: what was uploaded, to be uploaded elsewhere; no link to a prediction of here."""
    objects = [
        {
            "name": item["name"],
            "position": item["position_m"],
            "quaternion_xyzw": item["quaternion_xyzw"],
            "mask_ids": item["mask_ids"],
        }
        for item in record.given_objects
    ]
    return {
        "task": record.task,
        "instruction": record.instruction,
        "objects": objects,
        "cameras": [camera_json(item.camera()) for item in record.cameras],
        "control_frequency_hz": record.control_frequency_hz,
        "extra": record.extra or {},
        "left_out": record.left_out,
        "note": record.note,
        "uploaded_instruction": record.uploaded_instruction,
    }


def _keyframe(record: KeyframeRecord, workspace: Workspace) -> JsonObject:
    discrete = discretize_action(record.action(), workspace)
    document = {name: value for name, value in record.to_json().items() if name != "objects"}
    return {**document, "bins": list(discrete.bins), "clamped": discrete.clamped}


def _object(record: ObjectRecord, workspace: Workspace) -> JsonObject:
    return {**record.to_json(), "bins": list(object_bins(record.pose(), workspace))}


def task_document(record: TaskRecord, num_episodes: int, num_unseen: int | None = None) -> JsonObject:
    """A `TaskOut`.

    Args:
        num_unseen: its episodes without images with color and depth; None in lists, which do not count them.
    """
    stored: dict[str, Any] = TaskSettings.model_validate(record.settings).model_dump(mode="json")
    names = None if record.object_names is None else list(record.object_names)
    described = {"name": record.name, "version": record.version, "object_names": names, "num_episodes": num_episodes}
    if num_unseen is not None:
        described["note"] = _note(num_unseen, num_episodes) if stored["object_models"] and num_unseen else ""
    return {**described, **stored}


def _note(num_unseen: int, num_episodes: int) -> str:
    return (
        f"{num_unseen} of {num_episodes} episodes have no images with color and depth: their objects' poses stay as"
        " they were given, and object_models apply to predictions alone. Answers to images say so with a finding,"
        " poses-of-another-source, until an episode with given poses and images shows that both mean the same."
    )


def stats_document(task: str, stats: TaskStats, compare: Sequence[str] = ()) -> JsonObject:
    """A `TaskStatsOut`."""
    configurations = [_standing(item) for item in stats.standings]
    compared = [_comparison(item) for item in stats.comparisons(compare)]
    return {"task": task, **_counts(stats.total), "configurations": configurations, "comparisons": compared}


def _standing(standing: Standing) -> JsonObject:
    asked = {"id": standing.configuration.id, **vars(standing.configuration), "is_yardstick": standing.is_yardstick}
    return {**asked, **_counts(standing.counts), "llm_ms": standing.llm_ms, "tokens": standing.tokens}


def _counts(counts: Counts) -> JsonObject:
    rate = counts.rate
    return {**vars(counts), "success_rate": rate.rate if rate.trials else None, "interval": list(rate.interval)}


def _comparison(compared: StandingComparison) -> JsonObject:
    pairs = compared.pairs
    return {
        "one": compared.one.configuration.id,
        "other": compared.other.configuration.id,
        **vars(pairs),
        "difference": list(pairs.interval),
        "evidence": pairs.evidence,
        "may_stop": pairs.is_decided,
        "pairs_until_decided": pairs.num_until_decided,
    }


def run_document(record: RunRecord) -> JsonObject:
    """A `RunOut`."""
    times = {name: getattr(record, name).isoformat() for name in ("created_at", "heard_at")}
    return {**vars(record), **times}


def job_document(record: JobRecord) -> JsonObject:
    """A `JobOut`."""
    shown = ("id", "task", "changes", "status", "num_episodes", "num_extracted", "error")
    times = {name: getattr(record, name) for name in ("created_at", "finished_at")}
    iso = {name: None if value is None else value.isoformat() for name, value in times.items()}
    return {name: getattr(record, name) for name in shown} | iso


def _asked(question: Question, prompt: Prompt) -> JsonObject:
    """What a prediction and a dry run have in common."""
    return {
        "task": question.request.task,
        **_understood(question.grounded),
        "objects": [ObjectRecord.of(pose).to_json() for pose in question.seen.objects],
        "model": question.known.profile.name,
        "representation": question.known.style.representation,
        "prompt_format": question.known.style.prompt_format,
        "demonstration_ids": list(question.prefix.demonstration_ids),
        "prompt": _prompt(prompt.system, prompt.user),
        "prefix_hash": question.prefix.cache_key,
    }


def _prompt(system: str, user: str) -> JsonObject | None:
    """A `PromptOut`, for those who may read the demonstrations in it; the store leaves out what it must not show."""
    return {"system": system, "user": user} if present().demonstrations and user else None


def _understood(order: Order) -> JsonObject:
    """How the instruction was understood."""
    return {"canonical_instruction": order.text, "grounding": [phrase.to_json() for phrase in order.phrases]}


def understood_document(question: Question) -> JsonObject:
    """An `UnderstoodOut`: what is known before the LLM has said anything."""
    return _understood(question.grounded)


def prediction_document(prediction: Prediction) -> JsonObject:
    """A `PredictionOut`."""
    reply = prediction.reply
    return {
        "id": prediction.id,
        "actions": [item.document for item in reply.actions],
        **_asked(prediction.question, reply.prompt),
        "reply_text": reply.text or "",
        "usage": dict(vars(reply.usage)),
        "timings_ms": prediction.timings_ms,
        "step": prediction.question.step,
        "samples": _samples(reply.samples),
        "findings": [finding.to_json() for finding in prediction.findings],
    }


def _samples(samples: Sequence[JsonObject] | None) -> JsonObject | None:
    """A `SamplesOut`."""
    if samples is None:
        return None
    return {"asked": len(samples), "used": sum(sample["used"] for sample in samples), "replies": list(samples)}


def dry_run_document(question: Question) -> JsonObject:
    """A `DryRunOut`."""
    prompt = question.prompt
    findings = [finding.to_json() for finding in question.findings]
    return {
        "id": None,
        **_asked(question, prompt),
        "grammar": prompt.grammar,
        "findings": findings,
        "timings_ms": timings().ms,
    }


def stored_prediction_document(record: PredictionRecord) -> JsonObject:
    """A `StoredPrediction`."""
    outcome = None
    if record.outcome_success is not None and record.outcome_at is not None:
        recorded_at = record.outcome_at.isoformat()
        outcome = {"success": record.outcome_success, "note": record.outcome_note, "recorded_at": recorded_at}
    same = ("id", "task", "instruction", "status", "error", "model", "representation", "prompt_format", "reply_text")
    return {
        **{name: getattr(record, name) for name in same},
        **_understood(Order.from_json(record.grounding, ())),
        "demonstration_ids": list(record.demonstration_ids),
        "prompt": _prompt(record.prompt_system, record.prompt_user),
        "actions": None if record.actions is None else list(record.actions),
        "objects": [item.to_json() for item in record.objects],
        "cameras": [item.name for item in record.cameras],
        "usage": record.usage,
        "timings_ms": record.timings_ms,
        "step": record.step,
        "samples": _samples(record.samples),
        "findings": list(record.findings),
        "request": record.request,
        "outcome": outcome,
        "key_id": record.key_id,
        "created_at": record.created_at.isoformat(),
    }


def model_document(profile: ModelProfile, available: bool, reason: str | None, default: str) -> JsonObject:
    """A `ModelOut`."""
    return {
        "name": profile.name,
        "available": available,
        "reason": reason or None,
        "style": profile.style,
        "grammar": profile.grammar,
        "representation": profile.representation,
        "prompt_format": profile.prompt_format,
        "system_prompt": profile.system_prompt,
        "description": profile.description,
        "timeout_s": profile.timeout_s,
        "reading_s": profile.reading_s,
        "default": profile.name == default,
    }
