"""Re-extraction as a job, on both databases: claimed once, resumed, switched over at once."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from app.services.teach import extract as extraction
from app.services.teach import run_jobs
from app.services.teach.run_jobs import RunJobs
from app.store import episodes, jobs, tasks
from app.store.errors import ConflictError, NotFoundError
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from tests.services.test_upload_episode import jointless, respond, upload

UNIFORM = {"keyframes": {"rule": "uniform", "interval": 10}}
LEASE = timedelta(seconds=60)


@pytest.fixture(params=["sqlite", "postgres"])
def store(request, tmp_path):
    url = request.getfixturevalue("postgres").migrated() if request.param == "postgres" else None
    store = Store.open(tmp_path, url)
    yield store
    store.close()


@pytest.fixture
def services(scripted, monkeypatch):
    monkeypatch.setattr(run_jobs, "BATCH", 2)
    services = scripted("[]")
    services.configure_task._max_at_once = 4
    for _ in range(5):
        services.upload_episode(upload("cube"), respond)
    return services


def indices(services):
    with services.store.read() as connection:
        return [[k.index for k in record.keyframes] for record in episodes.all_of(connection, "pick")]


def begin(services, changes=UNIFORM):
    return services.configure_task.at_once_or_as_job("pick", changes)


def job_of(services, job):
    with services.store.read() as connection:
        return jobs.get(connection, job.id)


def test_a_small_task_is_extracted_at_once(services):
    services.configure_task._max_at_once = 5
    assert begin(services).settings["keyframes"]["rule"] == "uniform"
    assert indices(services) == [[10, 20]] * 5


def test_a_large_one_by_a_job_that_switches_over_at_its_end(services):
    before = indices(services)
    job = begin(services)
    assert (job.status, job.num_episodes, job.num_extracted) == ("queued", 5, 0)
    with services.store.read() as connection:
        version = tasks.get(connection, "pick").version
    assert indices(services) == before
    assert services.run_jobs.run_next()
    assert indices(services) == [[10, 20]] * 5
    done = job_of(services, job)
    assert (done.status, done.num_extracted, done.error) == ("done", 5, None)
    assert done.finished_at >= done.created_at
    with services.store.read() as connection:
        task = tasks.get(connection, "pick")
        assert jobs.pending(connection, done, 9) != ()  # nothing stays staged
    assert (task.settings["keyframes"]["interval"], task.version) == (10, version + 1)
    assert not services.run_jobs.run_next()


def test_limits_that_are_tightened_before_a_job_ends_stay(services):
    begin(services, {**UNIFORM, "motion_limits": {"max_step_rotation_deg": 90.0}})
    services.configure_task("pick", {"motion_limits": {"max_step_m": 0.1}})
    assert services.run_jobs.run_next()
    limits = settings_of(services).motion_limits
    assert (limits.max_step_m, limits.max_step_rotation_deg) == (0.1, 90.0)


def test_settings_that_change_nothing_extracted_need_no_job(services):
    assert begin(services, {"num_demonstrations": 3}).settings["num_demonstrations"] == 3


def test_an_episode_that_cannot_be_extracted_fails_the_job_and_changes_nothing(services):
    services.upload_episode(jointless(), respond)
    before = indices(services)
    job = begin(services, {"keyframes": {"rule": "merged"}})
    assert services.run_jobs.run_next()
    failed = job_of(services, job)
    assert failed.status == "failed"
    assert "episode " in failed.error
    assert indices(services) == before
    assert begin(services).status == "queued"


def test_one_job_of_a_task_at_a_time(services):
    job = begin(services)
    with pytest.raises(ConflictError, match=job.id):
        begin(services)
    with pytest.raises(ConflictError, match="wait for its end"):
        services.configure_task("pick", UNIFORM)
    services.configure_task("pick", {"num_demonstrations": 3})
    services.run_jobs.run_next()
    with services.store.read() as connection:
        settings = tasks.get(connection, "pick").settings
    assert (settings["num_demonstrations"], settings["keyframes"]["rule"]) == (3, "uniform")


@pytest.mark.parametrize(("num_added", "num_removed"), [(1, 1), (0, 2)], ids=["one of each", "a whole batch"])
def test_episodes_that_are_added_and_removed_meanwhile(services, monkeypatch, num_added, num_removed):
    extract, extracted = extraction.extract_again, []

    def extract_while_others_work(store, record, settings):
        if len(extracted) < num_added:
            services.upload_episode(upload("cube"), respond)
        if len(extracted) < num_removed:
            with store.write() as connection:
                episodes.remove(connection, record.id)
        extracted.append(record.id)
        return extract(store, record, settings)

    monkeypatch.setattr(extraction, "extract_again", extract_while_others_work)
    job = begin(services)
    services.run_jobs.run_next()
    assert indices(services) == [[10, 20]] * (5 + num_added - num_removed)
    assert job_of(services, job).status == "done"


def test_a_job_that_settings_contradict_by_now_fails(services):
    """An error that is no refusal would end the worker, and no job would be done any more."""
    before = indices(services)
    job = begin(services, {**UNIFORM, "representation": "object_frame"})
    services.configure_task("pick", {"prompt_format": "kat"})
    assert services.run_jobs.run_next()
    assert job_of(services, job).status == "failed"
    assert "prompt_format" in job_of(services, job).error
    assert indices(services) == before


def settings_of(services):
    return services.configure_task._planned("pick", UNIFORM)[2]


def test_a_job_that_a_dead_process_left_is_taken_up_where_it_was(services, monkeypatch):
    job = begin(services)
    extract, extracted = extraction.extract_again, []

    def die_after_three(store, record, settings):
        if len(extracted) == 3:
            raise MemoryError("killed")
        extracted.append(record.id)
        return extract(store, record, settings)

    monkeypatch.setattr(extraction, "extract_again", die_after_three)
    dying = RunJobs(services.store, lease=timedelta(0))
    with pytest.raises(MemoryError):
        dying.run_next()
    assert (job_of(services, job).status, job_of(services, job).num_extracted) == ("running", 2)
    again = []
    monkeypatch.setattr(extraction, "extract_again", lambda *args: again.append(args[1].id) or extract(*args))
    assert services.run_jobs.run_next()
    assert len(again) == 3
    assert indices(services) == [[10, 20]] * 5


def test_a_claim_keeps_others_out_until_it_runs_out(services):
    begin(services)
    with services.store.write() as connection:
        mine = jobs.claim(connection, LEASE)
    with services.store.write() as connection:
        assert jobs.claim(connection, LEASE) is None
        jobs.release(connection, mine)
    with services.store.write() as connection:
        theirs = jobs.claim(connection, LEASE)
    assert theirs.id == mine.id
    for use in (jobs.release, lambda connection, job: jobs.fail(connection, job, "late")):
        with pytest.raises(jobs.LostClaimError), services.store.write() as connection:
            use(connection, mine)


def test_many_processes_claim_a_job_once(services):
    begin(services)

    def claim(_):
        with services.store.write() as connection:
            return jobs.claim(connection, LEASE)

    with ThreadPoolExecutor(4) as pool:
        claimed = [job for job in pool.map(claim, range(8)) if job is not None]
    assert len(claimed) == 1


def test_stopping_lets_another_go_on_at_once(services):
    job = begin(services)
    services.run_jobs.stop()
    services.run_jobs.run_next()
    assert job_of(services, job).status == "running"
    assert RunJobs(services.store).run_next()
    assert job_of(services, job).status == "done"


def test_unknown_job_and_task(services):
    with services.store.write() as connection:
        with pytest.raises(NotFoundError, match="there is no job 'nope'"):
            jobs.get(connection, "nope")
        with pytest.raises(NotFoundError, match="there is no task 'nope'"):
            jobs.add(connection, "nope", {})


def test_refused_settings_make_no_job(services):
    with pytest.raises(InvalidInputError):
        begin(services, {"object_models": {"bowl": {"estimator": "cuboid", "size_m": [1, 1, 1], "color": "red"}}})
    with services.store.read() as connection:
        assert jobs.list_page(connection).items == ()


def test_an_unexpected_error_fails_the_job_and_the_next_goes_on(services):
    def broken(_records, _wanted):
        raise KeyError("a mistake of ours")

    job = begin(services)
    assert RunJobs(services.store, LEASE, extract=broken).run_next()
    assert job_of(services, job).status == "failed"
    again = begin(services)
    assert RunJobs(services.store, LEASE).run_next()
    assert job_of(services, again).status == "done"
