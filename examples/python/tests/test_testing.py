"""Tests the golden files of `noctograph.testing` with a flight, and with changes that must fail."""

import json
import pathlib

import noctograph as nc
import pytest
from noctograph.testing import assert_golden

GOLDEN = pathlib.Path(__file__).parents[3] / "golden/python"
SCENE = nc.Scene(word="HI", seed=5, set={"camera.width_px": 240, "camera.height_px": 135})


def test_a_flight_is_the_golden_one():
    assert_golden(nc.photograph(SCENE).flights[0], GOLDEN / "hi")


@pytest.mark.parametrize("value", ["0", "no", "true", " 1"])
def test_only_1_blesses(tmp_path, monkeypatch, value):
    monkeypatch.setenv("NOCTOGRAPH_BLESS", "1")
    with pytest.warns(UserWarning, match="written anew"):
        assert_golden({"letters": [{"read": "H"}, {"read": "I"}]}, tmp_path / "golden")
    monkeypatch.setenv("NOCTOGRAPH_BLESS", value)
    with pytest.warns(UserWarning, match="only 1 blesses"), pytest.raises(AssertionError) as caught:
        assert_golden({"letters": [{"read": "H"}, {"read": "O"}]}, tmp_path / "golden")
    assert "letters[1].read: found O, wanted I" in str(caught.value) and "[0]" not in str(caught.value)


def test_what_moved_is_named_and_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shot, failures = nc.photograph(SCENE), tmp_path / "failures"
    goldens = {"photo": shot, "flight": shot.flights[0], "verdict": shot.verdict}
    with pytest.raises(AssertionError, match="NOCTOGRAPH_BLESS"):
        assert_golden(shot, tmp_path / "none")
    with monkeypatch.context() as blessed:
        blessed.setenv("NOCTOGRAPH_BLESS", "1")
        for name, product in goldens.items():
            with pytest.warns(UserWarning, match="written anew"):
                assert_golden(product, tmp_path / name)
    for name, product in goldens.items():
        assert_golden(product, tmp_path / name)
    later = nc.photograph(nc.Scene(SCENE, seed=6))
    assert_golden(later, tmp_path / "photo", most_flip=0.15, failures=failures)
    assert not failures.exists(), "another flight of the same word"
    for name, product in {"photo": later, "flight": later.flights[0], "verdict": later.verdict}.items():
        with pytest.raises(AssertionError, match="wanted"):
            assert_golden(product, tmp_path / name, failures=failures)
    assert [path.name for path in failures.iterdir()] == ["photo"]
    other = nc.photograph(nc.Scene(SCENE, word="HO"))
    with pytest.raises(AssertionError, match="read: found HO, wanted HI") as caught:
        assert_golden(other, tmp_path / "photo", most_flip=0.15, failures=failures)
    assert "mean FLIP: found" in str(caught.value)
    page = (failures / "photo/index.html").read_text()
    assert "read: found HO, wanted HI" in page
    for name in ("wanted", "found", "difference"):
        assert f"{name}.png" in page and (failures / f"photo/{name}.png").read_bytes().startswith(b"\x89PNG")
    small = nc.photograph(nc.Scene(SCENE, set={"camera.width_px": 120, "camera.height_px": 68}))
    with pytest.raises(AssertionError, match="size_px"):
        assert_golden(small, tmp_path / "photo", most_flip=0.01, failures=failures)
    with pytest.raises(nc.InputError, match="no picture"):
        assert_golden(shot.flights[0], tmp_path / "flight", most_flip=0.01)
    assert json.loads((tmp_path / "verdict/golden.json").read_text())["read"] == "HI"
