"""The results as a page in Markdown."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from benchmarks.metaworld.scores import NOTHING, TaskResult, mean_success_rates, seconds


def markdown(found: Sequence[TaskResult], facts: Mapping[str, str]) -> str:
    """A page.

    Args:
        facts: how it was made, by what they are about.
    """
    taken = seconds([each for task in found for each in task.llm_seconds])
    llm = (
        f"A prediction of the LLM took {taken['median']:.1f} s (median), at most {taken['max']:.1f} s." if taken else ""
    )
    errors = "\n".join(_kinds(problem for task in found for problem in task.problems))
    parts = [
        table(found),
        llm,
        f"Errors, which count as failures:\n\n{errors}" if errors else "",
        "\n".join(f"- {name}: {value}" for name, value in facts.items()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def table(found: Sequence[TaskResult]) -> str:
    """Successes of trials, in Markdown, with columns of even width."""
    methods = list(found[0].trials)
    head = ["task", "demonstrations", "keyframes", *methods, "LLM, median s"]
    rows = [head, *(list(_cells(task)) for task in found)]
    means = mean_success_rates(found).values()
    rows.append(["mean", "", "", *(NOTHING if rate is None else f"{rate:.1%}" for rate in means), ""])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])])
    return "\n".join(_line(row, widths) for row in rows)


def _kinds(problems: Iterable[str]) -> Iterator[str]:
    """A line for each status and title, the most frequent first, with one of the details as an example."""
    examples: dict[str, str] = {}
    numbers: Counter[str] = Counter()
    for problem in problems:
        kind, _, detail = problem.partition("; ")
        numbers[kind] += 1
        examples.setdefault(kind, detail)
    for kind, number in numbers.most_common():
        yield f"- {number} x {kind}" + (f", for example: {examples[kind]}" if examples[kind] else "")


def _cells(task: TaskResult) -> Iterator[str]:
    yield task.task
    refused = len(task.taught.refused) if task.taught else 0
    yield f"{task.num_demonstrations}, {refused} refused" if refused else str(task.num_demonstrations)
    span = task.num_keyframes
    yield NOTHING if span is None else "-".join(map(str, sorted(set(span))))
    for method in task.trials:
        yield str(task.score(method))
    taken = seconds(task.llm_seconds)
    yield NOTHING if taken is None else f"{taken['median']:.1f}"


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(row, widths, strict=True)
    cells = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
    return f"| {' | '.join(cells)} |"
