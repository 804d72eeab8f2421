import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from sqlalchemy import event, update

from app.store import episodes, tables, tasks
from app.store.errors import CorruptDataError, NotFoundError
from app.store.filters import EpisodeFilter
from app.store.records import Extraction
from app.store.trajectories import get_trajectory
from app.store.values import CameraRecord, KeyframeRecord, ObjectRecord
from roboprompt_client.types.camera import camera_json

from .drafts import EXTRACTION_KEYS, SETTINGS, TASK, camera_record, episode_draft, object_record, read, upload, write
from .drafts import trajectory as recorded


def test_everything_comes_back(store):
    camera = camera_record(rgb_digest="a" * 64, depth_digest="b" * 64)
    draft = episode_draft(cameras=(camera,))
    added = upload(store, draft)
    with store.read() as connection:
        stored = episodes.get(connection, added.id)
        trajectory = get_trajectory(connection, added.id)
    assert stored == added
    for name in ("task", "instruction", "keyframes", "objects", "given_objects", "cameras", "extra"):
        assert getattr(stored, name) == getattr(draft, name), name
    assert stored.num_frames == len(trajectory) == 30
    for name, array in vars(recorded()).items():
        assert getattr(trajectory, name).tobytes() == array.tobytes(), name


def test_records_become_the_pipelines_values_and_back():
    camera, pose, action = camera_record(mask_digest="c" * 64), object_record("cube"), episode_draft().keyframes[0]
    assert CameraRecord(camera_json(camera.camera()), mask_digest="c" * 64) == camera
    assert ObjectRecord.of(pose.pose()) == pose
    restored = KeyframeRecord.of(action.index, action.action())
    assert restored.position_m == action.position_m
    np.testing.assert_allclose(restored.quaternion_xyzw, action.quaternion_xyzw, rtol=0, atol=1e-15)


def test_unknown_episode(store):
    with store.write() as connection:
        for query in (episodes.get, get_trajectory, episodes.remove):
            with pytest.raises(NotFoundError, match="there is no episode 'nope'"):
                query(connection, "nope")


def test_damaged_trajectory_names_its_episode(store):
    added = upload(store, episode_draft())
    with store.write() as connection:
        connection.execute(update(tables.episodes).values(trajectory=b"RPT1 what is this"))
        with pytest.raises(CorruptDataError, match=f"trajectory {added.id} is damaged"):
            get_trajectory(connection, added.id)


def test_first_episode_fixes_the_object_names_in_its_order(store):
    upload(store, episode_draft(names=("lid", "jar")))
    upload(store, episode_draft(names=("jar", "lid")))
    task = read(store, tasks.get, TASK)
    assert (task.object_names, task.version) == (("lid", "jar"), 3)


def test_task_forgets_its_object_names_with_its_last_episode(store):
    first, second = (upload(store, episode_draft(seed)) for seed in range(2))
    other = upload(store, episode_draft(task="other"))
    for episode, names in ((first, ("drawer", "cube")), (second, None)):
        with store.write() as connection:
            episodes.remove(connection, episode.id)
            assert tasks.get(connection, TASK).object_names == names
    with store.read() as connection:
        assert tasks.get(connection, TASK).version == 5
        assert tasks.get(connection, "other").version == 2
        assert [episode.id for episode in episodes.list_page(connection).items] == [other.id]


def test_the_newest_of_each_task_and_the_neighbors_of_one(store):
    first, other, second, third = (upload(store, episode_draft(task=task)) for task in (TASK, "other", TASK, TASK))
    with store.read() as connection:
        newest = {TASK: replace(third, extra=None), "other": replace(other, extra=None)}
        assert episodes.newest_by_task(connection) == newest
        assert episodes.neighbors(connection, first) == (None, second.id)
        assert episodes.neighbors(connection, second) == (first.id, third.id)
        assert episodes.neighbors(connection, other) == (None, None)


def test_instructions_are_searched_as_they_are_written(store):
    wanted = upload(store, episode_draft(instruction="Fill it to 100%"))
    upload(store, episode_draft(instruction="fill it to 1000"))
    with store.read() as connection:
        for text in ("100%", "FILL IT TO 100%"):
            found = episodes.list_page(connection, EpisodeFilter(containing=text))
            assert [episode.id for episode in found.items] == [wanted.id]
        assert not episodes.list_page(connection, EpisodeFilter(task="other", containing="fill")).items


def pages_of(store, limit, task):
    pages, cursor = [], None
    while True:
        page = read(store, episodes.list_page, EpisodeFilter(task=task), limit, cursor)
        pages.append([episode.id for episode in page.items])
        if (cursor := page.next_cursor) is None:
            return pages


@pytest.mark.parametrize("limit", [1, 2, 3, 6, 7, 100])
def test_pages_hold_everything_once_newest_first(store, limit):
    ids = [upload(store, episode_draft(seed, task=("a", "b")[seed % 2])).id for seed in range(6)]
    for task, expected in ((None, ids[::-1]), ("a", ids[::2][::-1]), ("b", ids[1::2][::-1])):
        pages = pages_of(store, limit, task)
        assert [episode_id for page in pages for episode_id in page] == expected
        assert all(len(page) == limit for page in pages[:-1])
        assert 0 < len(pages[-1]) <= limit
    assert pages_of(store, limit, "nope") == [[]]


def test_pages_stay_in_step_while_episodes_come_and_go(store):
    ids = [upload(store, episode_draft(seed)).id for seed in range(4)]
    page = read(store, episodes.list_page, EpisodeFilter(task=TASK), limit=2)
    write(store, episodes.remove, ids[3])
    newer = upload(store, episode_draft(9))
    rest = read(store, episodes.list_page, EpisodeFilter(task=TASK), limit=2, cursor=page.next_cursor)
    assert [episode.id for episode in rest.items] == [ids[1], ids[0]]
    assert newer.sequence == 5


def test_deleted_number_is_never_given_again(store):
    first = upload(store, episode_draft())
    write(store, episodes.remove, first.id)
    assert upload(store, episode_draft()).sequence == first.sequence + 1


def test_demonstrations(store):
    drafts = [episode_draft(seed, instruction=f"open the {('top', 'bottom')[seed % 2]} drawer") for seed in range(5)]
    ids = [upload(store, draft).id for draft in drafts]
    upload(store, episode_draft(task="other"))
    with store.read() as connection:

        def chosen(*arguments):
            return [record.id for record in episodes.demonstrations(connection, TASK, *arguments)]

        assert chosen() == ids
        assert chosen(2) == ids[:2]
        assert chosen(100) == ids
        assert episodes.list_ids(connection, TASK) == tuple(ids)
        (record,) = episodes.demonstrations(connection, TASK, 1)
    assert (record.instruction, record.objects) == (drafts[0].instruction, drafts[0].objects)
    assert record.keyframes == drafts[0].keyframes
    demonstration = record.demonstration()
    assert (demonstration.id, [pose.name for pose in demonstration.objects]) == (ids[0], ["drawer", "cube"])
    assert tuple(demonstration.actions[0].position_m) == record.keyframes[0].position_m


def test_demonstrations_by_id_come_in_the_order_asked_for(store):
    ids = [upload(store, episode_draft(seed)).id for seed in range(3)]
    stranger = upload(store, episode_draft(task="other")).id
    with store.read() as connection:
        records = episodes.demonstrations_by_id(connection, TASK, [ids[2], ids[0]])
        assert [record.id for record in records] == [ids[2], ids[0]]
        assert episodes.demonstrations_by_id(connection, TASK, []) == ()
        for unknown in (stranger, "nope"):
            with pytest.raises(NotFoundError, match=f"there is no episode of task 'open_drawer' '{unknown}'"):
                episodes.demonstrations_by_id(connection, TASK, [ids[0], unknown])


def plan_of(store, ask):
    statements = []
    with store.read() as connection:
        event.listen(connection, "before_cursor_execute", lambda *args: statements.append((args[2], args[3])))
        ask(connection)
        statement, parameters = statements[-1]
        return "; ".join(row[3] for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters))


OF_TASK = "SEARCH episodes USING INDEX ix_episodes_task_sequence (task=?)"


@pytest.mark.parametrize(
    ("ask", "plan"),
    [
        (lambda connection: episodes.demonstrations(connection, TASK, 10), OF_TASK),
        (
            lambda connection: episodes.list_page(connection, EpisodeFilter(task=TASK), 10, 5),
            OF_TASK.replace("?", "? AND sequence<?"),
        ),
        (
            lambda connection: episodes.demonstrations_by_id(connection, TASK, episodes.list_ids(connection, TASK)),
            "SEARCH episodes USING INDEX sqlite_autoindex_episodes_1 (id=?)",
        ),
    ],
)
def test_one_index_finds_and_sorts(sqlite_store, ask, plan):
    upload(sqlite_store, episode_draft())
    assert plan_of(sqlite_store, ask) == plan


def test_new_extractions_replace_the_old_ones_of_other_settings(store):
    kept, *replaced = [upload(store, episode_draft(seed)) for seed in range(3)]
    new, keys = episode_draft(77), EXTRACTION_KEYS._replace(keyframes="new")
    assert read(store, episodes.stale, TASK, EXTRACTION_KEYS) == ()
    stale = read(store, episodes.stale, TASK, keys, [episode.id for episode in replaced])
    assert [record.id for record in stale] == [episode.id for episode in replaced]
    extractions = [Extraction(record.id, new.keyframes[:1], new.objects, keys) for record in stale]
    write(store, episodes.replace_extractions, extractions)
    assert [record.id for record in read(store, episodes.stale, TASK, keys)] == [kept.id]
    with store.read() as connection:
        assert episodes.get(connection, kept.id) == kept
        for episode in replaced:
            stored = episodes.get(connection, episode.id)
            assert (stored.keyframes, stored.objects) == (new.keyframes[:1], new.objects)
            assert (stored.given_objects, stored.extra) == (episode.given_objects, episode.extra)


def test_episodes_without_depth_are_counted(store):
    upload(store, episode_draft(cameras=(camera_record(rgb_digest="a" * 64),)))
    upload(store, episode_draft(1, cameras=(camera_record(rgb_digest="a" * 64, depth_digest="b" * 64),)))
    assert read(store, episodes.number_unseen, TASK) == 1


def test_of_uploads_with_one_key_at_once_one_is_stored(store):
    start = threading.Barrier(4)

    def upload_once(_):
        start.wait()
        with store.write() as connection:
            if (found := episodes.uploaded_with(connection, "key")) is not None:
                return found.id
            tasks.get_or_create(connection, TASK, SETTINGS)
            return episodes.add(connection, replace(episode_draft(), upload_key="key", upload_digest="d")).id

    with ThreadPoolExecutor(4) as pool:
        answers = set(pool.map(upload_once, range(4)))
    (episode,) = read(store, episodes.list_page, EpisodeFilter(upload_key="key")).items
    assert answers == {episode.id}
    assert read(store, episodes.list_page, EpisodeFilter(upload_key="other")).items == ()
