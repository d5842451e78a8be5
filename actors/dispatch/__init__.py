"""The dispatcher's actor, which runs an analytics scheduler, and the executors."""
