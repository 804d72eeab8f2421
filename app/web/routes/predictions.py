"""What was predicted and how it went: the list, and one prediction."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from pydantic import Field
from starlette.responses import Response

from app.api.routes import Wired
from app.api.schemas.lists import Filtered, PageQuery
from app.store import episodes, prediction_lists, tasks
from app.store.filters import FATES, PredictionFilter
from app.store.records import Fate
from app.web.page import HEADERS, FormQuery, PageRoute, query_of, render, render_part
from app.web.prediction_views import view_prediction

Text = Annotated[str, Field(max_length=200)]
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


class _Listed(FormQuery, PageQuery, Filtered):
    """What the list is asked for in its address."""

    model: Text | None = None
    representation: Text | None = None
    prompt_format: Text | None = None
    num_demonstrations: Annotated[int | None, Field(alias="demonstrations", ge=0, le=999)] = None
    fate: Annotated[Fate | None, Field(alias="outcome")] = None

    def filter(self) -> PredictionFilter:
        """The store's filter."""
        return PredictionFilter(**self.model_dump(exclude={"limit", "cursor"}))


@router.get("/ui/predictions")
def predictions_page(request: Request, services: Wired, listed: Annotated[_Listed, Query()]) -> Response:
    """Predictions, newest first."""
    chosen = listed.filter()
    with services.store.read() as connection:
        models = prediction_lists.models(connection)
        page = prediction_lists.list_page(connection, chosen, listed.limit, listed.cursor)
        names = list(tasks.counts(connection))
    return render(
        request,
        "predictions.html",
        page=page,
        chosen=chosen,
        first=listed.cursor is None,
        query=query_of(request),
        names=names,
        models=models,
        fates=FATES,
    )


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
