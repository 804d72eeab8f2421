"""Deleted is what was asked for, with all that refers to it, and nothing else."""

from datetime import timedelta

import pytest
from sqlalchemy import func, select

from app.store import labels, predictions, tables, tasks
from app.store.errors import NotFoundError
from app.store.labels import LabelRecord

from .drafts import TASK, blobs_of, camera_record, episode_draft, predict, prediction_draft, upload, write

OTHER = "close_jar"


def fill(store, task):
    """An episode, a label, a prediction with an outcome."""
    episode = upload(store, episode_draft(task=task))
    asked = predict(store, prediction_draft(task))
    with store.write() as connection:
        predictions.record_outcome(connection, asked.id, True, "fine")
        labels.add(connection, LabelRecord(task, "drawer", (camera_record(),), {"front": 7}, None, episode.id))


def counts(store):
    listed = (tables.tasks, tables.episodes, tables.labels, tables.predictions)
    with store.read() as connection:
        return {table.name: connection.scalar(select(func.count()).select_from(table)) for table in listed}


def test_a_task_goes_with_all_that_it_holds(store):
    fill(store, OTHER)
    alone = counts(store)
    fill(store, TASK)
    assert counts(store) == {name: 2 * number for name, number in alone.items()}
    write(store, tasks.remove, TASK)
    assert counts(store) == alone
    with store.read() as connection:
        assert tasks.get(connection, OTHER).object_names == ("drawer", "cube")


def test_what_was_under_way_for_a_deleted_task_is_refused(store):
    fill(store, TASK)
    write(store, tasks.remove, TASK)
    with pytest.raises(NotFoundError, match=TASK), store.write() as connection:
        predictions.add(connection, prediction_draft())
    with pytest.raises(NotFoundError), store.write() as connection:
        tasks.remove(connection, TASK)
    assert set(counts(store).values()) == {0}


def test_a_prediction_goes(store):
    gone, kept = predict(store, prediction_draft()), predict(store, prediction_draft())
    write(store, predictions.remove, gone.id)
    with store.read() as connection:
        assert predictions.get(connection, kept.id) == kept
        with pytest.raises(NotFoundError, match=gone.id):
            predictions.get(connection, gone.id)
    with pytest.raises(NotFoundError, match=gone.id), store.write() as connection:
        predictions.remove(connection, gone.id)


def test_images_that_others_have_stay(store):
    own, shared = store.blobs.put(b"own"), store.blobs.put(b"shared")
    upload(store, episode_draft(task=OTHER, cameras=(camera_record(rgb_digest=shared),)))
    for digest in (own, shared):
        predict(store, prediction_draft(cameras=(camera_record(rgb_digest=digest),)))
    assert blobs_of(store) == {own, shared}
    assert store.sweep(timedelta(0)) == 0
    write(store, tasks.remove, TASK)
    assert store.sweep(timedelta(hours=1)) == 0  # one of them may be part of an upload under way
    assert store.sweep(timedelta(0)) == 1
    assert blobs_of(store) == {shared}
