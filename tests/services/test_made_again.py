"""A task that is deleted and made again is another one, whatever its version."""

from app.store import tasks


def test_limits_of_a_task_that_was_made_again_are_its_own(scripted):
    services = scripted("[]")
    store, found = services.store, []
    for top in (1.0, 0.5):
        with store.write() as connection:
            tasks.get_or_create(connection, "press", {"workspace": {"min": [0, 0, 0], "max": [1, 1, top]}})
        with store.read() as connection:
            found.append(services.known.limits(connection, "press").workspace.max_m[2])
        with store.write() as connection:
            connection.exec_driver_sql("delete from tasks")
    assert found == [1.0, 0.5]
