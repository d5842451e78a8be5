"""The application's entry: the environment, its robots, and the run that flies them."""
