"""Pictures for people: a film strip of each simulated task's expert on one page, and the whole method as a GIF.

The GIF shows what the LLM reads, what it replies, and the arm that carries it out. Run: ``python -m benchmarks.films``
writes docs/tasks and docs/images/film.gif.
"""

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.drawing import RgbImage
from app.evaluation.report.pictures import captions, film_grid, film_tiles
from app.evaluation.server import service
from app.evaluation.teach import TeachingError
from app.sim.demonstrate import judge, record_demonstration
from app.sim.moves import moves_from_actions
from app.sim.outcomes import RecordedDemonstration
from app.sim.rendering import CAMERA, open_renderer
from app.sim.robot import SimulatedPanda
from app.sim.tasks import TASKS, make_task
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction

DOCS = Path("docs")
JPEG_QUALITY = 80
MAX_TILES = 8
INTRODUCTION = """# The simulated tasks

MuJoCo counterparts of the paper's 16 RLBench tasks and 6 real-robot tasks, not RLBench itself. Objects are held by
friction alone. Each strip shows the expert on the scene of seed {seed}; `python -m benchmarks.films` makes this page.
"""

FILMED, UNSEEN_SEED, NUM_DEMONSTRATIONS = "stack_cube", 700_000, 5  # of the GIF
SHOT_S = 0.3  # of simulated time, between two pictures
FRAME_MS, ROW_MS, LAST_MS = 90, 300, 4000
SCENE_PX, TEXT_WIDTH_PX, MARGIN_PX = (480, 360), 500, 14
FONT_PX, LINE_PX, LINE_CHARS = 13, 18, 68
COLORS = 96
BACKGROUND, TITLE, TEXT, DONE = "#181c22", "#8fb8ff", "#c3c9d1", "#7fd18b"


def film_task(task: str, seed: int, folder: Path) -> RecordedDemonstration:
    """Let the expert solve the scene of a seed, and save TASK.jpg: at most eight pictures from first to last."""
    recorded = record_demonstration(task, seed, cameras=(), film_strip=True)
    images = recorded.film_strip
    tiles = film_tiles(images, captions(len(images), len(recorded.expert_actions)))
    shown = np.linspace(0, len(tiles) - 1, min(len(tiles), MAX_TILES)).round().astype(int)
    folder.mkdir(parents=True, exist_ok=True)
    strip = Image.fromarray(film_grid([tiles[k] for k in shown]))
    strip.save(folder / f"{task}.jpg", quality=JPEG_QUALITY, optimize=True)
    return recorded


def write_page(filmed: Mapping[str, RecordedDemonstration], seed: int, folder: Path) -> Path:
    """`README.md` in the folder: of each task the instruction, what its scene varies, and the strip."""
    page = folder / "README.md"
    sections = (_section(task, recorded) for task, recorded in filmed.items())
    page.write_text("\n".join([INTRODUCTION.format(seed=seed), *sections]))
    return page


def _section(task: str, recorded: RecordedDemonstration) -> str:
    names = ", ".join(pose.name for pose in recorded.scene.objects)
    about = inspect.getdoc(TASKS[task]) or ""
    return f"""## {task}

"{recorded.scene.instruction}" ({names})

{about}

![The expert solves {task}, from the first picture to the last]({task}.jpg)
"""


@dataclass(frozen=True)
class Asked:
    """A question to the service with its answer.

    Attributes:
        demonstrations: as the LLM reads them, a line each.
        query: the line that it continues.
        rows: of its reply.
    """

    demonstrations: tuple[str, ...]
    query: str
    rows: tuple[str, ...]
    actions: tuple[EndEffectorAction, ...]


def make_moving_picture(task: str, seed: int, num_demonstrations: int, path: Path) -> str:
    """Teach a service of its own, ask it about the scene of `seed`, carry out the answer, and save all that as a GIF.

    Returns:
        Why the scene was not solved; empty if it was.

    Raises:
        TeachingError: a demonstration failed.
        ServiceProblemError, ServiceUnreachableError: the service did not answer.
        MotionError: the arm could not carry an action out.
    """
    robot = SimulatedPanda(make_task(task, seed), cameras=())
    with service() as client:
        _teach(client, task, num_demonstrations)
        asked = _ask(client, task, robot)
    frames: list[Image.Image] = []
    with open_renderer(robot.task.model) as renderer:
        before = renderer.rgb(robot.task.data, CAMERA)
        frames += [draw_frame(before, asked, num_rows, 0) for num_rows in range(len(asked.rows) + 1)]
        durations_ms = [ROW_MS] * len(frames)
        frames += [
            draw_frame(image, asked, len(asked.rows), num_done)
            for image, num_done in _carry_out(robot, asked.actions, lambda: renderer.rgb(robot.task.data, CAMERA))
        ]
    durations_ms += [FRAME_MS] * (len(frames) - len(durations_ms) - 1) + [LAST_MS]
    # keeps the few pixels of colored text, unlike the default method
    first, *rest = [frame.quantize(COLORS, Image.Quantize.MAXCOVERAGE) for frame in frames]
    path.parent.mkdir(parents=True, exist_ok=True)
    first.save(path, save_all=True, append_images=rest, duration=durations_ms, loop=0, optimize=True)
    return judge(robot)


def _teach(client: RoboPromptClient, task: str, number: int) -> None:
    for seed in range(number):
        recorded = record_demonstration(task, seed, cameras=())
        if not recorded.succeeded:
            raise TeachingError(f"the expert failed in scene {seed} of {task}: {recorded.failure}")
        scene = recorded.scene
        rate_hz = recorded.control_frequency_hz
        seen = Observation(scene.objects)
        client.upload(task, scene.instruction, recorded.trajectory, seen, control_frequency_hz=rate_hz)


def _ask(client: RoboPromptClient, task: str, robot: SimulatedPanda) -> Asked:
    predicted = client.predict(task, robot.task.instruction, robot.observe())
    prompt, reply = predicted.response["prompt"], predicted.response["reply_text"]
    *demonstrations, query = prompt["user"].strip().splitlines()
    return Asked(tuple(demonstrations), query, tuple(row.strip() for row in reply.split(";")), predicted.actions)


def _carry_out(
    robot: SimulatedPanda, actions: Sequence[EndEffectorAction], shoot: Callable[[], RgbImage]
) -> list[tuple[RgbImage, int]]:
    """Pictures of the motion, each with the number of actions that were done by then."""
    pictures: list[tuple[RgbImage, int]] = []
    done: list[int] = []
    begun_s = robot.task.data.time

    def after_step() -> None:
        if robot.task.data.time - begun_s >= len(pictures) * SHOT_S:
            pictures.append((shoot(), len(done)))

    robot.after_step.append(after_step)
    robot.after_move.append(done.append)
    robot.perform(moves_from_actions(actions))
    robot.after_step.remove(after_step)
    return [*pictures, (shoot(), len(done))]


def draw_frame(image: RgbImage, asked: Asked, num_rows: int, num_done: int) -> Image.Image:
    """The scene; beside it what the LLM reads and the first rows of its reply, those in green that were carried out."""
    page = Image.new("RGB", (SCENE_PX[0] + TEXT_WIDTH_PX, SCENE_PX[1]), BACKGROUND)
    page.paste(Image.fromarray(image).resize(SCENE_PX), (0, 0))
    lines = [("The LLM reads the demonstrations,", TITLE), *_wrapped(asked.demonstrations[-1], TEXT)]
    lines += [
        (f"... ({len(asked.demonstrations)} of them), and what the robot sees,", TITLE),
        *_wrapped(asked.query, TEXT),
    ]
    lines += [("and goes on:", TITLE)]
    lines += [(row, DONE if k < num_done else TEXT) for k, row in enumerate(asked.rows[:num_rows])]
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(FONT_PX)
    for k, (text, color) in enumerate(lines):
        draw.text((SCENE_PX[0] + MARGIN_PX, MARGIN_PX + k * LINE_PX), text, color, font)
    return page


def _wrapped(text: str, color: str) -> list[tuple[str, str]]:
    return [(line, color) for line in wrap(text, LINE_CHARS)]


def main() -> None:
    """Write them."""
    filmed = {task: film_task(task, 0, DOCS / "tasks") for task in TASKS}
    write_page(filmed, 0, DOCS / "tasks")
    not_solved = {task: recorded.failure for task, recorded in filmed.items() if recorded.failure}
    failure = make_moving_picture(FILMED, UNSEEN_SEED, NUM_DEMONSTRATIONS, DOCS / "images/film.gif")
    if not_solved or failure:
        sys.exit(f"not solved: {not_solved or ''} {failure}")


if __name__ == "__main__":
    main()
