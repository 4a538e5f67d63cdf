"""Collects `*.scenario.yaml` as tests: each scenario is one, and its file's coverage where it asks for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from mission.language.scenario import Scenario, ScenarioFile

SUFFIX = ".scenario.yaml"


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take files by their name."""
    if file_path.name.endswith(SUFFIX):
        collector: pytest.Collector = _File.from_parent(parent, path=file_path)
        return collector
    return None


class ScenarioError(Exception):
    """A scenario that does not go as expected; the message is its finding."""


class _File(pytest.File):
    def collect(self) -> Iterator[pytest.Item]:
        from mission.language.scenario_in import read

        file, findings = read(self.path)
        if file is None:
            yield _Unreadable.from_parent(self, name="file", text="\n".join(str(finding) for finding in findings))
            return
        for scenario in file.scenarios:
            yield _Story.from_parent(self, name=scenario.name, scenario=scenario, file=file)
        if file.must_be_complete:
            yield _Complete.from_parent(self, name="coverage", file=file)


class _Item(pytest.Item):
    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, ScenarioError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, self.name


class _Unreadable(_Item):
    def __init__(self, *, text: str, **settings: Any) -> None:
        super().__init__(**settings)
        self.text = text

    def runtest(self) -> None:
        raise ScenarioError(self.text)


class _Story(_Item):
    def __init__(self, *, scenario: Scenario, file: ScenarioFile, **settings: Any) -> None:
        super().__init__(**settings)
        self.scenario = scenario
        self.file = file

    def runtest(self) -> None:
        from mission.language.scenario import run

        result = run(self.file.mission, self.scenario)
        if result.failure is not None:
            raise ScenarioError(str(result.failure))


class _Complete(_Item):
    def __init__(self, *, file: ScenarioFile, **settings: Any) -> None:
        super().__init__(**settings)
        self.file = file

    def runtest(self) -> None:
        from mission.language.scenario import coverage_finding

        finding = coverage_finding(self.file, self.file.coverage(self.file.run()))
        if finding is not None:
            raise ScenarioError(str(finding))
