"""Templates of registered objects from the store, decoded once."""

from collections.abc import Sequence

from app.perception.base import ObjectQuery
from app.perception.object_model import ObjectModelError
from app.perception.registered.estimator import TaughtQuery
from app.perception.registered.model import RegisteredModel
from app.perception.registered.template import Template
from app.services.cache import Cache
from app.store.blobs import BlobStore
from app.store.errors import CorruptDataError
from roboprompt_client.errors import InvalidInputError

MAX_TEMPLATES = 16  # in memory, some MB each
_decoded: Cache[str, Template] = Cache(MAX_TEMPLATES)  # of any store: a digest names the same bytes everywhere


def with_templates(queries: Sequence[ObjectQuery], blobs: BlobStore) -> tuple[ObjectQuery, ...]:
    """The queries, those of registered objects with their templates.

    Raises:
        ObjectModelError: if a template is not stored.
        StoreUnavailableError: if it cannot be read.
    """
    return tuple(_with_template(query, blobs) for query in queries)


def _with_template(query: ObjectQuery, blobs: BlobStore) -> ObjectQuery:
    if not isinstance(query.model, RegisteredModel):
        return query
    digest = query.model.template
    try:
        template = _decoded.get_or_make(digest, lambda: Template.from_bytes(blobs.read(digest)))
    except (CorruptDataError, InvalidInputError) as error:
        message = f"is {digest!r}, which is not stored here as a template ({error})"
        remedy = "what POST /tasks/{name}/labels/learn gives"
        raise ObjectModelError(query.name, message, remedy, within="template") from None
    return TaughtQuery(**vars(query), template=template)
