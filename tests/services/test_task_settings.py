import pytest
from pydantic import ValidationError

from app.pipeline.workspace import RLBENCH_MAX_M, RLBENCH_MIN_M
from app.services.setting_parts import KeyframeSettings, MotionLimitsSettings
from app.services.task_settings import TaskSettings
from app.store import tasks

from .test_upload_episode import upload

KEEP_OUT = {"min": (0, 0, 0), "max": (1, 1, 1)}
BOX = {"min": (-1.0, -1.0, 0.0), "max": (1.0, 1.0, 2.0)}


def settings(**named):
    """As a request names them."""
    return TaskSettings.model_validate(named).model_dump(exclude_unset=True)


def changed(*changes):
    """The defaults after several requests."""
    current = TaskSettings()
    for change in changes:
        current = current.changed(settings(**change))
    return current


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("keyframes", {"rule": "waypoints", "delta_rad_s": 0.02, "interval": 9, "tolerance_m": 0.03}),
        ("keyframes", {"tolerance_deg": 5.0, "rule": "uniform"}),
        ("motion_limits", {"keep_out": (KEEP_OUT,), "max_step_m": 0.2, "max_step_rotation_deg": 30}),
        ("workspace", BOX),
    ],
)
def test_of_nested_settings_only_what_a_change_names_is_changed(name, values):
    one_by_one = changed(*({name: {key: value}} for key, value in values.items()))
    assert getattr(one_by_one, name) == getattr(changed({name: values}), name)
    first, *_ = values
    left = getattr(changed({name: values}, {name: {first: values[first]}}), name)
    assert left == getattr(changed({name: values}), name)


def test_other_settings_stay():
    both = changed({"keyframes": {"rule": "merged"}}, {"motion_limits": {"max_step_m": 0.3}}, {"num_demonstrations": 3})
    assert both.keyframes == KeyframeSettings(rule="merged")
    assert both.motion_limits == MotionLimitsSettings(max_step_m=0.3)
    assert both.num_demonstrations == 3


def test_null_takes_a_bound_away_and_maps_by_object_are_replaced_as_a_whole():
    bound = {"motion_limits": {"max_step_m": 0.3}}
    assert changed(bound, {"motion_limits": {"max_step_m": None}}).motion_limits.max_step_m is None
    both = changed({"yaw_symmetry_deg": {"cube": 90}}, {"yaw_symmetry_deg": {"plate": 0}})
    assert both.yaw_symmetry_deg == {"plate": 0}


@pytest.mark.parametrize("before", [{}, {"workspace": BOX}, {"workspace": "auto"}])
def test_a_preset_has_a_box_of_its_own(before):
    rlbench = changed(before, {"workspace": "rlbench"}).workspace
    assert (rlbench.preset, rlbench.min, rlbench.max) == ("rlbench", RLBENCH_MIN_M, RLBENCH_MAX_M)


@pytest.mark.parametrize("before", [{}, {"workspace": "rlbench"}])
def test_a_box_of_one_s_own_is_no_preset(before):
    own = changed(before, {"workspace": {"max": (1.0, 1.0, 3.0)}}).workspace
    assert (own.preset, own.min, own.max) == (None, RLBENCH_MIN_M, (1.0, 1.0, 3.0))


def test_a_preset_with_a_box_is_refused():
    with pytest.raises(ValidationError, match="leave out preset"):
        TaskSettings.model_validate({"workspace": {"preset": "rlbench", **BOX}})


def test_what_a_task_answers_can_be_sent_back(nearest):
    for place_m in ((0.3, 0.1, 0.02), (1.4, 0.1, 0.02)):
        nearest.upload_episode(upload("cube", place_m=place_m))
    with nearest.store.read() as connection:
        answered, stored = TaskSettings.of(connection, "pick"), tasks.get(connection, "pick").settings
    assert (answered.workspace.preset, answered.workspace.max[0] >= 1.5) == ("auto", True)
    assert answered.changed(settings(**answered.model_dump(mode="json"))).stored() == stored
    assert stored["workspace"] == {"preset": "auto"}
    wider = answered.changed({"workspace": {"max": (3.0, 3.0, 3.0)}}).workspace
    assert (wider.preset, wider.min) == (None, answered.workspace.min)
