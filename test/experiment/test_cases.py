"""Where the paper's parameter files are found."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from snake_control.config import load
from snake_control.experiment.cases import CASES, case_files, config_directory

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("case", CASES)
def test_files_of_a_case_configure_that_case(case):
    assert load(*case_files(case)).controller.case == case


def test_checkout_uses_its_own_files():
    assert config_directory() == ROOT / "config"


def test_installed_package_finds_its_share_directory(tmp_path):
    site, share = tmp_path / "site", tmp_path / "prefix" / "share" / "snake_control"
    shutil.copytree(ROOT / "snake_control", site / "snake_control")
    program = "from snake_control.experiment.cases import config_directory as d; print(d())"

    def ask():
        return subprocess.run(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            env=os.environ
            | {
                "PYTHONPATH": str(site),
                "AMENT_PREFIX_PATH": f"/no/such{os.pathsep}{share.parents[1]}",
            },
            capture_output=True,
            text=True,
            check=False,
        )

    missing = ask()
    assert missing.returncode != 0
    assert "paper_robot.yaml: not found" in missing.stderr
    shutil.copytree(ROOT / "config", share / "config")
    assert ask().stdout.strip() == str(share / "config")
