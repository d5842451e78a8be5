"""Environment variables of all Ray processes, on one machine and in clusters."""

from __future__ import annotations

__all__ = ["VARIABLES"]

VARIABLES = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # Ray would keep the history of each call in the head, 3 kB of memory a call, for a dashboard
    # that is not started.
    "RAY_task_events_report_interval_ms": "0",
    # Otherwise Ray refuses a node whose Python differs in patch level, as on a Jetson.
    "RAY_DEFAULT_PYTHON_VERSION_MATCH_LEVEL": "minor",
    # A frame is sent within its call: a reference costs round trips.
    "RAY_max_direct_call_object_size": "4194304",
    # Report an actor's death at once; Ray would wait a second for its cause.
    "RAY_timeout_ms_task_wait_for_death_info": "100",
    # Otherwise Ray runs workers, the drone's actor included, at nice 15; others set their own.
    "RAY_worker_niceness": "0",
    # Ray ends all processes of a node, the drone's included, after a minute without the head. A
    # day lets drones return home; a run's processes end by themselves afterwards.
    "RAY_gcs_rpc_server_reconnect_timeout_s": "86400",
}
