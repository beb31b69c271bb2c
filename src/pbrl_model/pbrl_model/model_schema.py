"""The JSON schema of a model's file, which is installed beside this: other programs check files by it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pbrl_model.model_file import SavedModel

SCHEMA = "model.schema.json"
"""Name of the installed file."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_path() -> Path:
    """Return where the schema is installed."""
    return Path(__file__).with_name(SCHEMA)


def schema_text() -> str:
    """Return the schema as it is installed."""
    return schema_path().read_text(encoding="utf-8")


def generated() -> dict[str, Any]:
    """Return the schema as the classes have it: what is installed must be the same."""
    return {"$schema": DIALECT, **SavedModel.model_json_schema()}


def main() -> None:
    """Write the schema anew, after the classes were changed: `python -m pbrl_model.model_schema`."""
    schema_path().write_text(json.dumps(generated(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
