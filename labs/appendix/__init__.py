"""The appendices of the course, A and B."""

NUMBER = "A"
TITLE = "Appendices"
