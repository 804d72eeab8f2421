"""What is doubtful about a prediction before its LLM is asked, causes first: its demonstrations, words and scene.

With what a reply adds, this is the one list that answers, stored predictions, pages and reports show.
"""

from collections.abc import Iterator, Mapping, Sequence

from app.pipeline.findings import Finding, Severity
from app.pipeline.language.grounded import Grounded
from app.pipeline.language.strangers import strangers
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.prediction_findings import scatter_findings
from app.pipeline.scene_findings import scene_findings
from app.services.predict.prefix import Prefix
from app.store.records import PredictionStatus
from roboprompt_client.trajectory import ObjectPose

LISTED = 3  # instructions that a sentence names
FAILURES: Mapping[PredictionStatus, tuple[str, str, str]] = {
    "parse_error": ("unparsable-reply", "reply", "The reply is not a list of valid actions"),
    "unsafe_action": ("unsafe-action", "actions", "An action breaks a bound of motion"),
    "unsupported": ("unsupported-action", "actions", "The demonstrations do not support an action"),
    "model_error": ("model-failed", "reply", "The LLM did not answer"),
}


def findings_before(
    prefix: Prefix, grounded: Grounded, observed: Sequence[ObjectPose], plans: Sequence[PlacedPlan]
) -> tuple[Finding, ...]:
    """What deserves a look before the LLM is asked, causes first.

    Args:
        observed: the objects as they were found.
        plans: the demonstrated rows in their scene.
    """
    scene = scene_findings(observed, prefix.scenes, grounded.instruction)
    words = _words(grounded, prefix, [pose.name for pose in observed])
    return (*_other_tasks(prefix), *words, *scene, *scatter_findings(plans))


def failure_findings(status: PredictionStatus, error: str | None) -> tuple[Finding, ...]:
    """Why there are no actions; nothing for the status `ok`."""
    if status == "ok":
        return ()
    code, where, what = FAILURES[status]
    return (Finding(code, "danger", f"{what}: {error}. The robot got no actions.", where),)


def _other_tasks(prefix: Prefix) -> Iterator[Finding]:
    if others := prefix.other_tasks:
        listed = ", ".join(f"{name} ({number})" for name, number in others)
        message = (
            f"Nobody has shown this task: the prompt has demonstrations of {listed}, with objects of their own. No"
            " demonstrated plan holds the actions, only the bounds of motion do."
        )
        yield Finding("other-tasks-demonstrations", "danger", message)


def _words(grounded: Grounded, prefix: Prefix, names: Sequence[str]) -> Iterator[Finding]:
    taught = tuple(dict.fromkeys(prefix.instructions))
    if grounded.unfamiliar is not None:
        message = f"{grounded.unfamiliar}; it was passed on to the LLM."
        yield Finding("unfamiliar-instruction", "danger", message, "instruction")
    elif taught and grounded.instruction not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {grounded.instruction!r}; they have {listed}."
        yield Finding("new-instruction", "info", message, "instruction")
        yield from _new_roles(names, grounded.instruction, taught)


def _new_roles(names: Sequence[str], instruction: str, taught: Sequence[str]) -> Iterator[Finding]:
    for stranger in strangers(names, instruction, taught):
        shown = ", ".join(map(repr, stranger.instead_of[:LISTED]))
        severity: Severity = "danger" if stranger.named_elsewhere else "warning"
        message = (
            f"{stranger.name!r} stands where demonstrations have {shown}, another kind of thing: the motion is theirs."
        )
        yield Finding("new-role", severity, message, "instruction")
