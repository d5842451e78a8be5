"""A run on one machine cannot be reached from any other."""

from __future__ import annotations

import ipaddress
import os
import socket
from typing import Any

import psutil
import pytest
import ray

from aerodaas.actors.cluster.ray_process import VARIABLE


class _Actor:
    def folder(self) -> str:
        """Folder of its local Ray."""
        return os.environ[VARIABLE]


def _of_ray(folder: str) -> list[psutil.Process]:
    """This process, and all of the local Ray in this folder."""
    found = [one for one in psutil.process_iter() if _folder_of(one) == folder]
    return [psutil.Process(), *found]


def _folder_of(process: psutil.Process) -> str:
    try:
        return str(process.environ().get(VARIABLE, ""))
    except psutil.Error:
        return ""


def _loopback(address: str) -> bool:
    parsed = ipaddress.ip_address(address)
    mapped = getattr(parsed, "ipv4_mapped", None)
    return (mapped or parsed).is_loopback


@pytest.mark.usefixtures("runtime")
def test_all_ports_are_on_the_loopback_interface() -> None:
    """Head, raylet, object manager, agents, workers and the application's own: TCP and UDP."""
    remote: Any = ray.remote(_Actor)
    actor = remote.options(num_cpus=0).remote()
    processes = _of_ray(ray.get(actor.folder.remote()))
    listening: dict[str, set[str]] = {}
    for process in processes:
        name = process.name()
        for one in process.net_connections("inet"):
            if one.status == psutil.CONN_LISTEN or one.type == socket.SOCK_DGRAM:
                listening.setdefault(name, set()).add(one.laddr.ip)
    ray.kill(actor)
    assert {"gcs_server", "raylet"} <= listening.keys()
    assert any(name.startswith("ray::") for name in listening)
    open_to_others = {
        name: addresses
        for name, addresses in listening.items()
        if not all(map(_loopback, addresses))
    }
    assert open_to_others == {}


@pytest.mark.usefixtures("runtime")
def test_the_node_is_known_by_the_loopback_address() -> None:
    """So that what joins it, or is told of it, is on this machine."""
    assert [node["NodeManagerAddress"] for node in ray.nodes()] == ["127.0.0.1"]
