"""The errors a user of the labs can cause: one root, each with a sentence that helps."""


class LabError(Exception):
    """Wrong use. The message says what was given and what is allowed."""


class ParameterError(LabError):
    """A parameter does not exist, or was given a value it does not take."""


class UnknownLab(LabError):
    """No lab has this name."""
