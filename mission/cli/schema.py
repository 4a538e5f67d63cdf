"""Print the JSON Schema of mission files, for editors."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON Schema of mission files.

    It ships as mission/language/mission.schema.json: a first line such as
    `# yaml-language-server: $schema=../mission/language/mission.schema.json` makes an editor complete and check.

    \b
    Examples:
      mission schema > mission.schema.json
    """
    from mission.language.schema import schema_text

    print(schema_text(), end="")
