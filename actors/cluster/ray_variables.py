"""Environment variables of every Ray process of ours, on one machine and in clusters."""

from __future__ import annotations

__all__ = ["VARIABLES"]

VARIABLES = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # Ray would refuse a node whose Python differs in its patch level; a Jetson's always does.
    "RAY_DEFAULT_PYTHON_VERSION_MATCH_LEVEL": "minor",
    # A frame goes in the call that it is for: a reference costs round trips.
    "RAY_max_direct_call_object_size": "4194304",
    # That an actor died is told at once; why it did, for which Ray would wait a second, may follow.
    "RAY_timeout_ms_task_wait_for_death_info": "100",
    # Ray would run its workers at nice 15, the drone's actor, too; the others lower themselves.
    "RAY_worker_niceness": "0",
    # Ray ends all processes of a node, the drone's, too, whose head is silent for a minute. A day
    # lets drones come home; a run's processes end by themselves afterwards.
    "RAY_gcs_rpc_server_reconnect_timeout_s": "86400",
}
