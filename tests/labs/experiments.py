"""Reads the experiments of an article: tests verify what it claims with its own settings."""

import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files

import pytest

from labs.params import Value


class Experiments:
    """The experiments of one article, and which of them a test verifies."""

    def __init__(self, package: str, name: str) -> None:
        article = files(package).joinpath(name, "article.md").read_text(encoding="utf-8")
        blocks = re.findall(r"```experiment\n(.*?)```", article, re.DOTALL)
        self.settings: Mapping[str, Mapping[str, Value]] = {
            block["title"]: block["set"] for block in map(tomllib.loads, blocks)
        }
        self.verified: set[str] = set()

    def verify(self, title: str) -> pytest.MarkDecorator:
        """Marks the test that verifies this experiment and gives it the experiment's settings."""
        self.verified.add(title)
        return pytest.mark.parametrize("setting", [self.settings[title]], ids=[title])

    def check_all_are_verified(self) -> None:
        """At least four experiments, each with a test."""
        assert len(self.settings) >= 4
        assert set(self.settings) == self.verified
