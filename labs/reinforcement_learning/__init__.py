"""Chapter 3 of the course."""

NUMBER = "3"
TITLE = "Reinforcement learning"
