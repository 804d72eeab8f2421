"""A case carried out: uploaded to a service, asked, and done in the simulation as the service says."""

import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from app.evaluation.world import World
from app.executors import Executor, call
from app.sim.outcomes import SceneView
from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.kinds import KINDS
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, UnsafeActionError
from roboprompt_client.robot import Observation
from roboprompt_client.types.trajectory import npz_from_trajectory

# What became of a case. `silent` is the defect: the robot moved, nothing warned it, and the motion failed.
Ending = Literal["refused at upload", "refused", "danger", "solved", "silent"]


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        seed: its demonstrations, its scene and what is wrong follow from it and the task.
        succeeded: whether the actions solved the scene, whatever the findings; False without actions.
        failure: why they did not, or why there are none.
        findings: of the answer, `code` and `severity`.
        upload_findings: of the recordings, each kind once.
        undetectable: see `benchmarks.adversary.undetectable`.
    """

    kind: str
    task: str
    seed: int
    ending: Ending
    succeeded: bool = False
    failure: str = ""
    findings: tuple[tuple[str, str], ...] = ()
    upload_findings: tuple[tuple[str, str], ...] = ()
    undetectable: bool = False

    @property
    def wrong(self) -> bool:
        """Whether the robot should not move by it unless the scene is solved all the same."""
        return KINDS[self.kind].wrong

    def to_json(self) -> dict[str, Any]:
        """As a line of the results."""
        return asdict(self)

    @classmethod
    def from_json(cls, line: Mapping[str, Any]) -> "Outcome":
        """The inverse of `to_json`."""
        pairs = {name: tuple(map(tuple, line[name])) for name in ("findings", "upload_findings")}
        return cls(**{**line, **pairs})


def ending_of(severities: Sequence[str], *, succeeded: bool) -> Ending:
    """What an answer with findings of these severities comes to: `run_task` stops for a danger alone."""
    if "danger" in severities:
        return "danger"
    return "solved" if succeeded else "silent"


def mutated(kind: str, case: Case, task: str, seed: int) -> Case | None:
    """The case with what the kind makes of it; equal arguments give equal cases. None where it offers no way to."""
    return KINDS[kind].mutation(case, np.random.default_rng((zlib.crc32(f"{kind}/{task}".encode()), seed)))


@dataclass
class Bench:
    """Carries cases out, one after the other.

    Attributes:
        scene: whose objects the cases tell of, rightly or not.
        seed: by which results name the scene.
        taught: what became of each set of recordings that was uploaded: findings, or the refusal.
    """

    client: RoboPromptClient
    executor: Executor
    world: World
    scene: SceneView
    seed: int
    taught: dict[str, list[dict[str, Any]] | ServiceProblemError | InvalidInputError] = field(default_factory=dict)

    def run(self, kind: str, case: Case) -> tuple[Outcome, Mapping[str, Any]]:
        """The outcome, and the document that the service answered the question with."""
        name = f"{self.scene.task}.{digest_of(case)}"
        lesson = self._teach(name, case)
        key = (kind, self.scene.task, self.seed)
        if isinstance(lesson, Exception):
            return Outcome(*key, "refused at upload", failure=str(lesson)), _problem(lesson)
        heard = kinds_of(lesson)
        try:
            seen = Observation(case.objects, end_effector=case.end_effector)
            predicted = self.client.predict(name, case.instruction, seen, **case.options)
        except (ServiceProblemError, InvalidInputError, UnsafeActionError) as error:
            return Outcome(*key, "refused", failure=str(error), upload_findings=heard), _problem(error)
        result = call(self.executor, self.world.execute, self.scene, predicted.actions)
        findings = kinds_of(predicted.findings)
        ending = ending_of([severity for _, severity in findings], succeeded=result.succeeded)
        outcome = Outcome(*key, ending, result.succeeded, result.failure, findings, heard)
        return outcome, predicted.response

    def _teach(self, name: str, case: Case) -> list[dict[str, Any]] | ServiceProblemError | InvalidInputError:
        if name not in self.taught:
            try:
                self.client.configure_task(name, **case.settings)
                uploads = [self._upload(name, item) for item in case.recordings]
                self.taught[name] = [finding for answer in uploads for finding in answer.get("findings", ())]
            except (ServiceProblemError, InvalidInputError) as error:
                self.taught[name] = error
        return self.taught[name]

    def _upload(self, name: str, item: Recording) -> dict[str, Any]:
        hertz = item.control_frequency_hz
        return self.client.upload(
            name, item.instruction, item.trajectory, Observation(item.objects), control_frequency_hz=hertz
        )


def kinds_of(findings: Sequence[Mapping[str, Any]]) -> tuple[tuple[str, str], ...]:
    """Code and severity of the findings, each kind once, in their order."""
    return tuple(dict.fromkeys((finding["code"], finding["severity"]) for finding in findings))


def digest_of(case: Case) -> str:
    """Equal for cases that teach the same, which a service is then taught once."""
    digest = hashlib.sha256(repr(sorted(case.settings.items())).encode())
    for item in case.recordings:
        poses = [
            (p.name, p.position_m.tolist(), p.quaternion_xyzw is not None and p.quaternion_xyzw.tolist())
            for p in item.objects
        ]
        digest.update(repr((item.instruction, item.control_frequency_hz, poses)).encode())
        digest.update(npz_from_trajectory(item.trajectory))
    return digest.hexdigest()[:16]


def _problem(error: Exception) -> Mapping[str, Any]:
    return error.problem if isinstance(error, ServiceProblemError) else {"error": str(error)}
