"""Campaigns: shares of those in Python, and the script that runs all of them through the night."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def module_of(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def test_redundant_rows_of_mechanisms_are_those_of_exact_arithmetic():
    mechanisms = module_of(ROOT / "tests/verdict/mechanisms.py")
    judged = [mechanisms.judge(seed) for seed in range(1, 61)]
    assert [fault for _, fault in judged if fault] == []
    assert sum(what == "right" for what, _ in judged) > 50
    # Next to its place a row of j7 has 1e-8 of a direction in which the next row lies.
    assert mechanisms.judge(8732) == ("right", "")


def test_a_mechanism_that_is_said_to_be_singular_is_held_against_its_neighbours():
    mechanisms = module_of(ROOT / "tests/verdict/mechanisms.py")
    # Four equal bars in a plane may fold; a pendulum may not.
    hinge = lambda a, b, *at: mechanisms.Joint("revolute", a, b, at, (0, 0, 1))  # noqa: E731
    folded = [(1, 0, 0), (3, 0, 0), (2, 0, 0)]
    joints = [hinge(-1, 0, 0, 0, 0), hinge(0, 1, 2, 0, 0), hinge(1, 2, 4, 0, 0), hinge(2, -1, 2, 0, 0)]
    rank = mechanisms.exact_rank([r for j in joints for r in mechanisms.velocity_rows(j, folded)])
    assert mechanisms.is_singular(folded, joints, rank)
    assert not mechanisms.is_singular(folded[:1], joints[:1], 5)


@pytest.fixture
def campaign(monkeypatch, tmp_path):
    script = module_of(ROOT / "scripts/campaign.py")
    program = tmp_path / "program"
    program.write_text('#!/bin/sh\n[ "$1" -ge 21 ] && { echo "WRONG seed $1: made up"; exit 1; }\necho "10 cases; 0 wrong"\n')
    program.chmod(0o755)
    chosen = script.Campaign("made-up", "numbers", "none", 10, (str(program), "SEED"))
    monkeypatch.setattr(script, "CAMPAIGNS", (chosen,))
    monkeypatch.setattr(script, "missing_of", lambda _: "")
    return script, chosen, tmp_path / "state"


def test_a_campaign_goes_on_from_its_last_seed_and_names_what_was_wrong(campaign):
    script, chosen, folder = campaign
    for seed, wrong in ((1, 0), (11, 0), (21, 1)):
        state = script.State(folder)
        assert state.take_seed(chosen) == seed
        state.note(chosen, script.run_share(chosen, seed, "", 60))
        assert json.loads((folder / "state.json").read_text())["made-up"]["wrong"] == wrong
    page = (folder / "page.md").read_text()
    assert "| made-up | 30 | 1 |" in page and "program 21`: 1 wrong" in page
    assert "made up" in (folder / "made-up-21.log").read_text()


def test_a_share_that_hangs_or_dies_is_wrong(campaign, tmp_path):
    script, chosen, _ = campaign
    for text, status in (("sleep 60", 124), ("kill -SEGV $$", -11)):
        program = tmp_path / "program"
        program.write_text(f"#!/bin/sh\n{text}\n")
        share = script.run_share(chosen, 1, "", 1)
        assert share["wrong"] == 1 and share["status"] == status


def test_campaigns_that_there_are_not_are_named(campaign, monkeypatch, capsys):
    script, _, folder = campaign
    monkeypatch.setattr(sys, "argv", ["campaign.py", "--only", "none", "--state", str(folder)])
    with pytest.raises(SystemExit) as end:
        script.main()
    assert end.value.code == 2
    assert "no campaign is called none" in capsys.readouterr().err
