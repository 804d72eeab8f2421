"""What the documentation promises holds on the running service."""

import re

import pytest

from app.api.schemas import examples, predictions, responses, tasks


@pytest.fixture(autouse=True)
def _alone(http):
    """A sentence that names no task is read against all of them, also against what other files taught this service."""
    for task in http.get("/tasks").json()["tasks"]:
        if task["object_names"] == ["red button"]:
            http.delete(f"/tasks/{task['name']}").raise_for_status()


def test_examples_can_be_sent_as_they_are(http):
    episode = http.post("/episodes", json=examples.EPISODE)
    assert episode.status_code == 201, episode.text
    assert http.put("/tasks/press", json=examples.TASK).status_code == 200
    prediction = http.post("/predict", json={**examples.PREDICT, "model": "embedded/gemma-3-270m"})
    assert prediction.status_code == 200, prediction.text
    assert len(prediction.json()["actions"]) == 3
    plan = http.post("/plans", json=examples.PLAN)
    assert plan.json() == {"steps": [{"task": "press", "instruction": "press the red button"}] * 2}, plan.text
    outcome = http.post(f"/predictions/{prediction.json()['id']}/outcome", json=examples.OUTCOME)
    assert outcome.status_code == 200, outcome.text
    edited = http.patch(f"/episodes/{episode.json()['id']}", json=examples.EDIT)
    assert edited.status_code == 200, edited.text
    tried = {**examples.TRY_MODEL, "episode_ids": [episode.json()["id"]]}
    assert http.post("/tasks/press/object_models/try", json=tried).status_code == 200


def test_examples_that_need_images_are_refused_for_the_lack_of_images_alone(http):
    http.post("/episodes", json=examples.EPISODE)
    bodies = {
        "/tasks/press/labels": (examples.LABEL, "there is no episode"),
        "/tasks/press/labels/learn": (examples.LEARN_LABELS, "label"),
        "/tasks/press/object_models/learn": (examples.LEARN, "images"),
        "/poses": (examples.POSES, "rgb_front"),
    }
    for path, (body, lacking) in bodies.items():
        problem = http.post(path, json=body).json()
        assert problem["status"] in (404, 422), problem
        assert lacking in problem["detail"], problem


def test_answers_are_what_their_schemas_say(http):
    http.post("/episodes", json=examples.EPISODE)
    predict = {**examples.PREDICT, "model": "nearest"}
    http.post("/episodes", json=examples.EPISODE)
    documents = {
        responses.EpisodePage: http.get("/episodes", params={"task": "press"}),
        tasks.TaskOut: http.get("/tasks/press"),
        tasks.TaskList: http.get("/tasks"),
        predictions.PredictionOut: http.post("/predict", json=predict),
        predictions.DryRunOut: http.post("/predict", json={**predict, "dry_run": True}),
        predictions.PlanOut: http.post("/plans", json=examples.PLAN),
        predictions.PredictionPage: http.get("/predictions"),
        responses.ModelList: http.get("/models"),
        responses.Health: http.get("/readyz"),
        responses.Problem: http.get("/episodes/none"),
    }
    for model, response in documents.items():
        extra = set(response.json()) - set(model.model_fields)
        assert not extra, (model, extra)
        model.model_validate_json(response.content)


def test_documentation_page_needs_no_other_host(http):
    page = http.get("/docs").text
    addresses = re.findall(r'<(?:link|script|img) [^>]*(?:src|href)="([^"]+)"', page)
    assert any("swagger-ui" in address for address in addresses)
    for address in addresses:
        assert address.startswith("/"), address
        assert http.get(address).status_code == 200
    assert "https://" not in page.replace("https://arxiv.org", "")
