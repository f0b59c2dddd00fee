"""Chapter 2 of the course."""

NUMBER = "2"
TITLE = "Optimal control"
