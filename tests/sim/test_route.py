import numpy as np
import pytest

from app.sim import panda
from app.sim.kinematics import Kinematics
from app.sim.moves import move_to, tool_down
from app.sim.planner import Planner
from app.sim.route import Pace, joined
from app.sim.world import BASE_POSITION_M, HOME_RAD, TIMESTEP_S

CORNERS_M = np.array([[0.10, -0.10, 0.95], [0.10, -0.10, 0.85], [0.30, -0.10, 0.85], [0.30, 0.15, 0.95]])
ON_LINE_M = 0.002


@pytest.fixture(scope="module")
def kinematics():
    return Kinematics(BASE_POSITION_M)


@pytest.fixture(scope="module")
def paths(kinematics):
    moves = [move_to(at, tool_down(), gripper_open=True, straight=at is not CORNERS_M[0]) for at in CORNERS_M]
    _, *lines = Planner(kinematics).plan(HOME_RAD, moves)
    return lines


def tool_m(kinematics, joints_rad):
    return np.array([kinematics.forward(joints).position_m for joints in joints_rad])


@pytest.mark.parametrize("within_m", [0.001, 0.01, 0.03])
def test_corners_are_passed_as_closely_as_asked(kinematics, paths, within_m):
    route = joined(paths, [within_m, within_m], kinematics)
    points = tool_m(kinematics, route.joints_rad)
    away_m = [np.linalg.norm(points - corner, axis=1).min() for corner in CORNERS_M]
    assert away_m[0] < 1e-3
    assert away_m[3] < 1e-3
    assert all(0.2 * within_m < distance_m < within_m + 1e-3 for distance_m in away_m[1:3])
    assert route.ends_m[:2] == pytest.approx([0.1, 0.3], abs=2e-3)
    assert (np.diff(route.along_m) > 0).all()


def test_between_its_corners_a_route_is_straight(kinematics, paths):
    route = joined(paths, [0.01, 0.01], kinematics)
    points = tool_m(kinematics, route.joints_rad)
    middle = (route.along_m > 0.15) & (route.along_m < 0.25)
    assert np.abs(points[middle][:, 1:] - CORNERS_M[1, 1:]).max() < ON_LINE_M


def test_a_corner_that_must_be_reached_is_an_end(kinematics, paths):
    route = joined(paths[:1], [], kinematics)
    assert np.linalg.norm(tool_m(kinematics, route.joints_rad[-1:]) - CORNERS_M[1]) < 1e-3
    assert route.length_m == pytest.approx(route.along_m[-1])


@pytest.fixture(scope="module")
def route(kinematics, paths):
    return joined(paths, [0.02, 0.01], kinematics)


def pace(route, speed_m_s=0.3):
    return Pace(route, np.full(len(route.along_m), speed_m_s), TIMESTEP_S)


def test_motions_stay_within_the_limits_up_to_the_jerk(route):
    motion = pace(route).motion
    rates = [np.diff(motion.positions_rad, n, axis=0) / TIMESTEP_S**n for n in (1, 2, 3)]
    limits = (panda.MAX_VELOCITY_RAD_S, panda.MAX_ACCELERATION_RAD_S2, panda.MAX_JERK_RAD_S3)
    for rate, limit, share in zip(rates, limits, (0.5, 0.5, 0.1), strict=True):
        assert (np.abs(rate) <= share * limit).all()
    assert np.abs(rates[0] - motion.velocities_rad_s[:-1]).max() < 0.02
    np.testing.assert_allclose(motion.positions_rad[[0, -1]], route.joints_rad[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(motion.velocities_rad_s[[0, -1]], 0, atol=1e-3)


def test_the_arm_is_nowhere_at_rest_but_at_the_ends(route):
    speeds = np.linalg.norm(pace(route).motion.velocities_rad_s, axis=1)
    inside = slice(round(0.3 / TIMESTEP_S), -round(0.3 / TIMESTEP_S))
    assert speeds[inside].min() > 0.1


def test_a_lower_speed_takes_longer(route):
    assert len(pace(route, 0.05).motion.positions_rad) > 2 * len(pace(route, 0.3).motion.positions_rad)


def test_the_row_of_a_place(kinematics, route):
    paced = pace(route)
    points = tool_m(kinematics, paced.motion.positions_rad[[paced.row_at(along_m) for along_m in (0.0, 0.2)]])
    assert paced.row_at(0.0) == 0
    assert np.linalg.norm(points - [CORNERS_M[0], [0.20, -0.10, 0.85]], axis=1).max() < ON_LINE_M
    assert paced.row_at(route.length_m) < len(paced.motion.positions_rad)
