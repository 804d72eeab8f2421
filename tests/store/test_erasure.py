"""Deleted is what was asked for, with all that refers to it, and nothing else."""

from datetime import timedelta

import pytest
from sqlalchemy import func, select

from app.store import erasure, labels, predictions, tables, tasks
from app.store.errors import NotFoundError
from app.store.labels import LabelRecord

from .drafts import TASK, camera_record, episode_draft, predict, prediction_draft, upload, write

OTHER = "close_jar"


def fill(store, task):
    """An episode, a label, a prediction with an outcome."""
    episode = upload(store, episode_draft(task=task))
    asked = predict(store, prediction_draft(task))
    with store.write() as connection:
        predictions.record_outcome(connection, asked.id, True, "fine")
        labels.add(connection, LabelRecord(task, "drawer", (camera_record(),), {"front": 7}, None, episode.id))


def counts(store):
    of_task = (tables.tasks, tables.episodes, tables.labels, tables.predictions)
    listed = of_task
    with store.read() as connection:
        return {table.name: connection.scalar(select(func.count()).select_from(table)) for table in listed}


def test_a_task_goes_with_all_that_it_holds(store):
    fill(store, OTHER)
    alone = counts(store)
    fill(store, TASK)
    assert counts(store) == {name: 2 * number for name, number in alone.items()}
    write(store, erasure.erase_task, TASK)
    assert counts(store) == alone
    with store.read() as connection:
        assert tasks.get(connection, OTHER).object_names == ("drawer", "cube")


def test_what_was_under_way_for_a_deleted_task_is_refused(store):
    fill(store, TASK)
    write(store, erasure.erase_task, TASK)
    with pytest.raises(NotFoundError, match=TASK), store.write() as connection:
        predictions.add(connection, prediction_draft())
    with pytest.raises(NotFoundError), store.write() as connection:
        erasure.erase_task(connection, TASK)
    assert set(counts(store).values()) == {0}


def test_a_prediction_goes(store):
    gone, kept = predict(store, prediction_draft()), predict(store, prediction_draft())
    write(store, erasure.erase_prediction, gone.id)
    with store.read() as connection:
        assert predictions.get(connection, kept.id) == kept
        with pytest.raises(NotFoundError, match=gone.id):
            predictions.get(connection, gone.id)
    with pytest.raises(NotFoundError, match=gone.id), store.write() as connection:
        erasure.erase_prediction(connection, gone.id)


def test_images_that_others_have_stay(store):
    own, shared = store.blobs.put(b"own"), store.blobs.put(b"shared")
    upload(store, episode_draft(task=OTHER, cameras=(camera_record(rgb_digest=shared),)))
    for digest in (own, shared):
        predict(store, prediction_draft(cameras=(camera_record(rgb_digest=digest),)))
    assert store.blobs.sizes() == {own: 3, shared: 6}
    assert store.sweep(timedelta(0)) == 0
    write(store, erasure.erase_task, TASK)
    assert store.sweep(timedelta(hours=1)) == 0  # one of them may be part of an upload under way
    assert store.sweep(timedelta(0)) == 1
    assert store.blobs.sizes() == {shared: 6}
