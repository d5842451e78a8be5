"""The log of a flight among a vehicle's, by the times that it tells of them."""

from __future__ import annotations

from aerodaas.extensions.vehicle_logs.log_service import LogEntry, log_of_flight

BEGIN, END = 1000.0, 1400.0


def test_by_when_they_began() -> None:
    """The last that began before the middle of the flight: clocks may differ by half of it."""
    logs = [LogEntry(1, 9, 500.0), LogEntry(2, 9, 1100.0), LogEntry(3, 9, 1500.0)]
    assert log_of_flight(logs, BEGIN, END) == logs[1]
    assert log_of_flight(logs[2:], BEGIN, END) is None


def test_by_when_they_were_last_written() -> None:
    """The first that was written after the middle of the flight, however long after."""
    logs = [
        LogEntry(1, 9, None, 990.0),
        LogEntry(2, 9, None, 1350.0),
        LogEntry(3, 9, None, 9000.0),
    ]
    assert log_of_flight(logs, BEGIN, END) == logs[1]
    assert log_of_flight([logs[0], logs[2]], BEGIN, END) == logs[2]
    assert log_of_flight(logs[:1], BEGIN, END) is None


def test_without_times() -> None:
    """None is as good as another."""
    assert log_of_flight([LogEntry(1, 9, None)], BEGIN, END) is None
