"""Upload by drag and drop, and by choosing."""

import json

import pytest
from playwright.sync_api import expect

from tests.episodes import arrays, camera, film_npz, metadata, npz, pick_trajectory
from tests.web.conftest import PLACES_M, picture


def parts(task, place_m):
    """The files of one demonstration by name."""
    document = metadata(task, {"cube": place_m}, cameras=[camera()])
    return {
        "metadata.json": json.dumps(document).encode(),
        "trajectory.npz": npz(**arrays(pick_trajectory(place_m))),
        "rgb_front.jpg": picture(60),
        "film_side.npz": film_npz([0.0, 0.5]),
    }


def write(folder, files):
    folder.mkdir(parents=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)


def drop(page, *paths):
    """As the browser gets it from a file manager."""
    box = page.locator("#drop").bounding_box()
    devtools = page.context.new_cdp_session(page)
    dragged = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        event = {"type": kind, "x": box["x"] + 20, "y": box["y"] + 20, "data": dragged}
        devtools.send("Input.dispatchDragEvent", event)


def test_dropped_files_become_an_episode(page, http, tmp_path):
    write(tmp_path / "files", parts("dropped", PLACES_M[0]))
    page.goto("/ui/upload")
    drop(page, *(tmp_path / "files").iterdir())
    expect(page.locator("#summary")).to_have_text("1 stored.")
    page.get_by_role("link", name="“pick up the cube” of dropped").click()
    page.wait_for_url("**/ui/episodes/*")
    (episode,) = http.get("/episodes", params={"task": "dropped"}).json()["episodes"]
    assert page.url.endswith(episode["id"])
    assert episode["cameras"] == ["front"]
    assert http.get(f"/episodes/{episode['id']}").json()["films"] == ["side"]


def test_a_folder_of_folders_is_sent_in_order(page, http, tmp_path):
    for number, place_m in ((10, PLACES_M[2]), (2, PLACES_M[1]), (1, PLACES_M[0])):
        write(tmp_path / "session" / f"episode{number}", parts("folders", place_m))
    (tmp_path / "session" / "notes.txt").write_text("a good day")
    page.goto("/ui/upload")
    page.get_by_label("Choose a folder").set_input_files(tmp_path / "session")
    expect(page.locator("#summary")).to_contain_text("3 stored.")
    expect(page.locator("#summary li")).to_have_text(
        "session/notes.txt: its name is not that of a demonstration's file"
    )
    newest_first = http.get("/episodes", params={"task": "folders"}).json()["episodes"]
    places_m = [episode["objects"][0]["position"] for episode in newest_first]
    assert places_m == [list(place_m) for place_m in (PLACES_M[2], PLACES_M[1], PLACES_M[0])]


def test_a_json_file_is_an_episode_too(page, http, tmp_path):
    trajectory = {name: array.astype(float).tolist() for name, array in arrays(pick_trajectory(PLACES_M[0])).items()}
    document = {"metadata": metadata("by json", {"cube": PLACES_M[0]}), "trajectory": trajectory}
    (tmp_path / "one.json").write_text(json.dumps(document))
    page.goto("/ui/upload")
    page.get_by_label("Choose files").set_input_files(tmp_path / "one.json")
    expect(page.locator("#summary")).to_have_text("1 stored.")
    assert http.get("/tasks/by json").json()["num_episodes"] == 1


def test_the_sample_can_be_uploaded(page, http, tmp_path):
    page.goto("/ui/upload")
    links = page.locator("details a[download]")
    files = {link.inner_text(): page.request.get(link.get_attribute("href")).body() for link in links.all()}
    write(tmp_path / "sample", files)
    page.get_by_label("Choose files").set_input_files(list((tmp_path / "sample").iterdir()))
    expect(page.locator("#summary")).to_have_text("1 stored.")
    (episode,) = http.get("/episodes", params={"task": "sample"}).json()["episodes"]
    assert (episode["num_frames"], episode["cameras"]) == (152, ["front"])
    assert http.get("/ui/sample/other.npz").status_code == 404


def test_the_form_of_the_documentation_sends_an_image(page, http, tmp_path):
    for name in ("trajectory.npz", "rgb_front.jpg"):
        (tmp_path / name).write_bytes(http.get(f"/ui/sample/{name}").content)
    page.goto("/docs#/episodes/upload_episode")
    operation = page.locator("#operations-episodes-upload_episode")
    operation.get_by_role("button", name="Try it out").click()
    operation.get_by_label("Request content type").select_option("multipart/form-data")
    metadata = operation.locator("textarea")
    metadata.fill(metadata.input_value().replace('"sample"', '"by form"'))
    for part, name in (("trajectory", "trajectory.npz"), ("rgb_front", "rgb_front.jpg")):
        row = operation.locator("tr.parameters", has=page.locator(".parameter__name", has_text=part))
        row.locator("input[type=file]").set_input_files(tmp_path / name)
    operation.get_by_role("button", name="Execute").click()
    expect(operation.locator(".live-responses-table .response-col_status").last).to_contain_text("201")
    (episode,) = http.get("/episodes", params={"task": "by form"}).json()["episodes"]
    assert episode["cameras"] == ["front"]


def test_refusals_stand_beside_the_file(page, http, tmp_path):
    page.expected_refusals = [422]
    write(tmp_path / "both" / "bad", {**parts("refused", PLACES_M[0]), "rgb_back.jpg": picture(60)})
    write(tmp_path / "both" / "good", parts("refused", PLACES_M[0]))
    page.goto("/ui/upload")
    page.get_by_label("Choose a folder").set_input_files(tmp_path / "both")
    expect(page.locator("#summary")).to_contain_text("1 stored, 1 refused")
    refused = page.get_by_role("listitem").filter(has_text="both/bad")
    expect(refused.get_by_role("alert")).to_contain_text("rgb_back: there is no camera 'back'")
    assert http.get("/tasks/refused").json()["num_episodes"] == 1


def test_a_dropped_folder_is_walked_through(page, http, tmp_path):
    for number in range(2):
        write(tmp_path / "day" / "robot" / f"episode{number}", parts("walked", PLACES_M[number]))
    page.goto("/ui/upload")
    drop(page, tmp_path / "day")
    expect(page.locator("#summary")).to_have_text("2 stored.")
    assert http.get("/tasks/walked").json()["num_episodes"] == 2


def test_files_that_are_no_demonstration_are_named(page, tmp_path):
    files = {"holiday.txt": b"sun", "bad.json": b"{task", "half.json": b'{"metadata": {}}', "null.json": b"null"}
    write(tmp_path / "files", {**files, "rgb_front.png": b"-"})
    page.goto("/ui/upload")
    drop(page, tmp_path / "files")
    said = page.get_by_role("alert")
    expect(said).to_contain_text("holiday.txt: its name is not that of a demonstration's file")
    expect(said).to_contain_text("bad.json: it is not JSON: ")
    expect(said).to_contain_text("half.json: it has no trajectory")
    expect(said).to_contain_text("null.json: it has no metadata and no trajectory")
    expect(said).to_contain_text("rgb_front.png: metadata.json with trajectory.npz is not beside it")


@pytest.mark.parametrize(("scheme", "width"), [pytest.param("light", 1280, marks=pytest.mark.long), ("dark", 360)])
def test_it_can_be_read_by_everyone(page, check_accessibility, scheme, width):
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/ui/upload")
    check_accessibility(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
