import pytest

from app.pipeline.check import check_demonstrations
from app.pipeline.keyframes import KeyframeRule
from tests.pipeline.check.recordings import grasped_from, moved_as, recorded, released, shifted, slipped

MERGED = KeyframeRule("merged")


def codes(check):
    return [finding.code for finding in check.findings]


def test_clean_demonstrations_predict_each_other():
    check = check_demonstrations(recorded(8))
    assert check.findings == ()
    (plan,) = check.plans
    assert [row.objects for row in plan.rows] == [("cube",)] * 3 + [("plate",)] * 3
    assert [row.switches for row in plan.rows] == [False, True, False, False, True, False]
    for row in plan.rows:
        assert row.error.m < 0.001
        assert row.varies.m > 0.05
    assert plan.shown
    assert {episode.manner for episode in plan.episodes} == {"rests"}
    assert all(len(episode.errors) == 6 for episode in plan.episodes)


@pytest.mark.parametrize("flows", [(), range(8), (6, 7)])
def test_clean_demonstrations_give_no_warning_whatever_their_manner(flows):
    check = check_demonstrations(recorded(8, flows=flows))
    assert {finding.severity for finding in check.findings} <= {"info"}, check.findings


def test_errors_are_those_of_the_demonstration_left_out():
    recordings = recorded(8)
    recordings[4] = shifted(recordings[4], (0.0, 0.03, 0.0))
    (plan,) = check_demonstrations(recordings).plans
    by_id = {episode.id: episode for episode in plan.episodes}
    assert [off.m for off in by_id["e4"].errors] == pytest.approx([0.03] * 6, abs=0.002)
    assert max(off.m for off in by_id["e5"].errors) < 0.005
    assert {row.worst_id for row in plan.rows} == {"e4"}


def test_one_of_eight_with_another_plan_is_named():
    recordings = recorded(8)
    check = check_demonstrations([*recordings[:7], slipped(recordings[7])])
    assert codes(check) == ["demonstration-unlike-others"]
    assert check.unlike_ids == ("e7",)
    (finding,) = check.findings
    assert (finding.severity, finding.where, finding.numbers["others"]) == ("warning", "episodes[e7]", 7)
    assert "e7" in finding.message


def test_one_of_eight_that_goes_elsewhere_is_named():
    recordings = recorded(8)
    check = check_demonstrations([*recordings[:7], moved_as(recordings[7], recordings[0])])
    assert codes(check) == ["demonstration-unlike-others"]
    assert check.unlike_ids == ("e7",)
    assert check.findings[0].numbers["worst_cm"] > 5


@pytest.mark.parametrize(("missing", "rows"), [("cube", 3), ("plate", 3)])
def test_an_object_that_is_not_sent_is_found_missing(missing, rows):
    check = check_demonstrations(recorded(8, without=(missing,), instruction="tidy up"))
    assert codes(check) == ["row-follows-no-object"]
    (finding,) = check.findings
    assert finding.severity == "danger"
    assert finding.numbers["rows"] == rows
    assert finding.numbers["error_cm"] > 5


@pytest.mark.parametrize("noise_m", [0.02, 0.04])
def test_noisy_poses_are_measured(noise_m):
    check = check_demonstrations(recorded(8, noise_m=noise_m, seed=5))
    assert codes(check) == ["noisy-poses"]
    assert check.findings[0].numbers["scatter_cm"] == pytest.approx(100 * noise_m * 1.6, rel=0.4)


def test_a_rule_of_rests_misses_the_path_of_a_hand_that_flows():
    check = check_demonstrations(recorded(8, MERGED, flows=range(8)))
    assert codes(check) == ["keyframes-miss-the-path"]
    assert check.findings[0].numbers["recordings"] == 8
    assert "`auto`" in check.findings[0].message


def test_ways_that_no_half_of_the_demonstrations_share_are_no_common_plan():
    recordings = recorded(9)
    twice = [released(item, 8) for item in recordings[3:6]]
    thrice = [released(item, 8, 24) for item in recordings[6:]]
    check = check_demonstrations([*recordings[:3], *twice, *thrice])
    assert codes(check) == ["no-common-plan"]
    assert check.unlike_ids == ()


@pytest.mark.parametrize(
    ("sides_deg", "symmetry_deg"),
    [
        ((0, 90, 180, 270), 90),
        ((0, 180), 180),
        ((0, 5, -5, 8), None),
        ((0, 45, 90, 135), None),  # any side: nothing is the same
        ((0,) * 9 + (180,), None),  # one is a slip
    ],
)
def test_a_symmetry_that_grasps_show_is_suggested_with_its_number(sides_deg, symmetry_deg):
    recordings = [
        grasped_from(item, sides_deg[k % len(sides_deg)] + 3 * (-1) ** k, 20 * k) for k, item in enumerate(recorded(10))
    ]
    found = [f for f in check_demonstrations(recordings).findings if f.code == "object-may-be-symmetric"]
    assert [(f.where, f.numbers["symmetry_deg"]) for f in found] == (
        [] if symmetry_deg is None else [("yaw_symmetry_deg[cube]", symmetry_deg)]
    )
