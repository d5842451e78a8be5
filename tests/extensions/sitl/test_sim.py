"""`aerodaas sim`, with a stand-in that speaks and dies as the programs do."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.sitl.command_line import _home
from aerodaas.extensions.sitl.process import PROGRAMS, SimulatedHome, SitlOptions, SitlProcess

SPEAKS = """#!{python}
import json, os, pathlib, socket, subprocess, sys, time
told = {{"arguments": sys.argv[1:], "model": os.environ.get("PX4_SIM_MODEL")}}
child = subprocess.Popen(["sleep", "60"])
told["pids"] = [os.getpid(), child.pid]
pathlib.Path("told.json").write_text(json.dumps(told))
print("it boots", flush=True)
port = int(sys.argv[sys.argv.index("--serial0") + 1].rpartition(":")[2])
speaker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
while True:
    speaker.sendto(bytes([0xFD, 0]), ("127.0.0.1", port))
    time.sleep(0.05)
"""
DIES = "#!/bin/sh\necho no such model\nexit 3\n"
SILENT = "#!/bin/sh\nexec sleep 60\n"


@pytest.fixture
def port() -> int:
    """One that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def tree(tmp_path: Path) -> Callable[[str], Path]:
    """A source tree of ArduPilot whose program is a script."""

    def plant(script: str) -> Path:
        root = tmp_path / "ardupilot"
        program = root / "build/sitl/bin/arducopter"
        program.parent.mkdir(parents=True)
        program.write_text(script.format(python=sys.executable), encoding="utf-8")
        program.chmod(0o755)
        parameters = root / "Tools/autotest/default_params/copter.parm"
        parameters.parent.mkdir(parents=True)
        parameters.write_text("FRAME_CLASS 1\n", encoding="utf-8")
        return root

    return plant


def told(state: Path) -> dict[str, object]:
    """What the stand-in was told."""
    import json  # noqa: PLC0415 - only here

    content: dict[str, object] = json.loads((state / "told.json").read_text(encoding="utf-8"))
    return content


def gone(pids: object, timeout: float = 10.0) -> bool:
    """Whether these processes end; a signal takes its time."""
    assert isinstance(pids, list)
    end = time.monotonic() + timeout
    while any(map(alive, pids)) and time.monotonic() < end:
        time.sleep(0.01)
    return not any(map(alive, pids))


def alive(pid: int) -> bool:
    """Whether a process still runs, and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").split(") ")[1][0] != "Z"
    except FileNotFoundError:
        return False


def test_it_flies_until_it_is_ended_with_all_it_has_started(
    tmp_path: Path, tree: Callable[[str], Path], port: int
) -> None:
    """By its place, speed, instance and parameters; on loopback alone."""
    mine = tmp_path / "mine.parm"
    home = SimulatedHome(47.0, 8.0, 500.0, 90.0)
    options = SitlOptions(
        tmp_path / "state", tree(SPEAKS), home, speed=2, instance=4, port=port, defaults=[mine]
    )
    with SitlProcess("ardupilot", options) as simulator:
        assert simulator.url == f"udpin:127.0.0.1:{port}"
        found = told(tmp_path / "state")
        words = found["arguments"]
        assert isinstance(words, list)
        after = {name: words[words.index(name) + 1] for name in ("--home", "--speedup", "-I")}
        assert after == {"--home": "47,8,500,90", "--speedup": "2", "-I": "4"}
        copter, own = words[words.index("--defaults") + 1].split(",")
        assert copter.endswith("default_params/copter.parm")
        assert own == str(mine)
        assert words[words.index("--serial0") + 1] == f"udpclient:127.0.0.1:{port}"
        assert words[words.index("--serial1") + 1] == words[words.index("--serial2") + 1] == "none"
        pids = found["pids"]
        assert isinstance(pids, list)
        assert all(map(alive, pids))
        assert simulator.log.read_text(encoding="utf-8") == "it boots\n"
    assert gone(pids)


def test_a_program_that_dies_is_told_with_its_last_words(
    tmp_path: Path, tree: Callable[[str], Path], port: int
) -> None:
    """At its start."""
    options = SitlOptions(tmp_path / "state", tree(DIES), port=port)
    with pytest.raises(SourceError, match=r"has ended with code 3[\s\S]*no such model"):
        SitlProcess("ardupilot", options).__enter__()


def test_a_program_that_dies_in_flight_is_told(
    tmp_path: Path, tree: Callable[[str], Path], port: int
) -> None:
    """By the signal."""
    options = SitlOptions(tmp_path / "state", tree(SPEAKS), port=port)
    with SitlProcess("ardupilot", options) as simulator:
        pids = told(tmp_path / "state")["pids"]
        assert isinstance(pids, list)
        os.kill(pids[0], signal.SIGKILL)
        with pytest.raises(SourceError, match="has ended by signal 9"):
            simulator.wait()
    assert gone(pids)


def test_a_program_that_says_nothing_is_ended(
    tmp_path: Path, tree: Callable[[str], Path], port: int
) -> None:
    """After its time."""
    options = SitlOptions(tmp_path / "state", tree(SILENT), port=port)
    simulator = SitlProcess("ardupilot", options, timeout=0.5)
    with pytest.raises(SourceError, match="said nothing at udpin:"):
        simulator.__enter__()
    assert simulator._process is None


def test_a_port_that_is_taken_is_told(tmp_path: Path, tree: Callable[[str], Path]) -> None:
    """Nothing is started."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        options = SitlOptions(tmp_path / "state", tree(SPEAKS), port=port)
        with pytest.raises(SourceError, match=f"port {port} is taken"):
            SitlProcess("ardupilot", options).__enter__()
    assert not (tmp_path / "state/told.json").exists()


@pytest.mark.parametrize(
    ("family", "variable"), [("ardupilot", "AERODAAS_ARDUPILOT"), ("px4", "AERODAAS_PX4")]
)
def test_what_is_not_installed_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, family: str, variable: str
) -> None:
    """Where it was looked for, and how it may be named."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv(variable, raising=False)
    make = PROGRAMS[family]  # type: ignore[index]
    with pytest.raises(SourceError, match=rf"on PATH[\s\S]*--from or {variable}"):
        make(SitlOptions(tmp_path))
    monkeypatch.setenv(variable, str(tmp_path / "tree"))
    with pytest.raises(SourceError, match=r"looked for .*tree/build"):
        make(SitlOptions(tmp_path))


def test_a_bare_arducopter_needs_parameters(tmp_path: Path) -> None:
    """Without the tree around it."""
    program = tmp_path / "arducopter"
    program.write_text(SILENT, encoding="utf-8")
    program.chmod(0o755)
    with pytest.raises(SourceError, match="give --defaults"):
        PROGRAMS["ardupilot"](SitlOptions(tmp_path, program))
    made = PROGRAMS["ardupilot"](SitlOptions(tmp_path, program, defaults=[Path("mine.parm")]))
    assert "mine.parm" in made.command


def test_px4_is_its_build_with_sih(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its variable; its place and speed are variables of its own."""
    program = tmp_path / "build/px4_sitl_sih/bin/px4"
    program.parent.mkdir(parents=True)
    program.write_text(SILENT, encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("AERODAAS_PX4", str(tmp_path))
    options = SitlOptions(
        tmp_path / "state", home=SimulatedHome(1.5, 2.5, 3.0), speed=4, instance=2
    )
    made = PROGRAMS["px4"](options)
    etc = str(tmp_path / "build/px4_sitl_sih/etc")
    assert made.command == [str(program), "-d", "-i", "2", "-w", str(tmp_path / "state"), etc]
    assert made.environment["PX4_SIM_MODEL"] == "sihsim_quadx"
    assert made.environment["PX4_SIM_SPEED_FACTOR"] == "4"
    assert made.environment["PX4_HOME_LAT"] == "1.5000000"
    assert options.heard_at == ("127.0.0.1", 14542)
    with pytest.raises(SourceError, match="without heading"):
        PROGRAMS["px4"](replace(options, home=SimulatedHome(1.5, 2.5, 3.0, 90.0)))


@pytest.mark.parametrize("text", ["", "47", "47,8,1,2,3", "north,east", "91,0", "0,181", "nan,0"])
def test_a_place_that_is_none_is_refused(text: str) -> None:
    """Rather than another one taken."""
    with pytest.raises(ConfigError, match="--home is LAT,LON"):
        _home(text, None)


def test_the_place_may_be_the_environments(tmp_path: Path) -> None:
    """Above the sea, where the file says so."""
    file = tmp_path / "environment.json"
    home = '{"latitude": 47, "longitude": 8, "altitude": 548, "above_sea": 500}'
    file.write_text(f'{{"robots": [{{"id": "drone"}}], "home": {home}}}', encoding="utf-8")
    assert _home(None, file) == SimulatedHome(47, 8, 500)
    file.write_text('{"robots": [{"id": "drone"}]}', encoding="utf-8")
    with pytest.raises(ConfigError, match="has no home"):
        _home(None, file)


def test_ctrl_c_ends_it_and_removes_its_folder(
    tmp_path: Path, tree: Callable[[str], Path], port: int
) -> None:
    """It has told the URL and the next command before."""
    words = ["sim", "ardupilot", "--from", str(tree(SPEAKS)), "--port", str(port)]
    with subprocess.Popen(
        [sys.executable, "-m", "aerodaas", *words],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(6)]
        (folder,) = tmp_path.glob("aerodaas-sim-*")
        pids = told(folder)["pids"]
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    assert f"--set drone.url=udpin:127.0.0.1:{port}" in "".join(lines)
    assert isinstance(pids, list)
    assert gone(pids)
    assert not folder.exists()


def test_an_application_is_flown_and_the_simulator_ended(
    tmp_path: Path, tree: Callable[[str], Path], port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the exit code of the application."""
    application = tmp_path / "mine.py"
    application.write_text("raise SystemExit(7)\n", encoding="utf-8")
    monkeypatch.setattr("aerodaas.extensions.sitl.command_line.signal.signal", lambda *_: None)
    state = tmp_path / "state"
    words = ["--from", str(tree(SPEAKS)), "--port", str(port), "--state", str(state)]
    began = time.monotonic()
    result = CliRunner().invoke(app, ["sim", "ardupilot", *words, "--run", str(application)])
    assert result.exit_code != 0
    assert time.monotonic() - began < 60
    pids = told(state)["pids"]
    assert isinstance(pids, list)
    assert gone(pids)
