"""Labels: views of an object with its masks."""

from datetime import timedelta

import pytest

from app.store import labels, tasks
from app.store.errors import NotFoundError
from app.store.store import Store, blob_digests

from .drafts import SETTINGS, TASK, camera_record


@pytest.fixture
def taught(store: Store) -> Store:
    with store.write() as connection:
        tasks.get_or_create(connection, TASK, SETTINGS)
    return store


def add(store: Store, name: str = "drawer", **digests: str) -> labels.LabelRecord:
    with store.write() as connection:
        return labels.add(connection, TASK, name, (camera_record(**digests),), {"front": 7}, 30.0, None)


def test_labels_come_back_as_they_were_added_by_object(taught: Store) -> None:
    first, other, second = add(taught), add(taught, "cube"), add(taught)
    with taught.read() as connection:
        assert labels.all_of(connection, TASK) == (first, other, second)
        assert labels.all_of(connection, TASK, "drawer") == (first, second)
        assert labels.number_of(connection, TASK) == 3


def test_a_label_is_removed_once(taught: Store) -> None:
    label = add(taught)
    with taught.write() as connection:
        labels.remove(connection, TASK, label.id)
    with taught.write() as connection, pytest.raises(NotFoundError, match="label"):
        labels.remove(connection, TASK, label.id)


def test_a_task_that_is_not_there_has_no_labels(store: Store) -> None:
    with store.write() as connection, pytest.raises(NotFoundError, match="task"):
        labels.add(connection, "none", "drawer", (), {}, None, None)


def test_masks_and_templates_are_kept_from_the_sweep(taught: Store) -> None:
    mask, template, orphan = (taught.blobs.put(data) for data in (b"mask", b"template", b"orphan"))
    add(taught, mask_digest=mask)
    with taught.write() as connection:
        model = {"estimator": "registered", "template": template}
        tasks.update_settings(connection, TASK, {**SETTINGS, "object_models": {"drawer": model}})
    with taught.read() as connection:
        assert blob_digests(connection) == {mask, template}
    assert taught.sweep(timedelta(0)) == 1
    assert set(taught.blobs.sizes()) == {mask, template}
    assert orphan not in taught.blobs.sizes()
