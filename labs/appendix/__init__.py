"""Chapter A of the course."""

NUMBER = "A"
TITLE = "Appendices"
