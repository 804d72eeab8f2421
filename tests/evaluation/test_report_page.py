"""A report of a small real run: the service in a process of its own, the regression in place of an LLM."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from urllib.parse import urlsplit

import pytest
from PIL import Image

from app.evaluation.methods import Method
from app.evaluation.report.page import MAX_FAILURES, write_report
from app.evaluation.results import Evaluation, TaskEvaluation, Trial
from app.evaluation.sweeps import REPLAY
from app.sim.demonstrate import record_demonstration, rollout, view_scene
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from tests.e2e.processes import running_server

TASK = "open_drawer"
METHOD = Method("regression", {"model": "regression"})
MARKUP = "<script>alert('a') & b</script>"
NUM_DEMONSTRATIONS = 4


class Page(HTMLParser):
    """What a page refers to, and its texts."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.links, self.images, self.ids, self.texts = set(), [], [], set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.add(tag)
        self.ids.add(attributes.get("id"))
        self.links += [attributes[name] for name in ("href", "src", "srcset") if name in attributes]
        if tag == "img":
            self.images.append(attributes)

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def evaluation(tmp_path_factory):
    environment = {"ROBOPROMPT_DEFAULT_MODEL": "regression"}
    with running_server(tmp_path_factory.mktemp("data"), environment) as url, RoboPromptClient(url) as client:
        for seed in range(NUM_DEMONSTRATIONS):
            teach(client, seed)
        solved, unsolved = trial(client, 100_000), trial(client, 100_001, execute_in=100_003)
    refused = replace(
        unsolved,
        scene=replace(unsolved.scene, instruction=MARKUP),
        answer=None,
        execution=None,
        error=f"502 the reply was {MARKUP}",
    )
    trials = (solved, refused, unsolved, *(replace(refused, seed=seed) for seed in range(MAX_FAILURES)))
    return Evaluation("roboprompt demo", (METHOD, REPLAY), (TaskEvaluation(TASK, trials),), 12.0)


def teach(client, seed):
    recorded = record_demonstration(TASK, seed, cameras=())
    client.upload(TASK, recorded.scene.instruction, recorded.trajectory, Observation(recorded.scene.objects))


def trial(client, seed, execute_in=None):
    """One prediction; with `execute_in` carried out on the scene of another seed."""
    scene = view_scene(TASK, seed)
    predicted = client.predict(TASK, scene.instruction, Observation(scene.objects), **METHOD.options)
    execution = rollout(TASK, execute_in or seed, predicted.actions, film_strip=True)
    return Trial(TASK, seed, METHOD.label, scene, predicted.response, execution=execution)


@pytest.fixture(scope="module")
def index(evaluation, tmp_path_factory):
    return write_report(evaluation, tmp_path_factory.mktemp("reports") / "new" / "report")


@pytest.fixture(scope="module")
def page(index):
    return Page(index)


def test_everything_that_the_page_links_to_is_in_the_folder(index, page):
    files = {link for link in page.links if not link.startswith("#")}
    assert index.name == "index.html"
    assert len(files) > 10
    for link in files:
        assert (index.parent / link).is_file(), link
    on_disk = {str(path.relative_to(index.parent)) for path in index.parent.rglob("*") if path.is_file()}
    assert on_disk == files | {"index.html"}
    assert {link[1:] for link in page.links if link.startswith("#")} <= page.ids


def test_nothing_comes_from_elsewhere(index, page):
    text = index.read_text(encoding="utf-8")
    assert not any(urlsplit(link).scheme or urlsplit(link).netloc for link in page.links)
    assert not re.search(r"https?:|url\(|@import", text)


def test_markup_in_texts_is_shown_and_not_obeyed(page):
    assert "script" not in page.tags
    assert page.texts.count(MARKUP) >= MAX_FAILURES
    assert any(f"502 the reply was {MARKUP}" in text for text in page.texts)


def test_images_are_described_and_have_their_size(index, page):
    for image in page.images:
        assert len(image["alt"]) > 20
        with Image.open(index.parent / image["src"]) as file:
            assert file.size == (int(image["width"]), int(image["height"]))


def test_successes_come_first_and_failures_beyond_the_detailed_are_listed(evaluation, page):
    badges = [text for text in page.texts if text in ("failed", "solved")]
    assert badges == ["solved"] + ["failed"] * MAX_FAILURES
    assert any(f"{MAX_FAILURES} of {MAX_FAILURES + 2} failed trials in detail" in text for text in page.texts)
    assert {str(failed.seed) for failed in evaluation.tasks[0].trials[1:]} <= set(page.texts)  # cells of the list


def test_prompt_reply_and_figures_are_shown(evaluation, page):
    solved = evaluation.tasks[0].trials[0]
    text = "".join(page.texts)
    for shown in (solved.answer["prompt"]["user"], solved.answer["reply_text"], "1/15", "roboprompt demo", "12 s"):
        assert shown in text


def test_a_bar_shows_each_success_rate_and_a_line_its_interval(index):
    bars = re.findall(r'<rect width="(\d+)".*?<path d="M(\d+) 4H(\d+)"', index.read_text(encoding="utf-8"))
    assert bars == [("7", "1", "30"), ("0", "0", "100")]  # 1 of 15 by the regression, no trial of the replay


def test_a_run_without_trials(evaluation, tmp_path):
    page = Page(write_report(replace(evaluation, tasks=(TaskEvaluation(TASK, ()),)), tmp_path))
    assert any("None in 0 trials" in text for text in page.texts)
    assert page.images == []


def test_the_film_of_a_success_is_at_the_top(index):
    above, _, _ = index.read_text().partition("<main>")
    (film,) = re.findall(r'<img src="([^"]*)"', above)
    assert "success-01-film" in film
