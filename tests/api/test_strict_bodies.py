"""In no field of a body does `true` count as 1, or text as a number or a truth value."""

import pytest
from pydantic import TypeAdapter, ValidationError

from app.api.schemas.objects import LearnBody, PosesBody
from app.api.schemas.requests import EpisodeMetadata, OutcomeBody, PredictBody
from app.perception.cuboid.model import ColorModel, CuboidModel, Rank
from app.perception.markers.model import Marker, MarkersModel
from app.perception.models import MasksModel, RemoteModel
from app.perception.registered.model import RegisteredModel
from app.services.setting_parts import KeyframeSettings
from app.services.task_settings import TaskSettings

BODIES = (EpisodeMetadata, LearnBody, OutcomeBody, PosesBody, PredictBody, TaskSettings)
PARTS = (ColorModel, CuboidModel, Marker, MarkersModel, MasksModel, Rank, RegisteredModel, RemoteModel)
PARTS_OF_OBJECT_MODELS = {part.__name__: part for part in PARTS}
WRONG = {"integer": (True, "5", 5.5), "number": (True, "0.5"), "boolean": (1, 0.0, "yes")}


def places(schema, path=()):
    """Where fields hold a number or a truth value, with the type; of a list the first item stands for all."""
    for option in schema.get("anyOf", [schema]):
        if option.get("type") in WRONG:
            yield path, option["type"]
        for inner in (option.get("items"), *option.get("prefixItems", ())[:1]):
            if isinstance(inner, dict):
                yield from places(inner, (*path, 0))


def fields():
    """Every model of the bodies, whole or within another, by its name, field and type."""
    schemas = {model.__name__: (model.model_json_schema(), model) for model in BODIES}
    for name, (schema, model) in schemas.items():
        for within, definition in {name: schema, **schema.get("$defs", {})}.items():
            for field, about in definition.get("properties", {}).items():
                for path, kind in places(about):
                    yield pytest.param(model, within, (field, *path), kind, id=f"{name}-{within}-{field}-{kind}")


def nested(path, value):
    """The field alone, with the value where the path ends."""
    for part in reversed(path):
        value = [value] if isinstance(part, int) else {part: value}
    return value


def of_name(model, name):
    """What validates a definition of that name."""
    if name in PARTS_OF_OBJECT_MODELS:
        return TypeAdapter(PARTS_OF_OBJECT_MODELS[name])
    todo, seen = [model], set()
    while todo:
        kind = todo.pop()
        if kind.__name__ == name:
            return kind
        seen.add(kind)
        inner = [part for field in kind.model_fields.values() for part in classes(field.annotation)]
        todo += [part for part in inner if part not in seen]
    raise LookupError(name)


def classes(annotation):
    if hasattr(annotation, "model_fields"):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from classes(part)


def refused_at(model, path, value):
    """The places that pydantic names."""
    try:
        validate = model.validate_python if isinstance(model, TypeAdapter) else model.model_validate
        validate(nested(path, value))
    except ValidationError as error:
        return {tuple(item["loc"])[: len(path)] for item in error.errors()}
    return set()


@pytest.mark.parametrize(("model", "name", "path", "kind"), [*fields()])
def test_values_of_another_type_are_refused(model, name, path, kind):
    within = of_name(model, name)
    for value in WRONG[kind]:
        if isinstance(value, str) and within is KeyframeSettings:
            continue  # the address of a page carries them as text
        assert path in refused_at(within, path, value), value


def test_every_kind_of_field_is_checked():
    looked_at = {(item.values[1], item.values[2][0]) for item in fields()}
    expected = {
        ("PredictBody", "max_actions"),
        ("PredictBody", "dry_run"),
        ("ObjectIn", "mask_ids"),
        ("Intrinsics", "fx"),
    }
    assert expected <= looked_at


@pytest.mark.parametrize("field", ["num_demonstrations", "max_actions", "seed"])
def test_a_whole_number_may_be_written_with_a_point(field):
    document = {"task": "t", "instruction": "go", "objects": [{"name": "cube", "position": [0, 0, 1.0]}], field: 5.0}
    value = getattr(PredictBody.model_validate(document), field)
    assert (value, type(value)) == (5, int)
