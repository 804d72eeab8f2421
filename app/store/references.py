"""Which blobs the rows of all tables refer to: the others may be swept, and a backup needs these."""

from sqlalchemy import Connection, Text, cast, select

from app.store import tables
from app.store.blobs import digests_in


def blob_digests(connection: Connection) -> set[str]:
    """The digests of every image that an episode, a prediction or a label refers to, and of settings' templates.

    Found in the text of the JSON: to decode that of 100,000 episodes takes ten seconds in which other threads starve.
    """
    digests: set[str] = set()
    images = (tables.episodes.c.cameras, tables.predictions.c.cameras, tables.labels.c.cameras)
    for column in (*images, tables.tasks.c.settings, tables.jobs.c.changes):
        query = select(cast(column, Text)).where(column.is_not(None)).execution_options(yield_per=1000)
        digests.update(digests_in(connection.scalars(query)))
    return digests
