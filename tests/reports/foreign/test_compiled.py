"""Solvers in C, asked through files: the right ones pass, and a check tells what a mistake is."""

import shutil
from contextlib import closing

import pytest
from planted.compiled import DECLARED, Compiled, mistakes

from flipproof.foreign.certify import FAILED, PASSED, certify

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")


def result_of(planted, check):
    with closing(planted.runner()) as runner:
        (result,) = certify(runner, [check], equation=DECLARED[planted.base]["equation"]).results
    return result


@pytest.mark.parametrize("check", ["start", "inputs", "order-before-impacts", "angle"])
@pytest.mark.parametrize("base", DECLARED)
def test_right_solvers_in_c_pass(base, check):
    assert result_of(Compiled("", base), check).verdict == PASSED


@pytest.mark.slow
@pytest.mark.parametrize("base", DECLARED)
def test_no_check_accuses_right_solvers_in_c(base):
    with closing(Compiled("", base).runner()) as runner:
        results = certify(runner, equation=DECLARED[base]["equation"]).results
    assert [result.line for result in results if result.verdict == FAILED] == []


@pytest.mark.parametrize(
    ("name", "check", "advice"),
    [
        ("free_in_c_8", "start", "the places of ask.start in another order"),
        ("free_in_c_14", "order-before-impacts", "look at how theta is advanced in a step, and answered"),
        ("free_in_c_20", "refinement", "use ask.effort as dt, or declare no refined_by; if it is used, right"),
        ("eq8_in_c_30", "angle", "the row at the end of the flight alone is wrong"),
        ("eq8_in_c_36", "order-before-impacts", "theta is of that order, and the others follow it through the weight"),
    ],
)
def test_the_check_tells_what_is_wrong(name, check, advice):
    result = result_of(mistakes()[name], check)
    assert result.verdict == FAILED
    assert advice in result.line
