"""Containerfile, compose file and scripts agree with each other and with the command line."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from typer.core import TyperGroup

from aerodaas.cli.app import app
from tools.containers.containerfile import Stage, read

ROOT = Path(__file__).parents[2]
ARGUMENTS, STAGES = read(ROOT / "Containerfile")
IMAGE = STAGES[-1]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "clusters" / "compose.yaml").read_text())
SERVICES = COMPOSE["services"]
HEAD = (ROOT / "clusters" / "edge-head.sh").read_text()
JOIN = (ROOT / "clusters" / "edge-join.sh").read_text()
SECRETIVE = re.compile(r"token|secret|passw|credential|_key", re.IGNORECASE)


def environment(stage: Stage) -> dict[str, str]:
    """Variables of a stage."""
    pairs = [pair for one in stage.of("ENV") for pair in shlex.split(one.words)]
    return dict(pair.split("=", 1) for pair in pairs)


def test_the_first_process_is_an_init_and_nobody_is_root() -> None:
    """The application is not process 1, and the user is a number that is not zero."""
    (entrypoint,) = IMAGE.of("ENTRYPOINT")
    assert entrypoint.listed() == ["/usr/bin/tini", "--"]
    (user,) = IMAGE.of("USER")
    assert int(user.words) > 0
    after = IMAGE.instructions[IMAGE.instructions.index(user) :]
    assert not [one for one in after if one.name in {"RUN", "COPY"}]
    assert f"--uid {user.words} " in IMAGE.of("RUN")[-1].words


def test_no_secret_gets_into_a_layer() -> None:
    """Neither by an argument or a variable, nor with the files that are copied."""
    for stage in STAGES:
        given = [one.words.partition("=")[0] for one in stage.of("ARG")]
        assert not [name for name in (*given, *environment(stage)) if SECRETIVE.search(name)]
    allowed = (ROOT / ".dockerignore").read_text().splitlines()[1:]
    assert allowed[0] == "*", "everything is left out that is not named"
    for line in allowed[1:]:
        if line.startswith("!"):
            assert list(ROOT.glob(line[1:])), line


def test_what_is_copied_is_there_and_let_through() -> None:
    """The scripts, and what the wheel is built from."""
    let_through = {
        path
        for line in (ROOT / ".dockerignore").read_text().splitlines()
        if line.startswith("!")
        for path in ROOT.glob(line[1:])
    }
    for one in IMAGE.of("COPY"):
        words = [word for word in shlex.split(one.words) if not word.startswith("--")]
        if "--from" not in one.words:
            assert {ROOT / word for word in words[:-1]} <= let_through
    links = [path for path in (ROOT / "aerodaas").iterdir() if path.is_symlink()]
    assert {path.resolve() for path in links} <= let_through


def test_its_constraints_are_the_locked_versions() -> None:
    """The line of the Containerfile makes a file that pip takes: no hashes, each version once."""
    script = STAGES[0].of("RUN")[-1].words
    line = script[script.index("sed -n") :].replace("/source/", f"{ROOT}/").partition(" >")[0]
    made = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=True).stdout  # noqa: S607
    locked = re.findall(
        r"^([a-z0-9][^ \\]*==[^ \\]+)", (ROOT / "requirements-dev.txt").read_text(), re.MULTILINE
    )
    assert [one.partition(" ")[0] for one in made.splitlines()] == locked
    assert len(locked) > 100
    assert "hash" not in made


def test_the_service_is_started_by_words_that_it_takes(tmp_path: Path) -> None:
    """By the script itself, with programs in its place that say how they were called."""
    (tmp_path / "bin").mkdir()
    for name in ("python", "ray"):
        program = tmp_path / "bin" / name
        program.write_text(f'#!/bin/sh\necho {name} "$@"\n')
        program.chmod(0o755)
    script = HEAD.replace("sleep 2", "sleep 0.2").replace("while true", "for once in 1")
    script = script.replace("/tmp", str(tmp_path))  # noqa: S108
    variables = {
        "PATH": "/usr/bin:/bin",
        "HOME": str(tmp_path),
        "AERODAAS_VENV": str(tmp_path),
        "AERODAAS_OWN_ADDRESS": "10.0.0.7",
        "AERODAAS_ROOT": "1",
        **{
            name: str(one)
            for name, one in SERVICES["edge"]["environment"].items()
            if name != "HOME"
        },
    }
    words = ["bash", "-c", script.replace("exec ", "") + "\nwait"]
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=True)
    (served,) = re.findall(r"^python -m aerodaas serve (.*)$", done.stdout, re.MULTILINE)
    root = typer.main.get_command(app)
    assert isinstance(root, TyperGroup)
    given = root.commands["serve"].make_context("serve", shlex.split(served)).params
    assert (given["address"], given["host"]) == ("10.0.0.7:6379", "0.0.0.0")  # noqa: S104 - with TLS
    assert given["certificate"] == Path("/run/secrets/certificate")
    assert '--resources={"edge":1}' in done.stdout
    assert "--dashboard-host=127.0.0.1" in done.stdout


def test_the_heads_tables_are_in_a_folder_that_nobody_else_has_made(tmp_path: Path) -> None:
    """Whatever another user has put there before, under whatever name."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "ray"
    program.write_text('#!/bin/sh\nstat -c "%a %u %F" "$RAY_gcs_storage_path"\n')
    (tmp_path / "bin" / "python").write_text("#!/bin/sh\n")
    for one in (tmp_path / "bin").iterdir():
        one.chmod(0o755)
    kept = tmp_path / "kept"
    kept.mkdir()
    (tmp_path / "ray-control").symlink_to(kept)
    (tmp_path / "ray-control.planted").symlink_to(kept)
    script = HEAD.replace("/tmp", str(tmp_path))  # noqa: S108
    variables = {"PATH": "/usr/bin:/bin", "AERODAAS_VENV": str(tmp_path), "HOME": str(tmp_path)}
    variables |= {"AERODAAS_OWN_ADDRESS": "10.0.0.7", "AERODAAS_ROOT": "1"}
    words = ["bash", "-c", script]
    for _ in range(2):
        done = subprocess.run(words, env=variables, capture_output=True, text=True, check=True)
        assert f"700 {os.getuid()} directory" in done.stdout
    assert len([one for one in tmp_path.glob("ray-control.*") if not one.is_symlink()]) == 1
    assert kept.is_dir()


@pytest.mark.parametrize("name", ["edge-head.sh", "edge-join.sh", "certificates.sh"])
def test_a_script_ends_at_its_first_failure(name: str) -> None:
    """Also within a pipe, and for a variable that is not set."""
    assert "\nset -euo pipefail\n" in (ROOT / "clusters" / name).read_text()


def test_the_head_refuses_to_run_as_root(tmp_path: Path) -> None:
    """Unless it is told to."""
    script = tmp_path / "head.sh"
    script.write_text(HEAD.replace("$(id -u)", "0"))
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "ray").write_text("#!/bin/sh\n")
    (tmp_path / "bin" / "ray").chmod(0o755)
    variables = {"PATH": "/usr/bin:/bin", "AERODAAS_VENV": str(tmp_path), "HOME": str(tmp_path)}
    done = subprocess.run(
        ["bash", str(script)],  # noqa: S607
        env=variables | {"AERODAAS_OWN_ADDRESS": "10.0.0.7"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "runs as root" in done.stderr


@pytest.mark.parametrize("name", SERVICES)
def test_nodes_keep_to_their_rights(name: str) -> None:
    """No privileges, no capabilities, the token as a file, and Ray's ports published nowhere."""
    service = SERVICES[name]
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert not service.get("privileged")
    assert "AERODAAS_USER" in service["user"]
    assert "token" in service["secrets"]
    assert service["environment"]["RAY_AUTH_TOKEN_PATH"] == "/run/secrets/token"  # noqa: S105
    assert set(service["secrets"]) <= set(COMPOSE["secrets"])
    assert [port.rsplit(":", 1)[1] for port in service.get("ports", [])] in ([], ["8400"])
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))
    assert (ROOT / "clusters" / service["command"][0]).is_file()


def test_scripts_know_the_variables_that_are_set() -> None:
    """Each is one that the script reads, or Ray's, or the shell's."""
    for name, script in (("edge", HEAD), ("cloud", JOIN)):
        for variable in SERVICES[name]["environment"]:
            if variable.startswith("AERODAAS_"):
                assert variable in script
    assert SERVICES["cloud"]["command"][1] == "edge:6379"
    assert SERVICES["cloud"]["environment"]["AERODAAS_RESOURCES"] == '{"cloud":1}'


def test_a_head_is_joined_by_its_name(tmp_path: Path) -> None:
    """As containers call each other; the own address is that of the way there."""
    (tmp_path / "bin").mkdir()
    for name, script in (
        ("python", "true"),
        ("ray", 'echo ray "$@"'),
        ("pgrep", "false"),
        ("ip", '[ "$4" = 127.0.0.1 ] || [ "$4" = ::1 ] && echo "local $4 dev lo src $4 uid 0"'),
    ):
        program = tmp_path / "bin" / name
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
    variables = {
        "PATH": f"{tmp_path}/bin:/usr/bin:/bin",
        "AERODAAS_VENV": str(tmp_path),
        "AERODAAS_OBJECT_STORE": "1000",
        "HOME": str(tmp_path),
    }
    words = ["bash", str(ROOT / "clusters" / "edge-join.sh")]
    done = subprocess.run(
        [*words, "localhost:6379"], env=variables, capture_output=True, text=True, check=True
    )
    joined = done.stdout.splitlines()[-1]
    assert re.search(r"--address localhost:6379 --node-ip-address (127.0.0.1|::1) ", joined)
    assert "--object-store-memory 1000 --resources" in joined
    done = subprocess.run(
        [*words, "nowhere.invalid:6379"], env=variables, capture_output=True, text=True, check=False
    )
    assert "no way leads to nowhere.invalid:6379" in done.stderr
