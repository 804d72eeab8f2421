import sys

import pytest

from app.datasets.bounds import MissingPackageError
from app.datasets.rerun import write_rerun
from tests.datasets.parcels import parcels


def test_the_package_that_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingPackageError, match="pip install rerun-sdk"):
        write_rerun(tmp_path / "pick.rrd", parcels())
    assert list(tmp_path.iterdir()) == []
