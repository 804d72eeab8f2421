import pytest

from app.api.schemas.requests import PredictBody
from app.evaluation.methods import (
    COPY,
    EXPERT,
    REGRESSION,
    REPLAY,
    SWEEPS,
    Method,
    chosen,
    methods_beside,
    with_models,
    with_noise,
    with_poses,
)
from app.evaluation.teach import suffix_of, variants
from app.services.task_settings import TaskSettings
from app.sim.tasks import TASKS
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import NAME_PATTERN

SCENE = {"task": "stack_cube", "instruction": "stack", "objects": [{"name": "cube", "position": [0, 0, 1]}]}


@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
def test_the_service_takes_what_a_sweep_asks(sweep):
    methods = sweep.with_models(())
    assert len({method.label for method in methods}) == len(methods) > 1
    for method in methods:
        PredictBody.model_validate({**SCENE, **method.options})
        TaskSettings.model_validate(method.settings)


@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
def test_names_of_taught_tasks_are_valid(sweep):
    for suffix in variants(sweep.with_models(())):
        for task in TASKS:
            assert NAME_PATTERN.fullmatch(f"{task}{suffix}.eval-123456.labels")


def test_only_what_differs_is_taught_anew():
    keyframes = SWEEPS["keyframes"].methods
    assert list(variants(keyframes)) == [
        "",
        ".1-uniform-5",
        ".2-uniform-10",
        ".3-uniform-20",
        ".4-uniform-40",
        ".5-uniform-80",
    ]
    assert list(variants(SWEEPS["main"].methods)) == [""]
    assert suffix_of(keyframes[0], keyframes) == ""
    assert suffix_of(keyframes[2], keyframes) == ".2-uniform-10"


def test_models():
    main = SWEEPS["main"].methods
    assert [m.label for m in with_models(main, [])] == [m.label for m in main]
    one = with_models(main, ["openai/gpt-4o"])
    assert [m.options.get("model") for m in one] == ["openai/gpt-4o", "nearest", "regression", None]
    assert one[0].label == "default"
    two = with_models(main, ["a", "b"])
    assert [m.label for m in two[:2]] == ["default, a", "default, b"]
    over = SWEEPS["outside"].with_models(["a"])
    assert [m.label for m in over[:4]] == ["nearest", "regression", "embedded/gemma-3-270m", "a"]


def test_the_method_asked_for_comes_first():
    first, *others = methods_beside("a")
    assert first == Method("a, its representation", {"model": "a"})
    assert [other.source for other in others] == ["service", "service", "expert replay"]
    assert [other.options.get("unsupported") for other in others] == ["allow", "allow", None]
    assert [method.label for method in methods_beside(None)[1:]] == [method.label for method in others[1:]]


def test_vision_is_for_those_that_ask_the_service():
    methods = with_poses(SWEEPS["main"].methods, "vision")
    assert [method.poses for method in methods] == ["vision", "vision", "vision", "given"]
    assert len(variants(methods)) == 2
    assert suffix_of(methods[3], methods) == ""


def test_options_that_need_given_poses_are_refused_with_the_reason():
    with pytest.raises(InvalidInputError, match="given poses"):
        with_poses(SWEEPS["noise"].methods, "vision")


def test_methods_by_name():
    main = SWEEPS["main"].with_models(())
    assert chosen(main, (), ()) == main
    assert chosen(main, ["expert replay", "default"], ()) == (REPLAY, main[0])
    assert chosen(main, ["replay", "nearest", "regression", "expert"], ()) == (REPLAY, COPY, REGRESSION, EXPERT)
    assert chosen(main, ["nearest", COPY.label, "nearest"], ()) == (COPY,)


def test_a_simple_name_takes_the_models():
    over = SWEEPS["main"].with_models(["a", "b"])
    assert [method.label for method in chosen(over, ["default"], ["a", "b"])] == ["default, a", "default, b"]
    assert [method.label for method in chosen(over, ["default, b", "replay"], ["a", "b"])] == [
        "default, b",
        "expert replay",
    ]


def test_noise_is_for_those_that_see_poses():
    noisy = with_noise(SWEEPS["main"].methods, 1.5)
    assert [method.noise for method in noisy] == [1.5] * 3 + [0.0]
    assert len(variants(noisy)) == 2
