"""A finished run, read again from its folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pcsv
import pyarrow.parquet as pq

from sva_bench.analysis.report import Content, write_report
from sva_bench.atomic import draft_file
from sva_bench.documents import check_kind, pretty_yaml, read_json
from sva_bench.documents import parse_yaml as parse
from sva_bench.errors import BadFile, BadInput
from sva_bench.runs import LEG_COLUMNS, MAP, stem_of
from sva_bench.world.load import world_of

_AGREE = 1e-6  # relative; a mean added up in another order


def report_again(folder: Path) -> Path:
    """Write the report of a finished run again, from its tables.

    Raises:
        BadInput, BadFile: If this is no run folder, or something in it is cut off, foreign or not of the same run.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; name a run folder, as in runs/<world>-seed0-<hash>")
    if not (folder / "summary.json").is_file():
        raise BadInput(f"{folder}: no run folder of ours (summary.json is missing); name one as in "
                       "runs/<world>-seed0-<hash>")
    path = folder / "report.html"
    content = read_content(folder)
    try:
        with draft_file(path) as draft:
            write_report(draft, content)
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise BadFile(folder / "summary.json", None, "", f"no summary as this version writes it ({error}); run the "
                      "command in manifest.json again") from None
    return path


def write_csv(folder: Path) -> list[Path]:
    """Write each table of a run folder as CSV too, for spreadsheets.

    Raises:
        BadFile: If one can't be read.
        BadInput: If one can't be written.
    """
    written = []
    for table in sorted(folder.glob("*.parquet")):
        rows = read_table(table)
        path = table.with_suffix(".csv")
        with draft_file(path) as draft:
            pcsv.write_csv(rows, draft)
        written.append(path)
    return written


def read_content(folder: Path) -> Content:
    """What the report of a run folder is made of.

    Raises:
        BadFile: If a file is missing, cut off, foreign or not of the same run.
    """
    documents = {kind: read_json(folder / f"{kind}.json") for kind in ("summary", "manifest")}
    for kind, document in documents.items():
        check_kind(document, f"sva-bench/{kind}@1")
    summary, manifest = documents["summary"].data, documents["manifest"].data
    try:
        plans = [(s["name"], name, plan["executed"]["mean"]) for s in summary["scenarios"]
                 for name, plan in s["plans"].items()]
        stems = {(s["name"], name): stem_of(s["name"], name, foreign="comparisons" in s) for s in summary["scenarios"]
                 for name in s["plans"]}
        world = world_of(parse(pretty_yaml(manifest["world"], {}), folder / "manifest.json"), folder / MAP)
    except (KeyError, TypeError, AttributeError) as error:
        raise BadFile(folder / "summary.json", None, "", f"no summary or manifest as this version writes it ({error}); "
                      "run the command again") from None
    _check_outcomes(folder / "outcomes.parquet", plans)
    routes = {}
    for scenario, name, _ in plans:
        document = read_json(folder / "plans" / f"{stems[scenario, name]}.json")
        check_kind(document, "sva-bench/plan@1")
        routes[scenario, name] = document.data.get("routes", {})
    legs = read_table(folder / "legs.parquet", LEG_COLUMNS)
    columns = {name: legs.column(name).to_numpy() if name.endswith("_s") else legs.column(name).to_pylist()
               for name in LEG_COLUMNS}
    return Content(summary=summary, routes=routes, stems=stems, legs=columns, world=world, manifest=manifest)


def read_table(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Some columns of a table of ours, or all.

    Raises:
        BadFile: If it can't be read, lacks a column, or holds NaN.
    """
    try:
        table = pq.read_table(path, columns=None if columns is None else list(columns))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise BadFile(path, None, "", f"no table of ours, or cut off ({str(error).splitlines()[0][:120]}); run the "
                      "command in manifest.json again") from None
    for name in table.column_names if columns is None else columns:
        if name not in table.column_names:
            raise BadFile(path, None, name, "this column is missing; run the command in manifest.json again")
        column = table.column(name)
        if column.null_count or (pa.types.is_floating(column.type) and not pc.all(pc.is_finite(column)).as_py()
                                 and len(column)):
            raise BadFile(path, None, name, "holds what is no number; run the command in manifest.json again")
    return table


def _check_outcomes(path: Path, plans: Sequence[tuple[str, str, float]]) -> None:
    """Refuse outcomes whose means aren't those of the summary."""
    table = read_table(path, ("scenario", "planner", "trial", "incentive"))
    grouped = table.group_by(["scenario", "planner"]).aggregate([("incentive", "sum"), ("trial", "max")]).to_pylist()
    means: Mapping[Any, float] = {
        (row["scenario"], row["planner"]): row["incentive_sum"] / (row["trial_max"] + 1) for row in grouped}
    for scenario, name, mean in plans:
        found = means.get((scenario, name))
        if found is None or not np.isclose(found, mean, rtol=_AGREE, atol=_AGREE):
            raise BadFile(path, None, "incentive", f"these aren't the trials of summary.json: {scenario}, {name} "
                          f"collected {mean:.6g} there and {'nothing' if found is None else f'{found:.6g}'} here; run "
                          "the command in manifest.json again")
