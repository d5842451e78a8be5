"""`aerodaas lab leaderboard`: schedulers ranked on one fixed set of cases."""
