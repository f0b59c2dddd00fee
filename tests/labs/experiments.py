"""Reads the experiments of an article: tests verify what it claims with its own settings."""

import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import pytest

from labs.params import Value


class ArticleExperiments:
    """The experiments of one article, and which of them a test verifies."""

    def __init__(self, package: str, name: str) -> None:
        article = files(package).joinpath(name, "article.md").read_text(encoding="utf-8")
        blocks = re.findall(r"```experiment\n(.*?)```", article, re.DOTALL)
        self.blocks = {block["title"]: block for block in map(tomllib.loads, blocks)}
        self.settings: Mapping[str, Mapping[str, Value]] = {
            title: block["set"] for title, block in self.blocks.items()
        }
        self.verified: set[str] = set()

    def verify(self, title: str) -> pytest.MarkDecorator:
        """Marks the test that verifies this experiment and gives it the experiment's settings."""
        self.verified.add(title)
        return pytest.mark.parametrize("setting", [self.settings[title]], ids=[title])

    def answer(self, title: str) -> str | float:
        """What the article says is right to predict: the text of a choice, or a number."""
        asked: dict[str, Any] = self.blocks[title]["predict"]
        right: int | float = asked["answer"]
        if "choices" not in asked:
            return right
        text: str = asked["choices"][right]
        return text

    def check_all_are_verified(self, at_least: int = 4) -> None:
        """So many experiments, each with a test."""
        assert len(self.settings) >= at_least
        assert set(self.settings) == self.verified
