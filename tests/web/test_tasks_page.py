"""The first page: what was taught, and how it fares."""


def test_the_entrance_leads_to_the_tasks(page, seeded):
    page.goto("/")
    assert page.url.endswith("/ui/tasks")
    row = page.get_by_role("row", name="pick")
    assert row.locator("td[data-label=Episodes]").inner_text() == "4"
    assert row.locator("td[data-label=Success]").inner_text().split() == ["50", "%", "1", "of", "2", "1", "failure"]
    assert page.get_by_role("navigation").get_by_role("link", name="Tasks").get_attribute("aria-current") == "page"


def test_a_filter_narrows_the_list(page, http):
    page.goto("/ui/tasks")
    page.get_by_label("Name or object contains").fill("CUBE")
    page.keyboard.press("Enter")
    page.wait_for_url("**/ui/tasks?q=CUBE")
    assert page.get_by_role("row", name="pick").is_visible()
    assert not page.get_by_role("row", name="bare").is_visible()
    names = [(task["name"], *(task["object_names"] or [])) for task in http.get("/tasks").json()["tasks"]]
    found = [words for words in names if any("cube" in word for word in words)]
    assert page.get_by_role("status").inner_text() == f"{len(found)} of {len(names)} tasks"
    page.goto("/ui/tasks?q=<script>")
    assert "No task has “<script>”" in page.locator("main").inner_text()


def test_the_keyboard_reaches_the_content(page):
    page.goto("/ui/tasks")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
