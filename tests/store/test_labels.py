"""Labels: views of an object with its masks."""

from datetime import timedelta

import pytest

from app.store import labels, tasks
from app.store.errors import NotFoundError
from app.store.store import blob_digests

from .drafts import SETTINGS, TASK, camera_record, read, write


@pytest.fixture
def taught(store):
    write(store, tasks.get_or_create, TASK, SETTINGS)
    return store


def add(store, name="drawer", **digests):
    return write(store, labels.add, TASK, name, (camera_record(**digests),), {"front": 7}, 30.0, None)


def test_labels_come_back_as_they_were_added_by_object(taught):
    first, other, second = add(taught), add(taught, "cube"), add(taught)
    with taught.read() as connection:
        assert labels.all_of(connection, TASK) == (first, other, second)
        assert labels.all_of(connection, TASK, "drawer") == (first, second)
        assert labels.number_of(connection, TASK) == 3


def test_a_label_is_removed_once(taught):
    label = add(taught)
    write(taught, labels.remove, TASK, label.id)
    with taught.write() as connection, pytest.raises(NotFoundError, match="label"):
        labels.remove(connection, TASK, label.id)


def test_a_task_that_is_not_there_has_no_labels(store):
    with store.write() as connection, pytest.raises(NotFoundError, match="task"):
        labels.add(connection, "none", "drawer", (), {}, None, None)


def test_masks_and_templates_are_kept_from_the_sweep(taught):
    mask, template, orphan = (taught.blobs.put(data) for data in (b"mask", b"template", b"orphan"))
    add(taught, mask_digest=mask)
    with taught.write() as connection:
        model = {"estimator": "registered", "template": template}
        tasks.update_settings(connection, TASK, {**SETTINGS, "object_models": {"drawer": model}})
    assert read(taught, blob_digests) == {mask, template}
    assert taught.sweep(timedelta(0)) == 1
    assert set(taught.blobs.sizes()) == {mask, template}
    assert orphan not in taught.blobs.sizes()
