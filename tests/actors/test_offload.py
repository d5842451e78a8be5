"""The cloud under a scheduler: which resources are used, what crosses the link, what is told."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from flying import Flyer, hop, robot
from inference_server import Serving, serving
from pydantic import SecretStr

from aerodaas import Analytics, Environment, Frame
from aerodaas.analytics.base import Context
from aerodaas.config.model import ComputeConfig, RuntimeEnvConfig
from aerodaas.dataflow.graph import Node
from aerodaas.environment.run import Run
from aerodaas.errors import GraphError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.recording.reader import Recording
from aerodaas.runtime.dispatch.offload import allowed, cloud_processes, priced
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile

pytestmark = pytest.mark.wall_clock

CAMERA = {"id": "camera", "rate": 4, "settings": {"width": 320, "height": 180}}
TOLD = Profile("a", 10.0, 1000 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND, cloud_cost=2.0)


class Spot(Analytics[Detections]):
    """Finds one thing in each picture: the whole of it."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections
    isolated = True
    scheduled = True

    def __init__(self, name: str) -> None:
        self.name = name

    def process(self, item: Frame, context: Context) -> Detections:
        """Say where this was found."""
        brightness = float(np.clip(item.image.mean() / 255, 0, 1))
        box = (0.0, 0.0, float(item.width), float(item.height))
        return Detections.of(item, [Detection(box, context.kind, brightness)])


def compute(*resources: dict[str, Any]) -> dict[str, ComputeConfig]:
    """Compute resources by id."""
    made = [ComputeConfig.model_validate(one) for one in resources]
    return {one.id: one for one in made}


def endpoint(name: str = "fn", url: str = "http://127.0.0.1:9", **told: Any) -> dict[str, Any]:  # noqa: ANN401
    """An endpoint."""
    told = {"url": url, "protocol": "function", **told}
    return {"id": name, "kind": "http", "executors": 3, "endpoint": told}


def node(name: str, on: str | None = None) -> Node:
    """An analysis in the graph."""
    return Node(f"drone/{name}", "analytics", Detections, Spot(name), compute=on)


def test_an_analysis_goes_where_it_may() -> None:
    """Deployed in the cloud: there. On the edge: to cloud nodes, and endpoints that know it."""
    known = compute(
        {"id": "edge"},
        {"id": "one", "kind": "cloud"},
        {"id": "two", "kind": "cloud", "executors": 4},
        endpoint(models={"spot": "s"}, cost=5.0),
    )

    def ids(one: Node) -> list[str]:
        return [resource.id for resource in allowed(one, known)]

    assert ids(node("spot", "edge")) == ids(node("spot")) == ["one", "two", "fn"]
    assert ids(node("other", "edge")) == ["one", "two"]
    assert ids(node("other", "two")) == ["two"]
    assert ids(node("other", "fn")) == ["fn"]


def test_calls_cost_what_the_endpoint_says_and_no_cloud_never_pays() -> None:
    """The dearest of several; with nowhere to go, more than any gain."""
    known = compute({"id": "one", "kind": "cloud"}, endpoint(cost=5.0), endpoint("free"))
    assert priced(TOLD, [known["one"]]).cloud_cost == 2.0
    assert priced(TOLD, [known["one"], known["fn"]]).cloud_cost == 5.0
    assert priced(TOLD, [known["free"]]).cloud_cost == 2.0
    assert priced(TOLD, []).cloud_gain <= 0


def test_analyses_share_a_process_but_those_with_their_own_packages() -> None:
    """One process for the plain ones at each resource, one for each of the others."""
    known = compute({"id": "one", "kind": "cloud", "executors": 2}, {"id": "edge"})
    nodes = [node("a"), node("b"), node("c")]
    env = RuntimeEnvConfig(env_vars={"A": SecretStr("1")})
    processes = cloud_processes(nodes, known, {n.id: env if n is nodes[2] else None for n in nodes})
    assert [sorted(process.works) for process in processes] == [["drone/a", "drone/b"], ["drone/c"]]
    assert [process.runtime_env for process in processes] == [None, env]
    assert {process.slots for process in processes} == {2}


def environment(*resources: dict[str, Any], **task: Any) -> dict[str, Any]:  # noqa: ANN401
    """A drone whose camera two analyses watch, both under a scheduler."""
    tasks = {name: {"benefit": 10, "deadline": 20_000, **task} for name in ("spot", "spy")}
    return {
        "robots": [robot(sensors=[CAMERA])],
        "compute": [{"id": "edge"}, *resources],
        "schedulers": {"tasks": tasks},
        "recording": {"images": "none"},
        "simulation": {"world": "empty"},
    }


def build(on: str) -> Callable[[Environment], None]:
    """Both analyses deployed on a resource, everything sent to the cloud."""

    def made(env: Environment) -> None:
        env.set_analytics_scheduler("cld")
        drone = env.get_robot_by_id("drone")
        camera = drone.get_sensor_by_id("camera").get_data_stream()
        for name in ("spot", "spy"):
            Spot(name).deploy(env.get_compute_resource_by_id(on)).analyse(camera)
        drone.navigate(hop((1, 0), hover=600))

    return made


def values(env: Environment) -> dict[str, Any]:
    """The dispatcher's figures."""
    run = env.launch()
    run.poll()
    return run.reports()["dispatcher"].values


def until(env: Environment, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Wait until they satisfy `holds`."""
    end = time.monotonic() + 60
    while not holds(found := values(env)):
        assert time.monotonic() < end, f"it never happened: {found}"
        time.sleep(0.2)
    return found


def recorded(run: Run, schema: str) -> list[Any]:
    """What was recorded under a schema."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        return [record.value for record in recording.records(schemas=[schema])]


@pytest.mark.slow
def test_a_frame_is_sent_once_for_two_analyses_and_the_way_is_recorded(flyer: Flyer) -> None:
    """As many frames sent as there were, half as many as tasks; each result says how it came."""
    content = environment({"id": "cloud", "kind": "cloud", "executors": 4})
    with flyer.flying(build("edge"), content, speed=1.0) as env:
        found = until(env, lambda v: v.get("outcomes", {}).get("done", 0) >= 20)
        env.get_robot_by_id("drone").end_mission()
    site = found["sites"]["cloud"]
    frames = site["frames"]
    assert found["tasks"] // 2 - 8 <= frames <= found["tasks"] // 2 + 1
    assert site["latency_ms"] > 0
    done = [d for d in recorded(env.launch(), "aerodaas.Decision") if d.action == "done"]
    assert {one.reason for one in done} == {"cloud: jpeg to cloud"}
    for one in done:
        figures = one.values
        assert figures["frame_kb"] == pytest.approx(320 * 180 * 3 / 1e3)
        assert min(figures["work_ms"], figures["link_ms"], figures["expected_way_ms"]) >= 0
    # Of each frame's two executions only the first sent something.
    senders = Counter(one.task.split("#")[1] for one in done if one.values["sent_kb"] > 0)
    assert max(senders.values()) == 1
    sent = [d for d in recorded(env.launch(), "aerodaas.Decision") if d.action == "cloud"]
    assert sent[0].values["cloud_ms"] == 300.0
    assert sent[-1].values["cloud_ms"] < 300.0


@pytest.mark.slow
def test_a_function_url_is_a_cloud_that_may_fail(flyer: Flyer) -> None:
    """Its results count; its failures are counted and told once; the mission goes on."""
    served = Serving()
    with serving(served) as url:
        content = environment(endpoint(url=f"{url}/detect", timeout=20.0, cost=3.0))
        with flyer.flying(build("fn"), content, speed=1.0) as env:
            until(env, lambda v: v.get("outcomes", {}).get("done", 0) >= 6)
            served.mood = "500"
            until(env, lambda v: v.get("outcomes", {}).get("failed", 0) >= 4)
            served.mood = ""
            done = values(env)["outcomes"]["done"]
            until(env, lambda v: v.get("outcomes", {})["done"] >= done + 4)
            env.get_robot_by_id("drone").end_mission()
    run = env.launch()
    told = [a.text for a in recorded(run, "aerodaas.Alert") if a.kind == "cloud_failed"]
    assert len(told) == 1
    assert "status 500: as told" in told[0]
    decisions = recorded(run, "aerodaas.Decision")
    failed = [one for one in decisions if one.action == "failed"]
    assert all("status 500" in one.reason for one in failed)


def test_an_endpoint_for_what_it_cannot_do_is_refused_while_building(flyer: Flyer) -> None:
    """Tensors of an analysis that has none, before anything starts."""
    resource = endpoint(protocol="v2")
    with pytest.raises(GraphError, match="Spot cannot run at fn"):
        flyer.fly(build("fn"), environment(resource), speed=1.0)
