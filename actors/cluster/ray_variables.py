"""Environment variables of Ray's processes, on one machine and in clusters."""

from __future__ import annotations

import os
import sys

__all__ = ["AUTH_MODE", "LOOPBACK_ONLY", "UNAUTHENTICATED", "VARIABLES", "set_variables"]

VARIABLES = {
    # Ray ends all processes of a node, the drone's included, after a minute without the head. A
    # day lets drones return home; a run's processes end by themselves afterwards.
    # https://docs.ray.io/en/latest/cluster/kubernetes/user-guides/kuberay-gcs-ft.html
    "RAY_gcs_rpc_server_reconnect_timeout_s": "86400",
    # Ray runs workers, the drone's actor included, at nice 15, and only the superuser may lower
    # that again. Ray's settings of this kind are in its `src/ray/common/ray_config_def.h`.
    "RAY_worker_niceness": "0",
    # The run reports dead processes by name; Ray would print its nodes' words about them, too.
    # https://docs.ray.io/en/latest/ray-observability/user-guides/configure-logging.html
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".",
}
LOOPBACK_ONLY = {
    # A Ray that forms no cluster of machines listens on the loopback interface only.
    # https://docs.ray.io/en/latest/cluster/getting-started.html
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
}
AUTH_MODE = "RAY_AUTH_MODE"
"""https://docs.ray.io/en/latest/ray-security/token-auth.html"""
UNAUTHENTICATED = "AERODAAS_UNAUTHENTICATED"
"""Environment variable that, set to 1, allows clusters without tokens."""


def set_variables() -> None:
    """Set the variables of this process and those that it starts, unless the user has set them.

    Ray reads the mode of authentication as it is imported: where that has happened, it stays.
    """
    for name, value in VARIABLES.items():
        os.environ.setdefault(name, value)
    if not os.environ.get(AUTH_MODE) and "ray" not in sys.modules:
        os.environ[AUTH_MODE] = "disabled" if os.environ.get(UNAUTHENTICATED) == "1" else "token"
