"""What each group of rules costs a prediction, in microseconds of CPU time: `python -m benchmarks.findings_time`.

Asked is a task with ten demonstrations of two objects. What depends on the demonstrations alone is computed once for
each version of a task.
"""

import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from app.evaluation.server import service
from app.pipeline.episode import Query
from app.pipeline.findings.actions import passing_findings
from app.pipeline.findings.demonstrated_scenes import ShownScenes
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.frames import frame_findings, held_findings, source_findings, start_findings
from app.pipeline.findings.gripper import hand_findings
from app.pipeline.findings.outliers import answer_findings, elsewhere_findings
from app.pipeline.findings.quaternion_order import objects_order_findings
from app.pipeline.findings.scatter import scatter_findings
from app.pipeline.findings.scene import scene_findings
from app.pipeline.findings.several_ways import ways_findings
from app.pipeline.findings.yaw import turning_findings
from app.services.cache import Cache
from app.services.predict.demonstrations import TaskReading
from app.store.store import Store
from benchmarks import scenes, service_time
from roboprompt_client.types.poses import Pose

TIMES = 50
HAND = Pose((0.1, 0.0, 1.2), (1.0, 0.0, 0.0, 0.0))


def measure() -> dict[str, float]:
    """Return CPU microseconds by group: first those of each prediction, then those of each version of a task."""
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as folder:
        data = Path(folder)
        with service(warm_up=False, data=data) as client:
            scenes.teach(client, service_time.TASK, service_time.NUM_DEMONSTRATIONS)
        store = Store.open(data)
        with store.read() as connection:
            taught = TaskReading(connection, service_time.TASK, Cache(1)).taught(True)
        store.close()
    return {name: _microseconds(rules) for name, rules in {**_of_each(taught), **_of_a_version(taught)}.items()}


def _of_each(taught: Taught) -> dict[str, Callable[[], Iterable[object]]]:
    shown, support = taught.demonstrations, taught.support
    seen = Query(scenes.INSTRUCTION, scenes.observation(1000).objects)
    followed, needed, hands = taught.followed(seen.order), taught.needed, taught.hands
    actions = [row.action for row in (support.placed(seen) or ())[0]]
    return {
        "scene and arrangement": lambda: scene_findings(seen, taught.scenes, followed, needed),
        "sources of poses": lambda: source_findings(seen.objects, shown, taught.compared),
        "the hand's start and frame": lambda: (
            *start_findings(HAND, taught.scenes),
            *frame_findings(HAND, shown, hands),
            *held_findings(HAND, seen, shown, hands),
        ),
        "demonstrations, known": lambda: taught.findings(seen.order),
        "actions that pass close": lambda: passing_findings(seen, actions, taught.scenes),
        "answers of few demonstrations": lambda: answer_findings(support, seen, actions, taught.round_objects),
    }


def _of_a_version(taught: Taught) -> dict[str, Callable[[], Iterable[object]]]:
    shown, support, order = taught.demonstrations, taught.support, taught.demonstrations[0].order
    none = [0.0] * len(shown)
    return {
        "once: ranges and arrangements": lambda: [*ShownScenes(shown).pairs, *ShownScenes(shown).sides],
        "once: scatter": lambda: scatter_findings(support, order),
        "once: turning": lambda: turning_findings(support, order),
        "once: several ways": lambda: ways_findings(shown, taught.hands, frozenset(), declared=False),
        "once: elsewhere": lambda: elsewhere_findings(shown, none, [False] * len(shown), declared=False),
        "once: hand and gripper": lambda: hand_findings(shown, taught.hands),
        "once: order of quaternions": lambda: objects_order_findings(shown),
    }


def _microseconds(rules: Callable[[], Iterable[object]]) -> float:
    spent_s = []
    for _ in range(TIMES):
        started_s = time.process_time()
        tuple(rules())
        spent_s.append(time.process_time() - started_s)
    return 1e6 * float(np.median(spent_s))


if __name__ == "__main__":
    for name, microseconds in measure().items():
        print(f"{name}: {microseconds:.0f}")  # noqa: T201
