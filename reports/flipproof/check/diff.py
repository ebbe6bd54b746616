"""Two reports compared: which findings moved beyond their bands, changed their verdict, came or went.

    |new - old| <= band_new + band_old + tolerance + ROUND_OFF max(|new|, |old|) + MIN_CHANGE

A finding that moved further and states no band in either report is not comparable: a residual, a ratio of growth or a
cost may be another on another machine, and nothing says by how much. It is told and not counted as a difference; its
verdict, unit, title, kind and threshold are compared all the same. Notes and run times are not compared: they hold the
clock of the machine. Titles are, for a certificate or an erratum states its verdict there.
"""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

from flipproof.frame.findings import interval_text
from slicemodel.scenario import UnsuitableFileError, read_text

ROUND_OFF: Final = 1e-9
"""Relative change of a number that nobody claims to be a change."""

MIN_CHANGE: Final = 1e-12
"""Absolute change, in the unit of the finding, that nobody claims to be a change."""

TOLERANCE: Final = 1e-6
"""What a finding may move beyond its bands, in its own unit: round-off of another machine, by way of a flight's impacts
and of finite differences."""

Kind = Literal["verdict", "moved", "words", "gone", "new", "bandless"]

HEADINGS: Final[Mapping[Kind, str]] = {
    "verdict": "changed their verdict",
    "moved": "moved beyond their bands",
    "words": "say something else",
    "gone": "are gone",
    "new": "are new",
    "bandless": "are not comparable: they moved, state no band, and are not counted as differences",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One finding that differs; ``words`` say from what to what."""

    kind: Kind
    id: str
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What two reports differ in; ``compared`` counts the findings that both have.

    ``premises`` say in what they were made differently and cannot be expected to agree: throw, slices, size of the
    report; ``circumstances`` in what else: versions and machine.
    """

    premises: tuple[str, ...]
    circumstances: tuple[str, ...]
    changes: tuple[Change, ...]
    compared: int

    @property
    def same(self) -> bool:
        """True if throw, slices and size are the same and no finding differs."""
        return not self.premises and not self.differences

    @property
    def differences(self) -> tuple[Change, ...]:
        """What counts as a difference: every change but those of findings that are not comparable."""
        return tuple(change for change in self.changes if change.kind != "bandless")

    @property
    def conclusion(self) -> str:
        """How many findings were compared, how many of them differ or are not comparable, how many are gone or new."""
        kinds = Counter(change.kind for change in self.changes)
        count = kinds["verdict"] + kinds["moved"] + kinds["words"]
        words = f"{self.compared} findings compared: "
        words += f"{count} differ{'s' if count == 1 else ''}" if count else "no difference"
        words += f", {kinds['bandless']} not comparable" if kinds["bandless"] else ""
        others = [
            f"{kinds[kind]} {'is' if kinds[kind] == 1 else 'are'} {kind}" for kind in ("gone", "new") if kinds[kind]
        ]
        return "; ".join([words, *others])

    def to_mapping(self) -> dict[str, object]:
        """Return the comparison as JSON-ready data."""
        return asdict(self) | {"same": self.same, "conclusion": self.conclusion}

    @property
    def text(self) -> str:
        """The comparison for a terminal: premises first."""
        lines = [f"DIFFERENT {words}" for words in self.premises]
        lines += [f"note: {words}" for words in self.circumstances]
        for kind, heading in HEADINGS.items():
            chosen = [change for change in self.changes if change.kind == kind]
            if chosen:
                lines.append(f"{heading} ({len(chosen)}):")
                lines += [f"  {change.id}: {change.words}" for change in chosen]
        return "\n".join(line.replace("\n", r"\n") for line in (*lines, self.conclusion))


def read_summary(path: Path) -> dict[str, Any]:
    """Return the summary in a report's folder, or in its file; raises ValueError, naming the file and what is wrong."""
    file = path / "summary.json" if path.is_dir() else path
    try:
        summary = json.loads(read_text(file, 2**28))
    except UnsuitableFileError as error:
        raise ValueError(f"{file}: {error}") from None
    except OSError as error:
        raise ValueError(f"{file}: cannot be read ({error.strerror or error}); name a report's folder") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: is not JSON ({error})") from None
    problem = _problem(summary)
    if problem:
        raise ValueError(f"{file}: {problem}")
    return dict(summary)


def _problem(summary: Any) -> str:
    """Return what keeps a summary from being compared, or nothing."""
    if not isinstance(summary, dict) or "findings" not in summary:
        return "is not the summary of a report: it has no findings"
    if summary.get("version") not in (1, 2):
        return f"version = {summary.get('version')!r} of the format, must be one of 1, 2"
    if not isinstance(summary.get("scenario"), dict):
        return "has no scenario"
    findings = summary["findings"]
    if not isinstance(findings, list) or not all(isinstance(finding, dict) for finding in findings):
        return "its findings are not a list of objects"
    for k, finding in enumerate(findings):
        needed = ("id", "title", "value", "unit", "kind", "band", "verdict", "admissible")
        missing = [name for name in needed if name not in finding]
        if missing:
            return f"finding {finding.get('id', k)!r} has no {', '.join(missing)}"
        if not isinstance(finding["id"], str):
            return f"finding {k} has the id {finding['id']!r}, which is no text"
        for name in ("value", "band"):
            if not _readable(finding[name]):
                return f"finding {finding['id']!r}: {name} = {finding[name]!r} is neither a number nor null"
        if (number(finding["band"]) or 0.0) < 0.0:
            return f"finding {finding['id']!r}: band = {finding['band']!r}, must be at least 0"
        bounds = finding["admissible"]
        if not (isinstance(bounds, list) and len(bounds) == 2 and all(map(_readable, bounds))):
            return f"finding {finding['id']!r}: admissible = {bounds!r} is not two numbers or nulls"
        if None not in bounds and not float(bounds[0]) <= float(bounds[1]):
            return f"finding {finding['id']!r}: admissible = {bounds!r}, the first must not exceed the second"
    ids = [finding["id"] for finding in findings]
    twice = sorted(name for name, count in Counter(ids).items() if count > 1)
    return f"findings share the id {twice[0]!r}" if twice else ""


def _readable(value: Any) -> bool:
    if isinstance(value, str):
        return value in ("nan", "inf", "-inf")
    if value is None or isinstance(value, float):
        return True
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def number(value: Any) -> float | None:
    """Return a number of a summary, which may be one of the words "nan", "inf", "-inf"; None stays None."""
    return None if value is None else float(value)


def compare_summaries(old: Mapping[str, Any], new: Mapping[str, Any], tolerance: float = TOLERANCE) -> Comparison:
    """Compare two summaries as ``read_summary`` gives them; ``tolerance`` is added to the bands of every finding."""
    before = {finding["id"]: finding for finding in old["findings"]}
    after = {finding["id"]: finding for finding in new["findings"]}
    both = [name for name in before if name in after]
    changes = [change for name in both if (change := change_of(before[name], after[name], tolerance)) is not None]
    changes += [Change(kind="gone", id=n, words=_finding_words(f)) for n, f in before.items() if n not in after]
    changes += [Change(kind="new", id=n, words=_finding_words(f)) for n, f in after.items() if n not in before]
    return Comparison(
        premises=tuple(_premises(old, new)),
        circumstances=tuple(_circumstances(old, new)),
        changes=tuple(changes),
        compared=len(both),
    )


def change_of(old: Mapping[str, Any], new: Mapping[str, Any], tolerance: float = TOLERANCE) -> Change | None:
    """Return in what a finding differs; None if it is the same within the bands and the tolerance."""
    name = old["id"]
    if old["verdict"] != new["verdict"]:
        reason = f" ({new['note']})" if new["verdict"] == "not evaluated" and new.get("note") else ""
        words = f"{old['verdict']} → {new['verdict']}, {_value(old)} → {_value(new)}{reason}"
        return Change(kind="verdict", id=name, words=words)
    if old["unit"] != new["unit"]:
        return Change(kind="moved", id=name, words=f"{_value(old)} → {_value(new)}")
    first, second = number(old["value"]), number(new["value"])
    if (first is None) != (second is None):
        return Change(kind="moved", id=name, words=f"{_value(old)} → {_value(new)}")
    moved = first is not None and second is not None and not within(first, second, bands(old, new) + tolerance)
    if moved and (_bands(old, new) or not (math.isfinite(first or 0.0) and math.isfinite(second or 0.0))):
        return Change(kind="moved", id=name, words=_moved(old, new, tolerance))
    if old["title"] != new["title"]:
        return Change(kind="words", id=name, words=f"“{old['title']}” → “{new['title']}”")
    if old["kind"] != new["kind"]:
        return Change(kind="words", id=name, words=f"{old['kind']} → {new['kind']}")
    thresholds = interval(old), interval(new)
    if not all(within(one, other, 1e-6 * abs(one)) for one, other in zip(*thresholds, strict=True)):
        before, after = (interval_text(threshold, None, digits=6) for threshold in thresholds)
        return Change(kind="words", id=name, words=f"threshold {before} → {after}")
    return Change(kind="bandless", id=name, words=_moved(old, new, tolerance)) if moved else None


def _bands(*findings: Mapping[str, Any]) -> list[float]:
    """Return the bands that findings state, without those that are not finite."""
    stated = [number(finding["band"]) for finding in findings]
    return [band for band in stated if band is not None and math.isfinite(band)]


def bands(*findings: Mapping[str, Any]) -> float:
    """Return the sum of the bands; one that is missing or not finite adds nothing."""
    return sum(_bands(*findings))


def within(old: float, new: float, allowed: float) -> bool:
    """Return whether two numbers are the same within ``allowed`` and round-off; NaN is the same as NaN."""
    if not (math.isfinite(old) and math.isfinite(new)):
        return old == new or (math.isnan(old) and math.isnan(new))
    return abs(new - old) <= allowed + ROUND_OFF * max(abs(old), abs(new)) + MIN_CHANGE


def interval(finding: Mapping[str, Any]) -> tuple[float, float]:
    """Return the ends of the interval that a finding of a summary must lie in; without a bound they are infinite."""
    low, high = map(number, finding["admissible"])
    return -math.inf if low is None else low, math.inf if high is None else high


def moved_words(old: float, new: float, allowed: float) -> str:
    """Return by how much a number moved, and what its bands and the tolerance allow."""
    return f"moved by {new - old:+.3g}, bands and tolerance allow {allowed:.3g}"


def _moved(old: Mapping[str, Any], new: Mapping[str, Any], tolerance: float) -> str:
    words = f"{_value(old)} → {_value(new)}"
    before, after = float(old["value"]), float(new["value"])
    if not _bands(old, new):
        return f"{words}, moved by {after - before:+.3g}, no band"
    return f"{words}, {moved_words(before, after, bands(old, new) + tolerance)}"


def _value(finding: Mapping[str, Any]) -> str:
    value = number(finding["value"])
    return "–" if value is None else f"{value:.6g} {finding['unit']}".strip()


def _finding_words(finding: Mapping[str, Any]) -> str:
    return f"{finding['title']} ({_value(finding)}, {finding['verdict']})"


def _premises(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    yield from (f"throw: {words}" for words in scenario_changes(old["scenario"], new["scenario"]))
    for name, words in (("slices", "slices"), ("size", "size of the report")):
        if old.get(name) != new.get(name):
            yield f"{words}: {old.get(name)} → {new.get(name)}"


def scenario_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return which fields of a throw differ, as "water_mass = 0.5 → 0.3"."""
    before, after = _flat(old), _flat(new)
    return [
        f"{name} = {before.get(name, 'absent')} → {after.get(name, 'absent')}"
        for name in dict.fromkeys((*before, *after))
        if before.get(name) != after.get(name)
    ]


def _flat(scenario: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for table, entries in scenario.items():
        if isinstance(entries, Mapping):
            flat |= {name if table == "scenario" else f"{table}.{name}": value for name, value in entries.items()}
        else:
            flat[table] = entries
    return flat


def _circumstances(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield in what two reports differ, but for what differs between any two."""
    if old["version"] != new["version"]:
        yield f"version of the format: {old['version']} → {new['version']}"
    provenances = [s["provenance"] if isinstance(s.get("provenance"), Mapping) else {} for s in (old, new)]
    before, after = (
        {"flipproof": s.get("flipproof"), **facts} for s, facts in zip((old, new), provenances, strict=True)
    )
    for name in dict.fromkeys((*before, *after)):
        old_fact, new_fact = before.get(name), after.get(name)
        if (
            name not in ("command", "made", "from the store")
            and None not in (old_fact, new_fact)
            and old_fact != new_fact
        ):
            yield f"{name}: {old_fact} → {new_fact}"
