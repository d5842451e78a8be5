"""The server: its interface as committed, both revisions, and refusals of calls."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from agent_client import MODES, Service, called, document, played
from hypothesis import given
from hypothesis import strategies as st
from mcp import Client
from mcp.shared.exceptions import MCPError

from aerodaas.protocol.schemas import MissionPhase

SNAPSHOT = Path(__file__).with_name("tools_list.json")
READS = {"catalogue", "fleet", "check", "mission", "watch", "results"}
FORBIDDEN = ("arm", "takeoff", "mode", "parameter", "approve", "resume", "velocity", "upload")


def _tools(mode: str) -> list[dict[str, Any]]:
    async def script(client: Client) -> list[dict[str, Any]]:
        found = await client.list_tools()
        return [one.model_dump(mode="json", exclude_none=True) for one in found.tools]

    return played(Service(), script, mode)


@pytest.mark.parametrize("mode", MODES)
def test_names_schemas_and_hints_are_those_that_are_committed(mode: str) -> None:
    """They are an interface: `UPDATE=1` writes the file anew, for its difference to be read."""
    found = _tools(mode)
    if os.environ.get("UPDATE"):
        lines = ",\n".join(json.dumps(one) for one in found)
        SNAPSHOT.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    assert found == json.loads(SNAPSHOT.read_text(encoding="utf-8"))


def test_hints_are_honest() -> None:
    """What only reads says so; what stops or changes a flight does not claim to be harmless."""
    tools = {one["name"]: one["annotations"] for one in _tools(MODES[0])}
    assert {name for name, hints in tools.items() if hints.get("read_only_hint")} == READS
    for name in ("stop", "change"):
        assert tools[name].get("destructive_hint", True)
    for name in ("propose", "rehearse", "request_approval"):
        assert tools[name]["destructive_hint"] is False
        assert tools[name]["idempotent_hint"]


def test_no_tool_and_no_argument_arms_approves_or_resumes() -> None:
    """What an agent never gets has no name."""
    names = {one["name"] for one in _tools(MODES[0])}
    arguments = {key for one in _tools(MODES[0]) for key in one["input_schema"]["properties"]}
    assert len(names) == 11
    assert not {word for word in FORBIDDEN if word in names | arguments}


def test_schemas_are_valid_and_have_the_bounds_of_the_fleet() -> None:
    """A waypoint has a heading and no yaw; speeds end at the fleet's, robots are named."""
    tools = {one["name"]: one for one in _tools(MODES[0])}
    for tool in tools.values():
        jsonschema.Draft202012Validator.check_schema(tool["input_schema"])
        jsonschema.Draft202012Validator.check_schema(tool["output_schema"])
    definitions = tools["propose"]["input_schema"]["$defs"]
    fields = definitions["Waypoint"]["properties"]
    assert "yaw" not in fields
    assert "heading_compass_deg" in fields
    assert fields["speed"]["anyOf"][0]["maximum"] == 4
    assert "15" in fields["z"]["description"]
    assert definitions["NavigationDocument"]["properties"]["robot"]["enum"] == ["drone"]
    assert tools["change"]["input_schema"]["properties"]["robot"]["enum"] == ["drone"]


def test_a_good_call_fits_the_schemas() -> None:
    """What the schema allows is taken, and what is answered is as it says."""
    tools = {one["name"]: one for one in _tools(MODES[0])}
    waypoint = {"id": "a", "x": 1, "y": 2, "z": 3, "heading_compass_deg": 5}
    content = {"document": document(waypoint), "why": ""}
    jsonschema.validate(content, tools["propose"]["input_schema"])
    service = Service()
    found = called(service, "propose", **content)
    jsonschema.validate(found, tools["propose"]["output_schema"])
    service.fly(position=(0.0, 0.0, 1.0))
    answer = called(service, "mission", id="m1")
    jsonschema.validate(answer, tools["mission"]["output_schema"])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("tool", "arguments", "names"),
    [
        ("propose", {"documnt": {}}, ["documnt", "document"]),
        ("mission", {}, ["id"]),
        ("mission", {"id": 5}, ["id"]),
        ("watch", {"id": "a", "seconds": 3600}, ["seconds", "60"]),
        ("request_approval", {"proposal": "p1", "approved": True}, ["approved"]),
        ("rehearse", {"proposal": "p1", "seeds": 100}, ["seeds", "5"]),
        ("arm", {}, ["arm"]),
        ("results", {"id": "m", "part": "/etc/passwd"}, ["part"]),
    ],
)
def test_a_call_of_another_form_is_refused_by_name(
    mode: str, tool: str, arguments: dict[str, Any], names: list[str]
) -> None:
    """Field and bound; neither the values nor the library that found them."""
    text = called(Service(), tool, mode, **arguments)
    assert isinstance(text, str)
    assert all(name in text for name in names)
    assert "pydantic" not in text
    assert "passwd" not in text


@pytest.mark.parametrize("mode", MODES)
def test_instructions_begin_with_the_frame(mode: str) -> None:
    """Ten lines."""

    async def script(client: Client) -> str:
        return client.instructions or ""

    lines = played(Service(), script, mode).strip().splitlines()
    assert len(lines) == 10
    assert "east" in lines[0]
    assert "heading_compass_deg" in lines[1]


def test_resources_show_schema_report_and_picture() -> None:
    """For clients that show them."""
    service = Service()
    service.fly()
    service.change_mission("m1", phase=MissionPhase.LANDED)

    async def script(client: Client) -> list[Any]:
        names = ("document-schema", "mission/m1/report", "mission/m1/rehearsal.png")
        return [(await client.read_resource(f"aerodaas://{one}")).contents[0] for one in names]

    schema, report, picture = played(service, script)
    assert "heading_compass_deg" in schema.text
    assert json.loads(report.text)["phase"] == "landed"
    assert picture.mime_type == "image/png"


def test_a_resource_that_is_not_there_tells_no_address() -> None:
    """As a tool's refusal does not."""

    async def script(client: Client) -> str:
        with pytest.raises(MCPError) as caught:
            await client.read_resource("aerodaas://mission/other/report")
        return str(caught.value)

    text = played(Service(), script)
    assert "other" in text
    assert "127.0.0.1" not in text


def test_prompts_begin_tasks_in_the_safe_order() -> None:
    """Four of them; each that flies ends at a person's approval."""

    async def script(client: Client) -> dict[str, str]:
        found = {}
        for prompt in (await client.list_prompts()).prompts:
            words = {one.name: "the field" for one in prompt.arguments or ()}
            result = await client.get_prompt(prompt.name, words)
            found[prompt.name] = str(result.messages[0].content.text)  # type: ignore[union-attr]
        return found

    found = played(Service(), script)
    assert len(found) == 4
    assert all("the field" in text for text in found.values())
    flying = [text for name, text in found.items() if "refusal" not in name]
    assert all("approval" in text for text in flying)


_FIELDS = [
    *("id", "x", "y", "z", "yaw", "heading_compass_deg", "waypoint_type", "actions", "type"),
    *("format", "version", "navigation", "waypoints", "robot", "analyses", "sensors"),
]
_JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**400), 10**400)
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["p1", "m1", "drone", "local", "yaw", "../m1", "\u202e"]),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=12) | st.sampled_from(_FIELDS), inner, max_size=6)
    ),
    max_leaves=25,
)
_ARGUMENTS = {
    "catalogue": ["topic"],
    "propose": ["document", "why", "parent", "minutes"],
    "check": ["proposal"],
    "watch": ["id", "until", "seconds"],
    "stop": ["id", "how"],
    "change": ["id", "robot", "waypoints", "why"],
    "results": ["id", "part"],
}
_CALLS = st.sampled_from(sorted(_ARGUMENTS)).flatmap(
    lambda tool: st.tuples(
        st.just(tool),
        st.dictionaries(st.sampled_from([*_ARGUMENTS[tool], "more"]), _JSON, max_size=5),
    )
)
_WAYPOINTS = st.dictionaries(st.sampled_from(_FIELDS), _JSON, max_size=8)


@given(st.lists(_CALLS, min_size=1, max_size=3), st.lists(_WAYPOINTS, max_size=3))
def test_whatever_is_sent_nothing_crashes_and_no_drone_is_commanded(
    calls: list[tuple[str, dict[str, Any]]], waypoints: list[dict[str, Any]]
) -> None:
    """A crash would answer with the tool's name alone; a good `stop` needs a mission that flies."""
    service = Service()
    service.put("m1", phase=MissionPhase.PROPOSED)
    more: list[tuple[str, dict[str, Any]]] = [
        ("propose", {"document": document(*waypoints), "why": ""}),
        ("change", {"id": "m1", "robot": "drone", "waypoints": waypoints, "why": ""}),
    ]

    async def script(client: Client) -> None:
        for tool, arguments in (*calls, *more):
            given = {"seconds": 1, **arguments} if tool == "watch" else arguments
            found = await client.call_tool(tool, given)
            text = getattr(found.content[0], "text", "")
            assert text != f"Error executing tool {tool}", (tool, arguments)
            assert "\u202e" not in text

    played(service, script)
    assert not service.commands
