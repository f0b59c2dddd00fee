"""Chapter 1 of the course."""

NUMBER = "1"
TITLE = "Reactive control"
