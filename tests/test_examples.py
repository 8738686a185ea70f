"""The examples run, and find what they look for."""

import re
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name, capsys, monkeypatch, size):
    monkeypatch.setattr(sys, "argv", [name, str(size)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    return capsys.readouterr().out


def test_fractional_noise(capsys, monkeypatch):
    printed = run("fractional_noise", capsys, monkeypatch, 2048)
    variance, H = map(float, re.findall(r"variance ([\d.]+) .* H ([\d.]+)", printed)[0])
    # Of 2048 points the estimates have standard deviations of some 5 % and 0.015.
    assert variance == pytest.approx(2.0, rel=0.3)
    assert pytest.approx(0.8, abs=0.06) == H


def test_field_with_gaps(capsys, monkeypatch):
    printed = run("field_with_gaps", capsys, monkeypatch, 48)
    estimate, draw = map(float, re.findall(r"(?:estimate|draw) ([\d.]+)", printed))
    assert estimate < 0.1
    assert estimate < draw < 3 * estimate
