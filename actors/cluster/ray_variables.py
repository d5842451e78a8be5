"""Environment variables of all Ray processes, on one machine and in clusters."""

from __future__ import annotations

__all__ = ["LOCAL_VARIABLES", "VARIABLES"]

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
LOCAL_VARIABLES = {
    **VARIABLES,
    # Nobody reads the figures of a Ray that has no dashboard.
    "RAY_enable_metrics_collection": "0",
    "RAY_event_stats": "0",
    "RAY_event_stats_print_interval_ms": "0",
    # What one node has is known to itself; these tell it to an autoscaler, or look for what
    # other nodes want, ten times a second.
    "RAY_raylet_report_resources_period_milliseconds": "1000",
    "RAY_gcs_pull_resource_loads_period_milliseconds": "10000",
    "RAY_report_worker_backlog_interval_ms": "10000",
    "RAY_object_manager_timer_freq_ms": "1000",
    # Housekeeping five and ten times a second, for thousands of short tasks.
    "RAY_kill_idle_workers_interval_ms": "5000",
    "RAY_raylet_check_gc_period_milliseconds": "1000",
    "RAY_DASHBOARD_AGENT_CHECK_PARENT_INTERVAL_S": "2",
}
"""Those of a Ray of one machine, which an application has started for itself."""
