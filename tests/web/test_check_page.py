"""Whether a task's demonstrations predict each other, as people read it."""


def test_the_way_there(page, seeded):
    page.goto("/ui/tasks")
    page.get_by_role("link", name="Check pick", exact=True).click()
    page.wait_for_url("**/ui/tasks/pick/check")
    assert page.get_by_role("heading", level=1).inner_text() == "Do the demonstrations agree?"
    assert page.get_by_role("region", name="Rows of plan 1").get_by_role("row").count() > 2
    links = page.get_by_role("region", name="Demonstrations of plan 1").get_by_role("link")
    assert sorted(links.all_inner_texts()) == sorted(episode["id"][:8] for episode in seeded)


def test_a_task_without_episodes_says_what_to_do(page):
    page.expected_refusals = [409]
    page.goto("/ui/tasks/bare/check")
    assert "has no demonstrations: upload some" in page.get_by_role("alert").inner_text()
