"""The recorded motion of an episode in the database: the `.npz` that the client uploads, one value of a row."""

from collections.abc import Sequence

from sqlalchemy import Connection, select

from app.store import tables
from app.store.errors import CorruptDataError, NotFoundError
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import Trajectory

_EPISODES = tables.episodes
MAX_STORED_BYTES = 10_000_000_000  # what was uploaded was within the limits of that moment


def unpack(npz: bytes, episode_id: str) -> Trajectory:
    """The trajectory of a stored `.npz`; raises CorruptDataError, naming the episode, if its bytes were changed."""
    try:
        return trajectory_from_npz(npz, max_unpacked_bytes=MAX_STORED_BYTES)
    except InvalidInputError as error:
        raise CorruptDataError("trajectory", episode_id, str(error)) from error


def get_trajectories(connection: Connection, ids: Sequence[str]) -> tuple[Trajectory, ...]:
    """The trajectories of episodes, in the order of `ids`; raises NotFoundError, CorruptDataError."""
    query = select(_EPISODES.c.id, _EPISODES.c.trajectory).where(_EPISODES.c.id.in_(ids))
    found = {row.id: row.trajectory for row in connection.execute(query)}
    for episode_id in ids:
        if episode_id not in found:
            raise NotFoundError("episode", episode_id)
    return tuple(unpack(found[episode_id], episode_id) for episode_id in ids)


def get_trajectory(connection: Connection, episode_id: str) -> Trajectory:
    """As `get_trajectories`, of one episode."""
    return get_trajectories(connection, [episode_id])[0]
