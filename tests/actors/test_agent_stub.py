"""The stand-in for the dashboard agent of a local Ray's node."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from flying import Flyer, hop
from orphans import until_gone_with_its_parent

from aerodaas import Environment
from aerodaas.actors.cluster import agent_stub

STUB = str(agent_stub.__file__)
NAMES = ("metrics_agent_port_n1", "metrics_export_port_n1", "dashboard_agent_listen_port_n1")
PORTS = dict.fromkeys(NAMES, "-1")


def test_it_writes_ports_down_and_ends_with_its_node(tmp_path: Path) -> None:
    """As Ray's own does without a web server: that there are none. The node may be killed."""
    words = [sys.executable, "-I", "-S", STUB, "agent.py", "--minimal", f"--session-dir={tmp_path}"]

    def written() -> bool:
        return {path.name: path.read_text() for path in tmp_path.iterdir()} == PORTS

    until_gone_with_its_parent([*words, "--node-id=n1"], written)


@pytest.mark.parametrize(
    "options",
    [
        ["--node-id=n1", "--minimal"],
        ["--session-dir={folder}", "--minimal"],
        ["--session-dir={folder}", "--node-id=n1"],
    ],
)
def test_what_it_does_not_know_is_rays_own(tmp_path: Path, options: list[str]) -> None:
    """Of another version, or one that shall serve: Ray's program runs in its place."""
    program = tmp_path / "agent.py"
    program.write_text("import sys; print(sys.argv[1:])")
    words = [option.format(folder=tmp_path) for option in options]
    done = subprocess.run(
        [sys.executable, "-I", "-S", STUB, str(program), *words],
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
    )
    assert done.stdout.strip() == str(words)


@pytest.mark.slow
def test_a_local_ray_has_no_other(flyer: Flyer) -> None:
    """Of all processes that fly, none is Ray's dashboard agent."""

    def fly(env: Environment) -> None:
        env.get_robot_by_id("drone").navigate(hop((20, 0)))

    with flyer.flying(fly) as env:
        env.launch()
        lines = [one.cmdline() for one in psutil.Process().children(recursive=True)]
        assert any(STUB in line for line in lines)
        assert not any("DashboardAgent" in " ".join(line[:1]) for line in lines)
