"""What an application starts from: the environment, its robots, and the run that flies them."""
