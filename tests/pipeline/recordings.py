"""Motions in continuous time that can be recorded at any rate, as people and scripts make them."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from roboprompt_client.types.trajectory import Trajectory

DOWN = Rotation.from_euler("x", 180, degrees=True)
RAD_S_PER_M_S = 2.0  # of a joint for each axis, as of a gantry
TREMOR_RAD_S = (7.3, 9.1, 11.7)
BLENDED = 31
STEP_S = 1e-4


@dataclass(frozen=True)
class ScriptedMotion:
    """A hand that passes places at times, and turns.

    Attributes:
        knots: (time in s, position in m) from time 0 on; two at one place are a rest.
        turns: (time in s, angle about the vertical in degrees); the hand stops turning at each.
        switches: times at which the gripper opens or closes.
        starts_open: the gripper at first.
        blend_s: the hand moves steadily from knot to knot and passes each in a curve that takes so long; 0: it slows
            down and comes to rest where it turns.
        tremor_m: of the hand.
        rest_s: the length of rests.
    """

    knots: tuple
    turns: tuple = ()
    switches: tuple = ()
    starts_open: bool = True
    blend_s: float = 0.0
    tremor_m: float = 0.0
    rest_s: float = 0.0

    @property
    def duration_s(self):
        return self.knots[-1][0]

    def positions_m(self, times_s):
        knot_times_s, places_m = zip(*self.knots, strict=True)
        places_m = np.array(places_m, dtype=float)
        if self.blend_s:
            moments_s = times_s[:, None] + np.linspace(-0.5, 0.5, BLENDED) * self.blend_s
            axes = [np.interp(moments_s, knot_times_s, axis).mean(axis=1) for axis in places_m.T]
            smooth_m = np.stack(axes, axis=1)
        else:
            smooth_m = PchipInterpolator(knot_times_s, places_m)(times_s)
        return smooth_m + self.tremor_m * np.sin(np.outer(times_s, TREMOR_RAD_S))

    def rotations(self, times_s):
        if not self.turns:
            return Rotation.concatenate([DOWN] * len(times_s))
        turn_times_s, angles_deg = zip(*self.turns, strict=True)
        angles_deg = PchipInterpolator(turn_times_s, angles_deg)(np.clip(times_s, turn_times_s[0], turn_times_s[-1]))
        return Rotation.from_euler("z", angles_deg[:, None], degrees=True) * DOWN

    def grippers(self, times_s):
        switched = np.searchsorted(np.array(self.switches), times_s + 1e-9, side="right")
        return (switched % 2 == 0) == self.starts_open

    def recorded(self, times_s):
        """The trajectory at these times, with them."""
        times_s = np.asarray(times_s, dtype=float)
        before_s, after_s = np.maximum(times_s - STEP_S, 0), np.minimum(times_s + STEP_S, self.duration_s)
        way_m = self.positions_m(after_s) - self.positions_m(before_s)
        turn_rad = (self.rotations(before_s).inv() * self.rotations(after_s)).as_rotvec()
        speeds = np.zeros((len(times_s), 7))
        speeds[:, :3] = RAD_S_PER_M_S * way_m / (after_s - before_s)[:, None]
        speeds[:, 4:] = turn_rad / (after_s - before_s)[:, None]
        return Trajectory(
            speeds,
            self.positions_m(times_s),
            self.rotations(times_s).as_quat(),
            self.grippers(times_s),
            timestamps_s=times_s,
        )

    def held(self, at_s, for_s):
        """With a pause."""
        here_m = tuple(self.positions_m(np.array([at_s]))[0])
        before = [knot for knot in self.knots if knot[0] < at_s]
        after = [(time_s + for_s, place_m) for time_s, place_m in self.knots if time_s > at_s]
        switches = tuple(time_s if time_s <= at_s else time_s + for_s for time_s in self.switches)
        return replace(self, knots=(*before, (at_s, here_m), (at_s + for_s, here_m), *after), switches=switches)

    def at(self, hz):
        """Recorded at a steady rate, the last moment included."""
        return self.recorded(np.linspace(0, self.duration_s, round(self.duration_s * hz) + 1))

    def irregular(self, hz, seed):
        """Recorded at about this rate, every period up to 60 % longer or shorter."""
        random = np.random.default_rng(seed)
        number = round(self.duration_s * hz)
        periods_s = random.uniform(0.4, 1.6, number)
        times_s = np.concatenate([[0.0], np.cumsum(periods_s)])
        return self.recorded(times_s / times_s[-1] * self.duration_s)


def flowing(stops_m, speed_m_s=0.15, **more):
    """Through the stops at one speed, without a rest."""
    return ScriptedMotion(_timed(stops_m, speed_m_s), **{"blend_s": 0.3, **more})


def resting(stops_m, speed_m_s=0.25, rest_s=0.4, **more):
    """From stop to stop with a rest at each, as scripts move."""
    return ScriptedMotion(_timed(stops_m, speed_m_s, rest_s), rest_s=rest_s, **more)


def _timed(stops_m, speed_m_s, rest_s=0.0):
    knots = [(0.0, tuple(stops_m[0]))]
    for before, after in pairwise(stops_m):
        arrives_s = knots[-1][0] + np.linalg.norm(np.subtract(after, before)) / speed_m_s
        knots.append((float(arrives_s), tuple(after)))
        if rest_s:
            knots.append((float(arrives_s + rest_s), tuple(after)))
    return tuple(knots)


def arrival_s(motion, place_m, nth=0):
    """When the motion has come to a place for the nth time (from 0), rests counting once."""
    times_s = [time_s for time_s, at_m in motion.knots if np.allclose(at_m, place_m)]
    return times_s[nth]


def pick_and_place(pick_m, place_m, move=flowing, above_m=0.12, start_m=(0.1, 0.0, 1.1), **more):
    """Over an object, down, closed, up, over a place, down, opened, up."""
    up_m = np.array([0, 0, above_m])
    pick_m, place_m = np.array(pick_m), np.array(place_m)
    stops_m = [np.array(start_m), pick_m + up_m, pick_m, pick_m + up_m, place_m + up_m, place_m, place_m + up_m]
    motion = move(stops_m, **more)
    rest_s = motion.rest_s
    switches = tuple(arrival_s(motion, at_m) + rest_s / 2 for at_m in (pick_m, place_m))
    return replace(motion, switches=switches)


def servoed(stops_m, switches, hz, speed_m_s, gain_per_s, near_m, rest_s):
    """A hand that a controller drives from stop to stop, as scripts in simulators do: it is seldom at rest.

    Args:
        switches: places among the stops at which the gripper switches.
        near_m: of a stop, where the next one becomes the goal.
        rest_s: of the hand where the gripper switches.
    """
    step_s = 0.002
    at_m, speed, is_open, rows = np.array(stops_m[0], dtype=float), np.zeros(3), True, []
    for place, stop_m in enumerate(stops_m[1:], start=1):
        left_s = rest_s if place in switches else 0.0
        while left_s > 0 or np.linalg.norm(stop_m - at_m) >= near_m:
            wanted = gain_per_s * (stop_m - at_m)
            wanted *= min(1.0, speed_m_s / max(np.linalg.norm(wanted), 1e-9))
            change = wanted - speed
            speed = speed + change * min(1.0, 3.0 * step_s / max(np.linalg.norm(change), 1e-9))
            at_m = at_m + speed * step_s
            if np.linalg.norm(stop_m - at_m) < near_m:
                left_s -= step_s
            rows.append((*at_m, *(RAD_S_PER_M_S * speed), is_open != (place in switches and left_s < 0.7 * rest_s)))
        is_open = is_open != (place in switches)
    rows = np.array(rows)[:: round(1 / hz / step_s)]
    speeds = np.concatenate([rows[:, 3:6], np.zeros((len(rows), 4))], axis=1)
    return Trajectory(speeds, rows[:, :3], np.tile(DOWN.as_quat(), (len(rows), 1)), rows[:, 6] > 0)
