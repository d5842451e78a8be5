"""Leaderboard: schedulers ranked on one fixed set of cases."""
