"""The summary's published schema, and the verdicts as JUnit XML."""

import json
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import PurePosixPath

import jsonschema
import numpy as np
import pytest

from flipproof.frame.columns import columns_csv, curves_csv, rows_csv
from flipproof.frame.findings import RULES, Band, Finding, regression
from flipproof.frame.gather import ChapterResult
from flipproof.output.junit import junit_text
from flipproof.output.summary import SUMMARY_VERSION, json_ready, schema_text, summarise, summary_text

SCHEMA = json.loads(schema_text())

FINDINGS = (
    Finding(id="ice-eq8", title="holds", value=0.0, unit="of ω₀", kind="regression", admissible=(0.0, 1e-12)),
    regression("order-eq8", "fails", 1.5, "", (0.9, 1.1), band=Band(0.01, "fit")),
    Finding(id="order-bad", title="is not a number", value=math.nan, unit="", kind="regression", admissible=(0.9, 1.1)),
    Finding(id="vectors-x", title="missing", value=None, unit="", kind="regression", note="x: failed\x00 & <burst>"),
    Finding(id="difference-a-b", title="apart", value=math.inf, unit="of ω₀", kind="observation", note="late"),
    Finding(id="limit-a", title="none", value=None, unit="", kind="observation", note="no order"),
)


def problems(part, value):
    """Return what a part of the schema says against a value."""
    schema = {"$schema": SCHEMA["$schema"], "$ref": f"#/$defs/{part}", "$defs": SCHEMA["$defs"]}
    return [error.message for error in jsonschema.Draft202012Validator(schema).iter_errors(value)]


def test_the_schema_is_a_schema_and_names_its_version():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert SCHEMA["properties"]["version"]["const"] == SUMMARY_VERSION


def test_the_schema_names_every_rule_of_a_band():
    assert SCHEMA["$defs"]["finding"]["properties"]["band_rule"]["enum"] == [*RULES, None]
    assert SCHEMA["$id"].endswith(f":{SUMMARY_VERSION}")


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.id)
def test_findings_of_every_verdict_fit_the_schema(finding):
    mapping = json.loads(summary_text(finding.to_mapping()))
    assert problems("finding", mapping) == []
    assert {"id", "value", "unit", "band", "threshold", "verdict"} <= set(mapping)


@pytest.mark.parametrize(
    "fault",
    [
        {"id": "has a blank"},
        {"id": ""},
        {"value": "1.5"},
        {"value": None},
        {"verdict": "observed"},
        {"verdict": "maybe"},
        {"kind": "observation"},
        {"admissible": [0.9]},
        {"band": "wide"},
        {"extra": 1},
    ],
    ids=str,
)
def test_the_schema_refuses_what_no_finding_can_be(fault):
    sound = FINDINGS[1].to_mapping()
    assert problems("finding", sound) == []
    assert problems("finding", sound | fault)


@pytest.mark.parametrize("name", ["id", "value", "unit", "band", "threshold", "verdict"])
def test_nothing_that_a_finding_must_have_can_be_left_out(name):
    sound = FINDINGS[1].to_mapping()
    assert problems("finding", {key: value for key, value in sound.items() if key != name})


def test_json_has_no_infinity_and_no_nan():
    found = json_ready(
        {"a": math.nan, "b": [math.inf, (1, -math.inf)], "c": {"d": 1.5, "e": None, "f": PurePosixPath("x")}},
    )
    assert found == {"a": "nan", "b": ["inf", [1, "-inf"]], "c": {"d": 1.5, "e": None, "f": "x"}}
    with pytest.raises(ValueError, match="JSON"):
        summary_text({"a": math.nan})


# ---------------------------------------------------------------------- JUnit


def suite_of(findings):
    (suite,) = ElementTree.fromstring(junit_text(findings).encode())
    return suite


def test_regressions_are_test_cases_and_observations_properties():
    suite = suite_of(FINDINGS)
    assert {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")} == {
        "tests": "4", "failures": "2", "errors": "1", "skipped": "0",
    }  # fmt: skip
    cases = {case.get("name"): case for case in suite.iter("testcase")}
    assert list(cases) == ["ice-eq8", "order-eq8", "order-bad", "vectors-x"]
    assert [child.tag for child in cases["ice-eq8"]] == ["system-out"]
    assert cases["order-eq8"].find("failure").get("message") == "1.50 ± 0.01 (fit), threshold 0.9 to 1.1"
    assert "nan" in cases["order-bad"].find("failure").get("message")
    assert cases["vectors-x"].find("error").get("message") == "x: failed� & <burst>"
    assert {each.get("name") for each in suite.iter("property")} == {"difference-a-b", "limit-a"}


def test_the_order_of_the_elements_is_that_of_the_format():
    suite = suite_of(FINDINGS)
    assert [child.tag for child in suite] == ["properties"] + ["testcase"] * 4
    for case in suite.iter("testcase"):
        assert case.get("classname")
        assert case.get("time") is None
        assert [child.tag for child in case][-1] == "system-out"
        assert len(case) <= 2


def test_the_suite_has_the_time_of_everything():
    (suite,) = ElementTree.fromstring(junit_text(FINDINGS, seconds=90.0).encode())
    assert float(suite.get("time")) == 90.0


def test_a_suite_without_observations_has_no_empty_properties():
    assert suite_of(FINDINGS[:1]).find("properties") is None


# ---------------------------------------------------------------------- ids


def test_two_findings_may_not_share_an_id():
    twice = (FINDINGS[0], replace(FINDINGS[1], id=FINDINGS[0].id))
    told = ChapterResult(chapter=None, study_result=None, findings=twice, figures=(), notes=())
    with pytest.raises(ValueError, match="share an id: ice-eq8"):
        summarise(None, {"ice": told}, {"flipproof": "0"}, {})


# ---------------------------------------------------------------------- CSV


def test_rows_have_nine_digits_and_empty_cells_for_what_is_missing():
    rows = [(1 / 3, None, "a, b", True), (math.nan, math.inf, 7, 1e-300)]
    assert rows_csv(("x [1]", "y [1]", "z", "w"), rows) == ('x [1],y [1],z,w\n0.333333333,,"a, b",yes\n,inf,7,1e-300\n')


def test_columns_of_unequal_length_end_in_empty_cells():
    assert columns_csv({"a [s]": [1.0, 2.0], "b [1]": [3.0]}) == "a [s],b [1]\n1,3\n2,\n"


def test_curves_share_their_times_where_they_can():
    t = np.array([0.0, 0.5, 1.0])
    text = curves_csv(
        {"short [1]": (t[:2], t[:2] + 1), "whole [1]": (t, t + 2), "other [1]": (np.array([0.0, 0.3]), np.zeros(2))}
    )
    assert text.splitlines() == [
        "t [s],short [1],whole [1],t of other [s],other [1]", "0,1,2,0,0", "0.5,1.5,2.5,0.3,0", "1,,3,,",
    ]  # fmt: skip
