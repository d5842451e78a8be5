"""From a document to the results: the same script over HTTP and over standard input and output.

Behind it is the real service with a simulated drone; whoever approves is a second client.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the extra `agents` is not installed")

import anyio
import httpx2
import psutil
from mcp import Client, StdioServerParameters
from mcp.client.stdio import stdio_client
from mcp.client.streamable_http import streamable_http_client

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.protocol.proposals import ApprovalIn

sys.path.append(str(Path(__file__).parents[2] / "service"))

from served import Served, fleet, robot

pytestmark = pytest.mark.slow
CONTENT = fleet(robot("one"))
DOCUMENT = {
    "format": "aerodaas-mission",
    "version": 1,
    "name": "visits",
    "sensors": ["one/odometry"],
    "navigation": [
        {
            "robot": "one",
            "waypoints": [
                {"id": "a", "x": 6, "y": 0, "z": 2, "heading_compass_deg": 90},
                {"id": "b", "x": 6, "y": 6, "z": 2},
            ],
        }
    ],
}


async def _asked(client: Client, tool: str, **arguments: object) -> Any:  # noqa: ANN401
    found = await client.call_tool(tool, arguments)
    assert not found.is_error, found.content
    return found.structured_content


async def flown(client: Client, person: ProviderClient) -> dict[str, Any]:
    """Have a mission proposed, checked, rehearsed, approved by `person`, flown and told."""
    assert (await _asked(client, "fleet"))["robots"][0]["robot"] == "one"
    far = {**DOCUMENT, "navigation": [{"robot": "one", "waypoints": [_place(500)]}]}
    bad = await _asked(client, "propose", document=far, why="too far")
    report = await _asked(client, "check", proposal=bad["proposal"])
    assert not report["passed"]
    assert report["findings"][0]["limit"] is not None
    proposal = await _asked(
        client, "propose", document=DOCUMENT, why="to look", parent=bad["proposal"]
    )
    again = await _asked(
        client, "propose", document=DOCUMENT, why="to look", parent=bad["proposal"]
    )
    id_ = proposal["proposal"]
    assert again["proposal"] == id_
    assert (await _asked(client, "check", proposal=id_))["passed"]
    early = await client.call_tool("request_approval", {"proposal": id_})
    assert early.is_error
    verdict = await _asked(client, "rehearse", proposal=id_, seeds=1)
    assert verdict["passed"], verdict
    asked = await _asked(client, "request_approval", proposal=id_)
    assert asked["phase"] == "awaiting_approval"
    assert "token" not in asked["link"]
    shown = person.mission(id_).proposal
    assert shown is not None
    person.approve(id_, ApprovalIn(hash=shown.hash))
    seen = await _asked(client, "watch", id=id_, until="decision", seconds=60)
    while not seen["mission"]["over"]:
        seen = await _asked(client, "watch", id=id_, until="over", seconds=60)
    assert seen["mission"]["landed"], seen
    results: dict[str, Any] = await _asked(client, "results", id=id_)
    detections = await _asked(client, "results", id=id_, part="detections")
    assert detections["detections"] == []
    return results


def _place(east: float) -> dict[str, Any]:
    return {"id": "a", "x": east, "y": 0, "z": 2}


def _check(results: dict[str, Any]) -> None:
    (robot,) = results["robots"]
    assert robot["state"] == "landed"
    assert (robot["waypoints_visited"], robot["waypoints_known"]) == (2, 2)
    assert robot["distance"] > 18


@pytest.fixture(name="provider", scope="module")
def _provider() -> Iterator[Served]:
    with Served(CONTENT, "--agents", "--speed", "max") as served:
        yield served


def _over_http(url: str, token: str) -> AbstractAsyncContextManager[Any]:
    headers = {"authorization": f"Bearer {token}"}
    client = httpx2.AsyncClient(headers=headers, timeout=70.0)
    return streamable_http_client(f"{url}/mcp", http_client=client)


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_over_http(provider: Served, mode: str) -> None:
    """With the agent's token; the provider's operator approves."""
    token = provider.user(f"scout-{mode}", "farm", scopes=["sense", "compute", "propose"])
    person = ProviderClient(provider.url, provider.token)

    async def play() -> dict[str, Any]:
        async with Client(_over_http(provider.url, token), mode=mode) as client:
            return await flown(client, person)

    _check(anyio.run(play))


def test_another_tenants_mission_does_not_exist(provider: Served) -> None:
    """By whatever id it is asked for, and whatever is done to it."""
    mine = provider.user("scout-a", "a", scopes=["sense", "compute", "propose"])
    theirs = provider.user("scout-b", "b", scopes=["sense", "compute", "propose"])

    async def play() -> None:
        async with Client(_over_http(provider.url, mine)) as client:
            found = await _asked(client, "propose", document=DOCUMENT, why="")
        async with Client(_over_http(provider.url, theirs)) as client:
            for tool, arguments in (
                ("mission", {"id": found["proposal"]}),
                ("check", {"proposal": found["proposal"]}),
                ("request_approval", {"proposal": found["proposal"]}),
                ("stop", {"id": found["proposal"], "how": "land"}),
                ("results", {"id": found["proposal"]}),
            ):
                refused = await client.call_tool(tool, arguments)
                assert refused.is_error, tool

    anyio.run(play)


def test_many_calls_at_once_keep_nobody_from_stopping(provider: Served) -> None:
    """More than an account may send requests at once: calls that wait are none."""
    token = provider.user("scout-many", "many", scopes=["propose"])

    async def play() -> None:
        async with Client(_over_http(provider.url, token)) as client:
            found = await _asked(client, "propose", document=DOCUMENT, why="")
            id_, watched = found["proposal"], []

            async def watch() -> None:
                watched.append(await _asked(client, "watch", id=id_, until="over", seconds=60))

            async with anyio.create_task_group() as group:
                for _ in range(24):
                    group.start_soon(watch)
                await anyio.sleep(3)
                assert (await _asked(client, "stop", id=id_, how="land"))["withdrawn"]
            assert {one["mission"]["phase"] for one in watched} == {"cancelled"}

    anyio.run(play)


def test_a_service_that_is_there(provider: Served) -> None:
    """The command's own way to it, with a token of the environment."""
    token = provider.user("scout-there", "there", scopes=["propose"])
    words = ["-m", "aerodaas", "agent", "--to", provider.url]
    environment = {**os.environ, "AERODAAS_TOKEN": token}

    async def play() -> Any:  # noqa: ANN401
        parameters = StdioServerParameters(command=sys.executable, args=words, env=environment)
        async with Client(stdio_client(parameters)) as client:
            return await _asked(client, "fleet")

    assert anyio.run(play)["name"]["text"] == "campus"


def test_over_standard_input_and_output(tmp_path: Path) -> None:
    """One command serves, and the person's address stands in standard error; all ends with it."""
    file, log = tmp_path / "fleet.json", tmp_path / "log"
    file.write_text(json.dumps(CONTENT), encoding="utf-8")
    words = ["-m", "aerodaas", "agent", "--env", str(file), "--speed", "max"]
    # A browser that reads and writes, as those in a terminal do.
    browser = tmp_path / "browser"
    browser.write_text("#!/bin/sh\necho noise\nhead -c 5\n", encoding="utf-8")
    browser.chmod(0o700)
    environment = {**os.environ, "BROWSER": str(browser)}

    async def play() -> dict[str, Any]:
        with log.open("w") as errors:
            parameters = StdioServerParameters(command=sys.executable, args=words, env=environment)
            async with Client(stdio_client(parameters, errlog=errors)) as client:
                url, token = re.findall(r"(http://\S+)/#token=(\S+)", log.read_text())[0]
                return await flown(client, ProviderClient(url, token))

    _check(anyio.run(play))
    until = time.monotonic() + 60
    while _processes(file):
        assert time.monotonic() < until
        time.sleep(0.2)


def test_a_killed_command_leaves_nothing_behind(tmp_path: Path) -> None:
    """Its service ends by itself."""
    file = tmp_path / "fleet.json"
    file.write_text(json.dumps(CONTENT), encoding="utf-8")
    command = [sys.executable, "-m", "aerodaas", "agent", "--env", str(file), "--no-browser"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stderr is not None
        assert "#token=" in process.stderr.readline()
        assert _processes(file)
        process.kill()
    until = time.monotonic() + 60
    while _processes(file):
        assert time.monotonic() < until
        time.sleep(0.2)


def test_a_real_drone_is_refused(tmp_path: Path) -> None:
    """Before anything is started: a fleet with one is a provider's to serve."""
    file = tmp_path / "fleet.json"
    real = {**robot("one"), "driver": "mavlink", "settings": {"url": "udpin:127.0.0.1:1"}}
    file.write_text(json.dumps(fleet(real)), encoding="utf-8")
    command = [sys.executable, "-m", "aerodaas", "agent", "--env", str(file), "--no-browser"]
    found = subprocess.run(
        command, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
    )
    assert found.returncode == 2
    assert found.stdout == ""
    assert "one" in found.stderr
    assert "--to" in found.stderr


def _processes(file: Path) -> list[psutil.Process]:
    """Processes that have the file on their command line, as the service has."""
    return [
        one
        for one in psutil.process_iter(["cmdline"])
        if str(file) in (one.info["cmdline"] or []) and one.pid != psutil.Process().pid
    ]
