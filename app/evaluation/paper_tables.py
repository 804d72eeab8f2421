"""The paper's tables and ablations as plans: what each compares, on which tasks, in how many scenes.

The paper has four tables, and six ablations in its Figures 3 and 4. They share trials: RoboPrompt with its ten
demonstrations is in eight of them and is run once. The methods are the paper's own, absolute rows in its format,
without the service's guard against actions that no demonstration supports.

What is not here stays the paper's number alone: VoxPoser, the supervised methods, and the real robot, for which our
scenes stand in.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from app.evaluation.methods import Method
from app.evaluation.paper import REAL_TASKS, RLBENCH_TASKS, SUCCESS_PERCENT, mean_percent
from app.evaluation.plan import Plan
from app.evaluation.sweeps import DEMONSTRATIONS, INTERVALS, KAT, LONG_REPLIES, NOISE, PAPER, SYSTEM_PROMPTS
from app.evaluation.trials import PlannedTrial

ROBOPROMPT = "RoboPrompt"
# The paper has no guard: what the LLM says is carried out.
UNGUARDED = {"unsupported": "allow"}
# Recorded for every method, so that results of one table hold for the others whichever is run first.
STORED = max(DEMONSTRATIONS)
CUBES = ("stack_cube", "destack_cube")
SUPERVISED = ("destack_cube", "push_button_real")
RLBENCH_SCENES, REAL_SCENES = 25, 10  # a task


@dataclass(frozen=True)
class PaperTable:
    """One of the paper's comparisons.

    Attributes:
        name: as `--table` takes it.
        tasks: in the order of its columns.
        episodes: scenes a task.
        methods: that are run here; one whose label is in `published` stands beside it.
        published: the paper's success in percent by method and task; empty where it prints no column for each task.
        means: the paper's average success in percent by method, where it prints only that.
        note: what the reader has to know of it.
    """

    name: str
    title: str
    tasks: tuple[str, ...]
    episodes: int
    methods: tuple[Method, ...]
    published: Mapping[str, Mapping[str, float]]
    means: Mapping[str, float]
    note: str

    def trials(self, first_seed: int) -> Iterator[PlannedTrial]:
        """Its trials. A method's trials on a task follow each other, so that the LLM keeps their common prefix."""
        for task in self.tasks:
            for method in self.methods:
                for seed in range(first_seed, first_seed + self.episodes):
                    yield PlannedTrial(task, seed, method)


@dataclass(frozen=True)
class PaperPlan(Plan):
    """The trials of some tables, those of the first table first, none twice.

    Attributes:
        tables: at least one.
    """

    tables: tuple[PaperTable, ...] = ()

    def trials(self) -> Iterator[PlannedTrial]:
        """Every trial."""
        for _, planned in self.trials_by_table():
            yield planned

    def trials_by_table(self) -> Iterator[tuple[PaperTable, PlannedTrial]]:
        """Every trial, with the first table that needs it."""
        seen: set[tuple[str, int, str]] = set()
        for table in self.tables:
            for planned in table.trials(self.first_test_seed):
                if planned.key not in seen:
                    seen.add(planned.key)
                    yield table, planned


def paper_tables(models: Sequence[str]) -> tuple[PaperTable, ...]:
    """All tables.

    Args:
        models: names from `GET /models`, at least one; Table III compares them, the other tables have the first.
    """
    ours = _method(ROBOPROMPT, models[0], PAPER)
    kat = _method("KAT", models[0], KAT)
    llms = [_method(model, model, PAPER) for model in models]
    llms[0] = ours  # so that Table I's trials count here as well
    uniform = [_uniform(interval, models[0]) for interval in INTERVALS]
    shown = [_method(f"{n} demonstrations", models[0], {**PAPER, "num_demonstrations": n}) for n in DEMONSTRATIONS]
    shown[DEMONSTRATIONS.index(10)] = ours
    noisy = [replace(ours, label=f"noise x {scale:g}", noise=scale) for scale in NOISE]
    prompts = [
        _method(f"system prompt {name}", models[0], {**PAPER, "system_prompt": name}) for name in SYSTEM_PROMPTS[1:]
    ]
    tokens = _method("action tokens", models[0], {**PAPER, "representation": "action_tokens"})
    closed = replace(ours, label="closed loop", source="closed loop")
    return (
        _of_tasks("I", "Simulation results", RLBENCH_TASKS, RLBENCH_SCENES, (kat, ours), SUCCESS_PERCENT, NOT_RUN),
        _of_tasks("II", "Real-robot results", REAL_TASKS, REAL_SCENES, (kat, ours), SUCCESS_PERCENT, STANDS_IN),
        _of_means(
            "III", "Various LLMs with RoboPrompt", llms, LLMS, f"{AVERAGED} Other models are run with further --model."
        ),
        _of_tasks("IV", "Comparison to supervised methods", SUPERVISED, REAL_SCENES, (ours,), FRONTIER, BUTTONS),
        _of_means("3a", "Keyframe extraction vs. uniform sampling", [ours, *uniform], MAIN, KEYFRAMES_SAID),
        _of_means("3b", "Number of demonstrations", shown, MAIN, SHOTS_SAID),
        replace(
            _of_means("3c", "Pose estimation robustness", [ours, *noisy], {}, NOISE_SAID),
            tasks=CUBES,
            episodes=REAL_SCENES,
        ),
        _of_means("4a", "Action prediction vs. action tokens", [ours, tokens], MAIN, READ_OFF),
        _of_means("4b", "Open loop vs. closed loop", [ours, closed], MAIN, LOOP_SAID),
        _of_means("4c", "Different system prompts", [ours, *prompts], MAIN, READ_OFF),
    )


def limited(tables: Iterable[PaperTable], tasks: Sequence[str] | None, episodes: int | None) -> tuple[PaperTable, ...]:
    """The tables with some of their tasks and scenes; one without any of the tasks is left out.

    Args:
        tasks, episodes: None: as in the paper.
    """
    some = (
        replace(
            table,
            tasks=tuple(task for task in table.tasks if tasks is None or task in tasks),
            episodes=episodes or table.episodes,
        )
        for table in tables
    )
    return tuple(table for table in some if table.tasks)


def paper_plan(tables: Sequence[PaperTable], demonstrations: int, command: str, at_once: int, seed: int) -> PaperPlan:
    """The plan of the tables, of which there is at least one."""
    return PaperPlan(
        tuple(dict.fromkeys(task for table in tables for task in table.tasks)),
        tuple({method.label: method for table in tables for method in table.methods}.values()),
        max(table.episodes for table in tables),
        demonstrations,
        command,
        predictions_at_once=at_once,
        first_test_seed=seed,
        tables=tuple(tables),
    )


def _method(label: str, model: str, options: Mapping[str, object]) -> Method:
    return Method(label, {**options, **UNGUARDED, "model": model}, stored=STORED)


def _uniform(interval: int, model: str) -> Method:
    sampled = {"keyframes": {"rule": "uniform", "interval": interval}}
    return replace(_method(f"uniform {interval}", model, {**PAPER, **LONG_REPLIES}), settings=sampled)


def _of_tasks(
    name: str,
    title: str,
    tasks: tuple[str, ...],
    episodes: int,
    methods: Sequence[Method],
    published: Mapping[str, Mapping[str, float]],
    note: str,
) -> PaperTable:
    here = {method: row for method, row in published.items() if set(tasks) <= set(row)}
    return PaperTable(name, title, tasks, episodes, tuple(methods), here, {}, note)


def _of_means(name: str, title: str, methods: Sequence[Method], means: Mapping[str, float], note: str) -> PaperTable:
    return PaperTable(name, title, RLBENCH_TASKS, RLBENCH_SCENES, tuple(methods), {}, means, note)


# Table III, "Various LLMs with RoboPrompt": average success rate over the tasks of Table I
LLMS = {
    "Llama3-8B-Inst.": 28.3,
    "GPT-4o mini": 44.8,
    "Qwen2-7B-Inst.": 48.8,
    "GPT-4 Turbo": 51.8,
    "GPT-4o": 56.3,
}
# Table IV, "Comparison to supervised methods"
FRONTIER: Mapping[str, Mapping[str, float]] = {
    "Octo": dict(zip(SUPERVISED, (40, 20), strict=True)),
    "LLARVA": dict(zip(SUPERVISED, (100, 80), strict=True)),
    ROBOPROMPT: dict(zip(SUPERVISED, (80, 100), strict=True)),
}
MAIN = {ROBOPROMPT: mean_percent(ROBOPROMPT, RLBENCH_TASKS) or 0.0}

NOT_RUN = "VoxPoser is not run here, nor are the supervised RVT-2 and Act3D: their rows are the paper's alone."
STANDS_IN = (
    "The paper's numbers are from a real robot; simulated scenes stand in for it here. VoxPoser is not run here."
)
BUTTONS = (
    'The paper does not say which of its two button tasks "push buttons" is; here it is push_button_real, which has 90'
    " in its Table II. Octo and LLARVA are not run here."
)
AVERAGED = "The paper's averages are over the 16 tasks of its Table I, 25 scenes each."
READ_OFF = f"The paper shows a chart without numbers; RoboPrompt's is from its Table I. {AVERAGED}"
KEYFRAMES_SAID = f"{READ_OFF} Its text: keyframes are better than uniform sampling by nearly 20 points."
SHOTS_SAID = f"{READ_OFF} Its text: about 40 % with two demonstrations. RoboPrompt has ten."
NOISE_SAID = (
    "The paper shows a chart without numbers, from a real robot, as the average of two tasks. Noise is on"
    " demonstrations and tests, in multiples of 1.68 cm and 4.61 degrees."
)
LOOP_SAID = f"{READ_OFF} Its text: the closed loop gains 0.7 points. RoboPrompt is the open loop."
