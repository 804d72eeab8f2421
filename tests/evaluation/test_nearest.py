import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.evaluation.teach import TaughtEpisode
from app.evaluation.trials import replayed
from app.sim.outcomes import RecordedDemonstration, SceneView
from roboprompt_client.types.poses import ObjectPose, object_json
from roboprompt_client.types.trajectory import Trajectory

KEYFRAMES = [3, 5]


def cube(x_m, yaw_deg=0.0):
    return ObjectPose("cube", [x_m, 0, 0.8], Rotation.from_euler("z", yaw_deg, degrees=True).as_quat())


def taught(number, instruction, pose):
    """A demonstration whose keyframes, the frames 3 and 5, have x = `number`."""
    positions = np.full((6, 3), -1.0)
    positions[KEYFRAMES] = float(number)
    down = np.tile([1.0, 0, 0, 0], (6, 1))
    trajectory = Trajectory(np.ones((6, 7)), positions, down, np.ones(6))
    scene = SceneView("stack_cube", number, instruction, (pose,), (), {})
    recorded = RecordedDemonstration(scene, trajectory, 20.0, True, "")
    keyframes = [{"index": index} for index in KEYFRAMES]
    return TaughtEpisode(recorded, {"objects": [object_json(pose)], "keyframes": keyframes})


DEMONSTRATIONS = (
    taught(0, "stack", cube(0.0)),
    taught(1, "stack", cube(0.3)),
    taught(2, "stack", cube(0.0, 40)),
    taught(3, "destack", cube(0.1)),
)


@pytest.mark.parametrize(
    ("instruction", "pose", "symmetry", "nearest"),
    [
        ("stack", cube(0.05), {}, 0),
        ("stack", cube(0.2), {}, 1),
        ("stack", cube(0.05, 30), {}, 2),
        ("stack", cube(0.05, 90), {}, 2),
        ("stack", cube(0.05, 90), {"cube": 90.0}, 0),
        ("stack", cube(0.1), {}, 0),
        ("destack", cube(0.0), {}, 3),
        ("never shown", cube(0.1), {}, 3),
    ],
)
def test_the_nearest_scene_of_the_instruction(instruction, pose, symmetry, nearest):
    actions = replayed(DEMONSTRATIONS, instruction, [pose], symmetry)
    assert len(actions) == 2
    assert {action.position_m[0] for action in actions} == {nearest}
