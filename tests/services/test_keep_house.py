from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.store import predictions, tables
from app.store.erasure import keep_house
from app.store.errors import StoreUnavailableError
from tests.store.drafts import camera_record, predict, prediction_draft

DAY = timedelta(days=1)


def age(store, record, by):
    with store.write() as connection:
        aged = update(tables.predictions).where(tables.predictions.c.id == record.id)
        connection.execute(aged.values(created_at=datetime.now(UTC) - by))


def kept(store):
    with store.read() as connection:
        return [record.id for record in predictions.list_page(connection).items]


def test_without_limits_everything_is_kept(store):
    record = predict(store, prediction_draft())
    age(store, record, 1000 * DAY)
    keep_house(store)
    assert kept(store) == [record.id]


def test_old_predictions_go_and_their_images_with_a_later_sweep(store):
    image = store.blobs.put(b"image")
    old, new = (predict(store, prediction_draft(cameras=(camera_record(rgb_digest=image),))) for _ in range(2))
    age(store, old, 3 * DAY)
    keep_house(store, max_age=2 * DAY)
    assert kept(store) == [new.id]
    keep_house(store, max_age=timedelta(0))
    assert kept(store) == [new.id]  # it is an hour's work: another process, or this one, has just done it
    (store._data_dir / ".swept").write_text("0")
    keep_house(store, max_age=timedelta(0))
    assert kept(store) == []
    assert store.blobs.sizes() == {image: 5}
    assert store.sweep(timedelta(0)) == 1


def test_a_disk_that_refuses_the_note_of_a_sweep_is_an_error_of_the_store(store):
    """Another error would end the service's housekeeping for good."""
    (store._data_dir / ".swept").mkdir()
    with pytest.raises(StoreUnavailableError):
        keep_house(store)
