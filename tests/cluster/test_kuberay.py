"""`clusters/kuberay.yaml` agrees with itself, with Ray's version and with the command line."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from packaging.requirements import Requirement
from typer.core import TyperGroup

from aerodaas.cli.app import app

ROOT = Path(__file__).parents[2]
MANIFESTS: list[dict[str, Any]] = list(
    yaml.safe_load_all((ROOT / "clusters" / "kuberay.yaml").read_text())
)


def of_kind(kind: str) -> dict[str, Any]:
    """The one manifest of a kind."""
    (found,) = (one for one in MANIFESTS if one["kind"] == kind)
    return found


CLUSTER = of_kind("RayCluster")["spec"]
HEAD = CLUSTER["headGroupSpec"]
(WORKERS,) = CLUSTER["workerGroupSpecs"]


def container(group: dict[str, Any]) -> dict[str, Any]:
    """The one container of a group's pods."""
    (found,) = group["template"]["spec"]["containers"]
    return dict(found)


def test_the_head_is_the_edge_and_the_workers_are_the_cloud() -> None:
    """By the resources that place actors, quoted as a shell takes them."""
    for group, resources in ((HEAD, {"edge": 1}), (WORKERS, {"cloud": 1})):
        (word,) = shlex.split(group["rayStartParams"]["resources"])
        assert json.loads(word) == resources


def test_the_service_is_started_by_words_that_it_takes() -> None:
    """And none but the wanted ones follow, whatever the loop around them."""
    (script,) = container(HEAD)["args"]
    found = re.search(r"aerodaas (serve .*?);", script)
    assert found
    serve, *words = shlex.split(found[1])
    root = typer.main.get_command(app)
    assert isinstance(root, TyperGroup)
    given = root.commands[serve].make_context(serve, words).params
    assert (given["port"], given["host"]) == (8400, "0.0.0.0")  # noqa: S104 - with TLS
    mounts = [one["mountPath"] for one in container(HEAD)["volumeMounts"]]
    for path in (given["fleet"], given["state"], given["certificate"], given["key"]):
        assert str(path.parent) in mounts
    assert script.endswith("exec $KUBERAY_GEN_RAY_START_CMD")


def test_what_pods_mount_is_there_or_told_to_be_made() -> None:
    """Claims are among the manifests; secrets and settings are in the steps at the top."""
    text = (ROOT / "clusters" / "kuberay.yaml").read_text()
    assert re.search(rf"secret generic {CLUSTER['authOptions']['secretName']} ", text)
    for volume in HEAD["template"]["spec"]["volumes"]:
        if "secret" in volume:
            assert f"create secret tls {volume['secret']['secretName']} " in text
        if "configMap" in volume:
            assert f"create configmap {volume['configMap']['name']} " in text
        if "persistentVolumeClaim" in volume:
            name = volume["persistentVolumeClaim"]["claimName"]
            assert of_kind("PersistentVolumeClaim")["metadata"]["name"] == name


def test_all_nodes_have_one_image_and_a_ray_that_is_supported() -> None:
    """Ray's protocol changes with each release."""
    assert container(HEAD)["image"] == container(WORKERS)["image"]
    lines = (ROOT / "pyproject.toml").read_text()
    (ray,) = re.findall(r'^ +"(ray>=[^"]+)"', lines, re.MULTILINE)
    assert Requirement(ray).specifier.contains(CLUSTER["rayVersion"])


@pytest.mark.parametrize("kind", ["Service", "NetworkPolicy"])
def test_users_reach_the_service_and_nothing_else(kind: str) -> None:
    """Ray's own ports are its nodes' alone."""
    spec = of_kind(kind)["spec"]
    name = of_kind("RayCluster")["metadata"]["name"]
    if kind == "Service":
        assert spec["selector"]["ray.io/cluster"] == name
        named = {one["name"]: one["containerPort"] for one in container(HEAD)["ports"]}
        assert [named[one["targetPort"]] for one in spec["ports"]] == [8400]
        return
    assert spec["podSelector"]["matchLabels"] == {"ray.io/cluster": name}
    open_to_all = [rule for rule in spec["ingress"] if "from" not in rule]
    assert [[port["port"] for port in rule["ports"]] for rule in open_to_all] == [[8400]]
