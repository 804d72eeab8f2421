"""The findings of a question and of its answer: words, poses, demonstrations, scene, actions."""

from collections.abc import Iterator, Sequence

from app.perception.base import GIVEN
from app.pipeline.finding import Finding, finding
from app.pipeline.order.order import Order
from app.pipeline.order.roles import strangers
from app.services.poses import Compared
from app.services.predict.known import Known
from app.services.predict.part_reply import ActionDoubt
from roboprompt_client.types.poses import ObjectPose

LISTED = 3  # instructions that a sentence names


def of_objects(known: Known) -> Iterator[Finding]:
    """Yield what is known of the observed objects alone: others than demonstrations have, and uncertain poses."""
    new = [pose.name for pose in known.bystanders]
    if known.absent or new:
        message = (
            f"The scene has other objects than the demonstrations: missing {', '.join(known.absent) or 'none'}; new"
            f" {', '.join(new) or 'none'}. Neither the motion nor the instruction refers to them."
        )
        yield finding("unusual-scene", 1.0, message, "objects", missing=len(known.absent), new=len(new))
    for pose in known.observed:
        reason = f": {pose.reason}" if pose.reason else ""
        message = f"The pose of {pose.name} is uncertain ({pose.estimator}){reason}. Compare it with the picture."
        unsure = finding("uncertain-pose", pose.confidence, message, f"objects[{pose.name}]")
        if reason or unsure.severity != "info":
            yield unsure
        if pose.name in known.skills.needed and (other := _other_source(pose, known)) is not None:
            yield other


def _other_source(pose: ObjectPose, known: Known) -> Finding | None:
    """Return a doubt about a pose that is measured otherwise than demonstrations', unless both are known to agree."""
    sources = known.sources.estimators.get(pose.name, frozenset()) - {pose.estimator}
    compared = [item for item in known.sources.compared if item.given.name == pose.name]
    if not sources or (compared and all(item.agrees for item in compared)):
        return None
    now, then = _said(pose.estimator), " or ".join(map(_said, sorted(sources)))
    message = f"The pose of {pose.name} is {now}, those of demonstrations are {then}; {_differ(compared)}"
    only_said = not compared and pose.estimator == GIVEN
    return finding("uncertain-pose", 0.5 if only_said else 0.0, message, f"objects[{pose.name}]")


def _said(source: str) -> str:
    return "given" if source == GIVEN else f"found in images ({source})"


def _differ(compared: Sequence[Compared]) -> str:
    if not compared:
        return "whether both mean the same point and axes is not known: upload an episode with both."
    off_cm, off_deg = 100 * max(item.off_m for item in compared), max(item.off_deg for item in compared)
    return (
        f"where episodes have both, they differ by up to {off_cm:.1f} cm and {off_deg:.0f} degrees: give poses of the"
        " same point and axes, or use one source for all."
    )


def of_words(order: Order, shown: Sequence[str]) -> Iterator[Finding]:
    """Yield what is new about an instruction; `shown` are those of demonstrations."""
    taught = tuple(dict.fromkeys(shown))
    if order.unfamiliar is not None:
        yield finding("new-instruction", 0.0, f"{order.unfamiliar}; it was passed on to the LLM.", "instruction")
    elif taught and order.text not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {order.text!r}; they have {listed}."
        roles = list(strangers(order, taught))
        for role in roles:
            there = ", ".join(map(repr, role.instead_of[:LISTED]))
            message += f" {role.name!r} stands where they have {there}, another kind of thing: the motion is theirs."
        p = min((0.0 if role.named_elsewhere else 0.5 for role in roles), default=1.0)
        yield finding("new-instruction", p, message, "instruction")


def of_actions(found: Sequence[ActionDoubt]) -> Iterator[Finding]:
    """Yield at most one finding for the unsupported actions and one for those within the margin."""
    unsupported = [item for item in found if item.unsupported is not None]
    straying = [item for item in found if item.unsupported is None]
    if unsupported:
        message = f"{_named(unsupported)} unlike every demonstration. {unsupported[0].unsupported}."
        yield finding("unusual-action", 0.0, message, f"actions[{unsupported[0].index}]", num_actions=len(unsupported))
    if straying:
        off_deg, worst = max(item.off_deg for item in straying), max(straying, key=lambda item: item.off_m)
        message = (
            f"{_named(straying)} up to {100 * worst.off_m:.1f} cm and {off_deg:.0f} degrees outside of the demonstrated"
            f" range, relative to {worst.seen_from}."
        )
        numbers = {"num_actions": len(straying), "off_m": worst.off_m, "off_deg": off_deg}
        yield finding("unusual-action", 1.0, message, f"actions[{straying[0].index}]", **numbers)


def _named(found: Sequence[ActionDoubt]) -> str:
    numbers = ", ".join(str(item.index + 1) for item in found)
    return f"Actions {numbers} are" if len(found) > 1 else f"Action {numbers} is"
