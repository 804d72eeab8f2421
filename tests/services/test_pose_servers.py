import pytest

from app.services.poses import PoseServers
from roboprompt_client.errors import InvalidInputError

LISTED = ("https://gpu-box:9000/poses", "http://10.0.0.5/")


def check(prefixes, url):
    PoseServers(prefixes).check({"mug": {"estimator": "remote", "url": url}, "cube": {"estimator": "masks"}})


@pytest.mark.parametrize(
    ("prefixes", "url"),
    [
        ((), "http://127.0.0.1:8000/poses"),
        ((), "http://localhost/poses"),
        ((), "http://[::1]:9000/"),
        (LISTED, "https://gpu-box:9000/poses"),
        (LISTED, "https://gpu-box:9000/poses/mug"),
        (LISTED, "http://10.0.0.5:80/anything"),
    ],
)
def test_allowed(prefixes, url):
    check(prefixes, url)


@pytest.mark.parametrize(
    ("prefixes", "url"),
    [
        ((), "http://gpu-box:9000/poses"),
        ((), "http://169.254.169.254/latest/meta-data"),
        ((), "http://localhost.evil.example/"),
        ((), "http://127.0.0.1.evil.example/"),
        ((), "http://0.0.0.0/"),
        ((), "http://2130706433/"),
        ((), "http://[::ffff:10.0.0.1]/"),
        (LISTED, "http://127.0.0.1:8000/poses"),
        (LISTED, "http://gpu-box:9000/poses"),
        (LISTED, "https://gpu-box:9001/poses"),
        (LISTED, "https://gpu-box:9000/posesX"),
        (LISTED, "https://gpu-box:9000/poses/../admin"),
        (LISTED, "https://gpu-box:9000/poses/%2e%2e/admin"),
        (LISTED, "https://gpu-box.evil.example:9000/poses"),
    ],
)
def test_refused_with_the_setting_that_would_allow_it(prefixes, url):
    with pytest.raises(InvalidInputError, match="ROBOPROMPT_POSE_SERVERS") as caught:
        check(prefixes, url)
    assert caught.value.field == "object_models[mug].url"
