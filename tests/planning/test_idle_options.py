"""Options of planners that would change nothing are refused."""

import pytest

from planning.errors import PlannerError
from planning.loading import load_planner


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "pma-nbo(order=random)",
            "order=random has no effect with coordination 'parallel'; leave it out, or set coordination=sequential",
        ),
        (
            "sma-nbo(samples=5)",
            "samples=5 has no effect with propagation 'nominal'; leave it out, or set propagation=monte-carlo",
        ),
    ],
)
def test_an_option_without_effect_is_an_error(text, says):
    with pytest.raises(PlannerError) as error:
        load_planner(text)
    assert str(error.value).endswith(says)


@pytest.mark.parametrize(
    "text", ["sma-nbo(order=random)", "mcr(samples=5)", "sma-nbo(propagation=monte-carlo, samples=5)"]
)
def test_the_same_with_effect_is_not(text):
    assert callable(load_planner(text).plan)
