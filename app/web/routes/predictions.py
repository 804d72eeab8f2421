"""What was predicted and how it went: the list, and one prediction."""

import re
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from pydantic import Field
from starlette.responses import Response

from app.api.routes import Wired
from app.api.schemas.lists import Filtered
from app.llm.computed import YARDSTICKS
from app.store import episodes, prediction_lists, tasks
from app.store.filters import FATES, PredictionFilter
from app.store.prediction_lists import ListCursor, ListOrder
from app.store.records import Fate
from app.web.page import HEADERS, FormQuery, PageRoute, query_of, render, render_part
from app.web.prediction_views import view_prediction
from roboprompt_client.errors import InvalidInputError

PAGE_SIZE = 50
_CURSOR = re.compile(r"(\d{1,2})\.(\d{1,18})", re.ASCII)
Text = Annotated[str, Field(max_length=200)]
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


class _Listed(FormQuery, Filtered):
    """What the list is asked for in its address."""

    model: Text | None = None
    representation: Text | None = None
    prompt_format: Text | None = None
    num_demonstrations: Annotated[int | None, Field(alias="demonstrations", ge=0, le=999)] = None
    fate: Annotated[Fate | None, Field(alias="outcome")] = None
    yardsticks: bool = False
    order: ListOrder = "successes"
    cursor: Annotated[str, Field(max_length=32)] = ""

    def filter(self, *, yardsticks: bool) -> PredictionFilter:
        """Without yardsticks, but for the one that is asked for by name."""
        without = () if self.model or yardsticks else tuple(YARDSTICKS)
        asked = self.model_dump(exclude={"yardsticks", "order", "cursor"})
        return PredictionFilter(**asked, without_models=without)


@router.get("/ui/predictions")
def predictions_page(request: Request, services: Wired, listed: Annotated[_Listed, Query()]) -> Response:
    """Predictions; yardsticks where they are asked for, and where no model was asked."""
    with services.store.read() as connection:
        models = prediction_lists.models(connection)
        yardsticks = listed.yardsticks or YARDSTICKS.issuperset(models)
        chosen = listed.filter(yardsticks=yardsticks)
        page = prediction_lists.list_page(connection, chosen, listed.order, PAGE_SIZE, _cursor(listed.cursor))
        names = list(tasks.counts(connection))
    return render(
        request,
        "predictions.html",
        page=page,
        chosen=chosen,
        order=listed.order,
        first=not listed.cursor,
        query=query_of(request),
        names=names,
        models=[name for name in models if name not in YARDSTICKS],
        measures=[name for name in models if name in YARDSTICKS],
        yardsticks=yardsticks,
        fates=FATES,
    )


def _cursor(text: str) -> ListCursor | None:
    if not text:
        return None
    if not (match := _CURSOR.fullmatch(text)):
        raise InvalidInputError("cursor", f"is {text!r}", "that of the page before")
    return ListCursor(int(match[1]), int(match[2]))


@router.get("/ui/predictions/{prediction_id}")
def prediction_page(request: Request, services: Wired, prediction_id: str) -> Response:
    """One prediction: what was asked, what came, what deserves a look."""
    view = view_prediction(services.store, services.known, prediction_id)
    with services.store.read() as connection:
        corrections = episodes.corrections_of(connection, prediction_id)
    return render(request, "prediction.html", view=view, corrections=corrections)


@documents.get("/ui/predictions/{prediction_id}/result")
def prediction_result(request: Request, services: Wired, prediction_id: str) -> Response:
    """The parts of the page that tell the result, and the scene."""
    view = view_prediction(services.store, services.known, prediction_id)
    root = request.scope.get("root_path", "")
    verdict, html = (render_part(f"prediction_{part}.html", view=view, root=root) for part in ("verdict", "result"))
    return JSONResponse({"verdict": verdict, "html": html, "scene": view.scene}, headers=HEADERS)
